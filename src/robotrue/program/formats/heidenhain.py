"""Heidenhain conversational programs with five axes: M128, FUNCTION TCPM, LN.

What is read: L and LN with X, Y, Z, A, B, C or a tool axis TX, TY, TZ; CC with C, and CR; MM and
INCH. What is left out is kept from before, and inserted where it no longer holds.
"""

from __future__ import annotations

import re
from typing import Final

from robotrue.program.formats.path_dialect import PathDialect
from robotrue.program.program import FrameTable, Program

_HEAD: Final = re.compile(rb"(?im)^[ \t]*+(?:0++[ \t]++)?BEGIN PGM\b")
_LINE: Final = re.compile(rb"(?m)^[ \t]*+N?\d++[ \t]++(?:LN?|CC?)[ \t]++[IXYZ]")


def _score(data: bytes) -> float:
    return 0.7 * bool(_HEAD.search(data)) + 0.3 * bool(_LINE.search(data))


def _read(data: bytes, name: str, frames: FrameTable) -> Program:
    from robotrue.program.formats.heidenhain_read import read_heidenhain

    return read_heidenhain(data, name, frames)


DIALECT: Final = PathDialect(name="heidenhain", suffixes=(".h",), score=_score, reader=_read)
