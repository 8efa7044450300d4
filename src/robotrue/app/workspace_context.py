"""Operations on items of a workspace: inputs by id, outputs in the job's own folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeVar, cast

from robotrue.app.context import Context, Shell
from robotrue.app.measured_rows import join_rows, read_rows, require_mapped
from robotrue.app.reporting import Message
from robotrue.app.request import ItemVersion, Naming, Reference
from robotrue.calibration.model import data_hash
from robotrue.cell.cell import Cell
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.plausibility import FEWEST_POSES
from robotrue.store import cells, documents, items, measurements, models, programs
from robotrue.store.jobs_work import Work
from robotrue.store.layout import copy_files
from robotrue.store.model_file import ModelFile, read_model
from robotrue.store.nouns import (
    CELL,
    DOCUMENT,
    MEASUREMENT,
    MODEL,
    PROGRAM,
    REGISTRATION,
    CellRecord,
    DocumentRecord,
    Noun,
)
from robotrue.store.records import ItemQuery, ItemRecord, Link, Ref, provenance_of_record
from robotrue.store.registrations import REGISTERED
from robotrue.store.workspace import Transaction

R = TypeVar("R", bound=ItemRecord)


class WorkspaceContext(Context):
    """The :class:`robotrue.app.context.Context` of a job.

    Attributes:
        work: The job, its workspace and its folder.
        naming: Name and note of its result.
        shell: None of the shells.
    """

    def __init__(self, work: Work, naming: Naming) -> None:
        self.work, self.naming, self.shell = work, naming, Shell()
        self._records: dict[tuple[str, ItemVersion], ItemRecord] = {}
        self._sent: dict[Path, MeasurementSet] = {}

    def step(self, text: str, done: int, of: int) -> None:
        """Writes the job's progress; raises when it was cancelled."""
        self.work.step(text, done, of)

    def report(self, message: Message) -> None:
        """Saves one line with the job.

        Paths of the server are removed: they are private, and gone when the job is over.
        """
        self.work.remark(message.text.replace(f"{self.work.folder}/", ""))

    def wrote(self, what: str, path: Path, remark: str = "") -> None:
        """Saves the remark; the file becomes a part of an item, which shows it."""
        if remark:
            self.inform(f"{what} written to {path.name}{remark}")

    def record(self, noun: Noun[R], reference: Reference) -> R:
        """Returns the record that is meant, the same each time: its version does not change.

        Raises:
            ConfigurationError: It is not in the workspace, or deleted.
        """
        if not isinstance(reference, ItemVersion):
            raise ConfigurationError(f"{reference} is a file, expected the id of a {noun.name}.")
        key = (noun.name, reference)
        if key not in self._records:
            _, id = items.resolve(self.work.workspace, reference.id, noun.name)
            record = items.get(self.work.workspace, noun, id, version=reference.version)
            if record.deleted:
                raise ConfigurationError(
                    f"{noun.name} {record.name!r} is deleted.",
                    hint=f"robotrue workspace undo {id[:8]}",
                )
            self._records[key] = record
        return cast(R, self._records[key])

    def records(self, noun: Noun[R], references: Sequence[Reference]) -> list[R]:
        """Returns the records that are meant."""
        return [self.record(noun, each) for each in references]

    def ref(self, noun: Noun[R], reference: Reference | None) -> Ref | None:
        """Returns the version of an item that is meant; None where none is."""
        return None if reference is None else self.record(noun, reference).ref

    def noun_of(self, reference: Reference, nouns: Sequence[str]) -> str:
        """Returns which of some nouns is referred to; the first where there is no such item."""
        if isinstance(reference, ItemVersion):
            for noun in nouns:
                with suppress(ConfigurationError):
                    return items.resolve(self.work.workspace, reference.id, noun)[0]
        return nouns[0]

    def name(self, reference: Reference) -> str:
        """Returns the name of an item that was opened, else what was stated."""
        if isinstance(reference, Path):
            return reference.name
        opened = [r for (_, each), r in self._records.items() if each == reference]
        return opened[0].name if opened else reference.id

    def model(self, reference: Reference) -> ModelFile:
        """Returns a model of the workspace, or of a file that was sent along."""
        if isinstance(reference, Path):
            return read_model(reference)
        return models.model_of(self.work.workspace, self.record(MODEL, reference))

    def measurements(
        self,
        cell: Cell,
        references: Sequence[Reference],
        mapping: Path | None = None,
        *,
        minimum: int | None = None,
    ) -> MeasurementSet:
        """Returns measurement sets as one; ``mapping`` is of those that were sent along.

        Raises:
            ConfigurationError: No measurements, or a mapping and nothing that it could map.
        """
        if not references:
            raise ConfigurationError(
                "no measurements were stated.", hint="choose a measurement set, or send a file."
            )
        require_mapped(mapping, references)
        rows = [self.unchecked_rows(cell, each, mapping) for each in references]
        names = [self.name(each) for each in references]
        least = FEWEST_POSES if minimum is None else minimum
        return join_rows(cell, rows, names, reporter=self, minimum=least)

    def unchecked_rows(
        self, cell: Cell, reference: Reference, mapping: Path | None = None
    ) -> MeasurementSet:
        """Returns the rows of a stored set or of a file sent with the request, before any check."""
        if isinstance(reference, Path):
            self._sent[reference] = read_rows(cell, reference, mapping, reporter=self)
            return self._sent[reference]
        return measurements.rows_of(self.work.workspace, self.record(MEASUREMENT, reference))

    def keep_measured(
        self,
        into: Transaction,
        references: Sequence[Reference],
        cell: Ref | None,
        mapping: Path | None = None,
    ) -> list[Ref]:
        """Returns the measurement sets that are meant; a file that was sent becomes one.

        Args:
            into: The transaction that ends the job.
            references: Read before with :meth:`measurements` or :meth:`unchecked_rows`.
            cell: They were measured in.
            mapping: Of the files that were sent.
        """
        return [
            self._keep_rows(into, each, cell, mapping)
            if isinstance(each, Path)
            else self.record(MEASUREMENT, each).ref
            for each in references
        ]

    def _keep_rows(
        self, into: Transaction, path: Path, cell: Ref | None, mapping: Path | None
    ) -> Ref:
        """Returns the set of a file's rows, an existing one if it was imported before."""
        rows = self._sent[path]
        same = ItemQuery(where={"data": data_hash(rows), "name": path.stem})
        for each in items.search(into, MEASUREMENT, same).items:
            if list(each.refs("cell")) == ([] if cell is None else [cell]):
                return each.ref
        raw = [path, *([] if mapping is None else [mapping])]
        return measurements.add(into, rows, name=path.stem, raw=raw, cell=cell).ref

    def cell_file(self, reference: Reference) -> Path:
        """Returns where a cell.toml lies for this job, with the files it names."""
        record: CellRecord = self.record(CELL, reference)
        return cells.copy_cell(self.work.workspace, record, self.folder("cell"))

    def model_file(self, reference: Reference) -> Path:
        """Returns where a model file lies for this job."""
        record = self.record(MODEL, reference)
        return models.copy_file(self.work.workspace, record, self.work.folder)

    def registration_file(self, reference: Reference) -> Path:
        """Returns where a registered cell.toml lies for this job, with its model."""
        record = self.record(REGISTRATION, reference)
        return copy_files(self.work.workspace, record, self.work.folder, REGISTERED)[0]

    def program_files(
        self, references: Sequence[Reference], folder: str = "before"
    ) -> tuple[Path, ...]:
        """Returns where the files of a program lie for this job.

        Raises:
            ConfigurationError: Several programs, or none.
        """
        if len(references) != 1:
            raise ConfigurationError(f"{len(references)} programs, expected one.")
        record = self.record(PROGRAM, references[0])
        return programs.copy_program(self.work.workspace, record, self.folder(folder))

    def document_files(self, reference: Reference, kind: str) -> tuple[Path, ...]:
        """Returns where the files of a document lie for this job."""
        if isinstance(reference, Path):
            return (reference,)
        record = self.document(reference, kind)
        return copy_files(self.work.workspace, record, self.folder(record.id))

    def document(self, reference: Reference, kind: str) -> DocumentRecord:
        """Returns the record of a document.

        Raises:
            ConfigurationError: It is of another kind.
        """
        record = self.record(DOCUMENT, reference)
        if record.kind != kind:
            raise ConfigurationError(f"{record.name!r} is a {record.kind}, expected a {kind}.")
        return record

    def keep_document(
        self, into: Transaction, reference: Reference, kind: str, beside: Path | None = None
    ) -> DocumentRecord:
        """Returns the document that is meant; a file that was sent becomes one.

        Args:
            into: The transaction that ends the job.
            reference: Item or file.
            kind: Of the document.
            beside: A further file that it comes with.
        """
        if not isinstance(reference, Path):
            return self.document(reference, kind)
        files = [*([] if beside is None else [beside]), reference]
        return documents.add(into, kind, name=reference.stem, files=files)

    def folder(self, name: str) -> Path:
        """Returns a folder of this job."""
        folder = self.work.folder / name
        folder.mkdir(exist_ok=True)
        return folder

    def output(self, path: Path) -> Path:
        """Returns where an output is written: the folder of this job."""
        return self.work.folder / path

    def program_output(self, path: Path) -> Path:
        """Returns where the files of a program are written: a folder of this job."""
        return self.folder(path.name)

    def leave_document(
        self,
        into: Transaction,
        kind: str,
        about: str,
        files: Sequence[Path],
        links: Sequence[Link],
        detail: Mapping[str, object],
    ) -> dict[str, object]:
        """Adds a document with its files; returns the result of the job.

        Args:
            into: The transaction that ends the job.
            kind: Of the document.
            about: Name of what it is about, for its own.
            files: Tables, programs, pages.
            links: Items it depends on.
            detail: Its numbers, JSON values.
        """
        made: ItemRecord = documents.add(
            into,
            kind,
            name=self.naming.name or f"{kind} of {about}"[: items.LONGEST_NAME],
            note=self.naming.note,
            files=list(files),
            about=list(links),
            detail={**detail, "job": self.work.job.id},
        )
        simulated = provenance_of_record(made).simulated
        return {"document": ref_document(made.ref), "simulated": simulated}


def require_workspace(context: Context) -> WorkspaceContext:
    """Returns the context of an operation that needs a workspace.

    Raises:
        ConfigurationError: It runs on files.
    """
    if not isinstance(context, WorkspaceContext):
        raise ConfigurationError("items of a workspace are needed here, not files.")
    return context


def ref_document(ref: Ref) -> dict[str, object]:
    """Returns a version of an item as JSON values."""
    return {"id": ref.id, "version": ref.version}
