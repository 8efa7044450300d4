"""Where the arm is before the first target, as the user states it: it chooses the configuration."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.robot.model import RobotModel

_AT_LIMIT = 1e-4  # rad; a printed posture may stand at a limit


def start_joints(robot: RobotModel, cell: Array, text: str | None = None) -> Array:
    """Returns the joints (6,) rad of the start posture, empty where none is stated.

    Args:
        robot: The arm.
        cell: (6,) rad, the controller's axis values the cell states; empty: none.
        text: ``A1,..,A6`` in deg, which goes before the cell; None: not stated.

    Raises:
        ConfigurationError: Not one number for each axis, or an axis beyond its limit.
    """
    axes = cell if text is None else _read(text, robot.dof)
    if not len(axes):
        return np.empty(0)
    if len(axes) != robot.dof or robot.controller is None:
        raise ConfigurationError(
            f"the start posture has {len(axes)} axes, {robot.name} has {robot.dof}.",
            hint="one number for each axis, as the pendant shows them.",
        )
    joints: Array = robot.controller.to_model(axes)
    low, high = robot.limits[:, 0] - _AT_LIMIT, robot.limits[:, 1] + _AT_LIMIT
    beyond = np.flatnonzero((joints < low) | (joints > high))
    if len(beyond):
        axis = int(beyond[0])
        ends = np.tile(joints, (2, 1))
        ends[:, axis] = robot.limits[axis]
        least, most = np.sort(robot.controller.to_controller(ends)[:, axis]) / DEG
        raise ConfigurationError(
            f"the start posture has axis {axis + 1} at {axes[axis] / DEG:g} deg, its limits are "
            f"{least:g} to {most:g} deg.",
            hint="the axis values the pendant shows where the program begins.",
        )
    return joints


def _read(text: str, count: int) -> Array:
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    if numbers.size != count or not np.isfinite(numbers).all():
        raise ConfigurationError(
            f"start posture {text!r}, expected {count} numbers in deg, as the pendant shows the "
            "axes.",
            hint="--start 0,-90,90,0,45,0",
        )
    return numbers * DEG
