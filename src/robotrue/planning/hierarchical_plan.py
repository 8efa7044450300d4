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

from robotrue.calibration.deng2022.domains import LEVER, Domains, check_overlap, turned_features
from robotrue.calibration.deng2022.readings import RULES, TARGET_RULE, AttitudeReading, TargetRule
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.regions import CylinderRegion, corners, grid_coordinates, points_at
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.model import RobotModel


def hierarchical_sample(
    region: CylinderRegion,
    counts: tuple[int, int, int],
    steps: Sequence[Array],
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Returns positions first, then attitudes: coordinates (n, 3) and turns (n, 3) rad.

    Positions are the complete grid. Attitudes are drawn from the complete grid of the three turns
    without repeating one before all were used.

    Args:
        region: Where.
        counts: Grid values of angle, radius and height.
        steps: Values in rad that each of rx, ry, rz may take.
        rng: Draws the attitudes.
    """
    place = grid_coordinates(region, counts)
    every = np.stack([g.ravel() for g in np.meshgrid(*steps, indexing="ij")], axis=1)
    rounds = -(-len(place) // len(every))
    order = np.concatenate([rng.permutation(len(every)) for _ in range(rounds)])[: len(place)]
    return place, every[order]


def target_counts(domains: Domains, total: int, *, further: float = 0.0) -> IntArray:
    """Returns the number of target poses of each sub-space, (k,), their sum ``total`` (rule 2).

    Args:
        domains: Where.
        total: Poses of the whole target domain.
        further: Share by which the furthest sub-space gets more than a near one; rule 2 requires
            "suitably more" without a number, and section 3 takes the same for all: 0.

    Raises:
        ConfigurationError: Fewer poses than sub-spaces, or a negative share.
    """
    k = len(domains.sub_spaces)
    if total < k or further < 0.0:
        raise ConfigurationError(
            f"{total} target poses for {k} sub-spaces, {further:g} more for the furthest; "
            "expected one each or more, and no negative share."
        )
    size = np.abs(domains.angles)
    span = float(np.ptp(size))
    wish = 1.0 + further * (size - size.min()) / (span if span > 0.0 else 1.0)
    exact = wish / wish.sum() * total
    counts: IntArray = np.maximum(np.floor(exact).astype(np.int64), 1)
    for row in np.argsort(counts - exact)[: total - int(counts.sum())]:
        counts[row] += 1
    return counts


def target_images(
    domains: Domains,
    features: Array,
    counts: IntArray,
    rng: np.random.Generator,
    *,
    rule: TargetRule = TARGET_RULE,
    errors: Array | None = None,
) -> list[IntArray]:
    """Returns, for each sub-space, the source rows whose turned poses are to be measured there.

    That target poses are images of source poses is rule 1. Which images:

    =================  =====================================================================
    ``random``         drawn
    ``boundary``       rule 3: source poses with the extreme errors, the corners of the
                       region, then others of its boundary, drawn
    ``corners``        rule 3 to the letter: the eight corners and the extreme errors, then
                       any, drawn
    ``space-filling``  each as far as possible from those already taken, attitude included
    =================  =====================================================================

    Args:
        domains: Where.
        features: (n, 6) of the source, m and rad.
        counts: (k,) poses wanted in each sub-space.
        rng: Draws.
        rule: See above.
        errors: (n, 3) m of the source, where they are known already; rule 3 then adds the poses of
            the smallest and largest error along each axis.

    Raises:
        ConfigurationError: No such rule, or more poses than the source has.
    """
    if rule not in RULES:
        raise ConfigurationError(f"no rule {rule!r}; rules are {list(RULES)}.")
    if counts.max() > len(features):
        raise ConfigurationError(
            f"{counts.max()} target poses in a sub-space, the source has only {len(features)}."
        )
    out: list[IntArray] = []
    for count in counts:
        if rule == "space-filling":
            rows = _spread(features, int(count), rng)
        else:
            rows = _order_by_rule(domains.source, features, errors, rule, rng)[: int(count)]
        out.append(rows)
    return out


def _order_by_rule(
    region: CylinderRegion,
    features: Array,
    errors: Array | None,
    rule: TargetRule,
    rng: np.random.Generator,
) -> IntArray:
    """All source rows, those required by a rule first, the others in random order."""
    drawn: IntArray = rng.permutation(len(features))
    if rule == "random":
        return drawn
    points = features[:, :3]
    gap = np.linalg.norm(points[:, None] - corners(region)[None], axis=2)
    first = [*gap.argmin(axis=0)]
    if errors is not None:
        first = [*errors.argmin(axis=0), *errors.argmax(axis=0), *first]
    rest = drawn
    if rule == "boundary":
        rest = drawn[np.argsort(~_on_boundary(region, points)[drawn], kind="stable")]
    return np.asarray(list(dict.fromkeys(int(row) for row in [*first, *rest])), dtype=np.int64)


def _on_boundary(region: CylinderRegion, points: Array) -> BoolArray:
    angle = np.arctan2(points[:, 1], points[:, 0])
    values = np.column_stack([angle, np.hypot(points[:, 0], points[:, 1]), points[:, 2]])
    near = np.abs(values[:, :, None] - region.limits[None]) < 1e-6
    return np.asarray(near.any(axis=(1, 2)))


def _spread(features: Array, count: int, rng: np.random.Generator) -> IntArray:
    """Rows chosen one by one, each furthest from those taken; the first is drawn."""
    scaled = features * np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])
    spread = np.ptp(scaled, axis=0)
    scaled = scaled / np.where(spread > 0.0, spread, 1.0)
    rows = [int(rng.integers(len(scaled)))]
    distance = np.full(len(scaled), np.inf)
    while len(rows) < count:
        distance = np.minimum(distance, np.linalg.norm(scaled - scaled[rows[-1]], axis=1))
        distance[rows] = -1.0
        rows.append(int(np.argmax(distance)))
    return np.array(rows, dtype=np.int64)


PoseMaker: TypeAlias = Callable[[Array, Array], Array]
"""T_base_target (n, 4, 4) of places (n, 3), angle, radius, height, and turns (n, 3) rad."""
REDRAWS: Final = 50
"""Times an unreachable attitude is drawn again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HierarchicalSettings:
    """Settings of a hierarchical plan.

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

    An attitude that is unreachable, here or turned by one of the angles, is drawn again: with a
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
        ReachError: A pose is out of reach; the message states its position.
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
