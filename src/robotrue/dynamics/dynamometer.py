"""From what a dynamometer reads to the force on the tool in base axes.

Three rotations relate them: the sensor's axes on its carrier; with a rotating one (Kistler 9123C)
the angle of the spindle, Rz(angle); and with any that moves with the tool the attitude of the arm.
One under the part reads the reaction.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError, ModelMismatchError

_AXES: Final = "xyz"
_STEP: Final = np.pi / 2.0
"""rad; an angle that is read less often than every quarter turn cannot be followed."""


class CarriedBy(StrEnum):
    """Part of the machine that carries the dynamometer."""

    BASE = "base"
    TOOL = "tool"
    SPINDLE = "spindle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Dynamometer(Columns):
    """Mounting of a dynamometer.

    Attributes:
        axes: (3, 3) R_carrier_sensor, right-handed.
        carried: By base (a plate under the part), tool (behind the spindle) or spindle (rotating).
        reaction: It reads the force on the part, the negative of that on the tool.
    """

    axes: Annotated[Array, Column("3 3")]
    carried: CarriedBy
    reaction: bool = False

    def _check_rules(self) -> None:
        """Checks the axes.

        Raises:
            ModelMismatchError: They are not at right angles, or left-handed.
        """
        if not np.allclose(self.axes.T @ self.axes, np.eye(3), atol=1e-9):
            raise ModelMismatchError("the axes of the sensor are not at right angles.")
        if np.linalg.det(self.axes) < 0.0:
            raise ModelMismatchError(
                "a sensor frame that is mirrored: its axes have determinant -1, expected +1.",
                hint="no mounting mirrors a sensor: one axis has the wrong sign, or two are "
                "swapped.",
            )


def parse_axes(text: str) -> Array:
    """Returns R_carrier_sensor (3, 3) of e.g. ``x,-y,-z``: where each sensor axis points.

    Raises:
        ConfigurationError: Not three different axes.
    """
    words = [word.strip().lower() for word in text.split(",")]
    out = np.zeros((3, 3))
    if len(words) == 3 and sorted(word.lstrip("+-") for word in words) == list(_AXES):
        for k, word in enumerate(words):
            out[_AXES.index(word[-1]), k] = -1.0 if word.startswith("-") else 1.0
        return out
    raise ConfigurationError(
        f"axes {text!r}, expected where the sensor's x, y and z point.",
        hint="x,y,z; or -y,x,z for a sensor turned by a quarter about z.",
    )


def unwrap_angle(angle: Array, source: str) -> Array:
    """Returns the angle (n,) rad of a spindle without leaps of a turn.

    Raises:
        ConfigurationError: It is read too seldom to be followed.
    """
    out = np.unwrap(angle)
    step = float(np.abs(np.diff(out)).max(initial=0.0))
    if step > _STEP:
        raise ConfigurationError(
            f"the spindle turns by {np.rad2deg(step):.0f} deg from one reading of its angle to "
            "the next, expected 90 at most.",
            source=source,
            hint="record the angle at the rate of the force.",
        )
    return np.asarray(out)


def force_in_base(
    reading: Array, sensor: Dynamometer, angle: Array | None, R_base_tool: Array
) -> Array:
    """Returns the force on the tool (n, 3) N, base axes.

    Args:
        reading: (n, 3) N, sensor axes.
        sensor: How it is mounted.
        angle: (n,) rad of the spindle in the tool frame about its z, for a rotating sensor.
        R_base_tool: (n, 3, 3) attitude of the tool frame.

    Raises:
        ConfigurationError: A rotating sensor without the angle of the spindle.
    """
    force = reading @ sensor.axes.T
    if sensor.reaction:
        force = -force
    if sensor.carried is CarriedBy.BASE:
        return np.asarray(force)
    if sensor.carried is CarriedBy.SPINDLE:
        if angle is None:
            raise ConfigurationError(
                "a rotating dynamometer without the angle of the spindle.",
                hint="--spindle-angle FILE with t_s,angle_deg.",
            )
        c, s = np.cos(angle), np.sin(angle)
        x, y = force[:, 0].copy(), force[:, 1].copy()
        force = np.column_stack([c * x - s * y, s * x + c * y, force[:, 2]])
    return np.asarray(np.einsum("nij,nj->ni", R_base_tool, force))
