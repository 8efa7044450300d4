"""Frames a program names by number and the controller holds: Yaskawa's and Fanuc's."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.program.external_axes import Carried, carry_frames, plain_key, riders_of
from robotrue.program.formats.text_lines import line_at
from robotrue.program.program import FrameTable

_SIDES: Final = {"base": "work frame", "tool": "tool"}
_END: Final = re.compile(rb"[\r\n]")
_LINE: Final = 1000
"""Bytes looked back for the beginning of a line."""


def list_changed_frames(
    files: Sequence[tuple[str, bytes]],
    words: Sequence[bytes],
    read: Callable[[bytes], Iterable[tuple[str, str]]],
) -> Mapping[tuple[str, str], str]:
    """Returns what changes numbered frames, by side and number, in the programs of a job.

    Args:
        files: Name and bytes of each.
        words: Of the statements that change one.
        read: Returns side and number of the frames that a line changes.
    """
    out: dict[tuple[str, str], str] = {}
    for name, data in files:
        for word in words:
            at = data.find(word)
            while at >= 0:
                least = max(at - _LINE, 0)
                begin = max(data.rfind(sign, least, at) for sign in (b"\n", b"\r"))
                end = found.start() if (found := _END.search(data, at)) else len(data)
                for side, number in read(data[max(begin + 1, least) : end]):
                    key = side, plain_key(number)
                    if key not in out:
                        out[key] = f"is changed by {name} in line {line_at(data, at)}"
                at = data.find(word, end)
    return out


class NumberedFrames:
    """Matrices of the numbered work frames and tools, looked up in the cell's table.

    Attributes:
        matrices: ``base`` and ``tool`` matrices by index; NaN is not known.
        lost: For each unknown index, the sentence with cause and remedy.
    """

    def __init__(
        self, table: FrameTable, name: str, *, holder: Mapping[str, str], zero_is_root: bool
    ) -> None:
        """Begins with the defaults.

        Args:
            table: What is known of the controller.
            name: Of the program file.
            holder: Where the controller keeps its ``base`` and ``tool`` data, for the sentences.
            zero_is_root: Number 0 is the robot's root, or the flange, when the table is silent.
        """
        self._given: dict[str, Mapping[str, Array]] = {"base": table.bases, "tool": table.tools}
        self._name, self._holder, self._zero = name, holder, zero_is_root
        self.matrices: dict[str, list[Array]] = {
            "base": [np.asarray(table.T_base_frame, dtype=np.float64)],
            "tool": [np.asarray(table.T_flange_tool, dtype=np.float64)],
        }
        self.lost: dict[tuple[str, int], str] = {}
        self._axes, self._at_rest = table.external, table.external_axes_at_rest
        self._riders = {0: riders_of(table.external, "base")}
        self._on_robot: set[int] = set()
        self._index: dict[tuple[str, str], int] = {}
        self._elsewhere = table.changed_frames
        self._changed: dict[tuple[str, str], str] = {}
        self._numbered: dict[tuple[str, str], int] = {}

    def change(self, side: str, number: str, line: int, by: str) -> None:
        """Notes that the program itself changes a numbered frame, so that it is not known."""
        self._changed.setdefault((side, plain_key(number)), f"is changed by {by} in line {line}")
        self._numbered.clear()

    def root(self, side: str) -> int:
        """Returns the index of the robot's root, or of the flange as a tool."""
        return self._enter(side, "root", np.eye(4))

    def robot_root(self) -> int:
        """Returns the index of the robot's root as a work frame that moves with the robot."""
        index = self._enter("base", "robot", np.eye(4))
        self._on_robot.add(index)
        return index

    def carry_frames(self, frame: IntArray, external: Array) -> Carried:
        """Returns the work frames of targets as external axes move them.

        Args:
            frame: (n,) index of each target.
            external: (n, 6) as printed, mm or deg; NaN where none is written.
        """
        matrices = self.stack_matrices("base")
        none = (False,) * len(self._axes)
        riders = np.array([self._riders.get(k, none) for k in range(len(matrices))])
        riders = riders.reshape(len(matrices), len(self._axes))
        on_robot = np.isin(np.arange(len(matrices)), list(self._on_robot))
        return carry_frames(
            self._axes, matrices, frame, external, riders, on_robot, rest=self._at_rest
        )

    def number(self, side: str, number: str, line: int) -> int:
        """Returns the index of a numbered frame; ``line`` is its first use."""
        if (side, number) not in self._numbered:
            self._numbered[side, number] = self._find_number(side, number, line)
        return self._numbered[side, number]

    def _find_number(self, side: str, number: str, line: int) -> int:
        printed, number = number.strip(), plain_key(number)
        what = self._changed.get((side, number)) or self._elsewhere.get((side, number))
        if what:
            return self.unknown(side, f"{printed} {what}", line, "compensate without it")
        for key, matrix in self._given[side].items():
            if plain_key(key) == number:
                index = self._enter(side, number, np.asarray(matrix, dtype=np.float64))
                if side == "base":
                    self._riders[index] = riders_of(self._axes, number)
                return index
        if number == "0" and self._zero:
            return self.root(side)
        return self.unknown(
            side,
            f"{printed} is in the controller ({self._holder[side]}), not in the program",
            line,
            f"add {side} {printed} to the cell ([[controller.{side}]])",
        )

    def shift(self, side: str, index: int, T_frame_shifted: Array) -> int:
        """Returns the index of a frame, or tool, moved in itself; that of one not known stays."""
        if (side, index) in self.lost:
            return index
        name = f"{index} by {T_frame_shifted.round(9).tolist()}"
        moved = self._enter(side, name, self.matrices[side][index] @ T_frame_shifted)
        if side == "base":
            self._riders[moved] = self._riders.get(index, (False,) * len(self._axes))
            if index in self._on_robot:
                self._on_robot.add(moved)
        return moved

    def unknown(self, side: str, what: str, line: int, cure: str) -> int:
        """Returns the index of a frame that is not known."""
        known = len(self.matrices[side])
        index = self._enter(side, "? " + what, np.full((4, 4), np.nan))
        if index == known:
            self.lost[side, index] = f"{self._name}:{line}: {_SIDES[side]} {what}; {cure}."
        return index

    def stack_matrices(self, side: str) -> Array:
        """Returns the matrices (f, 4, 4)."""
        return np.array(self.matrices[side])

    def list_lost(self, side: str) -> list[int]:
        """Returns the indices that are not known."""
        return [index for which, index in self.lost if which == side]

    def _enter(self, side: str, key: str, matrix: Array) -> int:
        if (side, key) not in self._index:
            self._index[side, key] = len(self.matrices[side])
            self.matrices[side].append(matrix)
        return self._index[side, key]
