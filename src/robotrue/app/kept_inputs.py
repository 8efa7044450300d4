"""Files sent with a job's request, saved as documents so that the job can be repeated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from robotrue.app.job_files import INPUT, job_fields, takes_files
from robotrue.app.operation import AnyOperation
from robotrue.core.files import sha256_of_file
from robotrue.errors import ConfigurationError
from robotrue.store import documents, items
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Transaction

UPLOAD: Final = "upload"
"""Key of a parameter that names a file on its way in."""
LOOKED_AT: Final = 50
"""Documents of a name among which the same content is looked for."""


def find_uploads(
    operation: AnyOperation, parameters: Mapping[str, object], find: Callable[[str], Path]
) -> dict[str, Path]:
    """Returns where the uploads lie that parameters name, by their ids.

    Args:
        operation: That the job is of.
        parameters: JSON values.
        find: Returns where an upload lies, by its id.

    Raises:
        ConfigurationError: A parameter names one that is no file, or there is none of that id.
    """
    files = {each.name for each in job_fields(operation) if takes_files(each)}
    paths: dict[str, Path] = {}
    for name, value in parameters.items():
        for each in value if isinstance(value, list) else [value]:
            id = _upload_of(each)
            if id is None:
                continue
            if name not in files:
                raise ConfigurationError(
                    f"parameter {name!r} is no file that can be sent along.",
                    hint=f"files are {', '.join(sorted(files)) or 'none'}.",
                )
            paths[id] = find(id)
    return paths


def name_uploads(parameters: Mapping[str, object], paths: Mapping[str, Path]) -> dict[str, object]:
    """Returns the parameters with uploads by name, so that they can be checked before saving."""
    named = {id: {"id": path.name} for id, path in paths.items()}
    return {name: _with_documents(value, named) for name, value in parameters.items()}


def keep_uploads(
    into: Transaction, parameters: Mapping[str, object], paths: Mapping[str, Path]
) -> dict[str, object]:
    """Returns the parameters with a document in place of each upload."""
    kept = {id: _keep_file(into, path) for id, path in paths.items()}
    return {name: _with_documents(value, kept) for name, value in parameters.items()}


def _with_documents(value: object, documents: Mapping[str, Mapping[str, object]]) -> object:
    if isinstance(value, list):
        return [_with_documents(each, documents) for each in value]
    id = _upload_of(value)
    return value if id is None else documents[id]


def _upload_of(value: object) -> str | None:
    """The upload that a parameter names; None where it names none."""
    if not isinstance(value, Mapping) or set(value) != {UPLOAD}:
        return None
    id = value[UPLOAD]
    return id if isinstance(id, str) else None


def _keep_file(into: Transaction, path: Path) -> dict[str, object]:
    """Returns the parameter for a document with this file, an existing one if there is one."""
    digest = sha256_of_file(path)
    asked = ItemQuery(where={"kind": INPUT, "name": path.name}, limit=LOOKED_AT)
    for each in items.search(into, DOCUMENT, asked).items:
        if each.attachments and each.attachments[0].sha256 == digest:
            return {"id": each.id, "version": each.version, "file": path.name}
    made = documents.add(into, INPUT, name=path.name, files=[path])
    return {"id": made.id, "version": made.version, "file": path.name}
