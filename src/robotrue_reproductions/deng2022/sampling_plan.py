"""The sampling plan of Deng et al. 2022, Tables 6 and 7, for one draw of its random attitudes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from robotrue.calibration.deng2022.domains import Domains, divide_target
from robotrue.calibration.deng2022.readings import TargetRule
from robotrue.core.arrays import Array, IntArray
from robotrue.core.regions import CylinderRegion, points_at
from robotrue.core.units import DEG
from robotrue.planning.hierarchical_plan import (
    reach_poses,
    sample_reachable,
    target_counts,
    target_images,
)
from robotrue.robot.model import RobotModel
from robotrue.simulation.plans import (
    POSTURE,
    VALIDATION,
    Attitude,
    Region,
    poses_at,
    region_poses,
    with_attitude,
)

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
        source=_joints(robot, poses_at(place, turn, attitude)),
        target=_joints(robot, poses_at(there, turn[image], attitude)),
        sub_space=sub_space,
        image=image,
        validation=_joints(robot, poses_at(grid, grid_turn, attitude)),
        check=_joints(robot, region_poses(inside, 50, rng)),
    )


def _sample(
    robot: RobotModel,
    region: CylinderRegion,
    rng: np.random.Generator,
    attitude: Attitude,
    angles: Array,
) -> tuple[Array, Array]:
    """The complete positions of Table 6 in a region and an attitude for each."""
    count = round((region.angle[1] - region.angle[0]) / ANGLE_STEP) + 1
    return sample_reachable(
        robot,
        region,
        (count, *PER_ANGLE),
        STEPS,
        rng,
        make=partial(poses_at, attitude=attitude),
        near=POSTURE,
        angles=angles,
    )


def _joints(robot: RobotModel, poses: Array) -> Array:
    return reach_poses(robot, poses, POSTURE)
