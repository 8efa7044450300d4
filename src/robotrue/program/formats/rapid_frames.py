"""Tools and work objects of a RAPID module at each statement, as matrices.

``tooldata`` is ``[robhold, tframe, load]``, ``wobjdata`` is ``[robhold, ufprog, "ufmec", uframe,
oframe]``; a target in a work object is in world * uframe * oframe. They are read and never
rewritten.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_quat_wxyz
from robotrue.core.units import MM
from robotrue.program.formats.control_flow import DIFFERS, ControlFlow
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.rapid_scan import POSE, SKIP, arguments, clean, fills, numbers_of
from robotrue.program.program import FrameTable

TOOL: Final = "tool"
WORK: Final = "base"
KINDS: Final = {"tooldata": TOOL, "wobjdata": WORK}
_FRAMES: Final = {TOOL: ("tframe",), WORK: ("uframe", "oframe")}
_MEMBERS: Final = {
    TOOL: ("tframe", "robhold"),
    WORK: ("uframe", "oframe", "robhold", "ufprog", "ufmec"),
}
_OTHER: Final = ("tload",)
"""Members that do not affect the position of the target, given the others."""
_PATH: Final = re.compile(r"\s*\.\s*([\w\x80-\xff]+)\s*(.*)$", re.DOTALL)


Member: TypeAlias = Array | bool | str | None
"""A frame (4, 4), a truth, a mechanical unit, or None where it is not known."""


@dataclass(slots=True)
class _Variable:
    """Line of declaration, and the values of every member in order of assignment."""

    line: int
    versions: dict[str, list[Member]] = field(default_factory=lambda: defaultdict(list))
    _number: dict[tuple[str, object], int] = field(default_factory=dict)
    _lost: bool = False

    def version(self, member: str, what: Member) -> int:
        """Returns the number of a member's value; the same value has the same number."""
        key = (member, what.tobytes() if isinstance(what, np.ndarray) else what)
        versions = self.versions[member]
        if key not in self._number:
            self._number[key] = len(versions)
            versions.append(None if self._lost else what)
        return self._number[key]

    @property
    def changed(self) -> bool:
        """True if a member was assigned besides its declaration."""
        return any(len(given) > 1 for given in self.versions.values())

    def lose(self) -> None:
        """Forgets every value, those to come as well; their numbers stay."""
        self._lost = True
        for given in self.versions.values():
            given[:] = [None] * len(given)


