"""The kinds of jobs that operations make, as workers want them: by name, not yet imported."""

from __future__ import annotations

from typing import Final

from robotrue.app.registry import job_operations

RUNNER: Final = "robotrue.app.job_runner:run_job"
"""Imported by the process of a job, and by none that only queues or claims one."""


def job_kinds() -> dict[str, str]:
    """Returns ``module:function`` by kind, for :func:`robotrue.store.jobs_worker.run_worker`."""
    return dict.fromkeys(job_operations(), RUNNER)
