"""ABB Externally Guided Motion: ``EgmRobot`` of the controller, and what may be sent back.

UDP, one message a datagram, every 4 ms. Field numbers are those of ``egm.proto``. There are two
generations of it: RobotWare 6 numbers the measured force 1, RobotWare 7 uses it for ``fcActive``
and numbers the force 2. Read with the wrong one the force is an empty list and nothing complains;
so the generation is stated, and an empty force is refused.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc, matrix_from_quat_wxyz
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, ShapeError
from robotrue.online import protobuf as wire
from robotrue.online.blocks import (
    Flag,
    ForceBlock,
    JointBlock,
    check_joints,
    check_poses,
    check_wrenches,
)
from robotrue.online.protobuf import WireMessage
from robotrue.online.robot_correction import Correction
from robotrue.online.sequence import SequenceState

_State = TypeVar("_State", bound=enum.IntEnum)
_CYCLE: Final = 4e-3
_NO_POSE: Final = np.full((4, 4), np.nan)
_QUAT_OFF: Final = 1e-3
"""Largest deviation of a quaternion from unit length."""


class RobotWare(enum.Enum):
    """RobotWare generation of the controller, which determines the fields of ``egm.proto``."""

    SIX = 6
    SEVEN = 7


class MessageType(enum.IntEnum):
    """``EgmHeader.MessageType``."""

    UNDEFINED = 0
    COMMAND = 1
    DATA = 2
    CORRECTION = 3
    PATH_CORRECTION = 4


class MotorState(enum.IntEnum):
    """``EgmMotorState``."""

    UNDEFINED = 0
    ON = 1
    OFF = 2


class GuidanceState(enum.IntEnum):
    """``EgmMCIState``: the guidance of the motion from outside."""

    UNDEFINED = 0
    ERROR = 1
    STOPPED = 2
    RUNNING = 3


class RapidState(enum.IntEnum):
    """``EgmRapidCtrlExecState``."""

    UNDEFINED = 0
    STOPPED = 1
    RUNNING = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class EgmPose:
    """A pose as the controller prints it.

    Attributes:
        xyz_mm: Position.
        quat_wxyz: Orientation, or None.
        euler_deg: About x, y, z, R = Rz(z) Ry(y) Rx(x), or None; wins over the quaternion.
    """

    xyz_mm: tuple[float, ...]
    quat_wxyz: tuple[float, ...] | None = None
    euler_deg: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EgmRobot:
    """One message of the controller, in its own units.

    Attributes:
        seqno: Number of the message.
        tm_ms: When the controller sent it, on its clock.
        joints_deg: As measured, 6 or 7, or empty.
        pose: As measured, in the work object of EGM, or None.
        planned_deg: Joints as planned, or empty.
        clock: (s, us) of the measurement on the controller's clock, or None.
        motors: Whether they are on, or None.
        guidance: Whether EGM moves the robot, or None.
        converged: Whether the robot is where it was last sent, or None.
        rapid: Whether the program runs, or None.
        force_sent: Whether the message holds a measured force at all.
        force_active: RobotWare 7: whether force control is active; None where it is not stated.
        force: Fx Fy Fz N, Tx Ty Tz N m; empty where it is absent.
    """

    seqno: int
    tm_ms: int
    joints_deg: tuple[float, ...] = ()
    pose: EgmPose | None = None
    planned_deg: tuple[float, ...] = ()
    clock: tuple[int, int] | None = None
    motors: MotorState | None = None
    guidance: GuidanceState | None = None
    converged: bool | None = None
    rapid: RapidState | None = None
    force_sent: bool = False
    force_active: bool | None = None
    force: tuple[float, ...] = ()


SeenMessage = tuple[EgmRobot, float, Flag]
"""A message, s on the host's clock when it came, and the flags of its number."""


def egm_sequence() -> SequenceState:
    """Returns the state that watches the seqno of a link, 4 ms a message."""
    return SequenceState(modulus=1 << 32, late_after=1.5 * _CYCLE)


