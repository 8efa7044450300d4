"""Universal Robots' Real-Time Data Exchange, protocol version 2: packets, recipes, data.

TCP 30004, big-endian: size (2 bytes, header included), type (1 byte), payload. The client names
variables, the controller answers with their types: that is a recipe, and data packets hold its
values without any further mark. All units are SI.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.blocks import (
    Flag,
    ForceBlock,
    JointBlock,
    check_joints,
    check_poses,
    check_wrenches,
)
from robotrue.online.sequence import SequenceState

Value = tuple[float, ...]
Rows = npt.NDArray[np.void]
"""Data packets as they were sent, with the names of their recipe."""
PROTOCOL: Final = 2
KINDS: Final = "VvOISPUM"
"""Protocol version, controller version, output recipe, input recipe, start, pause, data, text."""
JOINT_NAMES: Final = ("timestamp", "actual_q", "actual_TCP_pose")
FORCE_NAMES: Final = ("timestamp", "actual_TCP_force")
_HEADER: Final = struct.Struct(">HB")
_LONGEST: Final = 4096
"""Bytes; recipes of hundreds of variables stay below. More is another protocol's stream."""
_FORMATS: Final = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RtdePacket:
    """One packet.

    Attributes:
        kind: A letter of ``KINDS``.
        payload: What follows the header.
    """

    kind: str
    payload: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """Layout of a data packet.

    Attributes:
        number: The controller's, from 1.
        names: Variables in their order.
        types: Their types, as many.
    """

    number: int
    names: tuple[str, ...]
    types: tuple[str, ...]

    @property
    def layout(self) -> struct.Struct:
        """The values in a packet, after the byte of the recipe."""
        return struct.Struct(">" + "".join(_FORMATS[t] for t in self.types))

    @property
    def dtype(self) -> np.dtype[np.void]:
        """The same layout as a record."""
        kinds = (np.dtype(_FORMATS[t]).newbyteorder(">") for t in self.types)
        return np.dtype(list(zip(self.names, kinds, strict=True)))


def rtde_sequence(rate: float) -> SequenceState:
    """Returns the state that watches the ticks of a stream at ``rate`` packets per second."""
    return SequenceState(late_after=1.5 / rate)


def split_frames(buffer: bytes) -> tuple[tuple[RtdePacket, ...], bytes]:
    """Returns the whole packets at the start of a stream's bytes, and the bytes left over.

    Raises:
        FormatError: An invalid size or type: the stream is out of step, and everything after it is
            invalid.
    """
    frames = []
    at = 0
    while len(buffer) - at >= _HEADER.size:
        size, code = _HEADER.unpack_from(buffer, at)
        if not _HEADER.size <= size <= _LONGEST or chr(code) not in KINDS:
            raise FormatError(
                f"RTDE packet of {size} bytes and type {chr(code)!r}, expected 3 to {_LONGEST} "
                f"and one of {KINDS}.",
                hint="close the connection and open it again; port 30004, not 30001 to 30003.",
            )
        if len(buffer) - at < size:
            break
        frames.append(RtdePacket(kind=chr(code), payload=buffer[at + _HEADER.size : at + size]))
        at += size
    return tuple(frames), buffer[at:]


def write_frame(kind: str, payload: bytes = b"") -> bytes:
    """Returns a packet; ``S`` and ``P`` have no payload.

    Raises:
        FormatError: Not a type, or too long.
    """
    size = _HEADER.size + len(payload)
    if len(kind) != 1 or kind not in KINDS or size > _LONGEST:
        raise FormatError(f"RTDE packet {kind!r} of {size} bytes, expected one of {KINDS}.")
    return _HEADER.pack(size, ord(kind)) + payload


def write_protocol_request() -> bytes:
    """Returns the request for protocol version 2, the first packet of a connection."""
    return write_frame("V", struct.pack(">H", PROTOCOL))


