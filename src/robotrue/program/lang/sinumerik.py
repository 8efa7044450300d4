"""Sinumerik: G-code of Siemens controls with five axes or a robot (TRAORI, Run MyRobot).

What is read: X, Y, Z with A, B, C or a tool axis A3, B3, C3; G0 to G3, CIP; zero offsets; axis
targets JT1 to JT6. Omitted words keep their previous value, and are inserted where it changes.
"""

from __future__ import annotations

import re
from itertools import islice
from typing import Final

from robotrue.core.arrays import Array
from robotrue.program.controller_files import print_abc, print_mm
from robotrue.program.lang.word_languages import (
    G_CODE,
    LONG_PATH,
    g_code_feeds,
    is_other_language,
    list_losses,
    path_inserter,
    write_words,
)
from robotrue.program.language import Cutter, FrameForm, Language, NamedBytes, TableForm
from robotrue.program.program import FrameTable, Program

_OWN: Final = re.compile(
    rb"(?im)^[ \t]*+(?:N\d++[ \t]*+)?(?:TRAORI|TRAFOOF|STOPRE|CYCLE\d|ORI(?:WKS|RPY|VECT|AXES)"
    rb"|\$P_UIFR|\$TC_|G64\d?\b|G[57]10\b|G500\b|CIP\b)|\b[ABC]3=|\b[XYZABC]=[-+.\d]|^%_N_|\bCR="
    rb"|^[^;\r\n(]*;[ \t]*[A-Z]"
)
MOVE: Final = re.compile(
    rb"(?im)^[ \t]*+(?:N\d++[ \t]*+)?(?:G\d++(?:\.\d)?[ \t]*+)*+[XYZ][ \t]*+=?[ \t]*+[-+]?+[\d.]"
)
"""A block that moves, in any G-code."""


def score_g_code(data: bytes, own: re.Pattern[bytes]) -> float:
    """Returns how surely bytes are G-code of a control, from its own words.

    The moves of any G-code count more than others have, from three on enough; two words are enough.
    """
    if is_other_language(data):
        return 0.0
    moves, words = (
        sum(1 for _ in islice(pattern.finditer(data), most))
        for pattern, most in ((MOVE, 3), (own, 2))
    )
    return 0.15 * moves + 0.25 * words


def _score(data: bytes) -> float:
    return score_g_code(data, _OWN)


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.gcode_read import read_gcode
    from robotrue.program.formats.gcode_vocabulary import SINUMERIK

    return read_gcode(files, SINUMERIK, frames)


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    x, y, z = print_mm(xyz)
    c, b, a = print_abc(R)
    return (
        f"; {name}, mm; R = Rz(C) Ry(B) Rx(A), deg\n"
        f"G{53 + number} X{x} Y{y} Z{z} A{a} B{b} C{c}\n"
        f"$P_UIFR[{number}]=CTRANS(X,{x},Y,{y},Z,{z}):CROT(X,{a},Y,{b},Z,{c})\n"
    )


def _cutter() -> Cutter:
    from robotrue.program.formats.gcode_chunks import SINUMERIK

    return SINUMERIK


LANGUAGE: Final = Language(
    name="sinumerik",
    suffixes=(".mpf", ".spf", ".arc"),
    score=_score,
    reader=_read,
    writer=write_words,
    cutter=_cutter,
    long=LONG_PATH,
    called=G_CODE,
    sign=re.compile(rb"(?im)^[^\S\n]*+(%|N?\d*+[^\S\n]*+G0?[0-3]\b)"),
    inserter=path_inserter,
    feeds=g_code_feeds,
    frame_form=FrameForm(
        name="g54",
        system="G{} work offset",
        counted_from=53,
        order="R = Rz(C) Ry(B) Rx(A): about z, then the new y, then the new x, deg",
        frame=TableForm(first=1, last=6, print=_print_frame),
    ),
    losses=list_losses,
    steps_from_command=True,
    family=G_CODE,
)
