"""Blocks of a long program on the workers of a Dask scheduler. Needs the extra ``dask``.

Workers need this robotrue and nothing else: the file's bytes travel with the blocks, the model as
tables and, for covariances, as the bytes of its file.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from importlib.metadata import version
from typing import Protocol, cast

from robotrue.calibration.archive import open_model
from robotrue.calibration.model import ErrorModel
from robotrue.compensation.chunk_workers import (
    ChunkJob,
    ChunkTask,
    ChunkWorkers,
    CompensatedChunk,
    Pending,
    compensate_chunk,
)
from robotrue.core.archive import archive_from
from robotrue.errors import ConfigurationError, MissingExtraError


class DaskWorkers(ChunkWorkers):
    """The workers of a scheduler."""

    lost = (Exception,)
    """Killed, cancelled, or its data lost with the worker."""
    once = "Dask lost {where} ({cause}); it was repeated."
    twice = "the Dask workers lost {where} twice ({cause})."
    hint = "see the workers' logs, or leave --dask out."

    def __init__(self, job: ChunkJob, address: str) -> None:
        self._client, notes = _client_at(address)
        count = int(sum(self._client.nthreads().values()))
        super().__init__(job, count, 2 * count)
        self.notes.extend(notes)
        self._shared = self._scatter_job()

    def _scatter_job(self) -> object:
        return self._client.scatter(self._job, broadcast=True, hash=False)

    def _start(self, task: ChunkTask) -> Pending:
        content = self._client.scatter(task, hash=False)
        return cast(Pending, self._client.submit(_solve, self._shared, content, pure=False))

    def _restart(self, number: int) -> None:
        self._shared = self._scatter_job()
        super()._restart(number)

    def close(self) -> None:
        """Leaves the scheduler."""
        self._pending.clear()
        self._client.close()


class DaskFuture(Protocol):
    """The used part of a future of distributed, which is untyped.

    Attributes:
        status: ``pending``, ``finished``, ``error``, ``cancelled`` or ``lost``.
    """

    status: str

    def exception(self) -> BaseException | None:
        """Returns what it failed with."""
        ...

    def cancel(self, *, force: bool) -> object:
        """Ends it."""
        ...


class DaskClient(Protocol):
    """The used part of a client of distributed, which is untyped."""

    def nthreads(self) -> Mapping[str, int]:
        """Returns the threads of each worker, by its address."""
        ...

    def scatter(self, data: object, **options: bool) -> object:
        """Returns a handle on data that was sent to the workers."""
        ...

    def submit(self, call: Callable[..., object], *arguments: object, pure: bool) -> DaskFuture:
        """Returns the future of a call on a worker."""
        ...

    def run(self, call: Callable[[], tuple[str, ...]]) -> Mapping[str, tuple[str, ...]]:
        """Returns what a call returns on each worker, by its address."""
        ...

    def close(self) -> None:
        """Leaves the scheduler."""
        ...


def connect_scheduler(address: str, *, timeout: float) -> DaskClient:
    """Returns the client of a Dask scheduler that answers within ``timeout`` s.

    Raises:
        ConfigurationError: Nothing answers there.
        MissingExtraError: The package distributed is not installed.
    """
    try:
        connect = import_module("distributed").Client
    except ImportError as cause:
        raise MissingExtraError(
            "a Dask scheduler was named, and the package distributed is not installed.",
            hint="pip install 'robotrue[dask]'.",
        ) from cause
    try:
        client: DaskClient = connect(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as cause:
        raise ConfigurationError(
            f"no Dask scheduler answers at {address!r} ({cause}).",
            hint="the address `dask scheduler` prints, such as tcp://10.0.0.5:8786.",
        ) from cause
    return client


def _client_at(address: str) -> tuple[DaskClient, list[str]]:
    """Returns the client of a scheduler whose workers compute as this process does, and notes."""
    client = connect_scheduler(address, timeout=10.0)
    try:
        return client, _compare_versions(client, address)
    except ConfigurationError:
        client.close()
        raise


def _compare_versions(client: DaskClient, address: str) -> list[str]:
    """Returns notes on workers of another kind; raises where their results would differ."""
    if not client.nthreads():
        raise ConfigurationError(
            f"the Dask scheduler at {address!r} has no workers.",
            hint="start some: dask worker ADDRESS --nthreads 1.",
        )
    own, notes = versions(), []
    for worker, theirs in client.run(versions).items():
        if theirs[:-1] != own[:-1]:
            raise ConfigurationError(
                f"Dask worker {worker} has {theirs[:-1]}, this process {own[:-1]} (robotrue, "
                "numpy, numba): the result would not be the same bit for bit.",
                hint="install the same versions on both.",
            )
        if theirs[-1] != own[-1]:
            notes.append(
                f"Dask worker {worker} has a processor of another kind ({theirs[-1]}, here "
                f"{own[-1]}): results agree to rounding, not necessarily bit for bit."
            )
    return notes


def versions() -> tuple[str, ...]:
    """Returns what numbers depend on: versions of robotrue, numpy and numba, and the processor."""
    processor = import_module("llvmlite.binding").get_host_cpu_name()
    names = ("robotrue", "numpy", "numba")
    return (*(version(name) for name in names), f"{platform.machine()} {processor}")


def _solve(job: ChunkJob, task: ChunkTask) -> CompensatedChunk:
    return compensate_chunk(replace(job, setup=replace(job.setup, model=_model(job.archive))), task)


@lru_cache(maxsize=2)
def _model(archive: bytes) -> ErrorModel | None:
    return open_model(archive_from(archive)) if archive else None
