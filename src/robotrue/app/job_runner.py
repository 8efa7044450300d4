"""A job: an operation on items of a workspace, in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotrue.app.job_parameters import stated_parameters
from robotrue.app.presentation import Note
from robotrue.app.registry import operation_of
from robotrue.app.workspace_context import WorkspaceContext
from robotrue.errors import ConfigurationError
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.workspace import Transaction


def run_job(work: Work) -> Publish:
    """Runs the operation that a job is of; what it notes and shows become the job's remarks.

    Raises:
        ConfigurationError: No operation of that name saves a result, or parameters that cannot be.
    """
    kind = work.job.kind
    operation = operation_of(kind)
    save = operation.save
    if save is None:
        raise ConfigurationError(f"{kind!r} is no kind of job.")
    stated = stated_parameters(operation, work.parameters)
    context = WorkspaceContext(work, stated.naming)
    result = operation.run(stated.request, context)
    for block in result.blocks():
        if isinstance(block, Note):
            context.inform(block.text)

    def publish(into: Transaction) -> Mapping[str, Any]:
        return save(stated.request, result, into, context)

    return publish
