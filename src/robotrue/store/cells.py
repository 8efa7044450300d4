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
from robotrue.robot.model import nominal_identity
from robotrue.store import items
from robotrue.store.layout import copy_files
from robotrue.store.nouns import CELL, ROBOT, TOOL, CellRecord, Noun, R
from robotrue.store.records import Ref, links_to
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
    """Returns an imported cell.toml with the files it names, its arm and its tool.

    Args:
        where: Workspace or transaction.
        path: The file.
        name: In the workspace; None: that of the file.
        note: Of the user.
        id: Of the cell that gets this as its new version.

    Raises:
        ConfigurationError: The cell cannot be used, or a file it names is missing.
        FormatError: A file cannot be read.
    """
    path = Path(path)
    cell = read_cell(path)
    # the text, every file it names next to it, and those files
    text, named = plain_names(cell.text)
    companions = [(COMPANION, plain, path.parent / own) for plain, own in named.items()]
    with transaction(where) as into:
        return items.add(
            into,
            CELL,
            name=name or path.stem,
            note=note,
            id=id,
            links=links_to(robot=_find_robot(into, cell), tool=_find_tool(into, cell)),
            files=[(FILE, "cell.toml", text.encode()), *companions],
            detail={
                "payload_kg": float(cell.payload.mass[0]),
                "repeatability_m": cell.repeatability,
                "tracker": cell.tracker.name,
                "parts": [] if cell.part is None else list(cell.part.names),
                "source": path.name,
            },
            digest=sha256(text.encode()),
            robot=cell.robot.name,
            frame=cell.frame,
        )


def require_beside(text: str, names: Collection[str]) -> None:
    """Passes if a cell.toml names only files that came with it, by their names alone.

    Args:
        text: The cell.toml; its validity is not checked here.
        names: Of the files that came with it.

    Raises:
        ConfigurationError: Another file, which would be one of this machine.
    """
    try:
        stated = tomllib.loads(text)
    except tomllib.TOMLDecodeError:  # its reader reports the line
        return
    for name in named_files(stated):
        if name not in names:
            raise ConfigurationError(
                f"the cell names the file {name!r}, which did not come with it.",
                hint="send it together with the cell, and let the cell name it without a folder.",
            )


def copy_cell(workspace: Workspace, record: CellRecord, folder: Path) -> Path:
    """Returns the cell.toml written to a folder with the files it names.

    Raises:
        ArchiveError: A file is missing or was altered.
    """
    copy_files(workspace, record, folder, COMPANION)
    (path,) = copy_files(workspace, record, folder, FILE)
    return path


def _find_robot(into: Transaction, cell: Cell) -> Ref:
    robot = cell.robot.nominal()
    return _find_or_add(
        into,
        ROBOT,
        identity=nominal_identity(robot).sha256,
        name=robot.name,
        detail={"reach_m": float(robot.reach), "source": Path(cell.source).name},
        maker=robot.maker,
        dof=robot.dof,
    )


def _find_tool(into: Transaction, cell: Cell) -> Ref:
    T = np.asarray(cell.robot.T_flange_tool)
    identity = sha256((np.round(T, 9) + 0.0).tobytes())
    detail = {"T_flange_tool": T.tolist(), "source": Path(cell.source).name}
    return _find_or_add(into, TOOL, identity=identity, name=f"tool {identity[:8]}", detail=detail)


def _find_or_add(
    into: Transaction,
    noun: Noun[R],
    *,
    identity: str,
    **columns: Any,
) -> Ref:
    """Returns the item of this identity; it is added where there is none."""
    table = noun.table
    latest = select(table).where(table.latest == true(), noun.column("identity") == identity)
    row = into.session.scalars(latest.limit(1)).first()
    if row is not None:
        return Ref(id=row.id, version=row.version)
    return items.add(into, noun, identity=identity, **columns).ref
