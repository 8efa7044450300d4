"""Operations on objects of this process: each has a file in a folder that is gone afterwards.

An operation reads the object, not the file; the file is there for what only works on files.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from robotrue.app.files_context import FilesContext
from robotrue.app.reporting import Message
from robotrue.app.request import Reference

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.store.model_file import ModelFile


class MessageList:
    """A reporter that keeps every line and drops the progress.

    Attributes:
        messages: In their order.
        folder: Temporary folder, which messages do not name.
    """

    def __init__(self, folder: Path) -> None:
        self.messages: list[Message] = []
        self.folder = folder

    def report(self, message: Message) -> None:
        """Keeps one line without the names of temporary files."""
        inside = re.escape(str(self.folder))
        text = re.sub(rf",? written to {inside}/\S*", "", message.text)
        text = re.sub(rf"{inside}/(?:\d+/)?", "", text)
        self.messages.append(Message(text, label=message.label))

    def step(self, text: str, done: int, of: int) -> None:
        """Drops the progress."""


class ObjectsContext(FilesContext):
    """The context of the library.

    Attributes:
        folder: Holds a file for each object; the caller removes it.
    """

    def __init__(self, folder: Path) -> None:
        self.listener = MessageList(folder)
        super().__init__(self.listener)
        self.folder = folder
        self._cells: dict[Path, Cell] = {}
        self._models: dict[Path, ModelFile] = {}
        self._rows: dict[Path, MeasurementSet] = {}

    @property
    def messages(self) -> tuple[Message, ...]:
        """Reported messages."""
        return tuple(each for each in self.listener.messages if each.text)

    def new_file(self, name: str) -> Path:
        """Returns a path in a new folder; nothing is written."""
        place = self.folder / str(sum(1 for _ in self.folder.iterdir()) + 1)
        place.mkdir()
        return place / name

    def name(self, reference: Reference) -> str:
        """Returns the path as it was given; of an object the name of its file alone."""
        inside = isinstance(reference, Path) and reference.is_relative_to(self.folder)
        return Path(str(reference)).name if inside else super().name(reference)

    def wrote(self, what: str, path: Path, remark: str = "") -> None:
        """Reports a file that was written, unless it is a temporary one."""
        if not path.is_relative_to(self.folder):
            super().wrote(what, path, remark)

    def add_cell(self, cell: Cell) -> Path:
        """Writes a cell to a file and returns its path."""
        from robotrue.cell.cell_text import portable_text

        text, files = portable_text(cell)
        path = self.new_file("cell.toml")
        path.write_text(text, encoding="utf-8")
        for name, data in files.items():
            (path.parent / name).write_bytes(data)
        self._cells[path] = cell
        return path

    def add_model(self, stored: ModelFile, name: str) -> Path:
        """Writes a model to a file and returns its path."""
        from robotrue.store.model_file import write_model

        path = self.new_file(name)
        write_model(path, stored.model, stored.cell)
        self._models[path] = stored
        return path

    def add_rows(self, rows: MeasurementSet) -> Path:
        """Writes measured poses to a file, without partial orientations; returns its path."""
        import numpy as np

        from robotrue.measurement.formats.canonical import write_canonical

        path = self.new_file("measurements.csv")
        whole = rows.has_rotation.all() or not rows.has_rotation.any()
        nowhere = np.full((len(rows), 3, 3), np.nan)
        write_canonical(path, rows if whole else replace(rows, rotation=nowhere))
        self._rows[path] = rows
        return path

    def cell(self, reference: Reference) -> Cell:
        """Returns the cell that was given, or the one of a file."""
        known = self._cells.get(self.cell_file(reference))
        return super().cell(reference) if known is None else known

    def model(self, reference: Reference) -> ModelFile:
        """Returns the model that was given, or the one of a file."""
        known = self._models.get(self.model_file(reference))
        return super().model(reference) if known is None else known

    def unchecked_rows(
        self, cell: Cell, reference: Reference, mapping: Path | None = None
    ) -> MeasurementSet:
        """Returns the poses that were given, or those of a file."""
        known = self._rows.get(reference) if isinstance(reference, Path) else None
        return super().unchecked_rows(cell, reference, mapping) if known is None else known
