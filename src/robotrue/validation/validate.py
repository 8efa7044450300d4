"""A calibration against poses: before, after, how honest, and when not to believe it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import Load
from robotrue.validation.alignment import aligned_errors
from robotrue.validation.doubts import find_doubts, outside_training_region, physical_floor
from robotrue.validation.evaluation import Evaluation, evaluate
from robotrue.validation.metrics import (
    Coverage,
    ErrorStatistics,
    coverage,
    coverage_probability,
    error_statistics,
)

WORST_POINTS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstPoint:
    """One of the rows the model misses most.

    Attributes:
        group: Name of its set.
        source_row: One-based line in the source file.
        joints: (dof,) rad.
        position: (3,) m, measured, in base.
        before: m, length of measured minus nominal.
        after: (3,) m, measured minus predicted.
        probability: Of the smallest stated region that holds it; above 0.999 the model did not
            expect it.
    """

    group: str
    source_row: int
    joints: Array
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationReport:
    """What a set of measured poses says about a model. SI, base frame.

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


def validate(
    model: ErrorModel, measurements: MeasurementSet, *, payload: Load | None = None
) -> ValidationReport:
    """Returns how well a model predicts measured poses, and the doubts.

    Args:
        model: Any error model.
        measurements: Poses, best ones the fit never saw.
        payload: Used where a row does not state its own.

    Raises:
        ShapeError: No rows, or a covariance without spread.
        ModelMismatchError: Another robot, or a tracker station the model has never seen.
    """
    seen = evaluate(model, measurements, payload=payload)
    aligned = aligned_errors(model.robot, seen.measured.joints, seen.measured.position)
    before, after = error_statistics(seen.before), error_statistics(seen.after)
    before_aligned = None if aligned is None else error_statistics(aligned)
    inside = coverage(seen.after, seen.covariance)
    summary = model.training_summary()
    outside = outside_training_region(summary, seen.measured.joints)
    floor = physical_floor(seen.measured.covariance)
    axis_before, axis_after = _axis_angles(seen)
    return ValidationReport(
        robot=model.robot.name,
        before=before,
        before_aligned=before_aligned,
        after=after,
        coverage=inside,
        axis_before=axis_before,
        axis_after=axis_after,
        worst=_worst(seen),
        doubts=find_doubts(
            after=after,
            aligned=before_aligned,
            coverage=inside,
            outside=len(outside),
            floor=floor,
            summary=summary,
            measured=seen.measured,
        ),
        notes=_notes(measurements, before_aligned is not None, axis_before is not None),
        outside=outside,
        floor=floor,
        position=seen.measured.position,
        errors_before=seen.before,
        errors_after=seen.after,
        covariance=seen.covariance,
        probability=coverage_probability(seen.after, seen.covariance),
    )


def _worst(seen: Evaluation) -> tuple[WorstPoint, ...]:
    length = np.linalg.norm(seen.after, axis=1)
    rows = np.argsort(-length, kind="stable")[:WORST_POINTS]
    probability = coverage_probability(seen.after[rows], seen.covariance[rows])
    measured = seen.measured
    return tuple(
        WorstPoint(
            group=measured.group_names[int(measured.group[row])],
            source_row=int(measured.source_row[row]),
            joints=measured.joints[row],
            position=measured.position[row],
            before=float(np.linalg.norm(seen.before[row])),
            after=seen.after[row],
            probability=float(p),
        )
        for row, p in zip(rows, probability, strict=True)
    )


def _axis_angles(seen: Evaluation) -> tuple[AxisAngles | None, AxisAngles | None]:
    """Returns tool axis angles before and after, each with its own constant target rotation out."""
    known = seen.measured.has_rotation
    if not known.any():
        return None, None
    measured, nominal = seen.measured.rotation[known], seen.nominal[known, :3, :3]
    before = _axis_statistics(measured, nominal)
    turn = seen.rotation_error[known]
    if not np.isfinite(turn).all():
        return before, None
    return before, _axis_statistics(measured, matrix_from_rotation_vector(turn) @ nominal)


def _axis_statistics(measured: Array, expected: Array) -> AxisAngles:
    # How the target sits on the tool is a constant nobody commanded: R_tool_target, chordal mean.
    u, _, vt = np.linalg.svd(np.mean(np.swapaxes(expected, 1, 2) @ measured, axis=0))
    constant = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    aim = expected[:, :, 2]
    axis = (measured @ constant.T)[:, :, 2]
    angle = np.arctan2(np.linalg.norm(np.cross(aim, axis), axis=1), np.sum(aim * axis, axis=1))
    return AxisAngles(
        n=len(angle),
        mean=float(angle.mean()),
        p95=float(np.percentile(angle, 95.0)),
        max=float(angle.max()),
    )


def _notes(measurements: MeasurementSet, aligned: bool, rotations: bool) -> tuple[str, ...]:
    notes = []
    if measurements.frame == "tracker":
        notes.append(
            "Positions were measured in the tracker's frame; 'before' uses the station the model "
            "estimated, so an error of the base frame is not in it."
        )
    if aligned:
        notes.append(
            "'Base and tool aligned' fits base frame and tool point to these very rows: what a "
            "frame correction alone is worth."
        )
    if rotations:
        notes.append("Tool axis angles leave out the constant rotation of the target on the tool.")
    if np.isfinite(measurements.temperature).any():
        low, high = np.nanmin(measurements.temperature), np.nanmax(measurements.temperature)
        notes.append(f"Temperature {low - 273.15:.1f} to {high - 273.15:.1f} deg C.")
    if np.any(measurements.wrench):
        loaded = int(np.any(measurements.wrench, axis=1).sum())
        notes.append(f"{loaded} of {len(measurements)} poses under an external wrench.")
    spread = np.ptp(measurements.joints, axis=0) / DEG
    notes.append(
        "Joint ranges of these poses: "
        + ", ".join(f"J{i + 1} {s:.0f}" for i, s in enumerate(spread))
        + " deg."
    )
    return tuple(notes)
