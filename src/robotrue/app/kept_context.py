"""What an operation works with in a job whose result is kept as a document."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from robotrue.app.job_files import BLOCKS, VALUES
from robotrue.app.job_naming import Naming
from robotrue.app.request import Reference
from robotrue.app.workspace_context import WorkspaceContext
from robotrue.core.files import sha256_of_file
from robotrue.errors import ConfigurationError
from robotrue.store.cells import copy_cell
from robotrue.store.jobs_work import Work
from robotrue.store.layout import copy_files
from robotrue.store.models import copy_file as copy_model
from robotrue.store.nouns import CELL, DOCUMENT, MODEL, NOUNS, REGISTRATION
from robotrue.store.registrations import REGISTERED

RESULTS: Final = "results"


class KeptContext(WorkspaceContext):
    """The context of a job whose result is kept: a cell may be that of a model or a registration.

    Attributes:
        nouns: Of the items that the request refers to.
        results: Folder of what is written. Copies of cells and models lie beside it, so that a cell
            that is written names them without a folder.
        copies: Hashes of those copies, by their path.
    """

    def __init__(self, work: Work, naming: Naming) -> None:
        super().__init__(work, naming)
        self.nouns: dict[Reference, str] = {}
        self.copies: dict[Path, str] = {}
        self.results = self.folder(RESULTS)

    def cell_file(self, reference: Reference) -> Path:
        """Returns a cell.toml, or the model file or registered cell that is meant in its place."""
        return self._copy(reference, CELL.name)

    def model_file(self, reference: Reference) -> Path:
        """Returns a model file, or the cell that is meant in its place."""
        return self._copy(reference, MODEL.name)

    def registration_file(self, reference: Reference) -> Path:
        """Returns the registered cell.toml, its model beside it."""
        return self._copy(reference, REGISTRATION.name)

    def document_files(self, reference: Reference, kind: str) -> tuple[Path, ...]:
        """Returns the files of a document, also of what another job wrote: its reader judges it.

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

    def _copy(self, reference: Reference, usual: str) -> Path:
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
