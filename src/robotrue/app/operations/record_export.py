"""Write a stream of a record as CSV."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note, count
from robotrue.app.record_fields import RecordFolder, SkipDamage
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import table_output


class RecordExportRequest(Request):
    """Which stream of which record."""

    folder: RecordFolder
    output: Annotated[Path, table_output(help="CSV to write.")]
    stream: Annotated[str, Option(help="joints, force (as a replay reads them) or estimates.")] = (
        "estimates"
    )
    skip_damage: SkipDamage = False


def run(request: RecordExportRequest, context: Context) -> PlainResult:
    """Writes one stream as CSV, whole or not at all.

    Raises:
        ConfigurationError: Another stream than these.
        FormatError: No record, none of this stream in it, or damaged inside.
    """
    from robotrue.app.record_fields import damage_document, note_damage
    from robotrue.core.files import atomic_stream
    from robotrue.errors import ConfigurationError
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
    note_damage(record, context)
    return PlainResult(
        values={
            "record": str(request.folder),
            "output": str(output),
            "stream": stream,
            "rows": rows,
            "torn": damage_document(record),
        },
        shown=(Note(f"{count(rows, 'row')} of {stream} in {output}"),),
        provenance=stream_provenance(record.header(), stream),
    )


OPERATION: Final = Operation(request=RecordExportRequest, run=run)
