"""ABB EGM against bytes written by hand from egm.proto, both generations."""

import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from online_cases import (
    EGM_BARE,
    EGM_JOINT_TARGET,
    EGM_POSE_TARGET,
    EGM_SEVEN,
    EGM_SIX,
    FORCE,
    JOINTS,
    flipped,
)  # fmt: skip

from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, RobotrueError, ShapeError
from robotrue.online import egm
from robotrue.online.blocks import Flag
from robotrue.online.egm import RobotWare
from robotrue.online.robot_correction import Correction, CorrectionMode

BOTH = [(RobotWare.SIX, EGM_SIX), (RobotWare.SEVEN, EGM_SEVEN)]


def _joints(*robots):
    return egm.egm_joint_block([(robot, 1.25, Flag.NONE) for robot in robots])


def _force(*robots, frame="sensor"):
    return egm.egm_force_block([(robot, 1.25, Flag.NONE) for robot in robots], frame)


@pytest.mark.parametrize(("generation", "data"), BOTH)
def test_a_message_written_by_hand(generation, data):
    robot = egm.read_robot(data, generation)
    assert (robot.seqno, robot.tm_ms) == (300, 4000)
    assert robot.joints_deg == JOINTS
    assert robot.force == FORCE
    assert robot.motors is egm.MotorState.ON
    assert robot.guidance is egm.GuidanceState.RUNNING
    assert robot.rapid is egm.RapidState.RUNNING
    assert robot.converged is True
    joints = _joints(robot)
    assert joints.valid.all()
    assert joints.controller_time.tolist() == [4.0]
    np.testing.assert_allclose(joints.joints, [np.array(JOINTS) * DEG])
    np.testing.assert_allclose(joints.T_frame_tool[0, :3, 3], [1.0, 0.0, 0.5])
    np.testing.assert_array_equal(_force(robot).wrench, [FORCE])
    assert egm.write_robot(robot, generation) == data


@pytest.mark.parametrize(
    ("generation", "data", "other"),
    [(RobotWare.SEVEN, EGM_SIX, "RobotWare 6"), (RobotWare.SIX, EGM_SEVEN, "RobotWare 7")],
)
def test_the_other_generation_is_refused_by_name(generation, data, other):
    with pytest.raises(FormatError, match=f"0 values.*expected 6.*{other}"):
        egm.read_robot(data, generation)


@pytest.mark.parametrize("generation", RobotWare)
def test_a_force_message_without_values_is_refused(generation):
    with pytest.raises(FormatError, match=r"measuredForce has 0 values"):
        egm.read_robot(EGM_BARE + b"\x4a\x00", generation)


def test_no_force_is_no_zero_force():
    robot = egm.read_robot(EGM_BARE, RobotWare.SIX)
    assert not robot.force_sent
    with pytest.raises(FormatError, match="without a measured force"):
        _force(robot)


def test_packed_doubles_read_alike():
    body = struct.pack("<6d", *FORCE)
    packed = EGM_BARE + bytes([9 << 3 | 2, 2 + len(body), 2 << 3 | 2, len(body)]) + body
    assert egm.read_robot(packed, RobotWare.SEVEN).force == FORCE


