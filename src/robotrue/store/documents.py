"""Documents in the store: plans, validations, reports, and their numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from robotrue.store import items
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import Link
from robotrue.store.workspace import Transaction, Workspace


def add(
    where: Workspace | Transaction,
    kind: str,
    *,
    name: str,
    files: Sequence[Path] = (),
    about: Sequence[Link] = (),
    detail: Mapping[str, object] | None = None,
    note: str = "",
    id: str | None = None,
) -> DocumentRecord:
    """Returns an imported document.

    Args:
        where: Workspace or transaction.
        kind: ``plan``, ``validation``, ``report``, ...
        name: In the workspace.
        files: Tables, programs, pages; their role is ``file``.
        about: Items it depends on, by role.
        detail: Its numbers, JSON values.
        note: Of the user.
        id: Of the document that gets this as its new version.

    Raises:
        ConfigurationError: An item it depends on is not in the workspace, or an invalid file name.
        FormatError: A file cannot be read.
    """
    named = [("file", path.name, path) for path in files]
    return items.add(
        where, DOCUMENT, name=name, note=note, detail=detail, links=about, files=named, id=id,
        kind=kind,
    )  # fmt: skip
