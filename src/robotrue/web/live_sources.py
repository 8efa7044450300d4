"""Sources of live data: sensing services by address, with their limits and alarms."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from robotrue.core.csv_text import csv_text
from robotrue.errors import ConfigurationError
from robotrue.online.net_address import net_address
from robotrue.store import documents, items, journal
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Workspace
from robotrue.web.alarms import Alarm, Limits
from robotrue.web.serve_settings import SENSE_PORT, service_address

KIND: Final = "live source"
BEGUN: Final = "alarm"
OVER: Final = "alarm over"
MOST: Final = 20
"""Sources; each is an open connection."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSource:
    """A sensing service that is listened to.

    Attributes:
        id: Of its document.
        version: Likewise.
        name: For people.
        address: ``ws://host:port`` of ``robotrue sense --out``.
        limits: Beyond which an alarm is raised.
    """

    id: str
    version: int
    name: str
    address: str
    limits: Limits


def sources(workspace: Workspace) -> tuple[LiveSource, ...]:
    """Returns all sources, the oldest first."""
    query = ItemQuery(where={"kind": KIND}, sort="created", limit=MOST)
    return tuple(_source(each) for each in items.search(workspace, DOCUMENT, query).items)


def source(workspace: Workspace, id: str) -> LiveSource:
    """Returns a source by its id.

    Raises:
        ConfigurationError: There is none.
    """
    record = items.get(workspace, DOCUMENT, id)
    if record.kind != KIND or record.deleted:
        raise ConfigurationError(f"{record.name!r} is no live source.")
    return _source(record)


def is_allowed(address: str, named: Collection[str]) -> bool:
    """Returns whether the server connects to an address: one of this computer, or one named.

    Otherwise a user could make the server try any port of any machine.
    """
    return address in named or net_address(address, default_port=SENSE_PORT).loopback


def add_source(
    workspace: Workspace, address: str, name: str, named: Collection[str] = ()
) -> DocumentRecord:
    """Returns the document of a new source.

    Args:
        workspace: Where it is kept.
        address: Of a sensing service.
        name: For people; empty: its address.
        named: Addresses that the operator named when the server was started.

    Raises:
        ConfigurationError: No address of a sensing service, one of another computer that the
            operator has not named, or more than are listened to.
    """
    where = service_address(address)
    if not is_allowed(where, named):
        raise ConfigurationError(
            f"{where} is not on this computer, and the workbench was not started with it.",
            hint=f"robotrue serve --sense {where}",
        )
    if len(sources(workspace)) >= MOST:
        raise ConfigurationError(f"{MOST} sources are listened to, no more.", hint="delete one.")
    shown = name.strip() or where.removeprefix("ws://")
    detail = {"address": where, "limits_um": [0.0, 0.0, 0.0]}
    return documents.add(workspace, KIND, name=shown, detail=detail)


def set_limits(workspace: Workspace, id: str, limits: Limits) -> DocumentRecord:
    """Returns the new version of a source, with other limits.

    Raises:
        ConfigurationError: There is no such source.
    """
    kept = source(workspace, id)
    detail = {"address": kept.address, "limits_um": list(limits)}
    return documents.add(workspace, KIND, name=kept.name, detail=detail, id=id)


def record_alarm(workspace: Workspace, id: str, alarm: Alarm) -> None:
    """Writes the start or the end of an alarm to the journal of the workspace.

    Raises:
        RobotrueError: The database does not take it.
    """
    with workspace.write() as into:
        journal.record(into, OVER if alarm.over else BEGUN, "live", id, detail=alarm.document)


def alarms(workspace: Workspace, id: str, *, limit: int) -> list[dict[str, object]]:
    """Returns the latest alarms of a source, the newest first.

    An alarm without an end, because the server stopped during it, is reported as started.
    """
    out: dict[str, dict[str, object]] = {}
    for entry in journal.entries(workspace, item=id, limit=2 * limit).items:
        if entry.action in (BEGUN, OVER):
            out.setdefault(str(entry.detail.get("key")), dict(entry.detail))
    return sorted(out.values(), key=lambda each: str(each["begun"]), reverse=True)[:limit]


def alarms_csv(found: list[dict[str, object]]) -> str:
    """Returns alarms as a table, the oldest first."""
    names = ("begun", "axis", "value_um", "band_um", "limit_um", "duration_s", "over")
    return csv_text([names, *([each[name] for name in names] for each in reversed(found))])


def _source(record: DocumentRecord) -> LiveSource:
    x, y, z = (float(v) for v in record.detail["limits_um"])
    return LiveSource(
        id=record.id,
        version=record.version,
        name=record.name,
        address=str(record.detail["address"]),
        limits=(x, y, z),
    )
