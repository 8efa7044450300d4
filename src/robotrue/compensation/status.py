"""Outcome of a target and its reason: statuses, notes by line, remedies."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final, TypedDict

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.core.explained import Explained
from robotrue.program.program import Program, Reason

NAMED: Final = 5
"""Lines a note names; the others are counted."""


class Status(Explained):
    """One per target. All but ``COMPENSATED`` leave the bytes unchanged."""

    COMPENSATED = 0, "compensated"
    UNCHANGED_NO_ERROR = 1, "no error predicted"
    UNCHANGED_SOURCE = 2, "its pose cannot be read from the program"
    UNCHANGED_AXIS_TARGET = 3, "an axis target; compensated on request only"
    UNCHANGED_UNREACHABLE = 4, "out of the robot's reach"
    UNCHANGED_JOINT_LIMIT = 5, "beyond a joint limit"
    UNCHANGED_SINGULAR = 6, "too near a singularity"
    UNCHANGED_WRIST_SINGULAR = 7, "wrist stretched: axes 4 and 6 in line"
    UNCHANGED_BRANCH_JUMP = 8, "needs another arm configuration than the previous target"
    UNCHANGED_STEP = 9, "the correction is larger than allowed"
    UNCHANGED_NOT_CONVERGED = 10, "the inversion did not reach its tolerance"
    UNCHANGED_CONFIGURATION = (
        11,
        "the arm configuration is not stated, and another one inside the joint limits has another "
        "error; state the start posture with [controller] start_deg in the cell, or --start "
        "A1,..,A6",
    )


class Route(IntEnum):
    """Treatment of a target by the solvers."""

    SKIP = 0  # nothing is known of it
    LINEAR = 1  # pose; the arm must keep its configuration on the way
    FREE = 2  # pose after a joint move: the nearest solution
    GIVEN = 3  # pose whose nominal joints are already chosen
    PASS = 4  # axis target, left as it is, but the arm goes there
    AXES = 5  # axis target to be compensated


@dataclass(frozen=True, slots=True, kw_only=True)
class RowNote:
    """A sentence about targets of one program.

    Attributes:
        lines: The first ``NAMED`` lines, one-based.
        count: Number of targets.
        text: Sentence about them; ``%.0f`` is replaced by ``worst``.
        worst: Largest value among them, if the text names one.
        rank: Place of the note among others.
    """

    lines: tuple[int, ...]
    count: int
    text: str
    worst: float | None = None
    rank: int = 0

    def __str__(self) -> str:
        lines = ", ".join(str(line) for line in self.lines)
        tail = f", ... ({self.count} in all)" if self.count > len(self.lines) else ""
        text = self.text if self.worst is None else self.text % self.worst
        return f"line{'s' if self.count > 1 else ''} {lines}{tail}: {text}"


def row_note(
    program: Program, rows: IntArray, text: str, *, worst: float | None = None, rank: int = 0
) -> RowNote:
    """Returns the note on some rows of a program, in file order."""
    lines = tuple(int(program.line[row]) for row in rows[:NAMED])
    return RowNote(lines=lines, count=len(rows), text=text, worst=worst, rank=rank)


def merge_notes(notes: Iterable[RowNote]) -> tuple[RowNote, ...]:
    """Returns equal notes merged into one each, by rank, from parts of a program in order."""
    merged: dict[tuple[int, str], RowNote] = {}
    for note in notes:
        key = (note.rank, note.text)
        before = merged.get(key)
        if before is None:
            merged[key] = note
            continue
        worst = note.worst
        if before.worst is not None and worst is not None:
            worst = max(before.worst, worst)
        merged[key] = replace(
            before,
            lines=(before.lines + note.lines)[:NAMED],
            count=before.count + note.count,
            worst=worst,
        )
    return tuple(merged[key] for key in sorted(merged, key=lambda key: key[0]))


_BY_REASON: Final[Mapping[Reason, str]] = {
    Reason.NONE: "write the pose out in the move",
    Reason.EXPRESSION: "give the files that hold its data, or write the pose out in the move",
    Reason.RELATIVE: "write the target as an absolute pose, without a shift",
    Reason.UNKNOWN_FRAME: "give the controller's frame files beside the program, or state base and "
    "tool in the cell ([[controller.base]], [[controller.tool]])",
    Reason.EXTERNAL_AXIS: "describe the axis in the cell ([[controller.external]]), or state "
    "external_axes_at_rest",
    Reason.JOINT_TARGET: "state [robot] maker in the cell",
    Reason.INCOMPLETE: "write the omitted values out at the target",
    Reason.TOOL_ON_FLOOR: "state [controller] fixed_tool in the cell",
    Reason.OUT_OF_REACH: "correct its numbers, or their unit",
}
_BY_STATUS: Final[Mapping[Status, str]] = {
    Status.UNCHANGED_AXIS_TARGET: "compensate with --axis-targets",
    Status.UNCHANGED_UNREACHABLE: "check base, tool and robot of the cell",
    Status.UNCHANGED_JOINT_LIMIT: "move the part, or check the joint limits of the cell",
    Status.UNCHANGED_SINGULAR: "move the part, or turn the tool about its axis",
    Status.UNCHANGED_WRIST_SINGULAR: "tilt the tool at this target",
    Status.UNCHANGED_BRANCH_JUMP: "move there with a joint move",
    Status.UNCHANGED_STEP: "check base and tool, or allow more with --max-shift-mm",
    Status.UNCHANGED_NOT_CONVERGED: "check the model with robotrue validate",
    Status.UNCHANGED_CONFIGURATION: "state the start posture with --start A1,..,A6",
}
_HEAD: Final = re.compile(r"(\d+(?:, \d+)*)(?: and \d+ more lines)?: ")


class TargetLeftAlone(TypedDict):
    """One target, for JSON: file, line, number in the file, kind of reason, and sentences."""

    file: str
    line: int
    target: int
    kind: str
    reason: str
    remedy: str


def list_left_alone(program: Program, status: IntArray) -> list[TargetLeftAlone]:
    """Returns the targets that moves go to and that keep their numbers, in file order.

    A target whose line a note of the reader names has that note as its reason.

    Args:
        program: As it was read.
        status: (n,) :class:`Status`.
    """
    notes = _notes_by_line(program)
    kept = ~np.isin(status, (Status.COMPENSATED, Status.UNCHANGED_NO_ERROR))
    kept &= program.reason != Reason.UNUSED
    out: list[TargetLeftAlone] = []
    for row in np.flatnonzero(kept).tolist():
        line, why = int(program.line[row]), Status(int(status[row]))
        reason = Reason(int(program.reason[row]))
        by_reader = why == Status.UNCHANGED_SOURCE
        text = reason.explanation if by_reader else why.explanation
        out.append(
            TargetLeftAlone(
                file=program.name,
                line=line,
                target=row + 1,
                kind=_kind(reason if by_reader else why),
                reason=notes.get(line, text) if by_reader else text,
                remedy=_BY_REASON[reason] if by_reader else _BY_STATUS[why],
            )
        )
    return out


def _kind(why: Reason | Status) -> str:
    """Returns the name of a reason in words, such as ``joint limit``."""
    if why is Reason.NONE or why is Status.UNCHANGED_SOURCE:
        return "unreadable"
    return why.name.lower().removeprefix("unchanged_").replace("_", " ")


def count_by_kind(counts: Mapping[str, int]) -> dict[tuple[str, str], int]:
    """Returns targets left alone by kind and remedy, where only their statuses are known.

    Args:
        counts: Targets by the lower-case name of their :class:`Status`.
    """
    known = {status.name.lower(): status for status in _BY_STATUS}
    known["unchanged_source"] = Status.UNCHANGED_SOURCE
    remedies = {**_BY_STATUS, Status.UNCHANGED_SOURCE: _BY_REASON[Reason.NONE]}
    return {
        (_kind(known[name]), remedies[known[name]]): number
        for name, number in counts.items()
        if name in known
    }


def _notes_by_line(program: Program) -> dict[int, str]:
    """Returns the reader's notes on lines that it names."""
    out: dict[int, str] = {}
    for note in program.notes:
        match = _HEAD.match(note.removeprefix(f"{program.name}:"))
        for line in match[1].split(", ") if match else ():
            out.setdefault(int(line), note[note.index(": ") + 2 :])
    return out
