"""Programs too long to hold: an outline of the file, and blocks of it that are read one by one.

A dialect that can be read in blocks makes one quick pass over the file. It finds where the frames
may change and where a target depends on the one before; the ordinary reader then judges a
*skeleton* of the file, in which every stretch of plain motions is represented by two of them. What
it says of those holds for the whole stretch. A block is whole lines with a given number of targets,
so the blocks depend on the file alone. What cannot be read so is read whole.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final, Protocol, cast

import numpy as np

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.errors import FormatError
from robotrue.program.controller_files import with_files_beside
from robotrue.program.formats import detect
from robotrue.program.formats.job_files import companion_paths, gathered
from robotrue.program.program import Dialect, FrameTable, Program, Replacement

BLOCK: Final = 50_000
"""Targets of a block."""
_LOOKED_AT: Final = 1 << 20
_COUNT: Final = re.compile(r"\b\d+ targets")
"""In a note on the skeleton: too few."""
_MODULES: Final[Mapping[str, str]] = {
    "krl": "robotrue.program.formats.krl_stream",
    "rapid": "robotrue.program.formats.rapid_stream",
    "urscript": "robotrue.program.formats.urscript_stream",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """The file must be read whole.

    Attributes:
        why: One clause.
        line: One-based line that asks for it, 0 if none does.
    """

    why: str
    line: int = 0

    def __str__(self) -> str:
        return f"line {self.line}: {self.why}" if self.line else self.why


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Some whole lines of a file.

    Attributes:
        start: First byte.
        end: Byte after the last.
        line: Zero-based line of the first byte.
        judged_from: (s,) zero-based lines from which another judgement holds; the first is not
            after any target of the piece.
        judgement: (s,) index into ``Outline.judged``.
    """

    start: int
    end: int
    line: int
    judged_from: IntArray
    judgement: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A piece to be compensated, and the lines before it that say where the arm comes from.

    Attributes:
        piece: Its lines.
        lead: The lines before.
        first: How many targets stand before the block.
        targets: How many stand in it.
    """

    piece: Piece
    lead: Piece
    first: int
    targets: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """What is known of a long file after one pass.

    Attributes:
        name: File name.
        dialect: Registered name of the dialect.
        size: Bytes.
        sha256: Of the bytes.
        targets: How many there are.
        judged: (s, 5) frame, tool, reason of a pose and of an axis target, and the motion, -1
            where the target itself says it.
        T_base_frame: (f, 4, 4) as in :class:`Program`.
        T_flange_tool: (t, 4, 4).
        external_axes_at_rest: As in :class:`FrameTable`.
        blocks: In file order; together they are the file.
        notes: What the reader wants the user to know; without counts.
        companions: The other programs of the job, read whole, in its order.
        place: How many of them come before this file.
        start: As in :class:`Program`.
    """

    name: str
    dialect: str
    size: int
    sha256: str
    targets: int
    judged: IntArray
    T_base_frame: Array
    T_flange_tool: Array
    external_axes_at_rest: bool
    blocks: tuple[Block, ...]
    notes: tuple[str, ...]
    companions: tuple[Program, ...]
    place: int
    start: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """All that reading a piece takes besides its bytes; small, the same for every piece.

    Attributes:
        name: File name.
        dialect: Registered name of the dialect.
        table: (s, 5) as in :class:`Outline`.
        T_base_frame: (f, 4, 4).
        T_flange_tool: (t, 4, 4).
        external_axes_at_rest: As in :class:`FrameTable`.
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


class Surveyed(Protocol):
    """What a dialect finds in one pass over a long file.

    Attributes:
        size: Bytes.
        targets: How many there are.
    """

    size: int
    targets: int

    @property
    def sha256(self) -> str:
        """Of the bytes."""
        ...

    @property
    def skeleton(self) -> bytes:
        """Text for the ordinary reader."""
        ...

    @property
    def blocks(self) -> tuple[Block, ...]:
        """In file order; ``judgement`` counts the stretches."""
        ...

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> IntArray | Whole:
        """Returns the judgement of every stretch (s, 5), or why there is none.

        Args:
            skeleton: As the ordinary reader reads it.
            others: The other files of the job.
        """
        ...


