"""Where to measure: hierarchical sampling of the source, rules for the target (section 2.4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotrue.calibration.deng2022.domains import LEVER, Domains
from robotrue.calibration.deng2022.readings import RULES, TARGET_RULE, TargetRule
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.regions import CylinderRegion, corners, grid_coordinates
from robotrue.errors import ConfigurationError


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
    """Returns how many target poses each sub-space gets, (k,), their sum ``total`` (rule 2).

    Args:
        domains: Where.
        total: Poses of the whole target domain.
        further: Share by which the furthest sub-space gets more than a near one; rule 2 asks for
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
    """All source rows, those a rule asks for first, the others in random order."""
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
