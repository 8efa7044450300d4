"""UR script: ``.script`` files of Universal Robots.

What is read: movel, movej, movep and movec to literal poses ``p[...]``, to literal axes ``[...]``,
and to variables that hold one; ``pose_trans`` with a literal frame, ``get_inverse_kin`` of a pose;
the tool of ``set_tcp``. Nothing but the numbers of targets is ever rewritten, tools and frames
least of all. :mod:`robotrue.program.formats.urscript_write` defines how numbers are written.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.controller_files import print_values
from robotrue.program.formats.stated_feeds import PLAIN, target_lines
from robotrue.program.insertion import Inserter
from robotrue.program.language import Cutter, FrameForm, Language, TableForm, read_each
from robotrue.program.program import FrameTable, Program, Replacement

_MOTION: Final = re.compile(
    rb"(?<![\w.])(?:move[lpjc]|set_tcp)\s*\(\s*(?:p?\[|[A-Za-z_]\w*\s*[,)(=])", re.IGNORECASE
)
_HEAD: Final = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\S\n]*+def\s+\w++\s*+\((?:(?!^[^\S\n]*+def\s)[^)])*+\)\s*+:",
    re.MULTILINE,
)
"""A head that is not closed before the next one: what closes that one would close it, too."""
_FOREIGN: Final = re.compile(rb"^[^\S\n]*+(?:import|from)\s+\w|^[^\S\n]*+&ACCESS", re.MULTILINE)
_SPEED: Final = re.compile(
    rb"\bv[ \t]*=[ \t]*" + PLAIN
    + rb"|\][ \t]*,[ \t]*(?:a[ \t]*=[ \t]*)?[\d.]+[ \t]*,[ \t]*" + PLAIN
)  # fmt: skip


def _score(data: bytes) -> float:
    """1 for routines with motions, less for motions alone, 0 for Python."""
    lower = data.lower()
    if not any(word in lower for word in (b"move", b"set_tcp", b"def")):
        return 0.0
    if _FOREIGN.search(data):
        return 0.0
    return 0.8 * bool(_MOTION.search(data)) + 0.2 * bool(_HEAD.search(data))


def _read(data: bytes, name: str, frames: FrameTable) -> Program:
    from robotrue.program.formats.text_lines import require_text
    from robotrue.program.formats.urscript_build import build
    from robotrue.program.formats.urscript_scan import blank_comments, routines
    from robotrue.program.formats.urscript_walk import ScriptWalk

    require_text(data, name)
    code = blank_comments(data)
    found = routines(code, name)
    walk = ScriptWalk(code, found, frames.harmless_routines)
    walk.all()
    if len(found) == 1 and not walk.moves:
        raise FormatError(
            "not a UR script: no 'def' and no motion was found.",
            source=name,
            line=1,
            hint="give the .script that the controller runs.",
        )
    return build(walk, data, name, frames)


def _write(program: Program, replacement: Replacement) -> bytes:
    from robotrue.program.formats.urscript_write import write_urscript

    return write_urscript(program, replacement)


def _feeds(program: Program) -> Array:
    feed = np.full(len(program), np.nan)
    for row, text in enumerate(target_lines(program)):
        match = _SPEED.search(text) if b"move" in text else None
        if match:
            feed[row] = float(match[1] or match[2])
    return feed


def _print_pose(xyz: Array, R: Array) -> str:
    vector = rotation_vector_from_matrix(R)
    return f"p[{print_values(xyz * MM, 7, ', ')}, {print_values(vector, 9, ', ')}]"


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    return f"# {name} in base, m; rotation vector, rad\n{name} = {_print_pose(xyz, R)}\n"


def _print_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    return f"# {name} in the flange, m; rotation vector, rad\nset_tcp({_print_pose(xyz, R)})\n"


def _print_move(T: Array) -> str:
    values = [*T[:3, 3], *rotation_vector_from_matrix(T[:3, :3])]
    return f"movel(p[{','.join(f'{v:.7f}' for v in values)}],a=0.2,v=0.02)\n"


def _inserter() -> Inserter:
    from robotrue.program.formats.urscript_insert import INSERTER

    return INSERTER


def _cutter() -> Cutter:
    from robotrue.program.formats.line_chunks import URSCRIPT

    return URSCRIPT


LANGUAGE: Final = Language(
    name="urscript",
    suffixes=(".script", ".urscript"),
    score=_score,
    looked_at=1 << 18,
    reader=read_each(_read),
    writer=_write,
    called="a UR script",
    sign=re.compile(rb"(?m)^[^\S\n]*+(def\s+\w+\(\):|movel\()"),
    inserter=_inserter,
    cutter=_cutter,
    feeds=_feeds,
    frame_form=FrameForm(
        name="ur",
        system="Universal Robots",
        order="rotation vector (rx, ry, rz): axis times angle, rad",
        frame=TableForm(first=1, print=_print_frame),
        tool=TableForm(first=1, print=_print_tool),
    ),
    print_move=_print_move,
    prints_attitude=True,
)
