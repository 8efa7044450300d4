"""The work frames and tools a KRL program names, resolved to matrices where they are known."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.program.external_axes import Carried, carry_frames, plain_key, riders_of
from robotrue.program.formats.krl_scope import Scope
from robotrue.program.program import FrameTable

_FDAT: Final = re.compile(r"(TOOL_NO|BASE_NO|IPO_FRAME)\s+(#?\w+)", re.IGNORECASE)
_DATA: Final = re.compile(r"(BASE|TOOL)_DATA\s*\[\s*(\w+)\s*\]$", re.IGNORECASE)
_OF_FORM: Final = re.compile(
    r"S(TOOL2?|BASE)\s*\(\s*(\w+)\s*(?:\.\s*(?:TOOL|BASE)_NO\s*)?\)$", re.IGNORECASE
)
"""What inline forms of KSS 8 write after ``$TOOL =`` and ``$BASE =``."""
_EXTERNAL: Final = re.compile(r"EK\s*\(", re.IGNORECASE)
_EK_FORM: Final = re.compile(r"EK\s*\(\s*K_ROOT\s*\(\s*(\w+)\s*\.\s*BASE_NO\s*\)", re.IGNORECASE)
_EK_DATA: Final = re.compile(r",\s*BASE_DATA\s*\[\s*(\w+)\s*\]\s*\)\s*$", re.IGNORECASE)
_SIPO: Final = re.compile(r"SIPO_MODE\s*\(\s*(\w+)\s*\.\s*IPO_FRAME\s*\)", re.IGNORECASE)
_SET: Final = re.compile(r"\$(BASE|TOOL|IPO_MODE)\s*=\s*", re.IGNORECASE)
_IDENTITY: Final = ("$nullframe", "$world", "$robroot")


class Inline(NamedTuple):
    """FDAT: the numbers an inline form passes; ``None`` is not known."""

    tool: str | None
    base: str | None
    on_robot: bool


def read_fdat(text: str) -> Inline:
    """Returns the numbers in ``{TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}``."""
    found = {name.upper(): value for name, value in _FDAT.findall(text)}
    on_robot = found.get("IPO_FRAME", "#BASE").upper() != "#BASE"
    return Inline(found.get("TOOL_NO"), found.get("BASE_NO"), on_robot)


class DeferredFrame(NamedTuple):
    """A frame that is computed.

    Attributes:
        side: ``base`` or ``tool``.
        place: Its placeholder index.
        line: Zero-based, of the main text.
        text: The expression.
        numbered: It is the number of the frame.
        stored: Numbered frames as the program had set them up to here.
    """

    side: str
    place: int
    line: int
    text: str
    numbered: bool
    stored: dict[tuple[str, str], int]


UNSURE: Final = 2
"""Holder of the part: not known."""


class Setting(NamedTuple):
    """Assignment of ``$BASE``, ``$TOOL`` or ``$IPO_MODE`` in a WITH clause.

    Attributes:
        side: ``base``, ``tool`` or ``ipo_mode``.
        text: The right side.
        place: Where it begins.
    """

    side: str
    text: str
    place: int


def with_settings(code: str) -> list[Setting]:
    """Returns what a WITH clause sets of frames, up to the comma after each."""
    out = []
    found = list(_SET.finditer(code))
    for k, match in enumerate(found):
        last = found[k + 1].start() if k + 1 < len(found) else len(code)
        depth, end = 0, match.end()
        while end < last and (depth or code[end] != ","):
            depth += (code[end] in "({[") - (code[end] in ")}]")
            end += 1
        text = re.sub(r"(?<!\s)\s++C_\w++\s*$", "", code[match.end() : end])
        out.append(Setting(match[1].lower(), text.strip(), match.end()))
    return out


class Frames:
    """Work frames and tools as the program sets them, with the cell's table as fallback.

    Attributes:
        matrices: ``base`` and ``tool`` matrices by index; 0 is the default, NaN is not known.
        cures: The sentence for each one that is not known.
        scope: Which file a name belongs to.
        fdat: Inline-form data by name in that scope.
        may_differ: Whether side and number may have another value in a line than the last one set.
    """

    def __init__(self, table: FrameTable, name: str) -> None:
        self.table = table
        self.name = name
        self.scope = Scope()
        self.fdat: dict[str, Inline] = {}
        self.matrices: dict[str, list[Array]] = {
            "base": [np.asarray(table.T_base_frame, dtype=np.float64)],
            "tool": [np.asarray(table.T_flange_tool, dtype=np.float64)],
        }
        self.cures: dict[tuple[str, int], str] = {}
        self._riders = {("base", 0): riders_of(table.external, "base")}
        self._index: dict[tuple[str, bytes, tuple[bool, ...]], int] = {
            (side, (matrices[0] + 0.0).tobytes(), self._riders.get((side, 0), ())): 0
            for side, matrices in self.matrices.items()
        }
        self._unknown: dict[tuple[str, str], int] = {}
        self._data: dict[tuple[str, str], int] = {}
        self.may_differ: Callable[[str, str, int], bool] = lambda side, number, line: False

    def index_frame(self, side: str, matrix: Array, *keys: str) -> int:
        """Returns the index of a frame, entering it if it is new.

        Args:
            side: ``base`` or ``tool``.
            matrix: (4, 4).
            keys: What the table calls it, where an external axis may carry it.
        """
        matrix = matrix + 0.0  # -0.0 and 0.0 are one frame
        riders = riders_of(self.table.external, *keys) if side == "base" else ()
        key = (side, matrix.tobytes(), riders)
        if key not in self._index:
            index = self._index[key] = len(self.matrices[side])
            self._riders[side, index] = riders
            self.matrices[side].append(matrix)
        return self._index[key]

    def carry_frames(self, frame: IntArray, external: Array) -> Carried:
        """Returns the work frames of targets as external axes move them.

        Args:
            frame: (n,) index of each target.
            external: (n, 6) as printed, mm or deg; NaN where none is written.
        """
        axes, matrices = self.table.external, np.array(self.matrices["base"])
        none = (False,) * len(axes)
        riders = np.array([self._riders.get(("base", k), none) for k in range(len(matrices))])
        riders = riders.reshape(len(matrices), len(axes))
        still, on_robot = self.table.external_axes_at_rest, np.zeros(len(matrices), np.bool_)
        return carry_frames(axes, matrices, frame, external, riders, on_robot, rest=still)

    def unknown(self, side: str, line: int, what: str, cure: str) -> int:
        """Returns the index of a frame that is not known; its sentence names the first line."""
        if (side, what) not in self._unknown:
            self.matrices[side].append(np.full((4, 4), np.nan))
            index = self._unknown[side, what] = len(self.matrices[side]) - 1
            self.cures[side, index] = f"{self.name}:{line + 1}: the {side} {what}; {cure}."
        return self._unknown[side, what]

    def aggregate(self, side: str, line: int, values: Array) -> int:
        """Returns the index of a frame written as X, Y, Z, A, B, C in mm and deg."""
        if not np.isfinite(values).all():
            return self.unknown(
                side,
                line,
                "leaves components out or computes them",
                "write all of X, Y, Z, A, B, C as numbers",
            )
        written = pose_from_xyz_abc(values[:3] * MM, values[3:] * DEG)
        return self.index_frame(side, self.in_robot(side, written))

    def number(self, side: str, line: int, number: str | None, *, coupled: bool = False) -> int:
        """Returns the index of a numbered frame: set in the program, in the table, or 0.

        ``coupled``: a base on an external axis would be followed; a plain ``BASE_DATA`` is then the
        frame on that axis, used as if it were fixed in the world.
        """
        if number is None or not number.isdecimal():
            return self.unknown(
                side, line, f"number {number or '?'} is computed", "write the number out"
            )
        number = plain_key(number)
        if self.may_differ(side, number, line):
            what, cure = f"data {number} is also set elsewhere", "set it before its use there"
            return self.unknown(side, line, what, cure)
        if (side, number) in self._data:
            return self._data[side, number]
        matrix = _lookup(self._choose_table(side), number)
        rides = side == "base" and any(riders_of(self.table.external, number))
        if rides and not coupled:
            return self.unknown(
                side,
                line,
                f"number {number} is on an external axis and is used as if it were at rest",
                "set it with BAS(#EX_BASE,..) or EK(..)",
            )
        if matrix is not None:
            return self.index_frame(side, matrix, number)
        if number == "0":
            return self.index_frame(side, self.in_robot(side, np.eye(4)))
        return self.unknown(
            side,
            line,
            f"number {number} is stored in the controller ($config.dat), not in the program",
            f"add {side} {number} to the cell ([[controller.{side}]])",
        )

    def find_expression(self, side: str, line: int, text: str) -> int | None:
        """Returns the index of the right-hand side of ``$BASE=`` or ``$TOOL=``, not an aggregate.

        None is returned of what has to be evaluated.
        """
        text = text.strip()
        match = _OF_FORM.match(text)
        if match and self.scope.name(match[2]) in self.fdat and side == match[1][:4].lower():
            inline = self.fdat[self.scope.name(match[2])]
            return self.number(side, line, inline.tool if side == "tool" else inline.base)
        if side == "base" and _EXTERNAL.match(text):
            return self._external_base(line, text)
        match = _DATA.match(text)
        if match and match[1].lower() == side and match[2].isdecimal():
            return self.number(side, line, match[2])
        if text.lower() in _IDENTITY:
            at_robot = text.lower() == "$robroot"
            return self.index_frame(side, np.eye(4) if at_robot else self.in_robot(side, np.eye(4)))
        return None

    def find_named(self, side: str, line: int, text: str, why: str, cure: str) -> int:
        """Returns the index of a frame the cell's table has by name, else of one not known."""
        matrix = _lookup(self._choose_table(side), text)
        if matrix is not None:
            return self.index_frame(side, matrix, text)
        return self.unknown(
            side,
            line,
            f"is {text[:40]!r}, which the program does not hold as numbers"
            + (f" ({why})" if why else ""),
            cure or f"write the {side} as numbers, or add it to the cell by this name",
        )

    def reserve(self, side: str) -> int:
        """Returns a new index for a frame that is not known yet."""
        self.matrices[side].append(np.full((4, 4), np.nan))
        return len(self.matrices[side]) - 1

    def rename(self, index: Mapping[tuple[str, int], int]) -> None:
        """Gives numbered frames their indices: from side and placeholder index."""
        for (side, number), one in self._data.items():
            self._data[side, number] = index.get((side, one), one)

    def in_robot(self, side: str, matrix: Array) -> Array:
        """Returns a frame as the program writes it, in the robot base; tools as they are."""
        return matrix if side == "tool" else self.table.T_base_world @ matrix

    def stored_numbers(self) -> dict[tuple[str, str], int]:
        """Returns the numbered frames as the program has set them so far."""
        return dict(self._data)

    def holder(self, text: str) -> int:
        """Returns 0 for ``#BASE``, 1 for ``#TCP``, ``UNSURE`` for what is not known."""
        text = text.strip().lower()
        match = _SIPO.match(text)
        if match:
            inline = self.fdat.get(self.scope.name(match[1]))
            return UNSURE if inline is None else int(inline.on_robot)
        return {"#base": 0, "#tcp": 1}.get(text, UNSURE)

    def _external_base(self, line: int, text: str) -> int:
        """Returns the index of ``EK(..)``: a base on an external system of axes."""
        form, data = _EK_FORM.match(text), _EK_DATA.search(text)
        inline = self.fdat.get(self.scope.name(form[1])) if form else None
        number = inline.base if inline else data[1] if data else None
        return self.carried_number(line, number)

    def carried_number(self, line: int, number: str | None) -> int:
        """Returns the index of a numbered work frame that an external axis carries.

        The frame of the program or the controller under this number is relative to that axis, not
        to the robot base; only the cell defines its position.
        """
        if number is not None and number.isdecimal():
            matrix = _lookup(self.table.bases, number)
            if matrix is not None and any(riders_of(self.table.external, number)):
                return self.index_frame("base", matrix, number)
        return self.unknown(
            "base",
            line,
            f"number {number or '?'} follows an external axis",
            "describe the axis and this base in the cell ([[controller.external]])",
        )

    def differs_later(self, side: str, number: str, stored: Mapping[tuple[str, str], int]) -> bool:
        """Returns whether a numbered frame is set to something else than it was at some line."""
        key = side, plain_key(number)
        return key in self._data and self._data[key] != stored.get(key, -1)

    def store(self, side: str, number: str, index: int) -> None:
        """Remembers ``BASE_DATA[n]`` or ``TOOL_DATA[n]`` as the program writes it."""
        self._data[side, plain_key(number)] = index

    def inline_frames(self, line: int, inline: Inline) -> tuple[int, int, bool]:
        """Returns (base, tool, on robot) that an inline form's numbers select."""
        return (
            self.number("base", line, inline.base, coupled=True),
            self.number("tool", line, inline.tool),
            inline.on_robot,
        )

    def _choose_table(self, side: str) -> Mapping[str, Array]:
        return self.table.bases if side == "base" else self.table.tools


def _lookup(table: Mapping[str, Array], name: str) -> Array | None:
    for key, matrix in table.items():
        if plain_key(key) == plain_key(name):
            return np.asarray(matrix, dtype=np.float64)
    return None
