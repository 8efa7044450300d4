"""The report of a calibration: a validation, in the words and tables of a measurement room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import DEG, MM
from robotrue.report.content import (
    Cell,
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
    Tone,
)
from robotrue.report.labels import (
    axis_columns,
    column,
    columns,
    fact,
    per_axis_table,
    plain_columns,
    statistics_table,
    tile,
    versions,
)
from robotrue.report.plots import CoveragePlot, ErrorDistribution, ErrorMap, Plane, PointErrors
from robotrue.report.words import Lang, ReportTexts
from robotrue.validation.contest import Selection
from robotrue.validation.metrics import wilson_interval
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
    lang: Lang = DEFAULT_LANG,
) -> ReportContent:
    """Returns the content of a page about one validation.

    Args:
        report: From :func:`robotrue.validation.validate.validate`.
        title: Heading.
        simulated: True if the measurements come from a simulated robot.
        subtitle: Robot, cell, date.
        selection: Why this method, if it was chosen automatically.
        tolerance: m; the verdict then states whether 95 % of the poses meet it.
        unseen: What the data cannot determine, from the calibration.
        provenance: Data hashes, settings, conditions; versions are added.
        lang: Language of the page.
    """
    t = ReportTexts(lang=lang)
    # A model's warnings may quote undetermined parameters; the page shows each sentence once.
    doubts = tuple(d for d in report.doubts if not any(u.rstrip(".") in d for u in unseen))
    sections = [_accuracy(report, tolerance, t), _uncertainty(report, t), _places(report, t)]
    if selection is not None:
        sections.append(contest_section(selection))
    return ReportContent(
        title=title,
        subtitle=subtitle,
        simulated=simulated,
        verdict=_verdict(report, tolerance, len(doubts), t),
        tiles=_tiles(report, t),
        sections=tuple(sections),
        unseen=tuple(map(t.sentence, unseen)),
        doubts=tuple(map(t.sentence, doubts)),
        provenance=(
            *provenance,
            *versions(),
            *(fact(t, "fact.note", t.sentence(note)) for note in report.notes),
        ),
        lang=lang,
    )


def _verdict(
    report: ValidationReport, tolerance: float | None, doubts: int, t: ReportTexts
) -> Conclusion:
    after, before = report.after, report.before
    text = t("cal.verdict", mean=after.mean / MM, max=after.max / MM)
    tone: Tone = "good"
    if after.mean >= before.mean or (
        report.before_aligned is not None and after.mean >= report.before_aligned.mean
    ):
        tone = "bad"
        text = t("cal.no_better", mean=after.mean / MM)
    elif tolerance is not None:
        kept = after.p95 <= tolerance
        tone = "good" if kept else "bad"
        key = "cal.kept" if kept else "cal.not_kept"
        text = t(key, p95=after.p95 / MM, tolerance=tolerance / MM)
    elif doubts:
        tone = "caution"
    aligned = report.before_aligned
    key, size = ("cal.detail", before) if aligned is None else ("cal.detail_aligned", aligned)
    detail = t(key, n=after.n, mean=size.mean / MM)
    if doubts:
        detail += " " + t("cal.doubts" if doubts > 1 else "cal.doubt", n=doubts)
    return Conclusion(text=text, tone=tone, detail=detail)


def _tiles(report: ValidationReport, t: ReportTexts) -> tuple[KeyFigure, ...]:
    inside = report.coverage
    before, after = report.before_aligned or report.before, report.after
    shown = (
        ("cal.mean_error", after.mean, before.mean, t("cal.poses", n=after.n)),
        ("cal.p95", after.p95, before.p95, ""),
        ("cal.largest", after.max, before.max, ""),
    )
    return (
        *(tile(t, key, a / MM, _MM, before=b / MM, note=note) for key, a, b, note in shown),
        tile(
            t,
            "cal.hold",
            100.0 * inside.share,
            "%",
            digits=1,
            note=t("cal.interval", low=100 * inside.low, high=100 * inside.high),
            tone="good" if inside.is_honest else "caution",
        ),
    )


def _accuracy(report: ValidationReport, tolerance: float | None, t: ReportTexts) -> Section:
    rows = [(t("cal.computed"), report.before)]
    if report.before_aligned is not None:
        rows.append((t("cal.aligned"), report.before_aligned))
    rows.append((t("cal.calibrated"), report.after))
    before = np.linalg.norm(report.errors_before, axis=1)
    after = np.linalg.norm(report.errors_after, axis=1)
    tables = [
        statistics_table(t("cal.table"), rows, words=t),
        per_axis_table(t("cal.axis_table"), rows, words=t),
    ]
    if report.axis_before is not None:
        tables.append(_angles_table(report.axis_before, report.axis_after, t))
    return Section(
        title=t("cal.section"),
        text=t("cal.section_text"),
        blocks=(
            *tables,
            PointErrors(
                before=before,
                after=after,
                axis_label=t("pose"),
                limit=tolerance,
                title=t("cal.points_title"),
            ),
            ErrorDistribution(before=before, after=after, title=t("cal.distribution")),
        ),
    )


def _angles_table(before: AxisAngles, after: AxisAngles | None, t: ReportTexts) -> ReportTable:
    rows: list[tuple[Cell, ...]] = []
    for name, angles in ((t("cal.computed"), before), (t("cal.calibrated"), after)):
        if angles is None:
            rows.append((name, None, None, None, None))
        else:
            values = (angles.mean, angles.p95, angles.max)
            rows.append((name, angles.n, *(value / DEG for value in values)))
    return ReportTable(
        title=t("cal.angles"),
        columns=(
            TableColumn(title=""),
            column(t, "n"),
            *columns(t, "mean", "p95", "max", unit="deg"),
        ),
        rows=tuple(rows),
        caption=t("cal.angles_text"),
    )


def _uncertainty(report: ValidationReport, t: ReportTexts) -> Section:
    inside = report.coverage
    levels = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
    counts = [int((report.probability <= level).sum()) for level in levels]
    bounds = np.array([wilson_interval(count, inside.n) for count in counts])
    shares = (inside.share, *inside.axis_share)
    return Section(
        title=t("cal.uncertainty"),
        text=t("cal.uncertainty_text"),
        blocks=(
            CoveragePlot(
                stated=levels,
                observed=np.array(counts) / inside.n,
                low=bounds[:, 0],
                high=bounds[:, 1],
                title=t("cal.honesty"),
                caption=t("cal.coverage_text"),
            ),
            ReportTable(
                title=t("cal.shares"),
                columns=(
                    column(t, "cal.3d", "%", 1),
                    *(column(t, "cal.alone", "%", 1, axis=axis) for axis in "xyz"),
                    *columns(t, "cal.3d_from", "cal.3d_to", unit="%", digits=1),
                ),
                rows=(tuple(100.0 * float(s) for s in (*shares, inside.low, inside.high)),),
            ),
        ),
    )


def _places(report: ValidationReport, t: ReportTexts) -> Section:
    spread = np.ptp(report.position, axis=0)
    planes: tuple[Plane, ...] = ("yz", "xz", "xy")
    plane = planes[int(np.argmin(spread))]
    return Section(
        title=t("cal.places"),
        blocks=(
            ErrorMap(
                position=report.position,
                before=report.errors_before,
                after=report.errors_after,
                plane=plane,
                magnification=100.0,
                title=t("cal.map"),
            ),
            ReportTable(
                title=t("cal.worst"),
                columns=(
                    *columns(t, "cal.set", "cal.line"),
                    *columns(t, "before", "after", unit=_MM),
                    column(t, "cal.region", "%", 1),
                    *axis_columns(len(report.worst[0].axes)),
                ),
                rows=tuple(
                    (
                        point.group,
                        point.source_row,
                        point.before / MM,
                        float(np.linalg.norm(point.after)) / MM,
                        100.0 * point.probability,
                        *(float(q) / DEG for q in point.axes),
                    )
                    for point in report.worst
                ),
                caption=t("cal.worst_text"),
            ),
        ),
    )


def contest_section(
    selection: Selection,
    *,
    title: str = "Selection of the method",
    heading: str = "Methods on held-out poses",
) -> Section:
    """Returns the chapter with the best method on held-out poses, its margin, and the rule."""
    rows: list[tuple[Cell, ...]] = []
    kinds = list(dict.fromkeys(k for s in selection.table for k in s.mean_by_kind))
    kinds = kinds if len(kinds) > 1 else []  # a single kind equals the mean
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
            ReportTable(
                title=heading,
                columns=(
                    *plain_columns("method"),
                    *plain_columns("mean", *kinds, "max", unit=_MM),
                    *plain_columns("in 95 % region", unit="%", digits=1),
                    *plain_columns("gain", "noise", unit=_MM, digits=4),
                    *plain_columns("result"),
                ),
                rows=tuple(rows),
                caption=f"Rule: {selection.rule}.",
                highlight=names.index(selection.winner),
            ),
        ),
    )
