"""Postures in which touches of one fixed point show every axis that lost its zero.

The tool comes from above, leaned by up to a stated angle to any side, turned about itself, with the
arm in every configuration that reaches. Of these the touches are chosen one by one: each the one
that takes the most from the sum of the variances of the zeros.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.new_rows import NUISANCE_SD, whiten
from robotrue.calibration.probing import before_touching
from robotrue.calibration.probing_estimate import ProbingSettings
from robotrue.calibration.touches import touch_rows
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.arm_scene import Scene, collisions
from robotrue.planning.order import short_order
from robotrue.planning.probing_candidates import TRACKER
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.inverse_numeric import all_solutions
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.opw import opw_geometry

ATTITUDES: Final = 160
"""Attitudes drawn for an arm with a closed inverse; each has up to eight configurations."""
SEARCHED: Final = 24
"""The same for an arm whose configurations have to be searched."""
MARGIN: Final = 3.0 * DEG
"""Kept from the joint limits."""
LOST: Final = 0.3 * DEG
"""A lost zero, one standard deviation."""
ROUND: Final = 1e-3 * DEG
"""A posture is stated to this."""


def plan_mastering(
    arm: ErrorModel,
    robot: RobotModel,
    scene: Scene,
    point: Array,
    count: int,
    *,
    settings: ProbingSettings,
    lean: float,
    seed: int,
) -> ProbingSet:
    """Returns the touches to make, with their joints, in an order of short travel.

    Args:
        arm: Prior of the arm.
        robot: The nominal arm with the tool that touches.
        scene: Arm and surroundings; colliding postures are left out.
        point: (3,) m in base, roughly.
        count: Number of touches.
        settings: Noise of the touches.
        lean: rad, largest angle of the tool off straight down.
        seed: Of the attitudes.

    Raises:
        ConfigurationError: Fewer than 8 touches, or a lean outside 5 to 180 deg.
        ReachError: Fewer postures than touches reach the point.
    """
    if count < 8 or not 5.0 * DEG <= lean <= np.pi:
        raise ConfigurationError(
            f"{count} touches with a lean of {lean / DEG:g} deg, expected 8 or more and 5 to 180.",
            hint="-n 16 --tool-lean-deg 60",
        )
    joints = _reach(robot.nominal(), point, lean, seed)
    if len(joints):
        hit = [bad for what, bad in collisions(scene, joints).items() if not what.endswith(TRACKER)]
        joints = joints[~np.any(hit, axis=0)] if hit else joints
    if len(joints) < count:
        x, y, z = point / MM
        raise ReachError(
            f"{len(joints)} postures reach {x:.0f}, {y:.0f}, {z:.0f} mm in base, {count} touches "
            "are requested.",
            hint="a point nearer to the middle of the work area, or a larger --tool-lean-deg.",
        )
    chosen = _choose(arm, joints, point, count, settings)
    joints = joints[chosen]
    joints = joints[short_order(joints)]
    return ProbingSet(
        names=tuple(f"touch {k + 1}" for k in range(count)),
        point=np.zeros((count, 3)),
        joints=joints,
    )


def _reach(robot: RobotModel, point: Array, lean: float, seed: int) -> Array:
    """Joints (m, dof) rad that bring the tip to the point, in many attitudes."""
    rng = np.random.default_rng([seed, 53])
    closed = opw_geometry(robot)
    n = ATTITUDES if closed is not None else SEARCHED
    # Even over the cap of directions, then any turn about the tool axis.
    away = np.arccos(1.0 - rng.uniform(0.0, 1.0, n) * (1.0 - np.cos(lean)))
    side, spin = rng.uniform(0.0, 2.0 * np.pi, (2, n))
    down = matrix_from_rotation_vector(np.array([np.pi, 0.0, 0.0]))
    tilt = matrix_from_rotation_vector(
        away[:, None] * np.stack([np.cos(side), np.sin(side), np.zeros(n)], axis=1)
    )
    turn = matrix_from_rotation_vector(spin[:, None] * np.array([0.0, 0.0, 1.0]))
    wanted = pose(tilt @ down @ turn, np.tile(point, (n, 1)))
    if closed is not None:
        found = inverse_branches(robot, wanted @ inverse(robot.T_flange_tool))
        joints = found.reshape(-1, robot.dof)
    else:
        joints = np.concatenate(all_solutions(robot, wanted))
    joints = np.round(joints[~np.isnan(joints).any(axis=1)] / ROUND) * ROUND
    low, high = robot.limits[:, 0] + MARGIN, robot.limits[:, 1] - MARGIN
    able = ((joints >= low) & (joints <= high)).all(axis=1)
    at = forward(robot, joints)[:, :3, 3]
    return np.asarray(joints[able & (np.linalg.norm(at - point, axis=1) < MM)])


def _choose(
    arm: ErrorModel, joints: Array, point: Array, count: int, settings: ProbingSettings
) -> IntArray:
    """Returns the rows (count,) that determine the zeros best, greedily."""
    columns, covariance, theta = _linearise(arm, joints, point, settings)
    gain = columns @ covariance  # (m, 3, p)
    left = np.ones(len(joints), dtype=bool)
    chosen = []
    for _ in range(count):
        spread = gain @ np.swapaxes(columns, 1, 2) + np.eye(3)
        zeros = gain[:, :, theta]
        information = np.einsum("mit,mij,mjt->m", zeros, np.linalg.inv(spread), zeros)
        best = int(np.argmax(np.where(left, information, -np.inf)))
        chosen.append(best)
        left[best] = False
        gain = gain - (columns @ gain[best].T) @ np.linalg.solve(spread[best], gain[best])
    return np.array(chosen)


def _linearise(
    arm: ErrorModel, joints: Array, point: Array, settings: ProbingSettings
) -> tuple[Array, Array, slice]:
    """Returns whitened columns (m, 3, p), prior covariance (p, p), and the place of the zeros."""
    belief: Belief = before_touching(arm, settings)
    n = len(joints)
    touches = ProbingSet(
        names=("point",) * n,
        point=np.zeros((n, 3)),
        joints=joints,
        part=np.zeros(n, dtype=np.int64),
        sockets=(0,),
    )
    rows = touch_rows(
        belief,
        touches,
        {0: pose(np.eye(3), point)},
        touch_sigma=settings.touch_sigma,
        payload=settings.payload,
    )
    columns, _ = whiten(rows.pieces(belief), belief.noise, np.ones(n))
    theta = parameter_slice(belief.robot.dof, "theta")
    covariance = np.zeros((columns.shape[1],) * 2)
    covariance[: belief.end, : belief.end] = belief.root.T @ belief.root
    covariance[theta, theta] += LOST**2 * belief.robot.joint_map @ belief.robot.joint_map.T
    covariance[belief.end :, belief.end :] = NUISANCE_SD**2 * np.eye(rows.nuisances)
    return columns.reshape(n, 3, -1), covariance, theta
