"""Meaning of a program's blocks: plain ones read by compiled code, odd ones one by one."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.program.formats.gcode_kernels import NO_STATE, ODD, count_letters, read_blocks
from robotrue.program.formats.gcode_vocabulary import (
    OPEN,
    Modal,
    Vocabulary,
    WordColumn,
    code_tables,
    column_table,
)
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.program import Reason

ALL: Final = tuple(range(WordColumn.R))
POINT: Final = (0, 1, 2)
_NUMBERED: Final = re.compile(rb"(?im)^[ \t/:]*N(\d{1,9})(?!\d)")
_NEVER: Final = 2**31
PROGRAM_NUMBER: Final = re.compile(rb"(?im)^[ \t]*O0*(\d{1,8})\b")
_EVERY: Final = (*ALL, *range(WordColumn.J1, WordColumn.J6 + 1))
_LARGEST: Final = 1e8
"""Of any number in a block; 100 km."""
Take = Callable[[int, int, bytes], None]
"""Takes an odd block: its number, its first byte, its text without the comment."""

CALLED: Final = "called"
"""The shift of a program that is called while coordinates are shifted: it cannot end it."""


@dataclass(slots=True)
class Findings:
    """Results of the slow reader, by block.

    Attributes:
        groups: States that programs of the control can set.
        shifts: Coordinate shifts in force.
        moved: Those that may be in force, also behind calls and jumps.
        ever_moved: Any is in force anywhere.
        begun: Those that are in force anywhere.
        elsewhere: Those that may be in force behind any call or jump, by programs of the job.
        reached: First block that a jump leads to, where it is known before.
        breaks: Blocks behind which the modal state is uncertain, with whether any is ``moved``.
        jumps: Those of them that branch, repeat, or have a label.
        entries: Blocks that jumps lead to.
        anchors: Blocks that move coordinates by where the robot is.
        rounds: Blocks that begin the program again if nothing has called it (M99).
        targets: Block numbers that are jumped to; -1 for one that is computed.
        words: (block, column, first byte, bytes, value); NaN and -1 for one that is computed.
        state: Settings by (block, group).
        lost: Columns that are unknown when a block ends, by block.
        changes: Blocks that load the chosen tool.
        flags: Why the point of a block cannot be compensated.
        silent: Blocks whose coordinates are not a target.
        frames: (block, name, matrix or None) of work frames the program sets; None is not known.
        local: (block, name, x y z as printed) of local zeros (G52) that are constants; the name is
            a separate work frame.
        names: Names of frames and tools, whose numbers are states.
        told: (first byte, sentence about the text there).
        remarks: (first byte, sentence) that leaves nothing out.
        inch: Unit the head of the program states: None where it does not.
    """

    groups: tuple[Modal, ...] = tuple(Modal)
    shifts: dict[str, bool] = field(default_factory=dict)
    moved: set[str] = field(default_factory=set)
    ever_moved: bool = False
    begun: set[str] = field(default_factory=set)
    elsewhere: frozenset[str] = frozenset()
    reached: int = _NEVER
    breaks: list[tuple[int, bool]] = field(default_factory=list)
    jumps: list[int] = field(default_factory=list)
    entries: list[int] = field(default_factory=list)
    anchors: list[int] = field(default_factory=list)
    rounds: list[int] = field(default_factory=list)
    targets: set[int] = field(default_factory=set)
    words: list[tuple[int, int, int, int, float]] = field(default_factory=list)
    state: dict[tuple[int, int], int] = field(default_factory=dict)
    lost: dict[int, tuple[int, ...]] = field(default_factory=dict)
    changes: list[int] = field(default_factory=list)
    flags: dict[int, Reason] = field(default_factory=dict)
    silent: set[int] = field(default_factory=set)
    frames: list[tuple[int, str, Array | None]] = field(default_factory=list)
    local: list[tuple[int, str, tuple[float, float, float]]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    told: list[tuple[int, str]] = field(default_factory=list)
    remarks: list[tuple[int, str]] = field(default_factory=list)
    inch: bool | None = None

    def name(self, text: str) -> int:
        """Returns the number of a name."""
        if text not in self.names:
            self.names.append(text)
        return self.names.index(text)

    def set(self, block: int, group: Modal, value: int) -> None:
        """Sets a state from this block on."""
        self.state[block, int(group)] = value

    def barrier(self, block: int) -> None:
        """Discards the modal state: code between this block and the next is not read."""
        self.breaks.append((block, bool(self.moved)))
        self.shifts = {CALLED: True} if CALLED in self.shifts else {}
        for group in self.groups:
            self.state.setdefault((block, int(group)), OPEN)
        self.lost[block] = _EVERY

    def enter(self, block: int) -> None:
        """Discards it before a block that jumps lead to."""
        self.entries.append(block)
        for group in self.groups:
            self.state.setdefault((block, int(group)), OPEN)
        if block:
            self.lost[block - 1] = _EVERY

    def shift(self, block: int, kind: str, on: bool) -> None:
        """Records that coordinates are moved, turned or scaled in one way, or no longer."""
        self.shifts[kind] = on
        (self.moved.add if on else self.moved.discard)(kind)
        self.ever_moved |= on
        self.begun |= {kind} if on else set()
        entered = bool(self.breaks) or block >= self.reached
        maybe = self.moved | self.elsewhere if entered else self.moved
        behind = not maybe.issubset(self.shifts)  # a call or jump, and not ended since
        lasting = int(any(self.shifts.values()))
        self.set(block, Modal.SHIFTED, lasting or (OPEN if behind else 0))

    def forget(self, block: int, columns: tuple[int, ...] = ALL) -> None:
        """Forgets columns when the block ends."""
        self.lost[block] = (*self.lost.get(block, ()), *columns)

    def flag(self, block: int, reason: Reason) -> None:
        """Says why the point of a block cannot be compensated."""
        self.flags.setdefault(block, reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class Blocks:
    """A whole file.

    Attributes:
        data: The bytes.
        first: (l,) first byte of every block.
        end: (l,) its end without comment and line end.
        state: (l, groups) as set by each block, ``NO_STATE`` where it does not set one.
        block: (t,) block of every word, rising.
        column: (t,) :class:`WordColumn`.
        start: (t,) first byte of its number, -1 of one that is computed.
        length: (t,) bytes.
        value: (t,) NaN of one that is computed.
        findings: What the slow reader found.
    """

    data: bytes
    first: IntArray
    end: IntArray
    state: IntArray
    block: IntArray
    column: IntArray
    start: IntArray
    length: IntArray
    value: Array
    findings: Findings

    def line(self, block: int) -> int:
        """Returns the one-based line of a block."""
        return block + 1


def with_findings(
    columns: tuple[IntArray, IntArray, IntArray, IntArray, Array], found: Findings
) -> tuple[IntArray, IntArray, IntArray, IntArray, Array]:
    """Returns block, column, start, length and value of all words, by block."""
    if found.words:
        more = list(zip(*found.words, strict=True))
        columns = tuple(  # type: ignore[assignment]
            np.concatenate([old, np.array(new, old.dtype)])
            for old, new in zip(columns, more, strict=True)
        )
        order = np.argsort(columns[0], kind="stable")
        columns = tuple(each[order] for each in columns)  # type: ignore[assignment]
    return columns


def scan_blocks(
    data: bytes, name: str, vocabulary: Vocabulary, reader: Callable[[Vocabulary, Findings], Take]
) -> Blocks:
    """Returns the content of all blocks.

    Args:
        data: The bytes.
        name: Of the file, for messages.
        vocabulary: The control.
        reader: Makes the slow reader.

    Raises:
        FormatError: Not text, or what the slow reader refuses.
    """
    require_text(data, name)
    text, first = np.frombuffer(data, np.uint8), line_starts(data)
    last = np.append(first[1:], len(data))
    count, room = len(first), int(count_letters(text))
    status, end = np.zeros(count, np.int64), np.zeros(count, np.int64)
    state = np.full((count, len(Modal)), NO_STATE, np.int32)
    block, column = np.empty(room, np.int64), np.empty(room, np.int64)
    start, length, value = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room)
    size = read_blocks(
        text, first, last, column_table(vocabulary), *code_tables(vocabulary),
        np.array(vocabulary.signs), status, end, state, block, column, start, length, value,
    )  # fmt: skip
    columns = tuple(each[:size] for each in (block, column, start, length, value))
    for k in np.flatnonzero(np.isnan(columns[4])).tolist():
        at = int(columns[2][k])
        columns[4][k] = float(data[at : at + int(columns[3][k])])
    found = Findings(groups=vocabulary.groups)
    take = reader(vocabulary, found)
    for row in np.flatnonzero(status == ODD).tolist():
        take(row, int(first[row]), data[int(first[row]) : int(end[row])])
    settings = state.astype(np.int64)
    _enter_targets(data, first, settings, found)
    for (row, group), setting in found.state.items():
        settings[row, group] = setting
    block, column, start, length, value = with_findings(columns, found)  # type: ignore[arg-type]
    value = np.where(np.abs(value) < _LARGEST, value, np.nan)
    return Blocks(
        data=data, first=first, end=end, state=settings, block=block, column=column,
        start=start, length=length, value=value, findings=found,
    )  # fmt: skip


def _enter_targets(data: bytes, first: IntArray, state: IntArray, found: Findings) -> None:
    """Discards what is in force before blocks that are jumped to, or begin another program."""
    places = [
        match.start(1)
        for match in (_NUMBERED.finditer(data) if found.targets else ())
        if -1 in found.targets or int(match[1]) in found.targets
    ]
    entered = [int(row) - 1 for row in np.searchsorted(first, places, side="right")]
    for row in sorted({*entered, *list_starts(data, first)}):
        for group in np.flatnonzero(state[row] != NO_STATE).tolist():
            found.state.setdefault((row, group), int(state[row, group]))
        found.enter(row)


def list_starts(data: bytes, first: IntArray) -> list[int]:
    """Returns the blocks where programs behind the first one of a file begin.

    Args:
        data: The file.
        first: (l,) first byte of every block.
    """
    places = [match.start() for match in PROGRAM_NUMBER.finditer(data)][1:]
    return [int(row) - 1 for row in np.searchsorted(first, places, side="right")]
