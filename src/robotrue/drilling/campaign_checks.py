"""Plausibility checks of a campaign: the right foot, and undetermined combinations.

The calibration plane, or the foot, may have moved while it was made. The rows of a campaign are in
the order of its clamps. If the plane is knocked after clamp k, every tilt that is stated from there
on is off by the same angle, and no cause explains it: a step does. The best of all steps is
compared with the residuals of the regression without one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign import Campaign, conditions, tilt_seen
from robotrue.drilling.correction_trials import usable_positions
from robotrue.drilling.foot import Foot, exchanged_columns, readings, sensor_orders
from robotrue.drilling.head import Head, normal_from_tilt, rotation
from robotrue.drilling.regression import columns
from robotrue.errors import ImplausibleDataError, ObservabilityError

FEWEST_FOR_STEP: Final = 20
"""Clamps below which a step explains much by chance."""
ENDS: Final = 5
"""Clamps on either side of a step, at least."""
CLEAR: Final = 0.75
"""Share of the squared residuals a step must explain; by chance .35 of 30 clamps (simulated)."""
FEWEST: Final = 8
"""Clamps below which a sensor cannot be checked."""
STUCK: Final = 0.1
"""Share of the travel it should make, below which a sensor is stuck."""
BETTER: Final = 0.5
"""Share of the error another order of sensors must leave to be the likely one."""
SLOPE: Final = (0.8, 1.25)
"""What a sensor may show per metre of travel; outside it is in another unit."""
TURNING: Final = 0.1 * DEG
"""rad, spread of the normals of one plane below which the sense is not checked."""
BETTER_SENSE: Final = 0.3
"""Share of that spread another sense must leave to be the likely one."""
NEIGHBOUR: Final = 4
"""Planes of a campaign with as many clamps more are separated."""
ONE_FORCE: Final = 1.0
"""N of spread below which all clamps are at one force."""
ONE_HEIGHT: Final = 0.1 * MM
"""m of spread likewise for the height."""
SMALLEST_FORCE: Final = 5.0
"""N that the hardest clamp of a campaign reaches, in any usual unit but kN."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignStep(Columns):
    """A step of the stated tilts.

    Attributes:
        clamp: Number of the first clamp after it, from 1.
        tilt: (2,) rad, by which the tilts stated from there on changed against the readings.
        share: Of the squared residuals that it explains.
    """

    clamp: int
    tilt: Annotated[Array, Column("2", unit="rad")]
    share: float


def find_step(foot: Foot, campaign: Campaign) -> CampaignStep | None:
    """Returns the step that best explains the unexplained residual; None if none is clear."""
    n = len(campaign)
    if n < FEWEST_FOR_STEP:
        return None
    causes = conditions(foot, campaign.order, campaign.clamps)
    off = campaign.tilt - tilt_seen(foot, campaign.order, campaign.clamps.readings)
    basis, _ = np.linalg.qr(columns("interactions", causes)[1])
    residual = off - basis @ (basis.T @ off)
    steps = (np.arange(n)[:, None] >= np.arange(ENDS, n - ENDS + 1)).astype(float)
    steps -= basis @ (basis.T @ steps)
    size = np.maximum(np.sum(steps**2, axis=0), 1.0)
    height = steps.T @ residual / size[:, None]
    share = size * np.sum(height**2, axis=1) / max(float(np.sum(residual**2)), 1e-30)
    best = int(np.argmax(share))
    if share[best] < CLEAR:
        return None
    return CampaignStep(clamp=best + ENDS + 1, tilt=height[best], share=float(share[best]))


