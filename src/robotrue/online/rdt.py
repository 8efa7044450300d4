"""ATI Net F/T and Ethernet Axia, Raw Data Transfer: requests, the sensor's scale, records.

UDP 49152, big-endian. Records hold counts; the sensor's page ``netftapi2.xml`` states counts per
unit, which differ from sensor to sensor.
"""

from __future__ import annotations

import enum
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM, STANDARD_GRAVITY
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.online.blocks import Flag, ForceBlock, check_wrenches
from robotrue.online.sequence import SequenceState
from robotrue.online.xml_text import parse_xml

_REQUEST: Final = struct.Struct(">HHI")
_MAGIC: Final = 0x1234
RECORD: Final = np.dtype(
    [("rdt", ">u4"), ("ft", ">u4"), ("status", ">u4"), ("counts", ">i4", (6,))]
)
"""One record as it is sent, 36 bytes."""
Records = npt.NDArray[np.void]
_EXTREME: Final = (2**31 - 1, -(2**31))
LATCHED: Final = 1 << 16
"""A monitored limit was crossed once; the data are sound."""
SATURATED: Final = {"net": 1 << 17, "axia": 1 << 30 | 1 << 27}
_POUND: Final = 0.45359237 * STANDARD_GRAVITY
_INCH: Final = 25.4 * MM
_FORCE: Final = {
    "lbf": _POUND,
    "n": 1.0,
    "klbf": 1e3 * _POUND,
    "kn": 1e3,
    "kgf": STANDARD_GRAVITY,
}
_TORQUE: Final = {
    "lbfin": _POUND * _INCH,
    "lbfft": _POUND * 12.0 * _INCH,
    "nm": 1.0,
    "nmm": MM,
    "kgfcm": STANDARD_GRAVITY * 10.0 * MM,
    "knm": 1e3,
}
_CODES: Final = (tuple(_FORCE), tuple(_TORQUE))
"""``cfgfu`` and ``cfgtu`` count these from 1."""


class RdtCommand(enum.IntEnum):
    """Commands of a sensor."""

    STOP = 0x0000
    START = 0x0002
    """Records one by one, in real time."""
    START_BUFFERED = 0x0003
    RESET_LATCH = 0x0041
    BIAS = 0x0042
    """Takes the present load as zero: it also hides the load on the sensor."""


