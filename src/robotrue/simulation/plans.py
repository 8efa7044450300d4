"""Poses of a virtual campaign: regions of the workspace and seeded random poses in them.

Poses are those of the reflector, in cylinder coordinates about joint 1: angle, radius, height. The
attitude turns with the angle (convention A): the flange axis lies in the arm plane and points
60 deg below the horizontal. Or it is fixed in the base (convention B), and the whole workspace lies
100 mm lower, since its corners cannot be reached otherwise. The ranges are those of Tables 6 and 7
of Deng et al. 2022, which print no attitude of departure and no reflector; both are **assumed**.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.regions import CylinderRegion, random_coordinates
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Region(CylinderRegion):
    """A part of the workspace in cylinder coordinates, with the range of the attitude.

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
    return poses_at(place, turn, region.attitude)


def poses_at(place: Array, turn: Array, attitude: Attitude) -> Array:
    """Returns :func:`cylinder_poses` of places (n, 3): angle, radius, height."""
    return cylinder_poses(place[:, 0], place[:, 1], place[:, 2], turn, attitude)


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
