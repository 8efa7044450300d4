"""Whole lines of a program file that are read, compensated and written together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.program.program import Program


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """The file cannot be cut into chunks.

    Attributes:
        why: One clause.
        line: One-based line that asks for it, 0 if none does.
    """

    why: str
    line: int = 0

    def __str__(self) -> str:
        return f"line {self.line}: {self.why}" if self.line else self.why


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkLines:
    """Some whole lines of a file.

    Attributes:
        start: First byte.
        end: Byte after the last.
        line: Zero-based line of the first byte.
        rule_from: (s,) zero-based lines from which another rule holds; the first is not after any
            target of the lines.
        rule: (s,) rows of ``ChunkRules.table``.
    """

    start: int
    end: int
    line: int
    rule_from: IntArray
    rule: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramChunk:
    """Lines to be compensated, and the lines before them that say where the arm comes from.

    Attributes:
        lines: The lines.
        lead: The lines before.
        first: How many targets stand before them.
        targets: How many stand in them.
    """

    lines: ChunkLines
    lead: ChunkLines
    first: int
    targets: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkRules:
    """All that reading a chunk takes besides its bytes; small, the same for every chunk.

    Attributes:
        name: File name.
        dialect: Registered name of the dialect.
        table: (s, 5) frame, tool, reason of a pose and of an axis target, and the motion, -1 where
            the target itself says it.
        T_base_frame: (f, 4, 4) as in :class:`Program`.
        T_flange_tool: (t, 4, 4).
        external_axes_at_rest: As in :class:`~robotrue.program.program.FrameTable`.
    """

    name: str
    dialect: str
    table: IntArray
    T_base_frame: Array
    T_flange_tool: Array
    external_axes_at_rest: bool

    def __post_init__(self) -> None:
        """Checks shapes and freezes."""
        table = frozen(self.table, (None, 5), "table", dtype=np.int64)
        object.__setattr__(self, "table", table)


class ReadChunk(NamedTuple):
    """The targets of a chunk, and what was put around its bytes to make a program of them.

    Attributes:
        program: Its data are the bytes between head and foot.
        head: How many bytes stand before the chunk.
        foot: How many stand behind it.
    """

    program: Program
    head: int = 0
    foot: int = 0
