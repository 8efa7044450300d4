"""Records of the store as JSON."""

from __future__ import annotations

from dataclasses import fields
from datetime import datetime

from robotrue.store.records import Attachment, ItemRecord, Link


def record_document(record: ItemRecord, noun: str) -> dict[str, object]:
    """Returns a record as JSON values; its files with the address they are fetched from."""
    out: dict[str, object] = {"noun": noun}
    for field in fields(record):
        value = getattr(record, field.name)
        if field.name == "links":
            value = [_link(each) for each in value]
        elif field.name == "attachments":
            value = [_file(each, record, noun) for each in value]
        elif isinstance(value, datetime):
            value = value.isoformat()
        out[field.name] = value
    return out


def _link(link: Link) -> dict[str, object]:
    return {"role": link.role, "id": link.to.id, "version": link.to.version}


def _file(each: Attachment, record: ItemRecord, noun: str) -> dict[str, object]:
    where = f"/api/items/{noun}/{record.id}/files/{each.sha256}?version={record.version}"
    return {"role": each.role, "name": each.name, "sha256": each.sha256, "href": where}
