"""Pinocchio as independent judge: forward kinematics, Jacobian, gravity torque, wrench torque."""

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.units import STANDARD_GRAVITY
from robotrue.robot.forward import forward, joint_jacobian, walk
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset_names
from robotrue.robot.statics import Load, drive_torque
from robotrue.robot.urdf import to_urdf

from .arms import TOOL, arm, heavy, random_errors, random_joints

pin = pytest.importorskip("pinocchio")

ARMS = (*preset_names(), "odd-dh", "odd-mdh")


def _uncoupled(robot):
    """URDF has no parallelogram: the serial arm, and what takes its torques to the drives."""
    return replace(robot, joint_map=np.diag(np.diag(robot.joint_map)))


def _judge(robot, geometry_only=False):
    model = pin.buildModelFromXML(to_urdf(robot, geometry_only=geometry_only))
    model.gravity.linear = np.array([0.0, 0.0, -STANDARD_GRAVITY])
    return model, model.createData(), model.getFrameId("tool0")


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("erroneous", [False, True])
def test_pose_and_jacobian(name, erroneous):
    robot = _uncoupled(arm(name)).with_tool(TOOL)
    if erroneous:
        errors = random_errors(robot, 1)
        errors[parameter_slice(robot.dof, "gear")] = 0.0
        robot = robot.with_errors(errors)
    model, data, tool = _judge(robot)
    joints = random_joints(robot, 25, 2)
    state = walk(robot, joints)
    poses, jacobian = forward(robot, joints), joint_jacobian(robot, state)
    for q, T, J in zip(joints, poses, jacobian, strict=True):
        pin.framesForwardKinematics(model, data, q)
        np.testing.assert_allclose(T, data.oMf[tool].homogeneous, atol=1e-12)
        theirs = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(J, theirs, atol=1e-12)


@pytest.mark.parametrize("name", ARMS)
def test_gravity_payload_and_wrench_torque(name):
    robot = heavy(_uncoupled(arm(name)).with_tool(TOOL), 3)
    model, data, tool = _judge(robot)
    flange = model.getFrameId("flange")
    joints = random_joints(robot, 25, 4)
    com, mass, wrench = np.array([0.1, 0.2, 0.3]), 60.0, np.array([100, -200, 300, 10, 20, -30.0])
    load = Load(mass=np.array([mass]), com=com[None], wrench=wrench[None])
    ours = drive_torque(robot, joints, load)
    place = model.frames[flange].placement
    last = model.frames[flange].parentJoint
    body = pin.Inertia(mass, com, np.zeros((3, 3)))
    model.appendBodyToJoint(last, body, place)
    data = model.createData()
    for q, torque in zip(joints, ours, strict=True):
        gravity = pin.computeGeneralizedGravity(model, data, q)
        lever = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(torque, lever.T @ wrench - gravity, atol=1e-9)


def test_parallel_rod_carries_torque_to_the_drives():
    robot = heavy(arm("irb6660"), 5)
    model, data, _ = _judge(_uncoupled(robot))
    joints = random_joints(robot, 10, 6)
    ours = drive_torque(robot, joints)
    for q, torque in zip(joints, ours, strict=True):
        serial = robot.joint_map @ q
        gravity = pin.computeGeneralizedGravity(model, data, serial)
        np.testing.assert_allclose(torque, -robot.joint_map.T @ gravity, atol=1e-9)
