"""``robotrue record export`` and ``info``: a record of the service read back."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from robotrue.app.outputs import check_output
from robotrue.cli.console import count, emit_facts, emit_json, say, say_mark
from robotrue.core.files import atomic_stream
from robotrue.errors import ConfigurationError
from robotrue.online.record import Record
from robotrue.online.record_export import STREAMS, export_lines, stream_provenance
from robotrue.online.record_frames import Kind


def run_export(
    folder: Path, output: Path, *, stream: str, skip_damage: bool, as_json: bool
) -> None:
    """Writes one stream as CSV, whole or not at all.

    Raises:
        ConfigurationError: Another stream than these.
        FormatError: No record, none of this stream in it, or damaged inside.
    """
    if stream not in STREAMS:
        raise ConfigurationError(
            f"stream {stream!r}, expected {', '.join(STREAMS)}.", hint="--stream estimates"
        )
    check_output(output, [])
    record, rows = Record(folder), 0
    with atomic_stream(output) as out:
        lines = export_lines(record, stream, skip_damage=skip_damage)
        for data, contained in lines:
            out.write(data)
            rows += contained
    _say_torn(record)
    header = record.header()
    origin = stream_provenance(header, next(name for name in STREAMS if name == stream))
    say_mark(origin)
    if as_json:
        emit_json(
            {"record": str(folder), "output": str(output), "stream": stream, "rows": rows}
            | {"torn": _torn(record)},
            origin,
        )
    else:
        say(f"{count(rows, 'row')} of {stream} in {output}")


def run_info(folder: Path, *, skip_damage: bool, as_json: bool) -> None:
    """Reads a record once and prints what is in it.

    Raises:
        FormatError: No record, or damaged inside.
    """
    record = Record(folder)
    header = record.header()
    rows: Counter[str] = Counter()
    frames: Counter[str] = Counter()
    for frame in record.frames(skip_damage=skip_damage):
        name = frame.kind.name.lower()
        frames[name] += 1
        if frame.kind in (Kind.JOINTS, Kind.FORCE, Kind.ESTIMATES):
            rows[name] += len(frame.content)
    _say_torn(record)
    segments = record.segments()
    size = sum(path.stat().st_size for path in segments)
    origin = stream_provenance(header, "estimates")
    say_mark(origin)
    if as_json:
        emit_json(
            {
                "record": str(folder),
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
                "torn": _torn(record),
            }
        )
        return
    facts = [
        ("last started", header.started),
        *((role, address) for role, address in header.addresses.items()),
        ("segments", f"{len(segments)}, {size / 1e6:.1f} MB"),
        *((name, f"{number} rows in {frames[name]} frames") for name, number in rows.items()),
        *((name, f"{frames[name]} frames") for name in frames if name not in rows),
    ]
    emit_facts(f"record {folder}", facts, origin)


def _torn(record: Record) -> list[dict[str, Any]]:
    return [
        {"segment": t.segment.name, "offset": t.offset, "bytes": t.length, "inside": t.inside}
        for t in record.torn
    ]


def _say_torn(record: Record) -> None:
    for torn in record.torn:
        what = "damage" if torn.inside else "a torn frame"
        say(
            f"note: {what} of {torn.length} bytes at byte {torn.offset} of {torn.segment.name} "
            "was left out"
        )
