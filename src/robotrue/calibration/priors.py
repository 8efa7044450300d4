"""Priors: Gaussian scales in physical units, learnable per group.

The defaults are those of a production industrial arm. A scale that is learned moves to where the
data put it (marginal likelihood), held by a weak pull to the default
(:func:`robotrue.calibration.evidence.pulled_scale`), so that a group nobody can see keeps its
physical scale. As a belief the priors are an arm that nobody has measured; touches of a part are
added to it as to any other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, standard_terms
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.compliance import StiffnessPrior, compliance_prior
from robotrue.calibration.terms.first_moments import moment_prior
from robotrue.calibration.terms.geometry import PER_JOINT_GROUPS, PriorScales
from robotrue.calibration.terms.ripple import harmonics
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.errors import ConfigurationError
from robotrue.robot.model import MOMENTS, RobotModel, moment_slice, parameter_slice

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
