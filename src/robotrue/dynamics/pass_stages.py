"""Stages of a record: entry, steady cut, exit; and the sensor's zero around them.

The force of each turn of the spindle is one number, the root of its mean square. Half of the
highest values separates cut from air; the median of the turns in the cut is its level. The air
before and after the cut shows the zero of the dynamometer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.dynamics.force import ForceRecord
from robotrue.errors import ImplausibleDataError, ObservabilityError

TOUCHED: Final = 0.1
"""Part of the way from air to the cut's level at which the tool has touched."""
FULL: Final = 0.8
"""Part of that way from which the tool is fully in the cut. Depth and material may vary by less."""
_CUT: Final = 0.5
_CONTRAST: Final = 3.0
"""The cut has so many times the force of the air at least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PassStages:
    """Stages of a pass as times of its force record, s.

    Attributes:
        entry: The tool touches.
        steady: It is fully in the cut.
        leaving: It begins to leave.
        end: It is free.
        level: N, rms force of the steady stage.
        air: N, rms force of the air before and after.
    """

    entry: float
    steady: float
    leaving: float
    end: float
    level: float
    air: float


def find_stages(time: Array, force: Array, turn: float, source: str) -> PassStages:
    """Returns the stages of a pass, to a turn of the spindle.

    Args:
        time: (n,) s, even.
        force: (n, 3) N.
        turn: Samples per turn.
        source: Of messages.

    Raises:
        ImplausibleDataError: The record begins or ends in the cut, holds none, or two.
    """
    count = int(np.floor(len(force) / turn + 1e-9))
    if count < 4:
        raise ImplausibleDataError(
            f"{count} turns of the spindle, expected four or more.",
            source=source,
            hint="--spindle-rpm, or a longer record.",
        )
    edges = np.rint(np.arange(count + 1) * turn).astype(np.int64)
    square = np.add.reduceat((force**2).sum(axis=1)[: edges[-1]], edges[:-1])
    size = np.sqrt(square / np.diff(edges))
    cutting = size > _CUT * float(np.quantile(size, 0.9))
    level, air = float(np.median(size[cutting])), _air_of(size, cutting, source)
    if level < _CONTRAST * air:
        raise ImplausibleDataError(
            f"a force of {air:.3g} N in the air and {level:.3g} N in the cut: no cut is visible.",
            source=source,
            hint="take the sensor's offset off, or check that this record holds the pass.",
        )
    way = (size - air) / (level - air)
    inside = np.flatnonzero(way >= FULL)
    first, last = int(inside[0]), int(inside[-1])
    gap = np.flatnonzero(way[first : last + 1] < TOUCHED)
    if gap.size:
        raise ImplausibleDataError(
            f"the tool leaves the cut at {time[edges[first + int(gap[0])]]:.3f} s and comes back.",
            source=source,
            hint="cut the record: one pass each.",
        )
    before = np.flatnonzero(way[:first] < TOUCHED)
    behind = np.flatnonzero(way[last + 1 :] < TOUCHED)
    at = edges / (len(force) - 1) * (time[-1] - time[0]) + time[0]
    return PassStages(
        entry=float(at[int(before[-1]) + 1]),
        steady=float(at[first]),
        leaving=float(at[last + 1]),
        end=float(at[last + 1 + int(behind[0])]),
        level=level,
        air=air,
    )


def _air_of(size: Array, cutting: Array, source: str) -> float:
    """Returns the force in air, of the turns before the first that cuts and after the last."""
    inside = np.flatnonzero(cutting)
    before, behind = size[: inside[0]], size[inside[-1] + 1 :]
    for part, where in ((before, "begins"), (behind, "ends")):
        if len(part) == 0:
            raise ImplausibleDataError(
                f"the record {where} in the cut: entry and exit cannot be separated from the cut.",
                source=source,
                hint="record from before the tool touches until it is free.",
            )
    return float(min(np.median(before), np.median(behind)))


def zero_at_both_ends(
    record: ForceRecord, stages: PassStages, turn: float
) -> tuple[ForceRecord, Array]:
    """Returns the record without its zero, and the zero before and after the cut (2, 3) N.

    A charge amplifier drifts along a pass. The mean of whole turns in the air is its zero there;
    between the two it is taken for a straight line.

    Args:
        record: In the axes of the sensor.
        stages: Of the pass.
        turn: Samples per turn of the spindle.

    Raises:
        ObservabilityError: Less than a turn of air on one side.
    """
    time = record.time
    before, behind = np.flatnonzero(time < stages.entry), np.flatnonzero(time >= stages.end)
    zeros, middles = [], []
    for rows, where in ((before, "before"), (behind, "behind")):
        whole = round(np.floor(len(rows) / turn + 1e-9) * turn)
        if whole < 1:
            raise ObservabilityError(
                f"{len(rows)} samples of air {where} the cut, expected a turn of {turn:.0f}.",
                source=record.source,
                hint="record for a second more on both sides.",
            )
        taken = rows[:whole] if where == "before" else rows[-whole:]
        zeros.append(record.force[taken].mean(axis=0))
        middles.append(time[taken].mean())
    part = (time - middles[0]) / (middles[1] - middles[0])
    line = zeros[0] + part[:, None] * (zeros[1] - zeros[0])
    return replace(record, force=record.force - line), np.array(zeros)
