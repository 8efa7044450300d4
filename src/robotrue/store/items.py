"""Items of every noun: added, searched, changed, deleted and brought back; nothing is lost."""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from typing import Final, TypeVar

from sqlalchemy import Select, false, func, or_, select, true, tuple_, update
from sqlalchemy.orm import InstrumentedAttribute, Session

from robotrue.core.json_values import json_values, plain_text
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.store import journal
from robotrue.store.layout import attach_files
from robotrue.store.nouns import NOUNS, Noun, noun_of
from robotrue.store.records import Attachment, ItemQuery, ItemRecord, Link, Ref, ResultPage
from robotrue.store.schema import NAME, AttachmentRow, ItemRow, LinkRow, Versioned
from robotrue.store.workspace import Transaction, Workspace, now, reading, transaction

R = TypeVar("R", bound=ItemRecord)
LONGEST_NAME: Final = NAME.length or 200
SHORTEST_ID: Final = 4
"""Shortest abbreviation of an id, in characters."""
MOST: Final = 1000
"""Items of one page."""
_BESIDE: Final = frozenset({"links", "attachments"})
"""Fields of a record with separate tables."""
_OWN: Final = frozenset({"id", "version", "latest", "deleted", "created"}) | _BESIDE
_NOT_SORTED: Final = frozenset({"detail", "settings"}) | _BESIDE


def add(
    where: Workspace | Transaction,
    noun: Noun[R],
    *,
    name: str,
    note: str = "",
    detail: Mapping[str, object] | None = None,
    links: Sequence[Link] = (),
    files: Iterable[tuple[str, str, bytes | Path]] = (),
    id: str | None = None,
    **columns: object,
) -> R:
    """Returns a new item, or with an id a new version of it, that has just been written.

    Args:
        where: Workspace or transaction.
        noun: Its noun.
        name: In the workspace.
        note: Of the user.
        detail: What else is known of it, JSON values.
        links: Items it depends on.
        files: Role, name and content of each of its files.
        id: Of the item that gets a new version.
        columns: Those of the noun.

    Raises:
        ConfigurationError: No such item, what it is to rest on is missing, or a file's name is
            none.
        FormatError: A file cannot be read.
    """
    columns |= {"name": name, "note": note, "detail": dict(detail or {})}
    with transaction(where) as into:
        return _insert(into, noun, columns, links, attach_files(into, files), id)


def add_version(into: Transaction, noun: Noun[R], before: R, **changes: object) -> R:
    """Returns the new version of an item that is as the one before but for some columns."""
    columns = {**_columns(before), **changes}
    return _insert(into, noun, columns, before.links, before.attachments, before.id)


def _insert(
    into: Transaction,
    noun: Noun[R],
    columns: Mapping[str, object],
    links: Sequence[Link],
    attachments: Sequence[Attachment],
    id: str | None,
) -> R:
    columns = _clean(columns)
    session = into.session
    for link in links:
        _require_there(session, link.to)
    if id is None:
        return _write(into, noun, str(uuid.uuid4()), 1, columns, links, attachments, "added")
    version = _lock(session, noun, id).version + 1
    return _write(into, noun, id, version, columns, links, attachments, "changed")


def _clean(columns: Mapping[str, object]) -> dict[str, object]:
    """The columns as any database keeps them: JSON values, text of whole characters, no NUL."""
    clean = {
        key: json_values(value) if isinstance(value, Mapping) else value
        for key, value in columns.items()
    }
    name, clean["note"] = (str(columns[key]).strip() for key in ("name", "note"))
    clean["name"] = name
    if not 0 < len(name) <= LONGEST_NAME:
        raise ConfigurationError(
            f"a name of {len(name)} characters, expected 1 to {LONGEST_NAME}.",
            hint="--name",
        )
    if not plain_text(clean):
        raise ConfigurationError(
            f"{name[:40]!a} or its note holds a NUL character or half of one.",
            hint="type it again.",
        )
    return clean


