"""What sensing gives: the tool's error at every force sample, its band, whether to believe it."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
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
class EstimateBlock:
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

    host_time: Array
    error: Array
    sd: Array
    static: Array
    wrench: Array
    joints: Array
    sequence: IntArray
    doubt: IntArray

    def __post_init__(self) -> None:
        """Freezes and checks; an invalid row holds no number that could be taken for one."""
        n, set_ = len(self.host_time), object.__setattr__
        shapes: dict[str, tuple[int | None, ...]] = {
            "host_time": (n,),
            "error": (n, 3),
            "sd": (n, 3),
            "static": (n, 3),
            "wrench": (n, 6),
            "joints": (n, None),
        }
        for name, shape in shapes.items():
            set_(self, name, frozen(getattr(self, name), shape, name, allow_nan=True))
        for name in ("sequence", "doubt"):
            set_(self, name, frozen(getattr(self, name), (n,), name, dtype=np.int64))
        if np.count_nonzero(np.isnan(self.error) == self.valid[:, None]):
            raise ShapeError("an estimate is NaN where it is invalid, and nowhere else.")

    def __len__(self) -> int:
        return len(self.host_time)

    @property
    def valid(self) -> BoolArray:
        """(n,), whether to believe each."""
        return np.asarray((self.doubt & int(Doubt.INVALID)) == 0)
