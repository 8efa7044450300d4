"""What sensing gives: the tool's error at every force sample, its band, whether to believe it."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.errors import ShapeError


class Doubt(enum.IntFlag):
    """Why an estimate is not to be trusted; zero is trusted."""

    NONE = 0
    NO_JOINTS = 1
    """No valid joints yet, or the last are too old."""
    BAD_JOINTS = 2
    """The joints of this moment are flagged."""
    BAD_FORCE = 4
    """The force sample is flagged: not finite, counts, saturated, disconnected, out of order."""
    OUTSIDE = 8
    """A pose or force outside what the models were made for."""
    SETTLING = 16
    """Within the memory of the filters after a gap, a restart or an invalid sample."""
    CLOCK = 32
    """The streams' clocks cannot be told apart well enough, or one has jumped."""
    EXTRAPOLATED = 64
    """Physics alone: the learned part has nothing to say here. Valid, with the wider band."""

    INVALID = NO_JOINTS | BAD_JOINTS | BAD_FORCE | OUTSIDE | SETTLING | CLOCK


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateBlock(Columns):
    """Estimates in the order of the force samples they rest on.

    Attributes:
        host_time: (n,) s on the receiving computer's monotonic clock.
        error: (n, 3) m, actual minus programmed place of the tool point, base axes; NaN where
            invalid.
        sd: (n, 3) m, its standard deviation; NaN where invalid.
        static: (n, 3) m, the part a force that stands for long would leave.
        wrench: (n, 6) N and N m of the process on the tool point, base axes; NaN where invalid.
        joints: (n, dof) rad as the controller displays them, at these times; NaN where not known.
        sequence: (n,) numbers of the force samples.
        doubt: (n,) :class:`Doubt` values.
    """

    host_time: Annotated[Array, Column("n", unit="s", nan=True)]
    error: Annotated[Array, Column("n 3", unit="m", nan=True)]
    sd: Annotated[Array, Column("n 3", unit="m", nan=True)]
    static: Annotated[Array, Column("n 3", unit="m", nan=True)]
    wrench: Annotated[Array, Column("n 6", nan=True)]
    joints: Annotated[Array, Column("n dof", unit="rad", nan=True)]
    sequence: Annotated[IntArray, Column("n")]
    doubt: Annotated[IntArray, Column("n")]

    def _check_rules(self) -> None:
        """An invalid row holds no number that could be taken for one."""
        if np.count_nonzero(np.isnan(self.error) == self.valid[:, None]):
            raise ShapeError("an estimate is NaN where it is invalid, and nowhere else.")

    def __len__(self) -> int:
        return len(self.host_time)

    @property
    def valid(self) -> BoolArray:
        """(n,), whether to believe each."""
        return np.asarray((self.doubt & int(Doubt.INVALID)) == 0)
