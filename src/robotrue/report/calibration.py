"""The report of a calibration: a validation, in the words and tables of a measurement room."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.report.content import (
    Cell,
    Column,
    CoveragePlot,
    ErrorDistribution,
    ErrorMap,
    Fact,
    Plane,
    PointErrors,
    ReportContent,
    Section,
    Table,
    Tile,
    Tone,
    Verdict,
)
from robotrue.validation.contest import Selection
from robotrue.validation.metrics import ErrorStatistics, wilson_interval
from robotrue.validation.report import AxisAngles, ValidationReport

_MM = "mm"


def calibration_content(
    report: ValidationReport,
    *,
    title: str,
    simulated: bool,
    subtitle: str = "",
    selection: Selection | None = None,
    tolerance: float | None = None,
    unseen: Sequence[str] = (),
    provenance: Sequence[Fact] = (),
) -> ReportContent:
    """Returns the content of a page about one validation.

    Args:
        report: From :func:`robotrue.validation.validate.validate`.
        title: Heading.
        simulated: True if the measurements come from a simulated robot.
        subtitle: Robot, cell, date.
        selection: Why this method, if it was chosen automatically.
        tolerance: m; the verdict then says whether 95 % of the poses keep it.
        unseen: What the data cannot determine, from the calibration.
        provenance: Data hashes, settings, conditions; versions are added.
    """
    # A model's doubts may quote what it could not see; the page says each thing once.
    doubts = tuple(d for d in report.doubts if not any(u.rstrip(".") in d for u in unseen))
    sections = [_accuracy(report, tolerance), _uncertainty(report), _places(report)]
    if selection is not None:
        sections.append(contest_section(selection))
    return ReportContent(
        title=title,
        subtitle=subtitle,
        simulated=simulated,
        verdict=_verdict(report, tolerance, len(doubts)),
        tiles=_tiles(report),
        sections=tuple(sections),
        unseen=tuple(unseen),
        doubts=doubts,
        provenance=(*provenance, *_versions(), *(Fact(name="note", value=n) for n in report.notes)),
    )


def _verdict(report: ValidationReport, tolerance: float | None, doubts: int) -> Verdict:
    after, before = report.after, report.before
    text = (
        f"Predicts where the robot really goes within {after.mean / MM:.3f} mm on average, "
        f"{after.max / MM:.3f} mm at worst."
    )
    tone: Tone = "good"
    if after.mean >= before.mean or (
        report.before_aligned is not None and after.mean >= report.before_aligned.mean
    ):
        tone = "bad"
        text = f"No better than a frame correction: {after.mean / MM:.3f} mm on average."
    elif tolerance is not None:
        kept = after.p95 <= tolerance
        tone = "good" if kept else "bad"
        text = (
            f"95 % of the poses are predicted within {after.p95 / MM:.3f} mm: the tolerance of "
            f"{tolerance / MM:g} mm is {'kept' if kept else 'NOT kept'}."
        )
    elif doubts:
        tone = "caution"
    detail = f"{after.n} poses; without calibration {before.mean / MM:.3f} mm on average."
    if doubts:
        detail += f" {doubts} doubt{'s' if doubts > 1 else ''} below."
    return Verdict(text=text, tone=tone, detail=detail)


def _tiles(report: ValidationReport) -> tuple[Tile, ...]:
    before, after, inside = report.before, report.after, report.coverage
    return (
        _tile("mean error", after.mean, before.mean, f"{after.n} poses"),
        _tile("95 % of poses below", after.p95, before.p95),
        _tile("largest error", after.max, before.max),
        Tile(
            label="stated 95 % regions hold",
            value=100.0 * inside.share,
            unit="%",
            digits=1,
            note=f"interval {100 * inside.low:.1f} to {100 * inside.high:.1f} %",
            tone="good" if inside.is_honest else "caution",
        ),
    )


def _tile(label: str, value: float, before: float, note: str = "") -> Tile:
    return Tile(label=label, value=value / MM, unit=_MM, before=before / MM, note=note)


def _accuracy(report: ValidationReport, tolerance: float | None) -> Section:
    rows = [("as the controller computes", report.before)]
    if report.before_aligned is not None:
        rows.append(("base and tool aligned", report.before_aligned))
    rows.append(("with this calibration", report.after))
    before = np.linalg.norm(report.errors_before, axis=1)
    after = np.linalg.norm(report.errors_after, axis=1)
    tables = [
        statistics_table("Position error before and after", rows),
        per_axis_table("Position error along each axis", rows),
    ]
    if report.axis_before is not None:
        tables.append(_angles_table(report.axis_before, report.axis_after))
    return Section(
        title="Before and after",
        text=(
            "Distance between where the instrument saw the tool point and where it was expected. "
            "Prediction errors: the robot was not moved again."
        ),
        blocks=(
            *tables,
            PointErrors(before=before, after=after, axis_label="pose", limit=tolerance),
            ErrorDistribution(before=before, after=after),
        ),
    )


def statistics_table(
    title: str, rows: Sequence[tuple[str, ErrorStatistics]], *, caption: str = ""
) -> Table:
    """Returns a table of named statistics: n, mean, sd, 95 %, max, mean + 3 sd, RMS in mm."""
    names = ("mean", "sd", "95 %", "max", "mean + 3 sd", "RMS")
    return Table(
        title=title,
        columns=(Column(title=""), Column(title="n"), *(Column(title=t, unit=_MM) for t in names)),
        rows=tuple(
            (name, s.n, *(v / MM for v in (s.mean, s.std, s.p95, s.max, s.three_sigma, s.rms)))
            for name, s in rows
        ),
        caption=caption,
        highlight=len(rows) - 1,
    )


def per_axis_table(title: str, rows: Sequence[tuple[str, ErrorStatistics]]) -> Table:
    """Returns a table of signed mean, standard deviation and largest value per base axis in mm."""
    columns = [Column(title="")]
    for quantity in ("mean", "sd", "max"):
        columns += [Column(title=f"{quantity} {axis}", unit=_MM) for axis in "xyz"]
    return Table(
        title=title,
        columns=tuple(columns),
        rows=tuple(
            (name, *(float(v) / MM for v in (*s.axis_mean, *s.axis_std, *s.axis_max)))
            for name, s in rows
        ),
        highlight=len(rows) - 1,
    )


def _angles_table(before: AxisAngles, after: AxisAngles | None) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, angles in (("as the controller computes", before), ("with this calibration", after)):
        if angles is None:
            rows.append((name, None, None, None, None))
        else:
            values = (angles.mean, angles.p95, angles.max)
            rows.append((name, angles.n, *(value / DEG for value in values)))
    return Table(
        title="Angle of the tool axis",
        columns=(
            Column(title=""),
            Column(title="n"),
            *(Column(title=t, unit="deg") for t in ("mean", "95 %", "max")),
        ),
        rows=tuple(rows),
        caption="The constant rotation of the target on the tool is left out.",
    )


def _uncertainty(report: ValidationReport) -> Section:
    inside = report.coverage
    levels = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
    counts = [int((report.probability <= level).sum()) for level in levels]
    bounds = np.array([wilson_interval(count, inside.n) for count in counts])
    shares = (inside.share, *inside.axis_share)
    return Section(
        title="Stated uncertainty",
        text=(
            "Every prediction states a region that should hold the true point with a given "
            "probability. Here is how many it held."
        ),
        blocks=(
            CoveragePlot(
                stated=levels,
                observed=np.array(counts) / inside.n,
                low=bounds[:, 0],
                high=bounds[:, 1],
                caption=(
                    "Below the dashed line the model claims too much; above it, too little. The "
                    "band is what this number of poses can tell."
                ),
            ),
            Table(
                title="Share of poses inside their stated 95 % regions",
                columns=tuple(
                    Column(title=t, unit="%", digits=1)
                    for t in ("3-D", "x alone", "y alone", "z alone", "3-D from", "3-D to")
                ),
                rows=(tuple(100.0 * float(s) for s in (*shares, inside.low, inside.high)),),
            ),
        ),
    )


def _places(report: ValidationReport) -> Section:
    spread = np.ptp(report.position, axis=0)
    planes: tuple[Plane, ...] = ("yz", "xz", "xy")
    plane = planes[int(np.argmin(spread))]
    dof = len(report.worst[0].joints)
    joints = tuple(Column(title=f"J{i + 1}", unit="deg", digits=2) for i in range(dof))
    return Section(
        title="Where it misses",
        blocks=(
            ErrorMap(
                position=report.position,
                before=report.errors_before,
                after=report.errors_after,
                plane=plane,
                magnification=100.0,
            ),
            Table(
                title="Worst points",
                columns=(
                    Column(title="set"),
                    Column(title="line"),
                    Column(title="before", unit=_MM),
                    Column(title="after", unit=_MM),
                    Column(title="region", unit="%", digits=1),
                    *joints,
                ),
                rows=tuple(
                    (
                        point.group,
                        point.source_row,
                        point.before / MM,
                        float(np.linalg.norm(point.after)) / MM,
                        100.0 * point.probability,
                        *(float(q) / DEG for q in point.joints),
                    )
                    for point in report.worst
                ),
                caption=(
                    "Line of the source file. Region: the smallest stated region that holds the "
                    "point; near 100 % means the model did not expect it. Look at these rows first."
                ),
            ),
        ),
    )


def contest_section(
    selection: Selection,
    *,
    title: str = "Why this method",
    heading: str = "Methods on held-out poses",
) -> Section:
    """Returns the chapter that says who won on held-out poses, by how much, and the rule."""
    rows: list[tuple[Cell, ...]] = []
    kinds = list(dict.fromkeys(k for s in selection.table for k in s.mean_by_kind))
    kinds = kinds if len(kinds) > 1 else []  # one kind alone says what the mean says
    first = next(s for s in selection.table if not s.failure)
    for score in selection.table:
        if score.failure:
            rows.append((score.name, *([None] * (len(kinds) + 5)), score.failure))
            continue
        contest, used = np.isfinite(score.gain), score.name == selection.winner
        rows.append(
            (
                score.name,
                score.mean / MM,
                *(score.mean_by_kind[kind] / MM for kind in kinds),
                score.max / MM,
                100.0 * score.coverage,
                score.gain / MM if contest else None,
                score.noise / MM if contest else None,
                "used" if used else "falls back" if not contest and score is not first else "",
            )
        )
    names = [score.name for score in selection.table]
    return Section(
        title=title,
        text=selection.reason,
        blocks=(
            Table(
                title=heading,
                columns=(
                    Column(title="method"),
                    Column(title="mean", unit=_MM),
                    *(Column(title=kind, unit=_MM) for kind in kinds),
                    Column(title="max", unit=_MM),
                    Column(title="in 95 % region", unit="%", digits=1),
                    Column(title="gain", unit=_MM, digits=4),
                    Column(title="noise", unit=_MM, digits=4),
                    Column(title="result"),
                ),
                rows=tuple(rows),
                caption=f"Rule: {selection.rule}.",
                highlight=names.index(selection.winner),
            ),
        ),
    )


def _versions() -> tuple[Fact, ...]:
    return (
        Fact(name="robotrue", value=version("robotrue")),
        Fact(name="numpy", value=np.__version__),
        Fact(name="python", value=platform.python_version()),
    )
