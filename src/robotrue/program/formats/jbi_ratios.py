"""What ``ALL.PRM`` or ``RC.PRM`` of a Yaskawa controller says of the pulses of its axes.

The group ``RC1G`` holds the gear ratios of the first robot, ten parameters a line. They are not
used by themselves: which way an axis counts, and the pulses of a turn of its motor, do not stand
there. They are named as a proposal, to be compared with one position on the pendant.
"""

from __future__ import annotations

import re
from typing import Final

from robotrue.program.program import FrameTable

_GROUP: Final = re.compile(rb"^///RC1G[^\r\n]*\r?\n((?:(?!//)[^\n]*\n?)*)", re.MULTILINE)
_LONG: Final = 200
"""Lines from which the group is that of a controller with the longer list."""
_PLACES: Final = ((97, 2, 98), (109, 0, 110))
"""Line of the denominators, how many entries it begins late, and line of the numerators."""
_TURN: Final = 4096.0
"""Pulses of a turn of a motor."""


def propose_ratios(frames: FrameTable) -> tuple[str, list[float]] | None:
    """Returns the file beside the job and pulses per degree of six axes; None without any."""
    for name, data in frames.declarations:
        match = _GROUP.search(data)
        ratios = _read(match[1]) if match else None
        if ratios is not None:
            return name, ratios
    return None


def _read(text: bytes) -> list[float] | None:
    lines = [line.strip() for line in text.split(b"\n") if line.strip()]
    first, late, second = _PLACES[len(lines) >= _LONG]
    if len(lines) <= second:
        return None
    cells = [
        [cell.strip() for cell in lines[row].split(b",")][skip : skip + 6]
        for row, skip in ((first, late), (second, 0))
    ]
    if any(len(row) != 6 or not all(re.fullmatch(rb"-?\d{1,9}", c) for c in row) for row in cells):
        return None
    below, above = ([abs(float(cell)) for cell in row] for row in cells)
    if not (all(below) and all(above)):
        return None
    return [round(_TURN * a / b / 360.0, 4) for a, b in zip(above, below, strict=True)]
