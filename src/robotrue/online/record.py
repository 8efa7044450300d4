"""Reader of a record: all data up to the last whole frame, and the torn bytes after it.

A record is a folder of segments ``segment-000001.rtr``, ... A segment is a line of magic, a header
(JSON: schema, addresses, hashes of the models, units, settings) and frames
(:mod:`robotrue.online.record_frames`). A process that is killed leaves a torn frame at the end of
its segment at most; a record that is opened again continues in a new segment.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

from robotrue.errors import ArchiveError, FormatError
from robotrue.online.record_frames import (
    HEAD,
    MAGIC,
    Kind,
    RecordFrame,
    frame_from,
    frame_kind,
    frame_number,
    head_length,
    is_sound,
)

SCHEMA: Final = 1
FIRST_LINE: Final = b"robotrue record\n"
UNITS: Final = "SI: m, rad, s, N, N m; joints as the controller displays them"
_BUFFER: Final = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordHeader:
    """Header of a segment, before its frames.

    Attributes:
        addresses: Address by role: ``robot``, ``force``.
        provenance: SHA-256 of what made the estimates, by role: cell, models, clock.
        settings: JSON values of all other settings that the estimates depend on.
        started: UTC, ISO 8601, when the service was started that wrote the segment.
        host_to_utc: s to add to host times for UTC (seconds since 1970), at that moment.
        simulated: Roles whose data are marked as simulated: streams, models.
    """

    addresses: Mapping[str, str]
    provenance: Mapping[str, str]
    settings: Mapping[str, object]
    started: str
    host_to_utc: float
    simulated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Makes the mappings read-only."""
        for name in ("addresses", "provenance", "settings"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Torn:
    """Bytes that are no whole frame.

    Attributes:
        segment: File.
        offset: Bytes, where they begin.
        length: Bytes that are left out.
        inside: Whole frames follow: not cut off by a crash, but damaged where it lay.
    """

    segment: Path
    offset: int
    length: int
    inside: bool


@dataclass(slots=True)
class StreamRecord:
    """A record on disk.

    Attributes:
        path: Folder.
        torn: What :meth:`frames` has left out so far.
    """

    path: Path
    torn: list[Torn] = field(default_factory=list)

    def segments(self) -> list[Path]:
        """Returns the segments in their order.

        Raises:
            FormatError: There are none.
        """
        found = segments(self.path)
        if not found:
            raise FormatError("no record: no segment in this folder.", source=self.path)
        return found

    def header(self) -> RecordHeader:
        """Returns the newest header that is whole.

        Raises:
            FormatError: There is none.
            ArchiveError: Written by a newer robotrue.
        """
        for segment in reversed(self.segments()):
            with segment.open("rb") as stream:
                if found := _read_header(stream, segment):
                    return found
        raise FormatError("no segment has a whole header.", source=self.path)

    def frames(
        self, kinds: Collection[Kind] | None = None, *, skip_damage: bool = False
    ) -> Iterator[RecordFrame]:
        """Yields the frames in order, holding one at a time.

        Args:
            kinds: Only these; all are checked.
            skip_damage: Continue after damage inside a segment; ``torn`` states the bytes left out.

        Raises:
            FormatError: Damage with whole frames after it, which no crash leaves.
        """
        for segment in self.segments():
            yield from self.segment_frames(segment, kinds, skip_damage=skip_damage)

    def segment_frames(
        self, segment: Path, kinds: Collection[Kind] | None = None, *, skip_damage: bool = False
    ) -> Iterator[RecordFrame]:
        """Gives the frames of one segment, as :meth:`frames`."""
        for head, payload in self._read_whole_frames(segment, skip_damage):
            if kinds is None or frame_kind(head) in kinds:
                yield frame_from(head, payload)

    def next_number(self) -> int:
        """Returns the number after the last whole frame; 0 where there is none."""
        for segment in reversed(segments(self.path)):
            number = None
            for head, _ in self._read_whole_frames(segment, skip_damage=True):
                number = frame_number(head)
            if number is not None:
                return number + 1
        return 0

    def _read_whole_frames(self, segment: Path, skip_damage: bool) -> Iterator[tuple[bytes, bytes]]:
        with segment.open("rb", buffering=_BUFFER) as stream:
            if _read_header(stream, segment) is None:
                self._note_torn(segment, 0, segment.stat().st_size, inside=False)
                return
            while True:
                at = stream.tell()
                head = stream.read(HEAD.size)
                if not head:
                    return
                length = head_length(head)
                payload = b"" if length is None else stream.read(length)
                if length is not None and len(payload) == length and is_sound(head, payload):
                    yield head, payload
                    continue
                there = _next_frame(stream, at + 1)
                end = segment.stat().st_size if there is None else there
                self._note_torn(segment, at, end - at, inside=there is not None)
                if there is None:
                    return
                if not skip_damage:
                    raise FormatError(
                        f"damaged at byte {at}; whole frames follow from byte {there}.",
                        source=segment,
                        hint="fetch the segment from its backup, or leave the damage out "
                        "(--skip-damage).",
                    )
                stream.seek(there)

    def _note_torn(self, segment: Path, offset: int, length: int, *, inside: bool) -> None:
        found = Torn(segment=segment, offset=offset, length=length, inside=inside)
        if found not in self.torn:
            self.torn.append(found)


def segments(path: Path) -> list[Path]:
    """Returns the segments of a record in their order; none where there is no record."""
    return sorted(path.glob("segment-[0-9][0-9][0-9][0-9][0-9][0-9].rtr"))


def header_bytes(header: RecordHeader) -> bytes:
    """Returns what a segment begins with."""
    document = {
        "schema": SCHEMA,
        "units": UNITS,
        "addresses": dict(header.addresses),
        "provenance": dict(header.provenance),
        "settings": dict(header.settings),
        "started": header.started,
        "host_to_utc_s": header.host_to_utc,
        "simulated": list(header.simulated),
    }
    text = json.dumps(document, sort_keys=True, allow_nan=False).encode()
    numbers = len(text).to_bytes(4, "little") + zlib.crc32(text).to_bytes(4, "little")
    return FIRST_LINE + numbers + text + b"\n"


def _read_header(stream: BinaryIO, source: Path) -> RecordHeader | None:
    """Returns the header and leaves the stream after it; None where it is torn."""
    first = stream.read(len(FIRST_LINE))
    if first != FIRST_LINE[: len(first)]:
        raise FormatError("not a segment of a record.", source=source)
    numbers = stream.read(8)
    length = int.from_bytes(numbers[:4], "little")
    if len(numbers) < 8 or length > 1 << 24:
        return None
    text = stream.read(length)
    whole = zlib.crc32(text).to_bytes(4, "little") == numbers[4:] and stream.read(1) == b"\n"
    if len(text) < length or not whole:
        return None
    document = json.loads(text)
    if document["schema"] > SCHEMA:
        raise ArchiveError(
            f"record schema {document['schema']}, this robotrue reads up to {SCHEMA}.",
            source=source,
            hint="update robotrue.",
        )
    return RecordHeader(
        addresses=document["addresses"],
        provenance=document["provenance"],
        settings=document["settings"],
        started=document["started"],
        host_to_utc=document["host_to_utc_s"],
        simulated=tuple(document.get("simulated", ())),
    )


def _next_frame(stream: BinaryIO, start: int) -> int | None:
    """Returns where the next whole frame begins, or None."""
    stream.seek(start)
    base, window = start, b""
    while True:
        more = stream.read(_BUFFER)
        window += more
        found = window.find(MAGIC)
        while found >= 0:
            if _is_whole_frame_at(stream, base + found):
                return base + found
            found = window.find(MAGIC, found + 1)
        if not more:
            return None
        keep = len(MAGIC) - 1
        base, window = base + len(window) - keep, window[-keep:]
        stream.seek(base + keep)


def _is_whole_frame_at(stream: BinaryIO, at: int) -> bool:
    stream.seek(at)
    head = stream.read(HEAD.size)
    length = head_length(head)
    if length is None:
        return False
    payload = stream.read(length)
    return len(payload) == length and is_sound(head, payload)
