"""Records of an ATI sensor one by one, as its manual prints them: what blocks must hold."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np
from single_samples import ForceSample

from robotrue.errors import FormatError
from robotrue.online.blocks import Flag
from robotrue.online.rdt import LATCHED, RdtDevice, RdtScale

_RECORD: Final = struct.Struct(">III6i")
_MOST_RECORDS: Final = 40
_EXTREME: Final = (2**31 - 1, -(2**31))
_SATURATED: Final = {"net": 1 << 17, "axia": 1 << 30 | 1 << 27}


@dataclass(frozen=True, slots=True, kw_only=True)
class RdtRecord:
    """One record as it was sent.

    Attributes:
        rdt_sequence: Number of the record.
        ft_sequence: Number of the measurement within the sensor; it stands still if that hangs.
        status: Status word; 0 is well.
        counts: Fx Fy Fz Tx Ty Tz.
    """

    rdt_sequence: int
    ft_sequence: int
    status: int
    counts: tuple[int, ...]


def read_records(data: bytes) -> tuple[RdtRecord, ...]:
    """Returns the records of a datagram: one, or up to 40 in the buffered mode.

    Raises:
        FormatError: A size that is no multiple of 36 bytes.
    """
    count, rest = divmod(len(data), _RECORD.size)
    if rest or not 1 <= count <= _MOST_RECORDS:
        raise FormatError(
            f"RDT datagram of {len(data)} bytes, expected 1 to {_MOST_RECORDS} times "
            f"{_RECORD.size}.",
            hint="port 49152 of the sensor itself.",
        )
    return tuple(
        RdtRecord(rdt_sequence=r[0], ft_sequence=r[1], status=r[2], counts=tuple(r[3:]))
        for r in _RECORD.iter_unpack(data)
    )


def write_record(record: RdtRecord) -> bytes:
    """Returns a record as a sensor sends it, for simulators and tests."""
    return _RECORD.pack(record.rdt_sequence, record.ft_sequence, record.status, *record.counts)


def force_sample(
    record: RdtRecord,
    scale: RdtScale,
    host_time: float,
    *,
    device: RdtDevice,
    rate: float,
    before: RdtRecord | None = None,
    flags: Flag = Flag.NONE,
) -> ForceSample:
    """Returns the sample of a record, in the axes of the sensor.

    Any bit of the status word but "limit latched" makes it invalid; so does a measurement that
    has not moved since the record before, and a channel at the end of its range.

    Args:
        record: As read.
        scale: Of this sensor.
        host_time: s.
        device: Family of the sensor.
        rate: Records per second as configured; the sensor's time is ``rdt_sequence / rate``.
        before: The record before it, where there is one.
        flags: What the sequence says.
    """
    if record.status & ~LATCHED:
        flags |= Flag.SENSOR_FAULT
    if record.status & _SATURATED[device.value] or any(c in _EXTREME for c in record.counts):
        flags |= Flag.SATURATED
    if (
        before is not None
        and before.ft_sequence == record.ft_sequence
        and before.rdt_sequence != record.rdt_sequence
    ):
        flags |= Flag.SENSOR_FAULT
    counts = np.array(record.counts, dtype=np.float64)
    return ForceSample(
        controller_time=record.rdt_sequence / rate,
        host_time=host_time,
        wrench=counts * np.repeat([scale.newton, scale.newton_metre], 3),
        frame="sensor",
        sequence=record.rdt_sequence,
        status=record.status,
        flags=flags,
    )
