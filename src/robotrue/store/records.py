"""Immutable records of the store, pages of them, and queries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Generic, TypeVar

from robotrue.core.document_decoder import decode
from robotrue.core.provenance import Provenance, provenance_from
from robotrue.store.query_defaults import LIMIT, SORT

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ref:
    """One version of one item."""

    id: str
    version: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """Dependency of a version on another item.

    Attributes:
        role: ``data``, ``cell``, ``model``, ``parent``, ``before``, ``robot``, ``tool``, ...
        to: The version it rests on.
    """

    role: str
    to: Ref


def links_to(**roles: Ref | Sequence[Ref] | None) -> tuple[Link, ...]:
    """Returns links by role: to one version, to several in order, or to none."""
    return tuple(
        Link(role=role, to=ref)
        for role, refs in roles.items()
        for ref in ([refs] if isinstance(refs, Ref) else refs or ())
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A file of a version.

    Attributes:
        role: Its role: ``file``, ``raw``, ``model``, ``report``, ...
        name: Original name.
        sha256: Of its content; its name in the workspace.
    """

    role: str
    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemRecord:
    """One version of an item.

    Attributes:
        id: Never changes, also through export and import.
        version: From 1.
        latest: There is no newer version.
        deleted: This version marks the item as deleted.
        name: For people; need not be unique.
        note: Text of the user.
        created: When this version was made.
        detail: Further fields of its noun, JSON values; lengths and angles named with their unit or
            SI.
        links: Items it depends on.
        attachments: Its files.
    """

    id: str
    version: int
    latest: bool
    deleted: bool
    name: str
    note: str
    created: datetime
    detail: Mapping[str, Any]  # each noun reads its own
    links: tuple[Link, ...] = ()
    attachments: tuple[Attachment, ...] = ()

    @property
    def ref(self) -> Ref:
        """This version."""
        return Ref(id=self.id, version=self.version)

    def refs(self, role: str) -> tuple[Ref, ...]:
        """Returns what it rests on in one role, in order."""
        return tuple(link.to for link in self.links if link.role == role)

    def files(self, role: str) -> tuple[Attachment, ...]:
        """Returns its files of one role, in order."""
        return tuple(each for each in self.attachments if each.role == role)


@dataclass(frozen=True, slots=True, kw_only=True)
class _SourcesDetail:
    """Names of sources in the detail of a record."""

    sources: tuple[object, ...] = ()
    groups: tuple[object, ...] = ()
    history: tuple[dict[str, object], ...] = ()


def provenance_of_record(record: ItemRecord) -> Provenance:
    """Returns the provenance in the detail of a record; measured, where not stated.

    Raises:
        ArchiveError: The detail holds something else in its place.
    """
    from robotrue.calibration.training_summary import read_step  # numpy, which lists do without

    detail = record.detail
    session = detail.get("session")
    about = session if isinstance(session, Mapping) else detail
    simulated = about.get("simulated")
    if detail.get("provenance") is None and isinstance(simulated, bool):
        return Provenance(simulated=simulated)
    stated = decode(_SourcesDetail, dict(detail))
    steps = [name for step in stated.history for name in read_step(step).sources]
    before = (*stated.sources, *stated.groups, *steps)
    return provenance_from(detail.get("provenance"), before=before)


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemQuery:
    """Query for items.

    Attributes:
        text: Part of the name or the note, in any case of letters; empty: all.
        where: Fields of the record that must have these values.
        linked: A role and the id of the item it must rest on.
        sort: Field to sort by, with ``-`` before it: greatest first.
        offset: Items left out before the page.
        limit: Items on the page.
        deleted: Those that are deleted, instead of those that are not.
    """

    text: str = ""
    where: Mapping[str, str | int | float] = field(default_factory=dict)
    linked: tuple[str, str] | None = None
    sort: str = SORT
    offset: int = 0
    limit: int = LIMIT
    deleted: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultPage(Generic[T]):
    """One page of a query's result.

    Attributes:
        items: In order.
        total: Total number on all pages.
        offset: Items before this page.
    """

    items: tuple[T, ...]
    total: int
    offset: int
