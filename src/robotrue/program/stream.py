"""Programs too long to hold: an outline of the file, and blocks of it that are read one by one.

A dialect that can be read in blocks makes one quick pass over the file. It finds where the frames
may change and where a target depends on the one before; the ordinary reader then judges a
*skeleton* of the file, in which every stretch of plain motions is represented by two of them. What
it says of those holds for the whole stretch. A block is whole lines with a given number of targets,
so the blocks depend on the file alone. What cannot be read so is read whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Final, Protocol, cast

import numpy as np

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.program.controller_files import with_files_beside
from robotrue.program.formats import detect
from robotrue.program.program import FrameTable, Program

BLOCK: Final = 50_000
"""Targets of a block."""
_LOOKED_AT: Final = 1 << 20
_MODULES: Final[Mapping[str, str]] = {"krl": "robotrue.program.formats.krl_stream"}


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
        judged: (s, 4) frame, tool, reason of a pose and of an axis target.
        T_base_frame: (f, 4, 4) as in :class:`Program`.
        T_flange_tool: (t, 4, 4).
        external_axes_at_rest: As in :class:`FrameTable`.
        blocks: In file order; together they are the file.
        notes: What the reader wants the user to know; without counts.
        companions: The other files of the job, read whole.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """All that reading a piece takes besides its bytes; small, the same for every piece.

    Attributes:
        name: File name.
        dialect: Registered name of the dialect.
        table: (s, 4) as in :class:`Outline`.
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
        table = frozen(self.table, (None, 4), "table", dtype=np.int64)
        object.__setattr__(self, "table", table)


class Streamed(Protocol):
    """What the module of a dialect that can be read in blocks offers."""

    def outline(
        self, path: Path, companions: tuple[Path, ...], frames: FrameTable, targets: int
    ) -> Outline | Whole:
        """Returns the outline of a file, or why there is none.

        Raises:
            FormatError: The bytes are not in this dialect, with the line.
        """
        ...

    def read_piece(self, data: bytes, piece: Piece, judged: Judged) -> Program:
        """Returns the targets of a piece, as they stand in the program of the whole file."""
        ...


def outline(path: str | Path, frames: FrameTable, *, targets: int = BLOCK) -> Outline | Whole:
    """Returns the outline of a program file with its companions, or why it must be read whole.

    Args:
        path: A program file; its companions lie beside it.
        frames: What the program names but does not hold.
        targets: Targets of a block.

    Raises:
        FormatError: The file cannot be read, or is not in its dialect.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            language = detect(stream.read(_LOOKED_AT), path.name)
    except OSError:
        read_bytes(path)  # says what is wrong
        raise FormatError("cannot read.", source=path, hint="check the path.") from None
    if language.name not in _MODULES:
        return Whole(why=f"programs in {language.name} are read whole")
    beside = [path.with_name(name) for name in language.companions(path.name)]
    found: list[Path] = []
    for other in beside:
        if other.is_file() and not any(other.samefile(one) for one in (path, *found)):
            found.append(other)
    table, said = with_files_beside(path, language.name, frames)
    out = _module(language.name).outline(path, tuple(found), table, targets)
    return replace(out, notes=(*out.notes, *said)) if isinstance(out, Outline) and said else out


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


def _module(name: str) -> Streamed:
    return cast(Streamed, import_module(_MODULES[name]))
