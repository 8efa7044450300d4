"""A campaign: clamps at known tilts, forces and heights, what the sensors said, and its checks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG, MM
from robotrue.drilling.foot import Foot, plane_under, readings
from robotrue.drilling.head import AXIS_ORDER, AxisOrder, normal_from_tilt, tilt_from_normal
from robotrue.errors import ImplausibleDataError, ObservabilityError

FORCE: Final = 1000.0
"""N, one unit of force of :class:`Conditions`."""
HEIGHT: Final = 0.1
"""m, one unit of height likewise."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamps(Columns):
    """What is known of n clamps when the head has to be turned: readings and conditions.

    Attributes:
        readings: (n, k) m, less their zero.
        force: (n,) N, clamp force.
        height: (n,) m, position of the Z axis.
        approach: n labels of how the foot was brought down; blank is the one way a cell always
            does it, out of the foot's own rest position.
    """

    readings: Annotated[Array, Column("n k")]
    force: Annotated[Array, Column("n", unit="N")]
    height: Annotated[Array, Column("n", unit="m")]
    approach: Annotated[tuple[str, ...], Column("n", fill="")] = ()

    def __len__(self) -> int:
        return len(self.readings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign(Columns):
    """n clamps whose true tilt is known from outside the foot.

    Attributes:
        clamps: Readings and conditions.
        tilt: (n, 2) rad, the true normal of the surface in the spindle's frame as (a, b).
        order: Axis order the tilts are written in.
        source: File the campaign came from, or "".
        provenance: Simulated or measured, and the file.
    """

    clamps: Annotated[Clamps, Column("n")]
    tilt: Annotated[Array, Column("n 2", unit="rad")]
    order: AxisOrder = AXIS_ORDER
    source: str = ""
    provenance: Provenance = MEASURED

    def __len__(self) -> int:
        return len(self.clamps)

    @property
    def normal(self) -> Array:
        """(n, 3) true normals in the spindle's frame."""
        return normal_from_tilt(self.order, self.tilt)


def reading_errors(foot: Foot, campaign: Campaign) -> Array:
    """Returns measured less theoretical readings (n, k) m (step 4).

    The height of a clamp's plane along the spindle is not a tilt: the common part of the readings
    that theory cannot know is not taken out, it stands in the errors and is harmless there.
    """
    return campaign.clamps.readings - readings(foot, campaign.normal, np.zeros(len(campaign)))


def tilt_seen(foot: Foot, order: AxisOrder, reading: Array) -> Array:
    """Returns the tilt (n, 2) rad that uncorrected readings (n, k) m show."""
    return tilt_from_normal(order, plane_under(foot, reading).normal)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions(Columns):
    """The causes of n clamps, all that the machine knows when it has to turn.

    In units in which a coefficient is what the error changes by over a usual step of its cause.

    Attributes:
        a: (n,) deg, tilt about x as the uncorrected readings show it.
        b: (n,) deg, about y.
        force: (n,) kN.
        height: (n,) in 100 mm.
    """

    a: Annotated[Array, Column("n", unit="deg")]
    b: Annotated[Array, Column("n", unit="deg")]
    force: Annotated[Array, Column("n", unit="kN")]
    height: Annotated[Array, Column("n", unit="100 mm")]

    def __len__(self) -> int:
        return len(self.a)

    @property
    def table(self) -> Array:
        """(n, 4) a, b, force, height."""
        return np.stack([self.a, self.b, self.force, self.height], axis=-1)


def conditions(foot: Foot, order: AxisOrder, clamps: Clamps) -> Conditions:
    """Returns the causes that are known of each clamp.

    Raises:
        ShapeError: Not one reading per sensor.
    """
    tilt = tilt_seen(foot, order, clamps.readings) / DEG
    return Conditions(
        a=tilt[:, 0], b=tilt[:, 1], force=clamps.force / FORCE, height=clamps.height / HEIGHT
    )


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
