"""Runner of a job: an operation on items of a workspace, in a separate process."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from robotrue.app.job_files import BLOCKS, VALUES
from robotrue.app.job_parameters import stated_parameters
from robotrue.app.job_places import (
    JobInputs,
    JobPlaces,
    KeptContext,
    hide_folder,
    hide_in_values,
    plain_block,
    without_folder,
)
from robotrue.app.operation import AnyOperation, Result
from robotrue.app.presentation import Note
from robotrue.app.registry import job_operation
from robotrue.app.workspace_context import WorkspaceContext
from robotrue.core.json_values import json_values
from robotrue.core.provenance import marked_document
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.workspace import Transaction


def run_job(work: Work) -> Publish:
    """Runs the operation that a job is of; what it notes becomes the job's remarks.

    Raises:
        ConfigurationError: No job does an operation of that name, or invalid parameters.
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
        return lambda into: _keep_result(found, into, kept, places)
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


def _keep_result(
    result: Result, into: Transaction, context: WorkspaceContext, places: JobPlaces
) -> Mapping[str, object]:
    """Leaves a document of the kind of the job; returns the result of the job.

    Its files are those that were written and the JSON values of the result; what a terminal would
    show is in its detail, for the page of the result.
    """
    job, folder = context.work.job, context.work.folder
    values, origin = result.document() or {}, result.provenance
    marked = dict(values) if "simulated" in values else marked_document(values, origin)
    files = places.results()
    written = _write_values(marked, job.kind, folder, files)
    detail = {
        "simulated": bool(marked.get("simulated", False)),
        "provenance": None if origin is None else origin.to_document(),
        VALUES: written.name,
        BLOCKS: [plain_block(each, folder) for each in result.blocks()],
        "remarks": [without_folder(each, folder) for each in context.work.remarks],
    }
    return context.leave_document(
        into,
        job.kind.replace("_", " "),
        next(iter(places.subjects), "no input"),
        [*files, written],
        list(dict.fromkeys(places.links)),
        json_values(detail),
    )


def _write_values(
    values: Mapping[str, object], kind: str, folder: Path, beside: Sequence[Path]
) -> Path:
    """The file of the JSON values, by a name that none next to it has."""
    taken = {path.name for path in beside}
    name = f"{kind}.json"
    while name in taken:
        name = f"_{name}"
    path = folder / name
    plain = hide_in_values(json_values(values), folder)
    path.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n")
    return path
