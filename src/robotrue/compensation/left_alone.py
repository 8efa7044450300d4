"""Targets that keep their numbers, one by one: file, line, reason and what to do about it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final, TypedDict

import numpy as np

from robotrue.compensation.status import Status
from robotrue.core.arrays import IntArray
from robotrue.program.program import Program, Reason

_BY_REASON: Final[Mapping[Reason, str]] = {
    Reason.NONE: "write the pose out in the move",
    Reason.EXPRESSION: "give the files that hold its data, or write the pose out in the move",
    Reason.RELATIVE: "write the target as an absolute pose, without a shift",
    Reason.UNKNOWN_FRAME: "give the controller's frame files beside the program, or state base and "
    "tool in the cell ([[controller.base]], [[controller.tool]])",
    Reason.EXTERNAL_AXIS: "describe the axis in the cell ([[controller.external]]), or state "
    "external_axes_at_rest",
    Reason.JOINT_TARGET: "state [robot] maker in the cell",
    Reason.INCOMPLETE: "write out at the target what it leaves out",
    Reason.TOOL_ON_FLOOR: "state [controller] fixed_tool in the cell",
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
    """One target, for JSON: the file, its line, its number in the file, and sentences."""

    file: str
    line: int
    target: int
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
                reason=notes.get(line, text) if by_reader else text,
                remedy=_BY_REASON[reason] if by_reader else _BY_STATUS[why],
            )
        )
    return out


def _notes_by_line(program: Program) -> dict[int, str]:
    """Returns what the reader says of lines that it names."""
    out: dict[int, str] = {}
    for note in program.notes:
        match = _HEAD.match(note.removeprefix(f"{program.name}:"))
        for line in match[1].split(", ") if match else ():
            out.setdefault(int(line), note[note.index(": ") + 2 :])
    return out
