"""Report of a job of several programs: one row per program, reasons by count, worst targets.

A program is one file, or files that belong together by their names, as a ``.src`` and its ``.dat``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Final, TypeAlias, TypedDict

import numpy as np

from robotrue.app.presentation import Block, Note, Table, count
from robotrue.compensation.result import Compensation
from robotrue.compensation.status import Status, TargetLeftAlone, count_by_kind
from robotrue.core.units import MM
from robotrue.program.lang import find_language
from robotrue.program.program import Program
from robotrue.validation.error_map import radius_95

WORST: Final = 10
"""Targets with the largest predicted errors that are shown."""
COMMON: Final = 5
"""Notes of several programs that are shown once each."""
_PLACE: Final = re.compile(
    r"^(?:\S+:\d+: |lines? [\d, .]+(?: and \d+ more lines| \(\d+ in all\))?: )"
)
_MM_PER_UM: Final = 1e-3
Counts: TypeAlias = Mapping[str, Any]
"""Counts of a compensated file and what was predicted of it: JSON values."""


class ProgramRow(TypedDict):
    """One program, for JSON: targets that moves go to, lengths of its path, sizes in mm."""

    file: str
    language: str
    targets: int
    compensated: int
    left_alone: int
    path_mm: float
    compensated_path_mm: float
    correction_mean_mm: float | None
    correction_max_mm: float | None
    first_reason: str


class ReasonCount(TypedDict):
    """One reason of targets left alone, for JSON, with the first of them and the remedy."""

    kind: str
    targets: int
    programs: int
    first: str
    remedy: str


class WorstTarget(TypedDict):
    """A target with a large predicted error, for JSON; ``bound_mm`` adds 95 % of the scatter."""

    file: str
    line: int
    error_before_mm: float
    error_after_mm: float
    bound_mm: float
    compensated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FileResult:
    """What became of a file.

    Attributes:
        name: Of the file.
        language: Of its program.
        counts: JSON values of its targets.
        path: m, length of lines, arcs and splines that lead to its targets, and of those whose two
            ends are compensated.
        held: The program and its compensation; None of a file that was cut or only copied.
    """

    name: str
    language: str
    counts: Counts
    path: tuple[float, float] = (0.0, 0.0)
    held: tuple[Program, Compensation] | None = None

    @property
    def left_alone(self) -> Sequence[TargetLeftAlone]:
        """Targets that keep their numbers, one by one, as far as they are known."""
        found: Sequence[TargetLeftAlone] = self.counts.get("left_alone", ())
        return found

    @property
    def status(self) -> Mapping[str, int]:
        """Targets by status."""
        found: Mapping[str, int] = self.counts["status"]
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class JobReport:
    """All programs of a job in one table.

    Attributes:
        programs: In the order of the job.
        reasons: The most frequent first.
        worst: The largest bound first.
    """

    programs: tuple[ProgramRow, ...]
    reasons: tuple[ReasonCount, ...]
    worst: tuple[WorstTarget, ...]

    def document(self) -> dict[str, object]:
        """Returns JSON values."""
        return {
            "programs": list(self.programs),
            "reasons": list(self.reasons),
            "worst_targets": list(self.worst),
        }

    def blocks(self) -> tuple[Block, ...]:
        """Returns the tables, and the remedy of the most frequent reason."""
        done = sum(row["compensated"] for row in self.programs)
        targets = sum(row["targets"] for row in self.programs)
        out: list[Block] = [
            Table(
                title=f"{count(len(self.programs), 'program')}: {done} of {targets} targets "
                "compensated; correction mean and max in mm",
                columns=("file", "language", "targets", "done", "path", "mean", "max", "left alone",
                         "first reason"),
                rows=tuple(map(_program_cells, self.programs)),
            )
        ]  # fmt: skip
        if self.reasons:
            out.append(
                Table(
                    title="targets left alone, by reason",
                    columns=("reason", "targets", "programs", "first at", "remedy"),
                    rows=tuple(map(_reason_cells, self.reasons)),
                    words=True,
                )
            )
            most, left = self.reasons[0], sum(each["targets"] for each in self.reasons)
            out.append(
                Note(
                    f"largest group of targets left alone, {most['targets']} of {left} "
                    f"({most['kind']}): {most['remedy']}."
                )
            )
        if self.worst:
            out.append(
                Table(
                    title="largest predicted errors, mm; bound: after, with 95 % of the scatter",
                    columns=("target", "before", "after", "bound", "compensated"),
                    rows=tuple(map(_worst_cells, self.worst)),
                )
            )
        return tuple(out)


def report_job(files: Sequence[FileResult]) -> JobReport | None:
    """Returns the report of a job; None if it is one program.

    Args:
        files: In the order of the job.
    """
    programs = _group_files(files)
    if len(programs) < 2:
        return None
    reasons: Counter[tuple[str, str]] = Counter()
    places: dict[tuple[str, str], str] = {}
    users: Counter[tuple[str, str]] = Counter()
    for parts in programs:
        found = Counter[tuple[str, str]]()
        for part in parts:
            for key, number, place in _list_reasons(part):
                found[key] += number
                places.setdefault(key, place)
        reasons.update(found)
        users.update(dict.fromkeys(found, 1))
    return JobReport(
        programs=tuple(map(_describe_program, programs)),
        reasons=tuple(
            ReasonCount(kind=key[0], targets=number, programs=users[key], first=places[key],
                        remedy=key[1])
            for key, number in reasons.most_common()
        ),
        worst=_find_worst(files),
    )  # fmt: skip


def common_notes(notes: Iterable[tuple[str, str]]) -> list[str]:
    """Returns notes of programs, equal ones once, with their number.

    Args:
        notes: File and note.
    """
    found: dict[str, list[str]] = {}
    for name, note in notes:
        text = _PLACE.sub("", note)
        if not text.startswith("unchanged, "):
            place = note[: len(note) - len(text)].removesuffix(": ")
            found.setdefault(text, []).append(
                place if place.startswith(name) else f"{name} {place}"
            )
    ranked = sorted(found.items(), key=lambda each: -len(each[1]))
    out = [
        f"{places[0].strip()}: {text}" + _others(len(places)) for text, places in ranked[:COMMON]
    ]
    if len(ranked) > COMMON:
        out.append(f"{count(len(ranked) - COMMON, 'further note')}: -v or --json shows them.")
    return out


def _others(number: int) -> str:
    return f" ({number} times in the job)" if number > 1 else ""


def _group_files(files: Sequence[FileResult]) -> list[list[FileResult]]:
    """Returns the files of each program, by the order of suffixes in their language."""
    groups: dict[tuple[str, str], list[FileResult]] = {}
    for file in files:
        path = PurePosixPath(file.name)
        beside = map(PurePosixPath, find_language(file.language).name_companions(path.name))
        alike = any(each.stem.lower() == path.stem.lower() for each in beside)
        key = path.stem.lower() if alike else path.name
        groups.setdefault((path.parent.as_posix(), key), []).append(file)
    return [sorted(group, key=_suffix_order) for group in groups.values()]


def _suffix_order(file: FileResult) -> int:
    suffixes, own = find_language(file.language).suffixes, PurePosixPath(file.name).suffix.lower()
    return suffixes.index(own) if own in suffixes else len(suffixes)


def _list_reasons(file: FileResult) -> Iterable[tuple[tuple[str, str], int, str]]:
    """Yields kind and remedy of the unchanged targets of a file, their number, and lines."""
    for each in file.left_alone:
        yield (each["kind"], each["remedy"]), 1, f"{each['file']}:{each['line']}"
    if not file.left_alone and file.held is None:
        for key, number in count_by_kind(file.status).items():
            yield key, number, file.name


def _describe_program(parts: Sequence[FileResult]) -> ProgramRow:
    left = [each for part in parts for each in part.left_alone]
    alone = sum(number for part in parts for _, number, _ in _list_reasons(part))
    done = [int(part.status.get("compensated", 0)) for part in parts]
    correct = sum(int(part.status.get("unchanged_no_error", 0)) for part in parts)
    sizes = [(n, part.counts["correction_um"]) for n, part in zip(done, parts, strict=True) if n]
    targets = alone + correct + sum(done)
    reason = "" if targets else "no target"
    if left:
        reason = f"line {left[0]['line']}: {left[0]['kind']}"
    elif alone:
        reason = next(kind for part in parts for (kind, _), _, _ in _list_reasons(part))
    return ProgramRow(
        file=parts[0].name,
        language=parts[0].language,
        targets=targets,
        compensated=sum(done),
        left_alone=alone,
        path_mm=sum(part.path[0] for part in parts) / MM,
        compensated_path_mm=sum(part.path[1] for part in parts) / MM,
        correction_mean_mm=_MM_PER_UM * sum(n * size["mean"] for n, size in sizes) / sum(done)
        if sizes
        else None,
        correction_max_mm=max((_MM_PER_UM * size["max"] for _, size in sizes), default=None),
        first_reason=reason,
    )


def _find_worst(files: Sequence[FileResult]) -> tuple[WorstTarget, ...]:
    """Returns the targets of programs held whole whose error may be largest after compensation."""
    found: list[WorstTarget] = []
    for program, result in (file.held for file in files if file.held is not None):
        before, after = (
            np.linalg.norm(each, axis=1)
            for each in (result.predicted_error_before, result.predicted_error_after)
        )
        scatter = radius_95(result.covariance) if len(result.covariance) else np.zeros(len(after))
        bound = after + np.nan_to_num(scatter)
        rows = np.flatnonzero(np.isfinite(bound))
        for row in rows[np.argsort(-bound[rows], kind="stable")][:WORST].tolist():
            found.append(
                WorstTarget(
                    file=program.name,
                    line=int(program.line[row]),
                    error_before_mm=float(before[row]) / MM,
                    error_after_mm=float(after[row]) / MM,
                    bound_mm=float(bound[row]) / MM,
                    compensated=bool(result.status[row] == Status.COMPENSATED),
                )
            )
    return tuple(sorted(found, key=lambda each: -each["bound_mm"])[:WORST])


def _program_cells(row: ProgramRow) -> tuple[str, ...]:
    mean, largest = row["correction_mean_mm"], row["correction_max_mm"]
    return (
        row["file"],
        row["language"],
        str(row["targets"]),
        _share(row["compensated"], row["targets"]),
        _share(row["compensated_path_mm"], row["path_mm"]),
        "-" if mean is None else f"{mean:.3f}",
        "-" if largest is None else f"{largest:.3f}",
        str(row["left_alone"]),
        row["first_reason"],
    )


def _reason_cells(each: ReasonCount) -> tuple[str, ...]:
    counts = str(each["targets"]), str(each["programs"])
    return (each["kind"], *counts, each["first"], each["remedy"])


def _share(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.1f} %" if whole else "-"


def _worst_cells(each: WorstTarget) -> tuple[str, ...]:
    sizes = (each["error_before_mm"], each["error_after_mm"], each["bound_mm"])
    done = "yes" if each["compensated"] else "no"
    return (f"{each['file']}:{each['line']}", *(f"{size:.3f}" for size in sizes), done)
