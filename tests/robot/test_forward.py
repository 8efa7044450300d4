from dataclasses import replace

import numpy as np
import pytest

from robotrue.robot.forward import (
    drive_jacobian,
    forward,
    joint_jacobian,
    parameter_jacobian,
    walk,
)
from robotrue.robot.model import parameter_names, parameter_slice
from robotrue.robot.statics import Load, deflect_arm, weight_torque

from .arms import TOOL, arm, random_errors, random_joints

ARMS = ("kr160", "irb6660", "gp225", "ur10", "odd-dh", "odd-mdh")


def _twist(before, after):
    """Small motion between two poses: translation and left rotation vector, (n, 6)."""
    turn = after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], 1, 2)
    skew = 0.5 * (turn - np.swapaxes(turn, 1, 2))
    rotation = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    return np.concatenate([after[:, :3, 3] - before[:, :3, 3], rotation], axis=1)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("erroneous", [False, True])
def test_pose_only_equals_walk(name, erroneous):
    robot = arm(name).with_tool(TOOL)
    if erroneous:
        robot = robot.with_errors(random_errors(robot, 3))
    joints = random_joints(robot, 5000, 4)
    shift = np.random.default_rng(5).normal(size=joints.shape) * 1e-3
    np.testing.assert_allclose(
        forward(robot, joints, shift), walk(robot, joints, shift).transforms, atol=1e-15
    )


def test_no_poses_is_no_error():
    assert forward(arm("kr160"), np.empty((0, 6))).shape == (0, 4, 4)


@pytest.mark.parametrize("name", ARMS)
def test_joint_jacobian_is_the_difference_quotient(name):
    robot = arm(name).with_errors(random_errors(arm(name), 6))
    joints, step = random_joints(robot, 20, 7), 1e-6
    analytic = joint_jacobian(robot, walk(robot, joints))
    for k in range(robot.dof):
        ahead, back = joints.copy(), joints.copy()
        ahead[:, k] += step
        back[:, k] -= step
        quotient = _twist(forward(robot, back), forward(robot, ahead)) / (2 * step)
        np.testing.assert_allclose(analytic[:, :, k], quotient, atol=2e-9)


@pytest.mark.parametrize("name", ARMS)
def test_drive_jacobian_is_the_difference_quotient(name):
    robot = arm(name).with_errors(random_errors(arm(name), 8))
    joints, step = random_joints(robot, 10, 9), 1e-6
    analytic = drive_jacobian(robot, walk(robot, joints))
    for k in range(robot.dof):
        shift = np.zeros((1, robot.dof))
        shift[0, k] = step
        quotient = _twist(forward(robot, joints, -shift), forward(robot, joints, shift))
        np.testing.assert_allclose(analytic[:, :, k], quotient / (2 * step), atol=2e-9)


@pytest.mark.parametrize("name", ["kr160", "irb6660", "odd-dh", "odd-mdh"])
def test_parameter_jacobian_is_the_difference_quotient(name):
    robot = arm(name)
    robot = robot.with_errors(random_errors(robot, 10, compliance=1e-3))
    joints = random_joints(robot, 8, 11)
    load = Load(
        mass=np.array([40.0]), com=np.array([[0.1, 0.0, 0.2]]), wrench=np.full((1, 6), 100.0)
    )
    state, torque = deflect_arm(robot, joints, load)
    weight = weight_torque(robot, walk(robot.nominal(), joints))
    analytic = parameter_jacobian(robot, state, joints, torque, weight)
    names = parameter_names(robot.dof)
    for k, label in enumerate(names):
        step = 1e-9 if label.startswith("compliance") else 1e-6
        pair = []
        for sign in (-1.0, 1.0):
            errors = robot.errors.copy()
            errors[k] += sign * step
            pair.append(deflect_arm(robot.with_errors(errors), joints, load)[0].transforms)
        quotient = _twist(*pair) / (2 * step)
        scale = max(1.0, np.abs(quotient).max())
        np.testing.assert_allclose(
            analytic[:, :, k], quotient, atol=5e-7 * scale, err_msg=f"{name} {label}"
        )


def test_tool_error_and_tool_are_the_same_motion():
    robot = arm("kr160")
    errors = np.zeros(len(robot.errors))
    place = parameter_slice(6, "tool").start
    errors[place : place + 3] = [0.01, -0.02, 0.03]
    moved = np.eye(4)
    moved[:3, 3] = errors[place : place + 3]
    joints = random_joints(robot, 10, 1)
    np.testing.assert_allclose(
        forward(robot.with_errors(errors), joints),
        forward(replace(robot, T_flange_tool=moved), joints),
        atol=1e-15,
    )