def read_robot(data: bytes, generation: RobotWare) -> EgmRobot:
    """Returns a message of the controller.

    Raises:
        FormatError: Damaged, not an EgmRobot, or with a measured force that is empty or not of
            six values: then of the other generation.
    """
    message = WireMessage(data, "EgmRobot")
    seqno, tm, kind = _read_header(message)
    if kind is not MessageType.DATA:
        raise FormatError(
            f"EGM message of type {kind.name}, expected DATA from a controller.",
            hint="does another sensor answer on this port?",
        )
    back = message.message(2, "feedBack")
    sent, active, force = _read_force(message, generation)
    converged = message.varint(6)
    return EgmRobot(
        seqno=seqno,
        tm_ms=tm,
        joints_deg=_read_joints(back),
        pose=_read_pose(back),
        planned_deg=_read_joints(message.message(3, "planned")),
        clock=_read_clock(back),
        motors=_read_state(message, 4, MotorState),
        guidance=_read_state(message, 5, GuidanceState),
        converged=None if converged is None else bool(converged),
        rapid=_read_state(message, 8, RapidState),
        force_sent=sent,
        force_active=active,
        force=force,
    )


def egm_joint_block(messages: Sequence[SeenMessage]) -> JointBlock:
    """Returns the block of messages; its poses are in the work object of EGM.

    Raises:
        FormatError: A message has no joints.
        ShapeError: Messages of arms with different numbers of joints.
    """
    robots = [robot for robot, _, _ in messages]
    if not all(robot.joints_deg for robot in robots):
        raise FormatError(
            "EgmRobot without measured joints.", hint="EGMSetupUC with the joints of the arm."
        )
    if len({len(robot.joints_deg) for robot in robots}) > 1:
        raise ShapeError("messages of arms with different numbers of joints in one stream.")
    poses, faults = zip(*(_matrix(robot.pose) for robot in robots), strict=True)
    off = [Flag.INACTIVE * (robot.motors is MotorState.OFF) for robot in robots]
    ill = [Flag.SENSOR_FAULT * (robot.guidance is GuidanceState.ERROR) for robot in robots]
    flags = _flags_of(messages) | np.array(faults) | np.array(off) | np.array(ill)
    joints, flags = check_joints(np.array([robot.joints_deg for robot in robots]) * DEG, flags)
    T_frame_tool, flags = check_poses(np.array(poses), flags)
    return JointBlock(
        controller_time=np.array([_time(robot) for robot in robots]),
        host_time=np.array([time for _, time, _ in messages]),
        joints=joints,
        T_frame_tool=T_frame_tool,
        sequence=np.array([robot.seqno for robot in robots], dtype=np.int64),
        flags=flags,
    )


def egm_force_block(messages: Sequence[SeenMessage], frame: str) -> ForceBlock:
    """Returns the measured forces of messages.

    Args:
        messages: As read.
        frame: The axes the controller was set up to report them in; no message says.

    Raises:
        FormatError: A message has no measured force.
    """
    robots = [robot for robot, _, _ in messages]
    if not all(robot.force for robot in robots):
        raise FormatError(
            "EgmRobot without a measured force.",
            hint="a force sensor and its calibration (FCCalib) on the controller, or --force "
            "from another source.",
        )
    off = [Flag.INACTIVE * (robot.force_active is False) for robot in robots]
    flags = _flags_of(messages) | np.array(off)
    wrench, flags = check_wrenches(np.array([robot.force for robot in robots]), flags)
    return ForceBlock(
        controller_time=np.array([_time(robot) for robot in robots]),
        host_time=np.array([time for _, time, _ in messages]),
        wrench=wrench,
        frame=frame,
        sequence=np.array([robot.seqno for robot in robots], dtype=np.int64),
        status=np.zeros(len(robots), dtype=np.int64),
        flags=flags,
    )


def _flags_of(messages: Sequence[SeenMessage]) -> IntArray:
    return np.array([int(flags) for _, _, flags in messages], dtype=np.int64)