def _write(
    into: Transaction,
    noun: Noun[R],
    id: str,
    version: int,
    columns: Mapping[str, object],
    links: Sequence[Link],
    attachments: Sequence[Attachment],
    action: str,
    *,
    deleted: bool = False,
) -> R:
    session, at = into.session, now()
    if version == 1:
        session.add(ItemRow(id=id, noun=noun.name, created=at))
        session.flush()
    else:
        table = noun.table
        earlier = update(table).where(table.id == id, table.latest == true())
        session.execute(earlier.values(latest=False))
    key = {"id": id, "version": version}
    session.add(noun.table(**columns, **key, latest=True, deleted=deleted, created=at))
    for position, link in enumerate(links):
        to = {"to_id": link.to.id, "to_version": link.to.version}
        session.add(LinkRow(**key, role=link.role, position=position, **to))
    for position, file in enumerate(attachments):
        row = {"role": file.role, "name": file.name, "sha256": file.sha256}
        session.add(AttachmentRow(**key, position=position, **row))
    journal.record(into, action, noun.name, id, version, {"name": columns["name"]})
    session.flush()
    return get(into, noun, id, version=version)


def get(where: Workspace | Transaction, noun: Noun[R], id: str, *, version: int | None = None) -> R:
    """Returns one version of an item, also of one that is deleted; None: the latest.

    Raises:
        ConfigurationError: It is missing.
    """
    with reading(where) as session:
        return _records(session, noun, [_row(session, noun, id, version)])[0]


def search(where: Workspace | Transaction, noun: Noun[R], query: ItemQuery) -> ResultPage[R]:
    """Returns a page of the latest versions.

    Raises:
        ConfigurationError: A field that the noun has not, or an invalid page.
    """
    if query.offset < 0 or not 0 < query.limit <= MOST:
        raise ConfigurationError(
            f"items {query.offset} and on, {query.limit} of them, expected 0 or more and 1 to "
            f"{MOST}.",
            hint="--limit 50",
        )
    chosen = _select(noun, query)
    field = query.sort.removeprefix("-")
    column = _column(noun, field)
    falling = query.sort.startswith("-")
    order = [each.desc() if falling else each.asc() for each in (column, noun.table.id)]
    page = chosen.order_by(*order).offset(query.offset).limit(query.limit)
    with reading(where) as session:
        if query.text or query.where:
            rows, total = _read_counted(session, noun, page)
        else:  # both come from an index
            rows, total = session.scalars(page).all(), None
        if total is None:
            counted = chosen.with_only_columns(func.count(), maintain_column_froms=True)
            total = session.scalar(counted) or 0
        found = _records(session, noun, rows)
    return ResultPage(items=tuple(found), total=total, offset=query.offset)


def _read_counted(
    session: Session, noun: Noun[R], page: Select[Versioned]
) -> tuple[Sequence[Versioned], int | None]:
    """Returns the rows of a page and the total number, in one pass over the table.

    Beyond the last page the total is not known.
    """
    table = noun.table
    keys = session.execute(
        page.with_only_columns(
            table.id, table.version, func.count().over(), maintain_column_froms=True
        )
    ).all()
    if not keys:
        return (), None
    order = {(id, version): place for place, (id, version, _) in enumerate(keys)}
    rows = session.scalars(select(table).where(tuple_(table.id, table.version).in_(list(order))))
    return sorted(rows, key=lambda row: order[row.id, row.version]), int(keys[0][2])


def _select(noun: Noun[R], query: ItemQuery) -> Select[Versioned]:
    table = noun.table
    state = true() if query.deleted else false()
    chosen = select(table).where(table.latest == true(), table.deleted == state)
    if query.text:
        chosen = chosen.where(
            or_(*(each.icontains(query.text, autoescape=True) for each in (table.name, table.note)))
        )
    for field, value in query.where.items():
        chosen = chosen.where(_column(noun, field) == value)
    if query.linked is not None:
        role, to = query.linked
        rests = select(LinkRow.id).where(
            LinkRow.id == table.id,
            LinkRow.version == table.version,
            LinkRow.role == role,
            LinkRow.to_id == to,
        )
        chosen = chosen.where(rests.exists())
    return chosen


