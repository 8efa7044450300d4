"""Possible touches: every feature, in the attitudes of the machining and leaned ones.

The tip is the tool point of the given robot. A feature is touched with the attitudes in which the
part is machined (there the arm's error is the same as when it cuts), turned about the tool axis and
leaned to every side (that determines the tool point and the wrist), as far as the direction from
which the feature is reached, the joint limits and the surroundings allow. A feature that no
machined attitude faces is touched straight from a reachable side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG
from robotrue.errors import ReachError, ShapeError
from robotrue.measurement.formats.part_points import Features
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.arm_scene import Scene, collisions
from robotrue.planning.candidates import Rejections
from robotrue.planning.plan_defaults import LEAN_DEG
from robotrue.planning.probing import Machining
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry

SPINS: Final = np.array([0.0, 90.0, -90.0, 180.0]) * DEG
"""About the tool axis; a ball touches alike in all of them."""
ALIKE: Final = 20.0 * DEG
"""Machined attitudes nearer to one another than this count as one."""
FACE: Final = 0.94
"""Cosine between directions of one face."""
TURNS: Final = np.arange(0.0, 2.0 * np.pi, np.pi / 6.0)
"""rad about the tool axis that are tried for one posture in front of a part."""
ROOM: Final = 0.05
"""rad kept from the joint limits by it."""
MOST_ATTITUDES: Final = 12
"""Largest number of machined attitudes used, the most frequent ones."""
MOST: Final = 4000
"""Touches that are handed on, evenly over features and attitudes."""
TRACKER: Final = "tracker"
"""The body of the tracker in a scene; touching needs none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchLimits(Columns):
    """Limits for a probing posture.

    Attributes:
        lean: rad, by which the tool is leaned off each machined attitude, to four sides.
        steepest: rad, largest angle between the tool and the direction a feature is reached from.
        margin: rad, kept from the joint limits.
        tip_axis: (3,) the way from the flange to the tip, in the tool frame; normalised. Default:
            +z; KUKA's own convention is +x.
    """

    lean: float = LEAN_DEG * DEG
    steepest: float = 60.0 * DEG
    margin: float = 2.0 * DEG
    tip_axis: Annotated[Array, Column("3")] = field(
        default_factory=lambda: np.array([0.0, 0.0, 1.0])
    )

    def _check_rules(self) -> None:
        """Makes the axis unit.

        Raises:
            ShapeError: An axis without a direction.
        """
        length = float(np.linalg.norm(self.tip_axis))
        if not length > 0.0:
            raise ShapeError("tip_axis is zero, expected a direction in the tool frame.")
        self._set_column("tip_axis", self.tip_axis / length)


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchCandidates:
    """Touches that can be made.

    Attributes:
        touches: With their planned joints, feature by feature.
        tried: Number of combinations of feature and attitude tried.
        rejected: (reason, count) of the others.
        untouchable: Features without any touch.
    """

    touches: ProbingSet
    tried: int
    rejected: tuple[tuple[str, int], ...]
    untouchable: tuple[str, ...]


def touch_candidates(
    robot: RobotModel,
    features: Features,
    machining: Machining,
    T_base_part: Mapping[int, Array],
    *,
    limits: TouchLimits | None = None,
    scene: Scene | None = None,
) -> TouchCandidates:
    """Returns every touch that can be made.

    Args:
        robot: Nominal arm with the touching tip as its tool.
        features: Features that can be touched.
        machining: Machining whose attitudes are used.
        T_base_part: (4, 4) of every part, roughly.
        limits: Leans, steepness, margins.
        scene: Surroundings; without them collisions are not checked.

    Raises:
        ReachError: No touch is left; states the causes.
    """
    limits = TouchLimits() if limits is None else limits
    place = np.stack([T_base_part[int(k)] for k in features.part])
    outward = _outward(features, place)
    stated = outward[~np.isnan(outward[:, 0])]
    attitude, near = _attitudes(robot, machining, limits, stated)
    point = apply(place, features.point)
    n, a = len(features), len(attitude)
    feature, chosen = np.repeat(np.arange(n), a), np.tile(np.arange(a), n)
    open_side = _can_reach(outward, attitude @ limits.tip_axis, limits.steepest)
    rejections = Rejections(n * a)
    rejections.leave_out("the tool comes from the wrong side", ~open_side[feature, chosen])
    mine = np.flatnonzero(rejections.good)
    joints = np.full((n * a, robot.dof), np.nan)
    wanted = pose(attitude[chosen[mine]], point[feature[mine]])
    joints[mine] = _joints(robot, wanted, near[chosen[mine]])
    _check_joints(robot, joints, limits, scene, rejections)
    able = np.flatnonzero(rejections.good)
    if not len(able):
        why = ", ".join(f"{reason} {count}" for reason, count in rejections.rejected)
        raise ReachError(
            f"not one of {n * a} touches of {n} features can be made ({why}).",
            hint="check the rough frame of the part, the tool and the directions ax, ay, az.",
        )
    untouchable = _without(features, feature[able])
    if len(able) > MOST:
        rejections.count("more than are checked", len(able) - MOST)
        able = able[np.linspace(0, len(able) - 1, MOST).round().astype(np.int64)]
    rows = feature[able]
    return TouchCandidates(
        touches=ProbingSet(
            names=tuple(features.names[k] for k in rows),
            point=features.point[rows],
            joints=joints[able],
            normal=features.normal[rows],
            part=features.part[rows],
        ),
        tried=n * a,
        rejected=rejections.rejected,
        untouchable=untouchable,
    )


