"""What one move leaves on clamps with known tilt: uncorrected, by the patent, by the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array
from robotrue.drilling.campaign import Campaign, tilt_seen
from robotrue.drilling.choose import squared_distance
from robotrue.drilling.correction import residual_tilt
from robotrue.drilling.foot_model import NormalModel, estimate_tilt
from robotrue.drilling.head import normal_from_tilt, tilt_between
from robotrue.errors import ConfigurationError

REGION: float = -2.0 * float(np.log(0.05))
"""Squared Mahalanobis distance inside which a two-dimensional error lies with 95 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Residuals:
    """Tilt left, rad: mean, 95th percentile and largest."""

    mean: float
    p95: float
    largest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltEvaluation:
    """Residual tilt of a test.

    Attributes:
        clamps: How many.
        uncorrected: Of the readings as they are.
        patent: Of the patent's regression; None where the campaign could not determine it.
        ours: Of the model.
        left: (n, 2) rad, true tilt less that of the model at every clamp.
        before: (n, 2) rad, true tilt less that of the readings as they are.
        covered: Share of clamps whose true tilt lies in the model's 95 % region.
    """

    clamps: int
    uncorrected: Residuals
    patent: Residuals | None
    ours: Residuals
    left: Array
    before: Array
    covered: float


def evaluate_test(model: NormalModel, test: Campaign) -> TiltEvaluation:
    """Returns what one move leaves on clamps the model was not learned from.

    Raises:
        ConfigurationError: No clamps, or tilts in another axis order.
    """
    if not len(test):
        raise ConfigurationError("the test holds no clamps.", source=test.source or None)
    if test.order != model.head.order:
        raise ConfigurationError(
            f"the test's tilts are in order {test.order}, the head's is {model.head.order}."
        )
    found = estimate_tilt(model, test.clamps)
    left = tilt_between(normal_from_tilt(model.head.order, found.tilt), test.normal)
    before = residual_tilt(model.foot, None, test)
    raw = tilt_seen(model.foot, model.head.order, test.clamps.readings)
    distance = squared_distance(found.tilt - test.tilt, found.covariance)
    return TiltEvaluation(
        clamps=len(test),
        uncorrected=residuals(before),
        patent=None
        if model.patent is None
        else residuals(residual_tilt(model.foot, model.patent, test)),
        ours=residuals(left),
        left=test.tilt - found.tilt,
        before=test.tilt - raw,
        covered=float(np.mean(distance <= REGION)),
    )


def residuals(left: Array) -> Residuals:
    """Returns mean, 95th percentile and largest of tilts left (n,) rad."""
    return Residuals(
        mean=float(np.mean(left)),
        p95=float(np.percentile(left, 95.0)),
        largest=float(np.max(left)),
    )
