"""A calibration against poses: before, after, coverage, and warnings."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import sha256
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.plausibility import FEWEST_POSES
from robotrue.robot.configuration import controller_axes
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load
from robotrue.validation.evaluation import Evaluation, aligned_rows, evaluate
from robotrue.validation.metrics import (
    Coverage,
    ErrorStatistics,
    coverage,
    coverage_probability,
    error_statistics,
)
from robotrue.validation.report import AxisAngles, ValidationReport, WorstPoint, coverage_parts

__all__ = ["ValidationReport", "validate"]


FEW_POINTS: Final = 20
"""With 20 points the interval of a 95 % coverage is 24 points wide; fewer decide nothing."""
REPEATABILITY: Final = 0.03 * MM
"""m, 3-D, the best an industrial arm repeats to; part of every single visit."""
REGION_MARGIN: Final = 2.0 * DEG


def physical_floor(instrument_covariance: Array) -> float:
    """Returns the least error in m one visit per pose can show: instrument and repeatability.

    Root sum of squares of the instrument's 3-D sigma and :data:`REPEATABILITY`.

    Args:
        instrument_covariance: (n, 3, 3) m^2.
    """
    instrument = float(np.mean(np.trace(instrument_covariance, axis1=1, axis2=2)))
    return float(np.hypot(np.sqrt(instrument), REPEATABILITY))


def outside_training_region(summary: TrainingSummary, joints: Array) -> IntArray:
    """Returns the rows with a joint more than 2 deg outside the range the model was trained in.

    Without a joint range in the summary no row is returned.

    Args:
        summary: :meth:`ErrorModel.training_summary`.
        joints: (n, dof) rad.
    """
    stated = summary.joint_range
    if stated is None or stated.shape != (2, joints.shape[1]):
        return np.zeros(0, dtype=np.int64)
    low, high = stated
    outside = (joints < low - REGION_MARGIN) | (joints > high + REGION_MARGIN)
    rows: IntArray = np.flatnonzero(outside.any(axis=1))
    return rows


def find_doubts(
    *,
    after: ErrorStatistics,
    aligned: ErrorStatistics | None,
    coverage: Coverage,
    outside: int,
    floor: float,
    summary: TrainingSummary,
    measured: MeasurementSet,
) -> tuple[str, ...]:
    """Returns every reason found not to take the result at its word, one sentence each."""
    found: list[str] = []
    found.extend(_overlap_doubt(summary, measured))
    if after.n < FEWEST_POSES:
        found.append(
            f"{after.n} pose{'s' * (after.n > 1)}: only the error of these poses is known. "
            "Unknown: the accuracy of the robot, the share of points in their stated region, and "
            f"whether the file belongs to this robot; {FEWEST_POSES} or more poses check it."
        )
    elif after.n < FEW_POINTS:
        found.append(
            f"Only {after.n} poses: the largest error and the coverage are not significant; at "
            f"least {FEW_POINTS} are required."
        )
    if outside:
        found.append(
            f"{outside} of {after.n} poses have a joint outside the training range of the model: "
            "there it extrapolates."
        )
    if after.mean < floor:
        found.append(
            f"A mean of {after.mean / MM:.3f} mm is below the {floor / MM:.3f} mm that instrument "
            f"and repeatability ({REPEATABILITY / MM:.2f} mm) allow for one visit per pose: "
            "averaged, simulated, or used in the fit."
        )
    if aligned is not None and after.mean >= aligned.mean:
        found.append(
            f"Correcting only base and tool gives {aligned.mean / MM:.3f} mm on these poses, the "
            f"model {after.mean / MM:.3f} mm: the model is no better than a frame correction here."
        )
    found.extend(_coverage_doubt(coverage))
    found.extend(summary.warnings)
    return tuple(found)


def _overlap_doubt(summary: TrainingSummary, measured: MeasurementSet) -> tuple[str, ...]:
    if summary.data_sha256 == sha256(measured.joints.tobytes() + measured.position.tobytes()):
        return (
            "The model was fitted to exactly these poses: the errors show the fit, not the "
            "prediction. Validate on held-out poses.",
        )
    shared = sorted(set(summary.sources) & set(measured.sources))
    if not shared:
        return ()
    return (
        f"The fit used rows of the same file ({', '.join(shared)}): the numbers are valid only if "
        "these poses were held out.",
    )


def _coverage_doubt(coverage: Coverage) -> tuple[str, ...]:
    if coverage.is_honest:
        return ()
    direction = "too small" if coverage.share < coverage.level else "too large"
    return (
        f"The stated {100 * coverage.level:.0f} % regions hold {100 * coverage.share:.1f} % of the "
        f"poses (interval {100 * coverage.low:.1f} to {100 * coverage.high:.1f} %): the stated "
        f"uncertainty is {direction} here.",
    )


WORST_POINTS = 10


def validate(
    model: ErrorModel, measurements: MeasurementSet, *, payload: Load | None = None
) -> ValidationReport:
    """Returns the accuracy of a model at measured poses, and its warnings.

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
        worst=_worst(model.robot, seen),
        doubts=find_doubts(
            after=after,
            aligned=before_aligned,
            coverage=inside,
            outside=len(outside),
            floor=floor,
            summary=summary,
            measured=seen.measured,
        ),
        notes=_notes(
            model.robot, measurements, before_aligned is not None, axis_before is not None
        ),
        outside=outside,
        floor=floor,
        position=seen.measured.position,
        errors_before=seen.before,
        errors_after=seen.after,
        covariance=seen.covariance,
        probability=coverage_probability(seen.after, seen.covariance),
        parts=coverage_parts(
            seen.after,
            seen.covariance,
            seen.measured.position,
            seen.measured.joints,
            summary.joint_range,
        ),
    )