def _check_joints(
    robot: RobotModel,
    joints: Array,
    limits: TouchLimits,
    scene: Scene | None,
    rejections: Rejections,
) -> None:
    """Leaves out touches without joints, at the joint limits, or in a collision."""
    rejections.leave_out("out of reach", np.asarray(np.isnan(joints).any(axis=1)))
    low, high = robot.limits[:, 0] + limits.margin, robot.limits[:, 1] - limits.margin
    beyond = np.asarray(((joints < low) | (joints > high)).any(axis=1))
    rejections.leave_out("joint limits", beyond)
    standing = np.flatnonzero(rejections.good)
    if scene is None or not len(standing):
        return
    for reason, hit in collisions(scene, joints[standing]).items():
        if not reason.endswith(TRACKER):
            bad = np.zeros(len(joints), dtype=bool)
            bad[standing] = hit
            rejections.leave_out(reason, bad)


def attitude_groups(robot: RobotModel, joints: Array, *, tip_axis: Array) -> tuple[IntArray, Array]:
    """Returns the group of each posture (n,), and a representative posture (g, dof) of each group.

    Tool axes nearer than :data:`ALIKE` to that of a group's first posture belong to it, however the
    tool is turned about them. Groups come in the order of their first postures.

    Args:
        robot: Nominal arm with its tool.
        joints: (n, dof) rad.
        tip_axis: (3,) unit, in the tool frame.
    """
    axis = forward(robot.nominal(), joints)[:, :3, :3] @ tip_axis
    group = np.full(len(joints), -1, dtype=np.int64)
    first: list[int] = []
    for k in range(len(joints)):
        if group[k] < 0:
            near = axis @ axis[k] >= np.cos(ALIKE)
            group[near & (group < 0)] = len(first)
            first.append(k)
    return group, joints[first]


def _attitudes(
    robot: RobotModel, machining: Machining, limits: TouchLimits, outward: Array
) -> tuple[Array, Array]:
    """Attitudes R_base_tool (a, 3, 3) to touch with, and a posture (a, dof) near each."""
    axis = limits.tip_axis
    group, first = attitude_groups(robot, machining.joints, tip_axis=axis)
    common = np.argsort(-np.bincount(group, minlength=len(first)), kind="stable")[:MOST_ATTITUDES]
    near = first[common]
    own = forward(robot.nominal(), near)[:, :3, :3]
    own, near = _facing(own, near, axis, outward)
    aside = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    aside = aside / np.linalg.norm(aside)
    across = np.cross(axis, aside)
    leans = limits.lean * np.stack([np.zeros(3), aside, -aside, across, -across])
    if limits.lean == 0.0:
        leans = leans[:1]
    spins = SPINS[:, None] * axis
    turn = matrix_from_rotation_vector(leans)[:, None] @ matrix_from_rotation_vector(spins)[None]
    turn = turn.reshape(-1, 3, 3)
    every = own[:, None] @ turn[None]
    return every.reshape(-1, 3, 3), np.repeat(near, len(turn), axis=0)


def _facing(own: Array, near: Array, axis: Array, outward: Array) -> tuple[Array, Array]:
    """The attitudes, and more that face features which the machined ones do not.

    Each is the nearest machined one, turned no further than it must be.
    """
    for towards in -outward:
        angle = (own @ axis) @ towards
        best = int(np.argmax(angle))
        if angle[best] >= np.cos(ALIKE) or len(own) >= 2 * MOST_ATTITUDES:
            continue
        turn = _rotate_onto(own[best] @ axis, towards)
        own = np.concatenate([own, (turn @ own[best])[None]])
        near = np.concatenate([near, near[best : best + 1]])
    return own, near


