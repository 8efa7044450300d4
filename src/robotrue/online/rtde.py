"""Universal Robots' Real-Time Data Exchange, protocol version 2: packets, recipes, data.

TCP 30004, big-endian: size (2 bytes, header included), type (1 byte), payload. The client names
variables, the controller answers with their types: that is a recipe, and data packets hold its
values without any further mark. All units are SI.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.samples import Flag, ForceSample, JointSample, unknown_pose
from robotrue.online.sequence import SequenceState

Value = tuple[float, ...]
PORT: Final = 30004
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
_SIZES: Final = {"VECTOR3D": 3, "VECTOR6D": 6, "VECTOR6INT32": 6, "VECTOR6UINT32": 6}


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One packet.

    Attributes:
        kind: A letter of ``KINDS``.
        payload: What follows the header.
    """

    kind: str
    payload: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """What a data packet holds.

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


def rtde_sequence(rate: float) -> SequenceState:
    """Returns the state that watches the ticks of a stream at ``rate`` packets per second."""
    return SequenceState(late_after=1.5 / rate)


def split_frames(buffer: bytes) -> tuple[tuple[Frame, ...], bytes]:
    """Returns the whole packets at the start of a stream's bytes, and the bytes left over.

    Raises:
        FormatError: A size or type that cannot be: the stream is out of step, and nothing after
            it can be trusted.
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
        frames.append(Frame(kind=chr(code), payload=buffer[at + _HEADER.size : at + size]))
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


def write_input_request(names: tuple[str, ...]) -> bytes:
    """Returns the request to write variables.

    Raises:
        ConfigurationError: No names, or one that is not a name.
    """
    return write_frame("I", _write_names(names))


def read_accepted(frame: Frame) -> bool:
    """Returns whether the controller accepted a ``V``, ``S`` or ``P``.

    Raises:
        FormatError: Another packet.
    """
    if frame.kind not in "VSP" or len(frame.payload) != 1 or frame.payload[0] > 1:
        raise FormatError(f"RTDE packet {frame.kind!r} {frame.payload!r}, expected yes or no.")
    return frame.payload == b"\x01"


def read_controller_version(frame: Frame) -> tuple[int, int, int, int]:
    """Returns major, minor, bug fix and build of the controller.

    Raises:
        FormatError: Another packet.
    """
    if frame.kind != "v" or len(frame.payload) != 16:
        raise FormatError(f"RTDE packet {frame.kind!r} of {len(frame.payload)} bytes, expected v.")
    major, minor, fix, build = struct.unpack(">4I", frame.payload)
    return major, minor, fix, build


def read_recipe(frame: Frame, names: tuple[str, ...]) -> Recipe:
    """Returns the recipe that the controller answers to a request for ``names``.

    Raises:
        ConfigurationError: A variable the controller does not have, or another client writes.
        FormatError: Another packet, another number of types, or types that are none.
    """
    if frame.kind not in "OI" or not frame.payload:
        raise FormatError(f"RTDE packet {frame.kind!r}, expected a recipe.")
    try:
        types = tuple(frame.payload[1:].decode("ascii").split(","))
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
    if frame.payload[0] == 0:
        raise FormatError("RTDE recipe 0: the controller did not accept it.")
    return Recipe(number=frame.payload[0], names=names, types=types)


def write_recipe(kind: str, recipe: Recipe) -> bytes:
    """Returns the answer to a request, ``O`` or ``I``, as a controller sends it."""
    return write_frame(kind, bytes([recipe.number]) + ",".join(recipe.types).encode("ascii"))


