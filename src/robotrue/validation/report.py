"""Result of a validation: numbers, warnings, coverage in parts, and their JSON form.

One share of covered rows over all poses may be right with regions too wide near the base and too
narrow far out. So the rows are grouped by radius and by distance from the training data, and the
error is taken apart by direction; every share has its Wilson interval, because a part has fewer
rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.special import ndtri

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG, MM
from robotrue.validation.metrics import (
    Coverage,
    ErrorStatistics,
    chi2_quantile,
    squared_distance,
    wilson_interval,
)

Question: TypeAlias = Literal["radius", "direction", "distance from the data"]
LEVEL: Final = 0.95
BANDS: Final = 3
"""Bands of the radius, of equal row count."""
FEWEST: Final = 5
"""Rows of a part below which its share is not meaningful."""
MIDDLE: Final = 0.7
"""Share of the half range of every joint up to which a pose is in the middle of the data."""
ON_AXIS: Final = 1e-3
"""m from the base axis below which radial and tangential have no meaning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CoveragePart:
    """Coverage of one part.

    Attributes:
        by: What the rows are parted by.
        part: Which part, in words with unit.
        n: Number of rows.
        share: Observed share in the stated 95 % regions.
        low: Lower end of its 95 % Wilson interval.
        high: Upper end.
    """

    by: Question
    part: str
    n: int
    share: float
    low: float
    high: float

    @property
    def is_honest(self) -> bool:
        """True when 95 % lies in the interval of the observed share."""
        return self.low <= LEVEL <= self.high

    def document(self) -> dict[str, object]:
        """Returns JSON values; shares 0 to 1."""
        return {
            "by": self.by,
            "part": self.part,
            "n": self.n,
            "coverage_95": self.share,
            "coverage_95_low": self.low,
            "coverage_95_high": self.high,
        }


def coverage_parts(
    residuals: Array,
    covariances: Array,
    position: Array,
    joints: Array,
    joint_range: Array | None,
) -> tuple[CoveragePart, ...]:
    """Returns the coverage by radius, by direction of the error and by distance from the data.

    Parts with fewer than :data:`FEWEST` rows are left out.

    Args:
        residuals: (n, 3) m, measured minus predicted, in base.
        covariances: (n, 3, 3) m^2 of the residuals.
        position: (n, 3) m, measured, in base.
        joints: (n, dof) rad.
        joint_range: (2, dof) rad of the training poses; None where it is not known.

    Raises:
        ShapeError: A covariance that is not positive definite.
    """
    inside = squared_distance(residuals, covariances) <= chi2_quantile(LEVEL, 3)
    out = _by_radius(inside, np.linalg.norm(position, axis=1))
    out += _by_direction(residuals, covariances, position)
    if joint_range is not None and joint_range.shape == (2, joints.shape[1]):
        out += _by_distance(inside, joints, joint_range)
    return tuple(out)


def _part(by: Question, part: str, inside: BoolArray) -> list[CoveragePart]:
    n = len(inside)
    if n < FEWEST:
        return []
    low, high = wilson_interval(int(inside.sum()), n)
    share = float(inside.mean())
    return [CoveragePart(by=by, part=part, n=n, share=share, low=low, high=high)]


def _by_radius(inside: BoolArray, radius: Array) -> list[CoveragePart]:
    """Bands of the distance from the base origin."""
    order = np.argsort(radius, kind="stable")
    out: list[CoveragePart] = []
    for rows in np.array_split(order, BANDS):
        if len(rows):
            words = f"{radius[rows[0]]:.2f} to {radius[rows[-1]]:.2f} m from the base"
            out += _part("radius", words, inside[rows])
    return out


def _by_direction(residuals: Array, covariances: Array, position: Array) -> list[CoveragePart]:
    """Components of the error: away from the base axis, around it, and along it."""
    across = np.linalg.norm(position[:, :2], axis=1)
    seen = across > ON_AXIS
    radial = np.zeros((int(seen.sum()), 3))
    radial[:, :2] = position[seen, :2] / across[seen, None]
    around = np.stack([-radial[:, 1], radial[:, 0], radial[:, 2]], axis=1)
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), radial.shape)
    bound = float(ndtri(0.5 + LEVEL / 2.0))
    out: list[CoveragePart] = []
    for words, axis in (("radial", radial), ("tangential", around), ("vertical", up)):
        error = (residuals[seen] * axis).sum(axis=1)
        sd = np.sqrt(np.einsum("ni,nij,nj->n", axis, covariances[seen], axis))
        out += _part("direction", words, np.abs(error) <= bound * sd)
    return out