def write_robot(robot: EgmRobot, generation: RobotWare) -> bytes:
    """Returns a message as a controller sends it, for simulators and tests."""
    back = b""
    if robot.joints_deg:
        back += wire.write_message(1, wire.write_doubles(1, robot.joints_deg))
    if robot.pose is not None:
        back += wire.write_message(2, _write_pose(robot.pose))
    if robot.clock is not None:
        second, microsecond = robot.clock
        back += wire.write_message(
            4, wire.write_varint(1, second) + wire.write_varint(2, microsecond)
        )
    out = _write_header(robot.seqno, robot.tm_ms, MessageType.DATA) + wire.write_message(2, back)
    if robot.planned_deg:
        joints = wire.write_message(1, wire.write_doubles(1, robot.planned_deg))
        out += wire.write_message(3, joints)
    for number, state in ((4, robot.motors), (5, robot.guidance)):
        if state is not None:
            out += wire.write_message(number, wire.write_varint(1, state))
    if robot.converged is not None:
        out += wire.write_varint(6, robot.converged)
    if robot.rapid is not None:
        out += wire.write_message(8, wire.write_varint(1, robot.rapid))
    if robot.force_sent:
        force = b""
        if generation is RobotWare.SEVEN and robot.force_active is not None:
            force += wire.write_varint(1, robot.force_active)
        force += wire.write_doubles(1 if generation is RobotWare.SIX else 2, robot.force)
        out += wire.write_message(9, force)
    return out


def write_path_correction(seqno: int, tm_ms: int, correction: Correction, age: float) -> bytes:
    """Returns an ``EgmSensorPathCorr`` for a robot in EGMMoveL or EGMMoveC.

    Args:
        seqno: Our own number of the message.
        tm_ms: Our time.
        correction: Its shift, in the frame of the sensor as EGM was set up; path correction does
            not turn the tool.
        age: s since the measurement the correction rests on; sent in whole ms.

    Raises:
        ShapeError: A turn, or an age below zero.
    """
    if np.any(correction.turn) or not 0.0 <= age < 1e6:
        raise ShapeError(
            f"turn {correction.turn / DEG} deg, age {age:g} s; expected no turn and an age from 0.",
            hint="EGM corrects the path in x, y, z only.",
        )
    body = wire.write_message(1, _write_numbers(tuple((correction.shift / MM).tolist())))
    body += wire.write_varint(2, round(age * 1e3))
    return _write_header(seqno, tm_ms, MessageType.PATH_CORRECTION) + wire.write_message(2, body)


def read_path_correction(data: bytes) -> tuple[int, tuple[float, ...], int]:
    """Returns seqno, x y z in mm and age in ms of an ``EgmSensorPathCorr``, as a controller does.

    Raises:
        FormatError: Damaged, or another message.
    """
    message = WireMessage(data, "EgmSensorPathCorr")
    seqno, _, kind = _read_header(message)
    body = message.message(2, "pathCorr")
    xyz, age = _read_numbers(body, 1, 3), body.varint(2)
    if kind is not MessageType.PATH_CORRECTION or xyz is None or age is None:
        raise FormatError(f"EGM message {kind.name} without pos and age, expected both.")
    return seqno, xyz, age


def read_target(data: bytes) -> tuple[int, tuple[float, ...], EgmPose | None]:
    """Returns seqno, joints in deg (or none) and pose (or None) of an ``EgmSensor``.

    Raises:
        FormatError: Damaged, or another message.
    """
    message = WireMessage(data, "EgmSensor")
    seqno, _, kind = _read_header(message)
    if kind is not MessageType.CORRECTION:
        raise FormatError(f"EGM message {kind.name}, expected CORRECTION.")
    planned = message.message(2, "planned")
    return seqno, _read_joints(planned), _read_pose(planned)


def _read_header(message: WireMessage) -> tuple[int, int, MessageType]:
    what, header = message.what, message.message(1, f"{message.what} header")
    seqno, tm, kind = header.varint(1), header.varint(2), header.varint(3)
    # the proto requires none; a controller sends it always, and sensors do without
    if tm is None and what != "EgmRobot":
        tm = 0
    if seqno is None or tm is None or max(seqno, tm) >= 1 << 32:
        raise FormatError(f"{what} without a header of seqno and tm.", hint="is this EGM's port?")
    if kind is None or kind not in MessageType.__members__.values():
        raise FormatError(f"{what} of type {kind}, expected 0 to 4.")
    return seqno, tm, MessageType(kind)


