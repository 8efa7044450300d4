"""What sensing gives: the tool's error at every force sample, its band, whether it is valid.

As columns in shop-floor units it has the names that files, messages and pages share.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG, UM
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


_AXES: Final = ("x", "y", "z")
ERROR: Final = tuple(f"e{a}_um" for a in _AXES)
SD: Final = tuple(f"sd_{a}_um" for a in _AXES)
STATIC: Final = tuple(f"static_{a}_um" for a in _AXES)
WRENCH: Final = (*(f"f{a}_N" for a in _AXES), *(f"m{a}_Nm" for a in _AXES))
NO_DOUBT: Final = "none"
_BITS: Final = tuple(d for d in Doubt if d and d.value & (d.value - 1) == 0)


def number_columns(joints: int) -> tuple[str, ...]:
    """Returns the names of the columns of :func:`numbers`, units in the names."""
    return (*ERROR, *SD, *STATIC, *WRENCH, *(f"j{k}_deg" for k in range(1, joints + 1)))


def numbers(block: EstimateBlock, joints: int) -> Array:
    """Returns (n, 15 + joints) um, N, N m and deg; NaN where nothing is known.

    Every number of an invalid row that could be taken for an estimate is NaN, the static part and
    the band too; a block without joints has NaN there.

    Raises:
        ShapeError: The block is of an arm with another number of joints.
    """
    dof = block.joints.shape[1]
    if dof not in (0, joints):
        raise ShapeError(f"estimates of an arm of {dof} joints, expected {joints}.")
    out = np.full((len(block), 15 + joints), np.nan)
    out[:, 0:3] = block.error / UM
    out[:, 3:6] = block.sd / UM
    out[:, 6:9] = block.static / UM
    out[:, 9:15] = block.wrench
    out[:, 15 : 15 + dof] = block.joints / DEG
    out[~block.valid, :9] = np.nan
    return out


def doubt_words(doubt: int) -> str:
    """Returns the names of the bits of a doubt joined by ``+``, ``none`` for no doubt."""
    names = [str(d.name).lower() for d in _BITS if doubt & d]
    return "+".join(names) or NO_DOUBT


def doubt_names() -> dict[int, str]:
    """Returns the name of each bit of a doubt, lower case."""
    return {int(d): str(d.name).lower() for d in _BITS}
