"""What cannot be a campaign: a stuck sensor, exchanged cables, another unit, a turned sign."""

from __future__ import annotations

from itertools import permutations
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.foot import Foot, readings
from robotrue.errors import ImplausibleDataError, ObservabilityError

FEWEST: Final = 8
"""Clamps below which nothing can be said of a sensor."""
STUCK: Final = 0.1
"""Share of the travel it should make, below which a sensor is stuck."""
BETTER: Final = 0.5
"""Share of the error another order of sensors must leave to be the likely one."""
SLOPE: Final = (0.8, 1.25)
"""What a sensor may show per metre of travel; outside it is in another unit."""
SHUFFLED: Final = 6
"""Most sensors whose orders are all tried."""


def check_campaign(foot: Foot, campaign: Campaign) -> None:
    """Checks that the readings are those of this foot at these tilts.

    Raises:
        ObservabilityError: Too few clamps, or tilts that do not vary.
        ImplausibleDataError: A stuck sensor, exchanged sensors, another unit or sign.
    """
    n = len(campaign)
    if n < FEWEST:
        raise ObservabilityError(
            f"{n} clamps, at least {FEWEST} are needed to learn anything of a foot.",
            source=campaign.source or None,
            hint="clamp 15 times or more, with different tilts, forces and heights.",
        )
    expected = readings(foot, campaign.normal, np.zeros(n))
    travel = np.ptp(expected, axis=0)
    if not (travel > 20.0 * foot.reading_sigma).all():
        raise ObservabilityError(
            f"the tilts move the sensors by {travel.min() / MM:.4f} mm only.",
            source=campaign.source or None,
            hint="tilt the head by some degrees either way.",
        )
    measured = campaign.clamps.readings
    _check_stuck(campaign, measured, travel)
    _check_slopes(campaign, measured, expected)
    _check_order(campaign, measured, expected)


def _check_stuck(campaign: Campaign, measured: Array, travel: Array) -> None:
    made = np.ptp(measured, axis=0)
    still = np.flatnonzero(made < STUCK * travel)
    if len(still) == len(travel):
        return  # another unit; said there
    if len(still):
        k = int(still[0])
        raise ImplausibleDataError(
            f"sensor {k + 1} moves by {made[k] / MM:.4f} mm where {travel[k] / MM:.4f} mm are "
            "expected: it is stuck, or not connected.",
            source=campaign.source or None,
            hint="free the sensor and clamp again.",
        )


def _check_slopes(campaign: Campaign, measured: Array, expected: Array) -> None:
    """One slope for all sensors at once: an exchange leaves it small, but not another unit."""
    size = float(np.ptp(measured, axis=0).mean() / np.ptp(expected, axis=0).mean())
    if SLOPE[0] <= size <= SLOPE[1]:
        return
    raise ImplausibleDataError(
        f"the readings travel {size:.4g} times as far as the tilts say.",
        source=campaign.source or None,
        hint="check the unit of the readings, radius_mm of the foot, and that a_deg and b_deg are "
        "degrees.",
    )


def _check_order(campaign: Campaign, measured: Array, expected: Array) -> None:
    stated = _offset_free_rms(measured, expected)
    if _offset_free_rms(-measured, expected) < BETTER * stated:
        raise ImplausibleDataError(
            "the readings fall where they should grow.",
            source=campaign.source or None,
            hint="a reading grows where the surface is farther from the foot: turn its sign, or "
            "that of a_deg and b_deg.",
        )
    sensors = measured.shape[1]
    if sensors > SHUFFLED:
        return
    best = min(
        permutations(range(sensors)), key=lambda p: _offset_free_rms(measured[:, list(p)], expected)
    )
    if _offset_free_rms(measured[:, list(best)], expected) < BETTER * stated:
        said = ", ".join(f"column {p + 1} is sensor {k + 1}" for k, p in enumerate(best) if p != k)
        raise ImplausibleDataError(
            f"the readings fit the tilts when {said}: sensors are exchanged, or their angles run "
            "the other way round.",
            source=campaign.source or None,
            hint="exchange the columns, or angles_deg of the foot.",
        )


def _offset_free_rms(measured: Array, expected: Array) -> float:
    """Root mean square (m) of what is left once every sensor's own offset is taken out."""
    off = measured - expected
    return float(np.sqrt(np.mean((off - off.mean(axis=0)) ** 2)))
