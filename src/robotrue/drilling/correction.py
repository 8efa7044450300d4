"""What corrects a foot's readings: one contract, five families."""

from __future__ import annotations

from typing import Final, Literal, Protocol, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.drilling.campaign import Campaign, Clamps, reading_errors
from robotrue.drilling.foot import Foot, plane_under
from robotrue.drilling.head import AxisOrder, tilt_between
from robotrue.drilling.physics import fit_physics
from robotrue.drilling.regression import fit_linear
from robotrue.drilling.terms import Conditions, conditions

Kind: TypeAlias = Literal["patent", "interactions", "quadratic", "cubic", "gp", "physics"]
KINDS: Final[tuple[Kind, ...]] = (
    "patent",
    "interactions",
    "quadratic",
    "cubic",
    "gp",
    "physics",
)
"""From the simplest to the richest."""


class Correction(Protocol):
    """A learned error of readings."""

    @property
    def noise(self) -> Array:
        """(k,) m, deviation of one reading that the correction does not explain."""
        ...

    def predict(self, c: Conditions) -> tuple[Array, Array]:
        """Returns the expected error (m, k) m and its variance, (m,) or (m, k) m^2."""
        ...


def fit_correction(kind: Kind, foot: Foot, campaign: Campaign) -> Correction:
    """Returns a correction learned from a campaign (step 7).

    Raises:
        ObservabilityError: The campaign cannot determine it.
    """
    causes = conditions(foot, campaign.order, campaign.clamps)
    errors = reading_errors(foot, campaign)
    if kind == "gp" or kind == "physics":
        return fit_physics(causes, errors, foot.reading_sigma, rest_alone=kind == "gp")
    return fit_linear(kind, causes, errors)


def corrected_normal(
    foot: Foot, order: AxisOrder, correction: Correction | None, clamps: Clamps
) -> Array:
    """Returns the normals (n, 3) that the corrected readings show; uncorrected with ``None``."""
    readings = np.asarray(clamps.readings)
    if correction is not None:
        readings = readings - correction.predict(conditions(foot, order, clamps))[0]
    return plane_under(foot, readings).normal


def residual_tilt(foot: Foot, correction: Correction | None, campaign: Campaign) -> Array:
    """Returns the angle (n,) rad one move by the (corrected) readings leaves to the true normal."""
    seen = corrected_normal(foot, campaign.order, correction, campaign.clamps)
    return tilt_between(seen, campaign.normal)
