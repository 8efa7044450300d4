"""Yaskawa JBI: jobs of the DX, FS and YRC controllers as text files.

What is read: C and P points in mm and deg, in degrees of the axes, or in pulses when the pulses
per degree are given; MOVJ, MOVL, MOVC and MOVS; user frames and tools by number. Only the numbers
of robot points are ever rewritten; ``///NPOS`` stays true, because no point is added.
"""

from __future__ import annotations

import re
from typing import Final

from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG
from robotrue.program.controller_files import (
    NUMBER,
    ControllerFile,
    all_finite,
    frame_of,
    print_abc,
    print_mm,
    print_values,
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

_JOB: Final = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?|[\r\n])[ \t]*/JOB[ \t]*[\r\n]", re.IGNORECASE)
_SECTION: Final = re.compile(rb"[\r\n][ \t]*//(?:POS|INST|NAME)\b", re.IGNORECASE)
_CND: Final = re.compile(r"^//(TOOL|UFRAME)[ \t]+(\d{1,9})[ \t]*$", re.IGNORECASE)
_RATIOS: Final = re.compile(r"^///RC1G\b", re.MULTILINE)
_SIX: Final = re.compile(rf"{NUMBER}(?:[ \t]*,[ \t]*{NUMBER}){{5}}")
_BASIC: Final = re.compile(r"^/+BASICFRM[ \t]+(.*)$", re.IGNORECASE)
_BASE_FRAME: Final = 16
"""Second value of ``BASICFRM`` of a user frame in the base frame."""
_MOVE: Final = re.compile(rb"^MOV[LCS][ \t]+([CP]\d++)[^\r\n]*?\bV=" + PLAIN, re.MULTILINE)
_POINT: Final = re.compile(rb"[ \t]*([CP]\d+)")


def _score(data: bytes) -> float:
    """1 for ``/JOB`` with one of its sections, less for one of the two."""
    return 0.5 * bool(_JOB.search(data)) + 0.5 * bool(_SECTION.search(data))


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.jbi_read import read_jbi

    return read_jbi(files, frames)


def _write(program: Program, replacement: Replacement) -> bytes:
    from robotrue.program.formats.jbi_write import write_jbi

    return write_jbi(program, replacement)


def _feeds(program: Program) -> Array:
    stated = ((move[1], float(move[2])) for move in _MOVE.finditer(program.data))
    return feeds_of_points(program, stated, _POINT)


def _recognise_frames(text: str) -> bool:
    return any(_CND.match(line) for line in text.split("\n")[:64]) or bool(_RATIOS.search(text))


def _read_frames(name: str, text: str) -> ControllerFile:
    """The first six numbers after ``//TOOL n``, or ``////BUSER`` after ``//UFRAME n``.

    User frames are in the base frame unless ``///BASICFRM`` states another.
    """
    if _RATIOS.search(text):
        return ControllerFile(name=name, declarations=True)
    out = ControllerFile(name=name)
    notes: list[str] = []
    current: tuple[str, str] | None = None
    elsewhere = False
    for line in text.split("\n"):
        head = _CND.match(line)
        basic = _BASIC.match(line)
        if head:
            current, elsewhere = (head[1].upper(), str(int(head[2]))), False
        elif basic:
            values = [part.strip() for part in basic[1].split(",")]
            told = values[1] if len(values) > 1 else ""
            elsewhere = told.isdecimal() and int(told[:9]) != _BASE_FRAME
        elif current is not None:
            kind, number = current
            inside = line.strip()
            if kind == "UFRAME":
                if not re.match(r"/+BUSER\b", inside, re.IGNORECASE):
                    continue
                inside = re.sub(r"^/+BUSER[ \t]*=?", "", inside, flags=re.IGNORECASE).strip()
            elif not inside or inside.startswith("/"):
                continue
            if not _SIX.fullmatch(inside) or not all_finite(inside.split(",")):
                raise unreadable_frame(name, text, text.index(line), f"//{kind} {number}")
            current = None
            if elsewhere:
                notes.append(
                    f"{name}: user frame {number} is given in another frame than the base; give "
                    "it in cell.toml."
                )
                continue
            numbers = [float(part) for part in inside.split(",")]
            matrix = frame_of(numbers[:3], numbers[:2:-1])
            (out.bases if kind == "UFRAME" else out.tools)[number] = matrix
    return ControllerFile(name=name, bases=out.bases, tools=out.tools, notes=tuple(notes))


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    x, y, z = print_mm(xyz)
    rz, ry, rx = print_abc(R)
    return (
        f"User frame {number} {name}, mm; R = Rz(Rz) Ry(Ry) Rx(Rx), deg\n"
        f"X: {x}  Y: {y}  Z: {z}\nRx: {rx}  Ry: {ry}  Rz: {rz}\n"
    )


def _print_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    turns = (abc_from_matrix(R) / DEG)[::-1]
    return (
        "; in TOOL.CND: X,Y,Z mm, Rx,Ry,Rz deg, R = Rz(Rz) Ry(Ry) Rx(Rx)\n"
        f"//TOOL {number}\n///NAME {name[:16]}\n"
        f"{print_values(xyz, 3, ',')},{print_values(turns, 4, ',')}\n"
    )


def _inserter() -> Inserter:
    from robotrue.program.formats.jbi_insert import INSERTER

    return INSERTER


def _cutter() -> Cutter:
    from robotrue.program.formats.jbi_chunks import CUTTER

    return CUTTER


LANGUAGE: Final = Language(
    name="jbi",
    suffixes=(".jbi",),
    score=_score,
    reader=_read,
    writer=_write,
    called="a Yaskawa JBI job",
    sign=re.compile(rb"(?m)^/JOB\b"),
    inserter=_inserter,
    cutter=_cutter,
    feeds=_feeds,
    frame_files=FrameFiles(
        names=("TOOL.CND", "UFRAME.CND", "ALL.PRM", "RC.PRM"),
        recognise=_recognise_frames,
        read=_read_frames,
    ),
    frame_form=FrameForm(
        name="yaskawa",
        system="Yaskawa",
        order="R = Rz(Rz) Ry(Ry) Rx(Rx), deg",
        frame=TableForm(first=1, last=63, print=_print_frame),
        tool=TableForm(first=0, last=63, print=_print_tool),
    ),
    prints_attitude=True,
)