class RdtDevice(enum.Enum):
    """Device family; the two families use different status words."""

    NET = "net"
    """Net F/T (9620-05)."""
    AXIA = "axia"
    """Ethernet Axia (9610-05)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RdtScale:
    """Counts per newton and per newton metre.

    Attributes:
        newton: N per count.
        newton_metre: N m per count.
    """

    newton: float
    newton_metre: float


def rdt_sequence(rate: float) -> SequenceState:
    """Returns the state that watches the rdt_sequence of a sensor with ``rate`` records per second.

    Up to 28 ms between two records are the sensor's own, and not late.
    """
    return SequenceState(modulus=1 << 32, window=max(100, round(rate)), late_after=0.028 + 2 / rate)


def write_request(command: RdtCommand, count: int = 0) -> bytes:
    """Returns a request; ``count`` records are sent, 0 until it is stopped.

    Raises:
        FormatError: A count outside 0 to 2^32 - 1.
    """
    if not 0 <= count < 1 << 32:
        raise FormatError(f"{count} records requested, expected 0 to 2^32 - 1.")
    return _REQUEST.pack(_MAGIC, command, count)


def read_request(data: bytes) -> tuple[RdtCommand, int]:
    """Returns command and count of a request, as a sensor reads it.

    Raises:
        FormatError: Another size, mark or command.
    """
    if len(data) != _REQUEST.size:
        raise FormatError(f"RDT request of {len(data)} bytes, expected {_REQUEST.size}.")
    magic, command, count = _REQUEST.unpack(data)
    if magic != _MAGIC or command not in RdtCommand.__members__.values():
        raise FormatError(f"RDT request {magic:#06x} {command:#06x}, expected {_MAGIC:#06x}.")
    return RdtCommand(command), count


def parse_netftapi(data: bytes, source: str | Path | None = None) -> RdtScale:
    """Returns the scale that the sensor's page ``netftapi2.xml`` states.

    Raises:
        FormatError: Not that page, or counts or units missing: a count is never taken as a
            newton.
        ImplausibleDataError: Counts per unit that are not above zero, or units that contradict.
    """
    root = parse_xml(data, "netftapi2.xml", source)
    found: dict[str, str] = {}
    for element in root.iter():
        text = (element.text or "").strip()
        if text and found.setdefault(element.tag, text) != text:
            raise FormatError(f"{element.tag} occurs twice and differs.", source=source)
    force = _unit(found, "fu", _FORCE, _CODES[0], source) / _counts(found, "cfgcpf", source)
    torque = _unit(found, "tu", _TORQUE, _CODES[1], source) / _counts(found, "cfgcpt", source)
    return RdtScale(newton=force, newton_metre=torque)


def parse_rate(data: bytes, source: str | Path | None = None) -> float | None:
    """Returns the records per second that the sensor's page states (``comrdtrate``), if it does.

    Raises:
        FormatError: Not that page, or no number.
        ImplausibleDataError: A rate no sensor of the kind has.
    """
    element = parse_xml(data, "netftapi2.xml", source).find(".//comrdtrate")
    text = "" if element is None else (element.text or "").strip()
    if not text:
        return None
    try:
        return checked_rate(float(text))
    except ValueError as cause:
        raise FormatError(f"no number comrdtrate: {text!r}.", source=source) from cause


def checked_rate(rate: float) -> float:
    """Returns the records per second of a sensor, if it can have them.

    Raises:
        ImplausibleDataError: Below 1 or above 10,000.
    """
    if not 1.0 <= rate <= 1e4:
        raise ImplausibleDataError(f"{rate:g} records per second, expected 1 to 10000.")
    return rate


def _counts(found: dict[str, str], name: str, source: str | Path | None) -> float:
    try:
        counts = float(found[name])
    except (KeyError, ValueError) as cause:
        raise FormatError(
            f"no number {name}.", source=source, hint="http://SENSOR/netftapi2.xml"
        ) from cause
    if not (math.isfinite(counts) and 1.0 <= counts <= 1e10):
        raise ImplausibleDataError(
            f"{name} is {counts:g} counts per unit, expected 1 to 1e10.", source=source
        )
    return counts


def _unit(
    found: dict[str, str],
    name: str,
    known: dict[str, float],
    codes: tuple[str, ...],
    source: str | Path | None,
) -> float:
    """Returns the unit from its name (``scfgfu``) and code (``cfgfu``), whichever are given."""
    text, code = found.get(f"scfg{name}"), found.get(f"cfg{name}")
    meant = set()
    if text is not None:
        meant.add("".join(c for c in text.lower() if c.isalpha()))
    if code is not None and code.isascii() and code.isdigit() and 1 <= int(code) <= len(codes):
        meant.add(codes[int(code) - 1])
    elif code is not None:
        meant.add(code)
    if len(meant) > 1:
        raise ImplausibleDataError(
            f"scfg{name} says {text!r} and cfg{name} {code!r}: two units.", source=source
        )
    unit = meant.pop() if meant else None
    if unit not in known:
        raise FormatError(
            f"unit {text or code!r} of scfg{name}/cfg{name}, expected one of {', '.join(known)}.",
            source=source,
            hint="http://SENSOR/netftapi2.xml",
        )
    return known[unit]


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
        flags: (n,), of the sequence.
        device: Family of the sensor.
        rate: Records per second as configured.
        frame: Of the axes, where the sensor itself turns them.
        before: rdt and ft sequence of the record before the first.
    """
    status = records["status"].astype(np.int64)
    counts = records["counts"].astype(np.float64)
    rdt = records["rdt"].astype(np.int64)
    ft = records["ft"].astype(np.int64)
    full = ((counts == _EXTREME[0]) | (counts == _EXTREME[1])).any(axis=1)
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

    The last came just now, those before it earlier by the sensor's count, but none before
    ``earliest``, when the socket was last found empty.
    """
    age = (int(rdt[-1]) - rdt) / rate
    times = np.clip(now - np.maximum(age, 0.0), earliest, now)
    return np.asarray(np.maximum.accumulate(times))
