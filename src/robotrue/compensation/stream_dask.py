"""Blocks of a long program on the workers of a Dask scheduler. Needs the extra ``dask``.

Workers need this robotrue and nothing else: the file's bytes travel with the blocks, the model as
tables and, for covariances, as the bytes of its file.
"""

from __future__ import annotations

import platform
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from importlib.metadata import version
from typing import Any

from robotrue.calibration.archive import open_model
from robotrue.calibration.model import ErrorModel
from robotrue.compensation.stream_block import (
    BlockTask,
    SolvedBlock,
    StreamJob,
    solve_block,
)
from robotrue.core.archive import archive_from
from robotrue.errors import ConfigurationError, MissingExtraError, RobotrueError


class Dask:
    """The workers of a scheduler."""

    def __init__(self, job: StreamJob, address: str) -> None:
        try:
            client: Any = import_module("distributed").Client
        except ImportError as cause:
            raise MissingExtraError(
                "a Dask scheduler was named, and the package distributed is not installed.",
                hint="pip install 'robotrue[dask]'.",
            ) from cause
        try:
            self._client = client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as cause:
            raise ConfigurationError(
                f"no Dask scheduler answers at {address!r} ({cause}).",
                hint="the address `dask scheduler` prints, such as tcp://10.0.0.5:8786.",
            ) from cause
        self.notes: list[str] = []
        self._job = job
        self.count = self._require_equals(address)
        self.ahead = 2 * self.count
        self._shared = self._scattered()
        self._tasks: dict[int, BlockTask] = {}
        self._futures: dict[int, Any] = {}

    def _require_equals(self, address: str) -> int:
        """Returns the number of threads of all workers, which must compute as this process does."""
        threads = int(sum(self._client.nthreads().values()))
        if not threads:
            self.close()
            raise ConfigurationError(
                f"the Dask scheduler at {address!r} has no workers.",
                hint="start some: dask worker ADDRESS --nthreads 1.",
            )
        mine = versions()
        for worker, theirs in self._client.run(versions).items():
            if theirs[:-1] != mine[:-1]:
                self.close()
                raise ConfigurationError(
                    f"Dask worker {worker} has {theirs[:-1]}, this process {mine[:-1]} (robotrue, "
                    "numpy, numba): the result would not be the same bit for bit.",
                    hint="install the same versions on both.",
                )
            if theirs[-1] != mine[-1]:
                self.notes.append(
                    f"Dask worker {worker} has a processor of another kind ({theirs[-1]}, here "
                    f"{mine[-1]}): numbers agree to rounding, not surely bit for bit."
                )
        return threads

    def _scattered(self) -> Any:
        return self._client.scatter(self._job, broadcast=True, hash=False)

    def submit(self, task: BlockTask) -> None:
        """Hands the task to the scheduler."""
        self._tasks[task.number] = task
        self._hand_in(task)

    def _hand_in(self, task: BlockTask) -> None:
        content = self._client.scatter(task, hash=False)
        self._futures[task.number] = self._client.submit(_solve, self._shared, content, pure=False)

    def result(self, number: int) -> SolvedBlock:
        """Returns a block when it is done; if a worker was lost on the way, it is done again, once.

        Raises:
            ConfigurationError: Workers were lost twice.
        """
        try:
            done: SolvedBlock = self._futures[number].result()
        except RobotrueError:
            raise
        except Exception as cause:  # killed, cancelled, or its data lost with the worker
            where = f"block {number + 1} (from line {self._tasks[number].piece.line + 1})"
            self.notes.append(f"Dask lost {where} ({type(cause).__name__}); it was done again.")
            done = self._again(number, where)
        del self._tasks[number], self._futures[number]
        return done

    def _again(self, number: int, where: str) -> SolvedBlock:
        try:
            self._shared = self._scattered()
            self._hand_in(self._tasks[number])
            done: SolvedBlock = self._futures[number].result()
        except RobotrueError:
            raise
        except Exception as cause:
            raise ConfigurationError(
                f"the Dask workers lost {where} twice ({type(cause).__name__}: {cause}).",
                source=self._job.judged.name,
                hint="see the workers' logs, or leave --dask out.",
            ) from cause
        return done

    def close(self) -> None:
        """Leaves the scheduler."""
        self._client.close()

    def __enter__(self) -> Dask:
        return self

    def __exit__(self, *_: object) -> None:
        self._futures.clear()
        self.close()


def versions() -> tuple[str, ...]:
    """Returns what numbers depend on: versions of robotrue, numpy and numba, and the processor."""
    processor = import_module("llvmlite.binding").get_host_cpu_name()
    names = ("robotrue", "numpy", "numba")
    return (*(version(name) for name in names), f"{platform.machine()} {processor}")


@lru_cache(maxsize=2)
def _model(archive: bytes) -> ErrorModel | None:
    return open_model(archive_from(archive)) if archive else None


def _solve(job: StreamJob, task: BlockTask) -> SolvedBlock:
    return solve_block(replace(job, setup=replace(job.setup, model=_model(job.archive))), task)
