"""The clock file: how the force's clock stands to the joints', and which clocks those are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.errors import ArchiveError, ConfigurationError, FormatError
from robotrue.online.clock_alignment import ClockAlignment
from robotrue.online.sensing_chain import StreamShift

KIND: Final = "robotrue-clock"
SCHEMA: Final = 1


def clock_document(found: ClockAlignment, *, host: bool, sources: dict[str, str]) -> dict[str, Any]:
    """Returns the content of a clock file.

    Args:
        found: The alignment.
        host: Both records have the host's times; else the recorders' own.
        sources: SHA-256 of the two records by role.
    """
    return {
        "kind": KIND,
        "schema": SCHEMA,
        "clock": "host" if host else "recorder",
        "offset_s": found.offset,
        "offset_sd_s": found.offset_sd,
        "drift_ppm": found.drift * 1e6,
        "drift_sd_ppm": found.drift_sd * 1e6,
        "at_s": found.at,
        "explained": found.explained,
        "rival": found.rival,
        "moved_s": found.moved,
        "sources": sources,
    }


def write_clock(path: str | Path, document: dict[str, Any]) -> None:
    """Writes a clock file whole or not at all."""
    write_atomic(path, (json.dumps(document, indent=1, sort_keys=True) + "\n").encode())


def read_clock(path: str | Path, *, live: bool) -> tuple[StreamShift, str]:
    """Returns what to add to force times, and the file's SHA-256.

    Args:
        path: Of :func:`write_clock`.
        live: Whether the streams are live: the clocks of recorders are not theirs, and a drift
            of the host's times to themselves is none.

    Raises:
        FormatError: Cannot be read, or not a clock file.
        ArchiveError: Of a newer robotrue.
        ConfigurationError: Clocks of recorders, for live streams.
    """
    data = read_bytes(path)
    try:
        document = json.loads(data)
        kind, schema, clock = document["kind"], int(document["schema"]), document["clock"]
        numbers = [float(document[k]) for k in ("offset_s", "drift_ppm", "at_s")]
    except (ValueError, KeyError, TypeError) as cause:
        raise FormatError(f"not a clock file ({cause}).", source=path, hint="sense align") from None
    if kind != KIND:
        raise FormatError(f"not a clock file but {kind!r}.", source=path, hint="sense align")
    if schema > SCHEMA:
        raise ArchiveError(f"clock file schema {schema}, expected {SCHEMA}.", source=path)
    if live and clock != "host":
        raise ConfigurationError(
            "the clocks of two recorders, and the streams are live: theirs are others.",
            source=path,
            hint="record the jog with sense --record, export it, and align that.",
        )
    offset, drift, at = numbers
    drift = 0.0 if live else drift * 1e-6
    return StreamShift(offset=offset, drift=drift, at=at), sha256(data)
