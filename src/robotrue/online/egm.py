"""ABB Externally Guided Motion: ``EgmRobot`` of the controller, and what may be sent back.

UDP, one message a datagram, every 4 ms. Field numbers are those of ``egm.proto``. There are two
generations of it: RobotWare 6 numbers the measured force 1, RobotWare 7 puts ``fcActive`` there
and numbers the force 2. Read with the wrong one the force is an empty list and nothing complains;
so the generation is stated, and an empty force is refused.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import (
    matrix_from_abc,
    matrix_from_quat_wxyz,
    quat_wxyz_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, ShapeError
from robotrue.online import protobuf as wire
from robotrue.online.samples import Correction, Flag, ForceSample, JointSample, unknown_pose
from robotrue.online.sequence import SequenceState

_State = TypeVar("_State", bound=enum.IntEnum)
_CYCLE: Final = 4e-3
_QUAT_OFF: Final = 1e-3
"""How far from unit length a quaternion may be printed."""


class RobotWare(enum.Enum):
    """Which generation of ``egm.proto`` the controller speaks."""

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
        force_active: RobotWare 7: whether force control is active; None where it is not said.
        force: Fx Fy Fz N, Tx Ty Tz N m; empty where it is not there.
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


def egm_sequence() -> SequenceState:
    """Returns the state that watches the seqno of a link, 4 ms a message."""
    return SequenceState(modulus=1 << 32, late_after=1.5 * _CYCLE)


def read_robot(data: bytes, generation: RobotWare) -> EgmRobot:
    """Returns a message of the controller.

    Raises:
        FormatError: Damaged, not an EgmRobot, or with a measured force that is empty or not of
            six values: then of the other generation.
    """
    fields = wire.read_fields(data, "EgmRobot")
    seqno, tm, kind = _header(fields, "EgmRobot")
    if kind is not MessageType.DATA:
        raise FormatError(
            f"EGM message of type {kind.name}, expected DATA from a controller.",
            hint="does another sensor answer on this port?",
        )
    back = _fields(fields, 2, "feedBack")
    joints = _joints(back, "feedBack")
    planned = _joints(_fields(fields, 3, "planned"), "planned")
    sent, active, force = _force(fields, generation)
    converged = wire.one_varint(fields, 6, "EgmRobot")
    return EgmRobot(
        seqno=seqno,
        tm_ms=tm,
        joints_deg=joints,
        pose=_pose(back),
        planned_deg=planned,
        clock=_clock(back),
        motors=_state(fields, 4, MotorState),
        guidance=_state(fields, 5, GuidanceState),
        converged=None if converged is None else bool(converged),
        rapid=_state(fields, 8, RapidState),
        force_sent=sent,
        force_active=active,
        force=force,
    )


def joint_sample(robot: EgmRobot, host_time: float, flags: Flag = Flag.NONE) -> JointSample:
    """Returns the sample of a message; its pose is in the work object of EGM.

    Raises:
        FormatError: The message has no joints.
    """
    if not robot.joints_deg:
        raise FormatError(
            "EgmRobot without measured joints.", hint="EGMSetupUC with the joints of the arm."
        )
    if robot.motors is MotorState.OFF:
        flags |= Flag.INACTIVE
    if robot.guidance is GuidanceState.ERROR:
        flags |= Flag.SENSOR_FAULT
    T_frame_tool, wrong = _matrix(robot.pose)
    return JointSample(
        controller_time=_time(robot),
        host_time=host_time,
        joints=np.array(robot.joints_deg) * DEG,
        T_frame_tool=T_frame_tool,
        sequence=robot.seqno,
        flags=flags | wrong,
    )


def force_sample(
    robot: EgmRobot, host_time: float, *, frame: str, flags: Flag = Flag.NONE
) -> ForceSample:
    """Returns the measured force of a message.

    Args:
        robot: As read.
        host_time: s.
        frame: The axes the controller was set up to report it in; the message does not say.
        flags: What is wrong with the message.

    Raises:
        FormatError: The message has no measured force.
    """
    if not robot.force:
        raise FormatError(
            "EgmRobot without a measured force.",
            hint="a force sensor and its calibration (FCCalib) on the controller, or --force "
            "from another source.",
        )
    if robot.force_active is False:
        flags |= Flag.INACTIVE
    return ForceSample(
        controller_time=_time(robot),
        host_time=host_time,
        wrench=np.array(robot.force),
        frame=frame,
        sequence=robot.seqno,
        flags=flags,
    )


def write_robot(robot: EgmRobot, generation: RobotWare) -> bytes:
    """Returns a message as a controller sends it, for simulators and tests."""
    back = b""
    if robot.joints_deg:
        back += wire.write_message(1, wire.write_doubles(1, robot.joints_deg))
    if robot.pose is not None:
        back += wire.write_message(2, _written_pose(robot.pose))
    if robot.clock is not None:
        second, microsecond = robot.clock
        back += wire.write_message(
            4, wire.write_varint(1, second) + wire.write_varint(2, microsecond)
        )
    out = _written_header(robot.seqno, robot.tm_ms, MessageType.DATA) + wire.write_message(2, back)
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


def write_joint_target(seqno: int, tm_ms: int, joints_deg: tuple[float, ...]) -> bytes:
    """Returns an ``EgmSensor`` that sends the robot to joints.

    Raises:
        ShapeError: A joint that is not finite.
    """
    _finite(joints_deg, "joints")
    planned = wire.write_message(1, wire.write_doubles(1, joints_deg))
    return _written_header(seqno, tm_ms, MessageType.CORRECTION) + wire.write_message(2, planned)


def write_pose_target(seqno: int, tm_ms: int, T_frame_tool: Array) -> bytes:
    """Returns an ``EgmSensor`` that sends the tool to a pose (4, 4) m in the work object.

    Raises:
        ShapeError: A pose that is not finite.
    """
    target = np.asarray(T_frame_tool, dtype=np.float64)
    _finite(target.ravel().tolist(), "T_frame_tool")
    printed = EgmPose(
        xyz_mm=tuple((target[:3, 3] / MM).tolist()),
        quat_wxyz=tuple(quat_wxyz_from_matrix(target[:3, :3]).tolist()),
    )
    planned = wire.write_message(2, _written_pose(printed))
    return _written_header(seqno, tm_ms, MessageType.CORRECTION) + wire.write_message(2, planned)


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
    body = wire.write_message(1, _written_three(tuple((correction.shift / MM).tolist())))
    body += wire.write_varint(2, round(age * 1e3))
    return _written_header(seqno, tm_ms, MessageType.PATH_CORRECTION) + wire.write_message(2, body)


def read_path_correction(data: bytes) -> tuple[int, tuple[float, ...], int]:
    """Returns seqno, x y z in mm and age in ms of an ``EgmSensorPathCorr``, as a controller does.

    Raises:
        FormatError: Damaged, or another message.
    """
    fields = wire.read_fields(data, "EgmSensorPathCorr")
    seqno, _, kind = _header(fields, "EgmSensorPathCorr")
    body = _fields(fields, 2, "pathCorr")
    xyz = _numbers(body, 1, 3, "pathCorr")
    age = wire.one_varint(body, 2, "pathCorr")
    if kind is not MessageType.PATH_CORRECTION or xyz is None or age is None:
        raise FormatError(f"EGM message {kind.name} without pos and age, expected both.")
    return seqno, xyz, age


def read_target(data: bytes) -> tuple[int, tuple[float, ...], EgmPose | None]:
    """Returns seqno, joints in deg (or none) and pose (or None) of an ``EgmSensor``.

    Raises:
        FormatError: Damaged, or another message.
    """
    fields = wire.read_fields(data, "EgmSensor")
    seqno, _, kind = _header(fields, "EgmSensor")
    if kind is not MessageType.CORRECTION:
        raise FormatError(f"EGM message {kind.name}, expected CORRECTION.")
    planned = _fields(fields, 2, "planned")
    return seqno, _joints(planned, "planned"), _pose(planned)


def _header(fields: tuple[wire.WireField, ...], what: str) -> tuple[int, int, MessageType]:
    header = _fields(fields, 1, f"{what} header")
    seqno = wire.one_varint(header, 1, f"{what} header")
    tm = wire.one_varint(header, 2, f"{what} header")
    # the proto asks for none; a controller sends it always, and sensors do without
    if tm is None and what != "EgmRobot":
        tm = 0
    kind = wire.one_varint(header, 3, f"{what} header")
    if seqno is None or tm is None or max(seqno, tm) >= 1 << 32:
        raise FormatError(f"{what} without a header of seqno and tm.", hint="is this EGM's port?")
    if kind is None or kind not in MessageType.__members__.values():
        raise FormatError(f"{what} of type {kind}, expected 0 to 4.")
    return seqno, tm, MessageType(kind)


def _force(
    fields: tuple[wire.WireField, ...], generation: RobotWare
) -> tuple[bool, bool | None, tuple[float, ...]]:
    body = wire.one_message(fields, 9, "EgmRobot")
    if body is None:
        return False, None, ()
    inner = wire.read_fields(body, "measuredForce")
    number = 1 if generation is RobotWare.SIX else 2
    other = RobotWare.SEVEN if generation is RobotWare.SIX else RobotWare.SIX
    values = wire.doubles(
        tuple(f for f in inner if f.wire_type != wire.VARINT), number, "measuredForce"
    )
    if len(values) != 6:
        elsewhere = any(
            f.number == 3 - number and f.wire_type != wire.VARINT and f.value for f in inner
        )
        raise FormatError(
            f"measuredForce has {len(values)} values as RobotWare {generation.value}, expected 6.",
            hint=f"RobotWare {other.value}: its force stands in the other field."
            if elsewhere
            else f"RobotWare {other.value}, or calibrate the force sensor (FCCalib).",
        )
    active = wire.one_varint(inner, 1, "measuredForce") if number == 2 else None
    return True, None if active is None else bool(active), values


def _fields(
    fields: tuple[wire.WireField, ...], number: int, what: str
) -> tuple[wire.WireField, ...]:
    body = wire.one_message(fields, number, what)
    return () if body is None else wire.read_fields(body, what)


def _joints(fields: tuple[wire.WireField, ...], what: str) -> tuple[float, ...]:
    values = wire.doubles(_fields(fields, 1, f"{what} joints"), 1, f"{what} joints")
    if len(values) not in (0, 6, 7):
        raise FormatError(f"{what} has {len(values)} joints, expected 6 or 7.")
    return values


def _numbers(
    fields: tuple[wire.WireField, ...], number: int, size: int, what: str
) -> tuple[float, ...] | None:
    """A message of required doubles 1..size, or None where it does not stand."""
    body = wire.one_message(fields, number, what)
    if body is None:
        return None
    inner = wire.read_fields(body, what)
    found = [wire.one_double(inner, i, what) for i in range(1, size + 1)]
    values = tuple(v for v in found if v is not None)
    if len(values) != size:
        raise FormatError(f"{what}: {len(values)} of {size} numbers in field {number}.")
    return values


def _pose(fields: tuple[wire.WireField, ...]) -> EgmPose | None:
    inner = _fields(fields, 2, "cartesian")
    xyz = _numbers(inner, 1, 3, "cartesian")
    if xyz is None:
        return None
    quat, euler = _numbers(inner, 2, 4, "cartesian"), _numbers(inner, 3, 3, "cartesian")
    return EgmPose(xyz_mm=xyz, quat_wxyz=quat, euler_deg=euler)


def _matrix(printed: EgmPose | None) -> tuple[Array, Flag]:
    if printed is None or (printed.euler_deg is None and printed.quat_wxyz is None):
        return unknown_pose(), Flag.NONE
    turn = np.array(printed.euler_deg or printed.quat_wxyz)
    xyz = np.array(printed.xyz_mm)
    if not (np.isfinite(turn).all() and np.isfinite(xyz).all()):
        return unknown_pose(), Flag.NOT_FINITE
    if printed.euler_deg is not None:
        return pose(matrix_from_abc(turn[::-1] * DEG), xyz * MM), Flag.NONE
    if not abs(math.hypot(*turn.tolist()) - 1.0) <= _QUAT_OFF:
        return unknown_pose(), Flag.IMPLAUSIBLE
    return pose(matrix_from_quat_wxyz(turn), xyz * MM), Flag.NONE


def _clock(fields: tuple[wire.WireField, ...]) -> tuple[int, int] | None:
    inner = _fields(fields, 4, "time")
    second, microsecond = (wire.one_varint(inner, i, "time") for i in (1, 2))
    if second is None or microsecond is None:
        return None
    if microsecond >= 1_000_000 or second >= 1 << 40:
        raise FormatError(f"time {second} s {microsecond} us, expected below 1000000 us.")
    return second, microsecond


def _time(robot: EgmRobot) -> float:
    if robot.clock is None:
        return robot.tm_ms * 1e-3
    return robot.clock[0] + robot.clock[1] * 1e-6


def _state(fields: tuple[wire.WireField, ...], number: int, kind: type[_State]) -> _State | None:
    body = wire.one_message(fields, number, kind.__name__)
    if body is None:
        return None
    value = wire.one_varint(wire.read_fields(body, kind.__name__), 1, kind.__name__)
    if value is None or value not in kind.__members__.values():
        raise FormatError(f"{kind.__name__} {value}, expected 0 to {max(kind)}.")
    return kind(value)


def _written_header(seqno: int, tm_ms: int, kind: MessageType) -> bytes:
    body = wire.write_varint(1, seqno % (1 << 32)) + wire.write_varint(2, tm_ms % (1 << 32))
    return wire.write_message(1, body + wire.write_varint(3, kind))


def _written_three(values: tuple[float, ...]) -> bytes:
    return b"".join(wire.write_double(i + 1, value) for i, value in enumerate(values))


def _written_pose(printed: EgmPose) -> bytes:
    out = wire.write_message(1, _written_three(printed.xyz_mm))
    for number, values in ((2, printed.quat_wxyz), (3, printed.euler_deg)):
        if values is not None:
            out += wire.write_message(number, _written_three(values))
    return out


def _finite(values: tuple[float, ...] | list[float], what: str) -> None:
    if not all(math.isfinite(v) for v in values):
        raise ShapeError(f"{what} {list(values)}, expected finite numbers.")
