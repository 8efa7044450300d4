"""What corrects a foot's readings: one contract, five families."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol, get_args

import numpy as np

from robotrue.core.arrays import Array
from robotrue.drilling.campaign import Campaign, Clamps, reading_errors
from robotrue.drilling.drill_defaults import Kind
from robotrue.drilling.foot import Foot, plane_under
from robotrue.drilling.head import AxisOrder, tilt_between, tilt_from_normal
from robotrue.drilling.physics import fit_physics
from robotrue.drilling.regression import fit_linear
from robotrue.drilling.terms import Conditions, conditions

KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
"""From the simplest to the richest."""
_TO_TILT: Final = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Slopes to tilts, to first order: a turns against the slope in y, b with that in x."""


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
class CorrectedReadings:
    """What corrected readings show.

    Attributes:
        tilt: (n, 2) rad.
        covariance: (n, 2, 2) rad^2, of the readings' scatter and of the correction.
        residual: (n, k) m, corrected readings less those of a plane; zero with three sensors.
        conditions: The causes.
    """

    tilt: Array
    covariance: Array
    residual: Array
    conditions: Conditions

    def row(self, i: int) -> CorrectedReadings:
        """Returns one clamp."""
        a, b, force, height = self.conditions.table[i : i + 1].T
        return CorrectedReadings(
            tilt=self.tilt[i : i + 1],
            covariance=self.covariance[i : i + 1],
            residual=self.residual[i : i + 1],
            conditions=Conditions(a=a, b=b, force=force, height=height),
        )


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