def read_data(frame: Frame, recipe: Recipe) -> dict[str, Value]:
    """Returns the values of a data packet by name, each as a tuple.

    Raises:
        FormatError: Another packet, another recipe, or another size.
    """
    layout = recipe.layout
    if frame.kind != "U" or len(frame.payload) != 1 + layout.size:
        raise FormatError(
            f"RTDE packet {frame.kind!r} with {len(frame.payload)} bytes, expected U with "
            f"{1 + layout.size}."
        )
    if frame.payload[0] != recipe.number:
        raise FormatError(f"RTDE data of recipe {frame.payload[0]}, expected {recipe.number}.")
    flat = layout.unpack_from(frame.payload, 1)
    values: dict[str, Value] = {}
    at = 0
    for name, kind in zip(recipe.names, recipe.types, strict=True):
        size = _SIZES.get(kind, 1)
        values[name] = flat[at : at + size]
        at += size
    return values


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


def read_text(frame: Frame) -> tuple[str, str, int]:
    """Returns message, source and level (0 exception to 3 info) of a text packet.

    Raises:
        FormatError: Another packet, or lengths that do not fit.
    """
    texts = []
    rest = frame.payload if frame.kind == "M" else b""
    for _ in range(2):
        if not rest or len(rest) < 1 + rest[0]:
            raise FormatError(f"RTDE packet {frame.kind!r} {frame.payload!r}, expected a message.")
        texts.append(rest[1 : 1 + rest[0]].decode("utf-8", "replace"))
        rest = rest[1 + rest[0] :]
    if len(rest) != 1:
        raise FormatError(f"RTDE message with {len(rest)} bytes of level, expected 1.")
    return texts[0], texts[1], rest[0]


def joint_sample(
    values: Mapping[str, Value], host_time: float, *, rate: float, flags: Flag = Flag.NONE
) -> JointSample:
    """Returns the sample of a data packet that holds ``JOINT_NAMES``; its pose is in base.

    RTDE numbers no packets: the sequence is the controller's time in ticks of ``rate``.

    Raises:
        FormatError: The recipe has no timestamp or joints.
    """
    time, tick, wrong = _clock(values, rate)
    joints = _six(values, "actual_q")
    T_frame_tool = unknown_pose()
    if "actual_TCP_pose" in values:
        numbers = _six(values, "actual_TCP_pose")
        if np.isfinite(numbers).all() and np.abs(numbers[3:]).max() < 1e3:
            T_frame_tool = pose(matrix_from_rotation_vector(numbers[3:]), numbers[:3])
        else:
            wrong |= Flag.IMPLAUSIBLE if np.isfinite(numbers).all() else Flag.NOT_FINITE
    return JointSample(
        controller_time=time,
        host_time=host_time,
        joints=joints,
        T_frame_tool=T_frame_tool,
        sequence=tick,
        flags=flags | wrong,
    )


def force_sample(
    values: Mapping[str, Value], host_time: float, *, rate: float, flags: Flag = Flag.NONE
) -> ForceSample:
    """Returns the force at the tool point, in base axes, of a packet that holds ``FORCE_NAMES``.

    Raises:
        FormatError: The recipe has no timestamp or force.
    """
    time, tick, wrong = _clock(values, rate)
    return ForceSample(
        controller_time=time,
        host_time=host_time,
        wrench=_six(values, "actual_TCP_force"),
        frame="base",
        sequence=tick,
        flags=flags | wrong,
    )


def _clock(values: Mapping[str, Value], rate: float) -> tuple[float, int, Flag]:
    stamp = values.get("timestamp")
    if stamp is None or len(stamp) != 1:
        raise FormatError("RTDE data without timestamp.", hint="ask for it in the recipe.")
    time = float(stamp[0])
    if not 0.0 <= time < 1e10:
        return float("nan"), -1, Flag.CLOCK_JUMP
    return time, round(time * rate), Flag.NONE


def _six(values: Mapping[str, Value], name: str) -> Array:
    found = values.get(name)
    if found is None or len(found) != 6:
        raise FormatError(f"RTDE data without {name}.", hint="ask for it in the recipe.")
    return np.array(found, dtype=np.float64)


def _write_names(names: tuple[str, ...]) -> bytes:
    if not names or not all(n.isascii() and n.isidentifier() for n in names):
        raise ConfigurationError(f"RTDE variables {names}, expected names.")
    return ",".join(names).encode("ascii")
