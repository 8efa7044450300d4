"""Analytic inverse kinematics of the nominal arm: eight branches, limits, turns.

As in a controller. For arms with a spherical wrist (:mod:`robotrue.robot.opw`) and for arms with
axes 2 to 4 parallel (:mod:`robotrue.robot.parallel_arm`); for all others, and for the actual arm
with errors and compliance, see :mod:`robotrue.robot.inverse_numeric`.

Branch numbers are ``4 * wrist_flip + 2 * shoulder + elbow``:

* ``shoulder`` 0: the wrist point is ahead of axis 1 (a1 counted forward), 1: the arm reaches over
  or behind.
* ``elbow`` 0: the forearm is folded in the positive sense of theta_opw 3 (towards the front when
    the arm is upright), 1: the other way.
* ``wrist_flip`` 0: theta_opw 5 >= 0, 1: theta_opw 5 < 0.

For an arm with parallel axes :mod:`robotrue.robot.parallel_arm` defines them.

Source: Brandstoetter, Angerer, Hofbaur 2014, section 3; the elbow by one square root and an
arctangent instead of two arc cosines, the sixth axis from the fifth row instead of a separate
arctangent, so that full stretch and a straight wrist keep their digits.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.poses import inverse as inverse_pose
from robotrue.errors import ConfigurationError, ReachError
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import OpwGeometry, opw_geometry
from robotrue.robot.parallel_arm import ParallelGeometry, parallel_geometry, solve_branches

ClosedArm: TypeAlias = OpwGeometry | ParallelGeometry
"""An arm whose inverse has eight closed branches."""
BRANCHES: Final = 8
STRAIGHT_WRIST: Final = 1e-9
"""rad; a wrist straighter than this leaves A4 free, and the previous one is kept."""
_STRETCH: Final = 1e-12  # cosine beyond 1 that is rounding of a fully stretched arm
_TURN: Final = 2.0 * np.pi
_FIRST: Final = 64  # poses tried at a time for the start of a path
_LIMIT_SLACK: Final = 1e-9  # rad; rounding of a joint at its limit
_BLOCK: Final = 2048  # poses at a time, so that the work stays in the cache


def require_opw(robot: RobotModel) -> OpwGeometry:
    """Returns the ortho-parallel geometry of the arm.

    Raises:
        ConfigurationError: The arm has no spherical wrist, or is otherwise not of this kind.
    """
    geometry = opw_geometry(robot)
    if geometry is None:
        raise ConfigurationError(
            f"{robot.name} is not an ortho-parallel arm with a spherical wrist; "
            "its inverse has no closed branches.",
            hint="inverse_numeric.solve with a seed, or inverse_numeric.solve_global without.",
        )
    return geometry


def require_closed(robot: RobotModel) -> ClosedArm:
    """Returns the geometry whose inverse has closed branches.

    Raises:
        ConfigurationError: Neither a spherical wrist nor axes 2 to 4 parallel.
    """
    geometry = opw_geometry(robot) or parallel_geometry(robot)
    if geometry is None:
        raise ConfigurationError(
            f"{robot.name} has neither a spherical wrist nor parallel axes 2 to 4; its inverse has "
            "no closed branches.",
            hint="inverse_numeric.solve with a seed, or inverse_numeric.solve_global without.",
        )
    return geometry


def inverse_branches(
    robot: RobotModel,
    T_base_flange: Array,
    *,
    reference: Array | None = None,
) -> Array:
    """Returns the joints of all eight branches (n, 8, 6) rad, NaN where a branch does not exist.

    Joints are within one turn of ``reference`` (or of zero) and not compared with limits.

    Args:
        robot: The arm; its nominal geometry is used.
        T_base_flange: (n, 4, 4).
        reference: (n, 6) or (6,) rad; supplies A4 where the wrist is straight, A1 where the
            wrist point is on axis 1, and the turn of every joint.

    Raises:
        ConfigurationError: An arm without closed branches.
    """
    arm = require_closed(robot)
    T = np.asarray(T_base_flange, dtype=np.float64)
    near = np.zeros((1, 6)) if reference is None else np.atleast_2d(reference)
    near = np.broadcast_to(near, (len(T), 6))
    out = np.empty((len(T), BRANCHES, 6))
    for start in range(0, len(T), _BLOCK):
        part = slice(start, start + _BLOCK)
        out[part] = np.moveaxis(_options(arm, T[part], near[part]), -1, 0)
    return out


def _options(arm: ClosedArm, T_base_flange: Array, near: Array) -> Array:
    """All branches (8, 6, m) for m poses, each joint on the turn nearest to near (m, 6)."""
    if isinstance(arm, ParallelGeometry):
        joints = np.moveaxis(solve_branches(arm, T_base_flange, near), 0, -1)
    else:
        T_base_opw = _then(T_base_flange, inverse_pose(arm.T_opw_flange))
        hand = np.ascontiguousarray(np.moveaxis(T_base_opw[:, :3], 0, -1))
        joints = _joints(arm, _block(arm, hand, np.ascontiguousarray(arm.angles(near).T)))
    return np.asarray(joints - _TURN * np.rint((joints - near.T) * (1.0 / _TURN)))


def _then(T: Array, step: Array) -> Array:
    """T @ step for one constant step, as one matrix product (a batched one is ten times slower)."""
    return np.asarray((np.reshape(T, (-1, 4)) @ step).reshape(-1, 4, 4))


def _joints(arm: OpwGeometry, angles: Array) -> Array:
    """Returns q from theta_opw, both (8, 6, m)."""
    serial: Array = arm.sign[:, None] * (angles - arm.offset[:, None])
    if np.array_equal(arm.joint_map, np.eye(6)):
        return serial
    unmap = np.rint(np.linalg.inv(arm.joint_map))
    joints: Array = np.einsum("ij,bjm->bim", unmap, serial)
    return joints


def _block(arm: OpwGeometry, hand: Array, near: Array) -> Array:
    """All branches of theta_opw (8, 6, m) for hand poses (3, 4, m) and reference angles (6, m)."""
    angles = np.empty((BRANCHES, 6, hand.shape[2]))
    for shoulder, (theta1, ahead, up) in enumerate(_shoulders(arm, hand, near[0])):
        cosine, sine = np.cos(theta1), np.sin(theta1)
        turned = (
            cosine * hand[0, :3] + sine * hand[1, :3],
            cosine * hand[1, :3] - sine * hand[0, :3],
            hand[2, :3],
        )
        for elbow, (theta2, theta3) in enumerate(_elbows(arm, ahead, up)):
            slot = 2 * shoulder + elbow
            theta1 = theta1 + 0.0 * theta3  # NaN in all six where the elbow does not reach
            wrist, flipped = _wrist(turned, theta2 + theta3, near[3])
            angles[slot] = theta1, theta2, theta3, *wrist
            angles[slot + 4] = theta1, theta2, theta3, *flipped
    return angles


def _shoulders(arm: OpwGeometry, hand: Array, near1: Array) -> list[tuple[Array, Array, Array]]:
    """theta1, and the wrist point seen from axis 2: ahead and up, for the two shoulder branches."""
    x, y, z = hand[:, 3] - arm.c4 * hand[:, 2]
    square = x * x + y * y - arm.b * arm.b
    with np.errstate(invalid="ignore"):
        reach = np.sqrt(np.where((square < 0.0) & (square > -_STRETCH), 0.0, square))
    heading = np.arctan2(y, x)
    aside = np.arctan2(arm.b, reach)
    theta1_front, theta1_back = heading - aside, heading + aside - np.pi
    overhead = np.hypot(x, y) < STRAIGHT_WRIST
    if overhead.any():
        theta1_front = np.where(overhead, near1, theta1_front)
        theta1_back = np.where(overhead, near1, theta1_back)
    up = z - arm.c1
    return [(theta1_front, reach - arm.a1, up), (theta1_back, -reach - arm.a1, up)]


def _elbows(arm: OpwGeometry, ahead: Array, up: Array) -> list[tuple[Array, Array]]:
    """theta2 and theta3 of the two elbows."""
    fore, lead = np.hypot(arm.a2, arm.c3), np.arctan2(arm.a2, arm.c3)
    distance2 = ahead * ahead + up * up
    cosine = (distance2 - arm.c2**2 - fore**2) / (2.0 * arm.c2 * fore)
    rest = 1.0 - cosine * cosine
    with np.errstate(invalid="ignore"):
        sine = np.sqrt(np.where((rest < 0.0) & (rest > -2.0 * _STRETCH), 0.0, rest))
    fold = np.arctan2(sine, cosine)
    bearing = np.arctan2(ahead, up)
    behind = np.arctan2(fore * sine, arm.c2 + fore * cosine)
    return [(bearing - behind, fold - lead), (bearing + behind, -fold - lead)]


_Wrist: TypeAlias = tuple[Array, Array, Array]


def _wrist(turned: tuple[Array, Array, Array], pitch: Array, near4: Array) -> tuple[_Wrist, _Wrist]:
    """theta4..6 and their flipped twins from the hand seen in the frame turned with joint 1."""
    ahead, side, up = turned
    cosine, sine = np.cos(pitch), np.sin(pitch)
    row = cosine * ahead - sine * up  # the hand's forearm-x components
    along = sine * ahead[2] + cosine * up[2]
    bend = np.hypot(row[2], side[2])
    straight = bend < STRAIGHT_WRIST
    safe = np.where(straight, 1.0, bend)
    c4, s4 = row[2] / safe, side[2] / safe
    theta4 = np.arctan2(side[2], row[2])
    theta5 = np.arctan2(bend, along)
    if straight.any():
        theta4 = np.where(straight, near4, theta4)
        c4, s4 = np.cos(theta4), np.sin(theta4)
    theta6 = np.arctan2(c4 * side[0] - s4 * row[0], c4 * side[1] - s4 * row[1])
    # The twin turns A4 and A6 by half a turn; a straight wrist has no twin and keeps its A4.
    half = np.where(straight, 0.0, np.pi)
    return (theta4, theta5, theta6), (theta4 + half, -theta5, theta6 + half)


def _inside(robot: RobotModel, options: Array) -> Array:
    """Moves joints (8, 6, m) beyond a limit by whole turns; NaN where no turn is inside."""
    lower = robot.limits[:, 0, None] - _LIMIT_SLACK
    upper = robot.limits[:, 1, None] + _LIMIT_SLACK
    out = options.copy()
    for i in range(6):
        q = out[:, i]
        beyond = (q < lower[i]) | (q > upper[i])
        if not beyond.any():
            continue
        turned = q[beyond]
        turned = turned - _TURN * np.ceil(np.maximum(turned - upper[i], 0.0) / _TURN)
        turned = turned + _TURN * np.ceil(np.maximum(lower[i] - turned, 0.0) / _TURN)
        q[beyond] = np.where(turned > upper[i], np.nan, turned)
    missing = np.isnan(out).any(axis=1)
    np.moveaxis(out, 1, -1)[missing] = np.nan
    return out


def inverse_batch(
    robot: RobotModel,
    T_base_tool: Array,
    *,
    near: Array | None = None,
    branch: int | IntArray | None = None,
) -> Array:
    """Returns joints (n, 6) rad inside the limits, each pose by itself; NaN where there are none.

    Args:
        robot: The arm; nominal geometry and its ``T_flange_tool`` are used, errors left aside.
        T_base_tool: (n, 4, 4).
        near: (n, 6) or (6,) rad. Of the branches (or of the turns of the given one) the nearest
            to it in the Euclidean sense is taken; the middle of the limits if not given.
        branch: Branch number for all or (n,) per pose; any branch if not given.

    Raises:
        ConfigurationError: An arm without closed branches.
    """
    arm = require_closed(robot)
    n = len(T_base_tool)
    seed = np.broadcast_to(_seed(robot, near), (n, 6))
    fixed = None if branch is None else np.broadcast_to(np.asarray(branch, dtype=np.int64), (n,))
    T_tool_flange = inverse_pose(robot.T_flange_tool)
    out = np.empty((n, 6))
    for start in range(0, n, _BLOCK):
        part = slice(start, start + _BLOCK)
        options = _inside(robot, _options(arm, _then(T_base_tool[part], T_tool_flange), seed[part]))
        if fixed is None:
            apart = options - seed[part].T
            distance = np.einsum("bim,bim->bm", apart, apart)
            chosen = np.argmin(np.where(np.isnan(distance), np.inf, distance), axis=0)
        else:
            chosen = fixed[part]
        out[part] = options[chosen, :, np.arange(options.shape[2])]
    return out


def _seed(robot: RobotModel, near: Array | None) -> Array:
    return robot.limits.mean(axis=1) if near is None else np.asarray(near, dtype=np.float64)


def inverse_path(robot: RobotModel, T_base_tool: Array, *, near: Array | None = None) -> Array:
    """Returns joints (n, 6) rad along a path: one branch throughout, every joint without jumps.

    The branch is the one nearest to ``near`` at the first reachable pose.
    Where the wrist is straight A4 and A6 are those of the pose before. A full turn is added where
    an angle would jump; a joint that would then leave its limits gives NaN, not a turn back.

    Args:
        robot: The arm; nominal geometry and its tool.
        T_base_tool: (n, 4, 4) in path order.
        near: (6,) rad before the first pose; the middle of the limits if not given.

    Fails when: the path leads through a wrist singularity; a branch that is kept then turns A4 by
    half a turn from one pose to the next, as the arm itself would have to.

    Raises:
        ConfigurationError: An arm without closed branches.
    """
    arm = require_closed(robot)
    seed = _seed(robot, near)
    T_base_flange = T_base_tool @ inverse_pose(robot.T_flange_tool)
    chosen, start, first = _first_reached(robot, T_base_tool, seed)
    path = np.full((len(T_base_tool), 6), np.nan)
    if start < 0:
        return path
    path[start:] = inverse_branches(robot, T_base_flange[start:], reference=first)[:, chosen]
    path[start] = first
    reached = np.flatnonzero(~np.isnan(path[:, 0]))
    for k in _straight(arm, path):
        earlier = reached[reached < k]
        if len(earlier):
            previous = path[earlier[-1]]
            again = inverse_branches(robot, T_base_flange[[k]], reference=previous)
            path[k] = again[0, chosen]
    path[reached] = np.unwrap(path[reached], axis=0)
    lower, upper = robot.limits[:, 0] - _LIMIT_SLACK, robot.limits[:, 1] + _LIMIT_SLACK
    path[((path < lower) | (path > upper)).any(axis=1)] = np.nan
    return path


def _first_reached(robot: RobotModel, T_base_tool: Array, seed: Array) -> tuple[int, int, Array]:
    """Branch, index and joints of the first pose inside the limits; index -1 if there is none."""
    for start in range(0, len(T_base_tool), _FIRST):
        part = T_base_tool[start : start + _FIRST]
        found = inverse_batch(robot, part, near=seed)
        good = np.flatnonzero(~np.isnan(found[:, 0]))
        if len(good):
            joints = found[good[0]]
            return branch_of(robot, joints), start + int(good[0]), joints
    return 0, -1, seed


def _straight(geometry: ClosedArm, joints: Array) -> IntArray:
    bend = geometry.singular_measures(joints)[:, 0]
    return np.flatnonzero(bend < STRAIGHT_WRIST).astype(np.int64)


def branch_of(robot: RobotModel, joints: Array) -> int:
    """Returns the branch number of joints (6,) rad, see the head of this module."""
    return int(branches_of(robot, np.asarray(joints)[None])[0])


def branches_of(robot: RobotModel, joints: Array) -> IntArray:
    """Returns the branch numbers (n,) of joints (n, 6) rad, see the head of this module."""
    return require_closed(robot).branches(joints)


def inverse(
    robot: RobotModel,
    T_base_tool: Array,
    *,
    near: Array | None = None,
    branch: int | None = None,
) -> Array:
    """Returns joints (6,) rad of one pose, nearest to ``near`` inside the limits.

    Args:
        robot: The arm; nominal geometry and its ``T_flange_tool`` are used, errors left aside.
        T_base_tool: (4, 4).
        near: (6,) rad; the middle of the limits if not given.
        branch: Branch number; the branch nearest to ``near`` if not given.

    Raises:
        ReachError: No branch reaches the pose, or only beyond a joint limit.
        ShapeError: Not a finite 4 x 4 pose.
        ConfigurationError: An arm without closed branches.
    """
    T = frozen(T_base_tool, (4, 4), "T_base_tool")[None]
    found: Array = inverse_batch(robot, T, near=near, branch=branch)[0]
    if not np.isnan(found[0]):
        return found
    raise _unreachable(robot, T, near, branch)


def _unreachable(
    robot: RobotModel,
    T: Array,
    near: Array | None,
    branch: int | None,
) -> ReachError:
    """Says why: too far, too near, or which limit of the branch that comes closest."""
    seed = _seed(robot, near)
    T_base_flange = T @ inverse_pose(robot.T_flange_tool)
    options = inverse_branches(robot, T_base_flange, reference=seed)[0]
    kept = options if branch is None else options[[branch]]
    alive = kept[~np.isnan(kept).any(axis=1)]
    which = robot.name if branch is None else f"branch {branch} of {robot.name}"
    if not len(alive):
        geometry = require_closed(robot)
        span, longest = float(geometry.span(T_base_flange)[0]), geometry.stretch
        folded = " (the arm cannot fold to it)" if span <= longest else ""
        return ReachError(
            f"{which} cannot reach this pose: the wrist point is {span:.4f} m from the middle of "
            f"the shoulder, the stretched arm is {longest:.4f} m long{folded}.",
            hint="check the tool and the work frame, or move the part.",
        )
    lower, upper = robot.limits[:, 0], robot.limits[:, 1]
    turned = alive + _TURN * np.rint((robot.limits.mean(axis=1) - alive) / _TURN)
    excess = np.maximum(lower - turned, turned - upper)
    best = int(np.argmin(np.maximum(excess, 0.0).sum(axis=1)))
    joint = int(np.argmax(excess[best]))
    value, low, high = np.degrees([turned[best, joint], lower[joint], upper[joint]])
    return ReachError(
        f"{which} reaches this pose only beyond a limit: joint {joint + 1} at {value:.3f} deg, "
        f"allowed {low:.3f} to {high:.3f} deg (model sense).",
        hint="turn the tool about its axis, or move the part.",
    )
