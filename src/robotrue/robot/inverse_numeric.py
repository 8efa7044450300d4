"""Numeric inverse kinematics of any arm as it really is: errors, compliance, load, any wrist.

Damped Newton on SE(3) for all poses at once (Levenberg-Marquardt with the damping of each pose
adapted to its own progress). The residual is the tool twist from the arm's present pose to the
target, position in m, rotation vector in rad, in base; the step is J^T (J J^T + damping)^-1
residual.

Source: Levenberg 1944, Marquardt 1963; Sugihara 2011, "Solvability-unconcerned inverse kinematics
by the Levenberg-Marquardt method", for the damping proportional to the squared residual.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import rotation_vector_from_matrix, wrap
from robotrue.errors import ShapeError
from robotrue.robot.forward import ChainState, joint_jacobian
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import NO_LOAD, Load, deflect_arm

TOLERANCE: Final = 1e-10
"""m and rad; the residual at which a pose counts as reached, far below any robot or tracker."""
SEEDS: Final = 64
"""Postures that a search without a seed starts from."""
_DAMPING: Final = 1e-2  # damping over squared residual at the start
_FLOOR: Final = 1e-14  # keeps J J^T regular where the arm is singular to the last digit
_DISTINCT: Final = 1e-4  # rad by which two solutions differ
_TURN: Final = 2.0 * np.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class NumericSolution:
    """Joints found for n poses.

    Attributes:
        joints: (n, dof) rad, the best found also where not converged.
        residual: (n, 6) target minus reached, m and rad, in base.
        converged: (n,) whether position and rotation are both within the tolerance.
        iterations: (n,) steps tried.
    """

    joints: Array
    residual: Array
    converged: BoolArray
    iterations: IntArray


def solve(
    robot: RobotModel,
    T_base_tool: Array,
    seed: Array,
    *,
    load: Load = NO_LOAD,
    tolerance: float = TOLERANCE,
    max_iterations: int = 60,
) -> NumericSolution:
    """Returns the joints near ``seed`` at which the actual, loaded arm takes the poses.

    Joint limits are not enforced: the solution is the one the seed leads to. Turns are kept.

    Args:
        robot: The arm with errors and compliance; call on ``robot.nominal()`` for the controller's.
        T_base_tool: (n, 4, 4).
        seed: (n, dof) or (dof,) rad.
        load: Payload and wrench, one row or n rows, as for
            :func:`robotrue.robot.statics.deflect_arm`.
        tolerance: m and rad, on the length of the position and of the rotation residual.
        max_iterations: Steps tried before a pose is given up.

    Fails when: the pose is out of reach or singular; ``converged`` is then False and the residual
    is the remaining distance.

    Raises:
        ShapeError: Arrays that do not fit each other.
    """
    target = np.asarray(T_base_tool, dtype=np.float64)
    if target.ndim != 3 or target.shape[1:] != (4, 4):
        raise ShapeError(f"T_base_tool has shape {target.shape}, expected (any, 4, 4).")
    n = len(target)
    q = np.array(np.broadcast_to(np.asarray(seed, dtype=np.float64), (n, robot.dof)))
    state, residual = _residual(robot, target, q, load)
    jacobian = joint_jacobian(robot, state)
    factor = np.full(n, _DAMPING)
    iterations = np.zeros(n, dtype=np.int64)
    open_ = np.flatnonzero(~_is_reached(residual, tolerance))
    for _ in range(max_iterations):
        if not len(open_):
            break
        error, lever = residual[open_], jacobian[open_]
        squared = np.sum(error * error, axis=1)
        normal = lever @ np.swapaxes(lever, 1, 2)
        normal += (factor[open_] * squared + _FLOOR)[:, None, None] * np.eye(6)
        step = (np.swapaxes(lever, 1, 2) @ np.linalg.solve(normal, error[..., None]))[..., 0]
        largest = np.abs(step).max(axis=1, keepdims=True)
        trial = q[open_] + step * np.minimum(1.0, 0.5 / np.maximum(largest, 1e-300))
        state, fresh = _residual(robot, target[open_], trial, load.take(open_))
        better = np.sum(fresh * fresh, axis=1) < squared
        won = open_[better]
        q[won], residual[won] = trial[better], fresh[better]
        jacobian[won] = joint_jacobian(robot, state)[better]
        factor[open_] = np.where(better, factor[open_] * 0.1, factor[open_] * 10.0 + 1e-6)
        iterations[open_] += 1
        open_ = open_[~_is_reached(residual[open_], tolerance)]
    return NumericSolution(
        joints=q,
        residual=residual,
        converged=_is_reached(residual, tolerance),
        iterations=iterations,
    )


def _residual(
    robot: RobotModel, target: Array, joints: Array, load: Load
) -> tuple[ChainState, Array]:
    state, _ = deflect_arm(robot, joints, load)
    turn = target[:, :3, :3] @ np.swapaxes(state.rotation, 1, 2)
    twist = [target[:, :3, 3] - state.position, rotation_vector_from_matrix(turn)]
    return state, np.concatenate(twist, axis=1)


def _is_reached(residual: Array, tolerance: float) -> BoolArray:
    position = np.linalg.norm(residual[:, :3], axis=1)
    rotation = np.linalg.norm(residual[:, 3:], axis=1)
    return np.asarray((position <= tolerance) & (rotation <= tolerance))


def solve_global(
    robot: RobotModel,
    T_base_tool: Array,
    *,
    near: Array | None = None,
    seeds: int = SEEDS,
) -> NumericSolution:
    """Returns joints inside the limits for each pose, without a seed: for arms like the UR.

    Every pose is solved from the same ``seeds`` postures, spread evenly over the limits; of the
    solutions inside the limits the nearest to ``near`` is returned, on the nearest turn.

    Args:
        robot: The arm with errors and compliance.
        T_base_tool: (n, 4, 4).
        near: (n, dof) or (dof,) rad; the middle of the limits if not given.
        seeds: Postures to start from.

    Fails when: no posture leads to a solution inside the limits: ``converged`` is False, and the
    pose is out of reach or needs more seeds.
    """
    n = len(T_base_tool)
    middle = robot.limits.mean(axis=1)
    wanted = np.broadcast_to(middle if near is None else np.asarray(near), (n, robot.dof))
    options = all_solutions(robot, T_base_tool, seeds=seeds)
    start, found = np.array(wanted), np.zeros(n, dtype=bool)
    for k, option in enumerate(options):
        turned = _turn_inside(robot, option, wanted[k])
        if len(turned):
            start[k] = turned[np.argmin(np.sum((turned - wanted[k]) ** 2, axis=1))]
            found[k] = True
    # A whole turn is not quite a whole turn where a gear has an error: a last step settles it.
    last = solve(robot, T_base_tool, start)
    return NumericSolution(
        joints=last.joints,
        residual=last.residual,
        converged=last.converged & found,
        iterations=last.iterations,
    )


def all_solutions(robot: RobotModel, T_base_tool: Array, *, seeds: int = SEEDS) -> list[Array]:
    """Returns for each pose the distinct solutions found (m, dof) rad, in (-180, 180] deg.

    Limits are not looked at. Distinct means more than 1e-4 rad apart in some joint.

    Args:
        robot: The arm with errors and compliance.
        T_base_tool: (n, 4, 4).
        seeds: Postures to start from; deterministic, the R_d sequence over the limits.

    Fails when: there are more solutions than the seeds lead to; the list is then incomplete.
    """
    starts = _spread(robot, seeds)
    target = np.repeat(np.asarray(T_base_tool, dtype=np.float64), seeds, axis=0)
    index = np.repeat(np.arange(len(T_base_tool)), seeds)
    tried = solve(robot, target, np.tile(starts, (len(T_base_tool), 1)), max_iterations=40)
    return [
        _distinct(tried.joints[(index == k) & tried.converged]) for k in range(len(T_base_tool))
    ]


def _spread(robot: RobotModel, count: int) -> Array:
    """Evenly spread postures inside one turn of the limits (Roberts 2018, the R_d sequence)."""
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (robot.dof + 1))
    steps = root ** -np.arange(1.0, robot.dof + 1.0)
    unit = (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0
    middle = robot.limits.mean(axis=1)
    half = np.minimum(np.diff(robot.limits, axis=1)[:, 0] / 2.0, np.pi)
    out: Array = middle + (2.0 * unit - 1.0) * half
    return out


def _distinct(joints: Array) -> Array:
    kept: list[Array] = []
    for row in wrap(joints):
        if all(np.abs(wrap(row - other)).max() > _DISTINCT for other in kept):
            kept.append(row)
    return np.array(kept).reshape(-1, joints.shape[1])


def _turn_inside(robot: RobotModel, joints: Array, near: Array) -> Array:
    """The solutions that have a turn inside the limits, on the turn nearest to ``near``."""
    lower, upper = robot.limits[:, 0] - 1e-9, robot.limits[:, 1] + 1e-9
    q = joints + _TURN * np.rint((near - joints) / _TURN)
    q = q - _TURN * np.ceil(np.maximum(q - upper, 0.0) / _TURN)
    q = q + _TURN * np.ceil(np.maximum(lower - q, 0.0) / _TURN)
    out: Array = q[((q >= lower) & (q <= upper)).all(axis=1)]
    return out
