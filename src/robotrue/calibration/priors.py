"""What is believed before the data: Gaussian scales in physical units, learnable per group.

The defaults are those of a production industrial arm. A scale that is learned moves to where the
data put it (marginal likelihood), held by a weak pull of :data:`PULL` pseudo-parameters to the
default, so that a group nobody can see keeps its physical scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.parameters import Layout, State
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.errors import ConfigurationError
from robotrue.robot.model import PER_JOINT, RobotModel, parameter_slice

PULL: Final = 0.5
"""Weight of the default scale in a learned one, in parameters."""
WIND_UP: Final = 5e-3
"""rad by which a drive may turn under the weight it carries at arm's length."""
LEARNED: Final = ("theta", "d", "a", "alpha", "beta", "gear")


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorScales:
    """Standard deviation of each group of errors.

    Attributes:
        theta: rad, joint offsets.
        d: m.
        a: m.
        alpha: rad.
        beta: rad, Hayati's angle about y.
        gear: Relative error of the gear ratio.
        base: m, position of the robot root.
        base_rotation: rad.
        tool: m, position of the reflector on the flange.
        tool_rotation: rad.
    """

    theta: float = 1e-3
    d: float = 5e-4
    a: float = 5e-4
    alpha: float = 5e-4
    beta: float = 5e-4
    gear: float = 2e-5
    base: float = 2e-2
    base_rotation: float = 2e-2
    tool: float = 1e-2
    tool_rotation: float = 2e-2

    def __post_init__(self) -> None:
        """Refuses scales that are not positive."""
        for name in self.__slots__:
            if not getattr(self, name) > 0.0:
                raise ConfigurationError(
                    f"prior scale {name} is {getattr(self, name)}, must be positive."
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class StiffnessPrior:
    """Joint stiffness known before measuring, from a data sheet or an earlier calibration.

    Attributes:
        stiffness: (n,) N m/rad.
        relative_sd: (n,) or one number: standard deviation of the compliance, relative to its mean.
    """

    stiffness: Array
    relative_sd: Array

    def __post_init__(self) -> None:
        """Checks values and freezes."""
        stiffness = frozen(self.stiffness, (None,), "stiffness")
        sd = frozen(np.broadcast_to(self.relative_sd, stiffness.shape), (None,), "relative_sd")
        if (stiffness <= 0.0).any() or (sd <= 0.0).any():
            raise ConfigurationError("stiffness and its relative sd must be positive.")
        object.__setattr__(self, "stiffness", stiffness)
        object.__setattr__(self, "relative_sd", sd)


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


def compliance_scale(robot: RobotModel, payload_mass: float) -> Array:
    """Returns a broad scale of joint compliance (n,) rad/(N m) from the arm's own weight.

    Drives are built for their load: each is taken to wind up by at most about :data:`WIND_UP`
    under everything outboard of it hanging at arm's length. An arm without masses gets 1e-5.
    """
    mass = np.cumsum(robot.link_mass[::-1])[::-1] + payload_mass
    links = np.hypot(robot.a, robot.d)
    if robot.convention == "mdh":
        links = np.hypot(np.append(robot.a[1:], 0.0), robot.d)
    lever = np.cumsum(links[::-1])[::-1] + float(np.linalg.norm(robot.T_flange_tool[:3, 3]))
    torque = mass * lever * float(np.linalg.norm(robot.gravity))
    known = torque > 1.0
    return np.where(known, WIND_UP / np.where(known, torque, 1.0), 1e-5)


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
    learned = [*LEARNED] if stiffness is not None else [*LEARNED, "compliance"]
    for name in PER_JOINT:
        place = parameter_slice(dof, name)
        if name not in free_groups:
            continue
        if name == "compliance":
            sd[place] = (
                compliance_scale(centre.robot, payload_mass)
                if stiffness is None
                else stiffness.relative_sd / _checked(stiffness, dof).stiffness
            )
        else:
            sd[place] = getattr(scales, name)
        if name in learned:
            group[place] = learned.index(name)
    for name, linear, angular in (
        ("base", scales.base, scales.base_rotation),
        ("tool", scales.tool, scales.tool_rotation),
    ):
        if name in free_groups:
            sd[parameter_slice(dof, name)] = np.repeat([linear, angular], 3)
    if not tool_rotation:
        sd[parameter_slice(dof, "tool")][3:] = 0.0
    # Stations and further reflectors are nuisances: centred on a closed-form start and far looser
    # than any data, so that they cost nothing.
    sd[layout.robot_size :] = 0.1
    if stiffness is not None and "compliance" in free_groups:
        errors = centre.robot.errors.copy()
        errors[parameter_slice(dof, "compliance")] = 1.0 / _checked(stiffness, dof).stiffness
        centre = State(
            robot=centre.robot.with_errors(errors),
            T_tracker_base=centre.T_tracker_base,
            T_flange_target=centre.T_flange_target,
        )
    return Prior(centre=centre, sd=sd, group=group)


def _checked(prior: StiffnessPrior, dof: int) -> StiffnessPrior:
    if len(prior.stiffness) != dof:
        raise ConfigurationError(
            f"{len(prior.stiffness)} stiffness values for a robot of {dof} joints."
        )
    return prior