def write_output_request(names: tuple[str, ...], rate: float) -> bytes:
    """Returns the request for variables at ``rate`` packets per second.

    Raises:
        ConfigurationError: No rate above zero, no names, or one that is not a name.
    """
    if not 0.0 < rate <= 500.0:
        raise ConfigurationError(f"rate {rate:g} 1/s, expected up to 500 (125 before e-Series).")
    return write_frame("O", struct.pack(">d", rate) + _write_names(names))


def read_accepted(packet: RtdePacket) -> bool:
    """Returns whether the controller accepted a ``V``, ``S`` or ``P``.

    Raises:
        FormatError: Another packet.
    """
    if packet.kind not in "VSP" or len(packet.payload) != 1 or packet.payload[0] > 1:
        raise FormatError(f"RTDE packet {packet.kind!r} {packet.payload!r}, expected yes or no.")
    return packet.payload == b"\x01"


def read_recipe(packet: RtdePacket, names: tuple[str, ...]) -> Recipe:
    """Returns the recipe that the controller answers to a request for ``names``.

    Raises:
        ConfigurationError: A variable the controller does not have, or another client writes.
        FormatError: Another packet, another number of types, or invalid types.
    """
    if packet.kind not in "OI" or not packet.payload:
        raise FormatError(f"RTDE packet {packet.kind!r}, expected a recipe.")
    try:
        types = tuple(packet.payload[1:].decode("ascii").split(","))
    except UnicodeDecodeError as cause:
        raise FormatError("RTDE recipe that is not text.") from cause
    if len(types) != len(names):
        raise FormatError(f"RTDE recipe of {len(types)} types for {len(names)} variables.")
    for name, kind in zip(names, types, strict=True):
        if kind in ("NOT_FOUND", "IN_USE"):
            raise ConfigurationError(
                f"RTDE variable {name} is {kind} on this controller.",
                hint="an older controller has fewer variables; another client may write it.",
            )
        if kind not in _FORMATS:
            raise FormatError(
                f"RTDE type {kind!r} of {name}, expected one of {', '.join(_FORMATS)}.",
                hint="protocol version 2 answers with types.",
            )
    if packet.payload[0] == 0:
        raise FormatError("RTDE recipe 0: the controller did not accept it.")
    return Recipe(number=packet.payload[0], names=names, types=types)


def write_recipe(kind: str, recipe: Recipe) -> bytes:
    """Returns the answer to a request, ``O`` or ``I``, as a controller sends it."""
    return write_frame(kind, bytes([recipe.number]) + ",".join(recipe.types).encode("ascii"))


def read_data(packets: Sequence[RtdePacket], recipe: Recipe) -> Rows:
    """Returns the values of data packets (n,) by name.

    Raises:
        FormatError: Another packet, another recipe, or another size.
    """
    dtype = recipe.dtype
    for packet in packets:
        if packet.kind != "U" or len(packet.payload) != 1 + dtype.itemsize:
            raise FormatError(
                f"RTDE packet {packet.kind!r} with {len(packet.payload)} bytes, expected U with "
                f"{1 + dtype.itemsize}."
            )
        if packet.payload[0] != recipe.number:
            raise FormatError(f"RTDE data of recipe {packet.payload[0]}, expected {recipe.number}.")
    return np.frombuffer(b"".join(packet.payload[1:] for packet in packets), dtype)


def write_data(recipe: Recipe, values: Mapping[str, Value]) -> bytes:
    """Returns a data packet: inputs to a controller, or outputs of a simulated one.

    Raises:
        FormatError: A value missing, of another size, or outside its type.
    """
    flat = [number for name in recipe.names for number in values.get(name, ())]
    try:
        body = recipe.layout.pack(*flat)
    except struct.error as cause:
        raise FormatError(f"RTDE data do not fit their recipe: {cause}.") from cause
    return write_frame("U", bytes([recipe.number]) + body)


