"""Journal of changes, append-only. Authors are not recorded."""

from __future__ import annotations

import uuid
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from datetime import datetime

from sqlalchemy import func, select

from robotrue.store.query_defaults import LIMIT
from robotrue.store.records import ResultPage
from robotrue.store.schema import JournalRow
from robotrue.store.workspace import Transaction, Workspace, now, reading


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One thing that was done.

    Attributes:
        number: Counts up.
        at: When.
        action: ``added``, ``changed``, ``deleted``, ``restored``, ``submitted``, ``done``, ...
        noun: Of the item; ``job`` for jobs, ``workspace`` for the whole.
        item: Its id.
        version: Of the item; 0 where it has none.
        detail: JSON values.
    """

    number: int
    at: datetime
    action: str
    noun: str
    item: str
    version: int
    detail: Mapping[str, object]


def record(
    into: Transaction,
    action: str,
    noun: str,
    item: str,
    version: int = 0,
    detail: Mapping[str, object] | None = None,
) -> None:
    """Adds an entry, in the transaction of its action."""
    into.session.add(
        JournalRow(
            entry=str(uuid.uuid4()),
            at=now(),
            action=action,
            noun=noun,
            item=item,
            version=version,
            detail=dict(detail or {}),
        )
    )


def entries(
    where: Workspace | Transaction,
    *,
    item: str | None = None,
    without: Collection[str] = (),
    offset: int = 0,
    limit: int = LIMIT,
) -> ResultPage[Entry]:
    """Returns what was done, the newest first.

    Args:
        where: Workspace or transaction.
        item: Of one item; None: of all.
        without: Actions that are left out.
        offset: Entries before the first.
        limit: Entries at most.
    """
    chosen = select(JournalRow)
    if without:
        chosen = chosen.where(JournalRow.action.not_in(without))
    if item is not None:
        chosen = chosen.where(JournalRow.item == item)
    with reading(where) as session:
        total = session.scalar(select(func.count()).select_from(chosen.subquery())) or 0
        rows = session.scalars(
            chosen.order_by(JournalRow.number.desc()).offset(offset).limit(limit)
        )
        names = [field.name for field in fields(Entry)]
        found = tuple(Entry(**{name: getattr(row, name) for name in names}) for row in rows)
    return ResultPage(items=found, total=total, offset=offset)
