"""Contract of a program language: one frozen object, made in one leaf file.

:mod:`robotrue.program.lang` registers the leaf files. All other code uses the object of a language;
no other file of the product lists languages.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError
from robotrue.program.insertion import Inserter
from robotrue.program.program import FrameTable, Program, Replacement, leave_far
from robotrue.program.program_chunk import ChunkLines, ReadChunk, Skeleton, Whole

if TYPE_CHECKING:
    from robotrue.program.controller_files import ControllerFile
    from robotrue.program.formats.file_survey import Survey

NamedBytes: TypeAlias = Sequence[tuple[str, bytes]]
"""Files of a job: name and bytes."""
LONG: Final = 32 << 20
"""Bytes from which a file is cut."""
ANY: Final = 1_000_000
"""Last number of a table whose entries have names."""


class Cutter(Protocol):
    """Reads a long file of a language a chunk of lines at a time."""

    def survey_file(self, name: str, frames: FrameTable, targets: int) -> Survey | Whole:
        """Returns the survey of a file of this name, not yet run, or why it cannot be cut."""
        ...

    def read_lines(self, data: bytes, lines: ChunkLines, skeleton: Skeleton) -> ReadChunk:
        """Returns the targets of some lines; lines, frames and reasons are those of the lines.

        Frames and reasons are those of the file if the skeleton has a splice.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Unfollowed:
    """What a written file cannot hold of new targets.

    Attributes:
        count: Number of targets.
        worst: Largest deviation, in the unit of the sentence.
        line: One-based line where it is.
        text: Sentence with the fields ``count``, ``worst`` and ``line``.
    """

    count: int
    worst: float
    line: int
    text: str

    def __str__(self) -> str:
        return self.text.format(count=self.count, worst=self.worst, line=self.line)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameFiles:
    """Files in which a controller saves its frames and tools.

    Attributes:
        names: Under which they lie next to a program, in any case.
        recognise: Returns whether a text (lines end with LF) is such a file.
        read: Returns the frames of a file by its name and text; raises FormatError, with the line,
            for a frame of which not all numbers can be read.
    """

    names: tuple[str, ...]
    recognise: Callable[[str], bool]
    read: Callable[[str, str], ControllerFile]


@dataclass(frozen=True, slots=True, kw_only=True)
class TableForm:
    """Format of an entry in the controller's table of frames or tools.

    Attributes:
        first: First number of the table.
        last: Last number; ``ANY`` where entries have names and the number is not used.
        print: Returns the lines, from position (3,) mm, rotation (3, 3), the name of a variable and
            the number in the table.
    """

    first: int
    last: int = ANY
    print: Callable[[Array, Array, str, int], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameForm:
    """Format of a frame or tool that is typed in or pasted.

    Attributes:
        name: Name in the user's request.
        system: The system that reads it; ``{}`` is replaced by the number in the table.
        order: Convention of its three or four rotation numbers.
        frame: Of its table of work frames.
        tool: Of its table of tools; None where it takes none.
        counted_from: Added to the number in ``system``.
    """

    name: str
    system: str
    order: str
    frame: TableForm
    tool: TableForm | None = None
    counted_from: int = 0


def _no_names(_: str) -> tuple[str, ...]:
    return ()


def _no_losses(_: Program, __: Replacement) -> tuple[Unfollowed, ...]:
    return ()


def _no_feeds(program: Program) -> Array:
    return np.full(len(program), np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """One program language.

    Attributes:
        name: Registered name; that of :attr:`Program.dialect`.
        suffixes: Of its files, in lower case.
        score: Returns 0..1: score of the first ``looked_at`` bytes of a file.
        reader: Returns one program per file of a job, read together; raises FormatError with file
            and line.
        writer: Returns the source bytes with the changed numbers, and only those, replaced.
        looked_at: Number of bytes scored.
        called: Noun of one of its programs in messages of other languages.
        sign: Found in its programs and in none of another language.
        name_companions: Names of files that belong to a file of this name, if they exist.
        name_files: Names of files next to a program that its text names; None where it names none.
        inserter: Returns the inserter of targets into its programs; None without one.
        cutter: Returns the reader of its long files in chunks; None where they are read whole.
        long: Bytes from which a file is cut.
        feeds: Returns the feed (n,) m/s as the text states it, infinite for rapids, NaN where it is
            not known.
        frame_files: Files of its controllers that hold frames.
        frame_form: Format of a frame in its controllers.
        losses: Returns what a written file cannot hold of the new targets.
        print_move: Returns one straight move to a pose (4, 4), tool in base, that stops there.
        prints_attitude: Its targets print the rotation about the tool axis in full.
        steps_from_command: Its relative targets start from the command before.
        one_text: The files of a job are one text of statements.
        family: Name shared with languages that use each other's suffixes.
        table_suffixes: Further suffixes its programs are written to.
    """

    name: str
    suffixes: tuple[str, ...]
    score: Callable[[bytes], float]
    reader: Callable[[NamedBytes, FrameTable], tuple[Program, ...]]
    writer: Callable[[Program, Replacement], bytes]
    looked_at: int = 1 << 16
    called: str = ""
    sign: re.Pattern[bytes] | None = None
    name_companions: Callable[[str], tuple[str, ...]] = _no_names
    name_files: Callable[[bytes], tuple[str, ...]] | None = None
    inserter: Callable[[], Inserter] | None = None
    cutter: Callable[[], Cutter] | None = None
    long: int = LONG
    feeds: Callable[[Program], Array] = _no_feeds
    frame_files: FrameFiles | None = None
    frame_form: FrameForm | None = None
    losses: Callable[[Program, Replacement], tuple[Unfollowed, ...]] = _no_losses
    print_move: Callable[[Array], str] | None = None
    prints_attitude: bool = False
    steps_from_command: bool = False
    one_text: bool = False
    family: str = ""
    table_suffixes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Checks the name and the suffixes.

        Raises:
            ConfigurationError: A name that is no word, or a suffix without dot or in upper case.
        """
        wrong = [each for each in self.suffixes if not re.fullmatch(r"\.[^.A-Z\s]+", each)]
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name) or wrong:
            raise ConfigurationError(
                f"language {self.name!r} with suffixes {', '.join(self.suffixes)}: the name is "
                "lower case, suffixes begin with a dot and are lower case.",
            )

    def detect(self, data: bytes) -> float:
        """Returns 0..1: how surely these bytes are in this language."""
        return self.score(data[: self.looked_at])

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one file.

        Raises:
            FormatError: The bytes are not in this language, with the line.
        """
        return self.read_job([(name, data)], frames=frames)[0]

    def read_job(self, files: NamedBytes, *, frames: FrameTable) -> tuple[Program, ...]:
        """Returns one program per (name, bytes), read together: points of one, motions of another.

        Raises:
            FormatError: The bytes are not in this language, with the file and line.
        """
        return tuple(map(leave_far, self.reader(files, frames)))

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the source bytes with the changed numbers, and only those, replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        return self.writer(program, replacement)


def read_each(
    read: Callable[[bytes, str, FrameTable], Program],
) -> Callable[[NamedBytes, FrameTable], tuple[Program, ...]]:
    """Returns the reader of a job of files that know nothing of each other."""

    def read_files(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
        return tuple(read(data, name, frames) for name, data in files)

    return read_files
