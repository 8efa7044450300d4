"""Check a record frame by frame and say what is in it."""

from __future__ import annotations

from typing import Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts
from robotrue.app.record_fields import RecordFolder, SkipDamage
from robotrue.app.request import Request


class RecordInfoRequest(Request):
    """Which record."""

    folder: RecordFolder
    skip_damage: SkipDamage = False


def run(request: RecordInfoRequest, context: Context) -> PlainResult:
    """Reads a record once and counts what is in it.

    Raises:
        FormatError: No record, or damaged inside.
    """
    from collections import Counter

    from robotrue.app.record_fields import damage_document, note_damage
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
    note_damage(record, context)
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
            "torn": damage_document(record),
        },
        shown=(Facts(title=f"record {request.folder}", rows=facts),),
        provenance=stream_provenance(header, "estimates"),
    )


OPERATION: Final = Operation(request=RecordInfoRequest, run=run)
