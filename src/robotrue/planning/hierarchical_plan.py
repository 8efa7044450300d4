"""Hierarchical sampling: a source region completely, its images in the sub-spaces (section 2.4).

Positions are a complete grid, attitudes are drawn. The rules for target poses of Deng et al. 2022:

1. Each is the image of a source pose, turned about joint 1.
2. Sub-spaces further from the source get more of them, by a stated share.
3. They include the boundary of the region (``boundary``, ``corners``), or are drawn or spread.
4. Sub-spaces overlap, with three shared poses or more, only where the attitude is fixed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.deng2022.domains import Domains, check_overlap, turned_features
from robotrue.calibration.deng2022.readings import AttitudeReading, TargetRule
from robotrue.calibration.deng2022.sampling import (
    hierarchical_sample,
    target_counts,
    target_images,
)
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.core.regions import CylinderRegion, points_at
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import MM
from robotrue.errors import ReachError
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.model import RobotModel

PoseMaker: TypeAlias = Callable[[Array, Array], Array]
"""T_base_target (n, 4, 4) of places (n, 3), angle, radius, height, and turns (n, 3) rad."""
REDRAWS: Final = 50
"""Times an attitude that cannot be taken is drawn anew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HierarchicalSettings:
    """What a hierarchical plan samples.

    Attributes:
        counts: Grid values of angle, radius and height in the source.
        steps: rad, values that the turns rx, ry, rz of the attitude may take.
        targets: Poses of the whole target domain.
        further: Share by which the furthest sub-space gets more than the nearest (rule 2).
        rule: Which source poses have an image (rule 3).
        attitude: Whether the attitude turns with the angle.
        tool_abc: (3,) rad, KUKA A, B, C of the measured point in base, at angle 0 if it turns.
        near: (dof,) rad, a posture of the branch wanted; the middle of the limits if None.
        seed: Of attitudes and target poses.
    """

    counts: tuple[int, int, int]
    steps: Sequence[Array]
    targets: int
    further: float
    rule: TargetRule
    attitude: AttitudeReading
    tool_abc: Array
    near: Array | None
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class HierarchicalPlan:
    """Poses of the source and of the target, joints in rad.

    Attributes:
        source: (n, dof).
        target: (m, dof).
        sub_space: (m,) of each target pose, from 0.
        image: (m,) source pose that it is the turned image of.
        domains: Where.
    """

    source: Array
    target: Array
    sub_space: IntArray
    image: IntArray
    domains: Domains

    @property
    def complete(self) -> int:
        """Poses if every sub-space were sampled like the source."""
        return len(self.source) * (1 + len(self.domains.sub_spaces))


def plan_hierarchy(
    robot: RobotModel, domains: Domains, settings: HierarchicalSettings
) -> HierarchicalPlan:
    """Returns the poses to measure in the source and in every sub-space.

    Args:
        robot: Nominal arm whose tool is the measured point.
        domains: Source, target and sub-spaces.
        settings: What is sampled.

    Raises:
        ReachError: A pose is out of reach with every attitude drawn.
        ConfigurationError: Rule 4 is broken, or fewer target poses than sub-spaces.
    """
    rng = np.random.default_rng([settings.seed, 19])
    rotation = matrix_from_abc(settings.tool_abc)

    def make(place: Array, turn: Array) -> Array:
        heading = np.zeros((len(place), 3))
        if settings.attitude == "turning":
            heading[:, 0] = place[:, 0]
        turned = matrix_from_abc(heading) @ rotation @ matrix_from_abc(turn[:, ::-1])
        return pose(turned, points_at(domains.source, place))

    angles = np.array([0.0, *domains.angles])
    place, turn = sample_reachable(
        robot, domains.source, settings.counts, settings.steps, rng,
        make=make, near=settings.near, angles=angles,
    )  # fmt: skip
    features = np.column_stack([points_at(domains.source, place), turn])
    if settings.attitude == "turning":
        features[:, 5] += place[:, 0]
    counts = target_counts(domains, settings.targets, further=settings.further)
    images = target_images(domains, features, counts, rng, rule=settings.rule)
    image, sub_space = np.concatenate(images), np.repeat(np.arange(len(counts)), counts)
    there = place[image]
    there[:, 0] += domains.angles[sub_space]
    turned = [
        turned_features(features[rows], float(angle), settings.attitude)
        for rows, angle in zip(images, domains.angles, strict=True)
    ]
    check_overlap(domains, np.concatenate(turned))
    return HierarchicalPlan(
        source=reach_poses(robot, make(place, turn), settings.near),
        target=reach_poses(robot, make(there, turn[image]), settings.near),
        sub_space=sub_space,
        image=image,
        domains=domains,
    )


def sample_reachable(
    robot: RobotModel,
    region: CylinderRegion,
    counts: tuple[int, int, int],
    steps: Sequence[Array],
    rng: np.random.Generator,
    *,
    make: PoseMaker,
    near: Array | None,
    angles: Array,
) -> tuple[Array, Array]:
    """Returns the complete grid of a region (n, 3) and an attitude (n, 3) rad for each place.

    An attitude that cannot be taken, here or turned by one of the angles, is drawn anew: with a
    fixed attitude a few corners of the workspace allow only some.

    Args:
        robot: Nominal arm whose tool is the measured point.
        region: Where.
        counts: Grid values of angle, radius and height.
        steps: rad, values that each of rx, ry, rz may take.
        rng: Draws the attitudes.
        make: Makes poses of places and turns.
        near: (dof,) rad, a posture of the branch wanted.
        angles: rad, 0 and those of the sub-spaces.
    """
    place, turn = hierarchical_sample(region, counts, steps, rng)
    for _ in range(REDRAWS):
        lost = np.zeros(len(place), dtype=bool)
        for angle in angles:
            there = place + np.array([angle, 0.0, 0.0])
            joints = inverse_batch(robot, make(there, turn), near=near)
            lost |= ~np.isfinite(joints).all(axis=1)
        if not lost.any():
            break
        turn[lost] = np.stack([rng.choice(values, int(lost.sum())) for values in steps], axis=1)
    return place, turn


def reach_poses(robot: RobotModel, poses: Array, near: Array | None) -> Array:
    """Returns joints (n, dof) rad of poses (n, 4, 4).

    Raises:
        ReachError: A pose is out of reach; the message says where.
    """
    joints = inverse_batch(robot, poses, near=near)
    lost = np.flatnonzero(~np.isfinite(joints).all(axis=1))
    if len(lost):
        x, y, z = poses[lost[0], :3, 3] / MM
        raise ReachError(
            f"{len(lost)} of {len(poses)} poses of the plan are out of reach, the first at "
            f"({x:.1f}, {y:.1f}, {z:.1f}) mm.",
            hint="a smaller region, fewer turns, another attitude of the tool, or the branch.",
        )
    return joints
