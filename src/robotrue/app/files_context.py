"""Operations on files: references are paths, outputs go to the user's paths."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robotrue.app.context import Context, Shell
from robotrue.app.outputs import check_output
from robotrue.app.reporting import Message, Reporter
from robotrue.app.request import Output, Reference, Request, fields_of, input_paths, paths_in
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.store.model_file import ModelFile


class FilesContext(Context):
    """The :class:`robotrue.app.context.Context` of the command line and of scripts.

    Attributes:
        reporter: Receiver of messages.
        shell: The shell that runs the operation.
    """

    def __init__(self, reporter: Reporter, shell: Shell | None = None) -> None:
        self.reporter = reporter
        self.shell = Shell() if shell is None else shell

    def step(self, text: str, done: int, of: int) -> None:
        """Reports the progress."""
        self.reporter.step(text, done, of)

    def report(self, message: Message) -> None:
        """Reports one line."""
        self.reporter.report(message)

    def wrote(self, what: str, path: Path, remark: str = "") -> None:
        """Reports a file that was written."""
        self.inform(f"{what} written to {path}{remark}")

    def name(self, reference: Reference) -> str:
        """Returns the path as it was given."""
        return str(reference)

    def model(self, reference: Reference) -> ModelFile:
        """Returns the content of a model file."""
        from robotrue.store.model_file import read_model

        return read_model(self.model_file(reference))

    def measurements(
        self,
        cell: Cell,
        references: Sequence[Reference],
        mapping: Path | None = None,
        *,
        minimum: int | None = None,
    ) -> MeasurementSet:
        """Returns the rows of measurement files as one set."""
        from robotrue.app.measured_rows import join_rows
        from robotrue.measurement.plausibility import FEWEST_POSES

        paths = [_path(each) for each in references]
        sets = [self.unchecked_rows(cell, path, mapping) for path in paths]
        least = FEWEST_POSES if minimum is None else minimum
        return join_rows(cell, sets, [str(path) for path in paths], reporter=self, minimum=least)

    def unchecked_rows(
        self, cell: Cell, reference: Reference, mapping: Path | None = None
    ) -> MeasurementSet:
        """Returns the rows of one measurement file, before any check."""
        from robotrue.app.measured_rows import read_rows

        return read_rows(cell, _path(reference), mapping, reporter=self)

    def cell_file(self, reference: Reference) -> Path:
        """Returns the path of a cell.toml."""
        return _path(reference)

    def model_file(self, reference: Reference) -> Path:
        """Returns the path of a model file."""
        return _path(reference)

    def registration_file(self, reference: Reference) -> Path:
        """Returns the path of a registered cell.toml."""
        return _path(reference)

    def program_files(
        self, references: Sequence[Reference], folder: str = "before"
    ) -> tuple[Path, ...]:
        """Returns the paths of program files, or of the folder of a job."""
        return tuple(_path(each) for each in references)

    def document_files(self, reference: Reference, kind: str) -> tuple[Path, ...]:
        """Returns the path of the one file; its reader reports another kind."""
        return (_path(reference),)

    def output(self, path: Path) -> Path:
        """Returns the path as it was given."""
        return path

    def program_output(self, path: Path) -> Path:
        """Returns the path as it was given."""
        return path


def check_outputs(request: Request) -> None:
    """Refuses, before any work is done, outputs that are invalid or that are inputs.

    Raises:
        ConfigurationError: As :func:`robotrue.app.outputs.check_output`.
    """
    for field in fields_of(type(request)):
        if isinstance(field.entry, Output):
            read = input_paths(request, besides=field.entry.renews)
            for path in paths_in(getattr(request, field.name)):
                check_output(path, read, folder=field.entry.folder)


def _path(reference: Reference) -> Path:
    if not isinstance(reference, Path):
        raise ConfigurationError(f"item {reference.id!r} of a workspace, expected a file.")
    return reference
