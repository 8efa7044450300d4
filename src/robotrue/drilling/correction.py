"""What corrects a foot's readings: one contract, five families, and which of them to trust.

Each is judged on forces and tilts it has not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, Protocol, TypeAlias, get_args

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.drilling.campaign import Campaign, Clamps, Conditions, conditions, reading_errors
from robotrue.drilling.drill_defaults import Kind
from robotrue.drilling.foot import Foot, plane_under
from robotrue.drilling.head import AxisOrder, tilt_between, tilt_from_normal
from robotrue.drilling.physics import fit_physics
from robotrue.drilling.regression import fit_linear
from robotrue.errors import ObservabilityError

KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
"""From the simplest to the richest."""
_TO_TILT: Final = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Slopes to tilts, to first order: a turns against the slope in y, b with that in x."""
Step: TypeAlias = Callable[[str, int, int], None]
LEVELS: Final = 5
"""Blocks of force where the campaign does not keep to fewer levels."""
SECTORS: Final = 4
"""Blocks of tilt, by its direction."""
FARTHEST: Final = 16.0
"""Squared distance one held-out clamp may count: outliers alone do not widen all."""


class ReadingCorrection(Protocol):
    """A learned error of readings."""

    @property
    def noise(self) -> Array:
        """(k,) m, deviation of one reading that the correction does not explain."""
        ...

    def predict(self, c: Conditions) -> tuple[Array, Array]:
        """Returns the expected error (m, k) m and its variance, (m,) or (m, k) m^2."""
        ...


def fit_correction(kind: Kind, foot: Foot, campaign: Campaign) -> ReadingCorrection:
    """Returns a correction learned from a campaign (step 7).

    Raises:
        ObservabilityError: The campaign cannot determine it.
    """
    causes = conditions(foot, campaign.order, campaign.clamps)
    errors = reading_errors(foot, campaign)
    if kind == "gp" or kind == "physics":
        return fit_physics(causes, errors, foot.reading_sigma, rest_alone=kind == "gp")
    return fit_linear(kind, causes, errors)


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectedReadings(Columns):
    """What corrected readings show.

    Attributes:
        tilt: (n, 2) rad.
        covariance: (n, 2, 2) rad^2, of the readings' scatter and of the correction.
        residual: (n, k) m, corrected readings less those of a plane; zero with three sensors.
        conditions: The causes.
    """

    tilt: Annotated[Array, Column("n 2", unit="rad")]
    covariance: Annotated[Array, Column("n 2 2", unit="rad^2")]
    residual: Annotated[Array, Column("n k", unit="m")]
    conditions: Annotated[Conditions, Column("n")]


def correct_readings(
    foot: Foot, order: AxisOrder, correction: ReadingCorrection, clamps: Clamps
) -> CorrectedReadings:
    """Returns the tilt the corrected readings show, with its covariance.

    Raises:
        ShapeError: Not one reading per sensor.
    """
    c = conditions(foot, order, clamps)
    mean, variance = correction.predict(c)
    plane = plane_under(foot, clamps.readings - mean)
    scatter = np.maximum(correction.noise, foot.reading_sigma) ** 2
    each = (variance if variance.ndim == 2 else variance[:, None]) + scatter
    slopes = _TO_TILT @ np.linalg.pinv(foot.design)[:2]
    return CorrectedReadings(
        tilt=tilt_from_normal(order, plane.normal),
        covariance=np.einsum("ij,nj,kj->nik", slopes, each, slopes),
        residual=plane.residual,
        conditions=c,
    )


