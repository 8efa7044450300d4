"""Touches that can be made: every feature, in the attitudes of the machining and leaned ones.

The tip is the tool point of the robot handed over. A feature is touched with the attitudes in which
the part is machined (there the arm's own error is the same as when it cuts), turned about the tool
axis and leaned to every side (that tells the tool point and the wrist), as far as the direction
from which the feature is reached, the joint limits and what stands around allow. A feature that no
machined attitude faces is touched straight from where it can be reached.
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
MOST_ATTITUDES: Final = 12
"""Machined attitudes that are taken over; the commonest."""
MOST: Final = 4000
"""Touches that are handed on, evenly over features and attitudes."""
TRACKER: Final = "tracker"
"""The body a scene puts where the tracker stands; touching needs none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchLimits(Columns):
    """What a touch must keep.

    Attributes:
        lean: rad, by which the tool is leaned off each machined attitude, to four sides.
        steepest: rad, largest angle between the tool and the direction a feature is reached from.
        margin: rad, kept from the joint limits.
        tip_axis: (3,) the way from the flange to the tip, in the tool frame; normalised. Default:
            +z; KUKA's own convention is +x.
    """

    lean: float = 15.0 * DEG
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
        tried: How many combinations of feature and attitude were looked at.
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
        features: What can be touched.
        machining: Whose attitudes are taken.
        T_base_part: (4, 4) of every part, roughly.
        limits: Leans, steepness, margins.
        scene: What stands around; nothing is checked without it.

    Raises:
        ReachError: Not one touch is left; says what took them.
    """
    limits = TouchLimits() if limits is None else limits
    place = np.stack([T_base_part[int(k)] for k in features.part])
    outward = _outward(features, place)
    stated = outward[~np.isnan(outward[:, 0])]
    attitude, near = _attitudes(robot, machining, limits, stated)
    point = apply(place, features.point)
    n, a = len(features), len(attitude)
    feature, chosen = np.repeat(np.arange(n), a), np.tile(np.arange(a), n)
    counts: dict[str, int] = {}
    good = np.ones(n * a, dtype=bool)
    towards = attitude @ limits.tip_axis
    open_side = _can_reach(outward, towards, limits.steepest)[feature, chosen]
    good &= _drop_bad(counts, "the tool comes from the wrong side", good, ~open_side)
    joints = np.full((n * a, robot.dof), np.nan)
    mine = np.flatnonzero(good)
    wanted = pose(attitude[chosen[mine]], point[feature[mine]])
    joints[mine] = _joints(robot, wanted, near[chosen[mine]])
    out = np.asarray(np.isnan(joints).any(axis=1))
    good &= _drop_bad(counts, "out of reach", good, out)
    low, high = robot.limits[:, 0] + limits.margin, robot.limits[:, 1] - limits.margin
    beyond = np.asarray(((joints < low) | (joints > high)).any(axis=1))
    good &= _drop_bad(counts, "joint limits", good, beyond)
    if scene is not None and good.any():
        standing = np.flatnonzero(good)
        for reason, hit in collisions(scene, joints[standing]).items():
            if not reason.endswith(TRACKER):
                bad = np.zeros_like(good)
                bad[standing] = hit
                good &= _drop_bad(counts, reason, good, bad)
    rejected = tuple((reason, count) for reason, count in counts.items() if count)
    if not good.any():
        why = ", ".join(f"{reason} {count}" for reason, count in rejected)
        raise ReachError(
            f"not one of {n * a} touches of {n} features can be made ({why}).",
            hint="check the rough frame of the part, the tool and the directions ax, ay, az.",
        )
    untouchable = _without(features, feature[good])
    able = np.flatnonzero(good)
    if len(able) > MOST:
        kept = able[np.linspace(0, len(able) - 1, MOST).round().astype(np.int64)]
        rejected += (("more than are looked at", len(able) - MOST),)
        able = kept
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
        rejected=rejected,
        untouchable=untouchable,
    )


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
        now = own[best] @ axis
        about = np.cross(now, towards)
        if np.linalg.norm(about) < 1e-6:  # straight against it: any way round
            about = np.cross(now, np.eye(3)[int(np.argmin(np.abs(now)))])
        about = about / np.linalg.norm(about) * np.arccos(np.clip(now @ towards, -1.0, 1.0))
        own = np.concatenate([own, (matrix_from_rotation_vector(about) @ own[best])[None]])
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


def _drop_bad(counts: dict[str, int], reason: str, good: BoolArray, bad: BoolArray) -> BoolArray:
    """Which are not bad; those that were still good are counted under the reason."""
    counts[reason] = counts.get(reason, 0) + int((good & bad).sum())
    return ~bad


def _without(features: Features, rows: IntArray) -> tuple[str, ...]:
    left = {features.names[k] for k in rows}
    return tuple(name for name in dict.fromkeys(features.names) if name not in left)
