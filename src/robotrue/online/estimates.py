"""Estimates of sensing: tool error at each force sample, its 95 % band, and its validity.

As columns in shop-floor units it has the names that files, messages and pages share. For a screen
estimates are thinned without losing a peak: smallest, largest and last of short times. These bins
lie on a grid of the host's clock, so that they do not depend on how the stream is cut into blocks;
what is not valid is counted in its bin and never part of its numbers.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.csv_text import axis_names
from robotrue.core.units import DEG, UM
from robotrue.errors import ConfigurationError, ShapeError


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
    """The offset of the streams' clocks is not known well enough, or one has jumped."""
    EXTRAPOLATED = 64
    """Physics alone: the learned part is not valid here. Valid, with the wider band."""

    INVALID = NO_JOINTS | BAD_JOINTS | BAD_FORCE | OUTSIDE | SETTLING | CLOCK


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateBlock(Columns):
    """Estimates in the order of their force samples.

    Attributes:
        host_time: (n,) s on the receiving computer's monotonic clock.
        error: (n, 3) m, actual minus programmed position of the tool point, base axes; NaN where
            invalid.
        sd: (n, 3) m, its standard deviation; NaN where invalid.
        static: (n, 3) m, the part that a constant force would leave.
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
        """(n,), whether each is valid."""
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
    return (*ERROR, *SD, *STATIC, *WRENCH, *axis_names(joints))


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
    """Returns the names of the bits of a warning joined by ``+``, ``none`` for no warning."""
    names = [str(d.name).lower() for d in _BITS if doubt & d]
    return "+".join(names) or NO_DOUBT


def doubt_names() -> dict[int, str]:
    """Returns the name of each bit of a warning, lower case."""
    return {int(d): str(d.name).lower() for d in _BITS}


MOST_PER_SECOND: Final = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateBin:
    """Summary of a short interval; columns as in :func:`~robotrue.online.estimates.numbers`.

    Attributes:
        index: Of the bin on the grid of the host's clock.
        host_time: s, of the last sample in it.
        sequence: Its number.
        rows: Samples.
        invalid: Invalid samples.
        doubt: Warnings of all samples, combined.
        low: (k,) um, N, N m, deg; the smallest valid value, NaN where there is none.
        high: (k,) the largest, likewise.
        last: (k,) the last sample's.
    """

    index: int
    host_time: float
    sequence: int
    rows: int
    invalid: int
    doubt: int
    low: Array
    high: Array
    last: Array


class Envelopes:
    """A stream of blocks as bins of equal length."""

    def __init__(self, *, per_second: float, joints: int) -> None:
        """Takes the rate of bins in 1/s, and the joints of the arm.

        Raises:
            ConfigurationError: No rate a screen can show.
        """
        if not 1.0 <= per_second <= MOST_PER_SECOND:
            raise ConfigurationError(
                f"{per_second:g} updates a second, expected 1 to {MOST_PER_SECOND:g}.",
                hint="20 to 50 for a screen.",
            )
        self._rate = per_second
        self._joints = joints
        self._open: EstimateBin | None = None

    def add(self, block: EstimateBlock) -> list[EstimateBin]:
        """Returns the bins that are whole now; the last one stays open for what comes.

        Raises:
            ShapeError: The block is of an arm with another number of joints.
        """
        if not len(block):
            return []
        found = self._bins(block)
        if self._open is not None:
            if found[0].index == self._open.index:
                found[0] = _merge_bins(self._open, found[0])
            else:
                found.insert(0, self._open)
        self._open = found.pop()
        return found

    def flush(self) -> list[EstimateBin]:
        """Returns the open bin, if there is one: for a stream that has stopped."""
        found, self._open = self._open, None
        return [] if found is None else [found]

    def _bins(self, block: EstimateBlock) -> list[EstimateBin]:
        values = numbers(block, self._joints)
        index = np.floor(block.host_time * self._rate).astype(np.int64)
        starts = np.concatenate([[0], np.flatnonzero(np.diff(index)) + 1])
        ends = np.append(starts[1:], len(index))
        low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
        invalid = np.add.reduceat((~block.valid).astype(np.int64), starts)
        doubt = np.bitwise_or.reduceat(block.doubt, starts)
        return [
            EstimateBin(
                index=int(index[end - 1]),
                host_time=float(block.host_time[end - 1]),
                sequence=int(block.sequence[end - 1]),
                rows=int(end - start),
                invalid=int(invalid[k]),
                doubt=int(doubt[k]),
                low=low[k],
                high=high[k],
                last=values[end - 1],
            )
            for k, (start, end) in enumerate(zip(starts, ends, strict=True))
        ]


def _merge_bins(first: EstimateBin, second: EstimateBin) -> EstimateBin:
    return EstimateBin(
        index=second.index,
        host_time=second.host_time,
        sequence=second.sequence,
        rows=first.rows + second.rows,
        invalid=first.invalid + second.invalid,
        doubt=first.doubt | second.doubt,
        low=np.fmin(first.low, second.low),
        high=np.fmax(first.high, second.high),
        last=second.last,
    )
