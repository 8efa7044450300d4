"""Heidenhain conversational programs with five axes: M128, FUNCTION TCPM, LN.

What is read: L and LN with X, Y, Z, A, B, C or a tool axis TX, TY, TZ; CC with C, and CR; MM and
INCH. Omitted words keep their previous value, and are inserted where it changes.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.program.formats.stated_feeds import FLAGS, PLAIN, RAPID, last_stated
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.lang.word_languages import LONG_PATH, list_losses, write_words
from robotrue.program.language import Cutter, Language, NamedBytes
from robotrue.program.program import FrameTable, Program

_HEAD: Final = re.compile(rb"(?im)^[ \t]*+(?:0++[ \t]++)?BEGIN PGM\b")
_LINE: Final = re.compile(rb"(?m)^[ \t]*+N?\d++[ \t]++(?:LN?|CC?)[ \t]++[IXYZ]")
_FEED: Final = re.compile(
    rb";[^\r\n]*|\bF(?:" + PLAIN + rb"|(?P<max>MAX)|(?P<odd>AUTO|[UZQ]))", FLAGS
)


def _score(data: bytes) -> float:
    return 0.7 * bool(_HEAD.search(data)) + 0.3 * bool(_LINE.search(data))


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.gcode_read import read_gcode
    from robotrue.program.formats.gcode_vocabulary import HEIDENHAIN

    return read_gcode(files, HEIDENHAIN, frames)


def _feeds(program: Program) -> Array:
    place, value, once = [], [], []
    known = b"INCH" not in program.data[:4096].upper()
    for match in _FEED.finditer(program.data):
        if match["max"]:
            once.append(match.start())
        elif match[1] or match["odd"]:
            place.append(match.start())
            value.append(float(match[1]) * MM / 60.0 if match[1] and known else np.nan)
    feed = last_stated(program, place, value)
    fast = np.searchsorted(line_starts(program.data), np.array(once, dtype=np.int64), side="right")
    feed[np.isin(program.line, fast)] = RAPID
    return feed


def _cutter() -> Cutter:
    from robotrue.program.formats.gcode_chunks import HEIDENHAIN

    return HEIDENHAIN


LANGUAGE: Final = Language(
    name="heidenhain",
    suffixes=(".h",),
    score=_score,
    reader=_read,
    writer=write_words,
    cutter=_cutter,
    long=LONG_PATH,
    feeds=_feeds,
    losses=list_losses,
    steps_from_command=True,
)
