"""Settings of a fit besides the robot and the measurements."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from robotrue.calibration.robust import LOSSES, Loss
from robotrue.calibration.terms.compliance import StiffnessPrior
from robotrue.calibration.terms.geometry import PriorScales
from robotrue.errors import ConfigurationError
from robotrue.robot.statics import NO_LOAD, Load

RP_PER_SIGMA: Final = 3.6158
"""ISO 9283 RP = mean l + 3 S_l over the distances l to the barycentre. For an isotropic Gaussian of
sd sigma per axis l is Maxwell distributed: mean 1.5958 sigma, sd 0.6734 sigma."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSettings:
    """Settings of the fixed-point iteration.

    Attributes:
        loss: Robust rule of :mod:`robotrue.calibration.robust`.
        learn_noise: Add white noise to lengths and angles as the data ask.
        learn_scales: Move the prior scales of the learnable groups.
        max_iterations: Linearisations.
        tolerance: Largest step at the end, in posterior standard deviations; or no predicted number
            moves by a hundredth of its noise.
    """

    loss: Loss = "huber"
    learn_noise: bool = True
    learn_scales: bool = True
    max_iterations: int = 300
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        """Refuses a rule that does not exist."""
        if self.loss not in LOSSES:
            raise ConfigurationError(f"no robust rule {self.loss!r}; rules are {list(LOSSES)}.")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Settings of every calibration method.

    Attributes:
        payload: Load of rows that do not state their own.
        repeatability: m, ISO 9283 RP of the arm as in its data sheet; the sd per axis is
            RP / 3.6158.
        scales: Prior standard deviations.
        stiffness: Known joint stiffness; without it a broad scale from the arm's weight is learned.
        rotation_sd: rad per axis of a measured orientation without covariance.
        campaign_shift: m per axis, sd by which the arm stands off its mean on one day; default:
            12 um, what a metre of steel grows by in a kelvin. One campaign cannot show it; a
            prediction for another day pays it twice.
        solver: Robust rule, what is learned, iterations.
        lean_on_prior: Accept fewer numbers than the parameters they should determine; the rest
            then comes from the prior, and the verdict says so.
    """

    payload: Load = NO_LOAD
    repeatability: float = 6e-5
    scales: PriorScales = field(default_factory=PriorScales)
    stiffness: StiffnessPrior | None = None
    rotation_sd: float = 2e-4
    campaign_shift: float = 1.2e-5
    solver: SolverSettings = field(default_factory=SolverSettings)
    lean_on_prior: bool = False

    def __post_init__(self) -> None:
        """Refuses values that cannot be."""
        if not 0.0 <= self.repeatability < 0.01:
            raise ConfigurationError(
                f"repeatability {self.repeatability * 1e3:g} mm, allowed 0 to 10 mm.",
                hint="0.06 mm is written repeatability=6e-5.",
            )
        if not 0.0 <= self.campaign_shift < 0.01:
            raise ConfigurationError(
                f"campaign_shift {self.campaign_shift * 1e3:g} mm, allowed 0 to 10 mm.",
                hint="0.01 mm is written campaign_shift=1e-5.",
            )
        if len(self.payload.mass) != 1 or len(self.payload.com) != 1:
            raise ConfigurationError("the default payload must be one load, not one per row.")

    @property
    def repeatability_sd(self) -> float:
        """Standard deviation per axis of one visit, m."""
        return self.repeatability / RP_PER_SIGMA
