"""What the operations on a record of the service share: their fields, and damage in the record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

from robotrue.app.context import Context
from robotrue.app.request import InputFile, Option

if TYPE_CHECKING:
    from robotrue.online.record import StreamRecord

RecordFolder: TypeAlias = Annotated[
    Path, InputFile(argument="RECORD", folder=True, help="Folder of `sense --record`.")
]
SkipDamage: TypeAlias = Annotated[bool, Option(help="Go on behind damage inside a segment.")]


def damage_document(record: StreamRecord) -> list[dict[str, object]]:
    """Returns the bytes that reading the record left out, as JSON values."""
    return [
        {"segment": t.segment.name, "offset": t.offset, "bytes": t.length, "inside": t.inside}
        for t in record.torn
    ]


def note_damage(record: StreamRecord, context: Context) -> None:
    """Reports the bytes that reading the record left out."""
    for torn in record.torn:
        what = "damage" if torn.inside else "a torn frame"
        context.note(
            f"{what} of {torn.length} bytes at byte {torn.offset} of {torn.segment.name} "
            "was left out"
        )