def _column(noun: Noun[R], field: str) -> InstrumentedAttribute[object]:
    known = [f.name for f in fields(noun.record) if f.name not in _NOT_SORTED]
    if field not in known:
        raise ConfigurationError(
            f"{noun.name} has no field {field!r}; it has {', '.join(known)}.",
            hint="--sort=-created",
        )
    return noun.column(field)


def versions(where: Workspace | Transaction, noun: Noun[R], id: str) -> tuple[R, ...]:
    """Returns all versions of an item, the first first.

    Raises:
        ConfigurationError: It is missing.
    """
    with reading(where) as session:
        _row(session, noun, id, None)
        table = noun.table
        rows = session.scalars(select(table).where(table.id == id).order_by(table.version))
        return tuple(_records(session, noun, list(rows)))


def read_creation_times(where: Workspace | Transaction, ids: Sequence[str]) -> dict[str, datetime]:
    """Returns when each item came to be; a record says when its version did."""
    with reading(where) as session:
        found = session.execute(select(ItemRow.id, ItemRow.created).where(ItemRow.id.in_(ids)))
        return {id: at for id, at in found}


def change(
    where: Workspace | Transaction,
    noun: Noun[R],
    id: str,
    *,
    name: str | None = None,
    note: str | None = None,
) -> R:
    """Returns the new version of an item with another name or note.

    Raises:
        ConfigurationError: It is missing, or deleted.
    """
    with transaction(where) as into:
        before = _require_living(into, noun, id)
        name, note = (
            (before.name if name is None else name),
            (before.note if note is None else note),
        )
        return add_version(into, noun, before, name=name, note=note)


def delete(where: Workspace | Transaction, noun: Noun[R], id: str) -> R:
    """Marks an item as deleted and returns that version; all its content remains.

    Raises:
        ConfigurationError: It is missing, or deleted already.
    """
    with transaction(where) as into:
        return _repeat(into, noun, _require_living(into, noun, id), "deleted", deleted=True)


def undo(
    where: Workspace | Transaction, noun: Noun[R], id: str, *, version: int | None = None
) -> R:
    """Returns the item as it was before its latest version: undeleted, or with its earlier content.

    That is a new version, too: to undo twice is to be where one was.

    Args:
        where: Workspace or transaction.
        noun: Its noun.
        id: Of the item.
        version: That is to be taken back; None: the latest, whatever others did meanwhile.

    Raises:
        ConfigurationError: It is missing, or has only its first version.
        ModelMismatchError: The version is not the latest any more.
    """
    with transaction(where) as into:
        _lock(into.session, noun, id)
        latest = get(into, noun, id)
        if version is not None and latest.version != version:
            raise ModelMismatchError(
                f"version {version} of {noun.name} {latest.name!r} is not its latest any more, "
                f"version {latest.version} is.",
                hint="look at it again.",
            )
        if latest.version == 1:
            raise ConfigurationError(
                f"{noun.name} {latest.name!r} has only its first version: nothing to undo.",
                hint=f"robotrue workspace delete {id}",
            )
        before = get(into, noun, id, version=latest.version - 1)
        return _repeat(into, noun, before, "restored", deleted=before.deleted, after=latest)


def _repeat(
    into: Transaction,
    noun: Noun[R],
    source: R,
    action: str,
    *,
    deleted: bool,
    after: ItemRecord | None = None,
) -> R:
    """Returns a new version with the content of an earlier one; ``after``: the latest so far."""
    version = (after or source).version + 1
    return _write(
        into, noun, source.id, version, _columns(source), source.links, source.attachments, action,
        deleted=deleted,
    )  # fmt: skip


