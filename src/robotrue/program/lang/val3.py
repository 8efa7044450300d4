"""Staubli VAL3: applications of version s7 and later, ``.dtx`` with the points, ``.pgx`` with code.

What is read: points and axis values of the ``.dtx``, frames and tools that it chains by
``fatherId``; movej, movel and movec of the ``.pgx`` to them. A ``.pjx`` names the files of its
application. Nothing but the numbers of points is ever rewritten, frames and tools least of all.
"""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG
from robotrue.program.controller_files import print_mm
from robotrue.program.lang.word_languages import LONG_PATH
from robotrue.program.language import Cutter, FrameForm, Language, NamedBytes, TableForm
from robotrue.program.program import FrameTable, Program, Replacement

_SCHEMA: Final = re.compile(rb"http://www\.staubli\.com/robotics/VAL3/(?:Data|Program|Project)/")
_OLD: Final = re.compile(rb"<(?:programList|dataList)\b|ProgramNameSpace|DataNameSpace")
_FILE: Final = re.compile(rb"\bfile\s*+=\s*+\"([^\"\r\n/\\:]+)\"")


def _score(data: bytes) -> float:
    """1 for the schema of VAL3, less for one before version 7."""
    return 1.0 if _SCHEMA.search(data) else 0.6 * bool(_OLD.search(data))


def _name_companions(name: str) -> tuple[str, ...]:
    """The data file of a program of the same name."""
    path = PurePath(name)
    return (f"{path.stem}.dtx",) if path.suffix.lower() == ".pgx" else ()


def _name_files(data: bytes) -> tuple[str, ...]:
    """The programs and data files of a project."""
    if b"<Project" not in data[:4096]:
        return ()
    names = [match[1].decode("utf-8", "replace") for match in _FILE.finditer(data)]
    return tuple(dict.fromkeys(name for name in names if name.lower().endswith((".pgx", ".dtx"))))


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.val3_read import read_val3

    return read_val3(files, frames)


def _write(program: Program, replacement: Replacement) -> bytes:
    from robotrue.program.formats.pose_write import spans_of
    from robotrue.program.formats.target_tokens import TargetTokens, rewritten

    tokens = spans_of(program, TargetTokens, "val3")
    return rewritten(program, replacement, tokens, (), aligned=False)


def _cutter() -> Cutter:
    from robotrue.program.formats.val3_chunks import CUTTER

    return CUTTER


def _value(xyz: Array, R: Array) -> str:
    x, y, z = print_mm(xyz)
    rz, ry, rx = (f"{np.round(-turn, 6) + 0.0:.6f}" for turn in abc_from_matrix(R.T) / DEG)
    return f'x="{x}" y="{y}" z="{z}" rx="{rx}" ry="{ry}" rz="{rz}"'


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    return (
        f'<Data name="{name}" access="private" xsi:type="array" type="frame" size="1">\n'
        f'  <Value key="0" {_value(xyz, R)} fatherId="world[0]" />\n</Data>\n'
    )


def _print_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    return (
        f'<Data name="{name}" access="private" xsi:type="array" type="tool" size="1">\n'
        f'  <Value key="0" {_value(xyz, R)} fatherId="flange[0]" ioLink="valve1" />\n</Data>\n'
    )


LANGUAGE: Final = Language(
    name="val3",
    suffixes=(".pgx", ".dtx", ".pjx"),
    score=_score,
    reader=_read,
    writer=_write,
    called="a VAL3 file",
    cutter=_cutter,
    long=LONG_PATH,
    sign=_SCHEMA,
    name_companions=_name_companions,
    name_files=_name_files,
    frame_form=FrameForm(
        name="val3",
        system="Staubli VAL3",
        order="R = Rx(rx) Ry(ry) Rz(rz): about x, then the new y, then the new z, deg",
        frame=TableForm(first=1, print=_print_frame),
        tool=TableForm(first=1, print=_print_tool),
    ),
    prints_attitude=True,
    one_text=True,
)
