"""Compensation of programs too long to hold: block by block, by several workers, in file order.

A block depends on the one before only through where the arm is (:class:`ArmState`). A worker drives
through a few hundred targets before its block to get there; the block is taken only if it began,
bit for bit, where the block before it ended, and is done again from there otherwise. So the bytes
are those of :func:`robotrue.compensation.compensate.compensate` on the whole file, whoever did
which block.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.result import Tally, sum_tallies
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.setup import compensation_setup
from robotrue.compensation.stream_block import BlockTask, SolvedBlock, StreamJob, drive_through
from robotrue.compensation.stream_workers import Here, Processes, Workers
from robotrue.core.archive import archive_bytes
from robotrue.core.files import atomic_stream
from robotrue.core.progress import Progress, unheard
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.stream import Outline, Piece, judged
from robotrue.robot.statics import NO_LOAD, Load

ALONE: Final = 2_000_000
"""Targets up to which one process is as quick as several, which take seconds to start."""
ALONE_SURE: Final = 200_000
"""The same with covariances, which take five times as long as all else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Streamed:
    """What came of a long program.

    Attributes:
        tally: Sums over its targets.
        sha256: Of the bytes written.
        blocks: How many there were.
        again: How many of them had to be done again, since the arm came from elsewhere.
        workers: How many worked at a time.
        notes: What happened on the way.
    """

    tally: Tally
    sha256: str
    blocks: int
    again: int
    workers: int
    notes: tuple[str, ...]

    def summary(self) -> Mapping[str, Any]:
        """Returns JSON values: those of a program held whole, and how it was done."""
        return {
            **self.tally.summary(),
            "route": "blocks",
            "blocks": self.blocks,
            "blocks_done_again": self.again,
            "workers": self.workers,
        }


def _any(_: Tally) -> None:
    """Accepts whatever came of the targets."""


def compensate_stream(
    model: ErrorModel,
    found: Outline,
    source: str | Path,
    target: str | Path,
    *,
    settings: CompensationSettings | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress = unheard,
    accept: Callable[[Tally], None] = _any,
) -> Streamed:
    """Writes the compensated program to ``target`` and returns the sums over its targets.

    The file is that of :func:`~robotrue.compensation.compensate.compensate` and
    :func:`~robotrue.program.formats.write_program`, byte for byte; memory does not grow with it.

    Args:
        model: Error of the robot, with :meth:`~ErrorModel.mean_tables`.
        found: Outline of the source.
        source: The program.
        target: File to write; whole or not there.
        settings: As for a program held whole.
        workers: Processes; None: as many as help. The caller's main module must be importable
            without side effects where it is not one.
        dask: Address of a Dask scheduler that has workers; takes the place of processes.
        progress: Told how many blocks are done, and of how many.
        accept: Told the sums before the file takes its place; what it raises leaves none.

    Raises:
        ConfigurationError: No tables, a number of workers that is none, or workers that died.
        FormatError: The source changed since it was outlined, or the target cannot be written.
    """
    settings = settings or CompensationSettings()
    load = settings.load_for(found.targets)
    job = _job(model, found, settings, load)
    closed = job.setup.arm.has_closed_form
    alone = ALONE_SURE if settings.covariance else ALONE
    count = worker_count(found.targets, workers, alone=alone) if closed else 1
    digest, tallies, again = hashlib.sha256(), [], 0
    with (
        _workers(job, count, dask if closed else None) as staff,
        Path(source).open("rb") as reading,
        atomic_stream(target) as writing,
    ):
        for done, repeated in _in_order(staff, job, found, load, reading):
            writing.write(done.data)
            digest.update(done.data)
            tallies.append(done.tally)
            again += repeated
            progress("compensating", len(tallies), len(found.blocks))
        if os.fstat(reading.fileno()).st_size != found.size:
            raise FormatError("the file changed while it was compensated.", source=source)
        total = sum_tallies(tallies)
        accept(total)
        notes = [] if closed else ["an arm without a closed form is followed by one process."]
        return Streamed(
            tally=total,
            sha256=digest.hexdigest(),
            blocks=len(found.blocks),
            again=again,
            workers=staff.count,
            notes=(*notes, *staff.notes),
        )


