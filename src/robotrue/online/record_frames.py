"""Frames of a record: blocks, clock fixes, health and checkpoints as bytes, and back.

A frame is a head of 24 bytes and a payload, all little-endian::

    4s magic "RTR1" | B kind | B version | H zero | I payload bytes | Q number | I CRC-32

The CRC covers the head before it and the payload. Payload of a block: ``I`` rows, ``H`` joints,
``H`` bits of the columns that follow, ``16s`` frame name, then the columns, each raw float64 or
int64. A column without information is left out: floats that are all NaN, integers that are all
zero, a host time that is the controller's. Clock fixes and health are JSON; a checkpoint is a list
of named arrays.
"""

from __future__ import annotations

import enum
import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.errors import FormatError, ShapeError
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.estimates import EstimateBlock

MAGIC: Final = b"RTR1"
HEAD: Final = struct.Struct("<4sBBHIQI")
LARGEST: Final = 1 << 30
"""Bytes; no payload is longer, so a longer one is damage."""
_VERSION: Final = 1
_BLOCK: Final = struct.Struct("<IHH16s")
_ENTRY: Final = struct.Struct("<HcB")
_TYPES: Final = {b"d": "<f8", b"q": "<i8", b"D": "<c16", b"B": "|u1"}

Arrays: TypeAlias = Mapping[str, npt.NDArray[np.generic]]
Document: TypeAlias = Mapping[str, object]
Content: TypeAlias = JointBlock | ForceBlock | EstimateBlock | Document


class Kind(enum.IntEnum):
    """Kinds of frames."""

    JOINTS = 1
    FORCE = 2
    ESTIMATES = 3
    CLOCK = 4
    HEALTH = 5
    CHECKPOINT = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordFrame:
    """One entry of a record.

    Attributes:
        number: Counted from 0 through all segments of the record.
        kind: What it is.
        content: A block, JSON values (clock, health) or named arrays (checkpoint).
    """

    number: int
    kind: Kind
    content: Any


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    shape: tuple[int, ...]  # -1: the number of joints
    whole: bool = False


_FLOAT_TIMES: Final = (_Column("controller_time", ()), _Column("host_time", ()))
_COLUMNS: Final[dict[Kind, tuple[_Column, ...]]] = {
    Kind.JOINTS: (
        *_FLOAT_TIMES,
        _Column("joints", (-1,)),
        _Column("T_frame_tool", (4, 4)),
        _Column("sequence", (), True),
        _Column("flags", (), True),
    ),
    Kind.FORCE: (
        *_FLOAT_TIMES,
        _Column("force", (3,)),
        _Column("torque", (3,)),
        _Column("sequence", (), True),
        _Column("status", (), True),
        _Column("flags", (), True),
    ),
    Kind.ESTIMATES: (
        _Column("host_time", ()),
        _Column("error", (3,)),
        _Column("sd", (3,)),
        _Column("static", (3,)),
        _Column("wrench", (6,)),
        _Column("joints", (-1,)),
        _Column("sequence", (), True),
        _Column("doubt", (), True),
    ),
}


def frame_bytes(kind: Kind, number: int, content: Content | Arrays) -> bytes:
    """Returns a frame.

    Raises:
        ShapeError: A checkpoint array of a type other than float64, int64, complex128, uint8.
    """
    if isinstance(content, JointBlock | ForceBlock | EstimateBlock):
        payload = _block_bytes(kind, content)
    elif kind is Kind.CHECKPOINT:
        payload = _arrays_bytes(content)
    else:
        payload = json.dumps(dict(content), separators=(",", ":")).encode()
    head = HEAD.pack(MAGIC, kind, _VERSION, 0, len(payload), number, 0)[:-4]
    crc = zlib.crc32(payload, zlib.crc32(head))
    return b"".join((head, crc.to_bytes(4, "little"), payload))


def head_length(head: bytes) -> int | None:
    """Returns the bytes of payload that a head announces, or None where it is no head."""
    if len(head) < HEAD.size:
        return None
    magic, kind, version, zero, length, _, _ = HEAD.unpack(head)
    known = kind in Kind.__members__.values() and version == _VERSION
    return length if magic == MAGIC and known and not zero and length <= LARGEST else None


def is_sound(head: bytes, payload: bytes) -> bool:
    """Returns whether head and payload are what was written."""
    return zlib.crc32(payload, zlib.crc32(head[:-4])) == int.from_bytes(head[-4:], "little")


def frame_kind(head: bytes) -> Kind:
    """Returns the kind of a sound head."""
    return Kind(head[4])


def frame_number(head: bytes) -> int:
    """Returns the number of a sound head."""
    return int.from_bytes(head[12:20], "little")


def frame_from(head: bytes, payload: bytes) -> RecordFrame:
    """Returns the frame of a sound head and payload.

    Raises:
        FormatError: The payload is not of its kind.
    """
    kind, number = frame_kind(head), frame_number(head)
    try:
        if kind in _COLUMNS:
            content: Content | Arrays = _block_from(kind, payload)
        elif kind is Kind.CHECKPOINT:
            content = _arrays_from(payload)
        else:
            content = json.loads(payload)
    except (struct.error, ValueError, ShapeError, KeyError) as cause:
        raise FormatError(f"frame {number} is no {kind.name.lower()}: {cause}.") from cause
    return RecordFrame(number=number, kind=kind, content=content)


