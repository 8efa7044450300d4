from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ReachError, ShapeError
from robotrue.robot.forward import forward
from robotrue.robot.inverse import (
    branch_of,
    branches_of,
    inverse,
    inverse_batch,
    inverse_branches,
    inverse_path,
)
from robotrue.robot.opw import opw_forward, opw_geometry
from robotrue.robot.presets import preset

from .arms import SPHERICAL, TOOL, odd_arm, random_joints, worst_of_branches


@pytest.mark.parametrize("name", SPHERICAL)
def test_every_branch_reaches_the_pose_and_one_is_the_seed(name):
    robot = preset(name)
    joints = random_joints(robot, 4000, 1)
    poses = forward(robot, joints)
    found = inverse_branches(robot, poses, reference=joints)
    worst, exists = worst_of_branches(robot, poses, found)
    assert worst < 1e-12
    nearest = np.nanmin(np.abs(found - joints[:, None]).max(axis=2), axis=1)
    assert nearest.max() < 1e-8
    assert 6.0 < exists.sum(axis=1).mean() <= 8.0
    for branch in range(8):
        here = exists[:, branch]
        assert (branches_of(robot, found[here, branch]) == branch).all()


@pytest.mark.parametrize("name", SPHERICAL)
def test_nearest_to_the_seed_is_the_seed_with_its_turns(name):
    robot = preset(name).with_tool(TOOL)
    joints = random_joints(robot, 2000, 2)
    found = inverse_batch(robot, forward(robot, joints), near=joints)
    assert np.abs(found - joints).max() < 1e-8


@pytest.mark.parametrize("name", SPHERICAL)
def test_solutions_stay_inside_the_limits(name):
    robot = preset(name)
    poses = forward(robot, random_joints(robot, 500, 3))
    for branch in range(8):
        found = inverse_batch(robot, poses, branch=branch)
        kept = found[~np.isnan(found[:, 0])]
        assert (kept >= robot.limits[:, 0] - 1e-9).all()
        assert (kept <= robot.limits[:, 1] + 1e-9).all()


def test_modified_dh_and_senses_do_not_matter():
    """The KR160 as modified DH, joints 2 and 5 reversed: same branches, same poses."""
    robot = preset("kr160")
    modified = replace(
        robot,
        convention="mdh",
        a=np.concatenate([[0.0], robot.a[:-1]]),
        alpha=np.concatenate([[0.0], robot.alpha[:-1]]),
        joint_map=np.diag([1.0, -1, 1, 1, -1, 1]),
        limits=np.tile([-2.0 * np.pi, 2.0 * np.pi], (6, 1)),
    )
    joints = random_joints(robot, 50, 4)
    other = joints @ modified.joint_map
    np.testing.assert_allclose(forward(modified, other), forward(robot, joints), atol=1e-12)
    geometry = opw_geometry(modified)
    np.testing.assert_allclose(opw_forward(geometry, other), forward(robot, joints), atol=1e-12)
    found = inverse_batch(modified, forward(robot, joints), near=other)
    np.testing.assert_allclose(found, other, atol=1e-8)


def test_arms_of_another_kind_are_refused():
    assert opw_geometry(preset("ur5")) is None
    with pytest.raises(ConfigurationError, match="no closed branches"):
        inverse(odd_arm("dh"), np.eye(4))


def test_general_arms_are_not_ortho_parallel():
    assert opw_geometry(odd_arm("dh")) is None
    skewed = preset("kr160")
    skewed = replace(skewed, alpha=skewed.alpha + np.array([0, 1e-6, 0, 0, 0, 0]))
    assert opw_geometry(skewed) is None


def test_errors_do_not_change_the_nominal_inverse():
    robot = preset("kr160")
    joints = random_joints(robot, 20, 5)
    poses = forward(robot, joints)
    wrong = robot.with_errors(np.full(len(robot.errors), 1e-3))
    np.testing.assert_array_equal(
        inverse_batch(wrong, poses, near=joints), inverse_batch(robot, poses, near=joints)
    )


def test_full_stretch_keeps_its_digits():
    robot = preset("kr160")
    angles = opw_geometry(robot)
    lead = np.arctan2(angles.a2, angles.c3)
    stretched = angles.joints(np.array([0.3, 0.7, -lead, 0.4, 0.6, 0.5]))
    pose = forward(robot, stretched[None])
    found = inverse_batch(robot, pose, near=stretched)
    assert np.abs(forward(robot, found) - pose).max() < 1e-12


