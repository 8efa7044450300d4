"""Fanuc LS: TP programs as text (ASCII), with their positions in ``/POS``.

What is read: positions as X Y Z W P R or J1 to J6; J, L, C, A and S moves; user frames and tools by
number. Only the numbers of positions and their CONFIG are ever rewritten.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from robotrue.core.arrays import Array
from robotrue.errors import FormatError
from robotrue.program.controller_files import (
    NUMBER,
    ControllerFile,
    all_finite,
    frame_of,
    print_abc,
    print_mm,
    unreadable_frame,
)
from robotrue.program.formats.stated_feeds import PLAIN, feeds_of_points
from robotrue.program.insertion import Inserter
from robotrue.program.language import (
    Cutter,
    FrameFiles,
    FrameForm,
    Language,
    NamedBytes,
    TableForm,
)
from robotrue.program.program import FrameTable, Program, Replacement

_PROG: Final = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?|[\r\n])[ \t]*/PROG\b")
_SECTION: Final = re.compile(rb"[\r\n][ \t]*/(?:ATTR|MN|POS)[ \t]*[\r\n]")
_VA: Final = re.compile(r"^\[\*SYSTEM\*\]\$MNU(FRAME|TOOL)\b(?!NUM)", re.MULTILINE)
_POSREG: Final = re.compile(r"^\[\*POSREG\*\]\$POSREG\b", re.MULTILINE)
_VA_ONE: Final = re.compile(
    r"\[[ \t]*1[ \t]*,[ \t]*(\d{1,9})[ \t]*\][ \t]*=(?>[^\[]*?Group[ \t]*:[ \t]*1\b)[^\[]*?"
    + r"\s++".join(rf"{letter}[ \t]*+:[ \t]*+({NUMBER})" for letter in "XYZWPR"),
    re.IGNORECASE,
)
_MOVE: Final = re.compile(
    rb"P\[(\d++)(?:(?!P\[)[^\]\r\n])*+\][ \t]++" + PLAIN + rb"[ \t]*(mm/sec|cm/min)",
    re.IGNORECASE,
)
_POINT: Final = re.compile(rb"[ \t]*P\[(\d+)")
_CM_PER_MIN: Final = 10.0 / 60.0
"""mm/s."""


def _score(data: bytes) -> float:
    """1 for ``/PROG`` with one of its sections, less for one of the two."""
    return 0.5 * bool(_PROG.search(data)) + 0.5 * bool(_SECTION.search(data))


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.fanuc_moves import fanuc_frame_changes, quiet_programs
    from robotrue.program.formats.fanuc_read import read_fanuc
    from robotrue.program.formats.fanuc_register_files import names_registers
    from robotrue.program.formats.fanuc_registers import list_effects

    named = any(names_registers(data) for _, data in files)
    effects = list_effects(files, frames.harmless_routines) if named else {}
    quiet = (*frames.harmless_routines, *quiet_programs(files))
    changed = fanuc_frame_changes(files)
    frames = replace(frames, harmless_routines=quiet, changed_frames=changed)
    return tuple(read_fanuc(data, name, frames, effects) for name, data in files)


def _write(program: Program, replacement: Replacement) -> bytes:
    from robotrue.program.formats.fanuc_write import write_fanuc

    return write_fanuc(program, replacement)


def _feeds(program: Program) -> Array:
    moves = _MOVE.finditer(program.data)
    stated = (
        (move[1], float(move[2]) * (_CM_PER_MIN if move[3].lower() == b"cm/min" else 1.0))
        for move in moves
    )
    return feeds_of_points(program, stated, _POINT)


def _read_frames(name: str, text: str) -> ControllerFile:
    """The positions of group 1 in ``$MNUFRAME`` and ``$MNUTOOL``."""
    out = ControllerFile(name=name)
    for match in _VA.finditer(text):
        end = text.find("\n[*", match.end())
        section = text[match.end() : end if end >= 0 else len(text)]
        for one in _VA_ONE.finditer(section):
            if not all_finite(one.groups()[1:]):
                at = match.end() + one.start()
                raise unreadable_frame(name, text, at, f"$MNU{match[1].upper()}[1,{one[1]}]")
            numbers = [float(one[i]) for i in range(2, 8)]
            matrix = frame_of(numbers[:3], numbers[:2:-1])
            side = out.bases if match[1].upper() == "FRAME" else out.tools
            side[str(int(one[1]))] = matrix
    if not (out.bases or out.tools or _POSREG.search(text)):
        raise FormatError(
            "no position of group 1 in $MNUFRAME or $MNUTOOL.",
            source=name,
            line=1,
            hint="save the frames as ASCII (SYSFRAME.VA), not the binary SYSFRAME.SV.",
        )
    return replace(out, declarations=_POSREG.search(text) is not None)


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    return f"UFRAME[{number}] {name}, {_print_pose(xyz, R)}"


def _print_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    return f"UTOOL[{number}] {name}, {_print_pose(xyz, R)}"


def _print_pose(xyz: Array, R: Array) -> str:
    x, y, z = print_mm(xyz)
    r, p, w = print_abc(R)
    return f"mm; R = Rz(R) Ry(P) Rx(W), deg\nX: {x}  Y: {y}  Z: {z}\nW: {w}  P: {p}  R: {r}\n"


def _inserter() -> Inserter:
    from robotrue.program.formats.fanuc_insert import INSERTER

    return INSERTER


def _cutter() -> Cutter:
    from robotrue.program.formats.fanuc_chunks import CUTTER

    return CUTTER


LANGUAGE: Final = Language(
    name="fanuc_ls",
    suffixes=(".ls",),
    score=_score,
    reader=_read,
    writer=_write,
    called="a Fanuc LS program",
    sign=re.compile(rb"(?m)^[^\S\n]*+/PROG\b"),
    inserter=_inserter,
    cutter=_cutter,
    feeds=_feeds,
    frame_files=FrameFiles(
        names=("SYSFRAME.VA", "FRAMEVAR.VA", "POSREG.VA"),
        recognise=lambda text: bool(_VA.search(text) or _POSREG.search(text)),
        read=_read_frames,
    ),
    frame_form=FrameForm(
        name="fanuc",
        system="Fanuc",
        order="R = Rz(R) Ry(P) Rx(W), deg",
        frame=TableForm(first=1, last=61, print=_print_frame),
        tool=TableForm(first=1, last=30, print=_print_tool),
    ),
    prints_attitude=True,
    steps_from_command=True,
)
