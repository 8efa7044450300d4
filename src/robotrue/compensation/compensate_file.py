"""Compensation of a program file chunk by chunk, by several workers, in file order.

A chunk depends on the one before only through the state of the arm (:class:`ArmState`). A worker
solves a few hundred targets before its chunk to reach it; the chunk is used only if it started, bit
for bit, where the chunk before it ended, and is solved again from there otherwise. So the bytes are
those of :func:`robotrue.compensation.compensate.compensate` on the whole file, independent of the
workers. A file that is held whole is one chunk.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.chunk_workers import (
    ChunkJob,
    ChunkProcesses,
    ChunkTask,
    ChunkWorkers,
    CompensatedChunk,
    ThisProcess,
    drive_through,
)
from robotrue.compensation.compensate import load_about_part_origin
from robotrue.compensation.result import Compensation, Tally, sum_tallies
from robotrue.compensation.settings import CompensationSettings, compensation_setup
from robotrue.core.archive import archive_bytes
from robotrue.core.progress import Progress, unheard
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.line_note import LineNote, join_notes
from robotrue.program.program_chunk import ChunkLines
from robotrue.program.program_file import ProgramFile
from robotrue.robot.statics import NO_LOAD, Load

ALONE: Final = 2_000_000
"""Targets up to which one process is as quick as several, which take seconds to start."""
ALONE_SURE: Final = 200_000
"""The same with covariances, which take five times as long as all else."""
ReadLines: TypeAlias = Callable[[ChunkLines], bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensatedFile:
    """Result of compensating a program file.

    Attributes:
        tally: Sums over its targets.
        sha256: Of the bytes written.
        chunks: Number of chunks.
        again: Number of chunks solved again, since the arm came from elsewhere.
        workers: Number of workers.
        notes: What happened on the way.
        noted: Notes of the reader on lines of a file that is cut.
        held: What became of every target of a file that is held whole; None of one that is cut.
    """

    tally: Tally
    sha256: str
    chunks: int
    again: int
    workers: int
    notes: tuple[str, ...]
    noted: tuple[LineNote, ...]
    held: Compensation | None

    def summary(self) -> Mapping[str, object]:
        """Returns JSON values: the sums, and how it was done."""
        if self.held is not None:
            return {"route": "whole", **self.tally.summary()}
        return {
            **self.tally.summary(),
            "route": "blocks",
            "blocks": self.chunks,
            "blocks_done_again": self.again,
            "workers": self.workers,
        }


def compensate_file(
    model: ErrorModel,
    file: ProgramFile,
    source: str | Path,
    writing: BinaryIO,
    *,
    settings: CompensationSettings | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress = unheard,
) -> CompensatedFile:
    """Writes the compensated program and returns the sums over its targets.

    The bytes are those of :func:`~robotrue.compensation.compensate.compensate` and
    :func:`~robotrue.program.formats.write_program`; memory does not grow with a file that is cut.

    Args:
        model: Error of the robot; with :meth:`~ErrorModel.mean_tables` for a file that is cut.
        file: Outline of the source.
        source: The program.
        writing: Receives the bytes, such as :func:`~robotrue.core.files.atomic_stream`.
        settings: Load, guards and tolerances.
        workers: Processes; None: as many as speed it up. The caller's main module must be
            importable without side effects if not 1.
        dask: Address of a Dask scheduler that has workers; replaces processes.
        progress: Called with the number of targets done and the total.

    Raises:
        ConfigurationError: No tables, an invalid number of workers, or workers that died.
        FormatError: The source changed since it was outlined.
    """
    settings = settings or CompensationSettings()
    load = settings.load_for(file.targets)
    if file.held is not None:
        load = load_about_part_origin(file.held, load)
    job = _job(model, file, settings)
    closed = file.held is not None or job.setup.arm.has_closed_form
    alone = ALONE_SURE if settings.covariance else ALONE
    count = worker_count(file.targets, workers, alone=alone) if closed else 1
    digest, tallies, again = hashlib.sha256(), [], 0
    noted: tuple[LineNote, ...] = ()
    held: Compensation | None = None
    with (
        _workers(job, file, count, dask if closed else None, progress) as staff,
        _open_lines(file, source) as read,
    ):
        for solved, repeated in _in_order(staff, job, file, load, read):
            writing.write(solved.data)
            digest.update(solved.data)
            tallies.append(solved.tally)
            noted = join_notes([*noted, *solved.noted])
            again += repeated
            held = solved.held
            chunk = file.chunks[len(tallies) - 1]
            progress("compensating", chunk.first + chunk.targets, file.targets)
        notes = [] if closed else ["an arm without a closed form is solved by one process."]
        return CompensatedFile(
            tally=sum_tallies(tallies),
            sha256=digest.hexdigest(),
            chunks=len(file.chunks),
            again=again,
            workers=staff.count,
            notes=(*notes, *staff.notes),
            noted=noted,
            held=held,
        )


def worker_count(targets: int, asked: int | None, *, alone: int = ALONE) -> int:
    """Returns the number of worker processes: as requested, else as many as speed it up.

    Args:
        targets: Of the program.
        asked: Requested number; None: as many as speed it up, at most eight.
        alone: Targets up to which one is as fast as two.

    Raises:
        ConfigurationError: Fewer than one requested.
    """
    if asked is not None:
        if asked < 1:
            raise ConfigurationError(f"--workers is {asked}, expected 1 or more.")
        return asked
    if targets <= alone:
        return 1
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(cores or 1, 8, 1 + targets // alone))


def _workers(
    job: ChunkJob, file: ProgramFile, count: int, dask: str | None, progress: Progress
) -> ChunkWorkers:
    if file.held is not None or (dask is None and count == 1):
        return ThisProcess(job, progress if file.held is not None else unheard)
    job = replace(job, setup=replace(job.setup, model=None))
    if dask is not None:
        from robotrue.compensation.chunk_dask import DaskWorkers

        return DaskWorkers(job, dask)
    return ChunkProcesses(job, count)


def _job(model: ErrorModel, file: ProgramFile, settings: CompensationSettings) -> ChunkJob:
    external = None if file.held is None else file.held.external
    setup = compensation_setup(model, file.T_flange_tool, file.start, settings, external)
    if file.held is None and not setup.has_tables:
        raise ConfigurationError(
            "the model has no flat tables; programs are read whole with it.", source=file.name
        )
    plain = replace(setup.settings, load=NO_LOAD, wrench=np.empty(0))
    sure = settings.covariance and file.held is None
    return ChunkJob(
        name=file.name,
        setup=replace(setup, settings=plain),
        archive=archive_bytes(model.to_archive()) if sure else b"",
        content=file.content,
    )


def _in_order(
    staff: ChunkWorkers, job: ChunkJob, file: ProgramFile, load: Load, read: ReadLines
) -> Iterator[tuple[CompensatedChunk, bool]]:
    """Yields the chunks in file order, and whether each had to be done again."""
    state = guess = job.setup.start_state()
    if staff.ahead > 1:
        guess = _guess_state(job, file, read, state)
    submitted = 0
    for number in range(len(file.chunks)):
        while submitted < min(number + staff.ahead, len(file.chunks)):
            exact = submitted == number
            before = state if exact else guess
            staff.submit(_task(file, load, read, submitted, before, exact=exact))
            submitted += 1
        solved = staff.result(number)
        repeated = not solved.start.equals(state)
        if repeated:
            staff.submit(_task(file, load, read, number, state, exact=True))
            solved = staff.result(number)
        state = guess = solved.end
        yield solved, repeated


def _task(
    file: ProgramFile, load: Load, read: ReadLines, number: int, state: ArmState, *, exact: bool
) -> ChunkTask:
    chunk = file.chunks[number]
    return ChunkTask(
        number=number,
        lines=chunk.lines,
        data=read(chunk.lines),
        lead=None if exact else chunk.lead,
        lead_data=b"" if exact else read(chunk.lead),
        load=load.take(slice(chunk.first, chunk.first + chunk.targets)),
        state=state,
    )


def _guess_state(job: ChunkJob, file: ProgramFile, read: ReadLines, start: ArmState) -> ArmState:
    """Returns where the arm is soon after the program began: a guess for the first chunks."""
    state, lines = start.copy(), file.chunks[0].lines
    data = read(lines)
    if len(file.chunks) > 1:
        lead = file.chunks[1].lead
        end = data.find(b"\n", lead.end - lead.start) + 1
        data = data[:end] if end else data
    drive_through(job, lines, data, state, alike=job.setup.settings.alike)
    return state


@contextlib.contextmanager
def _open_lines(file: ProgramFile, source: str | Path) -> Iterator[ReadLines]:
    """Yields a reader of lines for a file that is cut; a whole file needs none."""
    if file.held is not None:
        yield lambda lines: b""
        return
    with Path(source).open("rb") as reading:
        yield partial(_read_lines, reading, file.name)
        if os.fstat(reading.fileno()).st_size != file.size:
            raise FormatError("the file changed while it was compensated.", source=source)


def _read_lines(reading: BinaryIO, name: str, lines: ChunkLines) -> bytes:
    reading.seek(lines.start)
    data = reading.read(lines.end - lines.start)
    if len(data) != lines.end - lines.start:
        raise FormatError("the file became shorter while it was read.", source=name)
    return data
