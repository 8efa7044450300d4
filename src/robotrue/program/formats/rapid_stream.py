"""Long RAPID modules in blocks: motions to robtargets in place, one in a line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.program.formats import dialect
from robotrue.program.formats.line_survey import (
    NUMBER,
    LineForm,
    LineSurvey,
    listed,
    read_lines,
    written_lines,
)
from robotrue.program.program import FrameTable, Program, Replacement
from robotrue.program.stream import Judged, Piece, Surveyed, Whole

_ABSENT: Final = rb"(?:9[eE]\+?0?9|0(?:\.0*)?)"
_TARGET: Final = (
    rb"\[\s*\[" + listed(NUMBER, 3) + rb"\]\s*,\s*\[" + listed(NUMBER, 4) + rb"\]\s*,\s*\["
    + listed(rb"-?\d+", 4) + rb"\]\s*,\s*\[" + listed(_ABSENT, 6) + rb"\]\s*\]"
)  # fmt: skip
_AXES: Final = rb"\[\s*\[" + listed(NUMBER, 6) + rb"\]\s*,\s*\[" + listed(_ABSENT, 6) + rb"\]\s*\]"
_VALUE: Final = rb"(?:\w+|\[[\d.,eE+\-\s]*\])"
FORM: Final = LineForm(
    plain=re.compile(
        rb"[ \t]*Move(?:(?:L|J|(?P<via>C))[ \t]+" + _TARGET + rb"(?(via)\s*,\s*" + _TARGET + rb")"
        rb"|(?P<key_axes>AbsJ)[ \t]+" + _AXES + rb"(?:\\NoEOffs)?)"
        rb"\s*,\s*"
        + _VALUE
        + rb"(?:\\[VT]:=[\d.]+)?\s*,\s*"
        + _VALUE
        + rb"\s*,\s*(?P<key_tool>\w+)"
        rb"\s*,?\s*(?:\\WObj\s*:=\s*(?P<key_work>\w+)\s*)?;[ \t]*(?:![^\r\n]*)?[\r\n]*",
        re.IGNORECASE,
    ),
    idle=re.compile(rb"[ \t]*(?:![^\r\n]*)?[\r\n]*"),
    mark=b"!\n",
    foot=b"\nENDPROC\nENDMODULE\n",
)


def survey(path: Path, frames: FrameTable, targets: int) -> Surveyed | Whole:
    """Returns what one pass over a module finds, or why it must be read whole."""
    if frames.external:
        return Whole(why="external axes in the kinematic chain need every target at once")
    found = LineSurvey(path.name, targets, FORM)
    refused = found.run(path)
    return found if refused is None else refused


def read_piece(data: bytes, piece: Piece, judged: Judged) -> Program:
    """Returns the targets of a piece, as they stand in the program of the whole module."""
    keys = {FORM.key(match) for match in FORM.plain.finditer(data)}
    tools, works = ({key[k].decode("ascii") for key in keys} for k in (1, 2))
    given = FrameTable(
        tools={name: np.eye(4) for name in tools if name.lower() != "tool0"},
        bases={name: np.eye(4) for name in works if name.lower() not in ("", "wobj0")},
    )
    head = b"MODULE m\nPROC p()\n" + FORM.mark
    return read_lines(data, piece, judged, FORM, dialect("rapid"), head, given)


def write_piece(program: Program, replacement: Replacement) -> bytes:
    """Returns the bytes of a piece with the changed numbers replaced."""
    return written_lines(program, replacement, FORM, dialect("rapid"))
