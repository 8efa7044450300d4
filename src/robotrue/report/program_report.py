"""The report of a program: predicted errors before and after, and GO or NO-GO by a stated rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.compensation.difference import Difference
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import MM
from robotrue.errors import ModelMismatchError
from robotrue.report.content import (
    Cell,
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    finite_or_none,
)
from robotrue.report.labels import column, columns, statistics_table, tile, versions
from robotrue.report.plots import PointErrors
from robotrue.report.words import Lang, ReportTexts
from robotrue.validation.conformity import Conformity, all_conform, conformity, to_judge
from robotrue.validation.error_map import radius_95
from robotrue.validation.metrics import error_statistics

MOST_WORST: Final = 20
_MM: Final = "mm"
_STATES: Final = ("prog.conforms", "prog.undecided", "prog.fails", "prog.unknown")


def program_content(
    found: Sequence[tuple[str, Difference]],
    *,
    robot: str,
    before: str,
    after: str,
    tolerance: float,
    simulated: bool,
    doubts: Sequence[str] = (),
    provenance: Sequence[Fact] = (),
    lang: Lang = DEFAULT_LANG,
    strict: bool = False,
) -> ReportContent:
    """Returns the content of a report about a compensated program.

    Args:
        found: Name and difference of each file of the job, with predicted errors.
        robot: Name of the arm.
        before: Name of the first program.
        after: Name of the second.
        tolerance: m, largest distance of a target from where it should be.
        simulated: Whether the model was made from simulated data.
        doubts: Of the model.
        provenance: Files and hashes.
        lang: Language of the report.
        strict: Whether axis targets count as targets that are not proven.

    Raises:
        ModelMismatchError: Differences without predicted errors, or no target with one.
        ConfigurationError: A tolerance that is not above zero.
    """
    t = ReportTexts(lang=lang)
    joined = _join_targets(found, strict=strict)
    states = conformity(joined.after, joined.bound, tolerance)
    not_proven = int((states != Conformity.CONFORMS).sum())
    go = all_conform(states)
    text = (
        t("prog.go", tolerance=tolerance / MM)
        if go
        else t("prog.no_go", n=not_proven, targets=len(states), tolerance=tolerance / MM)
    )
    return ReportContent(
        title=t("prog.title", name=after),
        subtitle=t("prog.subtitle", before=before, after=after, robot=robot),
        simulated=simulated,
        verdict=Conclusion(
            text=text,
            tone="good" if go else "bad",
            detail=t("prog.rule") + _apart(joined, t),
        ),
        tiles=_tiles(joined, states, t),
        sections=(
            _before_after(joined, tolerance, t),
            _decision(joined, states, tolerance, t),
        ),
        doubts=(t("prog.predicted"), t("prog.each"), *map(t.sentence, doubts)),
        provenance=(*provenance, *versions()),
        lang=lang,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Targets:
    """Targets of all files in one; lengths in m, NaN where nothing was predicted."""

    file: tuple[str, ...]
    line: IntArray
    line_after: IntArray
    shift: Array
    error_before: Array
    error_after: Array
    bound: Array
    axis_targets: int

    @property
    def before(self) -> Array:
        return np.asarray(np.linalg.norm(self.error_before, axis=1))

    @property
    def after(self) -> Array:
        return np.asarray(np.linalg.norm(self.error_after, axis=1))

    @property
    def known(self) -> BoolArray:
        return np.asarray(np.isfinite(self.before + self.after + self.bound))


def _apart(joined: _Targets, t: ReportTexts) -> str:
    """Returns the sentence about targets that were not checked."""
    return "" if not joined.axis_targets else t("prog.apart", n=joined.axis_targets)


def _join_targets(found: Sequence[tuple[str, Difference]], *, strict: bool) -> _Targets:
    for name, one in found:
        if len(one.change) and not one.has_errors:
            raise ModelMismatchError(
                f"{name}: no predicted errors.", hint="compare with a model: --model MODEL"
            )
    parts = [one for _, one in found if len(one.change)]
    if not parts:
        raise ModelMismatchError("no targets to check.", hint="check the programs.")
    shift = np.concatenate([one.shift for one in parts])
    axis = ~to_judge(np.concatenate([one.axis_target for one in parts]), strict=strict)
    covariance = np.concatenate([one.covariance for one in parts])[~axis]
    bound = radius_95(covariance)
    names = np.array([name for name, one in found for _ in range(len(one.change))])
    joined = _Targets(
        file=tuple(names[~axis].tolist()),
        line=np.concatenate([one.line for one in parts])[~axis],
        line_after=np.concatenate([one.line_after for one in parts])[~axis],
        shift=np.linalg.norm(shift[~axis], axis=1),
        error_before=np.concatenate([one.error_before for one in parts])[~axis],
        error_after=np.concatenate([one.error_after for one in parts])[~axis],
        bound=bound,
        axis_targets=int(axis.sum()),
    )
    if not joined.known.any():
        raise ModelMismatchError(
            "no target has a predicted error: none is a pose the arm can take.",
            hint="check tool, frames and robot of the cell.",
        )
    return joined


def _tiles(joined: _Targets, states: IntArray, t: ReportTexts) -> tuple[KeyFigure, ...]:
    known = joined.known
    before, after, bound = joined.before[known], joined.after[known], joined.bound[known]
    moved = joined.shift[np.isfinite(joined.shift)]
    largest = float(moved.max()) / MM if len(moved) else 0.0
    proven = 100.0 * float((states == Conformity.CONFORMS).mean())
    worst_before, worst = (float((e + bound).max()) / MM for e in (before, after))
    return (
        tile(t, "prog.tile_after", float(after.mean()) / MM, _MM, before=float(before.mean()) / MM),
        tile(t, "prog.tile_worst", worst, _MM, before=worst_before),
        tile(t, "prog.tile_proven", proven, "%", digits=1),
        tile(t, "prog.tile_changed", largest, _MM),
    )


def _before_after(joined: _Targets, tolerance: float, t: ReportTexts) -> Section:
    known = joined.known
    rows = [
        (t("prog.row_before"), error_statistics(joined.error_before[known])),
        (t("prog.row_after"), error_statistics(joined.error_after[known])),
    ]
    before, after = joined.before[known], joined.after[known]
    return Section(
        title=t("prog.section"),
        text=t("prog.section_text"),
        blocks=(
            statistics_table(t("prog.table"), rows, words=t),
            PointErrors(
                before=before,
                after=after,
                axis_label=t("prog.target"),
                limit=tolerance,
                title=t("prog.points"),
                caption=t("prog.points_text"),
            ),
        ),
    )


def _decision(joined: _Targets, states: IntArray, tolerance: float, t: ReportTexts) -> Section:
    first = conformity(joined.before, joined.bound, tolerance)
    counts = ReportTable(
        title=t("prog.counts"),
        columns=columns(t, "prog.state", "prog.before", "prog.after"),
        rows=(
            *(
                (t(name), int((first == k).sum()), int((states == k).sum()))
                for k, name in enumerate(_STATES)
            ),
            (t("prog.axis"), joined.axis_targets, joined.axis_targets),
        ),
        caption=t("prog.counts_text"),
    )
    total = np.where(joined.known, joined.after + joined.bound, np.inf)
    programs = [] if len(set(joined.file)) < 2 else [_programs_table(joined, states, total, t)]
    order = np.argsort(-total, kind="stable")[:MOST_WORST]
    worst = ReportTable(
        title=t("prog.worst"),
        columns=(
            *columns(t, "prog.file", "prog.line", "prog.line_after"),
            *columns(t, "prog.shift", "prog.error_before", "prog.error_after", unit=_MM),
            *columns(t, "prog.bound", "prog.total", unit=_MM),
            column(t, "prog.state"),
        ),
        rows=tuple(_worst_row(joined, int(i), t(_STATES[int(states[i])])) for i in order),
        caption=t("prog.worst_text"),
    )
    return Section(title=t("prog.decision"), text=t("prog.rule"), blocks=(*programs, counts, worst))


def _programs_table(
    joined: _Targets, states: IntArray, total: Array, t: ReportTexts
) -> ReportTable:
    """Returns one row per file: its targets, those that are proven, changes and errors."""
    names = np.array(joined.file)
    rows = []
    for name in dict.fromkeys(joined.file):
        own = names == name
        shift, after = joined.shift[own], joined.after[own]
        sizes = (np.nanmean, shift), (np.nanmax, shift), (np.nanmean, after), (np.max, total[own])
        lengths = (float(size(of)) / MM if np.isfinite(of).any() else np.nan for size, of in sizes)
        proven = int((states[own] == Conformity.CONFORMS).sum())
        rows.append((name, int(own.sum()), proven, *map(finite_or_none, lengths)))
    return ReportTable(
        title=t("prog.programs"),
        columns=(
            *columns(t, "prog.file", "prog.of_file", "prog.proven"),
            *columns(t, "prog.shift", "prog.tile_changed", "prog.error_after", unit=_MM),
            column(t, "prog.total", unit=_MM),
        ),
        rows=tuple(rows),
        caption=t("prog.programs_text"),
    )


def _worst_row(joined: _Targets, i: int, state: str) -> tuple[Cell, ...]:
    before, after, bound = joined.before[i], joined.after[i], joined.bound[i]
    lengths = (joined.shift[i], before, after, bound, after + bound)
    numbers = (finite_or_none(float(length) / MM) for length in lengths)
    return (joined.file[i], int(joined.line[i]), int(joined.line_after[i]), *numbers, state)
