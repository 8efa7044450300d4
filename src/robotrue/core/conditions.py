"""Conditions of an arm at its postures: temperature, time, positions of external axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Self

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.errors import ShapeError

EXTERNAL_AXES: Final = 6
"""E1 to E6, as controllers number them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmConditions(Columns):
    """Conditions at n postures, or one row for all; NaN where they are not stated.

    An error term reads them in :attr:`~robotrue.calibration.terms.term.ArmPostures.conditions`.

    Attributes:
        temperature: (n, 1) K of the arm as a whole, or (n, dof) of each joint.
        time: (n,) s, on one clock.
        external: (n, 6) external axes, m of linear and rad of rotary ones.
    """

    temperature: Annotated[Array, Column("n _", unit="K", nan=True)]
    time: Annotated[Array, Column("n", unit="s", nan=True, fill=np.nan)] = EMPTY
    external: Annotated[Array, Column("n 6", unit="m, rad", nan=True, fill=np.nan)] = EMPTY

    def __len__(self) -> int:
        return len(self.temperature)

    def spread(self, rows: int) -> Self:
        """Returns the conditions of so many postures; one row is repeated for all.

        Raises:
            ShapeError: Another number of rows.
        """
        if len(self) not in (1, rows):
            raise ShapeError(f"conditions of {len(self)} postures, expected 1 or {rows}.")
        return self if len(self) == rows else self.take(np.zeros(rows, dtype=np.int64))


def no_conditions(rows: int = 1) -> ArmConditions:
    """Returns conditions without any stated value."""
    return ArmConditions(temperature=np.full((rows, 1), np.nan))


@dataclass(frozen=True, slots=True, kw_only=True)
class Rail(Columns):
    """A linear external axis that carries the arm.

    Attributes:
        number: 1 to 6, of E1 to E6.
        direction: (3,) unit vector in base, the way its value grows.
        at: m, its value where the base is as stated.
    """

    number: int
    direction: Annotated[Array, Column("3")]
    at: float = 0.0

    def carry(self, external: Array) -> Array:
        """Returns the displacement (n, 3) m of the arm by external axes (n, 6), base axes."""
        return np.asarray((external[:, self.number - 1, None] - self.at) * self.direction)


def join_conditions(
    *, temperature: Array, joint_temperature: Array, time: Array, external: Array
) -> ArmConditions:
    """Returns the conditions of n postures from the arrays that files and sets hold.

    Args:
        temperature: (n,) K of the arm; NaN where not measured.
        joint_temperature: (n, dof) K; that of the arm applies where NaN.
        time: (n,) s.
        external: (n, 6) m or rad.
    """
    joined = temperature[:, None]
    if not np.isnan(joint_temperature).all():
        joined = np.where(np.isnan(joint_temperature), joined, joint_temperature)
    return ArmConditions(temperature=joined, time=time, external=external)
