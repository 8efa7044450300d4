"""The result of an operation without a ``save`` of its own: a document with all that it wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from robotrue.app.job_files import BLOCKS, VALUES
from robotrue.app.job_places import JobPlaces, hide_in_values, plain_block, without_folder
from robotrue.app.operation import Result
from robotrue.app.workspace_context import WorkspaceContext
from robotrue.core.json_values import json_values
from robotrue.core.provenance import marked_document
from robotrue.store.workspace import Transaction


def keep_result(
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
    """The file of the JSON values, by a name that none beside it has."""
    taken = {path.name for path in beside}
    name = f"{kind}.json"
    while name in taken:
        name = f"_{name}"
    path = folder / name
    plain = hide_in_values(json_values(values), folder)
    path.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n")
    return path
