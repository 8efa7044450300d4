"""The model a drilling cell keeps: foot, head, correction, refinement, what it was tested on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import DEG
from robotrue.drilling.campaign import Campaign, Clamps
from robotrue.drilling.choose import Trial, all_tried, chosen, tried
from robotrue.drilling.correction import Correction, Kind, fit_correction
from robotrue.drilling.foot import Foot, plane_under
from robotrue.drilling.head import Head, tilt_from_normal
from robotrue.drilling.monitor import Watch, watch
from robotrue.drilling.refinement import Refinement, refinement
from robotrue.drilling.terms import Conditions, conditions
from robotrue.errors import ConfigurationError, ObservabilityError

SMALLEST: Final = 1e-3 * DEG
"""Deviation of a production record below which none is believed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """What a campaign covered.

    Attributes:
        force: (2,) N, lowest and highest clamp force.
        height: (2,) m, lowest and highest.
        tilt: rad, largest tilt the readings showed.
        approach: Labels of how the foot was brought down.
    """

    force: Array
    height: Array
    tilt: float
    approach: tuple[str, ...]

    def __post_init__(self) -> None:
        """Freezes."""
        for name in ("force", "height"):
            object.__setattr__(self, name, frozen(getattr(self, name), (2,), name))


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """What a model was frozen as.

    Attributes:
        version: Counts the freezes, from 1.
        tested_on: SHA-256 of the test campaign.
        clamps: How many it held.
        mean: rad, tilt left there; and ``p95`` and ``largest``.
        p95: rad.
        largest: rad.
    """

    version: int
    tested_on: str
    clamps: int
    mean: float
    p95: float
    largest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalModel:
    """Everything one move needs.

    Attributes:
        foot: The sensors.
        head: The rotary axes.
        kind: Which correction was chosen.
        correction: It.
        patent: The patent's regression on the same campaign, to compare with; None where the
            campaign cannot determine it.
        envelope: What the campaign covered.
        left: rad, mean tilt left on held-out forces and tilts.
        campaign: SHA-256 of the campaign.
        refinement: What production has added.
        monitor: Watch on what was left.
        version: Counts refinements and freezes.
        frozen: What it was frozen as; None while it may be refined.
    """

    foot: Foot
    head: Head
    kind: Kind
    correction: Correction
    patent: Correction | None
    envelope: Envelope
    left: float
    campaign: str
    refinement: Refinement
    monitor: Watch = field(default_factory=lambda: watch(2))
    version: int = 1
    frozen: Frozen | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What a model makes of clamps.

    Attributes:
        tilt: (n, 2) rad, the corrected and refined tilt of the surface in the spindle's frame.
        covariance: (n, 2, 2) rad^2: readings, correction and refinement.
        residual: (n, k) m, corrected readings less those of a plane; zero with three sensors.
        conditions: The causes.
    """

    tilt: Array
    covariance: Array
    residual: Array
    conditions: Conditions


def seen(model: NormalModel, clamps: Clamps) -> Seen:
    """Returns the tilt every clamp stands for, with its uncertainty.

    Raises:
        ShapeError: Not one reading per sensor.
    """
    foot, order = model.foot, model.head.order
    c = conditions(foot, order, clamps)
    mean, variance = model.correction.predict(c)
    plane = plane_under(foot, clamps.readings - mean)
    added, doubt = model.refinement.tilt(np.stack([c.a, c.b, c.force], axis=-1))
    scatter = np.maximum(model.correction.noise, foot.reading_sigma)
    each = np.broadcast_to(
        (variance if variance.ndim == 2 else variance[:, None]) + scatter**2,
        clamps.readings.shape,
    )
    slopes = np.linalg.pinv(foot.design)[:2]
    covariance = np.einsum("ij,nj,kj->nik", slopes, each, slopes)
    # To first order a turns against the slope in y and b with that in x.
    to_tilt = np.array([[0.0, -1.0], [1.0, 0.0]])
    covariance = to_tilt @ covariance @ to_tilt.T + doubt[:, None, None] * np.eye(2)
    return Seen(
        tilt=tilt_from_normal(order, plane.normal) + added,
        covariance=covariance,
        residual=plane.residual,
        conditions=c,
    )


def fit_model(
    foot: Foot, head: Head, campaign: Campaign, *, kind: Kind | None = None, digest: str = ""
) -> tuple[NormalModel, tuple[Trial, ...]]:
    """Returns the model learned from a campaign, and how every correction did where it was chosen.

    Args:
        foot: The sensors.
        head: The rotary axes; their order is that of the campaign's tilts.
        campaign: Clamps with known tilts.
        kind: The correction to take; the one that wins on held-out forces and tilts without it.
        digest: SHA-256 of the campaign's file.

    Raises:
        ConfigurationError: Tilts written in another axis order than the head's.
        ObservabilityError: No correction, or not that one, can be learned.
    """
    if campaign.order != head.order:
        raise ConfigurationError(
            f"the campaign's tilts are in order {campaign.order}, the head's is {head.order}."
        )
    trials = all_tried(foot, campaign) if kind is None else (tried(kind, foot, campaign),)
    best = chosen(trials)
    left = next(trial for trial in trials if trial.kind == best).mean
    clamps = campaign.clamps
    c = conditions(foot, campaign.order, clamps)
    model = NormalModel(
        foot=foot,
        head=head,
        kind=best,
        correction=fit_correction(best, foot, campaign),
        patent=_patent(foot, campaign),
        envelope=Envelope(
            force=np.array([clamps.force.min(), clamps.force.max()]),
            height=np.array([clamps.height.min(), clamps.height.max()]),
            tilt=float(np.hypot(c.a, c.b).max()) * DEG,
            approach=tuple(sorted(set(clamps.approach))),
        ),
        left=left,
        campaign=digest,
        refinement=refinement(max(left, SMALLEST)),
    )
    return model, trials


def _patent(foot: Foot, campaign: Campaign) -> Correction | None:
    try:
        return fit_correction("patent", foot, campaign)
    except ObservabilityError:
        return None
