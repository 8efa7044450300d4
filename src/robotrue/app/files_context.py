"""Operations on files: references are paths, outputs go where the user says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robotrue.app.outputs import check_output
from robotrue.app.reporting import Message, Reporter
from robotrue.app.request import InputFile, Item, Output, Reference, Request, fields_of
from robotrue.app.shell import Shell
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.store.model_file import ModelFile


class FilesContext:
    """The :class:`robotrue.app.context.Context` of the command line and of scripts.

    Attributes:
        reporter: Who listens.
        shell: Who runs the operation.
    """

    def __init__(self, reporter: Reporter, shell: Shell | None = None) -> None:
        self.reporter = reporter
        self.shell = Shell() if shell is None else shell

    def step(self, text: str, done: int, of: int) -> None:
        """Reports how far it is."""
        self.reporter.step(text, done, of)

    def report(self, message: Message) -> None:
        """Reports one line."""
        self.reporter.report(message)

    def note(self, text: str) -> None:
        """Reports what deserves attention."""
        self.report(Message(text, label="note"))

    def inform(self, text: str) -> None:
        """Reports plain information."""
        self.report(Message(text))

    def wrote(self, what: str, path: Path, remark: str = "") -> None:
        """Reports a file that was written."""
        self.inform(f"{what} written to {path}{remark}")

    def name(self, reference: Reference) -> str:
        """Returns the path as it was given."""
        return str(reference)

    def cell(self, reference: Reference) -> Cell:
        """Returns the cell of a cell.toml; its warnings are noted."""
        from robotrue.cell.config import read_cell

        cell = read_cell(self.cell_file(reference))
        for warning in cell.doubts:
            self.note(warning)
        return cell

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
        from robotrue.app.measured_rows import FEWEST_ROWS, read_together

        paths = [_path(each) for each in references]
        least = FEWEST_ROWS if minimum is None else minimum
        return read_together(cell, paths, mapping, reporter=self, minimum=least)

    def cell_file(self, reference: Reference) -> Path:
        """Returns the path of a cell.toml."""
        return _path(reference)

    def model_file(self, reference: Reference) -> Path:
        """Returns the path of a model file."""
        return _path(reference)

    def registration_file(self, reference: Reference) -> Path:
        """Returns the path of a registered cell.toml."""
        return _path(reference)

    def program_files(self, references: Sequence[Reference]) -> tuple[Path, ...]:
        """Returns the paths of program files, or of the folder of a job."""
        return tuple(_path(each) for each in references)

    def output(self, path: Path) -> Path:
        """Returns the path as it was given."""
        return path


def check_outputs(request: Request) -> None:
    """Refuses, before any work is done, outputs that cannot be or that are inputs.

    Raises:
        ConfigurationError: As :func:`robotrue.app.outputs.check_output`.
    """
    fields = fields_of(type(request))
    inputs = [
        path
        for field in fields
        if isinstance(field.entry, Item | InputFile)
        for path in _paths(getattr(request, field.name))
    ]
    for field in fields:
        if isinstance(field.entry, Output):
            for path in _paths(getattr(request, field.name)):
                check_output(path, inputs, folder=field.entry.folder)


def _paths(value: Any) -> Iterator[Path]:
    for each in value if isinstance(value, tuple) else (value,):
        if isinstance(each, Path):
            yield each


def _path(reference: Reference) -> Path:
    if not isinstance(reference, Path):
        raise ConfigurationError(f"item {reference.id!r} of a workspace, expected a file.")
    return reference
