"""Registrations in the store: part frames, and the probing sessions they came from.

A session is a document of kind ``touching``: every reading is a new version, written before it is
answered; several people may write to it, each to the version they have seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from robotrue.cell.config import read_cell
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.touch_session import ProbingSession, session_document, session_of
from robotrue.store import documents, items
from robotrue.store.nouns import DOCUMENT, REGISTRATION, DocumentRecord, RegistrationRecord
from robotrue.store.records import Ref, links_to
from robotrue.store.workspace import Transaction, Workspace, transaction

REGISTERED: Final = "cell"
"""Role of the cell.toml of a registration."""
POINTS: Final = "points"
SESSION_KIND: Final = "touching"
SESSION: Final = "session"
RESULT: Final = "registration"


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
    """Stores the imported registration of a part and its probing points.

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
    good = all(frame.verdict == "GO" for frame in part.frames)
    named = [(REGISTERED, registered), (POINTS, points), *(("report", page) for page in reports)]
    return items.add(
        where,
        REGISTRATION,
        name=name,
        note=note,
        id=id,
        links=links_to(cell=cell, model=model, session=session),
        files=[(role, path.name, path) for role, path in named],
        detail={
            "frames": [{**frame.document(), **frame.spread_document()} for frame in part.frames],
            "provenance": part.provenance.to_document(),
        },
        method=part.method,
        verdict="GO" if good else "NO-GO",
        frames=len(part.frames),
        identity=part.identity.sha256,
    )


def add_session(
    where: Workspace | Transaction,
    session: ProbingSession,
    *,
    name: str,
    cell: Ref,
    model: Ref | None,
    files: Sequence[Path] = (),
) -> DocumentRecord:
    """Returns a session at the part that was added to the store.

    Args:
        where: Workspace or transaction.
        session: Without readings, or with those of a file.
        name: In the workspace.
        cell: Frame of the part.
        model: Of the arm that touches; None: the nominal one.
        files: That the features came from.

    Raises:
        ConfigurationError: An item it depends on is not in the workspace.
        FormatError: A file cannot be read.
    """
    detail = {SESSION: session_document(session)}
    about = links_to(cell=cell, model=model)
    return documents.add(where, SESSION_KIND, name=name, files=files, about=about, detail=detail)


def session_in(record: DocumentRecord) -> ProbingSession:
    """Returns the session of a record.

    Raises:
        ConfigurationError: The record is of another kind.
    """
    if record.kind != SESSION_KIND:
        raise ConfigurationError(f"document {record.name!r} is a {record.kind}, no session.")
    return session_of(record.detail[SESSION])


def result_of(record: DocumentRecord) -> str | None:
    """Returns the id of the registration that was made of a session, None before it is done."""
    found = record.detail.get(RESULT)
    return None if found is None else str(found)


def save_session(
    where: Workspace | Transaction,
    id: str,
    version: int,
    session: ProbingSession,
    *,
    result: str | None = None,
) -> DocumentRecord:
    """Returns the new version of a session.

    Args:
        where: Workspace or transaction.
        id: Of the session.
        version: Version that was changed; it must still be the latest.
        session: The changed session.
        result: Id of the registration made from it.

    Raises:
        ModelMismatchError: Another user wrote to it meanwhile; nothing is written.
        ConfigurationError: There is no such session, or it is deleted.
    """
    with transaction(where) as into:
        before = items.get(into, DOCUMENT, id)
        if before.deleted:
            raise ConfigurationError(f"session {before.name!r} is deleted.", hint="History")
        _require_latest(before.version, version)
        # a new reading makes an old result stale
        detail = {key: value for key, value in before.detail.items() if key != RESULT}
        detail |= {SESSION: session_document(session)}
        detail |= {} if result is None else {RESULT: result}
        made = items.add_version(into, DOCUMENT, before, detail=detail)
        _require_latest(made.version - 1, version)  # two at the same moment: the second waited
        return made


def _require_latest(latest: int, seen: int) -> None:
    if latest != seen:
        raise ModelMismatchError(
            f"the session has changed meanwhile: it is at version {latest}, not {seen}.",
            hint="look at it again; your entry was not saved.",
        )
