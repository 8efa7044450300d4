"""Report pages that operations write: of a calibration, of a plan, of a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from robotrue.app.toolpath_sides import SideDocument, SidesDocument
from robotrue.calibration.model import ErrorModel, provenance_of
from robotrue.cell.cell import Cell
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import DEG, MM
from robotrue.planning.pose_plan import PosePlan
from robotrue.report.calibration_report import calibration_content
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.curve_plots import PoseCurves, PoseSeries
from robotrue.report.labels import axis_columns
from robotrue.report.map_plots import SideContour
from robotrue.report.page import report_html
from robotrue.report.warning_groups import group_unseen, without_unseen
from robotrue.robot.configuration import controller_axes
from robotrue.validation.contest import Selection
from robotrue.validation.report import ValidationReport


def write_calibration_page(
    path: Path,
    model: ErrorModel,
    result: ValidationReport,
    *,
    title: str,
    measured: Provenance,
    selection: Selection | None = None,
) -> None:
    """Writes one validation as a self-contained HTML page.

    Args:
        path: To be written.
        model: That was checked.
        result: Of the check.
        title: Heading.
        measured: Provenance of the poses it was checked on.
        selection: Why this method, if it was chosen automatically.

    Raises:
        FormatError: The file cannot be written.
    """
    summary = model.training_summary()
    sources = summary.sources
    origin = merge([provenance_of(model), measured])
    content = calibration_content(
        replace(result, doubts=without_unseen(model, result.doubts)),
        title=title,
        simulated=origin.simulated,
        subtitle=f"{result.robot}, method {summary.method or 'unknown'}",
        selection=selection,
        unseen=group_unseen(model),
        provenance=[
            Fact(name="training data", value=summary.data_sha256 or "not recorded"),
            *(Fact(name="measured", value=source) for source in sources),
        ],
    )
    write_atomic(path, report_html(content).encode("utf-8"))


FIRST = 4
"""Poses from which the curve is drawn: fewer do not fix base and tool."""


def plan_page(cell: Cell, plan: PosePlan, origin: Provenance) -> str:
    """Returns the page (HTML); ``origin`` is that of the model the plan starts from."""
    n, expected = len(plan), plan.expected
    return report_html(
        ReportContent(
            title=f"Poses to measure: {cell.robot.name}",
            verdict=Conclusion(
                text=f"{n} poses, expected mean error {expected.mean[n] / MM:.3f} mm where the "
                "arm will work.",
                detail=f"Criterion {plan.criterion}; as many random poses "
                f"{expected.random_mean[n] / MM:.3f} mm.",
            ),
            simulated=origin.simulated,
            subtitle="a plan, before any measurement",
            tiles=(
                KeyFigure(label="planned", value=float(expected.mean[n] / MM), unit="mm"),
                KeyFigure(label="random", value=float(expected.random_mean[n] / MM), unit="mm"),
                KeyFigure(label="floor", value=expected.floor_mean / MM, unit="mm"),
            ),
            sections=(
                Section(title="Accuracy", blocks=(draw_accuracy_curve(plan),)),
                Section(title="Candidates", blocks=(_list_rejected(plan),)),
                Section(title="Poses", blocks=(_list_poses(cell, plan),)),
            ),
            doubts=plan.notes,
            provenance=(
                Fact(name="cell", value=f"{cell.source} sha256:{cell.digest}"),
                Fact(name="seed", value=str(plan.seed)),
            ),
        )
    )


def draw_accuracy_curve(plan: PosePlan) -> PoseCurves:
    """The expected error against the number of poses, planned and at random."""
    n, expected = len(plan), plan.expected
    counts = np.arange(min(FIRST, n), n + 1)
    poses_axis = counts.astype(np.float64)
    return PoseCurves(
        series=(
            PoseSeries(
                label="planned", count=poses_axis, median=expected.mean[counts], role="ours"
            ),
            PoseSeries(
                label="random, from the same candidates",
                count=poses_axis,
                median=expected.random_mean[counts],
                low=expected.random_low[counts],
                high=expected.random_high[counts],
            ),
        ),
        floor=expected.floor_mean,
        title="Expected mean error against the number of poses",
        caption="From the arm's type and the instrument only; no measurements.",
    )


def _list_rejected(plan: PosePlan) -> ReportTable:
    return ReportTable(
        title="Reasons of rejected postures",
        columns=(TableColumn(title="reason"), TableColumn(title="postures", digits=0)),
        rows=(*plan.rejected, ("kept as candidates", plan.candidates), ("drawn", plan.drawn)),
    )


def _list_poses(cell: Cell, plan: PosePlan) -> ReportTable:
    axes = controller_axes(cell.robot, plan.joints) / DEG
    return ReportTable(
        title="The poses, in the order of measuring",
        columns=(
            TableColumn(title="pose"),
            *axis_columns(cell.robot.dof),
            *(TableColumn(title=axis, unit="mm", digits=1) for axis in "xyz"),
            TableColumn(title="load"),
            TableColumn(title="benefit, place"),
        ),
        rows=tuple(
            (
                k + 1,
                *map(float, axes[k]),
                *(float(v) for v in plan.position[k] / MM),
                int(plan.load[k]),
                int(plan.rank[k]) + 1,
            )
            for k in range(len(plan))
        ),
        caption="Joints in the sense of the robot model; x, y, z as the controller computes them.",
    )


class ProgramDocument(SidesDocument):
    """The JSON document of ``robotrue program``.

    Further keys: the program, the file of its identity, what its compensation came to, notes.
    """

    output: str
    identity: object
    compensation: Mapping[str, object] | None
    notes: list[str]


def program_page(cell: Cell, document: ProgramDocument, *, simulated: bool) -> str:
    """Returns the page (HTML) of the JSON document of ``robotrue program``."""
    sides = document["sides"]
    made = document["compensation"]
    name = Path(document["output"]).name
    sections = [Section(title="Sides", blocks=(_sides(sides),))]
    contours = tuple(
        SideContour(
            title=f"{side['name']}, {side['pass']}",
            caption="The outer boundary of the part's shadow along the tool axis; points that cut "
            "lie inside.",
            outlines=tuple(np.array(each) * MM for each in side["contour"]["outlines_mm"]),
            cuts=np.array(side["contour"]["cuts_mm"]) * MM,
        )
        for side in sides
        if side["contour"] is not None
    )
    if contours:
        sections.append(Section(title="Largest contour of each side", blocks=contours))
    words = [
        (side["source"], w["line"], w["text"]) for side in sides for w in side["unknown_words"]
    ]
    if words:
        table = ReportTable(
            title="Unknown statements",
            columns=(
                TableColumn(title="file"),
                TableColumn(title="line"),
                TableColumn(title="statement"),
            ),
            rows=tuple(words),
            caption="They are comments in the program; no motion.",
        )
        sections.append(Section(title="Words", blocks=(table,)))
    total = sum(side["duration_s"] for side in sides)
    return report_html(
        ReportContent(
            title=f"Program {name}",
            verdict=Conclusion(
                text=f"{document['targets']} targets on {len(sides)} "
                f"side{'' if len(sides) == 1 else 's'}, all within reach.",
                detail="compensated: "
                + (f"{made['compensated']} targets" if made else "not yet; robotrue compensate"),
            ),
            simulated=simulated,
            subtitle=cell.robot.name,
            tiles=(
                KeyFigure(label="cut", value=sum(s["cut_mm"] for s in sides) / 1e3, unit="m"),
                KeyFigure(label="time at the stated feeds", value=total / 60.0, unit="min"),
                KeyFigure(
                    label="nearest to a joint limit",
                    value=min(s["limit_margin_deg"] for s in sides),
                    unit="deg",
                ),
            ),
            sections=tuple(sections),
            doubts=tuple(document["notes"]),
            provenance=(Fact(name="cell", value=f"{cell.source} sha256:{cell.digest}"),),
        )
    )


def _sides(sides: Sequence[SideDocument]) -> ReportTable:
    return ReportTable(
        title="Sides in the order they are cut",
        columns=(
            TableColumn(title="side"),
            TableColumn(title="pass"),
            TableColumn(title="stock", unit="mm", digits=2),
            TableColumn(title="part frame"),
            TableColumn(title="points", digits=0),
            TableColumn(title="cut", unit="mm", digits=0),
            TableColumn(title="time", unit="s", digits=0),
            TableColumn(title="spin from", unit="deg", digits=1),
            TableColumn(title="spin to", unit="deg", digits=1),
            TableColumn(title="to a joint limit", unit="deg", digits=1),
            TableColumn(title="wrist", unit="deg", digits=1),
        ),
        rows=tuple(
            (
                side["name"],
                side["pass"],
                side["stock_mm"],
                side["part"] or "[base]",
                side["points"],
                side["cut_mm"],
                side["duration_s"],
                side["spin_deg"][0],
                side["spin_deg"][1],
                side["limit_margin_deg"],
                side["wrist_angle_deg"],
            )
            for side in sides
        ),
        caption="Spin: rotation about the tool axis, from a frame carried along the path. Wrist: "
        "smallest angle between axes 4 and 6.",
    )
