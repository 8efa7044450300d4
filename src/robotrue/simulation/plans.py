"""Where a campaign measures: the sampling plan of Deng et al. 2022 and seeded random poses.

Poses are those of the reflector, in cylinder coordinates about joint 1: angle, radius, height. The
attitude turns with the angle (convention A of the reproduction): the flange axis lies in the arm
plane and points 60 deg below the horizontal. Or it is fixed in the base (convention B), and the
whole workspace lies 100 mm lower, since its corners cannot be reached otherwise. Tables 6 and 7
print the ranges and the steps but no attitude of departure and no reflector; both are **assumed**
here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.deng2022.domains import Domains, divide_target
from robotrue.calibration.deng2022.sampling import (
    TargetRule,
    hierarchical_sample,
    target_counts,
    target_images,
)
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.core.regions import CylinderRegion, points_at, random_coordinates
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ReachError
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.model import RobotModel

Attitude: TypeAlias = Literal["turning", "fixed"]
"""Whether the tool's attitude turns with the angle about joint 1 (A) or not (B)."""

POSTURE: Final = np.array([0.0, 0.0, 0.0, 0.0, -60.0, 0.0]) * DEG
"""(6,) rad, model joints: the branch every plan uses, elbow up, tool ahead."""
ATTITUDE: Final = matrix_from_abc(np.array([0.0, 150.0, 0.0]) * DEG)
"""(3, 3) R_base_flange at angle 0: flange axis 60 deg below the horizontal."""
LOWERED: Final = 100.0 * MM
"""By which the workspace lies lower where the attitude is fixed."""
STEPS: Final = (
    np.arange(-15.0, 15.1, 15.0) * DEG,
    np.arange(-10.0, 10.1, 5.0) * DEG,
    np.arange(-10.0, 10.1, 2.5) * DEG,
)
"""rad, Table 6: values of the turns rx, ry, rz."""
PER_ANGLE: Final = (7, 6)
"""Table 6: radii and heights of the grid, 100 mm apart."""
ANGLE_STEP: Final = 5.0 * DEG
SUB_SPACES: Final = 5
"""Of 10 deg, 5 deg apart: the only ones in [-30, 40] deg with the 126 grid points of the source."""
TARGETS: Final = 80
_REDRAWS: Final = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperPlan:
    """The poses of Tables 6 and 7, joints in rad.

    Attributes:
        source: (126, 6) complete sampling of theta1 in [-40, -30] deg.
        target: (80, 6) 16 poses in each of five sub-spaces of [-30, 40] deg, source poses turned
            about joint 1 (rule 1 of section 2.4).
        sub_space: (80,) which sub-space.
        image: (80,) which source pose each target pose is the turned image of.
        validation: (378, 6) complete sampling of [-20, 20] deg.
        check: (50, 6) poses of [-20, 20] deg that are on no grid.
    """

    source: Array
    target: Array
    sub_space: IntArray
    image: IntArray
    validation: Array
    check: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Region(CylinderRegion):
    """A part of the workspace in cylinder coordinates, and how far the attitude may turn.

    Attributes:
        angle: Lower and upper angle about joint 1, rad.
        radius: Lower and upper distance from axis 1, m.
        height: Lower and upper height, m.
        turn: Largest turn of the attitude about its own x, y, z, rad.
        attitude: Whether the attitude turns with the angle.
    """

    angle: tuple[float, float] = (-40 * DEG, 40 * DEG)
    radius: tuple[float, float] = (800 * MM, 1400 * MM)
    height: tuple[float, float] = (700 * MM, 1200 * MM)
    turn: tuple[float, float, float] = (15 * DEG, 10 * DEG, 10 * DEG)
    attitude: Attitude = "turning"


VALIDATION: Final = Region(angle=(-20 * DEG, 20 * DEG))
"""The validation region of Table 7."""


def with_attitude(region: Region, attitude: Attitude) -> Region:
    """Returns a region of Tables 6 and 7 for another attitude: fixed ones lie 100 mm lower."""
    if attitude == region.attitude:
        return region
    down = LOWERED if attitude == "fixed" else -LOWERED
    low, high = region.height
    return replace(region, attitude=attitude, height=(low - down, high - down))


def cylinder_poses(
    angle: Array, radius: Array, height: Array, turn: Array, attitude: Attitude = "turning"
) -> Array:
    """Returns T_base_target (n, 4, 4) whose rotation is that of the flange.

    Args:
        angle: (n,) rad about joint 1.
        radius: (n,) m from axis 1.
        height: (n,) m.
        turn: (n, 3) rad: the attitude turned by Rz(rz) Ry(ry) Rx(rx) in its own axes, given as
            rx, ry, rz.
        attitude: Whether the attitude turns with the angle.
    """
    heading = np.zeros((len(angle), 3))
    if attitude == "turning":
        heading[:, 0] = angle
    rotation = matrix_from_abc(heading) @ ATTITUDE @ matrix_from_abc(turn[:, ::-1])
    place = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    return pose(rotation, place)


def region_poses(region: Region, n: int, rng: np.random.Generator) -> Array:
    """Returns n poses (n, 4, 4) drawn uniformly from a region, reachable or not."""
    place = random_coordinates(region, n, rng)
    turn = rng.uniform(-1.0, 1.0, (n, 3)) * region.turn
    return _poses(place, turn, region.attitude)


