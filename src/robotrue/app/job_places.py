"""Files of one job: inputs copied from the workspace, results saved with the job."""

from __future__ import annotations

import os
import re
import shutil
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Final

from robotrue.app.job_files import BLOCKS, VALUES, FileItem
from robotrue.app.presentation import Block, Note, Table, Text
from robotrue.app.request import (
    InputFile,
    Item,
    Naming,
    Reference,
    Request,
    RequestField,
    fields_of,
)
from robotrue.app.workspace_context import WorkspaceContext
from robotrue.core.files import read_bytes, sha256_of_file
from robotrue.core.json_values import texts_in
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.store import items
from robotrue.store.cells import copy_cell
from robotrue.store.jobs_work import Work
from robotrue.store.layout import copy_files
from robotrue.store.models import copy_file as copy_model
from robotrue.store.nouns import CELL, DOCUMENT, MODEL, NOUNS, REGISTRATION, CellRecord
from robotrue.store.records import ItemRecord, Link
from robotrue.store.registrations import REGISTERED

RESULTS: Final = "results"


class KeptContext(WorkspaceContext):
    """Context of a job whose result is saved; the cell may be that of a model or registration.

    Attributes:
        nouns: Of the items that the request refers to.
        results: Folder of what is written. Copies of cells and models lie next to it, so that a
            cell that is written names them without a folder.
        copies: Hashes of those copies, by their path.
    """

    def __init__(self, work: Work, naming: Naming) -> None:
        super().__init__(work, naming)
        self.nouns: dict[Reference, str] = {}
        self.copies: dict[Path, str] = {}
        self.results = self.folder(RESULTS)

    def cell_file(self, reference: Reference) -> Path:
        """Returns a cell.toml, or the model file or registered cell that is meant in its place."""
        return self._copy_beside(reference, CELL.name)

    def model_file(self, reference: Reference) -> Path:
        """Returns a model file, or the cell that is meant in its place."""
        return self._copy_beside(reference, MODEL.name)

    def registration_file(self, reference: Reference) -> Path:
        """Returns the registered cell.toml, its model next to it."""
        return self._copy_beside(reference, REGISTRATION.name)

    def document_files(self, reference: Reference, kind: str) -> tuple[Path, ...]:
        """Returns the files of a document, also those of another job, which their reader checks.

        Raises:
            ConfigurationError: A document of another kind, or that job wrote several files.
        """
        record = self.record(DOCUMENT, reference)
        if BLOCKS not in record.detail:
            return super().document_files(reference, kind)
        files = copy_files(self.work.workspace, record, self.folder(record.id))
        written = [path for path in files if path.name != record.detail[VALUES]]
        if len(written) != 1:
            raise ConfigurationError(
                f"{record.name!r} has {len(written)} files, expected one.", hint=f"a {kind}."
            )
        return (written[0],)

    def _copy_beside(self, reference: Reference, usual: str) -> Path:
        """The file of a cell, a model or a registration, beside the results."""
        noun, workspace = self.nouns.get(reference, usual), self.work.workspace
        record = self.record(NOUNS[noun], reference)
        taken = {each.name for each in record.attachments} & set(os.listdir(self.results))
        folder = self.folder(f"item {len(self.copies)}") if taken else self.results
        if noun == CELL.name:
            path = copy_cell(workspace, self.record(CELL, reference), folder)
        elif noun == MODEL.name:
            path = copy_model(workspace, self.record(MODEL, reference), folder)
        else:
            path = copy_files(workspace, record, folder, REGISTERED)[0]
        for each in folder.iterdir():
            self.copies.setdefault(each, sha256_of_file(each))
        return path


INPUTS: Final = "inputs"


class JobInputs:
    """Paths of the input files of a job; its results go to its folder.

    Attributes:
        links: To the items that it rests on.
        subjects: Names of the files that are read, then of the items.
    """

    def __init__(self, context: WorkspaceContext) -> None:
        self.links: list[Link] = []
        self.subjects: list[str] = []
        self._context = context

    def input_files(self, field: RequestField, stated: Sequence[FileItem]) -> tuple[Path, ...]:
        """Returns copies of the files that a field reads, with what came next to them.

        Raises:
            ConfigurationError: No such item or file, or one that names files of this computer.
        """
        together = isinstance(field.entry, InputFile) and field.entry.folder
        found: list[Path] = []
        for number, each in enumerate(stated, 1):
            folder = self._context.folder(INPUTS) / field.name
            folder = folder if together else folder / str(number)
            folder.mkdir(parents=True, exist_ok=True)
            found += self._copy(each, folder, several=field.many or together)
            if together:
                found = [folder]
        return tuple(found)

    def result_file(self, name: str) -> Path:
        """Returns where a result is written."""
        return self._context.output(Path(name))

    def _copy(self, stated: FileItem, folder: Path, *, several: bool) -> list[Path]:
        """Copies of the files of an item; those that are meant."""
        workspace = self._context.work.workspace
        noun, id = items.resolve(workspace, stated.id)
        record: ItemRecord = items.get(workspace, NOUNS[noun], id, version=stated.version)
        if record.deleted:
            raise ConfigurationError(f"{noun} {record.name!r} is deleted.", hint="bring it back.")
        self.links.append(Link(role=INPUTS, to=record.ref))
        self.subjects.append(stated.file or record.name)
        if isinstance(record, CellRecord) and noun == CELL.name:
            return [copy_cell(workspace, record, folder)]
        copies = copy_files(workspace, record, folder)
        meant = [path for path in copies if path.name == stated.file or not stated.file]
        if not meant:
            raise ConfigurationError(
                f"{noun} {record.name!r} has no file {stated.file!r}.",
                hint=", ".join(path.name for path in copies) or "another item.",
            )
        for path in copies:
            _require_own_files(path)
        return meant if several else meant[:1]


