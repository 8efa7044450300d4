"""The noun that validation returns: numbers, doubts, and their JSON form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import DEG, MM
from robotrue.validation.coverage_parts import CoveragePart
from robotrue.validation.metrics import Coverage, ErrorStatistics


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
            one the model estimated, so a frame error is already out; ``notes`` says so.
        before_aligned: The same after the best base and tool fitted to these rows; None for too
            few rows.
        after: Measured minus (nominal plus predicted).
        coverage: Share of rows in their stated 95 % regions.
        axis_before: Tool axis angles before; None without orientations.
        axis_after: Tool axis angles after; None if the model predicts no rotation.
        worst: The rows missed most, worst first.
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
