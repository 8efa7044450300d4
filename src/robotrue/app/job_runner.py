"""A job: an operation on items of a workspace, in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping

from robotrue.app.job_files import BLOCKS
from robotrue.app.job_parameters import stated_parameters
from robotrue.app.job_places import JobInputs, JobPlaces, hide_folder, plain_block
from robotrue.app.kept_context import KeptContext
from robotrue.app.kept_result import keep_result
from robotrue.app.operation import AnyOperation
from robotrue.app.presentation import Note
from robotrue.app.registry import job_operation
from robotrue.app.workspace_context import WorkspaceContext
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.workspace import Transaction


def run_job(work: Work) -> Publish:
    """Runs the operation that a job is of; what it notes becomes the job's remarks.

    Raises:
        ConfigurationError: No job does an operation of that name, or parameters that cannot be.
    """
    operation = job_operation(work.job.kind)
    with hide_folder(work.folder):
        return _run(operation, work)


def _run(operation: AnyOperation, work: Work) -> Publish:
    naming = stated_parameters(operation, work.parameters).naming
    save = operation.save
    if save is None:
        kept = KeptContext(work, naming)
        places = JobPlaces(kept)
        request = stated_parameters(operation, work.parameters, places).request
        places.link_items(request)
        found = operation.run(request, kept)
        return lambda into: keep_result(found, into, kept, places)
    context = WorkspaceContext(work, naming)
    stated = stated_parameters(operation, work.parameters, JobInputs(context))
    result = operation.run(stated.request, context)
    blocks = list(result.blocks())
    for block in blocks:
        if isinstance(block, Note):
            context.inform(block.text)
    tables = [plain_block(each, work.folder) for each in blocks if not isinstance(each, Note)]

    def publish(into: Transaction) -> Mapping[str, object]:
        saved = save(stated.request, result, into, context)
        return {**saved, BLOCKS: tables} if tables else saved

    return publish
