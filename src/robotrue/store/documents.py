"""What is kept besides models and programs: plans, validations, reports, and their numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robotrue.store import items
from robotrue.store.layout import attached
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import DocumentRecord, Link
from robotrue.store.workspace import Transaction, Workspace, transaction


def add(
    where: Workspace | Transaction,
    kind: str,
    *,
    name: str,
    files: Sequence[Path] = (),
    about: Sequence[Link] = (),
    detail: Mapping[str, Any] | None = None,
    note: str = "",
    id: str | None = None,
) -> DocumentRecord:
    """Returns a document taken in.

    Args:
        where: Workspace or transaction.
        kind: ``plan``, ``validation``, ``report``, ...
        name: In the workspace.
        files: Tables, programs, pages; their role is ``file``.
        about: What it rests on, by role.
        detail: Its numbers, JSON values.
        note: Of the user.
        id: Of the document that gets this as its new version.

    Raises:
        ConfigurationError: What it rests on is not in the workspace, or a file's name is none.
        FormatError: A file cannot be read.
    """
    with transaction(where) as into:
        attachments = attached(into, [("file", path.name, path) for path in files])
        columns = {"name": name, "note": note, "detail": dict(detail or {}), "kind": kind}
        return items.insert(into, DOCUMENT, columns, links=about, attachments=attachments, id=id)