class JobPlaces(JobInputs):
    """Paths of a job whose result is saved; its results go to a separate folder."""

    def __init__(self, context: KeptContext) -> None:
        super().__init__(context)
        self._kept = context

    def result_file(self, name: str) -> Path:
        """Returns where a result is written."""
        return self._kept.results / name

    def results(self) -> list[Path]:
        """Returns the files that were written, and copies that they name; a folder is packed."""
        for folder in [each for each in self._kept.results.iterdir() if each.is_dir()]:
            shutil.make_archive(str(folder), "zip", folder)
            shutil.rmtree(folder)
        copies = self._kept.copies
        found = sorted(self._kept.results.iterdir())
        written = [path for path in found if copies.get(path) != sha256_of_file(path)]
        named = {text for path in written for text in _named_files(path)}
        return [path for path in found if path in written or path.name in named]

    def link_items(self, request: Request) -> None:
        """Checks that the items of a request exist, and records the links to them.

        Raises:
            ConfigurationError: One is not in the workspace, or deleted.
        """
        for field in fields_of(type(request)):
            stated = getattr(request, field.name)
            if isinstance(field.entry, Item) and stated is not None:
                for each in stated if isinstance(stated, tuple) else (stated,):
                    noun = self._kept.noun_of(each, (field.entry.noun, *field.entry.also))
                    self._kept.nouns[each] = noun
                    record = self._context.record(NOUNS[noun], each)
                    self.links.append(Link(role=field.name, to=record.ref))
                    self.subjects.append(record.name)


def _require_own_files(path: Path) -> None:
    """Refuses a TOML that names a file outside of the folder it came to."""
    for text in _named_files(path):
        named = PurePosixPath(text.replace("\\", "/"))
        if named.is_absolute() or ".." in named.parts:
            raise ConfigurationError(
                f"it names the file {text[:200]!r}, which did not come with it.",
                source=path.name,
                hint="choose a cell of the workspace, which brings the files it names.",
            )


def _named_files(path: Path) -> Iterator[str]:
    """All texts in a TOML, among them the files it may name; of another file none."""
    if path.suffix.lower() == ".toml":
        with suppress(tomllib.TOMLDecodeError):  # its reader reports the line
            text = read_bytes(path).decode("utf-8-sig", errors="replace")
            yield from texts_in(tomllib.loads(text))


@contextmanager
def hide_folder(folder: Path) -> Iterator[None]:
    """Removes the job's folder from error messages: it is on the server, and temporary."""
    try:
        yield
    except RobotrueError as cause:
        cause.message = without_folder(cause.message, folder)
        cause.hint = None if cause.hint is None else without_folder(cause.hint, folder)
        cause.source = None if cause.source is None else without_folder(cause.source, folder)
        raise


def without_folder(text: str, folder: Path) -> str:
    """Returns a text without the folder of a job in front of the names of its files."""
    inside = rf"{re.escape(str(folder))}(?:/(?:{RESULTS}|{INPUTS}(?:/\w+(?:/\d+)?)?)(?=/))?/?"
    return re.sub(inside, "", text)


def hide_in_values(value: object, folder: Path) -> object:
    """Returns JSON values without the folder of a job, as :func:`without_folder`."""
    if isinstance(value, str):
        return without_folder(value, folder)
    if isinstance(value, Mapping):
        return {name: hide_in_values(each, folder) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [hide_in_values(each, folder) for each in value]
    return value


def plain_block(block: Block, folder: Path) -> dict[str, object]:
    """Returns a block as JSON values, for the page of a result."""
    if isinstance(block, Note | Text):
        return {"form": type(block).__name__.lower(), "text": without_folder(block.text, folder)}
    rows = hide_in_values(block.rows, folder)
    values: dict[str, object] = {"title": without_folder(block.title, folder), "rows": rows}
    if isinstance(block, Table):
        return {"form": "table", **values, "columns": list(block.columns), "words": block.words}
    return {"form": "facts", **values, "measured": block.measured}
