"""Corrections of a foot's readings or of the head's targets: one contract, five families."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Protocol

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.drilling.campaign import (
    Campaign,
    Clamps,
    Conditions,
    conditions,
    reading_errors,
    tilt_seen,
)
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Kind, Position
from robotrue.drilling.foot import Foot, FootPlane, plane_under
from robotrue.drilling.head import AxisOrder, normal_from_tilt, tilt_between, tilt_from_normal
from robotrue.drilling.physics import fit_physics
from robotrue.drilling.regression import fit_linear

_TO_TILT: Final = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Slopes to tilts, to first order: a turns against the slope in y, b with that in x."""


class ReadingCorrection(Protocol):
    """A learned error of readings, or of the tilts that the targets of A and B are made from.

    That of tilts is in metres at the mean radius of the sensors: a and b first, then, with more
    sensors than unknowns, what each reading is off the plane.
    """

    @property
    def inputs(self) -> tuple[Position, ...]:
        """Machine positions among its causes."""
        ...

    @property
    def corrects(self) -> Corrects:
        """Quantity that the correction acts on."""
        ...

    @property
    def noise(self) -> Array:
        """(k,) m, deviation of one reading that the correction does not explain."""
        ...

    def predict(self, c: Conditions) -> tuple[Array, Array]:
        """Returns the expected error (m, k) m and its variance, (m,) or (m, k) m^2."""
        ...


def fit_correction(
    kind: Kind,
    foot: Foot,
    campaign: Campaign,
    *,
    inputs: tuple[Position, ...] = (),
    corrects: Corrects = CORRECTS,
) -> ReadingCorrection:
    """Returns a correction learned from a campaign (step 7).

    Args:
        kind: Which one.
        foot: The sensors.
        campaign: Clamps with known tilts.
        inputs: Machine positions among its causes.
        corrects: Readings, or the targets of A and B.

    Raises:
        ObservabilityError: The campaign cannot determine it.
        ImplausibleDataError: An input that is not recorded at every clamp.
    """
    causes = conditions(foot, campaign.order, campaign.clamps)
    errors = learning_errors(foot, campaign, corrects)
    if kind == "gp" or kind == "physics":
        return fit_physics(
            causes,
            errors,
            foot.reading_sigma,
            rest_alone=kind == "gp",
            inputs=inputs,
            corrects=corrects,
        )
    return fit_linear(kind, causes, errors, inputs=inputs, corrects=corrects)


def learning_errors(foot: Foot, campaign: Campaign, corrects: Corrects) -> Array:
    """Returns what a correction learns, (n, k) m: of readings, or of tilts at the mean radius."""
    if corrects == "readings":
        return reading_errors(foot, campaign)
    plane = plane_under(foot, campaign.clamps.readings)
    off = (tilt_from_normal(campaign.order, plane.normal) - campaign.tilt) * _lever(foot)
    if len(foot.radius) == foot.design.shape[1]:
        return np.asarray(off)
    return np.concatenate([off, plane.residual], axis=1)


def _lever(foot: Foot) -> float:
    """m, mean radius: a tilt times it is the reading it makes."""
    return float(np.mean(foot.radius))


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectedReadings(Columns):
    """Tilt and diagnostics computed from corrected readings.

    Attributes:
        tilt: (n, 2) rad.
        covariance: (n, 2, 2) rad^2, of the readings' scatter and of the correction.
        residual: (n, k) m, corrected readings less those of a plane; zero with three sensors.
        conditions: The causes.
        seen: (n, 2) rad, tilt of the readings as they are.
        height: (n,) m of the corrected plane; NaN of targets, whose readings are not corrected.
    """

    tilt: Annotated[Array, Column("n 2", unit="rad")]
    covariance: Annotated[Array, Column("n 2 2", unit="rad^2")]
    residual: Annotated[Array, Column("n k", unit="m")]
    conditions: Annotated[Conditions, Column("n")]
    seen: Annotated[Array, Column("n 2", unit="rad")]
    height: Annotated[Array, Column("n", unit="m", nan=True, fill=np.nan)] = EMPTY


def correct_readings(
    foot: Foot, order: AxisOrder, correction: ReadingCorrection, clamps: Clamps
) -> CorrectedReadings:
    """Returns the tilt the corrected readings show, with its covariance.

    Raises:
        ShapeError: Not one reading per sensor.
        ImplausibleDataError: A machine position that the correction uses is not recorded.
    """
    c = conditions(foot, order, clamps)
    mean, variance = correction.predict(c)
    seen = plane_under(foot, clamps.readings)
    if correction.corrects == "joints":
        return _correct_targets(foot, order, seen, c, (mean, variance, correction.noise))
    plane = plane_under(foot, clamps.readings - mean)
    scatter = np.maximum(correction.noise, foot.reading_sigma) ** 2
    each = (variance if variance.ndim == 2 else variance[:, None]) + scatter
    slopes = _TO_TILT @ np.linalg.pinv(foot.design)[:2]
    return CorrectedReadings(
        tilt=tilt_from_normal(order, plane.normal),
        covariance=np.einsum("ij,nj,kj->nik", slopes, each, slopes),
        residual=plane.residual,
        conditions=c,
        seen=tilt_from_normal(order, seen.normal),
        height=plane.height,
    )


def _correct_targets(
    foot: Foot,
    order: AxisOrder,
    plane: FootPlane,
    c: Conditions,
    learned: tuple[Array, Array, Array],
) -> CorrectedReadings:
    """The tilt of uncorrected readings less its learned error, in metres at the mean radius."""
    mean, variance, noise = learned
    lever = _lever(foot)
    floor = lever * np.sqrt(np.diag(plane.slope_covariance)[::-1])
    each = (variance[:, :2] if variance.ndim == 2 else variance[:, None]) + np.maximum(
        noise[:2], floor
    ) ** 2
    each = np.broadcast_to(each / lever**2, (len(c), 2))
    tilt = tilt_from_normal(order, plane.normal)
    return CorrectedReadings(
        tilt=tilt - mean[:, :2] / lever,
        covariance=each[:, :, None] * np.eye(2),
        residual=plane.residual - (mean[:, 2:] if mean.shape[1] > 2 else 0.0),
        conditions=c,
        seen=tilt,
    )


def residual_tilt(foot: Foot, correction: ReadingCorrection | None, campaign: Campaign) -> Array:
    """Returns the angle (n,) rad one move leaves to the true normal; uncorrected with ``None``."""
    order = campaign.order
    if correction is None:
        tilt = tilt_seen(foot, order, campaign.clamps.readings)
    else:
        tilt = correct_readings(foot, order, correction, campaign.clamps).tilt
    return tilt_between(normal_from_tilt(order, tilt), campaign.normal)