def _by_distance(inside: BoolArray, joints: Array, joint_range: Array) -> list[CoveragePart]:
    """Coverage in the middle of the training joint ranges, near an end of one, outside."""
    low, high = joint_range
    half = np.maximum(0.5 * (high - low), 1e-9)
    off = (np.abs(joints - 0.5 * (low + high)) / half).max(axis=1)
    near, beyond = (off > MIDDLE) & (off <= 1.0), off > 1.0
    by: Question = "distance from the data"
    return [
        *_part(by, "in the middle of the training joint ranges", inside[off <= MIDDLE]),
        *_part(by, f"in the outer {100 * (1 - MIDDLE):.0f} % of a joint range", inside[near]),
        *_part(by, "outside a training joint range", inside[beyond]),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstPoint:
    """One of the rows the model misses most.

    Attributes:
        group: Name of its set.
        source_row: One-based line in the source file.
        joints: (dof,) rad.
        axes: (dof,) rad, as the controller displays them.
        position: (3,) m, measured, in base.
        before: m, length of measured minus nominal.
        after: (3,) m, measured minus predicted.
        probability: Of the smallest stated region that holds it; above 0.999 the model did not
            expect it.
    """

    group: str
    source_row: int
    joints: Array
    axes: Array
    position: Array
    before: float
    after: Array
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisAngles:
    """Angle of the tool's z axis between measured and expected, rad.

    Attributes:
        n: Rows with an orientation.
        mean: Mean angle.
        p95: 95th percentile.
        max: Largest angle.
    """

    n: int
    mean: float
    p95: float
    max: float

    def document(self) -> dict[str, object]:
        """Returns JSON values, deg."""
        angles = {"mean_deg": self.mean, "p95_deg": self.p95, "max_deg": self.max}
        return {"n": self.n, **{name: value / DEG for name, value in angles.items()}}


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationReport:
    """Validation of a model on a set of measured poses. SI, base frame.

    Attributes:
        robot: Name of the robot.
        before: Measured minus nominal, as measured. For sets in a tracker frame the station is the
            one the model estimated, so a frame error is already removed; ``notes`` states it.
        before_aligned: The same after the best base and tool fitted to these rows; None for too
            few rows.
        after: Measured minus (nominal plus predicted).
        coverage: Share of rows in their stated 95 % regions.
        axis_before: Tool axis angles before; None without orientations.
        axis_after: Tool axis angles after; None if the model predicts no rotation.
        worst: The rows with the largest errors, worst first.
        doubts: When not to trust these numbers.
        notes: How they were made.
        outside: (k,) rows outside the region the model was trained in.
        floor: m, the least mean error one visit per pose can show.
        position: (n, 3) m, measured.
        errors_before: (n, 3) m.
        errors_after: (n, 3) m.
        covariance: (n, 3, 3) m^2, of ``errors_after``.
        probability: (n,) of the smallest stated region that holds each row.
        parts: The coverage by radius, direction of the error and distance from the training data.
    """

    robot: str
    before: ErrorStatistics
    before_aligned: ErrorStatistics | None
    after: ErrorStatistics
    coverage: Coverage
    axis_before: AxisAngles | None
    axis_after: AxisAngles | None
    worst: tuple[WorstPoint, ...]
    doubts: tuple[str, ...]
    notes: tuple[str, ...]
    outside: IntArray
    floor: float
    position: Array
    errors_before: Array
    errors_after: Array
    covariance: Array
    probability: Array
    parts: tuple[CoveragePart, ...]

    @property
    def coverage_95(self) -> float:
        """Share of the rows inside their stated 95 % regions, 0 to 1."""
        return self.coverage.share

    def to_json(self) -> Mapping[str, object]:
        """Returns JSON values; lengths in mm, shares 0 to 1, units in the names.

        ``n, mean_mm, max_mm, p95_mm, std_mm, coverage_95`` and ``before`` are a contract; more
        keys may be added, none taken away.
        """
        inside = self.coverage
        return {
            **self.after.document(),
            "coverage_95": inside.share,
            "coverage_95_low": inside.low,
            "coverage_95_high": inside.high,
            "coverage_95_axis": inside.axis_share.tolist(),
            "coverage_95_parts": [part.document() for part in self.parts],
            "before": self.before.document(),
            "before_aligned": self.before_aligned and self.before_aligned.document(),
            "tool_axis_before": self.axis_before and self.axis_before.document(),
            "tool_axis_after": self.axis_after and self.axis_after.document(),
            "floor_mm": self.floor / MM,
            "outside_training_region": len(self.outside),
            "worst": [
                {
                    "set": point.group,
                    "source_row": point.source_row,
                    "joints_deg": (point.joints / DEG).tolist(),
                    "position_mm": (point.position / MM).tolist(),
                    "before_mm": point.before / MM,
                    "after_mm": (point.after / MM).tolist(),
                    "probability": point.probability,
                }
                for point in self.worst
            ],
            "doubts": list(self.doubts),
            "notes": list(self.notes),
        }