def worker_count(targets: int, asked: int | None, *, alone: int = ALONE) -> int:
    """Returns how many processes are to work: as asked, else as many as help.

    Args:
        targets: Of the program.
        asked: How many; None: as many as help, at most eight.
        alone: Targets up to which one is as quick as two.

    Raises:
        ConfigurationError: Fewer than one asked for.
    """
    if asked is not None:
        if asked < 1:
            raise ConfigurationError(f"--workers is {asked}, expected 1 or more.")
        return asked
    if targets <= alone:
        return 1
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(cores or 1, 8, 1 + targets // alone))


def _workers(job: StreamJob, count: int, dask: str | None) -> Workers:
    if dask is None and count == 1:
        return Here(job)
    job = replace(job, setup=replace(job.setup, model=None))
    if dask is not None:
        from robotrue.compensation.stream_dask import Dask

        return Dask(job, dask)
    return Processes(job, count)


def _job(
    model: ErrorModel, found: Outline, settings: CompensationSettings, load: Load
) -> StreamJob:
    setup = compensation_setup(model, found.T_flange_tool, found.start, load, settings)
    if not setup.has_tables:
        raise ConfigurationError(
            "the model has no flat tables; programs are read whole with it.",
            source=found.name,
        )
    plain = replace(setup.settings, load=NO_LOAD, wrench=np.empty(0))
    return StreamJob(
        judged=judged(found),
        setup=replace(setup, settings=plain),
        archive=archive_bytes(model.to_archive()) if settings.covariance else b"",
    )


def _in_order(
    staff: Workers, job: StreamJob, found: Outline, load: Load, reading: BinaryIO
) -> Iterator[tuple[SolvedBlock, bool]]:
    """Yields the blocks in file order, and whether each had to be done again."""
    state = guess = job.setup.start_state()
    if staff.ahead > 1:
        guess = _state_soon(job, found, reading, state)
    submitted = 0
    for number in range(len(found.blocks)):
        while submitted < min(number + staff.ahead, len(found.blocks)):
            exact = submitted == number
            before = state if exact else guess
            staff.submit(_task(found, load, reading, submitted, before, exact=exact))
            submitted += 1
        solved = staff.result(number)
        repeated = not solved.start.equals(state)
        if repeated:
            staff.submit(_task(found, load, reading, number, state, exact=True))
            solved = staff.result(number)
        state = guess = solved.end
        yield solved, repeated


def _task(
    found: Outline,
    load: Load,
    reading: BinaryIO,
    number: int,
    state: ArmState,
    *,
    exact: bool,
) -> BlockTask:
    block = found.blocks[number]
    return BlockTask(
        number=number,
        piece=block.piece,
        data=_bytes(reading, block.piece, found.name),
        lead=None if exact else block.lead,
        lead_data=b"" if exact else _bytes(reading, block.lead, found.name),
        load=load.take(slice(block.first, block.first + block.targets)),
        state=state,
    )


def _state_soon(job: StreamJob, found: Outline, reading: BinaryIO, start: ArmState) -> ArmState:
    """Returns where the arm is soon after the program began: a guess for the first blocks."""
    state = start.copy()
    piece = found.blocks[0].piece
    if len(found.blocks) > 1:
        lead = found.blocks[1].lead
        end = _line_end(reading, min(piece.end, piece.start + (lead.end - lead.start)))
        piece = replace(piece, end=end)
    data = _bytes(reading, piece, found.name)
    drive_through(job, piece, data, state, alike=job.setup.settings.alike)
    return state


def _line_end(reading: BinaryIO, place: int) -> int:
    reading.seek(place)
    reading.readline()
    return reading.tell()


def _bytes(reading: BinaryIO, piece: Piece, name: str) -> bytes:
    reading.seek(piece.start)
    data = reading.read(piece.end - piece.start)
    if len(data) != piece.end - piece.start:
        raise FormatError("the file became shorter while it was read.", source=name)
    return data
