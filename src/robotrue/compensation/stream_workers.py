"""Who compensates the blocks of a long program: this process, or several of this machine."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from multiprocessing import get_context, parent_process
from types import TracebackType
from typing import Any, ClassVar, Final, Protocol

from robotrue.compensation.stream_block import (
    BlockTask,
    SolvedBlock,
    StreamJob,
    solve_block,
    with_model,
)
from robotrue.errors import ConfigurationError, RobotrueError

_THREADS: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


class Workers(Protocol):
    """Whoever takes tasks and gives back blocks.

    Attributes:
        count: How many blocks are worked on at a time.
        ahead: How many tasks are worth handing in before the first is back.
        notes: What happened that the user should know.
    """

    count: int
    ahead: int
    notes: list[str]

    def submit(self, task: BlockTask) -> None:
        """Takes a task."""
        ...

    def result(self, number: int) -> SolvedBlock:
        """Returns a block when it is done.

        Raises:
            ConfigurationError: Whoever worked on it died twice.
        """
        ...

    def __enter__(self) -> Workers: ...
    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


class Here:
    """This process, one block at a time."""

    def __init__(self, job: StreamJob) -> None:
        self.count = self.ahead = 1
        self.notes: list[str] = []
        self._job = job
        self._tasks: dict[int, BlockTask] = {}

    def submit(self, task: BlockTask) -> None:
        """Keeps the task until its block is asked for."""
        self._tasks[task.number] = task

    def result(self, number: int) -> SolvedBlock:
        """Compensates a block and returns it."""
        return solve_block(self._job, self._tasks.pop(number))

    def __enter__(self) -> Here:
        return self

    def __exit__(self, *_: object) -> None:
        self._tasks.clear()


class RemoteWorkers:
    """Workers that may be lost; a block lost with one of them is done again, once."""

    lost: ClassVar[tuple[type[Exception], ...]] = ()
    """What a lost worker raises."""
    hint: ClassVar[str] = ""
    """One thing to try where a block was lost twice."""

    def __init__(self, job: StreamJob, count: int, ahead: int) -> None:
        self.count, self.ahead = count, ahead
        self.notes: list[str] = []
        self._job = job
        self._tasks: dict[int, BlockTask] = {}
        self._futures: dict[int, Any] = {}
        self._retried: set[int] = set()
        # A task submitted while the workers died has no future: KeyError.
        self._lost: tuple[type[Exception], ...] = (*self.lost, KeyError)

    def submit(self, task: BlockTask) -> None:
        """Gives the task to a worker."""
        self._tasks[task.number] = task
        self._start(task)

    def result(self, number: int) -> SolvedBlock:
        """Returns a block when it is done.

        Raises:
            ConfigurationError: Workers were lost twice while it was waited for.
        """
        while True:
            try:
                solved: SolvedBlock = self._futures[number].result()
            except RobotrueError:
                raise
            except self._lost as cause:
                self._retry(number, cause)
            else:
                del self._tasks[number], self._futures[number]
                return solved

    def _retry(self, number: int, cause: Exception) -> None:
        where = f"block {number + 1} (from line {self._tasks[number].piece.line + 1})"
        if number in self._retried:
            raise ConfigurationError(
                self._twice(where, cause), source=self._job.judged.name, hint=self.hint
            ) from cause
        self._retried.add(number)
        self.notes.append(self._once(where, cause))
        self._restart(number)

    def _start(self, task: BlockTask) -> None:
        """Gives a task to a worker."""
        raise NotImplementedError

    def _restart(self, number: int) -> None:
        """Replaces lost workers and starts what was lost with them."""
        raise NotImplementedError

    def _once(self, where: str, cause: Exception) -> str:
        raise NotImplementedError

    def _twice(self, where: str, cause: Exception) -> str:
        raise NotImplementedError

    def close(self) -> None:
        """Dismisses the workers."""
        raise NotImplementedError

    def __enter__(self) -> RemoteWorkers:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Processes(RemoteWorkers):
    """Processes of this machine, each started anew and with one thread."""

    lost = (BrokenProcessPool,)
    hint = "--workers 1; and see whether memory ran out."

    def __init__(self, job: StreamJob, count: int) -> None:
        super().__init__(job, count, count + 1)
        self._pool = self._new_pool()

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            max_workers=self.count,
            mp_context=get_context("spawn"),
            initializer=_start_worker,
            initargs=(self._job,),
        )

    def _start(self, task: BlockTask) -> None:
        with contextlib.suppress(BrokenProcessPool), _single_threaded():
            self._futures[task.number] = self._pool.submit(_solve, task)

    def _restart(self, number: int) -> None:
        self.close()
        self._pool = self._new_pool()
        self._futures.clear()
        for task in self._tasks.values():
            self._start(task)

    def _once(self, where: str, cause: Exception) -> str:
        return f"a worker process died while {where} was waited for; it was done again."

    def _twice(self, where: str, cause: Exception) -> str:
        return f"a worker process died twice while {where} was waited for."

    def close(self) -> None:
        """Ends the processes; what they work on is dropped."""
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
def _jobs() -> list[StreamJob]:
    """Returns what this worker process was begun with."""
    return []


def _start_worker(job: StreamJob) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C ends
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    _jobs()[:] = [with_model(job)]


def _leave_with_parent() -> None:
    """Ends this process when its parent is killed: nothing else would tell it."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _solve(task: BlockTask) -> SolvedBlock:
    (job,) = _jobs()
    return solve_block(job, task)
