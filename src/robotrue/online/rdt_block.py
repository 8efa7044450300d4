"""Records of an ATI sensor from bytes to a block."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import FormatError
from robotrue.online.blocks import ForceBlock
from robotrue.online.rdt import EXTREME, LATCHED, SATURATED, RdtDevice, RdtScale
from robotrue.online.samples import Flag, check_wrenches

RECORD: Final = np.dtype(
    [("rdt", ">u4"), ("ft", ">u4"), ("status", ">u4"), ("counts", ">i4", (6,))]
)
"""One record as it is sent, 36 bytes."""
Records = npt.NDArray[np.void]


def decode_records(data: bytes | bytearray | memoryview) -> Records:
    """Returns the records (n,) of bytes that hold whole ones, without copying.

    Raises:
        FormatError: A size that is no multiple of 36 bytes.
    """
    if len(data) % RECORD.itemsize:
        raise FormatError(
            f"RDT records of {len(data)} bytes, expected a multiple of {RECORD.itemsize}.",
            hint="port 49152 of the sensor itself.",
        )
    return np.frombuffer(data, dtype=RECORD)


def rdt_block(
    records: Records,
    scale: RdtScale,
    host_time: Array,
    flags: IntArray,
    *,
    device: RdtDevice,
    rate: float,
    frame: str = "sensor",
    before: tuple[int, int] | None = None,
) -> ForceBlock:
    """Returns the block of records, in the axes of the sensor.

    Any bit of the status word but "limit latched" makes a record invalid; so does a measurement
    that has not moved since the record before, and a channel at the end of its range.

    Args:
        records: (n,), as received.
        scale: Of this sensor.
        host_time: (n,) s.
        flags: (n,), what the sequence says.
        device: Family of the sensor.
        rate: Records per second as configured.
        frame: Of the axes, where the sensor itself turns them.
        before: rdt and ft sequence of the record before the first.
    """
    status = records["status"].astype(np.int64)
    counts = records["counts"].astype(np.float64)
    rdt = records["rdt"].astype(np.int64)
    ft = records["ft"].astype(np.int64)
    full = ((counts == EXTREME[0]) | (counts == EXTREME[1])).any(axis=1)
    full |= (status & SATURATED[device.value]) != 0
    hangs = np.zeros(len(rdt), dtype=bool)
    hangs[1:] = (ft[1:] == ft[:-1]) & (rdt[1:] != rdt[:-1])
    if before is not None:
        hangs[0] = ft[0] == before[1] and rdt[0] != before[0]
    ill = hangs | ((status & ~LATCHED) != 0)
    flags = flags | np.where(full, int(Flag.SATURATED), 0)
    flags = flags | np.where(ill, int(Flag.SENSOR_FAULT), 0)
    wrench = counts * np.repeat([scale.newton, scale.newton_metre], 3)
    wrench, flags = check_wrenches(wrench, flags)
    return ForceBlock(
        controller_time=rdt / rate,
        host_time=host_time,
        wrench=wrench,
        frame=frame,
        sequence=rdt,
        status=status,
        flags=flags,
    )


def arrival_times(rdt: IntArray, now: float, earliest: float, rate: float) -> Array:
    """Returns when records (n,) that were read together came, s on the host's clock.

    The last came just now, those before it as much earlier as the sensor's count says, but none
    before ``earliest``, when the socket was last found empty.
    """
    age = (int(rdt[-1]) - rdt) / rate
    times = np.clip(now - np.maximum(age, 0.0), earliest, now)
    return np.asarray(np.maximum.accumulate(times))