def check_campaign(foot: Foot, campaign: Campaign) -> None:
    """Checks that the readings are those of this foot at these tilts.

    Raises:
        ObservabilityError: Too few clamps, or tilts that do not vary.
        ImplausibleDataError: A stuck sensor, exchanged sensors, another unit or sign.
    """
    n = len(campaign)
    if n < FEWEST:
        raise ObservabilityError(
            f"{n} clamps, at least {FEWEST} are needed to calibrate a foot.",
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
    _check_order(foot, campaign, measured, expected)
    _check_each(campaign, measured, expected)
    _check_force(campaign)


def campaign_warnings(foot: Foot, campaign: Campaign) -> tuple[str, ...]:
    """Returns what a campaign does not determine, a sentence each with a remedy."""
    force, height = campaign.clamps.force, campaign.clamps.height
    warnings = []
    if np.ptp(force) < ONE_FORCE:
        warnings.append(
            f"all {len(campaign)} clamps are at {force.mean():.0f} N: the effect of the force "
            "cannot be estimated, and a clamp at another force is refused. Try: two forces or "
            "more, such as drill plan --forces-n 0,250,500."
        )
    if np.ptp(height) < ONE_HEIGHT:
        warnings.append(
            f"all {len(campaign)} clamps are at z {height.mean() / MM:.1f} mm: the effect of the "
            "height cannot be estimated. Try: two heights or more, such as drill plan --z-mm "
            "-100,100."
        )
    if (step := find_step(foot, campaign)) is not None:
        a, b = (step.tilt / DEG).tolist()
        warnings.append(
            f"from clamp {step.clamp} of {len(campaign)} on the stated tilts are {a:+.3f} deg in a "
            f"and {b:+.3f} deg in b off those before, which is {100.0 * step.share:.0f} % of the "
            "squared residuals: the calibration plane, its reference or the foot has moved. Try: "
            "measure the plane and take the zero again, and replace the clamps on one side."
        )
    _, reasons = usable_positions(foot, campaign)
    warnings += [
        f"{reason}: it is not used as a cause. Try: calibration planes with different directions "
        "or in different places."
        for reason in reasons.values()
    ]
    return tuple(warnings)


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
        f"the readings travel {size:.4g} times as far as the tilts.",
        source=campaign.source or None,
        hint="check the unit of the readings, radius_mm of the foot, and that a_deg and b_deg are "
        "degrees.",
    )


def _check_each(campaign: Campaign, measured: Array, expected: Array) -> None:
    """One slope per sensor: a mirrored one, or one of another unit, among sound ones."""
    own, wanted = (values - values.mean(axis=0) for values in (measured, expected))
    slopes = np.sum(own * wanted, axis=0) / np.sum(wanted**2, axis=0)
    wrong = np.flatnonzero((slopes < SLOPE[0]) | (slopes > SLOPE[1]))
    if not len(wrong):
        return
    k = int(wrong[0])
    mirrored = SLOPE[0] <= -slopes[k] <= SLOPE[1]
    raise ImplausibleDataError(
        f"sensor {k + 1} travels {slopes[k]:.3f} times as far as the tilts, "
        f"{SLOPE[0]:g} to {SLOPE[1]:g} are possible"
        f"{': it is mounted or wired in reverse' if mirrored else ''}.",
        source=campaign.source or None,
        hint="a reading grows where the surface is farther from the foot: turn the sign of its "
        "column."
        if mirrored
        else "check the unit and the seat of this sensor, and its radius_mm.",
    )


def check_head(head: Head, campaign: Campaign) -> None:
    """Checks the sense of A and B where a campaign records them.

    Clamps on one calibration plane see one normal in the frame of the machine: with a wrong sense
    the plane seems to turn with the head.

    Raises:
        ImplausibleDataError: Another sense makes the normals of a plane agree.
    """
    axes = campaign.clamps.axes
    if len(campaign) < FEWEST or not np.isfinite(axes).all() or np.ptp(axes, axis=0).max() == 0.0:
        return
    stated = _normal_spread(head, campaign, head.sense)
    others = [(a, b) for a in (1.0, -1.0) for b in (1.0, -1.0) if (a, b) != tuple(head.sense)]
    spread, sense = min((_normal_spread(head, campaign, other), other) for other in others)
    if stated < TURNING or spread > BETTER_SENSE * stated:
        return
    wrong = [name for name, was, now in zip("AB", head.sense, sense, strict=True) if was != now]
    raise ImplausibleDataError(
        f"the calibration plane seems to turn with the head: neighbouring normals are "
        f"{stated / DEG:.3f} deg apart with sense {[int(v) for v in head.sense]}, "
        f"{spread / DEG:.3f} deg with {[int(v) for v in sense]}: reversed "
        f"axes {' and '.join(wrong)}.",
        source=campaign.source or None,
        hint=f"[head] sense = {[int(v) for v in sense]} in the foot file, or the sign of "
        f"{', '.join(f'axis_{name}_deg' for name in wrong)}.",
    )


