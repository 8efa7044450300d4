"""Protocol Buffers' wire format: fields of a message from and to bytes, without a schema.

Google, *Encoding*, protobuf.dev: a field is a varint key ``number << 3 | type`` and its value.
Written here because two packages that register the same ``egm.proto`` cannot live in one process.
"""

from __future__ import annotations

import struct
from typing import Final

from robotrue.errors import FormatError

VARINT: Final = 0
_FIXED64: Final = 1
_BYTES: Final = 2
_FIXED32: Final = 5
_DOUBLE: Final = struct.Struct("<d")

WireValue = tuple[int, int | bytes]
"""Wire type and value of a field: whole number of a varint, else the raw bytes."""


class WireMessage:
    """The fields of one message by their numbers.

    Args:
        data: The message.
        what: Its name in error messages.

    Raises:
        FormatError: Cut short, a varint longer than 64 bits, field 0, or a retired wire type.
    """

    __slots__ = ("_fields", "what")

    def __init__(self, data: bytes, what: str) -> None:
        self.what = what
        self._fields: dict[int, list[WireValue]] = {}
        at = 0
        while at < len(data):
            number, value, at = _read_field(data, at, what)
            self._fields.setdefault(number, []).append(value)

    def __bool__(self) -> bool:
        return bool(self._fields)

    def values(self, number: int) -> list[WireValue]:
        """Returns every value of a field, undecoded."""
        return self._fields.get(number, [])

    def message(self, number: int, what: str) -> WireMessage:
        """Returns the message within; without fields where it is absent.

        Raises:
            FormatError: Of another wire type, twice, or damaged.
        """
        value = self._find_one(number, _BYTES)
        return WireMessage(value if isinstance(value, bytes) else b"", what)

    def varint(self, number: int) -> int | None:
        """Returns a whole number, enumeration or bool, or None where it is absent.

        Raises:
            FormatError: Of another wire type, or twice.
        """
        value = self._find_one(number, VARINT)
        return value if isinstance(value, int) else None

    def double(self, number: int) -> float | None:
        """Returns a double, or None where it is absent.

        Raises:
            FormatError: Of another wire type, or twice.
        """
        value = self._find_one(number, _FIXED64)
        return float(_DOUBLE.unpack(value)[0]) if isinstance(value, bytes) else None

    def doubles(self, number: int) -> tuple[float, ...]:
        """Returns a list of doubles, packed or one by one; empty where it is absent.

        Raises:
            FormatError: Of another wire type, or packed in no multiple of eight bytes.
        """
        found: list[float] = []
        for wire_type, value in self.values(number):
            if not isinstance(value, bytes) or wire_type == _FIXED32 or len(value) % 8:
                raise FormatError(f"{self.what}: field {number} holds no doubles.")
            found += [float(v[0]) for v in _DOUBLE.iter_unpack(value)]
        return tuple(found)

    def _find_one(self, number: int, wire_type: int) -> int | bytes | None:
        values = self.values(number)
        if not values:
            return None
        # The format lets the last one win; a controller sends each once, and a second is damage.
        if len(values) > 1 or values[0][0] != wire_type:
            raise FormatError(
                f"{self.what}: field {number} has wire type {values[0][0]} and occurs "
                f"{len(values)} times, expected type {wire_type}, once."
            )
        return values[0][1]


def _read_field(data: bytes, at: int, what: str) -> tuple[int, WireValue, int]:
    """Returns number, value and end of the field that begins at a byte."""
    key, at = _read_varint(data, at, what)
    number, wire_type = key >> 3, key & 7
    if number == 0 or number >= 1 << 29:
        raise FormatError(f"{what}: field number {number} at byte {at}.")
    if wire_type == VARINT:
        value, at = _read_varint(data, at, what)
        return number, (wire_type, value), at
    if wire_type == _BYTES:
        size, at = _read_varint(data, at, what)
    elif wire_type in (_FIXED64, _FIXED32):
        size = 8 if wire_type == _FIXED64 else 4
    else:
        raise FormatError(f"{what}: wire type {wire_type} of field {number}.")
    if at + size > len(data):
        raise FormatError(
            f"{what}: field {number} has {size} bytes, {len(data) - at} are left.",
            hint="a datagram cut short, or not a message of this protocol.",
        )
    return number, (wire_type, data[at : at + size]), at + size


def _read_varint(data: bytes, at: int, what: str) -> tuple[int, int]:
    value = 0
    for place, byte in enumerate(data[at : at + 10]):
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:
            if value >= 1 << 64:
                break
            return value, at + place + 1
    raise FormatError(f"{what}: a number at byte {at} is cut short or longer than 64 bits.")


def write_varint(number: int, value: int) -> bytes:
    """Returns a field that holds a whole number from 0 to 2^64 - 1."""
    return _encode_varint(number << 3 | VARINT) + _encode_varint(value)


def write_double(number: int, value: float) -> bytes:
    """Returns a field that holds a double."""
    return _encode_varint(number << 3 | _FIXED64) + _DOUBLE.pack(value)


def write_doubles(number: int, values: tuple[float, ...]) -> bytes:
    """Returns a list of doubles, one field each, as proto2 writes them."""
    return b"".join(write_double(number, value) for value in values)


def write_message(number: int, body: bytes) -> bytes:
    """Returns a field that holds a message."""
    return _encode_varint(number << 3 | _BYTES) + _encode_varint(len(body)) + body


def _encode_varint(value: int) -> bytes:
    if not 0 <= value < 1 << 64:
        raise FormatError(f"{value} cannot be written, expected 0 to 2^64 - 1.")
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
