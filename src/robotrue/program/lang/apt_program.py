"""APT and CL data as a program whose points are rewritten in place.

What is read: GOTO/ with three or six numbers; a tool axis is kept until the next. What is not a
point in the one frame of the file is left as it is: steps, arcs, cycles, moved coordinates.
"""

from __future__ import annotations

import re
from typing import Final

from robotrue.core.arrays import Array
from robotrue.program.lang.word_languages import (
    LONG_PATH,
    list_losses,
    path_inserter,
    toolpath_feeds,
    write_words,
)
from robotrue.program.language import Cutter, Language, read_each
from robotrue.program.program import FrameTable, Program

_POINT: Final = re.compile(
    rb"(?im)^(?:\xef\xbb\xbf)?[ \t]*+(?:GOTO|GODLTA|FROM)[ \t]*+/[ \t]*+[-+.\d]"
)


def _score(data: bytes) -> float:
    return min(0.35 * len(_POINT.findall(data)), 0.9)


def _read(data: bytes, name: str, frames: FrameTable) -> Program:
    from robotrue.program.formats.apt_program_read import read_apt_program

    return read_apt_program(data, name, frames)


def _feeds(program: Program) -> Array:
    from robotrue.program.formats.apt import read_apt

    return toolpath_feeds(program, read_apt)


def _cutter() -> Cutter:
    from robotrue.program.formats.path_chunks import APT

    return APT


LANGUAGE: Final = Language(
    name="apt",
    suffixes=(".apt", ".cls", ".cl", ".ncl", ".aptsource"),
    score=_score,
    reader=read_each(_read),
    writer=write_words,
    called="APT or CL data",
    sign=re.compile(rb"(?m)^[^\S\n]*+GOTO\s*/"),
    inserter=path_inserter,
    cutter=_cutter,
    long=LONG_PATH,
    feeds=_feeds,
    losses=list_losses,
    steps_from_command=True,
)
