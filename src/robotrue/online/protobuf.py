"""Protocol Buffers' wire format: fields of a message from and to bytes, without a schema.

Google, *Encoding*, protobuf.dev: a field is a varint key ``number << 3 | type`` and its value.
Written here because two packages that register the same ``egm.proto`` cannot live in one process.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from robotrue.errors import FormatError

VARINT: Final = 0
FIXED64: Final = 1
BYTES: Final = 2
FIXED32: Final = 5
_DOUBLE: Final = struct.Struct("<d")


@dataclass(frozen=True, slots=True, kw_only=True)
class WireField:
    """One field as it stands in a message.

    Attributes:
        number: From the schema, from 1.
        wire_type: VARINT, FIXED64, BYTES or FIXED32.
        value: Whole number of a varint, else the raw bytes.
    """

    number: int
    wire_type: int
    value: int | bytes


def read_fields(data: bytes, what: str) -> tuple[WireField, ...]:
    """Returns the fields of a message in their order.

    Raises:
        FormatError: Cut short, a varint longer than 64 bits, field 0, or a retired wire type.
    """
    fields = []
    at = 0
    while at < len(data):
        key, at = _varint(data, at, what)
        number, wire_type = key >> 3, key & 7
        if number == 0 or number >= 1 << 29:
            raise FormatError(f"{what}: field number {number} at byte {at}.")
        value: int | bytes
        if wire_type == VARINT:
            value, at = _varint(data, at, what)
        else:
            if wire_type == BYTES:
                size, at = _varint(data, at, what)
            elif wire_type in (FIXED64, FIXED32):
                size = 8 if wire_type == FIXED64 else 4
            else:
                raise FormatError(f"{what}: wire type {wire_type} of field {number}.")
            if at + size > len(data):
                raise FormatError(
                    f"{what}: field {number} has {size} bytes, {len(data) - at} are left.",
                    hint="a datagram cut short, or not a message of this protocol.",
                )
            value, at = data[at : at + size], at + size
        fields.append(WireField(number=number, wire_type=wire_type, value=value))
    return tuple(fields)


def _varint(data: bytes, at: int, what: str) -> tuple[int, int]:
    value = 0
    for place, byte in enumerate(data[at : at + 10]):
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:
            if value >= 1 << 64:
                break
            return value, at + place + 1
    raise FormatError(f"{what}: a number at byte {at} is cut short or longer than 64 bits.")


def one_message(fields: tuple[WireField, ...], number: int, what: str) -> bytes | None:
    """Returns the bytes of a message within, or None where it does not stand.

    Raises:
        FormatError: Of another wire type, or twice.
    """
    value = _one(fields, number, BYTES, what)
    return value if isinstance(value, bytes) else None


def one_varint(fields: tuple[WireField, ...], number: int, what: str) -> int | None:
    """Returns a whole number, enumeration or bool, or None where it does not stand.

    Raises:
        FormatError: Of another wire type, or twice.
    """
    value = _one(fields, number, VARINT, what)
    return value if isinstance(value, int) else None


def one_double(fields: tuple[WireField, ...], number: int, what: str) -> float | None:
    """Returns a double, or None where it does not stand.

    Raises:
        FormatError: Of another wire type, or twice.
    """
    value = _one(fields, number, FIXED64, what)
    return float(_DOUBLE.unpack(value)[0]) if isinstance(value, bytes) else None


def doubles(fields: tuple[WireField, ...], number: int, what: str) -> tuple[float, ...]:
    """Returns a list of doubles, packed or one by one; empty where it does not stand.

    Raises:
        FormatError: Of another wire type, or packed in no multiple of eight bytes.
    """
    found: list[float] = []
    for item in fields:
        if item.number != number:
            continue
        if not isinstance(item.value, bytes) or item.wire_type == FIXED32 or len(item.value) % 8:
            raise FormatError(f"{what}: field {number} holds no doubles.")
        found += [float(v[0]) for v in _DOUBLE.iter_unpack(item.value)]
    return tuple(found)


def _one(
    fields: tuple[WireField, ...], number: int, wire_type: int, what: str
) -> int | bytes | None:
    found = [item for item in fields if item.number == number]
    if not found:
        return None
    # The format lets the last one win; a controller sends each once, and a second is damage.
    if len(found) > 1 or found[0].wire_type != wire_type:
        raise FormatError(
            f"{what}: field {number} has wire type {found[0].wire_type} and stands "
            f"{len(found)} times, expected type {wire_type}, once."
        )
    return found[0].value


def write_varint(number: int, value: int) -> bytes:
    """Returns a field that holds a whole number from 0 to 2^64 - 1."""
    return _encode_varint(number << 3 | VARINT) + _encode_varint(value)


def write_double(number: int, value: float) -> bytes:
    """Returns a field that holds a double."""
    return _encode_varint(number << 3 | FIXED64) + _DOUBLE.pack(value)


def write_doubles(number: int, values: tuple[float, ...]) -> bytes:
    """Returns a list of doubles, one field each, as proto2 writes them."""
    return b"".join(write_double(number, value) for value in values)


def write_message(number: int, body: bytes) -> bytes:
    """Returns a field that holds a message."""
    return _encode_varint(number << 3 | BYTES) + _encode_varint(len(body)) + body


def _encode_varint(value: int) -> bytes:
    if not 0 <= value < 1 << 64:
        raise FormatError(f"{value} cannot be written, expected 0 to 2^64 - 1.")
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
