"""Sessions at the part in the store: every reading is a new version, written before it is answered.

A session is a document of kind ``touching``; several people may write to it, each to the version
they have seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.touch_session import TouchSession, session_document, session_of
from robotrue.store import documents, items
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import DocumentRecord, Link, Ref
from robotrue.store.workspace import Transaction, Workspace, transaction

KIND: Final = "touching"
SESSION: Final = "session"
RESULT: Final = "registration"


def begin(
    where: Workspace | Transaction,
    session: TouchSession,
    *,
    name: str,
    cell: Ref,
    model: Ref | None,
    files: Sequence[Path] = (),
) -> DocumentRecord:
    """Returns a session taken in.

    Args:
        where: Workspace or transaction.
        session: Without readings, or with those of a file.
        name: In the workspace.
        cell: Where the part stands.
        model: Of the arm that touches; None: the nominal one.
        files: That the features came from.

    Raises:
        ConfigurationError: What it rests on is not in the workspace.
        FormatError: A file cannot be read.
    """
    about = [Link(role="cell", to=cell)]
    about += [] if model is None else [Link(role="model", to=model)]
    detail = {SESSION: session_document(session)}
    return documents.add(where, KIND, name=name, files=files, about=about, detail=detail)


def session_in(record: DocumentRecord) -> TouchSession:
    """Returns the session of a record.

    Raises:
        ConfigurationError: The record is of another kind.
    """
    if record.kind != KIND:
        raise ConfigurationError(f"document {record.name!r} is a {record.kind}, no session.")
    return session_of(record.detail[SESSION])


def result_of(record: DocumentRecord) -> str | None:
    """Returns the id of the registration that was made of a session, None before it is done."""
    found = record.detail.get(RESULT)
    return None if found is None else str(found)


def changed(
    where: Workspace | Transaction,
    id: str,
    version: int,
    session: TouchSession,
    *,
    result: str | None = None,
) -> DocumentRecord:
    """Returns the new version of a session.

    Args:
        where: Workspace or transaction.
        id: Of the session.
        version: That was changed; it must still be the latest.
        session: As it is now.
        result: Id of the registration that was made of it.

    Raises:
        ModelMismatchError: Somebody else wrote to it meanwhile; nothing is written.
        ConfigurationError: There is no such session, or it is deleted.
    """
    with transaction(where) as into:
        before = items.get(into, DOCUMENT, id)
        if before.deleted:
            raise ConfigurationError(f"session {before.name!r} is deleted.", hint="History")
        _require_latest(before.version, version)
        detail: dict[str, Any] = {**_plain(before.detail), SESSION: session_document(session)}
        if result is not None:
            detail[RESULT] = result
        columns = {
            "name": before.name, "note": before.note, "detail": detail, "kind": before.kind
        }  # fmt: skip
        made = items.insert(
            into, DOCUMENT, columns, links=before.links, attachments=before.attachments, id=id
        )
        _require_latest(made.version - 1, version)  # two at the same moment: the second waited
        return made


def _plain(detail: Mapping[str, Any]) -> dict[str, Any]:
    """What else is kept of a session; a new reading makes an old result stale."""
    return {key: value for key, value in detail.items() if key != RESULT}


def _require_latest(latest: int, seen: int) -> None:
    if latest != seen:
        raise ModelMismatchError(
            f"the session went on meanwhile: it is at version {latest}, not {seen}.",
            hint="look at it again; what you entered was not taken.",
        )
