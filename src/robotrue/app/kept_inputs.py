"""Files that come with the request of a job: kept as documents, so that it can be done again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from robotrue.app.job_files import INPUT, job_fields
from robotrue.app.operation import AnyOperation
from robotrue.app.request import InputFile
from robotrue.core.files import sha256_of_file
from robotrue.errors import ConfigurationError
from robotrue.store import documents, items
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Transaction

UPLOAD: Final = "upload"
"""Key of a parameter that names a file on its way in."""
LOOKED_AT: Final = 50
"""Documents of a name among which the same content is looked for."""


@dataclass(frozen=True, slots=True)
class IncomingFiles:
    """The uploads that the parameters of a job name.

    Attributes:
        paths: Where each lies, by its id.
    """

    paths: Mapping[str, Path] = field(default_factory=dict)

    def checked(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the parameters with the names of uploads in place of their documents."""
        return self._replaced(parameters, lambda path: {"id": path.name})

    def kept(self, into: Transaction, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the parameters with a document in place of each upload."""
        return self._replaced(parameters, lambda path: _keep(into, path))

    def _replaced(
        self, parameters: Mapping[str, Any], make: Callable[[Path], dict[str, Any]]
    ) -> dict[str, Any]:
        def replace(value: Any) -> Any:
            if isinstance(value, list):
                return [replace(each) for each in value]
            return make(self.paths[value[UPLOAD]]) if _names_upload(value) else value

        return {name: replace(value) for name, value in parameters.items()}


def find_incoming(
    operation: AnyOperation, parameters: Mapping[str, Any], find: Callable[[str], Path]
) -> IncomingFiles:
    """Returns the uploads that parameters name.

    Args:
        operation: That the job is of.
        parameters: JSON values.
        find: Returns where an upload lies, by its id.

    Raises:
        ConfigurationError: A parameter names one that is no file, or there is none of that id.
    """
    files = {each.name for each in job_fields(operation) if isinstance(each.entry, InputFile)}
    paths: dict[str, Path] = {}
    for name, value in parameters.items():
        for each in filter(_names_upload, value if isinstance(value, list) else [value]):
            if name not in files:
                raise ConfigurationError(
                    f"parameter {name!r} is no file that can be sent along.",
                    hint=f"files are {', '.join(sorted(files)) or 'none'}.",
                )
            paths[each[UPLOAD]] = find(each[UPLOAD])
    return IncomingFiles(paths)


def _names_upload(value: object) -> bool:
    return isinstance(value, Mapping) and set(value) == {UPLOAD} and isinstance(value[UPLOAD], str)


def _keep(into: Transaction, path: Path) -> dict[str, Any]:
    """A document with the file, the one that is there where it came before."""
    digest = sha256_of_file(path)
    asked = ItemQuery(where={"kind": INPUT, "name": path.name}, limit=LOOKED_AT)
    for each in items.search(into, DOCUMENT, asked).items:
        if each.attachments and each.attachments[0].sha256 == digest:
            return _parameter(each, path.name)
    return _parameter(documents.add(into, INPUT, name=path.name, files=[path]), path.name)


def _parameter(record: DocumentRecord, file: str) -> dict[str, Any]:
    return {"id": record.id, "version": record.version, "file": file}
