"""What is believed before the data: Gaussian scales in physical units, learnable per group.

The defaults are those of a production industrial arm. A scale that is learned moves to where the
data put it (marginal likelihood), held by a weak pull to the default
(:func:`robotrue.calibration.evidence.pulled_scale`), so that a group nobody can see keeps its
physical scale.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.parameters import Layout, State
from robotrue.calibration.terms.compliance import StiffnessPrior, compliance_prior
from robotrue.calibration.terms.geometry import PER_JOINT_GROUPS, PriorScales
from robotrue.core.arrays import Array, BoolArray
from robotrue.robot.model import parameter_slice

LEARNED: Final = (*PER_JOINT_GROUPS, "compliance")
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
    layout: Layout,
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
        centre = replace(centre, robot=centre.robot.with_errors(errors))
    for name in set(free_groups) & set(deviations):
        place = parameter_slice(dof, name)
        sd[place] = deviations[name]
        if name in LEARNED and (name != "compliance" or stiffness is None):
            group[place] = LEARNED.index(name)
    if not tool_rotation:
        sd[parameter_slice(dof, "tool")][3:] = 0.0
    # Stations and further reflectors are nuisances: centred on a closed-form start and far looser
    # than any data, so that they cost nothing.
    sd[layout.robot_size :] = 0.1
    return Prior(centre=centre, sd=sd, group=group)
