"""Long UR scripts in blocks: motions to poses or axes in place, one in a line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

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

_SIX: Final = rb"\[\s*" + listed(NUMBER, 6) + rb"\s*\]"
FORM: Final = LineForm(
    plain=re.compile(
        rb"[ \t]*move(?:[lpj]\(\s*(?:p" + _SIX
        + rb"|pose_trans\(\s*(?P<key_frame>[A-Za-z_]\w*)\s*,\s*p" + _SIX + rb"\s*\))"
        + rb"|(?P<via>c)\(\s*p" + _SIX + rb"\s*,\s*p" + _SIX + rb"|(?P<key_axes>j)\(\s*" + _SIX
        + rb")\s*(?:,[\w\s=.,+\-]*)?\)[ \t]*(?:#[^\r\n]*)?[\r\n]*"
    ),
    idle=re.compile(rb"[ \t]*(?:#[^\r\n]*)?[\r\n]*"),
    mark=b"#\n",
    foot=b"\nend\n",
)  # fmt: skip


def survey(path: Path, frames: FrameTable, targets: int) -> Surveyed | Whole:
    """Returns what one pass over a script finds, or why it must be read whole."""
    found = LineSurvey(path.name, targets, FORM)
    refused = found.run(path)
    return found if refused is None else refused


def read_piece(data: bytes, piece: Piece, judged: Judged) -> Program:
    """Returns the targets of a piece, as they stand in the program of the whole script."""
    named = {frame for frame, _ in map(FORM.key, FORM.plain.finditer(data)) if frame}
    frames = b"".join(b"  %b = p[0,0,0,0,0,0]\n" % name for name in sorted(named))
    head = b"def p():\n" + frames + FORM.mark
    return read_lines(data, piece, judged, FORM, dialect("urscript"), head, FrameTable())


def write_piece(program: Program, replacement: Replacement) -> bytes:
    """Returns the bytes of a piece with the changed numbers replaced."""
    return written_lines(program, replacement, FORM, dialect("urscript"))
