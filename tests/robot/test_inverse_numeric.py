import numpy as np
import pytest

from robotrue.core.rotations import wrap
from robotrue.errors import ShapeError
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.inverse_numeric import all_solutions, solve, solve_global
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm

from .arms import TOOL, arm, heavy, odd_arm, random_errors, random_joints


def _loaded(name, count, seed):
    """An arm with errors and compliance under its own weight, payload and a wrench per pose."""
    rng = np.random.default_rng(seed)
    robot = heavy(arm(name), seed).with_tool(TOOL)
    errors = random_errors(robot, seed)
    errors[parameter_slice(robot.dof, "compliance")] = 10.0 ** rng.uniform(-6.5, -5.5, robot.dof)
    load = Load(
        mass=np.array([80.0]),
        com=np.array([[0.1, 0.0, 0.2]]),
        wrench=rng.normal(size=(count, 6)) * [300, 300, 300, 50, 50, 50],
    )
    return robot.with_errors(errors), load


@pytest.mark.parametrize("name", ["kr160", "irb6660", "ur10", "tx2-90l"])
def test_compliant_calibrated_arm_below_a_nanometre(name):
    robot, load = _loaded(name, 300, 1)
    joints = random_joints(robot, 300, 2)
    joints = wrap(joints) * 0.9
    poses = deflect_arm(robot, joints, load)[0].transforms
    seed = joints + np.random.default_rng(3).normal(size=joints.shape) * 5e-3
    found = solve(robot, poses, seed, load=load)
    assert found.converged.all()
    again = deflect_arm(robot, found.joints, load)[0].transforms
    assert np.abs(again - poses)[:, :3].max() < 1e-9
    assert np.abs(found.residual).max() < 1e-10


def test_nominal_seed_comes_back_from_far():
    robot = preset("kr160")
    joints = random_joints(robot, 200, 4) * 0.8
    poses = forward(robot, joints)
    found = solve(robot, poses, joints + 0.2)
    assert found.converged.mean() > 0.98
    assert (
        np.abs(forward(robot, found.joints[found.converged]) - poses[found.converged]).max() < 1e-9
    )


def test_singular_seed_and_singular_pose():
    """A straight wrist in a vertical plane: two joint axes coincide to the last digit."""
    robot = preset("kr160")
    straight = np.zeros((1, 6))
    pose = forward(robot, straight)
    stays = solve(robot, pose, straight)
    assert stays.converged[0]
    assert stays.iterations[0] == 0
    away = solve(robot, forward(robot, np.full((1, 6), 0.1)), straight)
    assert away.converged[0]
    back = solve(robot, pose, np.full(6, 0.05), tolerance=1e-9)
    assert back.converged[0]


def test_arm_of_four_joints_goes_where_it_can():
    robot = odd_arm("dh", dof=4)
    joints = random_joints(robot, 20, 8) * 0.5
    found = solve(robot, forward(robot, joints), joints + 0.01)
    assert found.converged.all()
    np.testing.assert_allclose(found.joints, joints, atol=1e-7)


def test_out_of_reach_is_said_not_hidden():
    robot = preset("ur5")
    pose = np.eye(4)[None].copy()
    pose[0, 0, 3] = 3.0
    found = solve(robot, pose, np.full(6, 0.3))
    assert not found.converged[0]
    assert np.linalg.norm(found.residual[0, :3]) > 1.0
    assert not solve_global(robot, pose, seeds=8).converged[0]


@pytest.mark.parametrize("name", ["ur5", "ur10"])
def test_global_finds_the_posture_of_a_ur(name):
    robot = preset(name)
    joints = random_joints(robot, 25, 5) * 0.9
    poses = forward(robot, joints)
    found = solve_global(robot, poses, near=joints)
    assert found.converged.all()
    assert np.abs(found.joints - joints).max() < 1e-5
    counts = [len(option) for option in all_solutions(robot, poses)]
    assert set(counts) <= {2, 4, 6, 8}


def test_global_finds_the_branches_of_an_arm_with_closed_ones():
    robot = preset("gp225")
    joints = random_joints(robot, 6, 6)
    poses = forward(robot, joints)
    closed = inverse_branches(robot, poses)
    for known, found in zip(closed, all_solutions(robot, poses, seeds=128), strict=True):
        for row in known[~np.isnan(known[:, 0])]:
            assert np.abs(wrap(found - row)).max(axis=1).min() < 1e-6


def test_global_respects_the_limits():
    robot = preset("kr160")
    poses = forward(robot, random_joints(robot, 10, 7))
    found = solve_global(robot, poses)
    kept = found.joints[found.converged]
    assert len(kept) >= 9
    assert (kept >= robot.limits[:, 0] - 1e-6).all()
    assert (kept <= robot.limits[:, 1] + 1e-6).all()


def test_wrong_shape_is_refused():
    with pytest.raises(ShapeError, match=r"\(4, 4\), expected \(any, 4, 4\)"):
        solve(preset("kr160"), np.eye(4), np.zeros(6))
