"""The text of a registered cell: that of the cell, and the part where touching found it."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import parse_cell
from robotrue.cell.part import PartTable, part_tables
from robotrue.cell.toml_edit import rename_files, with_part
from robotrue.core.files import read_bytes
from robotrue.store.model_file import ZIP


def model_file_of(cell: Cell, source: Path) -> Path | None:
    """Returns the model file that was given, itself or by a registered cell; None: nominal."""
    if read_bytes(source).startswith(ZIP):
        return source
    if cell.part is None or cell.part.identity.kind == "nominal":
        return None
    return source.parent / cell.part.model_file


def relative_name(path: Path, output: Path) -> str:
    """Returns a path as the file that is written names it."""
    return Path(os.path.relpath(path.resolve(), output.parent.resolve())).as_posix()


def registered_cell(cell: Cell, source: Path, table: PartTable, output: Path) -> bytes:
    """Returns the registered cell, read back before anything is written."""
    if not read_bytes(source).startswith(ZIP):
        text = rename_files(cell.text, partial(_move_path, source=source, output=output))
    elif cell.text and not cell.files:
        text = cell.text
    else:  # the files that it names are in the model file, not beside the output
        text = cell_text(cell)
    data = with_part(text, part_tables(table)).encode()
    parse_cell(data, output)
    return data


def _move_path(name: str, source: Path, output: Path) -> str:
    """A path that one cell file names, as another names it."""
    path = (source.parent / name).resolve()
    if Path(name).is_absolute() or source.parent.resolve() == output.parent.resolve():
        return str(name)
    return Path(os.path.relpath(path, output.parent.resolve())).as_posix()
