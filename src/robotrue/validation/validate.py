"""A calibration against poses: before, after, how honest, and when not to believe it."""

from __future__ import annotations

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import Load
from robotrue.validation.alignment import aligned_rows
from robotrue.validation.doubts import find_doubts, outside_training_region, physical_floor
from robotrue.validation.evaluation import Evaluation, evaluate
from robotrue.validation.metrics import coverage, coverage_probability, error_statistics
from robotrue.validation.report import AxisAngles, ValidationReport, WorstPoint

__all__ = ["ValidationReport", "validate"]

WORST_POINTS = 10


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
        ModelMismatchError: Another robot, an unknown tracker station or reflector.
    """
    seen = evaluate(model, measurements, payload=payload)
    aligned = aligned_rows(model, seen.measured)
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
