"""What is believed of an arm that nobody has measured: the priors of a fit, as a belief.

Touches of a part can be added to it as to any other belief; with a frame for every part this is a
calibration by probing alone.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, standard_terms
from robotrue.calibration.estimate import free_groups
from robotrue.calibration.parameters import Layout, State
from robotrue.calibration.priors import build_prior
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.ripple import harmonics
from robotrue.core.arrays import Array, frozen
from robotrue.robot.model import RobotModel

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
    robot: RobotModel, settings: FitSettings | None = None, *, ripple: Array | None = None
) -> Belief:
    """Returns the belief in an arm of which only the type is known.

    The base is held: where the arm is probed, the frames of the parts take its place.

    Args:
        robot: Nominal; errors it carries are the mean.
        settings: Priors, stiffness and repeatability.
        ripple: (h,) rad, sd of sine and cosine of N = 1 .. h cycles per revolution; that of
            :func:`typical_ripple` if not given.
    """
    settings = FitSettings() if settings is None else settings
    size = typical_ripple(robot) if ripple is None else frozen(ripple, (None,), "ripple")
    prior = build_prior(
        Layout(dof=robot.dof),
        State(robot=robot),
        settings.scales,
        free_groups=tuple(g for g in free_groups("elastic") if g != "base"),
        stiffness=settings.stiffness,
        payload_mass=float(settings.payload.mass[0]),
        tool_rotation=False,
    )
    waves = np.tile(np.repeat(size, 2), robot.dof)
    sd = np.concatenate([prior.sd, waves, np.zeros(robot.dof)])
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
