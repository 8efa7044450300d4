"""Whole lines of a program file that are read, compensated and written together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from robotrue.program.program import Program


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Skeleton:
    """Input for reading a chunk besides its bytes; small, the same for every chunk.

    Attributes:
        program: The skeleton of the file as the ordinary reader reads it, without its bytes. Its
            targets are in the file; the last one not after another has the settings there.
        stored: The targets are stored points: the program states their motions.
        external_axes_at_rest: As in :class:`~robotrue.program.program.FrameTable`.
    """

    program: Program
    stored: bool
    external_axes_at_rest: bool


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
