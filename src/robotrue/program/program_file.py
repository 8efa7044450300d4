"""The files of a job, each read, compensated and written a chunk at a time.

A file is one chunk, the :class:`Program` that the ordinary reader makes of it, unless it is long
and its dialect can cut it. Then one quick pass over the file finds where the frames may change and
where a target depends on the one before; the ordinary reader reads a *skeleton* of the file, in
which every stretch of plain motions is represented by a few of them. Its result for those applies
to the whole stretch. A chunk is whole lines with a given number of targets, so the chunks depend on
the file alone.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import sha256
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.formats import detect, read_job
from robotrue.program.formats.file_survey import Survey
from robotrue.program.formats.job_files import gather_files, outlined_paths
from robotrue.program.frames_beside import with_files_beside
from robotrue.program.lang import find_language
from robotrue.program.language import LONG, Cutter, Language
from robotrue.program.program import (
    FrameTable,
    Program,
    Reason,
    Replacement,
    find_open,
    leave_far,
)
from robotrue.program.program_chunk import (
    ChunkLines,
    ProgramChunk,
    ReadChunk,
    Skeleton,
    Whole,
)

CHUNK: Final = 50_000
"""Targets of a chunk of a long file."""
BYTES_HELD: Final = 4, 230
"""Bytes of memory for each byte, and for each decimal number, of a program that is held whole."""
LEAST_HELD: Final = 10
"""Bytes of memory for each byte of one with few decimal numbers."""
BESIDE: Final = 250 << 20
"""Bytes of memory besides."""
_LOOKED_AT: Final = 1 << 20
_COUNT: Final = re.compile(r"\b\d+ (?=targets|points|positions)")
"""In a note on the skeleton: too few."""
_PLACE: Final = re.compile(r"(?<=:)\d+(?:, \d+)*(?=:| and )|(?<=\bline )\d+")
"""Lines in a note."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramFile:
    """One file of a job.

    Attributes:
        name: File name.
        dialect: Registered name of the dialect.
        size: Bytes.
        sha256: Of the bytes.
        targets: How many there are.
        T_flange_tool: (t, 4, 4) as in :class:`Program`.
        start: As in :class:`Program`.
        notes: What the reader wants the user to know; of a file that is cut, without counts, and
            without those that its chunks have (:attr:`Program.noted`).
        chunks: In file order; together they are the file.
        content: The program, where it is held whole; else how a chunk is read.
        held: The program of a file that is held whole.
    """

    name: str
    dialect: str
    size: int
    sha256: str
    targets: int
    T_flange_tool: Array
    start: Array
    notes: tuple[str, ...]
    chunks: tuple[ProgramChunk, ...]
    content: Program | Skeleton
    held: Program | None = field(init=False)

    def __post_init__(self) -> None:
        """Sets ``held`` to a program that is held whole."""
        held = self.content if isinstance(self.content, Program) else None
        object.__setattr__(self, "held", held)

    @property
    def frames_in_use(self) -> Array:
        """(k, 4, 4) work frames of targets that can be compensated."""
        content = self.content
        program = content if isinstance(content, Program) else content.program
        return np.asarray(program.T_base_frame[program.frame[program.reason == Reason.NONE]])


def hold_program(program: Program) -> ProgramFile:
    """Returns the file of a program that is held whole: one chunk."""
    lines = ChunkLines(0, len(program.data), 0)
    return ProgramFile(
        name=program.name,
        dialect=program.dialect,
        size=len(program.data),
        sha256=sha256(program.data),
        targets=len(program),
        T_flange_tool=program.T_flange_tool,
        start=program.start,
        notes=program.notes,
        chunks=(ProgramChunk(lines=lines, lead=lines, first=0, targets=len(program)),),
        content=program,
    )


def open_job(
    paths: Sequence[Path],
    frames: FrameTable,
    *,
    several: bool,
    why_whole: Callable[[], str],
    note: Callable[[str], None],
) -> tuple[ProgramFile, ...]:
    """Returns the files of a job in its order.

    Args:
        paths: As for :func:`~robotrue.program.formats.read_job`.
        frames: Frames that they name but do not hold.
        several: Workers are requested, so that even a short program is cut.
        why_whole: Returns the option that needs whole programs; empty without one. Called for long
            ones.
        note: Called with why a long program is held whole.

    Raises:
        ConfigurationError: It must be held whole, and this machine has not the memory.
        FormatError: A file cannot be read, or is not in its dialect.
    """
    if len(paths) == 1 and not paths[0].is_dir():
        longest, language = find_longest(paths[0])
        size = longest.stat().st_size
        if size >= min(LONG, language.long) or several:
            why = why_whole()
            files = Whole(why=why) if why else outline_job(paths[0], frames)
            if not isinstance(files, Whole):
                return files
            note(_require_memory(longest, size, files))
    return tuple(map(hold_program, read_job(paths, frames)))


def _require_memory(path: Path, size: int, why: Whole) -> str:
    """Returns what holding a program takes.

    Raises:
        ConfigurationError: This machine has not so much.
    """
    with path.open("rb") as stream:
        sample = stream.read(_LOOKED_AT)
    numbers = size * sample.count(b".") // max(len(sample), 1)
    per_byte, per_number = BYTES_HELD
    need = max(per_byte * size + per_number * numbers, LEAST_HELD * size) + BESIDE
    text = f"the program is held whole ({why}); this takes about {_mib(need)}"
    if need > _memory():
        raise ConfigurationError(
            f"{text}, this machine has {_mib(_memory())}.",
            source=path,
            hint="split the program into files, or omit the options that need the whole.",
        )
    return f"{text}."


