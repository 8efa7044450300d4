"""Estimates thinned for a screen without losing a peak: smallest, largest and last of short times.

Bins lie on a grid of the host's clock, so that they do not depend on how the stream is cut into
blocks. What is not valid is counted in its bin and never part of its numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError
from robotrue.online.estimates import EstimateBlock, numbers

MOST_PER_SECOND: Final = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateBin:
    """What a short time held, columns as of :func:`~robotrue.online.estimates.numbers`.

    Attributes:
        index: Of the bin on the grid of the host's clock.
        host_time: s, of the last sample in it.
        sequence: Its number.
        rows: Samples.
        invalid: Of these not valid.
        doubt: Every doubt of any of them.
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
