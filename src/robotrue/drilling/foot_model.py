"""The model a drilling cell keeps: foot, head, correction, refinement, what it was tested on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.progress import Progress, unheard
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG
from robotrue.drilling.campaign import Campaign, Clamps, conditions
from robotrue.drilling.correction import (
    CorrectedReadings,
    ReadingCorrection,
    correct_readings,
    fit_correction,
)
from robotrue.drilling.correction_trials import (
    Trial,
    choose_trial,
    cross_validate,
    try_all,
)
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Kind, Position
from robotrue.drilling.foot import Foot, TakenZero
from robotrue.drilling.head import Head
from robotrue.drilling.refinement import Refinement, Watch, forget_constants
from robotrue.errors import ConfigurationError, ObservabilityError

SMALLEST: Final = 1e-3 * DEG
"""Smallest deviation of a production record that is used."""
SAME_ZERO: Final = 1e-9
"""m by which the same zero may differ where a file states it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope(Columns):
    """Ranges that a campaign covered.

    Attributes:
        force: (2,) N, lowest and highest clamp force.
        height: (2,) m, lowest and highest.
        tilt: rad, largest tilt the readings showed.
        approach: Labels of how the foot was brought down.
        positions: (4, 2) lowest and highest X, Y (m), A, B (rad); NaN where not recorded.
    """

    force: Annotated[Array, Column("2", unit="N")]
    height: Annotated[Array, Column("2", unit="m")]
    tilt: float
    approach: tuple[str, ...]
    positions: Annotated[Array, Column("4 2", nan=True, fill=np.nan)] = EMPTY