def _normal_spread(head: Head, campaign: Campaign, sense: tuple[float, float]) -> float:
    """Median angle (rad) from each normal in the machine's frame to its fourth neighbour."""
    turned = rotation(head.order, campaign.clamps.axes * np.asarray(sense))
    normals = np.einsum("nij,nj->ni", turned, campaign.normal)
    apart = np.linalg.norm(normals[:, None] - normals[None], axis=-1)
    return float(np.median(np.sort(apart, axis=1)[:, NEIGHBOUR]))


def _check_order(foot: Foot, campaign: Campaign, measured: Array, expected: Array) -> None:
    """Exchanged sensors or tilts, or another sign: whichever explains the readings best."""
    stated = _offset_free_rms(measured, expected)
    if _offset_free_rms(-measured, expected) < BETTER * stated:
        raise ImplausibleDataError(
            "the readings fall where they should grow.",
            source=campaign.source or None,
            hint="a reading grows where the surface is farther from the foot: turn its sign, or "
            "that of a_deg and b_deg.",
        )
    causes = [_best_order(measured, expected), _best_tilts(foot, campaign)]
    left, said, hint = min(causes, key=lambda cause: cause[0])
    if left < BETTER * stated:
        raise ImplausibleDataError(
            f"the readings fit the tilts when {said}: {left / MM:.3f} mm rms residual, "
            f"{stated / MM:.3f} mm as stated.",
            source=campaign.source or None,
            hint=hint,
        )


def _best_order(measured: Array, expected: Array) -> tuple[float, str, str]:
    """Returns the residual (m) of the best order of the sensors, a finding, and a remedy."""
    trials = sensor_orders(measured.shape[1])
    left, best = min(
        ((_offset_free_rms(measured[:, list(p)], expected), p) for p in trials),
        default=(np.inf, ()),
    )
    said = exchanged_columns(best)
    return (
        left,
        f"{said}: sensors are exchanged, or the direction of their angles is reversed",
        "exchange the columns, or angles_deg of the foot.",
    )


def _best_tilts(foot: Foot, campaign: Campaign) -> tuple[float, str, str]:
    """The same of exchanged columns of the tilt, or one with the other sign."""
    a, b = campaign.tilt.T
    others = {
        "the columns a_deg and b_deg are exchanged": np.stack([b, a], axis=-1),
        "a_deg has the other sign": np.stack([-a, b], axis=-1),
        "b_deg has the other sign": np.stack([a, -b], axis=-1),
    }
    height = np.zeros(len(campaign))
    left, said = min(
        (
            _offset_free_rms(
                campaign.clamps.readings,
                readings(foot, normal_from_tilt(campaign.order, tilt), height),
            ),
            said,
        )
        for said, tilt in others.items()
    )
    return (
        left,
        said,
        "A turns about x, B about y, by the right-hand rule; or angles_deg of the foot do not run "
        "from x towards y.",
    )


def _offset_free_rms(measured: Array, expected: Array) -> float:
    """Root mean square (m) of the residual after subtracting each sensor's own offset."""
    off = measured - expected
    return float(np.sqrt(np.mean((off - off.mean(axis=0)) ** 2)))


def _check_force(campaign: Campaign) -> None:
    largest = float(np.abs(campaign.clamps.force).max())
    if 0.0 < largest < SMALLEST_FORCE:
        raise ImplausibleDataError(
            f"the largest clamp force is {largest:g} N, expected {SMALLEST_FORCE:g} N or more.",
            source=campaign.source or None,
            hint="force_N is in newtons: kN times 1000, kg times 9.81.",
        )
