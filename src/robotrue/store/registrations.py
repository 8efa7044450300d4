"""Registrations in the store: where a part stands, found with which arm from which touches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from robotrue.cell.config import read_cell
from robotrue.errors import ConfigurationError
from robotrue.store import items
from robotrue.store.layout import attached
from robotrue.store.nouns import REGISTRATION
from robotrue.store.records import Link, Ref, RegistrationRecord
from robotrue.store.workspace import Transaction, Workspace, transaction

CELL_FILE: Final = "cell"
POINTS: Final = "points"


def add(
    where: Workspace | Transaction,
    registered: str | Path,
    points: str | Path,
    *,
    name: str,
    cell: Ref,
    model: Ref | None = None,
    session: Ref | None = None,
    reports: Sequence[Path] = (),
    note: str = "",
    id: str | None = None,
) -> RegistrationRecord:
    """Returns a registration taken in.

    Args:
        where: Workspace or transaction.
        registered: The cell.toml with its part frames.
        points: The touches.
        name: In the workspace.
        cell: The cell it belongs to.
        model: Of the arm that touched; None: the nominal one.
        session: Document the touches were entered in, if they were.
        reports: Pages about it.
        note: Of the user.
        id: Of the registration that gets this as its new version.

    Raises:
        ConfigurationError: The cell is not registered, or what it rests on is not in the workspace.
        FormatError: A file cannot be read.
    """
    registered, points = Path(registered), Path(points)
    part = read_cell(registered).part
    if part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame.",
            source=registered,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    links = [Link(role="cell", to=cell)]
    if model is not None:
        links.append(Link(role="model", to=model))
    if session is not None:
        links.append(Link(role="session", to=session))
    good = all(frame.verdict == "GO" for frame in part.frames)
    with transaction(where) as into:
        pages = [("report", page.name, page) for page in reports]
        attachments = attached(
            into, [(CELL_FILE, registered.name, registered), (POINTS, points.name, points), *pages]
        )
        columns = {
            "name": name,
            "note": note,
            "detail": {
                "frames": [frame.document() for frame in part.frames],
                "provenance": part.provenance.to_document(),
            },
            "method": part.method,
            "verdict": "GO" if good else "NO-GO",
            "frames": len(part.frames),
            "identity": part.identity.sha256,
        }
        return items.insert(
            into, REGISTRATION, columns, links=links, attachments=attachments, id=id
        )
