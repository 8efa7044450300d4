"""Predictions of a model at measured rows: the comparison used by all validation.

The fair "before" goes with it: the benefit of correcting base and tool alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.arrays import Array
from robotrue.errors import ModelMismatchError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward, parameter_jacobian, walk
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Measured against commanded and against predicted, row by row, in base.

    Attributes:
        measured: The set in base.
        nominal: (n, 4, 4) T_base_tool the controller computes.
        before: (n, 3) m, measured minus nominal.
        after: (n, 3) m, measured minus (nominal plus predicted error).
        rotation_error: (n, 3) rad, predicted left rotation vector; NaN where unknown.
        covariance: (n, 3, 3) m^2 of ``after``: prediction plus instrument.
    """

    measured: MeasurementSet
    nominal: Array
    before: Array
    after: Array
    rotation_error: Array
    covariance: Array


def evaluate(
    model: ErrorModel, measurements: MeasurementSet, *, payload: Load | None = None
) -> Evaluation:
    """Returns the comparison of a model with measured rows.

    Args:
        model: Any error model.
        measurements: Rows in base, or from a station the model has estimated.
        payload: Mass and centre used where a row does not state its own; no payload if None.

    Every row is compared with its own reflector; of a further one, nominal is where the controller
    would take the place that was identified.

    Raises:
        ShapeError: No rows, or a prediction that is not finite.
        ModelMismatchError: Another number of joints, an unknown station or reflector.
    """
    if not len(measurements):
        raise ShapeError("no measured poses to compare with.")
    robot = model.robot.nominal()
    if measurements.dof != robot.dof:
        raise ModelMismatchError(
            f"{measurements.dof} joints measured, the model's robot {robot.name} has {robot.dof}.",
            hint="check that the file belongs to this robot.",
        )
    measured = model.in_base(measurements)
    n = len(measured)
    load = row_loads(measured, payload)
    nominal, covariance = np.zeros((n, 4, 4)), np.zeros((n, 3, 3))
    error, turn = np.zeros((2, n, 3))
    for k in np.unique(measured.target).tolist():
        rows = np.flatnonzero(measured.target == k)
        seen = model.at_reflector(k) if k else model
        nominal[rows] = forward(seen.robot.nominal(), measured.joints[rows])
        prediction = seen.predict(
            Query(
                joints=measured.joints[rows],
                load=load.take(rows),
                approach=measured.approach[rows],
                conditions=measured.conditions.take(rows),
            )
        )
        error[rows], turn[rows] = prediction.error, prediction.rotation_error
        covariance[rows] = prediction.covariance
    if not np.isfinite(error).all():
        row = int(np.flatnonzero(~np.isfinite(error).all(axis=1))[0])
        raise ShapeError(f"the model predicts no finite error at row {row}.")
    before = measured.position - nominal[:, :3, 3]
    return Evaluation(
        measured=measured,
        nominal=nominal,
        before=before,
        after=before - error,
        rotation_error=turn,
        covariance=covariance + measured.covariance,
    )


def row_loads(measurements: MeasurementSet, payload: Load | None = None) -> Load:
    """Returns the load of every row: its own payload where stated, else ``payload``; its wrench."""
    default = NO_LOAD if payload is None else payload
    return default.fill_rows(
        measurements.payload_mass, measurements.wrench, measurements.payload_com
    )


FEWEST_POINTS = 10
"""Nine unknowns against three equations a point; below this the alignment eats the error."""


def aligned_rows(model: ErrorModel, measured: MeasurementSet) -> Array | None:
    """Returns :func:`aligned_errors` of rows in base, base and tool by reflector.

    Returns:
        None if a reflector has fewer than :data:`FEWEST_POINTS` rows.
    """
    out = np.zeros((len(measured), 3))
    for k in np.unique(measured.target).tolist():
        mine = measured.target == k
        robot = (model.at_reflector(k) if k else model).robot
        aligned = aligned_errors(robot, measured.joints[mine], measured.position[mine])
        if aligned is None:
            return None
        out[mine] = aligned
    return out


def aligned_errors(robot: RobotModel, joints: Array, position: Array) -> Array | None:
    """Returns measured minus nominal after the best base frame and tool point, (n, 3) m.

    Least squares over base (6) and tool point (3) on these very rows, minimum norm where base and
    tool are the same motion. Much of a published "before" is such a frame error, which no
    calibration is needed to remove.

    Args:
        robot: Nominal robot with the tool that was measured.
        joints: (n, dof) rad.
        position: (n, 3) m, in base.

    Returns:
        None for fewer than :data:`FEWEST_POINTS` rows.
    """
    if len(joints) < FEWEST_POINTS:
        return None
    base, tool = parameter_slice(robot.dof, "base"), parameter_slice(robot.dof, "tool")
    free = np.concatenate([np.r_[base], np.r_[tool][:3]])
    moved = robot.nominal()
    # Frame errors of centimetres and degrees: Gauss-Newton is done in a few steps.
    for _ in range(8):
        state = walk(moved, joints)
        gap = position - state.position
        jacobian = parameter_jacobian(moved, state, joints)[:, :3, free].reshape(-1, len(free))
        step = np.linalg.lstsq(jacobian, gap.ravel(), rcond=1e-9)[0]
        errors = moved.errors.copy()
        errors[free] += step
        moved = moved.with_errors(errors)
        if np.abs(step).max() < 1e-10:
            break
    out: Array = position - walk(moved, joints).position
    return out