class RapidFrames:
    """All tools and work objects.

    Attributes:
        frames: The matrices by index, and the sentence for each that is not known.
        elsewhere: Modules other than the one that is read, by the targets they declare.
        own: (side, name) of those no other module can change: LOCAL, CONST, or of a routine.
        renewed: (place, (side, name)) where one is given a whole value.
    """

    def __init__(self, table: FrameTable, name: str, course: ControlFlow) -> None:
        self.frames = Frames(table, name)
        self.elsewhere: dict[str, str] = {}
        self.own: set[tuple[str, str]] = set()
        self.renewed: list[tuple[int, tuple[str, str]]] = []
        self._table, self._course = table, course
        self._known: dict[tuple[str, str], _Variable] = {}
        given = _find_frame(table.bases, "wobj0")
        self._T_base_world = np.eye(4) if given is None else given

    def has(self, side: str, name: str) -> bool:
        """Returns whether the modules declare it."""
        return (side, name) in self._known

    def list_shared(self) -> list[tuple[str, str]]:
        """Returns side and name of those that other modules can change."""
        return [each for each in self._known if each not in self.own]

    def declare(self, side: str, name: str, value: bytes, line: int) -> None:
        """Enters a declaration; what is declared again after it was given a value is not known."""
        before = self._known.get((side, name))
        if before is not None and before.changed:
            before.lose()
            return
        variable = self._known[side, name] = _Variable(line)
        for member, what in self._whole(side, value).items():
            variable.version(member, what)

    def declare_beside(self, frames: Iterable[tuple[str, str, bytes, int, bool]]) -> None:
        """Enters what another module declares, where none before it does.

        Args:
            frames: Side, name, value, line, and whether no other module can change it.
        """
        for side, name, value, line, own in frames:
            if not self.has(side, name):
                self.declare(side, name, value, line)
                if own:
                    self.own.add((side, name))

    def assign(self, side: str, name: str, path: str, value: bytes, place: int) -> None:
        """Enters ``name.path := value`` at a place of the course."""
        variable = self._known[side, name]
        match = _PATH.match(path)
        if path.strip() and match is None:
            new: dict[str, Member] = dict.fromkeys(_MEMBERS[side])
        elif match is None:
            new = self._whole(side, value)
            self.renewed.append((place, (side, name)))
        else:
            member, deeper = match[1].lower(), match[2].strip()
            if member in _OTHER:
                return
            new = dict.fromkeys(_MEMBERS[side])
            if member in new:
                new = {member: None if deeper else _member(member, value)}
        for member, what in new.items():
            version = variable.version(member, what)
            self._course.set(place, (side, name, member), version)

    def lose(self, side: str, name: str, place: int) -> None:
        """Notes that something not followed may have changed it."""
        self.assign(side, name, ".?", b"", place)

    def _whole(self, side: str, value: bytes) -> dict[str, Member]:
        new: dict[str, Member] = dict.fromkeys(_MEMBERS[side])
        text = _bare(value)
        if not (text.startswith(b"[") and text.endswith(b"]")):
            return new
        found = arguments(text, 1, len(text) - 1)
        parts = [] if found is None else [text[a:b] for a, b in found.places]
        if side == TOOL and len(parts) == 3:
            new["robhold"], new["tframe"] = _truth(parts[0]), _frame(parts[1])
        if side == WORK and len(parts) == 5:
            new["robhold"] = _truth(parts[0])
            new["ufprog"] = _truth(parts[1])
            new["ufmec"] = _text(parts[2])
            new["uframe"], new["oframe"] = _frame(parts[3]), _frame(parts[4])
        return new

    def resolve(
        self, side: str, name: str, places: IntArray, line: int
    ) -> tuple[IntArray, BoolArray]:
        """Returns the index of the matrix at each place, and where part and tool are swapped.

        A swapped tool is fixed in the world: its index is one of the work frames. A swapped work
        object is held by the robot: its index is one of the tools.

        Args:
            side: ``TOOL`` or ``WORK``.
            name: Lower case; empty when the instruction names none.
            places: (n,) of the motions.
            line: Zero-based line of the first use, for the note.
        """
        variable = self._known.get((side, name))
        if variable is None:
            one = self._outside(side, name, line)
            return np.full(len(places), one), np.zeros(len(places), np.bool_)
        members = _MEMBERS[side]
        found = np.stack([self._course.versions((side, name, m), places) for m in members])
        first = np.flatnonzero(np.diff(found, axis=1, prepend=found[:, :1] - 1).any(axis=0))
        kinds, run = np.unique(found[:, first], axis=1, return_inverse=True)
        inverse = np.repeat(run.reshape(-1), np.diff(first, append=len(places)))
        index = np.empty(kinds.shape[1], np.int64)
        swapped = np.zeros(kinds.shape[1], np.bool_)
        for column in range(kinds.shape[1]):
            version = dict(zip(members, kinds[:, column].tolist(), strict=True))
            index[column], swapped[column] = self._one(side, name, variable, version)
        return index[inverse], swapped[inverse]

    def _one(
        self, side: str, name: str, variable: _Variable, version: dict[str, int]
    ) -> tuple[int, bool]:
        differs = [member for member, each in version.items() if each == DIFFERS]
        if differs:
            return self._lose(
                side, name, variable, f"depends on the path through the program ({differs[0]})"
            ), False
        values = {member: variable.versions[member][each] for member, each in version.items()}
        if values.get("ufprog") is False:
            return self._on_unit(name, variable, values), False
        held = values["robhold"]
        swapped = held is (side == WORK)
        stands = swapped is (side == TOOL)
        total = self._T_base_world if stands else np.eye(4)
        if held is None or values.get("ufprog", True) is None:
            return self._lose(side, name, variable, "is not given as numbers"), False
        for member in _FRAMES[side]:
            matrix = values[member]
            if not isinstance(matrix, np.ndarray):
                return self._lose(side, name, variable, "is not given as numbers"), False
            total = total @ matrix
        return self.frames.index_frame(WORK if stands else TOOL, total), swapped

    def _on_unit(self, name: str, variable: _Variable, values: Mapping[str, Member]) -> int:
        """Returns the index of a work object whose user frame a mechanical unit moves."""
        unit, oframe = values["ufmec"], values["oframe"]
        axes = [axis.name for axis in self._table.external if axis.frames]
        given = _find_frame(self._table.bases, unit.lower()) if isinstance(unit, str) else None
        known = isinstance(unit, str) and unit.lower() in {each.lower() for each in axes}
        if given is None or not known or not isinstance(oframe, np.ndarray):
            return self.frames.unknown(
                WORK, variable.line, f"{name!r} moves with another mechanical unit",
                "describe the unit in the cell: [[controller.external]] and [[controller.base]] of "
                "its name",
            )  # fmt: skip
        if values["robhold"] is not False:
            return self._lose(WORK, name, variable, "is held by the robot and by a unit")
        return self.frames.index_frame(WORK, given @ oframe, str(unit))

    def _outside(self, side: str, name: str, line: int) -> int:
        if side == WORK and name in ("", "wobj0"):
            return self.frames.index_frame(side, self._T_base_world)
        given = _find_frame(self._table.tools if side == TOOL else self._table.bases, name)
        if given is not None:
            return self.frames.index_frame(side, given, name)
        if name == "tool0":
            return self.frames.index_frame(side, np.eye(4))
        what = {TOOL: "tooldata", WORK: "wobjdata"}[side]
        shown = repr(name) if re.fullmatch(r"[\w\x80-\xff]+", name) else "of this instruction"
        return self.frames.unknown(
            side, line, f"{shown} is not in this module",
            f"copy its {what} into the module, or add it to the cell by this name",
        )  # fmt: skip

    def _lose(self, side: str, name: str, variable: _Variable, why: str) -> int:
        return self.frames.unknown(
            side, variable.line, f"{name!r} {why}", "write its frame as numbers before the motions"
        )


