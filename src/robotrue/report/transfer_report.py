"""The page of a transfer: the source used for the target, and the number of poses it takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotrue.core.units import MM
from robotrue.report.calibration_report import contest_section
from robotrue.report.content import Cell, Fact, KeyFigure, ReportContent, ReportTable, Section, Tone
from robotrue.report.content import Conclusion as Line
from robotrue.report.curve_plots import PoseCurves, PoseSeries
from robotrue.report.labels import plain_columns
from robotrue.validation.contest import CandidateScore, Selection
from robotrue.validation.guard import GuardVerdict
from robotrue.validation.learning_curve import LearningCurve


def transfer_content(
    verdict: GuardVerdict,
    selection: Selection | None,
    curve: LearningCurve | None,
    *,
    title: str,
    subtitle: str,
    simulated: bool,
    doubts: Sequence[str] = (),
    provenance: Sequence[Fact] = (),
) -> ReportContent:
    """Returns the content of a page about one guarded transfer.

    Args:
        verdict: Of the guard.
        selection: The contest on held-out target poses; None if there was none.
        curve: Accuracy against target poses, if it was computed.
        title: Heading.
        subtitle: Robot, sources, target.
        simulated: Whether any number comes from a simulated robot.
        doubts: Of the model, the guard's among them.
        provenance: Hashes, settings.
    """
    sections = []
    if selection is not None:
        sections.append(
            contest_section(
                selection,
                title="Source used for the target",
                heading="Candidates on held-out target poses",
            )
        )
    if curve is not None:
        sections.append(_curve_section(curve, verdict.winner))
    return ReportContent(
        title=title,
        subtitle=subtitle,
        simulated=simulated,
        verdict=_line(verdict, selection),
        tiles=_tiles(verdict, selection),
        sections=tuple(sections),
        doubts=tuple(doubts),
        provenance=tuple(provenance),
    )


def _line(verdict: GuardVerdict, selection: Selection | None) -> Line:
    if selection is None:
        return Line(
            text=f"{verdict.winner} is used; it was not checked against the target.",
            tone="caution",
            detail=f"{verdict.target_rows} target poses; three or more can be held out in turn.",
        )
    score = _score(selection, verdict.winner)
    tone: Tone = "caution" if verdict.doubts else "good"
    text = f"{verdict.winner} is used: {score.mean / MM:.3f} mm on held-out target poses"
    if np.isfinite(verdict.gain):
        against = _score(selection, verdict.against)
        text += f", against {against.mean / MM:.3f} mm from the target poses alone"
    return Line(
        text=text + ".",
        tone=tone,
        detail=(
            f"{verdict.target_rows} target poses, each held out in turn."
            + (
                f" Gain over {verdict.against} {verdict.gain / MM:.4f} mm, "
                f"noise {verdict.noise / MM:.4f} mm."
                if np.isfinite(verdict.gain)
                else ""
            )
        ),
    )


def _score(selection: Selection, name: str) -> CandidateScore:
    return next(score for score in selection.table if score.name == name)


def _tiles(verdict: GuardVerdict, selection: Selection | None) -> tuple[KeyFigure, ...]:
    if selection is None:
        return ()
    score = _score(selection, verdict.winner)
    note = f"{score.n} target poses"
    return (
        KeyFigure(label="mean error, held out", value=score.mean / MM, unit="mm", note=note),
        KeyFigure(label="largest", value=score.max / MM, unit="mm"),
        KeyFigure(
            label="coverage of the stated 95 % regions",
            value=100.0 * score.coverage,
            unit="%",
            digits=1,
        ),
    )


def _curve_section(curve: LearningCurve, winner: str) -> Section:
    plot: PoseCurves = curves_of(
        curve,
        winner,
        title="Accuracy and coverage against the number of target poses",
        caption=(
            f"Median and quartiles of {curve.repeats} random nested subsets, tested on "
            f"{curve.held} target rows used by no candidate."
        ),
    )
    low, median, high = curve.quartiles() / MM
    rows: list[tuple[Cell, ...]] = []
    for c, name in enumerate(curve.names):
        cells = (
            f"{median[c, k]:.3f} [{low[c, k]:.3f}-{high[c, k]:.3f}]"
            if np.isfinite(median[c, k])
            else None
            for k in range(len(curve.counts))
        )
        rows.append((name, *cells))
    table = ReportTable(
        title="Mean error, median [quartiles], mm",
        columns=plain_columns("candidate", *(f"{n} target poses" for n in curve.counts)),
        rows=tuple(rows),
        caption=" ".join(curve.failures),
        highlight=curve.names.index(winner) if winner in curve.names else None,
    )
    return Section(title="Required number of target poses", blocks=(plot, table))


def curves_of(curve: LearningCurve, winner: str, *, title: str, caption: str = "") -> PoseCurves:
    """Returns the plot of a learning curve: medians, quartiles over repeats, coverage."""
    low, median, high = curve.quartiles()
    inside = np.full(median.shape, np.nan)
    known = np.isfinite(median)
    inside[known] = np.nanmedian(curve.coverage[known], axis=1)
    return PoseCurves(
        series=tuple(
            PoseSeries(
                label=name,
                count=curve.counts.astype(np.float64),
                median=median[c],
                low=low[c],
                high=high[c],
                coverage=inside[c],
                role="ours" if name == winner else "peer",
            )
            for c, name in enumerate(curve.names)
        ),
        floor=curve.floor,
        axis_label="target poses",
        title=title,
        caption=caption,
    )