def _worst(robot: RobotModel, seen: Evaluation) -> tuple[WorstPoint, ...]:
    length = np.linalg.norm(seen.after, axis=1)
    rows = np.argsort(-length, kind="stable")[:WORST_POINTS]
    probability = coverage_probability(seen.after[rows], seen.covariance[rows])
    measured = seen.measured
    return tuple(
        WorstPoint(
            group=measured.group_names[int(measured.group[row])],
            source_row=int(measured.source_row[row]),
            joints=measured.joints[row],
            axes=controller_axes(robot, measured.joints[row]),
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
    # The mounting of the target on the tool is an uncommanded constant: R_tool_target, chordal
    # mean.
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


def _notes(
    robot: RobotModel, measurements: MeasurementSet, aligned: bool, rotations: bool
) -> tuple[str, ...]:
    notes = []
    if measurements.frame == "tracker":
        notes.append(
            "Positions were measured in the tracker's frame; 'before' uses the station the model "
            "estimated, so an error of the base frame is not in it."
        )
    if aligned:
        notes.append(
            "'Base and tool aligned' fits base frame and tool point to these rows: the effect of "
            "a frame correction alone."
        )
    if rotations:
        notes.append(
            "The constant rotation of the target on the tool is subtracted from tool axis angles."
        )
    if np.isfinite(measurements.temperature).any():
        low, high = np.nanmin(measurements.temperature), np.nanmax(measurements.temperature)
        notes.append(f"Temperature {low - 273.15:.1f} to {high - 273.15:.1f} deg C.")
    if np.any(measurements.wrench):
        loaded = int(np.any(measurements.wrench, axis=1).sum())
        notes.append(f"{loaded} of {len(measurements)} poses under an external wrench.")
    spread = np.ptp(controller_axes(robot, measurements.joints), axis=0) / DEG
    notes.append(
        "Axis ranges of these poses: "
        + ", ".join(f"A{i + 1} {s:.0f}" for i, s in enumerate(spread))
        + " deg."
    )
    return tuple(notes)
