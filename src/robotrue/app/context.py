"""Context of an operation: its reporter, its opened inputs, the place of its outputs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from robotrue.app.presentation import LiveView
from robotrue.app.reporting import Message
from robotrue.app.request import Reference
from robotrue.core.files import write_atomic

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.store.model_file import ModelFile


class Shell:
    """A shell without a person: it shows no running service and answers no question."""

    def live(self) -> AbstractContextManager[Callable[[LiveView], None]]:
        """Yields what shows a service while it runs; each view replaces the one before."""
        return _drop_views()

    def confirm(self, question: str, word: str) -> bool | None:
        """Returns whether the answer to a question is a word; None: without a person to answer."""
        return None


@contextmanager
def _drop_views() -> Iterator[Callable[[LiveView], None]]:
    yield lambda view: None


class Context(ABC):
    """Inputs and outputs of one run; references are paths, or items of a workspace.

    Attributes:
        shell: The shell that runs it.
    """

    shell: Shell

    @abstractmethod
    def step(self, text: str, done: int, of: int) -> None:
        """Reports the next step and the progress, ``done`` of ``of``; may raise to cancel."""

    @abstractmethod
    def report(self, message: Message) -> None:
        """Reports one line."""

    def note(self, text: str) -> None:
        """Reports what deserves attention."""
        self.report(Message(text, label="note"))

    def inform(self, text: str) -> None:
        """Reports plain information."""
        self.report(Message(text))

    @abstractmethod
    def name(self, reference: Reference) -> str:
        """Returns what messages call an input."""

    def cell(self, reference: Reference) -> Cell:
        """Returns a cell; its warnings are noted.

        Raises:
            ConfigurationError: It cannot be used.
        """
        from robotrue.cell.config import read_cell

        return read_cell(self.cell_file(reference))

    @abstractmethod
    def model(self, reference: Reference) -> ModelFile:
        """Returns a model with the cell it was measured in.

        Raises:
            ArchiveError: Not a model.
        """

    @abstractmethod
    def measurements(
        self,
        cell: Cell,
        references: Sequence[Reference],
        mapping: Path | None = None,
        *,
        minimum: int | None = None,
    ) -> MeasurementSet:
        """Returns measured poses as one set, checked for plausibility.

        Args:
            cell: They were measured in.
            references: One or more.
            mapping: Columns of files of another layout.
            minimum: Rows that are needed; None: as many as a calibration.

        Raises:
            ImplausibleDataError: Numbers that are impossible for this robot.
            ModelMismatchError: Another number of joints, or sets in different frames.
        """

    @abstractmethod
    def unchecked_rows(
        self, cell: Cell, reference: Reference, mapping: Path | None = None
    ) -> MeasurementSet:
        """Returns one set of measured poses in the cell's frame, before any check."""

    @abstractmethod
    def cell_file(self, reference: Reference) -> Path:
        """Returns a cell.toml, the files it names next to it."""

    @abstractmethod
    def model_file(self, reference: Reference) -> Path:
        """Returns a model file."""

    @abstractmethod
    def registration_file(self, reference: Reference) -> Path:
        """Returns the registered cell.toml, its model next to it."""

    @abstractmethod
    def program_files(
        self, references: Sequence[Reference], folder: str = "before"
    ) -> tuple[Path, ...]:
        """Returns the files of one job of the robot, the program first.

        Args:
            references: The files, or the one program of a workspace.
            folder: Where those of a workspace lie: another one for each program.
        """

    @abstractmethod
    def document_files(self, reference: Reference, kind: str) -> tuple[Path, ...]:
        """Returns the files of a document, as those of a campaign with its foot.

        Raises:
            ConfigurationError: A document of another kind.
        """

    @abstractmethod
    def output(self, path: Path) -> Path:
        """Returns where an output is written."""

    @abstractmethod
    def program_output(self, path: Path) -> Path:
        """Returns the file or the folder that the files of a program are written to."""

    @abstractmethod
    def wrote(self, what: str, path: Path, remark: str = "") -> None:
        """Reports a file that was written; ``remark`` follows its name, with its punctuation."""

    def write(self, path: Path, content: str | bytes, what: str = "", remark: str = "") -> Path:
        """Writes an output and reports it; returns where it is.

        Args:
            path: As the request states it.
            content: Of the file; text is written as UTF-8.
            what: As :meth:`wrote` names it; nothing is reported where it is empty.
            remark: As :meth:`wrote`.

        Raises:
            FormatError: The folder cannot be written to, or the disk is full.
        """
        place = self.output(path)
        write_atomic(place, content.encode() if isinstance(content, str) else content)
        if what:
            self.wrote(what, place, remark)
        return place
