"""Joint compliance: each drive winds up in proportion to the torque on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.mean_tables import MeanTables
from robotrue.calibration.terms.first_moments import supposed_masses
from robotrue.calibration.terms.term import without_errors
from robotrue.core.arrays import Array, frozen
from robotrue.errors import ConfigurationError
from robotrue.robot.model import RobotModel

WIND_UP: Final = 5e-3
"""rad by which a drive may turn under the weight it carries at arm's length."""
LIGHTER: Final = 4.0
"""What arms weigh that have the size of others, over the weight of a light one of them."""


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


def compliance_scale(robot: RobotModel, payload_mass: float) -> Array:
    """Returns a broad scale of joint compliance (n,) rad/(N m) from the arm's own weight.

    Drives are built for their load: each is taken to wind up by at most about :data:`WIND_UP`
    under everything outboard of it hanging at arm's length. An arm without masses is taken
    for a light one of its size.
    """
    links_mass = supposed_masses(robot)
    if not robot.link_mass.any() and not robot.total_mass:
        links_mass = links_mass / LIGHTER
    mass = np.cumsum(links_mass[::-1])[::-1] + payload_mass
    links = np.hypot(robot.a, robot.d)
    if robot.convention == "mdh":
        links = np.hypot(np.append(robot.a[1:], 0.0), robot.d)
    lever = np.cumsum(links[::-1])[::-1] + float(np.linalg.norm(robot.T_flange_tool[:3, 3]))
    torque = mass * lever * float(np.linalg.norm(robot.gravity))
    known = torque > 1.0
    return np.where(known, WIND_UP / np.where(known, torque, 1.0), 1e-5)


def compliance_prior(
    robot: RobotModel, stiffness: StiffnessPrior | None, payload_mass: float
) -> tuple[Array, Array]:
    """Returns mean and sd (n,) rad/(N m): of the stated stiffness, else broad about the robot's.

    Raises:
        ConfigurationError: A stiffness list of another length than the robot's joints.
    """
    if stiffness is None:
        return robot.error("compliance"), compliance_scale(robot, payload_mass)
    if len(stiffness.stiffness) != robot.dof:
        raise ConfigurationError(
            f"{len(stiffness.stiffness)} stiffness values for a robot of {robot.dof} joints."
        )
    return 1.0 / stiffness.stiffness, stiffness.relative_sd / stiffness.stiffness


def without_compliance(tables: MeanTables) -> MeanTables:
    """Returns the tables of a stiff arm."""
    return without_errors(tables, ("compliance",))
