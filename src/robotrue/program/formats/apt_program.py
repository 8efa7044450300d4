"""APT and CL data as a program whose points are rewritten in place.

What is read: GOTO/ with three or six numbers; a tool axis is kept until the next. What is not a
point in the one frame of the file is left as it is: steps, arcs, cycles, moved coordinates.
"""

from __future__ import annotations

import re
from typing import Final

from robotrue.program.formats.path_dialect import PathDialect
from robotrue.program.program import FrameTable, Program

_POINT: Final = re.compile(
    rb"(?im)^(?:\xef\xbb\xbf)?[ \t]*+(?:GOTO|GODLTA|FROM)[ \t]*+/[ \t]*+[-+.\d]"
)


def _score(data: bytes) -> float:
    return min(0.35 * len(_POINT.findall(data)), 0.9)


def _read(data: bytes, name: str, frames: FrameTable) -> Program:
    from robotrue.program.formats.apt_program_read import read_apt_program

    return read_apt_program(data, name, frames)


DIALECT: Final = PathDialect(
    name="apt", suffixes=(".apt", ".cls", ".cl", ".ncl", ".aptsource"), score=_score, reader=_read
)
