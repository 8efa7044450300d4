"""Arms with axes 2 to 4 parallel: closed branches, their numbers, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.rotations import wrap
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ReachError
from robotrue.robot.forward import forward
from robotrue.robot.inverse import (
    branches_of,
    inverse,
    inverse_batch,
    inverse_branches,
    inverse_path,
    require_opw,
)
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel
from robotrue.robot.parallel_arm import parallel_geometry
from robotrue.robot.presets import preset

from .arms import SPHERICAL, TOOL, random_joints, worst_of_branches

UR10 = preset("UR10")


def other_senses() -> RobotModel:
    """A UR10 whose axes 3 and 5 count the other way, as a joint map says it."""
    return replace(UR10, joint_map=np.diag([1.0, 1.0, -1.0, 1.0, -1.0, 1.0]))


@pytest.mark.parametrize("robot", [preset("UR5"), UR10, other_senses()])
def test_every_branch_reaches_the_pose_and_one_is_the_seed(robot: RobotModel) -> None:
    joints = random_joints(robot, 4000, 1)
    poses = forward(robot, joints)
    found = inverse_branches(robot, poses, reference=joints)
    worst, exists = worst_of_branches(robot, poses, found)
    assert worst < 1e-11
    assert np.nanmin(np.abs(found - joints[:, None]).max(axis=2), axis=1).max() < 1e-6
    assert exists.sum(axis=1).mean() > 6.0
    for branch in range(8):
        here = exists[:, branch]
        assert (branches_of(robot, found[here, branch]) == branch).all()


def test_one_pose_agrees_with_the_numeric_inverse() -> None:
    robot = UR10.with_tool(TOOL)
    joints = random_joints(robot, 20, 3)
    for q, T in zip(joints, forward(robot, joints), strict=True):
        near = q + 0.02
        numeric = solve(robot, T[None], near[None]).joints[0]
        assert np.abs(wrap(inverse(robot, T, near=near) - numeric)).max() < 1e-6


def test_measures_are_the_determinant_of_the_jacobian() -> None:
    arm = parallel_geometry(UR10)
    assert arm is not None
    joints = random_joints(UR10, 200, 4)
    step, columns = 1e-6, []
    middle = forward(UR10, joints)
    for axis in range(6):
        there = forward(UR10, joints + step * np.eye(6)[axis])
        turn = there[:, :3, :3] @ np.swapaxes(middle[:, :3, :3], 1, 2)
        spin = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
        columns.append(np.hstack([there[:, :3, 3] - middle[:, :3, 3], spin]) / step)
    determinant = np.abs(np.linalg.det(np.stack(columns, axis=2)))
    product = arm.singular_measures(joints).prod(axis=1)
    np.testing.assert_allclose(determinant, product * np.prod(np.abs(arm.links[1:3])), rtol=1e-3)


def test_a_straight_wrist_keeps_the_last_axis() -> None:
    joints = np.array([0.3, -1.2, 1.1, -0.4, 0.0, 0.7])
    pose = forward(UR10, joints[None])
    found = inverse_batch(UR10, pose, near=joints)[0]
    np.testing.assert_allclose(found, joints, atol=1e-7)


def test_a_path_keeps_its_branch_and_its_turns() -> None:
    t = np.linspace(0.0, 1.0, 200)[:, None]
    joints = np.array([0.2, -1.4, 1.5, -1.2, -1.4, 2.5]) + t * [0.8, 0.3, -0.4, 0.3, 0.5, 2.0]
    found = inverse_path(UR10, forward(UR10, joints), near=joints[0])
    np.testing.assert_allclose(found, joints, atol=1e-8)


def test_out_of_reach_says_how_far() -> None:
    far = np.eye(4)
    far[:3, 3] = 2.0, 0.0, 0.3
    with pytest.raises(ReachError, match=r"UR10 cannot reach this pose: .* m long"):
        inverse(UR10, far)


def test_limits_hold() -> None:
    tight = replace(UR10, limits=np.tile([-100.0 * DEG, 100.0 * DEG], (6, 1)))
    poses = forward(UR10, random_joints(UR10, 300, 5))
    found = inverse_batch(tight, poses)
    kept = found[~np.isnan(found[:, 0])]
    assert 0 < len(kept) < 300
    assert np.abs(kept).max() <= 100.0 * DEG + 1e-9


@pytest.mark.parametrize("name", SPHERICAL)
def test_arms_with_a_spherical_wrist_are_not_of_this_kind(name: str) -> None:
    assert parallel_geometry(preset(name)) is None


def test_a_calibrated_table_is_not_of_this_kind() -> None:
    bent = replace(UR10, alpha=UR10.alpha + np.array([0.0, 1e-4, 0.0, 0.0, 0.0, 0.0]))
    assert parallel_geometry(bent) is None
    with pytest.raises(ConfigurationError, match="neither a spherical wrist nor parallel axes"):
        inverse(bent, np.eye(4))


def test_configuration_words_still_need_a_spherical_wrist() -> None:
    with pytest.raises(ConfigurationError, match="not an ortho-parallel arm"):
        require_opw(UR10)