def _outward(features: Features, place: Array) -> Array:
    """Directions (n, 3) in base from which the features can be reached; NaN: any."""
    known = ~np.isnan(features.access)
    direction = np.where(known, features.access, features.normal)
    return np.asarray((place[:, :3, :3] @ direction[:, :, None])[:, :, 0])


def _can_reach(outward: Array, towards: Array, steepest: float) -> BoolArray:
    """(n, a) whether the tool comes from the side a feature is open to."""
    anywhere: BoolArray = np.isnan(outward[:, 0])
    against = -np.nan_to_num(outward) @ towards.T
    return np.asarray((against >= np.cos(steepest)) | anywhere[:, None])


def _joints(robot: RobotModel, wanted: Array, near: Array) -> Array:
    """Joints (n, dof) rad nearest to a posture; NaN where there are none."""
    if opw_geometry(robot) is not None:
        return inverse_batch(robot, wanted, near=near)
    found = solve(robot.nominal(), wanted, near)
    return np.where(found.converged[:, None], found.joints, np.nan)


def _without(features: Features, rows: IntArray) -> tuple[str, ...]:
    left = {features.names[k] for k in rows}
    return tuple(name for name in dict.fromkeys(features.names) if name not in left)


def find_facing_posture(
    robot: RobotModel, features: Features, T_base_part: Mapping[int, Array], tip_axis: Array
) -> Machining:
    """Returns one posture with the tool against the part, for candidates to take attitudes from.

    The tool points at the face with the most features, from above where no faces are stated; of its
    turns about that axis the one nearest to the middle of the joint limits is used.

    Args:
        robot: Nominal arm with the touching tip as its tool.
        features: Of the part.
        T_base_part: (4, 4) of every part, roughly.
        tip_axis: (3,) unit, the way from the flange to the tip, in the tool frame.

    Raises:
        ReachError: The middle of the features cannot be reached.
    """
    place = np.stack([T_base_part[int(k)] for k in features.part])
    point = apply(place, features.point)
    outward = np.nan_to_num(_outward(features, place))
    alike = (outward @ outward.T > FACE).sum(axis=1)
    first = int(np.argmax(alike))
    mine = outward @ outward[first] > FACE if alike[first] else np.ones(len(point), dtype=bool)
    middle = point[mine].mean(axis=0)
    nearest = int(np.argmin(np.where(mine, np.linalg.norm(point - middle, axis=1), np.inf)))
    for direction in (*([-outward[first]] if alike[first] else []), np.array([0.0, 0.0, -1.0])):
        joints = _reach_direction(robot, point[nearest], direction, tip_axis)
        if joints is not None:
            return Machining(
                group=("part",), point=features.point[[nearest]], joints=joints[None],
                part=features.part[[nearest]],
            )  # fmt: skip
    x, y, z = point[nearest] * 1e3
    raise ReachError(
        f"the arm cannot touch {features.names[nearest]!r} at {x:.0f}, {y:.0f}, {z:.0f} mm in "
        "base, in any turn of the tool.",
        hint="check the rough frame of the part and the tool of the cell.",
    )


def _reach_direction(
    robot: RobotModel, point: Array, direction: Array, tip_axis: Array
) -> Array | None:
    """Joints (dof,) with the tool axis along a direction, in the middle of their limits."""
    low, high = robot.limits[:, 0] + ROOM, robot.limits[:, 1] - ROOM
    middle = np.where(np.isfinite(low + high), 0.5 * (low + high), 0.0)
    turns = matrix_from_rotation_vector(TURNS[:, None] * direction)
    wanted = pose(turns @ _rotate_onto(tip_axis, direction), point)
    joints = _joints(robot, wanted, np.tile(middle, (len(wanted), 1)))
    with np.errstate(invalid="ignore"):
        able = ((joints >= low) & (joints <= high)).all(axis=1)
    if not able.any():
        return None
    away = np.where(able, np.linalg.norm(np.nan_to_num(joints) - middle, axis=1), np.inf)
    return np.asarray(joints[int(np.argmin(away))])


def _rotate_onto(axis: Array, to: Array) -> Array:
    """The smallest rotation (3, 3) that takes one unit vector to another."""
    about = np.cross(axis, to)
    sine, cosine = float(np.linalg.norm(about)), float(axis @ to)
    if sine < 1e-9:
        about = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        sine = float(np.linalg.norm(about))
        return matrix_from_rotation_vector(about / sine * (0.0 if cosine > 0.0 else np.pi))
    return matrix_from_rotation_vector(about / sine * float(np.arctan2(sine, cosine)))
