"""ABB RAPID: ``.mod``, ``.modx`` and ``.prg`` modules.

What is read: robtargets and jointtargets in motions and in declarations, arrays too; MoveL, MoveJ,
MoveC, MoveAbsJ and their forms with signals and triggers; tools and work objects as the module sets
them. Nothing but the numbers of targets is ever rewritten, tooldata and wobjdata least of all.
:mod:`robotrue.program.formats.rapid_write` defines how numbers are written.
"""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import MM
from robotrue.program.controller_files import print_mm, print_values
from robotrue.program.formats.stated_feeds import PLAIN
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Inserter
from robotrue.program.language import Cutter, FrameForm, Language, NamedBytes, TableForm
from robotrue.program.program import FrameTable, Program, Replacement
from robotrue.program.target_poses import as_printed

_HEAD: Final = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\S\n]*+(?:%%%|MODULE\s+[\w\x80-\xff])", re.IGNORECASE | re.MULTILINE
)
_BODY: Final = re.compile(
    rb"^[^\S\n]*+Move(?:L|J|C|AbsJ)\b[\s\\\[\w\x80-\xff]"
    rb"|\b(?:CONST|PERS|VAR)\s+(?:robtarget|jointtarget)\s"
    rb"|^[^\S\n]*+ENDMODULE\b|^[^\S\n]*+(?:LOCAL\s+)?(?:PERS|VAR|CONST)\s+[\w\x80-\xff]+\s+[\w\x80-\xff]+\s*:=",
    re.IGNORECASE | re.MULTILINE,
)
_BESIDE: Final = ("CalibData.mod", "CalibData.modx")
"""Where ABB's tools keep tooldata and wobjdata."""
_CARTESIAN: Final = re.compile(rb"\b(?:Move|Trigg)[LJC]", re.IGNORECASE)
_TIMED: Final = re.compile(
    rb"\\(?:T|V[ \t]*:=[ \t]*" + PLAIN + rb")(?=[ \t]*[:,\\])", re.IGNORECASE
)
"""A time or a speed in addition to the speed data, which it overrides."""
_SPEED: Final = re.compile(rb",\s*v(\d+)\b", re.IGNORECASE)


_NEEDED: Final = (b"%%%", b"module", b"move", b"pers", b"const", b"var")
"""One of these is in every module; without any, the slow patterns need not look."""


def _score(data: bytes) -> float:
    """1 for a module with a motion or data, less for one of the two."""
    lower = data.lower()
    if not any(word in lower for word in _NEEDED):
        return 0.0
    return 0.5 * bool(_HEAD.search(data)) + 0.5 * bool(_BODY.search(data))


def _name_companions(name: str) -> tuple[str, ...]:
    """The module in which ABB's tools keep the frames of the others."""
    return () if PurePath(name).stem.lower() == "calibdata" else _BESIDE


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    """One program per file; each with motions is read with the frames of all."""
    from robotrue.program.formats.rapid_read import read_rapid

    return read_rapid(files, frames)


def _write(program: Program, replacement: Replacement) -> bytes:
    from robotrue.program.formats.rapid_write import write_rapid

    return write_rapid(*as_printed(program, replacement))


def _feeds(program: Program) -> Array:
    starts = line_starts(program.data)
    feed = np.full(len(program), np.nan)
    for row, line in enumerate(program.line.tolist()):
        begin = int(starts[line - 1])
        text = program.data[begin : program.data.find(b";", begin)]
        if _CARTESIAN.search(text):
            match = _TIMED.search(text) or _SPEED.search(text)
            feed[row] = float(match[1]) * MM if match and match[1] else np.nan
    return feed


def _pose(xyz: Array, R: Array) -> str:
    return f"[[{','.join(print_mm(xyz))}],[{print_values(quat_wxyz_from_matrix(R), 9, ',')}]]"


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    return (
        f"! {name} as user frame, mm; [q1,q2,q3,q4] = [w,x,y,z]\n"
        f'PERS wobjdata w_{name[:29]}:=[FALSE,TRUE,"",{_pose(xyz, R)},'
        "[[0,0,0],[1,0,0,0]]];\n"
    )


def _print_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    return (
        f"! {name} in the flange, mm; [q1,q2,q3,q4] = [w,x,y,z]; mass and centre are not known\n"
        f"PERS tooldata t_{name[:29]}:=[TRUE,{_pose(xyz, R)},"
        "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];\n"
    )


def _print_move(T: Array) -> str:
    place = ",".join(f"{v:.4f}" for v in T[:3, 3] / MM)
    turn = ",".join(f"{v:.9f}" for v in quat_wxyz_from_matrix(T[:3, :3]))
    return (
        "ConfL\\Off;\n"
        f"MoveL [[{place}],[{turn}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
        "v20,fine,drill\\WObj:=base;\n"
        "ConfL\\On;\n"
    )


def _inserter() -> Inserter:
    from robotrue.program.formats.rapid_insert import INSERTER

    return INSERTER


def _cutter() -> Cutter:
    from robotrue.program.formats.line_chunks import RAPID

    return RAPID


LANGUAGE: Final = Language(
    name="rapid",
    suffixes=(".mod", ".modx", ".prg"),
    score=_score,
    looked_at=1 << 18,
    reader=_read,
    writer=_write,
    called="an ABB RAPID module",
    sign=re.compile(rb"(?im)^[^\S\n]*+MODULE\s+\w|\bMove[LJC]\s"),
    name_companions=_name_companions,
    inserter=_inserter,
    cutter=_cutter,
    feeds=_feeds,
    frame_form=FrameForm(
        name="rapid",
        system="ABB RAPID",
        order="unit quaternion [q1,q2,q3,q4] = [w,x,y,z]",
        frame=TableForm(first=1, print=_print_frame),
        tool=TableForm(first=1, print=_print_tool),
    ),
    print_move=_print_move,
    prints_attitude=True,
)
