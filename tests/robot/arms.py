"""Arms for the tests of this room: presets and an arm nobody built, with masses everywhere."""

from dataclasses import replace

import numpy as np

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, moment_slice, parameter_slice
from robotrue.robot.presets import preset, preset_names

SEVEN = ("Franka Panda", "KUKA LBR iiwa 14 R820")
SPHERICAL = tuple(n for n in preset_names() if not n.startswith("UR") and n not in SEVEN)
TOOL = pose_from_xyz_abc(np.array([0.1, -0.05, 0.3]), np.array([0.3, 0.5, -0.2]))


def random_joints(robot, count, seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (count, robot.dof))


def random_errors(robot, seed, compliance=0.0):
    """Errors of a millimetre and a milliradian; arms that give way have moments of some kg m."""
    rng = np.random.default_rng(seed)
    drawn = rng.normal(size=7 * robot.dof + 12) * 1e-3
    drawn[parameter_slice(robot.dof, "compliance")] *= compliance
    errors = np.zeros(len(robot.errors))
    moments = moment_slice(robot.dof)
    errors[np.r_[: moments.start, moments.stop : len(errors)]] = drawn
    errors[moments] = 10.0 * rng.normal(size=2 * robot.dof) * bool(compliance)
    return errors


def heavy(robot, seed):
    rng = np.random.default_rng(seed)
    return replace(
        robot,
        link_mass=rng.uniform(5.0, 200.0, robot.dof),
        link_com=rng.normal(size=(robot.dof, 3)) * 0.2,
    )


def odd_arm(convention, dof=6, seed=5):
    """General geometry, tool, masses, a flipped and a coupled joint."""
    rng = np.random.default_rng(seed)
    rod = np.eye(dof)
    rod[2, 1] = -1.0
    rod[3, 3] = -1.0
    arm = RobotModel(
        name="odd",
        convention=convention,
        theta=rng.uniform(-2, 2, dof),
        d=rng.uniform(-0.5, 0.5, dof),
        a=rng.uniform(-0.5, 0.5, dof),
        alpha=rng.uniform(-2, 2, dof),
        joint_map=rod,
        limits=np.tile([-np.pi, np.pi], (dof, 1)),
        T_flange_tool=TOOL,
    )
    return heavy(arm, seed)


def arm(name):
    return odd_arm(name[4:]) if name.startswith("odd-") else preset(name)


def worst_of_branches(robot, poses, found):
    """Largest error of the poses of all branches (n, 8, 6) that exist; those that do, (n, 8)."""
    exists = ~np.isnan(found).any(axis=2)
    assert (exists == ~np.isnan(found).all(axis=2)).all()
    again = forward(robot, np.nan_to_num(found).reshape(-1, 6)).reshape(len(poses), 8, 4, 4)
    return np.abs(again - poses[:, None])[exists].max(), exists
