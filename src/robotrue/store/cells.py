"""Cells in the store, with the arms and tools in them."""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import numpy as np
from sqlalchemy import select, true

from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cell.toml_edit import named_files, plain_names
from robotrue.core.files import sha256
from robotrue.errors import ConfigurationError
from robotrue.robot.identity import nominal_identity
from robotrue.store import items
from robotrue.store.layout import attached, laid_out
from robotrue.store.nouns import CELL, ROBOT, TOOL, Noun
from robotrue.store.records import CellRecord, Link, Record, Ref
from robotrue.store.workspace import Transaction, Workspace, transaction

FILE: Final = "cell"
COMPANION: Final = "companion"


def add(
    where: Workspace | Transaction,
    path: str | Path,
    *,
    name: str | None = None,
    note: str = "",
    id: str | None = None,
) -> CellRecord:
    """Returns a cell.toml taken in with the files it names, its arm and its tool.

    Args:
        where: Workspace or transaction.
        path: The file.
        name: In the workspace; None: that of the file.
        note: Of the user.
        id: Of the cell that gets this as its new version.

    Raises:
        ConfigurationError: The cell cannot be used, or a file it names is not there.
        FormatError: A file cannot be read.
    """
    path = Path(path)
    cell = read_cell(path)
    text, companions = _bundle(path, cell)
    with transaction(where) as into:
        files = [(FILE, "cell.toml", text.encode()), *companions]
        attachments = attached(into, files)
        robot, tool = _robot(into, cell), _tool(into, cell)
        columns = {
            "name": name or path.stem,
            "note": note,
            "detail": {
                "payload_kg": float(cell.payload.mass[0]),
                "repeatability_m": cell.repeatability,
                "tracker": cell.tracker.name,
                "parts": [] if cell.part is None else list(cell.part.names),
                "doubts": list(cell.doubts),
                "source": path.name,
            },
            "digest": sha256(text.encode()),
            "robot": cell.robot.name,
            "frame": cell.frame,
        }
        links = (Link(role="robot", to=robot), Link(role="tool", to=tool))
        return items.insert(into, CELL, columns, links=links, attachments=attachments, id=id)


def require_beside(text: str, names: Collection[str]) -> None:
    """Passes if a cell.toml names no file but those that came with it, by their names alone.

    Args:
        text: The cell.toml; whether it is one is not judged here.
        names: Of the files that came with it.

    Raises:
        ConfigurationError: Another file, which would be one of this machine.
    """
    try:
        stated = tomllib.loads(text)
    except tomllib.TOMLDecodeError:  # whoever reads it says where
        return
    for name in named_files(stated):
        if name not in names:
            raise ConfigurationError(
                f"the cell names the file {name!r}, which did not come with it.",
                hint="send it together with the cell, and let the cell name it without a folder.",
            )


def laid(workspace: Workspace, record: CellRecord, folder: Path) -> Path:
    """Returns the cell.toml written to a folder with the files it names.

    Raises:
        ArchiveError: A file is missing or was altered.
    """
    laid_out(workspace, record, folder, COMPANION)
    (path,) = laid_out(workspace, record, folder, FILE)
    return path


def _bundle(path: Path, cell: Cell) -> tuple[str, list[tuple[str, str, bytes | Path]]]:
    """Returns the text with every file it names beside it, and those files."""
    text, stated = plain_names(cell.text)
    return text, [(COMPANION, name, path.parent / own) for name, own in stated.items()]


def _robot(into: Transaction, cell: Cell) -> Ref:
    robot = cell.robot.nominal()
    identity = nominal_identity(robot).sha256
    columns = {
        "name": robot.name,
        "note": "",
        "detail": {"reach_m": float(robot.reach), "source": Path(cell.source).name},
        "maker": robot.maker,
        "dof": robot.dof,
        "identity": identity,
    }
    return _known(into, ROBOT, identity, columns)


def _tool(into: Transaction, cell: Cell) -> Ref:
    T = np.asarray(cell.robot.T_flange_tool)
    identity = sha256((np.round(T, 9) + 0.0).tobytes())
    columns = {
        "name": f"tool {identity[:8]}",
        "note": "",
        "detail": {"T_flange_tool": T.tolist(), "source": Path(cell.source).name},
        "identity": identity,
    }
    return _known(into, TOOL, identity, columns)


def _known(into: Transaction, noun: Noun[Any], identity: str, columns: dict[str, Any]) -> Ref:
    """The item of this identity; it is added where there is none."""
    table: Any = noun.table
    found = into.session.scalars(
        select(table).where(table.latest == true(), table.identity == identity).limit(1)
    ).first()
    if found is not None:
        return Ref(id=found.id, version=found.version)
    made: Record = items.insert(into, noun, columns)
    return made.ref
