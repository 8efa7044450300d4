"""What a mere correction of base and tool is worth: the honest "before"."""

from __future__ import annotations

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import parameter_jacobian, walk
from robotrue.robot.model import RobotModel, parameter_slice

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
