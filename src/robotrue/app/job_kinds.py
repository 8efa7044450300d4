"""The kinds of jobs that operations make, as workers want them: by name, not yet imported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final

from robotrue.app.registry import job_operations

RUNNER: Final = "robotrue.app.job_runner:run_job"
"""Imported by the process of a job, and by none that only queues or claims one."""


def job_kinds() -> dict[str, str]:
    """Returns ``module:function`` by kind, for :func:`robotrue.store.jobs_worker.run_worker`."""
    return dict.fromkeys(job_operations(), RUNNER)


class LazyJobKinds(Mapping[str, str]):
    """The same, on first use: it imports all operations, which a first page does not need."""

    def __getitem__(self, kind: str) -> str:
        return self._kinds[kind]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)

    def __bool__(self) -> bool:
        return True

    @cached_property
    def _kinds(self) -> dict[str, str]:
        return job_kinds()