def resolve(where: Workspace | Transaction, text: str, noun: str | None = None) -> tuple[str, str]:
    """Returns noun and id of the item a text means: its id, the beginning of it, or its name.

    Raises:
        ConfigurationError: None, or several.
    """
    nouns = list(NOUNS.values()) if noun is None else [noun_of(noun)]
    with reading(where) as session:
        chosen = select(ItemRow).where(ItemRow.noun.in_([each.name for each in nouns]))
        if len(text) >= SHORTEST_ID:
            exact = session.scalars(
                chosen.where(ItemRow.id.startswith(text.lower(), autoescape=True)).limit(3)
            )
            found = [(row.noun, row.id) for row in exact]
        else:
            found = []
        if not found:
            for each in nouns:
                table = each.table
                same = select(table.id).where(
                    table.latest == true(), table.deleted == false(), table.name == text
                )
                found += [(each.name, id) for id in session.scalars(same.limit(3))]
    if len(found) != 1:
        what = noun or "item"
        raise ConfigurationError(
            f"{'no' if not found else 'more than one'} {what} is {text!r}"
            f"{'' if not found else ': ' + ', '.join(f'{n} {i[:8]}' for n, i in found)}.",
            hint="robotrue workspace list shows ids; the first characters of one will do.",
        )
    return found[0]


def _require_living(into: Transaction, noun: Noun[R], id: str) -> R:
    _lock(into.session, noun, id)
    found = get(into, noun, id)
    if found.deleted:
        raise ConfigurationError(
            f"{noun.name} {found.name!r} is deleted.", hint=f"robotrue workspace undo {id}"
        )
    return found


def _lock(session: Session, noun: Noun[R], id: str) -> Versioned:
    """The latest version; others that would follow it wait for this transaction."""
    session.execute(select(ItemRow.id).where(ItemRow.id == id).with_for_update())
    return _row(session, noun, id, None)


def _row(session: Session, noun: Noun[R], id: str, version: int | None) -> Versioned:
    table = noun.table
    chosen = select(table).where(table.id == id)
    number = table.latest == true() if version is None else table.version == version
    asked = chosen.where(number).execution_options(populate_existing=True)
    found = session.scalars(asked).first() if plain_text(id) else None
    if found is None:
        which = "" if version is None else f" version {version} of"
        raise ConfigurationError(
            f"there is no{which} {noun.name} {id!r} in this workspace.",
            hint="robotrue workspace list shows all items.",
        )
    return found


def _require_there(session: Session, to: Ref) -> None:
    item = session.get(ItemRow, to.id)
    if item is None:
        raise ConfigurationError(
            f"it uses {to.id}, which is not in this workspace.",
            hint="robotrue workspace list shows all items.",
        )
    if item.noun in NOUNS:
        _row(session, NOUNS[item.noun], to.id, to.version)


def _columns(found: ItemRecord) -> dict[str, object]:
    return {f.name: getattr(found, f.name) for f in fields(found) if f.name not in _OWN}


def _records(session: Session, noun: Noun[R], rows: Sequence[Versioned]) -> list[R]:
    """The records of rows, with what belongs to them read in two queries."""
    ids = [row.id for row in rows]
    links: dict[tuple[str, int], list[Link]] = {}
    for link in session.scalars(
        select(LinkRow).where(LinkRow.id.in_(ids)).order_by(LinkRow.position)
    ):
        to = Ref(id=link.to_id, version=link.to_version)
        links.setdefault((link.id, link.version), []).append(Link(role=link.role, to=to))
    files: dict[tuple[str, int], list[Attachment]] = {}
    for row in session.scalars(
        select(AttachmentRow).where(AttachmentRow.id.in_(ids)).order_by(AttachmentRow.position)
    ):
        file = Attachment(role=row.role, name=row.name, sha256=row.sha256)
        files.setdefault((row.id, row.version), []).append(file)
    names = [f.name for f in fields(noun.record) if f.name not in _BESIDE]
    return [
        noun.record(
            **{name: getattr(row, name) for name in names},
            links=tuple(links.get((row.id, row.version), ())),
            attachments=tuple(files.get((row.id, row.version), ())),
        )
        for row in rows
    ]