class Streamed(Protocol):
    """What the module of a dialect that can be read in blocks offers."""

    def survey(self, path: Path, frames: FrameTable, targets: int) -> Surveyed | Whole:
        """Returns what one pass over a file finds, or why it must be read whole.

        Raises:
            FormatError: The bytes are not in this dialect, with the line.
        """
        ...

    def read_piece(self, data: bytes, piece: Piece, judged: Judged) -> Program:
        """Returns the targets of a piece, as they stand in the program of the whole file."""
        ...

    def write_piece(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the bytes of a piece with the changed numbers replaced."""
        ...


def longest(path: Path) -> tuple[Path, Dialect]:
    """Returns the longest of a program file and those beside it, and their dialect.

    Raises:
        FormatError: The file cannot be read, or is in no registered dialect.
    """
    try:
        with path.open("rb") as stream:
            language = detect(stream.read(_LOOKED_AT), path.name)
    except OSError as cause:
        raise FormatError(
            f"cannot read: {cause.strerror}.", source=path, hint="check the path."
        ) from cause
    job = [path, *companion_paths(path, language)]
    return max(job, key=lambda each: each.stat().st_size), language


def outline(path: str | Path, frames: FrameTable, *, targets: int = BLOCK) -> Outline | Whole:
    """Returns the outline of the longest file of a job, or why the job must be read whole.

    Args:
        path: A program file; its companions lie beside it.
        frames: What the program names but does not hold.
        targets: Targets of a block.

    Raises:
        FormatError: A file cannot be read, or is not in its dialect.
    """
    path = Path(path)
    long, language = longest(path)
    if language.name not in _MODULES:
        return Whole(why=f"programs in {language.name} have no outline")
    frames, beside = with_files_beside(path, language.name, frames)
    found = _module(language.name).survey(long, frames, targets)
    if isinstance(found, Whole):
        return found
    job = gathered([path], language, instead={long.name: found.skeleton})
    programs = language.read_job(job.files, frames=frames)
    place = [name for name, _ in job.files].index(long.name)
    skeleton = programs[place]
    others = [file for k, file in enumerate(job.files) if k != place]
    table = found.judge(skeleton, others)
    if isinstance(table, Whole):
        return table
    kept = [
        program
        for k, program in enumerate(programs)
        if k != place and (k < job.given or len(program))
    ]
    return Outline(
        name=long.name,
        dialect=language.name,
        size=found.size,
        sha256=found.sha256,
        targets=found.targets,
        judged=table,
        T_base_frame=skeleton.T_base_frame,
        T_flange_tool=skeleton.T_flange_tool,
        external_axes_at_rest=frames.external_axes_at_rest,
        blocks=found.blocks,
        notes=tuple(_COUNT.sub("targets", note) for note in (*skeleton.notes, *beside)),
        companions=tuple(kept),
        place=sum(any(one is each for each in programs[:place]) for one in kept),
        start=skeleton.start,
    )


def judged(found: Outline) -> Judged:
    """Returns what reading a piece of the file takes."""
    return Judged(
        name=found.name,
        dialect=found.dialect,
        table=found.judged,
        T_base_frame=found.T_base_frame,
        T_flange_tool=found.T_flange_tool,
        external_axes_at_rest=found.external_axes_at_rest,
    )


def read_piece(data: bytes, piece: Piece, by: Judged) -> Program:
    """Returns the targets of a piece, as they stand in the program of the whole file.

    Args:
        data: The bytes of the piece.
        piece: Its place.
        by: What the outline says of the whole.

    Raises:
        FormatError: The bytes are not those the outline was made of.
    """
    return _module(by.dialect).read_piece(data, piece, by)


def write_piece(program: Program, replacement: Replacement) -> bytes:
    """Returns the bytes of a piece with the changed numbers replaced and nothing else touched.

    Raises:
        ShapeError: A changed row has a value that cannot be written.
    """
    return _module(program.dialect).write_piece(program, replacement)


def _module(name: str) -> Streamed:
    return cast(Streamed, import_module(_MODULES[name]))