def paper_domains(attitude: Attitude = "turning") -> Domains:
    """Returns source, target and sub-spaces of Table 7."""
    whole = with_attitude(Region(), attitude)
    source, target = (
        CylinderRegion(angle=angle, radius=whole.radius, height=whole.height)
        for angle in ((-40 * DEG, -30 * DEG), (-30 * DEG, 40 * DEG))
    )
    return divide_target(source, target, SUB_SPACES)


def paper_plan(
    robot: RobotModel,
    seed: int,
    attitude: Attitude = "turning",
    *,
    targets: int = TARGETS,
    rule: TargetRule = "random",
) -> PaperPlan:
    """Returns the sampling plan of the paper for one draw of its random attitudes.

    Args:
        robot: The nominal KR160 with the reflector as its tool.
        seed: Of the attitudes, the choice of the target poses and the check poses.
        attitude: Whether the attitude turns with the angle.
        targets: Poses in the target domain, shared evenly among its sub-spaces.
        rule: Which source poses have their image measured there.

    Raises:
        ReachError: A pose is out of reach, as with another arm or another reflector.
    """
    rng = np.random.default_rng([seed, 19])
    domains = paper_domains(attitude)
    inside = with_attitude(VALIDATION, attitude)
    angles = np.array([0.0, *domains.angles])
    place, turn = _sample(robot, domains.source, rng, attitude, angles)
    counts = target_counts(domains, targets)
    features = np.column_stack([points_at(domains.source, place), turn])
    images = target_images(domains, features, counts, rng, rule=rule)
    image, sub_space = np.concatenate(images), np.repeat(np.arange(len(counts)), counts)
    there = place[image]
    there[:, 0] += domains.angles[sub_space]
    grid, grid_turn = _sample(robot, inside, rng, attitude, np.zeros(1))
    return PaperPlan(
        source=_joints(robot, _poses(place, turn, attitude)),
        target=_joints(robot, _poses(there, turn[image], attitude)),
        sub_space=sub_space,
        image=image,
        validation=_joints(robot, _poses(grid, grid_turn, attitude)),
        check=_joints(robot, region_poses(inside, 50, rng)),
    )


def _poses(place: Array, turn: Array, attitude: Attitude) -> Array:
    return cylinder_poses(place[:, 0], place[:, 1], place[:, 2], turn, attitude)


def _sample(
    robot: RobotModel,
    region: CylinderRegion,
    rng: np.random.Generator,
    attitude: Attitude,
    angles: Array,
) -> tuple[Array, Array]:
    """The complete positions of Table 6 in a region and an attitude for each.

    An attitude that cannot be taken, here or turned by one of the angles, is drawn anew: with a
    fixed attitude a few corners of the workspace allow only some.
    """
    count = round((region.angle[1] - region.angle[0]) / ANGLE_STEP) + 1
    place, turn = hierarchical_sample(region, (count, *PER_ANGLE), STEPS, rng)
    for _ in range(_REDRAWS):
        lost = np.zeros(len(place), dtype=bool)
        for angle in angles:
            there = place + np.array([angle, 0.0, 0.0])
            joints = inverse_batch(robot, _poses(there, turn, attitude), near=POSTURE)
            lost |= ~np.isfinite(joints).all(axis=1)
        if not lost.any():
            break
        turn[lost] = np.stack([rng.choice(steps, int(lost.sum())) for steps in STEPS], axis=1)
    return place, turn


def random_joints(robot: RobotModel, n: int, *, seed: int, region: Region | None = None) -> Array:
    """Returns n reachable postures (n, 6) rad inside the joint limits, equal for equal seeds.

    Args:
        robot: The nominal arm; its tool is the point the region is about.
        n: How many.
        seed: Of the draw.
        region: Where; the whole range of Table 6 if not given.

    Raises:
        ReachError: Fewer than one pose in fifty of the region can be taken.
        ConfigurationError: The arm has no closed inverse.
    """
    rng = np.random.default_rng([seed, 23])
    where = Region() if region is None else region
    found: list[Array] = []
    for _ in range(50):
        joints = inverse_batch(robot, region_poses(where, n, rng), near=POSTURE)
        found.append(joints[np.isfinite(joints).all(axis=1)])
        if sum(map(len, found)) >= n:
            return np.concatenate(found)[:n]
    raise ReachError(
        f"only {sum(map(len, found))} of {50 * n} poses drawn from the region can be taken.",
        hint="a region nearer to the robot, or smaller turns of the attitude.",
    )


def _joints(robot: RobotModel, poses: Array) -> Array:
    joints = inverse_batch(robot, poses, near=POSTURE)
    lost = np.flatnonzero(~np.isfinite(joints).all(axis=1))
    if len(lost):
        x, y, z = poses[lost[0], :3, 3] / MM
        raise ReachError(
            f"{len(lost)} of {len(poses)} poses of the plan are out of reach, the first at "
            f"({x:.1f}, {y:.1f}, {z:.1f}) mm.",
            hint="use the KR160 preset and its reflector.",
        )
    return joints
