"""Words of G-code as tables: one vocabulary per control.

A code that only sets a state is in a group; a code with a separate effect is *odd* and goes to the
slow reader (:mod:`.gcode_odd`). A code in neither is odd, too: its effect is unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.gcode_kernels import CODES, INDICES

UNCERTAIN: Final = -1
"""A state that cannot be known: a jump, a call or a skipped block lies before."""

OPEN: Final = -3
"""A state behind a call or a jump, as scanned: uncertain unless only one value is ever set."""

NAMED: Final = -10
"""Work frames from here down are names that the slow reader met."""


class Modal(IntEnum):
    """States that stay in force until set again."""

    MOTION = 0
    PLANE = 1  # 0 XY, 1 ZX, 2 YZ
    RELATIVE = 2  # 0 absolute, 1 relative
    INCH = 3  # 0 mm, 1 inch
    FRAME = 4  # number of a name
    TIP = 5  # 0 rotary axes, 1 tool point with angles, 2 tool point with a tool axis
    SIDEWAYS = 6  # 1 while the radius of the tool is compensated
    SHIFTED = 7  # 1 while the program moves, turns or scales the coordinates
    AXIS_WISE = 8  # 1 while points are driven to axis by axis
    ANGLES = 9  # 0 as in the cell, 1 RPY, 2 another order
    CENTRE = 10  # 0 from the start of the arc, 1 absolute
    TOOL = 11  # number of a name


class Drive(IntEnum):
    """Values of ``Modal.MOTION``."""

    RAPID = 0
    LINE = 1
    RIGHT = 2
    LEFT = 3
    THROUGH = 4  # an arc through a point
    OTHER = 5  # splines, threads, tangential arcs
    CYCLE = 6  # a canned cycle at every point


class WordColumn(IntEnum):
    """Words with a stored number."""

    X = 0
    Y = 1
    Z = 2
    A = 3
    B = 4
    C = 5
    AX = 6  # tool axis
    AY = 7
    AZ = 8
    I = 9  # noqa: E741
    J = 10
    K = 11
    VX = 12  # point an arc goes through
    VY = 13
    VZ = 14
    R = 15
    J1 = 16
    J6 = 21
    STAT = 22
    TU = 23


WIDTH: Final = 24


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vocabulary:
    """One control.

    Attributes:
        name: Of the dialect.
        columns: Address (``X``, ``A3``, ``NX``) to column; -2 for one that does not concern
            positions.
        codes: ``G0``, ``G43.4``, ``M128`` to (group, value); group -2 does not concern positions.
        signs: See :func:`.gcode_kernels.read_blocks`.
        names: Addresses of the columns as they are inserted, by :class:`.path_words.Turn`.
        frames: Names of the zero offsets by their value in ``Modal.FRAME``; the first is none.
        increments: A number without a point may count increments.
        groups: States that programs can set, and set again after a call.
        holder: Where the control keeps its frames and tools, for sentences.
    """

    name: str
    columns: Mapping[str, int]
    codes: Mapping[str, tuple[int, int]]
    signs: tuple[int, int, int, int]
    names: tuple[tuple[bytes, ...], ...]
    frames: tuple[str, ...]
    increments: bool
    groups: tuple[Modal, ...]
    holder: Mapping[str, str]


@cache
def column_table(vocabulary: Vocabulary) -> IntArray:
    """Returns the columns by letter and second index, for the compiled reader."""
    out = np.full((26, INDICES), -1)
    for address, column in vocabulary.columns.items():
        tail = address[1:]
        if len(tail) < 2 and ((address[0].isalpha() and not tail.isalpha()) or tail in "XYZ"):
            index = 0 if not tail else 1 + int(tail) if tail.isdigit() else ord(tail) - 77
            out[ord(address[0]) - 65, index] = column
    return out


@cache
def address_table(vocabulary: Vocabulary) -> Mapping[bytes, int]:
    """Returns the columns by address as programs write it, for the slow reader."""
    return {address.encode(): column for address, column in vocabulary.columns.items()}


@cache
def code_tables(vocabulary: Vocabulary) -> tuple[IntArray, IntArray]:
    """Returns group and value (2, CODES) of G and M codes, for the compiled reader."""
    group, setting = np.full((2, CODES), -1), np.zeros((2, CODES), np.int64)
    for code, (kind, value) in vocabulary.codes.items():
        row, number = "GM".index(code[0]), round(10.0 * float(code[1:]))
        group[row, number], setting[row, number] = kind, value
    return group, setting


def _each(
    prefix: str, numbers: Iterable[float], what: tuple[int, int]
) -> dict[str, tuple[int, int]]:
    return {f"{prefix}{number:g}": what for number in numbers}


def _frames(first: int, numbers: Iterable[float]) -> dict[str, tuple[int, int]]:
    return {f"G{n:g}": (Modal.FRAME, k) for k, n in enumerate(numbers, first)}


NOTHING: Final = (-2, 0)
_POINT: Final = {"X": 0, "Y": 1, "Z": 2, "A": 3, "B": 4, "C": 5}
_ARC: Final = {"I": 9, "J": 10, "K": 11}
_MOTION: Final = {f"G{k}": (int(Modal.MOTION), k) for k in range(4)}
_COMMON: Final = {
    **_MOTION,
    **{f"G{17 + k}": (int(Modal.PLANE), k) for k in range(3)},
    "G90": (Modal.RELATIVE, 0), "G91": (Modal.RELATIVE, 1),
    "G40": (Modal.SIDEWAYS, 0), "G41": (Modal.SIDEWAYS, 1), "G42": (Modal.SIDEWAYS, 1),
    **_each("G", (94, 95, 96, 97, 93), NOTHING),
}  # fmt: skip
_QUIET_M: Final = tuple(set(range(1000)) - {6, 98, 99})
"""M codes switch things; tool changes and calls move."""

SINUMERIK_FRAMES: Final = (500, *range(54, 58), *range(505, 600))
SINUMERIK: Final = Vocabulary(
    name="sinumerik",
    columns={
        **_POINT, **_ARC, "A3": 6, "B3": 7, "C3": 8, "I1": 12, "J1": 13, "K1": 14, "CR": 15,
        "A2": 3, "B2": 4, "C2": 5, "STAT": 22, "TU": 23, **{f"JT{k}": 15 + k for k in range(1, 7)},
        **dict.fromkeys("NFSH", -2), **{f"{each}{k}": -2 for each in "SM" for k in range(1, 5)},
    },
    codes={
        **_COMMON,
        "G70": (Modal.INCH, 1), "G700": (Modal.INCH, 1),
        "G71": (Modal.INCH, 0), "G710": (Modal.INCH, 0),
        **_frames(0, SINUMERIK_FRAMES),
        **_each("G", (9, 25, 26, 60, 64, *range(601, 604), *range(641, 646), 450, 451), NOTHING),
        **_each("M", _QUIET_M, NOTHING),
        "G33": (Modal.MOTION, Drive.OTHER), "G331": (Modal.MOTION, Drive.OTHER),
        "G332": (Modal.MOTION, Drive.OTHER), "G63": (Modal.MOTION, Drive.OTHER),
    },
    signs=(59, 0, 0, 0),
    names=(
        (b"X", b"Y", b"Z", b"", b"", b""),
        (b"X", b"Y", b"Z", b"A=", b"B=", b"C="),
        (b"X", b"Y", b"Z", b"A3=", b"B3=", b"C3="),
        (b"",) * 6,
    ),
    frames=tuple(f"G{k}" for k in SINUMERIK_FRAMES),
    increments=False,
    groups=tuple(set(Modal) - {Modal.CENTRE}),
    holder={"base": "its table of zero offsets", "tool": "its table of tools"},
)  # fmt: skip

FANUC_FRAMES: Final = ("", *(f"G{k}" for k in range(54, 60)))
FANUC: Final = Vocabulary(
    name="fanuc_gcode",
    columns={**_POINT, **_ARC, "R": 15, **dict.fromkeys("NFSHDO", -2)},
    codes={
        **_COMMON,
        "G20": (Modal.INCH, 1), "G21": (Modal.INCH, 0),
        **_frames(1, range(54, 60)),
        "G43.4": (Modal.TIP, 1), "G43.5": (Modal.TIP, 2), "G43": (Modal.TIP, 0),
        "G234": (Modal.TIP, 1), "G49": (Modal.TIP, 0),
        "G90.1": (Modal.CENTRE, 1), "G91.1": (Modal.CENTRE, 0),
        "G33": (Modal.MOTION, Drive.OTHER), "G80": (Modal.MOTION, UNCERTAIN),
        **_each("G", (73, 74, 76, *range(81, 90)), (Modal.MOTION, Drive.CYCLE)),
        **_each("G", (5, 5.1, 8, 9, 25, 61, 61.1, 64, 98, 99, 13.1), NOTHING),
        **_each("M", _QUIET_M, NOTHING),
    },
    signs=(59, 40, 41, 0),
    names=(
        (b"X", b"Y", b"Z", b"", b"", b""),
        (b"X", b"Y", b"Z", b"A", b"B", b"C"),
        (b"X", b"Y", b"Z", b"I", b"J", b"K"),
        (b"",) * 6,
    ),
    frames=FANUC_FRAMES,
    increments=True,
    groups=tuple(set(Modal) - {Modal.AXIS_WISE, Modal.ANGLES, Modal.CENTRE}),
    holder={"base": "its work offsets", "tool": "its tool offsets"},
)  # fmt: skip

HEIDENHAIN: Final = Vocabulary(
    name="heidenhain",
    columns={
        **_POINT, "TX": 6, "TY": 7, "TZ": 8,
        **dict.fromkeys(("NX", "NY", "NZ", "F", "R"), -2),
    },
    codes={
        **_each("M", sorted(set(_QUIET_M) - {89, 91, 92, 114, 118, 130, 140}), NOTHING),
        "M128": (Modal.TIP, 1), "M129": (Modal.TIP, 0),
    },
    signs=(59, 0, 0, 1),
    names=(
        (b"X", b"Y", b"Z", b"", b"", b""),
        (b"X", b"Y", b"Z", b"A", b"B", b"C"),
        (b"X", b"Y", b"Z", b"TX", b"TY", b"TZ"),
        (b"",) * 6,
    ),
    frames=("",),
    increments=False,
    groups=(
        Modal.MOTION, Modal.PLANE, Modal.FRAME, Modal.TIP, Modal.SIDEWAYS, Modal.SHIFTED,
        Modal.TOOL,
    ),
    holder={"base": "its preset table", "tool": "its table of tools"},
)  # fmt: skip
