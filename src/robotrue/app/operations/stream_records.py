"""Records of the sensing service: count, check, export as CSV."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, Note, PlainResult, count
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import table_output
from robotrue.core.files import atomic_stream
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.online.record import StreamRecord


RecordFolder: TypeAlias = Annotated[
    Path, InputFile(argument="RECORD", folder=True, help="Folder of `sense --record`.")
]
SkipDamage: TypeAlias = Annotated[bool, Option(help="Continue after damage inside a segment.")]


def _damage_document(record: StreamRecord) -> list[dict[str, object]]:
    """Returns the bytes that reading the record left out, as JSON values."""
    return [
        {"segment": t.segment.name, "offset": t.offset, "bytes": t.length, "inside": t.inside}
        for t in record.torn
    ]


def _note_damage(record: StreamRecord, context: Context) -> None:
    """Reports the bytes that reading the record left out."""
    for torn in record.torn:
        what = "damage" if torn.inside else "a torn frame"
        context.note(
            f"{what} of {torn.length} bytes at byte {torn.offset} of {torn.segment.name} "
            "was left out"
        )


class RecordInfoRequest(Request):
    """Record to describe."""

    folder: RecordFolder
    skip_damage: SkipDamage = False


@operation("record_info")
def describe_record(request: RecordInfoRequest, context: Context) -> PlainResult:
    """Check a record frame by frame and list its content.

    Raises:
        FormatError: No record, or damaged inside.
    """
    from robotrue.online.csv_streams import stream_provenance
    from robotrue.online.record import StreamRecord
    from robotrue.online.record_frames import Kind

    record = StreamRecord(request.folder)
    header = record.header()
    rows: Counter[str] = Counter()
    frames: Counter[str] = Counter()
    for frame in record.frames(skip_damage=request.skip_damage):
        name = frame.kind.name.lower()
        frames[name] += 1
        if frame.kind in (Kind.JOINTS, Kind.FORCE, Kind.ESTIMATES):
            rows[name] += len(frame.content)
    _note_damage(record, context)
    segments = record.segments()
    size = sum(path.stat().st_size for path in segments)
    facts = (
        ("last started", header.started),
        *header.addresses.items(),
        ("segments", f"{len(segments)}, {size / 1e6:.1f} MB"),
        *((name, f"{number} rows in {frames[name]} frames") for name, number in rows.items()),
        *((name, f"{frames[name]} frames") for name in frames if name not in rows),
    )
    return PlainResult(
        values={
            "record": str(request.folder),
            "segments": len(segments),
            "bytes": size,
            "started": header.started,
            "simulated": bool(header.simulated),
            "simulated_roles": list(header.simulated),
            "addresses": dict(header.addresses),
            "provenance": dict(header.provenance),
            "settings": dict(header.settings),
            "frames": dict(frames),
            "rows": dict(rows),
            "torn": _damage_document(record),
        },
        shown=(Facts(title=f"record {request.folder}", rows=facts),),
        provenance=stream_provenance(header, "estimates"),
    )


class RecordExportRequest(Request):
    """Record and stream to export."""

    folder: RecordFolder
    output: Annotated[Path, table_output()]
    """CSV to write."""
    stream: str = "estimates"
    """joints, force (as a replay reads them) or estimates."""
    skip_damage: SkipDamage = False


@operation("record_export")
def export_stream(request: RecordExportRequest, context: Context) -> PlainResult:
    """Write a stream of a record as CSV.

    Raises:
        ConfigurationError: Another stream than these.
        FormatError: No record, none of this stream in it, or damaged inside.
    """
    from robotrue.online.csv_streams import STREAMS, export_lines, stream_provenance
    from robotrue.online.record import StreamRecord

    stream = next((name for name in STREAMS if name == request.stream), None)
    if stream is None:
        raise ConfigurationError(
            f"stream {request.stream!r}, expected {', '.join(STREAMS)}.",
            hint="--stream estimates",
        )
    record, rows = StreamRecord(request.folder), 0
    output = context.output(request.output)
    with atomic_stream(output) as file:
        for data, contained in export_lines(record, stream, skip_damage=request.skip_damage):
            file.write(data)
            rows += contained
    _note_damage(record, context)
    return PlainResult(
        values={
            "record": str(request.folder),
            "output": str(output),
            "stream": stream,
            "rows": rows,
            "torn": _damage_document(record),
        },
        shown=(Note(f"{count(rows, 'row')} of {stream} in {output}"),),
        provenance=stream_provenance(record.header(), stream),
    )
