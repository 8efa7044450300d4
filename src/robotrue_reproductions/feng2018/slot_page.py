"""The report page of a simulated slot test: error on each side, the steps, what they cannot see."""

from __future__ import annotations

import numpy as np

from robotrue.core.units import MM
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.page import report_html
from robotrue.report.plots import ErrorMap, PointErrors
from robotrue_reproductions.feng2018.slot_experiment import CHECKED
from robotrue_reproductions.feng2018.slot_trial import SlotTrial

MAGNIFICATION = 100.0


def slot_page(trial: SlotTrial) -> str:
    """Returns the page (HTML)."""
    paper, chosen = trial.paper.slots, trial.chosen.slots
    before, after = (np.abs(s.measured.step).ravel() for s in (paper, chosen))
    sides = tuple(
        ErrorMap(
            position=CHECKED,
            before=paper.error[k],
            after=chosen.error[k],
            plane="xz",
            magnification=MAGNIFICATION,
            frame="part",
            title=f"{name}: before the paper's way, after {trial.chosen.way.name}",
            caption=f"True error of the tip over the block, rms {paper.side_rms[k] / MM:.3f} and "
            f"{chosen.side_rms[k] / MM:.3f} mm.",
        )
        for k, name in enumerate(("First side, from the front", "Second side, from the back"))
    )
    steps = PointErrors(
        before=before,
        after=after,
        title="Step at nine places of four slots",
        caption="Before: the paper's way. What a gauge would read.",
        axis_label="place, slot by slot",
    )
    content = ReportContent(
        title="Two-sided slot test",
        subtitle=f"simulated KR160 and block, cell {trial.seed}",
        simulated=True,
        verdict=Conclusion(
            text=f"Steps of {chosen.mismatch / MM:.3f} mm ({trial.chosen.way.name}); "
            f"{paper.mismatch / MM:.3f} mm the paper's way.",
            detail=f"True error over both sides {chosen.rms / MM:.3f} and {paper.rms / MM:.3f} mm "
            "rms: the steps do not show it all.",
        ),
        tiles=_tiles(trial),
        sections=(
            Section(title="Error of each side", blocks=sides),
            Section(title="The steps", blocks=(steps, _ways(trial))),
            Section(
                title="What the steps cannot see",
                text=" ".join(chosen.evaluation.blind),
                blocks=(_datums(trial),),
            ),
        ),
        provenance=(Fact(name="seed", value=str(trial.seed)),),
    )
    return report_html(content)


def _tiles(trial: SlotTrial) -> tuple[KeyFigure, ...]:
    paper, chosen = trial.paper, trial.chosen
    return (
        KeyFigure(
            label="step of the slots",
            value=chosen.slots.mismatch / MM,
            unit="mm",
            before=paper.slots.mismatch / MM,
        ),
        KeyFigure(
            label="true error, rms",
            value=chosen.slots.rms / MM,
            unit="mm",
            before=paper.slots.rms / MM,
        ),
        KeyFigure(
            label="step of the sculpture",
            value=chosen.outline.mismatch / MM,
            unit="mm",
            before=paper.outline.mismatch / MM,
        ),
    )


def _ways(trial: SlotTrial) -> ReportTable:
    chosen = [t.way.key for t in trial.results].index(trial.chosen.way.key)
    return ReportTable(
        title="Every way on the same cell and the same touches",
        columns=(
            TableColumn(title="way"),
            TableColumn(title="step", unit="mm"),
            TableColumn(title="sd of four", unit="mm"),
            TableColumn(title="rms, first", unit="mm"),
            TableColumn(title="rms, second", unit="mm"),
            TableColumn(title="sculpture", unit="mm"),
        ),
        rows=tuple(
            (
                t.way.name,
                t.slots.mismatch / MM,
                t.slots.evaluation.spread / MM,
                *(v / MM for v in t.slots.side_rms),
                t.outline.mismatch / MM,
            )
            for t in trial.results
        ),
        highlight=chosen,
        caption="Step: what a gauge reads. rms: the truth a real test does not have.",
    )


def _datums(trial: SlotTrial) -> ReportTable:
    return ReportTable(
        title="A datum that was not used for the frame, touched again",
        columns=(
            TableColumn(title="block"),
            TableColumn(title="datum"),
            TableColumn(title="off by", unit="mm"),
            TableColumn(title="the check says"),
        ),
        rows=tuple(
            (where, name, float(off / MM), check.verdict)
            for where, check in (("where it was", trial.rest), ("pushed by 1 mm", trial.knocked))
            for name, off in zip(check.names, check.distance, strict=True)
        ),
        caption="Both halves of a slot stay with the frame: pushing the block makes no step.",
    )
