"""Error that the laser shows without a cut: straight-edge and path, subtracted by position.

Cut and dry run are not equally long to the sample. Each sample of the cut is compared with the
nearest place of its tool point in the dry run, so clocks and starts need not agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ModelMismatchError

APART: Final = 0.5 * MM
"""Largest distance of the tool point of the cut from the path of the dry run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserRecord(Columns):
    """Displacement of the tool along the direction of the error.

    Attributes:
        time: (n,) s, even.
        displacement: (n,) m.
        source: File.
    """

    time: Annotated[Array, Column("n", unit="s")]
    displacement: Annotated[Array, Column("n", unit="m")]
    source: str

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rate(self) -> float:
        """Samples per second."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))


@dataclass(frozen=True, slots=True, kw_only=True)
class DryRun(Columns):
    """The same path without a cut.

    Attributes:
        time: (m,) s of the joints.
        place: (m, 3) m, tool point.
        laser: Readings along the path; its clock is that of ``time``.
    """

    time: Annotated[Array, Column("m", unit="s")]
    place: Annotated[Array, Column("m 3", unit="m")]
    laser: LaserRecord


def dry_displacement(dry: DryRun, time: Array, place: Array, at: Array, turn: float) -> Array:
    """Returns what the laser would show at times of the cut without one (n,) m.

    Args:
        dry: The dry run.
        time: (k,) s of the cut's joints.
        place: (k, 3) m, tool point of the cut.
        at: (n,) s of the cut's laser.
        turn: Samples of the dry laser per turn of the spindle, over which it is averaged.

    Raises:
        ModelMismatchError: The cut went another way.
        ImplausibleDataError: The dry run's laser and joints have no time in common.
    """
    laser = dry.laser
    if laser.time[0] > dry.time[-1] or laser.time[-1] < dry.time[0]:
        raise ImplausibleDataError(
            f"the dry run's laser runs from {laser.time[0]:.3f} to {laser.time[-1]:.3f} s, its "
            f"joints from {dry.time[0]:.3f} to {dry.time[-1]:.3f} s: no time in common.",
            source=laser.source,
            hint="records of one run, times of one clock.",
        )
    inside = (time >= at[0]) & (time <= at[-1])
    passed = _time_beside(dry, place[inside], laser.source)
    smooth = _mean_over(laser.displacement, max(round(turn), 1))
    return np.asarray(
        np.interp(np.interp(at, time[inside], passed), laser.time, smooth), dtype=np.float64
    )


def _time_beside(dry: DryRun, place: Array, source: str) -> Array:
    """Time of the dry run (k,) s at which it was nearest to each place (k, 3) m."""
    from scipy.spatial import cKDTree

    nearest = np.asarray(cKDTree(dry.place).query(place)[1], dtype=np.int64)
    best, found = np.full(len(place), np.inf), np.zeros(len(place))
    for start in (nearest - 1, nearest):
        a = np.clip(start, 0, len(dry.place) - 2)
        leg = dry.place[a + 1] - dry.place[a]
        length = np.maximum((leg**2).sum(axis=1), 1e-300)
        part = np.clip(((place - dry.place[a]) * leg).sum(axis=1) / length, 0.0, 1.0)
        off = np.linalg.norm(place - dry.place[a] - part[:, None] * leg, axis=1)
        better = off < best
        best = np.where(better, off, best)
        when = dry.time[a] + part * (dry.time[a + 1] - dry.time[a])
        found = np.where(better, when, found)
    if best.max() > APART:
        raise ModelMismatchError(
            f"the cut lies up to {best.max() / MM:.2f} mm from the path of the dry run, expected "
            f"{APART / MM:g} at most: a dry run of another path.",
            source=source,
            hint="repeat the dry run with the program of the cut.",
        )
    return found


def _mean_over(values: Array, width: int) -> Array:
    """Values (n,) averaged over so many samples around each; less at the ends, symmetrically."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(len(values))
    half = np.minimum(width // 2, np.minimum(index, len(values) - 1 - index))
    return np.asarray((total[index + half + 1] - total[index - half]) / (2 * half + 1))
