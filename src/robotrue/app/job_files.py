"""Files of a job whose result is saved: its inputs, and the names of its results."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Protocol

from robotrue.app.operation import AnyOperation
from robotrue.app.outputs import FORMATS, require_suffix
from robotrue.app.request import (
    JOB,
    InputFile,
    Item,
    ItemVersion,
    Option,
    Output,
    Request,
    RequestField,
    fields_of,
)
from robotrue.errors import ConfigurationError

INPUT: Final = "input"
"""Kind of the documents that keep what came with a job."""
BLOCKS: Final = "blocks"
"""In the detail of a kept result, and in the result of any other job: what its page shows."""
VALUES: Final = "values"
"""Likewise: the name of the file of its JSON values."""
LONGEST: Final = 120
"""Characters of the name of a result."""
_BAD: Final = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]')


class FileItem(ItemVersion):
    """A file of an item of a workspace.

    Attributes:
        file: Its name among those of the item; empty: the first, or all where several are read.
    """

    file: str = ""


class Places(Protocol):
    """Folders of the files of a job."""

    def input_files(self, field: RequestField, stated: Sequence[FileItem]) -> tuple[Path, ...]:
        """Returns the files that a field reads; of a folder the folder."""
        ...

    def result_file(self, name: str) -> Path:
        """Returns where a result is written."""
        ...


class NoPlaces:
    """Names in place of files: enough to check a request with, before there is a job."""

    def input_files(self, field: RequestField, stated: Sequence[FileItem]) -> tuple[Path, ...]:
        """Returns the names of files, as far as they are stated."""
        return tuple(Path(each.file or each.id) for each in stated)

    def result_file(self, name: str) -> Path:
        """Returns the name."""
        return Path(name)


def job_fields(operation: AnyOperation) -> tuple[RequestField, ...]:
    """Returns the fields of a request that a job states.

    A job with its own ``save`` has those of the shell ``job``; any other one also the input files
    and the names of the outputs.
    """
    request: type[Request] = operation.request
    fields = fields_of(request)
    if operation.save is not None:
        return tuple(field for field in fields if field.is_in(JOB))
    return tuple(
        field
        for field in fields
        if isinstance(field.entry, InputFile | Output)
        or (field.is_in(JOB) and not is_result_folder(field))
    )


def takes_files(field: RequestField) -> bool:
    """Returns whether a job may be given a file for a field."""
    return isinstance(field.entry, InputFile) or (
        isinstance(field.entry, Item) and field.entry.sent
    )


def is_result_folder(field: RequestField) -> bool:
    """Returns true if a field names an output folder of the command, which jobs do not have."""
    return field.kind is Path and type(field.entry) is Option


def result_name(request: type[Request], field: RequestField) -> str:
    """Returns the file name of a result where none is stated."""
    entry = field.entry
    if not isinstance(entry, Output):
        raise ConfigurationError(f"{request.__name__}.{field.name} is no output.")
    if entry.saved_as:
        return entry.saved_as
    words = re.sub(r"(?<!^)(?=[A-Z])", "_", request.__name__.removesuffix("Request")).lower()
    return (words if field.name == "output" else f"{words}_{field.name}") + _suffix(entry)


def _suffix(entry: Output) -> str:
    """The usual suffix of an output: the first that is declared, or that its help names."""
    if entry.suffixes:
        return entry.suffixes[0]
    spelled = re.findall(r"\.[a-z]{2,9}\b", entry.help)
    named = [f".{word.lower()}" for word in re.findall(r"\b[A-Z]{3,4}\b", entry.help)]
    return next((each for each in (*spelled, *named) if each in FORMATS), ".txt")


def require_result_name(name: str, request: type[Request], field: RequestField) -> str:
    """Returns the name of a result.

    Raises:
        ConfigurationError: It is empty, too long, a path, or has the suffix of another format.
    """
    entry, usual = field.entry, result_name(request, field)
    if len(name) > LONGEST or name.strip(". ") == "" or name.startswith(".") or _BAD.search(name):
        raise ConfigurationError(
            f"{field.name} is named {name[:60]!r}, expected a file name of up to {LONGEST} "
            "characters without a folder.",
            hint=usual,
        )
    if isinstance(entry, Output) and entry.suffixes:
        require_suffix(Path(name), entry.what or "a result", entry.suffixes, only=entry.only)
    return name


def file_item(stated: object) -> FileItem:
    """Returns the file that a parameter states: the id or name of an item, or a file of one."""
    if isinstance(stated, ItemVersion):
        return FileItem(**stated.model_dump())
    return FileItem(id=str(stated))