def _member(member: str, value: bytes) -> Member:
    if member == "ufmec":
        return _text(value)
    return _truth(value) if member in ("robhold", "ufprog") else _frame(value)


def _text(value: bytes) -> str | None:
    found = re.fullmatch(rb'"([^"]*)"', _bare(value))
    return found[1].decode("latin-1") if found else None


def _truth(value: bytes) -> bool | None:
    return {"true": True, "false": False}.get(clean(value).lower())


def _frame(value: bytes) -> Array | None:
    """Returns a pose literal as a matrix; None if it is not one."""
    value = _bare(value)
    match = fills(POSE, value, 0, len(value))
    if match is None:
        return None
    numbers = np.array([float(each) for each in numbers_of(match[0])])
    with np.errstate(over="ignore"):
        length = float(np.linalg.norm(numbers[3:]))
    if not (np.isfinite(numbers).all() and 0.5 < length < 2.0):
        return None
    out: Array = pose(matrix_from_quat_wxyz(numbers[3:]), numbers[:3] * MM)
    return out


def _bare(value: bytes) -> bytes:
    """Returns a value without the blanks and comments before it."""
    return SKIP.sub(b"", value, count=1).strip()


def _find_frame(table: Mapping[str, Array], name: str) -> Array | None:
    for key, matrix in table.items():
        if key.lower() == name:
            return np.asarray(matrix, dtype=np.float64)
    return None
