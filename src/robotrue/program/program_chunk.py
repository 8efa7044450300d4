"""Whole lines of a program file that are read, compensated and written together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from robotrue.core.arrays import Array, IntArray
from robotrue.program.program import FrameTable, Program


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """The file cannot be cut into chunks.

    Attributes:
        why: One clause.
        line: One-based line that requires it, 0 without one.
    """

    why: str
    line: int = 0

    def __str__(self) -> str:
        return f"line {self.line}: {self.why}" if self.line else self.why


class ChunkLines(NamedTuple):
    """Some whole lines of a file: first byte, byte after the last, zero-based first line."""

    start: int
    end: int
    line: int


class ProgramChunk(NamedTuple):
    """Lines to be compensated, and the lines before them that determine the arm's state.

    Attributes:
        lines: The lines.
        lead: The lines before.
        first: Number of targets before them.
        targets: Number of targets in them.
    """

    lines: ChunkLines
    lead: ChunkLines
    first: int
    targets: int


class SpliceStart(NamedTuple):
    """Begin of a chunk.

    Attributes:
        mode: Lines that set the modes in force there.
        point: First line of the chunk; empty for that of a lead.
        carried: Side and tool axis (2, 3) of the carried frame before it.
    """

    mode: bytes
    point: bytes
    carried: Array


class PointMoves(NamedTuple):
    """Moves to points that a skeleton has not.

    Attributes:
        first: Zero-based first line of the points of the file.
        end: The line after them.
        table: (k, 3) zero-based line and number of a point, and its motion.
    """

    first: int
    end: int
    table: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Splice:
    """The text of a skeleton whose lines are read together with those of a chunk.

    Attributes:
        text: Its lines, each with its end.
        edge: (k + 1,) first byte of each of them, and the size of the text.
        line: (k,) zero-based line of each in the file, rising.
        frames: What the program names but does not hold.
        starts: What is in force at the zero-based first line of every chunk and lead, if not in the
            skeleton.
        moves: Of a language of numbered points.
    """

    text: bytes
    edge: IntArray
    line: IntArray
    frames: FrameTable
    starts: Mapping[int, SpliceStart] = field(default_factory=dict)
    moves: PointMoves | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Skeleton:
    """Input for reading a chunk besides its bytes; small, the same for every chunk.

    Attributes:
        program: The skeleton of the file as the ordinary reader reads it, without its bytes. Its
            targets are in the file; the last one not after another has the settings there.
        stored: The targets are stored points: the program states their motions.
        external_axes_at_rest: As in :class:`~robotrue.program.program.FrameTable`.
        splice: Its text, where chunks are read together with it.
    """

    program: Program
    stored: bool
    external_axes_at_rest: bool
    splice: Splice | None = None


class ReadChunk(NamedTuple):
    """The targets of a chunk, and the bytes added around it to form a program.

    Attributes:
        program: Its data are the bytes between head and foot.
        head: Number of bytes before the chunk.
        foot: Number of bytes after it.
    """

    program: Program
    head: int = 0
    foot: int = 0