def frame_content(data: bytes) -> object:
    """Returns the content of the bytes of one sound frame.

    Raises:
        FormatError: The payload is not of its kind.
    """
    return frame_from(data[: HEAD.size], data[HEAD.size :]).content


def content_size(content: Content | Arrays) -> int:
    """Returns the approximate bytes of a content in memory."""
    if not isinstance(content, Mapping):
        content = {field.name: getattr(content, field.name) for field in fields(content)}
    values = content.values()
    return 1000 + sum(v.nbytes if isinstance(v, np.ndarray) else 200 for v in values)


def _block_bytes(kind: Kind, block: JointBlock | ForceBlock | EstimateBlock) -> bytes:
    dof, name = 0, b""
    if isinstance(block, ForceBlock):
        name = block.frame.encode()
    else:
        dof = block.joints.shape[1]
    there, parts = 0, [b""]
    for bit, column in enumerate(_COLUMNS[kind]):
        values = _values(block, column.name)
        if _says_nothing(values, column, block):
            continue
        there |= 1 << bit
        parts.append(values.astype("<i8" if column.whole else "<f8", copy=False).tobytes())
    parts[0] = _BLOCK.pack(len(block), dof, there, name)
    return b"".join(parts)


def _values(block: JointBlock | ForceBlock | EstimateBlock, name: str) -> npt.NDArray[np.generic]:
    if isinstance(block, ForceBlock) and name == "force":
        return np.asarray(block.wrench[:, :3])
    if isinstance(block, ForceBlock) and name == "torque":
        return np.asarray(block.wrench[:, 3:])
    return np.asarray(getattr(block, name))


def _says_nothing(values: npt.NDArray[np.generic], column: _Column, block: object) -> bool:
    if column.whole:
        return not values.any()
    if column.name == "host_time" and hasattr(block, "controller_time"):
        return bool((values == block.controller_time).all())
    # the first cell decides almost always: most columns hold numbers
    return values.size > 0 and bool(np.isnan(values.flat[0])) and bool(np.isnan(values).all())


def _block_from(kind: Kind, payload: bytes) -> JointBlock | ForceBlock | EstimateBlock:
    rows, dof, there, name = _BLOCK.unpack_from(payload)
    at, found = _BLOCK.size, dict[str, Any]()
    for bit, column in enumerate(_COLUMNS[kind]):
        shape = (rows, *(dof if n < 0 else n for n in column.shape))
        if there & 1 << bit:
            count = int(np.prod(shape))
            values = np.frombuffer(payload, "<i8" if column.whole else "<f8", count, at)
            at += 8 * count
            found[column.name] = values.reshape(shape)
        elif column.whole:
            found[column.name] = np.zeros(shape, dtype=np.int64)
        elif column.name == "host_time" and "controller_time" in found:
            found[column.name] = found["controller_time"]
        else:
            found[column.name] = np.full(shape, np.nan)
    if at != len(payload):
        raise ValueError(f"{len(payload) - at} bytes too many")
    if kind is Kind.JOINTS:
        return JointBlock(**found)
    if kind is Kind.ESTIMATES:
        return EstimateBlock(**found)
    wrench = np.concatenate([found.pop("force"), found.pop("torque")], axis=1)
    return ForceBlock(wrench=wrench, frame=name.rstrip(b"\0").decode(), **found)


def _arrays_bytes(arrays: Mapping[str, object]) -> bytes:
    parts = [len(arrays).to_bytes(4, "little")]
    for name, stated in arrays.items():
        values = np.asarray(stated)
        code = values.dtype.char.replace("l", "q").encode()
        if code not in _TYPES:
            raise ShapeError(
                f"checkpoint array {name} is of {values.dtype}, expected float64, int64, "
                "complex128 or uint8."
            )
        text = name.encode()
        parts += [_ENTRY.pack(len(text), code, values.ndim), text]
        parts.append(struct.pack(f"<{values.ndim}I", *values.shape))
        parts.append(values.astype(_TYPES[code], copy=False).tobytes())
    return b"".join(parts)


def _arrays_from(payload: bytes) -> dict[str, npt.NDArray[np.generic]]:
    count, at = int.from_bytes(payload[:4], "little"), 4
    found: dict[str, npt.NDArray[np.generic]] = {}
    for _ in range(count):
        length, code, ndim = _ENTRY.unpack_from(payload, at)
        at += _ENTRY.size
        name = payload[at : at + length].decode()
        at += length
        shape = struct.unpack_from(f"<{ndim}I", payload, at)
        at += 4 * ndim
        size = int(np.prod(shape, dtype=np.int64))
        values = np.frombuffer(payload, _TYPES[code], size, at)
        at += values.nbytes
        found[name] = values.reshape(shape).copy()
    if at != len(payload):
        raise ValueError(f"{len(payload) - at} bytes too many")
    return found
