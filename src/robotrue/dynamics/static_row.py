"""The static row of a frequency response: how far a standing force moves the tool along one line.

A prediction from the response of one pose contains this row times the mean force, at every pose.
Whoever learns what the prediction misses elsewhere has to take it back; knowing it, and not only
that there is one, is worth another pass: along a single pass a compliance that is the same
everywhere and a factor on all joints look alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.dynamics.frf import AXES
from robotrue.dynamics.interpolation import ResponseCurve
from robotrue.errors import ConfigurationError, ModelMismatchError

OWN_PART: Final = 0.10
ANY_PART: Final = 0.03
"""Standard deviation of an entry: part of its own size, and of that of the whole row. The row of a
hammer test is that of an arm without load, tool included; it is not that of the arm that cuts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticRow(Columns):
    """Displacement along the direction of the error over a standing force.

    Attributes:
        value: (3,) m/N per force along base x, y, z, as the prediction contains it.
        sd: (3,) m/N, how well the arm and the joints' factors are known to explain it.
    """

    value: Annotated[Array, Column("3", unit="m/N")]
    sd: Annotated[Array, Column("3", unit="m/N")]

    def _check_rules(self) -> None:
        """Checks the values."""
        if not (self.sd > 0.0).all():
            raise ConfigurationError(f"sd {self.sd} m/N of a static row, expected above zero.")

    def wider(self, times: float) -> StaticRow:
        """Returns the row with its standard deviations multiplied."""
        return replace(self, sd=self.sd * times)


def static_row(value: Array) -> StaticRow:
    """Returns a row (3,) m/N with the usual standard deviations."""
    value = np.asarray(value, dtype=np.float64)
    size = float(np.linalg.norm(value))
    return StaticRow(value=value, sd=OWN_PART * np.abs(value) + ANY_PART * size)


def row_of(curve: ResponseCurve, direction: Array) -> StaticRow:
    """Returns the static row of a response whose axes are those of base.

    Args:
        curve: As predictions are made with.
        direction: (3,) unit vector in base along which the error counts positive.

    Raises:
        ModelMismatchError: The response does not say how the tool moves along the direction.
    """
    frf = curve.frf
    missing = [
        axis
        for axis, part in zip(AXES, direction, strict=True)
        if abs(part) > 1e-9 and axis not in frf.response_axes
    ]
    if missing:
        raise ModelMismatchError(
            f"the response holds no displacement along {missing[0]}, the error has one.",
            source=frf.source,
            hint="--direction along an axis of the hammer test.",
        )
    value = np.zeros(3)
    rest = curve.at_rest
    for j, axis in enumerate(frf.excitation_axes):
        for i, moved in enumerate(frf.response_axes):
            value[AXES.index(axis)] += direction[AXES.index(moved)] * rest[i, j]
    return static_row(value)
