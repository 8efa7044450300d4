"""Work frames and tools of a G-code: zero offsets by name, tools by number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.program.formats.gcode_blocks import Blocks
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_vocabulary import NAMED, UNCERTAIN, Modal, Vocabulary
from robotrue.program.formats.numbered_frames import NumberedFrames
from robotrue.program.program import FrameTable


class GcodeFrames(NumberedFrames):
    """Indices of frames and tools for rows, and notes on unknown ones."""

    def __init__(
        self, table: FrameTable, name: str, blocks: Blocks, vocabulary: Vocabulary
    ) -> None:
        own = {
            f"{named} of line {block + 1}": matrix
            for block, named, matrix in blocks.findings.frames
            if matrix is not None
        }
        table = replace(table, bases={**table.bases, **own})
        super().__init__(table, name, holder=vocabulary.holder, zero_is_root=False)
        self._blocks, self._vocabulary = blocks, vocabulary
        self.notes: list[str] = []

    def columns(self, block: IntArray, force: IntArray) -> tuple[IntArray, IntArray]:
        """Returns frame and tool index (m,) of blocks (m,) with their state (m, groups)."""
        return self._bases(block, force[:, Modal.FRAME]), self._tools(block, force[:, Modal.TOOL])

    def tell(self, bases: IntArray, tools: IntArray) -> None:
        """Adds why frames and tools that are used are not known."""
        for side, used in (("base", bases), ("tool", tools)):
            self.notes += [self.lost[side, index] for index in np.unique(used).tolist()]

    def _bases(self, block: IntArray, setting: IntArray) -> IntArray:
        """A zero offset is what the program made of it when it called it, or that of the cell."""
        called = np.flatnonzero(self._blocks.state[:, Modal.FRAME] != NO_STATE)
        at = np.searchsorted(called, block, side="right") - 1
        since = np.where(at >= 0, called[at] if len(called) else 0, -1)
        made = np.array([each[0] for each in self._blocks.findings.frames], np.int64)
        version = np.searchsorted(made, since)
        local = np.searchsorted(self._local_blocks(), block)
        first, run = _runs(
            (setting * (len(made) + 1) + version) * (len(self._blocks.findings.local) + 1) + local
        )
        index = [
            self._base(int(setting[k]), int(version[k]), int(block[k]) + 1) for k in first.tolist()
        ]
        return np.array(index, np.int64)[run]

    def _local_blocks(self) -> IntArray:
        return np.array([each[0] for each in self._blocks.findings.local], np.int64)

    def _local_base(self, place: int, version: int, line: int) -> int:
        """Returns the frame that a local zero moves the work offset before it to."""
        findings = self._blocks.findings
        block, name, zero = findings.local[place]
        own = {NAMED - findings.names.index(each[1]) for each in findings.local}
        said = [each for each in self._list_stated(Modal.FRAME, block) if each not in own]
        inch = self._list_stated(Modal.INCH, block)
        if inch and inch[-1] != 0:
            what = f"{name} is not certainly in millimetres"
            return self.unknown("base", what, line, "state G21 before it")
        index = self._base_without_local(said[-1] if said else 0, version, line)
        if not any(zero):
            return index
        return self.shift("base", index, pose(np.eye(3), np.array(zero) * MM))

    def _list_stated(self, group: Modal, block: int) -> list[int]:
        """Returns the settings of a state before a block, in order."""
        column = self._blocks.state[:block, group]
        return [int(each) for each in column[column != NO_STATE].tolist()]

    def _base(self, setting: int, version: int, line: int) -> int:
        findings = self._blocks.findings
        before = [k for k, each in enumerate(findings.local) if each[0] < line - 1]
        if not before:
            return self._base_without_local(setting, version, line)
        _, name, zero = findings.local[before[-1]]
        if setting == NAMED - findings.names.index(name):
            return self._local_base(before[-1], version, line)
        if any(zero) and setting != UNCERTAIN:
            what = f"is called again while {name} may stay in force"
            return self.unknown("base", what, line, "end it with G52 X0. Y0. Z0. first")
        return self._base_without_local(setting, version, line)

    def _base_without_local(self, setting: int, version: int, line: int) -> int:
        name = self._frame_name(setting)
        for block, named, matrix in reversed(self._blocks.findings.frames[:version]):
            if named == name:
                if matrix is not None:
                    return self.number("base", f"{name} of line {block + 1}", line)
                what = f"{name} is set in line {block + 1} in a way that is not read"
                return self.unknown("base", what, line, "write it as CTRANS(..):CROT(..)")
        for block, named, _ in self._blocks.findings.frames[version:]:
            if named == name:
                what = f"{name} is set in line {block + 1}, and stays so for the next run"
                return self.unknown("base", what, line, "set it before it is called")
        if setting == UNCERTAIN:
            what = "is not certain behind a call, a label or a jump"
            return self.unknown("base", what, line, "call it again there")
        return self.number("base", name, line) if name else 0

    def _frame_name(self, setting: int) -> str:
        if setting <= NAMED:
            return self._blocks.findings.names[NAMED - setting]
        named = self._vocabulary.frames[setting] if setting >= 0 else ""
        return "" if named == "G500" else named

    def _tools(self, block: IntArray, setting: IntArray) -> IntArray:
        first, run = _runs(setting)
        index = [self._tool(int(setting[k]), int(block[k]) + 1) for k in first.tolist()]
        return np.array(index, np.int64)[run]

    def _tool(self, setting: int, line: int) -> int:
        if setting == 0:
            return 0
        if setting == UNCERTAIN:
            what = "is not certain behind a call, a label or a jump"
            return self.unknown("tool", what, line, "call it again there")
        name = self._blocks.findings.names[setting - 1]
        short = name[1:]
        keys = {key.strip().lower() for key in self._given["tool"]}
        named = not short[:1].isdigit() and name.lower() not in keys
        return self.number("tool", short if named or short.lower() in keys else name, line)


def _runs(column: IntArray) -> tuple[IntArray, IntArray]:
    """Returns where each run of equal values begins, and the run (n,) of every row."""
    fresh = np.diff(column, prepend=column[:1] - 1) != 0
    return np.flatnonzero(fresh), np.cumsum(fresh) - 1