def _memory() -> int:
    """Returns the memory of this machine in bytes; without bound where it states none."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 1 << 60


def _mib(count: int) -> str:
    return f"{count / 2**20:.0f} MiB of memory"


def find_longest(path: Path) -> tuple[Path, Language]:
    """Returns the longest of a program file and those next to it, and their dialect.

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
    job = outlined_paths(path, language)
    return max(job, key=lambda one: one.stat().st_size), language


def outline_job(
    path: str | Path, frames: FrameTable, *, targets: int = CHUNK
) -> tuple[ProgramFile, ...] | Whole:
    """Returns the files of a job with the longest cut into chunks, or why it cannot be.

    Args:
        path: A program file; its companions lie next to it.
        frames: What the program names but does not hold.
        targets: Targets of a chunk.

    Raises:
        FormatError: A file cannot be read, or is not in its dialect.
    """
    path = Path(path)
    longest, language = find_longest(path)
    if language.cutter is None:
        return Whole(why=f"programs in {language.name} have no outline")
    frames, noted = with_files_beside(path, language.name, frames)
    survey = language.cutter().survey_file(longest.name, frames, targets)
    if isinstance(survey, Whole):
        return survey
    beside = [each for each in outlined_paths(path, language) if each != longest]
    refused = survey.run(longest, beside)
    if refused is not None:
        return refused
    instead = {name: part.skeleton for name, part in survey.parts.items()}
    job = gather_files([path], language, instead=instead)
    names = [name for name, _ in job.files]
    try:
        programs = language.read_job(job.files, frames=frames)
    except FormatError as cause:
        line = None if cause.line is None else survey.locate(cause.line)
        raise FormatError(cause.message, source=cause.source, line=line, hint=cause.hint) from None
    others = [file for file in job.files if file[0] not in instead]
    cut: dict[str, ProgramFile] = {}
    for name, part in survey.parts.items():
        skeleton = _in_file(programs[names.index(name)], part)
        refused = part.judge(skeleton, others)
        if refused is not None:
            return refused
        cut[name] = _outline_part(part, skeleton, language, frames, noted)
    return tuple(
        cut.get(name) or hold_program(program)
        for k, (name, program) in enumerate(zip(names, programs, strict=True))
        if name == longest.name or k < job.given or len(program)
    )


def _outline_part(
    survey: Survey, skeleton: Program, language: Language, frames: FrameTable, noted: Sequence[str]
) -> ProgramFile:
    """Returns the outline of a file that is cut."""
    reason = np.where(skeleton.reason == Reason.OUT_OF_REACH, Reason.NONE, skeleton.reason)
    return ProgramFile(
        name=skeleton.name,
        dialect=language.name,
        size=survey.size,
        sha256=survey.sha256,
        targets=survey.targets,
        T_flange_tool=skeleton.T_flange_tool,
        start=skeleton.start,
        notes=tuple(_COUNT.sub("", note) for note in (*skeleton.notes, *noted)),
        chunks=survey.chunks,
        content=Skeleton(
            program=replace(skeleton, data=b"", spans=None, notes=(), reason=reason),
            stored=survey.stored,
            external_axes_at_rest=frames.external_axes_at_rest,
            splice=survey.splice(),
        ),
    )


def _in_file(skeleton: Program, survey: Survey) -> Program:
    """Returns the skeleton with the lines of the file."""

    def lines(match: re.Match[str]) -> str:
        return ", ".join(str(survey.locate(int(each))) for each in match[0].split(", "))

    line = np.array([survey.locate(each) for each in skeleton.line.tolist()], np.int64)
    of_lines = {note.sentence(skeleton.name) for note in skeleton.noted}  # chunks have them
    notes = tuple(
        _PLACE.sub(lines, note) for note in survey.notes(skeleton) if note not in of_lines
    )
    return replace(skeleton, line=line, notes=notes)


def read_chunk(data: bytes, lines: ChunkLines, content: Program | Skeleton) -> ReadChunk:
    """Returns the targets of some lines, as in the program of the whole file.

    Statements are not read again: the skeleton contains their effect.

    Args:
        data: The bytes of the lines; those of a program that is held are not needed.
        lines: Their place.
        content: Of the file.

    Raises:
        FormatError: The bytes are not those the outline was made of.
    """
    if isinstance(content, Program):
        return ReadChunk(content)
    whole = content.program
    program, head, foot = _require_cutter(whole.dialect).read_lines(data, lines, content)
    line = program.line + lines.line
    if content.splice is not None:
        return ReadChunk(replace(program, line=line, notes=()), head, foot)
    same = np.searchsorted(whole.line, line, side="right") - 1
    own = ~find_open(program.reason)
    stated = replace(
        program,
        line=line,
        reason=np.where(own, program.reason, whole.reason[same]),
        motion=whole.motion[same] if content.stored else program.motion,
        frame=whole.frame[same],
        tool=whole.tool[same],
        T_base_frame=whole.T_base_frame,
        T_flange_tool=whole.T_flange_tool,
        notes=(),
    )
    return ReadChunk(leave_far(stated), head, foot)


def write_chunk(chunk: ReadChunk, replacement: Replacement) -> bytes:
    """Returns the bytes of a chunk with the changed numbers replaced and nothing else touched.

    Raises:
        ShapeError: A changed row has a value that cannot be written.
    """
    data = find_language(chunk.program.dialect).write(chunk.program, replacement)
    return data[chunk.head : len(data) - chunk.foot]


def _require_cutter(name: str) -> Cutter:
    make = find_language(name).cutter
    if make is None:
        raise ConfigurationError(f"programs in {name} have no outline.", hint="read them whole.")
    return make()
