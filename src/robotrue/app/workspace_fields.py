"""Operations on a workspace and its jobs: the fields they share, and records as JSON values."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Block
from robotrue.app.request import Option

if TYPE_CHECKING:
    from robotrue.store.jobs import Job
    from robotrue.store.records import ItemRecord

HERE: Final = Path()
WorkspaceFolder: TypeAlias = Annotated[
    Path,
    Option(
        names=("--workspace", "-w"),
        variable="ROBOTRUE_WORKSPACE",
        help="Folder of the workspace; its database is in it, or where ROBOTRUE_DB says.",
    ),
]
ItemWord: TypeAlias = Annotated[
    str, Option(argument="ITEM", help="Id, the first characters of one, or a name.")
]
JobWord: TypeAlias = Annotated[str, Option(argument="JOB", help="Id, or its first characters.")]


def item_result(noun: str, record: ItemRecord, *shown: Block) -> PlainResult:
    """Returns one version of an item as a result."""
    from robotrue.store.records import provenance_of_record

    return PlainResult(
        values=item_document(noun, record), shown=shown, provenance=provenance_of_record(record)
    )


def item_document(noun: str, record: ItemRecord) -> dict[str, Any]:
    """Returns one version of an item as JSON values."""
    from robotrue.store.records import provenance_of_record

    values = asdict(record)
    links, files = values.pop("links"), values.pop("attachments")
    values["created"] = record.created.isoformat()
    values["links"] = [{"role": each["role"], **each["to"]} for each in links]
    values = {"noun": noun, **values, "files": list(files)}
    return {"simulated": provenance_of_record(record).simulated, **values}


def job_result(job: Job, *shown: Block) -> PlainResult:
    """Returns a job as a result."""
    from robotrue.core.provenance import Provenance

    origin = Provenance(simulated=is_simulated(job))
    return PlainResult(values=job_document(job), shown=shown, provenance=origin)


def job_document(job: Job) -> dict[str, object]:
    """Returns a job as JSON values."""
    values = asdict(job)
    for name in ("submitted", "started", "finished"):
        time = values[name]
        values[name] = None if time is None else time.isoformat()
    return {"simulated": is_simulated(job), **values}


def is_simulated(job: Job) -> bool:
    """Returns whether the result of a job that is done says that it is simulated."""
    return bool((job.result or {}).get("simulated"))


def json_facts(values: Mapping[str, object], prefix: str = "") -> tuple[tuple[str, str], ...]:
    """Returns names and values as JSON text."""
    return tuple((f"{prefix}{name}", json.dumps(value)) for name, value in values.items())


def value_text(value: object) -> str:
    """Returns a value of a record as text."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def time_text(time: datetime | None) -> str:
    """Returns a time in the zone of this computer; empty for none."""
    return "" if time is None else f"{time.astimezone():%Y-%m-%d %H:%M:%S}"