@dataclass(frozen=True, slots=True, kw_only=True)
class Residuals:
    """Tilt left, rad: mean, 95th percentile and largest."""

    mean: float
    p95: float
    largest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen(Residuals):
    """Frozen state of a model and its residual on the test.

    Attributes:
        version: Counts the freezes, from 1.
        tested_on: SHA-256 of the test campaign.
        clamps: Clamps of the test.
    """

    version: int
    tested_on: str
    clamps: int


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
        stretch: Factor on the correction's covariance from held-out tilts, at least 1.
        campaign: SHA-256 of the campaign.
        refinement: What production has added.
        monitor: Watch on what was left.
        version: Counts refinements and freezes.
        frozen: What it was frozen as; None while it may be refined.
        provenance: Of its campaign, of references in production, of the test it was frozen on.
        zero: That the readings it learned from are less; None where their foot file has none.
        new_zero: That the readings are less now, if it was taken since; not part of its file.
    """

    foot: Foot
    head: Head
    kind: Kind
    correction: ReadingCorrection
    patent: ReadingCorrection | None
    envelope: Envelope
    left: float
    stretch: float
    campaign: str
    refinement: Refinement
    monitor: Watch = field(default_factory=Watch)
    version: int = 1
    frozen: Frozen | None = None
    provenance: Provenance = MEASURED
    zero: TakenZero | None = None
    new_zero: TakenZero | None = None

    @property
    def zero_sigma(self) -> Array:
        """(2,) rad, what a zero taken since leaves uncertain of every tilt a, b.

        The error of the zero it learned with is in what it learned: only another zero counts, and
        then both do.
        """
        if self.new_zero is None:
            return np.zeros(2)
        before = np.zeros(2) if self.zero is None else self.zero.tilt_sigma
        return np.asarray(np.hypot(before, self.new_zero.tilt_sigma))


def use_zero(model: NormalModel, zero: TakenZero | None) -> NormalModel:
    """Returns a model for readings that are less this zero; None: the zero it learned with.

    Where the model does not know its own zero, one without a deviation is taken for the same.
    """
    if zero is None:
        return replace(model, new_zero=None)
    same = not zero.tilt_sigma.any()
    if model.zero is not None:
        same = np.allclose(zero.readings, model.zero.readings, rtol=0.0, atol=SAME_ZERO)
    return replace(model, new_zero=None if same else zero)


def absorb_zero(model: NormalModel) -> NormalModel:
    """Returns a model whose refinement learns what a zero taken since has changed."""
    if model.new_zero is None:
        return model
    sigma = float(np.sqrt(np.mean(model.zero_sigma**2)))
    widened = forget_constants(model.refinement, shift=sigma)
    return replace(model, refinement=widened, zero=model.new_zero, new_zero=None)


def estimate_tilt(model: NormalModel, clamps: Clamps) -> CorrectedReadings:
    """Estimates the tilt of every clamp, refined, with its covariance.

    Raises:
        ShapeError: Not one reading per sensor.
    """
    return with_refinement(
        model, correct_readings(model.foot, model.head.order, model.correction, clamps)
    )


def with_refinement(model: NormalModel, found: CorrectedReadings) -> CorrectedReadings:
    """Returns what the correction shows with what production has added to it."""
    c = found.conditions
    added, doubt = model.refinement.tilt(np.stack([c.a, c.b, c.force], axis=-1))
    return replace(
        found,
        tilt=found.tilt + added,
        covariance=model.stretch * found.covariance
        + doubt[:, None, None] * np.eye(2)
        + np.diag(model.zero_sigma**2),
    )


def fit_model(
    foot: Foot,
    head: Head,
    campaign: Campaign,
    *,
    kind: Kind | None = None,
    inputs: tuple[Position, ...] = (),
    corrects: Corrects = CORRECTS,
    digest: str = "",
    zero: TakenZero | None = None,
    step: Progress = unheard,
) -> tuple[NormalModel, tuple[Trial, ...]]:
    """Returns the model learned from a campaign, and how every correction did where it was chosen.

    Args:
        foot: The sensors.
        head: The rotary axes; their order is that of the campaign's tilts.
        campaign: Clamps with known tilts.
        kind: The correction to take; the one that wins on held-out forces and tilts without it.
        inputs: Machine positions among the causes.
        corrects: Readings, or the targets of A and B.
        digest: SHA-256 of the campaign's file.
        zero: That its readings are less, where it is known.
        step: Called with the correction on trial, the number done and the total.

    Raises:
        ConfigurationError: Tilts written in another axis order than the head's.
        ObservabilityError: No correction, or not that one, can be learned.
    """
    if campaign.order != head.order:
        raise ConfigurationError(
            f"the campaign's tilts are in order {campaign.order}, the head's is {head.order}."
        )
    trials = (
        try_all(foot, campaign, inputs=inputs, corrects=corrects, step=step)
        if kind is None
        else (cross_validate(kind, foot, campaign, inputs=inputs, corrects=corrects),)
    )
    trial = choose_trial(trials)
    model = NormalModel(
        foot=foot,
        head=head,
        kind=trial.kind,
        correction=fit_correction(trial.kind, foot, campaign, inputs=inputs, corrects=corrects),
        patent=_patent(foot, campaign, inputs, corrects),
        envelope=_envelope(foot, campaign),
        left=trial.mean,
        stretch=trial.stretch,
        campaign=digest,
        refinement=Refinement(sigma=max(trial.mean, SMALLEST)),
        provenance=campaign.provenance,
        zero=zero,
    )
    return model, trials


def _envelope(foot: Foot, campaign: Campaign) -> Envelope:
    clamps = campaign.clamps
    c = conditions(foot, campaign.order, clamps)
    positions = np.concatenate([clamps.place, clamps.axes], axis=1)
    return Envelope(
        force=np.array([clamps.force.min(), clamps.force.max()]),
        height=np.array([clamps.height.min(), clamps.height.max()]),
        tilt=float(np.hypot(c.a, c.b).max()) * DEG,
        approach=tuple(sorted(set(clamps.approach))),
        positions=np.stack([positions.min(axis=0), positions.max(axis=0)], axis=-1),
    )


def _patent(
    foot: Foot, campaign: Campaign, inputs: tuple[Position, ...], corrects: Corrects
) -> ReadingCorrection | None:
    try:
        return fit_correction("patent", foot, campaign, inputs=inputs, corrects=corrects)
    except ObservabilityError:
        return None