def residual_tilt(foot: Foot, correction: ReadingCorrection | None, campaign: Campaign) -> Array:
    """Returns the angle (n,) rad one move leaves to the true normal; uncorrected with ``None``."""
    readings = np.asarray(campaign.clamps.readings)
    if correction is not None:
        causes = conditions(foot, campaign.order, campaign.clamps)
        readings = readings - correction.predict(causes)[0]
    return tilt_between(plane_under(foot, readings).normal, campaign.normal)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """How a correction did on what it had not seen.

    Attributes:
        kind: Which correction.
        residual: (m,) rad, tilt left at every held-out clamp, forces first, then tilts; empty
            where it could not be learned.
        distance: (j,) squared Mahalanobis distance of the truth where tilts were held out.
        reason: Why not, or "".
    """

    kind: Kind
    residual: Array
    distance: Array
    reason: str = ""

    @property
    def mean(self) -> float:
        """Mean tilt left, rad; infinite where it could not be learned."""
        return float(np.mean(self.residual)) if len(self.residual) else float("inf")

    @property
    def stretch(self) -> float:
        """Factor on the covariance that makes the mean distance that of a normal one: 1 to 4."""
        if not len(self.distance):
            return 1.0
        return float(np.clip(np.mean(np.minimum(self.distance, FARTHEST)) / 2.0, 1.0, 4.0))


def held_out_blocks(foot: Foot, campaign: Campaign) -> tuple[list[BoolArray], list[BoolArray]]:
    """Returns the rows (n,) of each block to hold out: every force, and every sector of tilt."""
    force = campaign.clamps.force
    levels = np.unique(np.round(force, 0))
    if len(levels) > LEVELS:
        edges = np.quantile(force, np.linspace(0.0, 1.0, LEVELS + 1)[1:-1])
        level = np.searchsorted(edges, force)
    else:
        level = np.searchsorted(levels, np.round(force, 0))
    seen = conditions(foot, campaign.order, campaign.clamps)
    turn = np.arctan2(seen.b - np.median(seen.b), seen.a - np.median(seen.a))
    sector = np.floor((turn + np.pi) / (2.0 * np.pi) * SECTORS).astype(int) % SECTORS
    forces = [level == k for k in np.unique(level)] if len(np.unique(level)) > 1 else []
    return forces, [sector == k for k in np.unique(sector)]


def cross_validate(kind: Kind, foot: Foot, campaign: Campaign) -> Trial:
    """Returns how a correction does on every block when it is learned from the others."""
    forces, sectors = held_out_blocks(foot, campaign)
    left, distance = [], []
    for k, block in enumerate([*forces, *sectors]):
        try:
            learned = fit_correction(kind, foot, campaign.take(~block))
        except ObservabilityError as cause:
            nothing = np.empty(0)
            return Trial(kind=kind, residual=nothing, distance=nothing, reason=cause.message)
        held = campaign.take(block)
        left.append(residual_tilt(foot, learned, held))
        if k >= len(forces):
            found = correct_readings(foot, campaign.order, learned, held.clamps)
            distance.append(squared_distance(found.tilt - held.tilt, found.covariance))
    return Trial(kind=kind, residual=np.concatenate(left), distance=np.concatenate(distance))


def squared_distance(off: Array, covariance: Array) -> Array:
    """Returns the squared Mahalanobis distance (n,) of tilts off (n, 2) by (n, 2, 2)."""
    solved = np.linalg.solve(covariance, off[..., None])[..., 0]
    out: Array = np.einsum("ni,ni->n", off, solved)
    return out


def choose_kind(trials: tuple[Trial, ...]) -> Kind:
    """Returns the simplest correction that no richer one beats by more than chance.

    From the simplest on, a richer one takes the place of the one held when its mean is lower by
    more than the standard error of their difference, clamp by clamp.

    Raises:
        ObservabilityError: None could be learned.
    """
    able = [trial for trial in trials if len(trial.residual)]
    if not able:
        raise ObservabilityError(
            f"no correction can be learned: {trials[0].reason}",
            hint="clamp at least 15 times, with different tilts, forces and heights.",
        )
    held = able[0]
    for trial in able[1:]:
        gain = held.residual - trial.residual
        if np.mean(gain) > np.std(gain) / np.sqrt(len(gain)):
            held = trial
    return held.kind


def try_all(
    foot: Foot, campaign: Campaign, *, step: Step = lambda what, done, of: None
) -> tuple[Trial, ...]:
    """Returns the trial of every kind, the simplest first.

    Args:
        foot: The sensors.
        campaign: Clamps with known tilts.
        step: Hears which kind is on trial, how many were and of how many.
    """
    trials = []
    for k, kind in enumerate(KINDS):
        step(kind, k, len(KINDS))
        trials.append(cross_validate(kind, foot, campaign))
    return tuple(trials)
