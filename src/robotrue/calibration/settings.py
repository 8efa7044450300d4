"""Settings of a fit, and the priors that they state: Gaussian scales in physical units.

The default scales are those of a production industrial arm. A learned scale follows the data
(marginal likelihood), held by a weak pull to the default
(:func:`~robotrue.calibration.scale_learning.pulled_scale`), so that a group without data keeps its
physical scale. As a belief the priors are an unmeasured arm; touches of a part are added to it as
to any other.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, standard_terms
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.terms.error_vector import (
    PER_JOINT_GROUPS,
    PriorScales,
    StiffnessPrior,
    compliance_prior,
    moment_prior,
)
from robotrue.calibration.terms.ripple import harmonics
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.robust import LOSSES, Loss
from robotrue.errors import ConfigurationError
from robotrue.robot.model import MOMENTS, RobotModel, moment_slice, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load

RP_PER_SIGMA: Final = 3.6158
"""ISO 9283 RP = mean l + 3 S_l over the distances l to the barycentre. For an isotropic Gaussian of
sd sigma per axis l is Maxwell distributed: mean 1.5958 sigma, sd 0.6734 sigma."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSettings:
    """Settings of the fixed-point iteration.

    Attributes:
        loss: Robust rule of :mod:`robotrue.core.robust`.
        learn_noise: Add white noise to lengths and angles as required by the data.
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
        campaign_shift: m per axis, sd of the arm's deviation from its mean on one day; default: 12
            um, the growth of a metre of steel per kelvin. One campaign cannot show it; a prediction
            for another day includes it twice.
        solver: Robust rule, what is learned, iterations.
        lean_on_prior: Accept fewer numbers than the parameters they should determine; the others
            then come from the prior, and the verdict states it.
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
        """Refuses invalid values."""
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


LEARNED: Final = (*PER_JOINT_GROUPS, "compliance", *MOMENTS)
"""Groups of the error vector with a scale that is learned, in the order of ``Prior.group``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """Independent Gaussians about a state.

    Attributes:
        centre: The mean.
        sd: (size,) SI; zero where a parameter is held fixed.
        group: (size,) number of the learnable group, -1 where the scale stays.
    """

    centre: State
    sd: Array
    group: Array

    @property
    def free(self) -> BoolArray:
        """(size,) True where a parameter is estimated."""
        return np.asarray(self.sd > 0.0)


def build_prior(
    layout: ParameterLayout,
    centre: State,
    scales: PriorScales,
    *,
    free_groups: tuple[str, ...],
    stiffness: StiffnessPrior | None = None,
    payload_mass: float = 0.0,
    tool_rotation: bool = True,
) -> Prior:
    """Returns the prior of a fit about ``centre``.

    Args:
        layout: The parameter vector.
        centre: Mean; the compliance mean is replaced if ``stiffness`` is given.
        scales: Standard deviations.
        free_groups: Names of ``PER_JOINT`` plus ``base``, ``tool``; all others are held fixed.
        stiffness: Known stiffness, if any.
        payload_mass: kg, only scales the broad compliance prior.
        tool_rotation: Whether the reflector has axes that were measured; a bare point has none.

    Raises:
        ConfigurationError: A stiffness list of another length than the robot's joints.
    """
    dof = layout.dof
    sd = np.zeros(layout.size)
    group = np.full(layout.size, -1.0)
    deviations = dict(scales.deviations(dof))
    if "compliance" in free_groups:
        mean, deviations["compliance"] = compliance_prior(centre.robot, stiffness, payload_mass)
        errors = centre.robot.errors.copy()
        errors[parameter_slice(dof, "compliance")] = mean
        errors[moment_slice(dof)], moments = moment_prior(centre.robot)
        deviations |= dict(zip(MOMENTS, moments.reshape(2, dof), strict=True))
        centre = replace(centre, robot=centre.robot.with_errors(errors))
    for name in set(free_groups) & set(deviations):
        place = parameter_slice(dof, name)
        sd[place] = deviations[name]
        if name in LEARNED and name not in MOMENTS and (name != "compliance" or stiffness is None):
            group[place] = LEARNED.index(name)
    if not tool_rotation:
        sd[parameter_slice(dof, "tool")][3:] = 0.0
    # Stations and further reflectors are nuisances: centred on a closed-form start and far looser
    # than any data, so that they cost nothing.
    sd[layout.robot_size :] = 0.1
    return Prior(centre=centre, sd=sd, group=group)


def free_groups(method: str) -> tuple[str, ...]:
    """Returns the groups a method estimates; ``base`` and ``tool`` always.

    Raises:
        ConfigurationError: Not ``nominal``, ``geometric`` or ``elastic``.
    """
    groups = {"nominal": (), "geometric": PER_JOINT_GROUPS, "elastic": LEARNED}
    if method not in groups:
        raise ConfigurationError(f"no parameter set {method!r}; sets are {list(groups)}.")
    return (*groups[method], "base", "tool")


RIPPLE_AT_REACH: Final = 8e-5
"""m at the end of the stretched arm, sd of sine and cosine of one cycle per revolution."""
HIGHEST: Final = 16
"""Cycles per revolution of the default ripple."""


def typical_ripple(robot: RobotModel, highest: int = HIGHEST) -> Array:
    """Returns the sd (h,) rad of the ripple of N = 1 .. h cycles: falling with the root of N.

    Large arms have finer drives, so the size is the same in metres at the end of the stretched arm;
    it is what the learned model finds on a measured UR5 and UR10.
    """
    return np.asarray(RIPPLE_AT_REACH / robot.reach / np.sqrt(harmonics(highest)))


def prior_belief(
    robot: RobotModel,
    settings: FitSettings | None = None,
    *,
    ripple: Array | None = None,
    backlash: float = 0.0,
    held: str = "base",
) -> Belief:
    """Returns the belief in an arm of which only the type is known.

    The base is held: where the arm is probed, the frames of the parts take its place.

    Args:
        robot: Nominal; errors it carries are the mean.
        settings: Priors, stiffness and repeatability.
        ripple: (h,) rad, sd of sine and cosine of N = 1 .. h cycles per revolution; that of
            :func:`typical_ripple` if not given.
        backlash: rad, sd of that of each drive.
        held: Group of the error vector that is certain; empty: none.
    """
    settings = FitSettings() if settings is None else settings
    size = typical_ripple(robot) if ripple is None else frozen(ripple, (None,), "ripple")
    prior = build_prior(
        ParameterLayout(dof=robot.dof),
        State(robot=robot),
        settings.scales,
        free_groups=tuple(g for g in free_groups("elastic") if g != held),
        stiffness=settings.stiffness,
        payload_mass=float(settings.payload.mass[0]),
        tool_rotation=False,
    )
    waves = np.tile(np.repeat(size, 2), robot.dof)
    sd = np.concatenate([prior.sd, waves, np.full(robot.dof, backlash)])
    mean = np.concatenate([prior.centre.robot.errors, np.zeros(len(waves) + robot.dof)])
    return Belief(
        robot=robot.nominal(),
        terms=standard_terms(robot.dof, harmonics(len(size))),
        mean=mean,
        root=np.diag(sd)[sd > 0.0],
        white=0.0,
        repeatability=settings.repeatability_sd,
        inflation=1.0,
        T_tracker_base={},
    )