def test_straight_wrist_keeps_the_axis_of_before():
    robot = preset("kr160")
    joints = np.array([0.1, 0.2, 0.3, 0.4, 0.0, 0.5])
    near = np.array([0.1, 0.2, 0.3, 1.4, 0.0, 0.0])
    found = inverse(robot, forward(robot, joints[None])[0], near=near)
    np.testing.assert_allclose(found, [0.1, 0.2, 0.3, 1.4, 0.0, -0.5], atol=1e-9)


def test_wrist_point_over_axis_1_keeps_the_axis_of_before():
    robot = preset("irb120")
    joints = np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.0])
    geometry = opw_geometry(robot)
    # Upper arm back, forearm forward until the wrist point stands over the base.
    fold = np.arctan2(geometry.c3, -geometry.a2)
    reach = np.hypot(geometry.a2, geometry.c3)
    lean = -np.arcsin(reach * np.sin(1.0) / geometry.c2) if reach < geometry.c2 else -0.9
    up = np.arcsin(np.clip(-geometry.c2 * np.sin(lean) / reach, -1, 1))
    joints[1], joints[2] = lean, up - lean - fold
    joints[4] = 0.5
    ahead, _ = geometry.wrist_point(geometry.angles(joints))
    assert abs(ahead) < 1e-12
    found = inverse(robot, forward(robot, joints[None])[0], near=joints)
    np.testing.assert_allclose(found, joints, atol=1e-7)


def test_path_keeps_branch_and_turns_continuous():
    robot = preset("kr160").with_tool(TOOL)
    s = np.linspace(0.0, 1.0, 400)[:, None]
    start = np.array([-0.5, 0.1, 0.2, 2.9, -0.7, 5.5])
    path = start + s * np.array([1.0, 0.2, -0.3, 1.5, -0.5, -8.0])
    found = inverse_path(robot, forward(robot, path), near=start)
    np.testing.assert_allclose(found, path, atol=1e-8)


def test_path_that_leaves_a_limit_gives_nan_and_no_jump():
    robot = preset("kr160")
    start = np.array([-0.5, 0.1, 0.2, 0.5, -0.7, 5.5])
    path = start + np.linspace(0.0, 1.0, 50)[:, None] * np.array([0, 0, 0, 0, 0, 1.5])
    found = inverse_path(robot, forward(robot, path), near=start)
    beyond = path[:, 5] > robot.limits[5, 1]
    assert beyond.any()
    assert (np.isnan(found).all(axis=1) == beyond).all()
    np.testing.assert_allclose(found[~beyond], path[~beyond], atol=1e-8)


def test_path_out_of_reach_gives_nan():
    far = np.repeat(np.eye(4)[None], 5, axis=0)
    far[:, 0, 3] = 9.0
    assert np.isnan(inverse_path(preset("kr160"), far)).all()
    assert np.isnan(inverse_batch(preset("kr160"), far)).all()


def test_out_of_reach_message():
    far = np.eye(4)
    far[0, 3] = 5.0
    with pytest.raises(ReachError) as caught:
        inverse(preset("kr160"), far)
    assert str(caught.value) == (
        "KUKA KR160 R1570 cannot reach this pose: the wrist point is 5.0509 m from the middle of "
        "the shoulder, the stretched arm is 1.5734 m long. "
        "Try: check the tool and the work frame, or move the part."
    )


def test_limit_message_names_joint_and_value():
    robot = preset("kr160")
    tight = replace(robot, limits=robot.limits * np.array([1, 1, 0.01, 1, 1, 1])[:, None])
    joints = np.full(6, 0.3)
    with pytest.raises(ReachError, match=r"joint 3 at 17\.189 deg, allowed -0\.850 to 2\.280 deg"):
        inverse(tight, forward(robot, joints[None])[0])


def test_given_branch_is_taken():
    robot = preset("kr160")
    joints = np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6])
    pose = forward(robot, joints[None])[0]
    own = branch_of(robot, joints)
    np.testing.assert_allclose(inverse(robot, pose, branch=own, near=joints), joints, atol=1e-9)
    twin = inverse(robot, pose, branch=own ^ 4, near=joints)
    assert twin[4] == pytest.approx(0.5)
    assert abs(abs(twin[3] - joints[3]) - 180 * DEG) < 1e-9


def test_a_pose_with_nan_is_refused():
    with pytest.raises(ShapeError):
        inverse(preset("kr160"), np.full((4, 4), np.nan))