def _read_force(
    message: WireMessage, generation: RobotWare
) -> tuple[bool, bool | None, tuple[float, ...]]:
    """Returns whether a force was sent, whether force control is active, and the force."""
    if not message.values(9):
        return False, None, ()
    inner = message.message(9, "measuredForce")
    number = 1 if generation is RobotWare.SIX else 2
    values: tuple[float, ...] = ()
    if all(wire_type != wire.VARINT for wire_type, _ in inner.values(number)):
        values = inner.doubles(number)
    if len(values) != 6:
        other = RobotWare.SEVEN if generation is RobotWare.SIX else RobotWare.SIX
        elsewhere = any(v for kind, v in inner.values(3 - number) if kind != wire.VARINT)
        raise FormatError(
            f"measuredForce has {len(values)} values as RobotWare {generation.value}, expected 6.",
            hint=f"RobotWare {other.value}: its force is in the other field."
            if elsewhere
            else f"RobotWare {other.value}, or calibrate the force sensor (FCCalib).",
        )
    active = inner.varint(1) if number == 2 else None
    return True, None if active is None else bool(active), values


def _read_joints(message: WireMessage) -> tuple[float, ...]:
    values = message.message(1, f"{message.what} joints").doubles(1)
    if len(values) not in (0, 6, 7):
        raise FormatError(f"{message.what} has {len(values)} joints, expected 6 or 7.")
    return values


def _read_numbers(message: WireMessage, number: int, size: int) -> tuple[float, ...] | None:
    """A message of required doubles 1..size, or None where it is absent."""
    if not message.values(number):
        return None
    inner = message.message(number, message.what)
    values = tuple(v for i in range(1, size + 1) if (v := inner.double(i)) is not None)
    if len(values) != size:
        raise FormatError(f"{message.what}: {len(values)} of {size} numbers in field {number}.")
    return values


def _read_pose(message: WireMessage) -> EgmPose | None:
    inner = message.message(2, "cartesian")
    xyz = _read_numbers(inner, 1, 3)
    if xyz is None:
        return None
    return EgmPose(
        xyz_mm=xyz, quat_wxyz=_read_numbers(inner, 2, 4), euler_deg=_read_numbers(inner, 3, 3)
    )


def _read_clock(message: WireMessage) -> tuple[int, int] | None:
    inner = message.message(4, "time")
    second, microsecond = inner.varint(1), inner.varint(2)
    if second is None or microsecond is None:
        return None
    if microsecond >= 1_000_000 or second >= 1 << 40:
        raise FormatError(f"time {second} s {microsecond} us, expected below 1000000 us.")
    return second, microsecond


def _read_state(message: WireMessage, number: int, kind: type[_State]) -> _State | None:
    if not message.values(number):
        return None
    value = message.message(number, kind.__name__).varint(1)
    if value is None or value not in kind.__members__.values():
        raise FormatError(f"{kind.__name__} {value}, expected 0 to {max(kind)}.")
    return kind(value)


def _matrix(printed: EgmPose | None) -> tuple[Array, Flag]:
    if printed is None or (printed.euler_deg is None and printed.quat_wxyz is None):
        return _NO_POSE, Flag.NONE
    turn = np.array(printed.euler_deg or printed.quat_wxyz)
    xyz = np.array(printed.xyz_mm)
    if not (np.isfinite(turn).all() and np.isfinite(xyz).all()):
        return _NO_POSE, Flag.NOT_FINITE
    if printed.euler_deg is not None:
        return pose(matrix_from_abc(turn[::-1] * DEG), xyz * MM), Flag.NONE
    if not abs(math.hypot(*turn.tolist()) - 1.0) <= _QUAT_OFF:
        return _NO_POSE, Flag.IMPLAUSIBLE
    return pose(matrix_from_quat_wxyz(turn), xyz * MM), Flag.NONE


def _time(robot: EgmRobot) -> float:
    if robot.clock is None:
        return robot.tm_ms * 1e-3
    return robot.clock[0] + robot.clock[1] * 1e-6


def _write_header(seqno: int, tm_ms: int, kind: MessageType) -> bytes:
    body = wire.write_varint(1, seqno % (1 << 32)) + wire.write_varint(2, tm_ms % (1 << 32))
    return wire.write_message(1, body + wire.write_varint(3, kind))


def _write_numbers(values: tuple[float, ...]) -> bytes:
    return b"".join(wire.write_double(i + 1, value) for i, value in enumerate(values))


def _write_pose(printed: EgmPose) -> bytes:
    out = wire.write_message(1, _write_numbers(printed.xyz_mm))
    for number, values in ((2, printed.quat_wxyz), (3, printed.euler_deg)):
        if values is not None:
            out += wire.write_message(number, _write_numbers(values))
    return out