def read_text(packet: RtdePacket) -> tuple[str, str, int]:
    """Returns message, source and level (0 exception to 3 info) of a text packet.

    Raises:
        FormatError: Another packet, or lengths that do not fit.
    """
    texts = []
    rest = packet.payload if packet.kind == "M" else b""
    for _ in range(2):
        if not rest or len(rest) < 1 + rest[0]:
            raise FormatError(
                f"RTDE packet {packet.kind!r} {packet.payload!r}, expected a message."
            )
        texts.append(rest[1 : 1 + rest[0]].decode("utf-8", "replace"))
        rest = rest[1 + rest[0] :]
    if len(rest) != 1:
        raise FormatError(f"RTDE message with {len(rest)} bytes of level, expected 1.")
    return texts[0], texts[1], rest[0]


def rtde_joint_block(rows: Rows, host_time: float, *, rate: float) -> JointBlock:
    """Returns the block of packets that hold ``JOINT_NAMES``; its poses are in base.

    RTDE numbers no packets: the sequence is the controller's time in ticks of ``rate``.

    Raises:
        FormatError: The recipe has no timestamp or joints.
    """
    time, ticks, flags = _read_clock(rows, rate)
    joints, flags = check_joints(_column(rows, "actual_q", 6), flags)
    poses = np.full((len(rows), 4, 4), np.nan)
    if "actual_TCP_pose" in (rows.dtype.names or ()):
        printed = _column(rows, "actual_TCP_pose", 6)
        finite = np.isfinite(printed).all(axis=1)
        sound = finite & (np.abs(printed[:, 3:]) < 1e3).all(axis=1)
        poses[sound] = pose(matrix_from_rotation_vector(printed[sound, 3:]), printed[sound, :3])
        flags = flags | np.where(finite & ~sound, int(Flag.IMPLAUSIBLE), 0)
        flags = flags | np.where(finite, 0, int(Flag.NOT_FINITE))
    poses, flags = check_poses(poses, flags)
    return JointBlock(
        controller_time=time,
        host_time=np.full(len(rows), host_time),
        joints=joints,
        T_frame_tool=poses,
        sequence=ticks,
        flags=flags,
    )


def rtde_force_block(rows: Rows, host_time: float, *, rate: float) -> ForceBlock:
    """Returns the forces at the tool point, in base axes, of packets that hold ``FORCE_NAMES``.

    Raises:
        FormatError: The recipe has no timestamp or force.
    """
    time, ticks, flags = _read_clock(rows, rate)
    wrench, flags = check_wrenches(_column(rows, "actual_TCP_force", 6), flags)
    return ForceBlock(
        controller_time=time,
        host_time=np.full(len(rows), host_time),
        wrench=wrench,
        frame="base",
        sequence=ticks,
        status=np.zeros(len(rows), dtype=np.int64),
        flags=flags,
    )


def _read_clock(rows: Rows, rate: float) -> tuple[Array, IntArray, IntArray]:
    """Returns times (n,) s, ticks (n,) and flags (n,); -1 and a jump where there is no time."""
    time = _column(rows, "timestamp", 1)[:, 0]
    sound = (time >= 0.0) & (time < 1e10)
    time = np.where(sound, time, np.nan)
    ticks = np.where(sound, np.rint(np.where(sound, time, 0.0) * rate), -1.0).astype(np.int64)
    return time, ticks, np.where(sound, 0, int(Flag.CLOCK_JUMP))


def _column(rows: Rows, name: str, size: int) -> Array:
    names = rows.dtype.names or ()
    values = rows[name].reshape(len(rows), -1) if name in names else np.empty((len(rows), 0))
    if values.shape[1] != size:
        raise FormatError(f"RTDE data without {name}.", hint="ask for it in the recipe.")
    return values.astype(np.float64)


def _write_names(names: tuple[str, ...]) -> bytes:
    if not names or not all(n.isascii() and n.isidentifier() for n in names):
        raise ConfigurationError(f"RTDE variables {names}, expected names.")
    return ",".join(names).encode("ascii")
