"""The bin: permanently removes items deleted long ago that nothing depends on, with their files.

Everything else in a workspace is only ever added. This runs on request alone: an item is removed
with all its versions if its latest is marked deleted, if that was long enough ago, and if no
remaining item and no unfinished job needs it. The journal records that it existed.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import CompoundSelect, delete, select, true, union
from sqlalchemy.orm import Session

from robotrue.core.json_values import texts_in
from robotrue.errors import ConfigurationError
from robotrue.store import journal
from robotrue.store.blobs import STAGED, sweep
from robotrue.store.items import SHORTEST_ID
from robotrue.store.locks import hold_alone
from robotrue.store.nouns import MEASUREMENT, NOUNS, noun_of
from robotrue.store.schema import AttachmentRow, BlobRow, ItemRow, JobRow, LinkRow
from robotrue.store.workspace import LOCK, Transaction, Workspace, now

LONGEST: Final = 36500.0
"""d."""
_AT_ONCE: Final = 500
_OVER: Final = ("done", "failed", "cancelled")


@dataclass(frozen=True, slots=True, kw_only=True)
class Discarded:
    """An item in the bin.

    Attributes:
        noun: Of it.
        id: Its id.
        name: As it was called last.
        deleted: When.
    """

    noun: str
    id: str
    name: str
    deleted: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class RecycleBin:
    """Items and files that may be purged.

    Attributes:
        items: Nothing rests on them.
        needed: Deleted as long ago, and kept: something that stays rests on them.
        files: Of the items alone.
        bytes: Of those files.
    """

    items: tuple[Discarded, ...]
    needed: tuple[Discarded, ...]
    files: int
    bytes: int


def in_bin(workspace: Workspace, *, days: float) -> RecycleBin:
    """Returns what would go for good.

    Args:
        workspace: Looked at, not changed.
        days: Since the deletion, at least.

    Raises:
        ConfigurationError: The days are none.
    """
    before = _before(days)
    with workspace.read() as session:
        return _find_contents(session, before)[0]


def empty_bin(workspace: Workspace, *, days: float) -> RecycleBin:
    """Removes rows and files permanently, all or nothing, and returns them.

    A process that is killed in it leaves either everything, or files without a row, which the next
    opening of the workspace removes.

    Raises:
        ConfigurationError: The days are none, or another process is importing files at this moment.
    """
    before = _before(days)
    with hold_alone(workspace.folder / LOCK, wait=False) as mine:
        if not mine:
            raise ConfigurationError(
                "another process is importing files into the workspace.",
                hint="try again in a moment.",
            )
        with workspace.write() as into:
            for part in _parts(
                list(_find_deleted(into.session, before))
            ):  # no restore from here on
                asked = select(ItemRow.id).where(ItemRow.id.in_(part))
                into.session.execute(asked.with_for_update())
            found, files = _find_contents(into.session, before)
            _mark(workspace, files)
            _remove(into, found.items, [sha256 for sha256, _ in files])
        with workspace.read() as session:
            sweep(workspace.folder, lambda digest: session.get(BlobRow, digest) is not None)
    return found


def _before(days: float) -> datetime:
    if not 0.0 <= days <= LONGEST:
        raise ConfigurationError(
            f"{days:g} days since the deletion, expected 0 to {LONGEST:g}.", hint="30"
        )
    return now() - timedelta(days=days)


def _find_contents(session: Session, before: datetime) -> tuple[RecycleBin, list[tuple[str, str]]]:
    """Returns what may be purged, and the SHA-256 and place of its files."""
    old = _find_deleted(session, before)
    gone = _find_unneeded(session, set(old))
    files = list(_own_files(session, gone))
    found = RecycleBin(
        items=tuple(each for id, each in old.items() if id in gone),
        needed=tuple(each for id, each in old.items() if id not in gone),
        files=len(files),
        bytes=sum(row.size for row in files),
    )
    return found, [(row.sha256, row.place) for row in files]


def _find_deleted(session: Session, before: datetime) -> dict[str, Discarded]:
    found = {}
    for noun in NOUNS.values():
        table = noun.table
        asked = select(table.id, table.name, table.created).where(
            table.latest == true(), table.deleted == true(), table.created <= before
        )
        for id, name, at in session.execute(asked.order_by(table.created)):
            found[id] = Discarded(noun=noun.name, id=id, name=name, deleted=at)
    return found


def _find_unneeded(session: Session, old: set[str]) -> set[str]:
    """Those that nothing else rests on, and no job that is not over."""
    rests: dict[str, set[str]] = {}
    for id, to in session.execute(select(LinkRow.id, LinkRow.to_id).distinct()):
        rests.setdefault(id, set()).add(to)
    waiting = select(JobRow.parameters).where(JobRow.state.not_in(_OVER))
    named = {text.lower() for asked in session.scalars(waiting) for text in texts_in(asked)}
    begins = tuple(text for text in named if len(text) >= SHORTEST_ID)
    needed = {id for id in old if id.startswith(begins)}
    look = [*needed, *(id for id in rests if id not in old)]
    while look:
        for to in rests.get(look.pop(), ()):
            if to not in needed:
                needed.add(to)
                look.append(to)
    return old - needed


def _own_files(session: Session, gone: set[str]) -> Iterator[BlobRow]:
    """Files that versions of these items name, and of no other."""
    own: set[str] = set()
    samples, measured = MEASUREMENT.column("samples"), MEASUREMENT.table.id
    for digest, item in ((AttachmentRow.sha256, AttachmentRow.id), (samples, measured)):
        for part in _parts(sorted(gone)):
            own |= set(session.scalars(select(digest).where(item.in_(part))))
    for part in _parts(sorted(own)):
        users: CompoundSelect[object, str] = union(
            select(AttachmentRow.sha256, AttachmentRow.id).where(AttachmentRow.sha256.in_(part)),
            select(samples, measured).where(samples.in_(part)),
        )
        own -= {sha256 for sha256, id in session.execute(users) if id not in gone}
    for part in _parts(sorted(own)):
        yield from session.scalars(select(BlobRow).where(BlobRow.sha256.in_(part)))


def _mark(workspace: Workspace, files: Sequence[tuple[str, str]]) -> None:
    """Marks files that no row will name, before the rows go, so that :func:`sweep` finds them."""
    if files:
        place = workspace.folder / STAGED / uuid.uuid4().hex
        place.mkdir(parents=True)
        for sha256, kind in files:
            (place / f"{kind}-{sha256}").touch()


def _remove(into: Transaction, gone: Sequence[Discarded], files: Sequence[str]) -> None:
    session, ids = into.session, [each.id for each in gone]
    for part in _parts(ids):
        session.execute(delete(LinkRow).where(LinkRow.id.in_(part)))
        session.execute(delete(AttachmentRow).where(AttachmentRow.id.in_(part)))
    for name in {each.noun for each in gone}:
        table = noun_of(name).table
        for part in _parts([each.id for each in gone if each.noun == name]):
            session.execute(delete(table).where(table.id.in_(part)))
    for part in _parts(ids):
        session.execute(delete(ItemRow).where(ItemRow.id.in_(part)))
    for part in _parts(files):
        session.execute(delete(BlobRow).where(BlobRow.sha256.in_(part)))
    for each in gone:
        journal.record(into, "discarded", each.noun, each.id, detail={"name": each.name})


def _parts(values: Sequence[str]) -> Iterator[Sequence[str]]:
    """Databases take a limited number of values at once."""
    for start in range(0, len(values), _AT_ONCE):
        yield values[start : start + _AT_ONCE]
