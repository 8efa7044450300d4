"""Chunks of a program file, from bytes to compensated bytes, and their workers."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context, parent_process
from typing import ClassVar, Final, Protocol, Self

import numpy as np

from robotrue.calibration.archive import open_model
from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.compensate import compensate_targets
from robotrue.compensation.result import Compensation, Tally
from robotrue.compensation.settings import CompensationSetup
from robotrue.compensation.status import row_note
from robotrue.core.archive import archive_from
from robotrue.core.progress import Progress, unheard
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.program.line_note import LineNote
from robotrue.program.program import Program, Reason
from robotrue.program.program_chunk import ChunkLines, Skeleton
from robotrue.program.program_file import read_chunk, write_chunk
from robotrue.robot.statics import Load

_INCOMPLETE = -1
"""Place of the note on targets that leave something out: before all others."""
_THREADS: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkJob:
    """Shared input of every chunk of a file, sent to a worker once. Arrays and plain values.

    Attributes:
        name: File name.
        setup: What compensation takes; a worker's has no model, see :func:`with_model`.
        archive: The model file's bytes where covariances are requested of workers, else empty.
        content: Of the file; a worker's is never a program that is held whole.
    """

    name: str
    setup: CompensationSetup
    archive: bytes
    content: Program | Skeleton


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkTask:
    """One chunk to be compensated.

    Attributes:
        number: Place of the chunk.
        lines: Where it is in the file.
        data: Its bytes.
        lead: Lines before it, to be driven through first; None where ``state`` is exact.
        lead_data: Their bytes.
        load: One row, or one per target of the chunk.
        state: Where the arm is before the lead or the chunk.
    """

    number: int
    lines: ChunkLines
    data: bytes
    lead: ChunkLines | None
    lead_data: bytes
    load: Load
    state: ArmState


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensatedChunk:
    """A chunk that has been compensated.

    Attributes:
        data: Its bytes.
        start: Where the arm was taken to be before its first target.
        end: Where it is after the last.
        tally: Sums over its targets.
        noted: Notes of the reader on its lines.
        held: What became of every target of a file that is held whole; None of a part of a file.
    """

    data: bytes
    start: ArmState
    end: ArmState
    tally: Tally
    noted: tuple[LineNote, ...]
    held: Compensation | None


def with_model(job: ChunkJob) -> ChunkJob:
    """Returns the job with the model that its archive holds, if it holds one."""
    if not job.archive:
        return job
    return replace(job, setup=replace(job.setup, model=open_model(archive_from(job.archive))))


def compensate_chunk(
    job: ChunkJob, task: ChunkTask, progress: Progress = unheard
) -> CompensatedChunk:
    """Returns the compensated chunk: a function of the content of job and task alone."""
    state = task.state.copy()
    if task.lead is not None:
        drive_through(job, task.lead, task.lead_data, state)
    start = state.copy()
    chunk = read_chunk(task.data, task.lines, job.content)
    program, held = chunk.program, isinstance(job.content, Program)
    result = compensate_targets(job.setup, program, task.load, state, progress)
    tally = result.tally(program)
    incomplete = np.flatnonzero(program.reason == Reason.INCOMPLETE)
    if isinstance(job.content, Skeleton) and len(incomplete) and job.content.splice is None:
        text = "components are left out, and their inherited values are unknown."
        note = row_note(program, incomplete, text, rank=_INCOMPLETE)
        tally = replace(tally, notes=(note, *tally.notes))
    return CompensatedChunk(
        data=write_chunk(chunk, result.replacement),
        start=start,
        end=state,
        tally=tally,
        noted=() if held else program.noted,
        held=result if held else None,
    )


def drive_through(
    job: ChunkJob, lines: ChunkLines, data: bytes, state: ArmState, *, alike: float = np.inf
) -> None:
    """Advances ``state`` over the targets of some lines, without output.

    Whether a guessed configuration matters is found by the chunk itself, under its load; ``alike``
    is for a first look.
    """
    program = read_chunk(data, lines, job.content).program
    settings = replace(job.setup.settings, alike=alike, covariance=False)
    setup = replace(job.setup, settings=settings, model=None)
    compensate_targets(setup, program, Load(), state)


class Pending(Protocol):
    """A chunk that is being solved."""

    def result(self) -> CompensatedChunk:
        """Waits for it."""
        ...


class ChunkWorkers(ABC):
    """Takes tasks and returns chunks; a chunk lost with a worker is solved again, once.

    Attributes:
        count: Number of chunks solved at a time.
        ahead: Number of tasks to submit before the first returns.
        notes: Remarks for the user.
    """

    lost: ClassVar[tuple[type[Exception], ...]] = ()
    """What a lost worker raises."""
    once: ClassVar[str] = ""
    """The note on a chunk lost at ``{where}``, by ``{cause}``."""
    twice: ClassVar[str] = ""
    """The error where it was lost again."""
    hint: ClassVar[str] = ""
    """One thing to try then."""

    def __init__(self, job: ChunkJob, count: int, ahead: int) -> None:
        self.count, self.ahead = count, ahead
        self.notes: list[str] = []
        self._job = job
        self._tasks: dict[int, ChunkTask] = {}
        self._pending: dict[int, Pending] = {}
        self._retried: set[int] = set()

    @abstractmethod
    def _start(self, task: ChunkTask) -> Pending:
        """Gives a task to a worker."""

    def _restart(self, number: int) -> None:
        """Replaces lost workers and starts what was lost with them."""
        self._hand_over(self._tasks[number])

    @abstractmethod
    def close(self) -> None:
        """Dismisses the workers."""

    def submit(self, task: ChunkTask) -> None:
        """Takes a task."""
        self._tasks[task.number] = task
        self._hand_over(task)

    def _hand_over(self, task: ChunkTask) -> None:
        with contextlib.suppress(*self.lost):  # detected when its chunk is requested
            self._pending[task.number] = self._start(task)

    def result(self, number: int) -> CompensatedChunk:
        """Returns a chunk when it is done.

        Raises:
            ConfigurationError: Workers were lost twice while it was waited for.
        """
        lost: tuple[type[Exception], ...] = (*self.lost, KeyError)  # never handed over: KeyError
        while True:
            try:
                solved = self._pending[number].result()
            except RobotrueError:
                raise
            except lost as cause:
                self._retry(number, cause)
            else:
                del self._tasks[number], self._pending[number]
                return solved

    def _retry(self, number: int, cause: Exception) -> None:
        where = f"block {number + 1} (from line {self._tasks[number].lines.line + 1})"
        if number in self._retried:
            message = self.twice.format(where=where, cause=f"{type(cause).__name__}: {cause}")
            raise ConfigurationError(message, source=self._job.name, hint=self.hint) from cause
        self._retried.add(number)
        self.notes.append(self.once.format(where=where, cause=type(cause).__name__))
        self._restart(number)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class ThisProcess(ChunkWorkers):
    """This process, one chunk at a time."""

    def __init__(self, job: ChunkJob, progress: Progress) -> None:
        super().__init__(job, 1, 1)
        self._progress = progress

    def _start(self, task: ChunkTask) -> Pending:
        done: Future[CompensatedChunk] = Future()
        done.set_result(compensate_chunk(self._job, task, self._progress))
        return done

    def close(self) -> None:
        """Does nothing: there are no workers to end."""


class ChunkProcesses(ChunkWorkers):
    """New processes of this machine, each with one thread."""

    lost = (BrokenProcessPool,)
    once = "a worker process died while it computed {where}; it was repeated."
    twice = "a worker process died twice while it computed {where}."
    hint = "--workers 1; and check the memory."

    def __init__(self, job: ChunkJob, count: int) -> None:
        super().__init__(job, count, count + 1)
        self._pool = self._new_pool()

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            max_workers=self.count,
            mp_context=get_context("spawn"),
            initializer=_start_worker,
            initargs=(self._job,),
        )

    def _start(self, task: ChunkTask) -> Pending:
        with _single_threaded():
            return self._pool.submit(_solve, task)

    def _restart(self, number: int) -> None:
        self.close()
        self._pool = self._new_pool()
        self._pending.clear()
        for task in self._tasks.values():
            self._hand_over(task)

    def close(self) -> None:
        """Ends the processes; their current work is dropped."""
        self._pool.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def _single_threaded() -> Iterator[None]:
    """Makes processes started meanwhile use one thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@cache
def _jobs() -> list[ChunkJob]:
    """Returns the jobs that this worker process was started with."""
    return []


def _start_worker(job: ChunkJob) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C ends
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    _jobs()[:] = [with_model(job)]


def _leave_with_parent() -> None:
    """Ends this process when its parent is killed, which nothing else would report."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _solve(task: ChunkTask) -> CompensatedChunk:
    (job,) = _jobs()
    return compensate_chunk(job, task)