def test_euler_angles_win_over_the_quaternion():
    pose = egm.EgmPose(
        xyz_mm=(0.0, 0.0, 0.0), quat_wxyz=(1.0, 0.0, 0.0, 0.0), euler_deg=(0.0, 0.0, 90.0)
    )
    sent = egm.write_robot(
        egm.EgmRobot(seqno=1, tm_ms=1, joints_deg=JOINTS, pose=pose), RobotWare.SIX
    )
    T = _joints(egm.read_robot(sent, RobotWare.SIX)).T_frame_tool[0]
    np.testing.assert_allclose(T[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)


def test_values_that_are_not_finite_are_marked_and_gone():
    robot = egm.EgmRobot(
        seqno=1,
        tm_ms=1,
        joints_deg=(math.nan, *JOINTS[1:]),
        force_sent=True,
        force=(math.inf, *FORCE[1:]),
        pose=egm.EgmPose(xyz_mm=(1.0, 2.0, 3.0), quat_wxyz=(0.5, 0.0, 0.0, 0.0)),
    )
    back = egm.read_robot(egm.write_robot(robot, RobotWare.SEVEN), RobotWare.SEVEN)
    sound = replace(back, joints_deg=JOINTS, pose=None, force=FORCE)
    joints = _joints(back, sound)
    assert joints.flags.tolist() == [Flag.NOT_FINITE | Flag.IMPLAUSIBLE, Flag.NONE]
    assert np.isnan(joints.T_frame_tool).all()
    force = _force(back, sound, frame="tool")
    assert force.flags.tolist() == [Flag.NOT_FINITE, Flag.NONE]
    assert np.isnan(force.wrench[0, 0])


def test_inactive_force_control_and_motors_are_said():
    robot = egm.EgmRobot(
        seqno=1,
        tm_ms=1,
        joints_deg=JOINTS,
        motors=egm.MotorState.OFF,
        force_sent=True,
        force_active=False,
        force=FORCE,
    )
    assert _joints(robot).flags.tolist() == [Flag.INACTIVE]
    assert _force(robot, frame="tool").flags.tolist() == [Flag.INACTIVE]


def test_what_is_sent_reads_back():
    seqno, joints, pose = egm.read_target(EGM_JOINT_TARGET)
    assert (seqno, joints, pose) == (5, JOINTS, None)
    _, joints, pose = egm.read_target(EGM_POSE_TARGET)
    assert joints == ()
    assert pose is not None
    np.testing.assert_allclose(pose.xyz_mm, [1000.0, 2000.0, 3000.0])
    assert pose.quat_wxyz == (1.0, 0.0, 0.0, 0.0)
    shift = Correction(
        shift=np.array([0.1, -0.2, 0.3]) * MM, turn=np.zeros(3), mode=CorrectionMode.ABSOLUTE
    )
    sent = egm.write_path_correction(7, 28, shift, 0.012)
    seqno, xyz, age = egm.read_path_correction(sent)
    assert (seqno, age) == (7, 12)
    np.testing.assert_allclose(xyz, [0.1, -0.2, 0.3])
    with pytest.raises(FormatError, match="PATH_CORRECTION, expected CORRECTION"):
        egm.read_target(sent)


def test_what_cannot_be_sent_raises():
    turned = Correction(
        shift=np.zeros(3), turn=np.array([0, 0, 1e-3]), mode=CorrectionMode.ABSOLUTE
    )
    with pytest.raises(ShapeError, match="x, y, z only"):
        egm.write_path_correction(1, 1, turned, 0.0)


@pytest.mark.parametrize(("generation", "data"), BOTH)
def test_a_message_cut_short_never_gives_another_force(generation, data):
    for end in range(len(data)):
        try:
            robot = egm.read_robot(data[:end], generation)
        except RobotrueError:
            continue
        assert robot.force in ((), FORCE)
        assert robot.joints_deg in ((), JOINTS)


@pytest.mark.parametrize(("generation", "data"), BOTH)
def test_one_flipped_bit_raises_or_changes_one_thing(generation, data):
    whole = egm.read_robot(data, generation)
    refused = 0
    for damaged in flipped(data):
        try:
            robot = egm.read_robot(damaged, generation)
            if robot.joints_deg:
                _joints(robot)
        except RobotrueError:
            refused += 1
            continue
        changed = sum(
            getattr(robot, name) != getattr(whole, name)
            for name in (
                "seqno",
                "tm_ms",
                "joints_deg",
                "pose",
                "motors",
                "guidance",
                "force",
                "rapid",
            )
        )
        assert changed <= 1 or not robot.joints_deg or not robot.force
    assert refused > 300  # the rest are bits of numbers, or fields that became unknown


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=300), st.sampled_from(RobotWare))
def test_anything_else_raises_our_own_error(data, generation):
    for read in (
        lambda d: egm.read_robot(d, generation),
        egm.read_target,
        egm.read_path_correction,
    ):
        try:
            read(data)
        except RobotrueError:
            continue


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(*[st.floats(-400, 400)] * 6),
    st.tuples(*[st.floats(-5e3, 5e3)] * 6),
    st.sampled_from(RobotWare),
)
def test_round_trip(seqno, joints, force, generation):
    robot = egm.EgmRobot(
        seqno=seqno, tm_ms=seqno, joints_deg=joints, force_sent=True, force=force, clock=(9, 5)
    )
    assert egm.read_robot(egm.write_robot(robot, generation), generation) == robot
