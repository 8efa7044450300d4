"""Initial registers of a Fanuc LS program: ``POSREG.VA`` next to it, and its own statements.

A register of the file counts as a taught position where no program given sets it and none calls a
program that is not given; the file states its value when it was saved.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.program.controller_files import NUMBER, all_finite
from robotrue.program.formats.fanuc_registers import (
    Effects,
    Registers,
    effective_statements,
)
from robotrue.program.formats.fanuc_scan import FanucScan
from robotrue.program.formats.fanuc_values import RegisterPose, State
from robotrue.program.program import FrameTable

_POSREG: Final = re.compile(r"^\[\*POSREG\*\]\$POSREG\b", re.MULTILINE)
_ELEMENT: Final = re.compile(r"^[ \t]*\[[ \t]*1[ \t]*,[ \t]*(\d{1,6})[ \t]*\][ \t]*=", re.MULTILINE)
_GROUP: Final = re.compile(
    r"[ \t]*(?:'[^'\n]*')?\s*Group[ \t]*:[ \t]*1[ \t]+Config[ \t]*:[ \t]*([^\n]*?)[ \t]*\n\s*"
    + r"\s++".join(rf"{letter}[ \t]*+:[ \t]*+({NUMBER})" for letter in "XYZWPR")
    + r"\s*(EXT)?"
)
_SETS_POSITION: Final = re.compile(rb"(?<![\w$])P[ \t]*\[[^\]]*\][ \t]*=")
_GROUPS: Final = re.compile(rb"\bDEFAULT_GROUP[ \t]*=[ \t]*([^;]*);")


def read_position_registers(text: str) -> dict[int, RegisterPose]:
    """Returns the registers of group 1 that a ``POSREG.VA`` holds in the Cartesian form."""
    out: dict[int, RegisterPose] = {}
    begin = _POSREG.search(text)
    if begin is None:
        return out
    end = text.find("\n[*", begin.end())
    section = text[begin.end() : end if end >= 0 else len(text)]
    for element in _ELEMENT.finditer(section):
        match = _GROUP.match(section, element.end())
        if match is not None and not match[8] and all_finite(match.groups()[1:7]):
            values = tuple(float(each) for each in match.groups()[1:7])
            out[int(element[1])] = RegisterPose(values, match[1].encode("latin-1"))
    return out


def follow_registers(
    found: FanucScan, frames: FrameTable, effects: Effects
) -> tuple[dict[int, State], tuple[str, ...]]:
    """Returns the known registers at the moves that use them, and notes.

    Args:
        found: The program.
        frames: From the cell and the files next to the program.
        effects: Settings of programs, by name; ``*`` for all given ones.
    """
    first, last = found.statements
    body = found.data[first:last]
    if not names_registers(body):
        return {}, ()
    if _has_other_groups(found.data, first):
        return {}, ("registers of a program that moves several groups are not followed.",)
    begin, said = _start(frames, effects)
    known = Registers(effective_statements(found.data, first, last), _points(found), begin, effects)
    return known.at, said


def names_registers(text: bytes) -> bool:
    """Returns whether statements may use a position register or an offset."""
    return b"PR[" in text or b"FFSET" in text.upper()


def _has_other_groups(data: bytes, last: int) -> bool:
    match = _GROUPS.search(data, 0, last)
    return match is not None and not set(match[1].replace(b" ", b"").split(b",")[1:]) <= {b"*"}


def _start(frames: FrameTable, effects: Effects) -> tuple[State, tuple[str, ...]]:
    """Returns the registers of the files next to the program that nothing sets."""
    held: dict[int, RegisterPose] = {}
    names: list[str] = []
    for name, data in frames.declarations:
        text = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
        registers = read_position_registers(text)
        held = {**registers, **held}
        names += [name] * bool(registers)
    sets = effects.get("*", frozenset())
    if not held or sets is None or "PR*" in sets:
        return {}, ()
    start: State = {f"PR{n}": pose for n, pose in held.items() if f"PR{n}" not in sets}
    said = (
        f"position registers that no program given sets are as {names[0]} has them; moves to them "
        "get separate positions and no longer follow the register."
    )
    return start, (said,) if start else ()


def _points(found: FanucScan) -> dict[int, RegisterPose]:
    """Returns the positions that registers may be set from."""
    first, last = found.statements
    if _SETS_POSITION.search(found.data, first, last):
        return {}
    plain = np.isfinite(found.numbers.value).all(axis=1) & (found.is_axis == 0)
    out: dict[int, RegisterPose] = {}
    for row in np.flatnonzero(plain).tolist():
        begin, size = found.config[row].tolist()
        if begin >= 0 and row not in found.external:
            values = tuple(found.numbers.value[row].tolist())
            out[int(found.number[row])] = RegisterPose(values, found.data[begin : begin + size])
    return out
