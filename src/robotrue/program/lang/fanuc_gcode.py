"""Fanuc G-code with five axes: tool point control by angles (G43.4) or by a tool axis (G43.5).

What is read: X, Y, Z with A, B, C or I, J, K; G0 to G3 with I, J, K or R; work offsets. Omitted
words keep their previous value, and are inserted where it changes.
"""

from __future__ import annotations

import re
from typing import Final

from robotrue.program.lang.sinumerik import score_g_code
from robotrue.program.lang.word_languages import (
    G_CODE,
    LONG_PATH,
    g_code_feeds,
    list_losses,
    path_inserter,
    write_words,
)
from robotrue.program.language import Cutter, Language, NamedBytes
from robotrue.program.program import FrameTable, Program

_OWN: Final = re.compile(
    rb"(?im)^%[ \t]*\r?$|^O\d{1,8}\b|G43\.[45]\b|^[ \t]*+(?:N\d++[ \t]*+)?\([^\r\n]*\)[ \t]*\r?$"
    rb"|^[ \t]*+(?:N\d++[ \t]*+)?G(?:2[018]|49|80|54\.1|68\.2)\b|#\d|\bM98\b"
)


def _score(data: bytes) -> float:
    return score_g_code(data, _OWN)


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.gcode_read import read_gcode
    from robotrue.program.formats.gcode_vocabulary import FANUC

    return read_gcode(files, FANUC, frames)


def _cutter() -> Cutter:
    from robotrue.program.formats.gcode_chunks import FANUC_GCODE

    return FANUC_GCODE


LANGUAGE: Final = Language(
    name="fanuc_gcode",
    suffixes=(".nc", ".tap", ".cnc", ".ngc"),
    score=_score,
    reader=_read,
    writer=write_words,
    cutter=_cutter,
    long=LONG_PATH,
    inserter=path_inserter,
    feeds=g_code_feeds,
    losses=list_losses,
    steps_from_command=True,
    family=G_CODE,
)
