"""Groups of the error vector: geometry, joint compliance, first moments of the links' masses.

Geometry are joint zeros, links, gear ratios, base and tool. A drive winds up in proportion to the
torque on it. The torque of gravity on the drives is linear in two first moments for each link
(:func:`robotrue.robot.statics.weight_torque`), the wind-up of a drive the product of its compliance
and that torque. Unloaded poses show the products; poses under another known load show the
compliances, and with them the moments. Stated masses make the prior narrow and are never taken as
exact; without them it is that of an arm of this size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.terms.term import MeanTables, without_errors
from robotrue.core.arrays import Array, frozen
from robotrue.errors import ConfigurationError
from robotrue.robot.forward import walk
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import weight_torque

STATED_MASS: Final = 0.05
"""Relative sd of a link mass that is stated."""
STATED_CENTRE: Final = 0.01
"""m per axis, sd of a stated centre of mass."""
ASSUMED_TOTAL: Final = 0.7
"""Relative sd of an arm's mass that follows from its size, all links alike."""
STATED_TOTAL: Final = 0.2
"""The same where the arm's mass is stated: the share of its foot is not."""
ASSUMED_MASS: Final = 0.4
"""Relative sd of a link's share in the mass of its arm."""
ASSUMED_CENTRE: Final = 0.25
"""sd per axis of a centre of mass in the middle of its link, over the length of the link."""
LEAST_OFFSET: Final = 0.05
"""m, of the same: motors are next to the axes of short links."""
METRE_MASS: Final = 18.0
"""Mass in kg of an arm whose links add up to a metre. Data sheets of arms from 0.6 to 2.7 m reach
lie within a factor of 2 to 3, heavy ones above, collaborative arms below."""
GROWTH: Final = 3.2
"""Power of the length with which that grows."""
SHARES: Final = (0.28, 0.20, 0.19, 0.06, 0.035, 0.015)
"""Of the arm's mass in each link; the remainder is the foot, which does not move."""
_POSTURES: Final = 8


def assumed_masses(robot: RobotModel) -> Array:
    """Returns link masses (n,) kg: usual shares of the arm's mass, stated or that of its size."""
    length = np.abs(robot.a).sum() + np.abs(robot.d).sum()
    total = robot.total_mass or METRE_MASS * float(length) ** GROWTH
    place = np.linspace(0.0, 1.0, robot.dof)
    shares = np.interp(place, np.linspace(0.0, 1.0, len(SHARES)), SHARES)
    return np.asarray(total * shares * sum(SHARES) / shares.sum())


def supposed_masses(robot: RobotModel) -> Array:
    """Returns the link masses (n,) kg that are stated, else :func:`assumed_masses`."""
    return robot.link_mass if robot.link_mass.any() else assumed_masses(robot)


def moment_prior(robot: RobotModel) -> tuple[Array, Array]:
    """Returns mean and sd (2 n,) kg m of the moments beyond the stated masses; sd 0: no effect.

    Args:
        robot: Moments it carries are the mean.
    """
    frame = walk(robot.nominal(), np.zeros((1, robot.dof)))
    turn, corner = frame.link_rotation[0], frame.link_position[0]
    stated = bool(robot.link_mass.any())
    mass = supposed_masses(robot)
    if stated:
        centre = corner + np.einsum("nij,nj->ni", turn, robot.link_com)
        offset = np.full(robot.dof, STATED_CENTRE)
    else:
        ends = np.vstack([frame.joint_origin[0], frame.flange_position])
        centre = 0.5 * (ends[:-1] + ends[1:])
        offset = np.hypot(
            ASSUMED_CENTRE * np.linalg.norm(ends[1:] - ends[:-1], axis=1), LEAST_OFFSET
        )
    axes, origin = _axes(robot)
    each = np.eye(robot.dof) * mass
    first = each[:, :, None] * centre
    whole = lump_moments(axes, origin, mass, mass[:, None] * centre)
    relative = STATED_MASS if stated else ASSUMED_MASS
    common = 0.0 if stated else STATED_TOTAL if robot.total_mass else ASSUMED_TOTAL
    variance = (common * whole) ** 2
    for i in range(robot.dof):
        variance += (relative * lump_moments(axes, origin, each[i], first[i])) ** 2
        for k in range(3):
            shift = np.zeros((robot.dof, 3))
            shift[i, k] = mass[i] * offset[i]
            variance += lump_moments(axes, origin, np.zeros(robot.dof), shift) ** 2
    mean = robot.moments if stated or robot.moments.any() else whole
    seen = _have_effect(robot)
    return np.where(seen, mean, robot.moments), np.where(seen, np.sqrt(variance), 0.0)


def lump_moments(axes: Array, origin: Array, mass: Array, first: Array) -> Array:
    """Returns the moments (2 n,) kg m of :func:`weight_torque` that links have.

    From the tip on each link is handed the mass of the next one, at its axis, and the part of its
    moment along that axis: neither turns with the next joint.

    Args:
        axes: (n, 3, 3) unit x and y across each joint axis, and the axis, one a row; base frame.
        origin: (n, 3) m, a point of each axis.
        mass: (n,) kg.
        first: (n, 3) kg m, mass times centre of mass of each link in base, same posture.
    """
    out = np.zeros((len(mass), 3))
    carried, handed = 0.0, np.zeros(3)  # mass, and first moment about the base's origin
    for i in reversed(range(len(mass))):
        carried += float(mass[i])
        about = first[i] + handed - carried * origin[i]
        out[i] = axes[i] @ about
        handed = carried * origin[i] + out[i, 2] * axes[i, 2]
    return np.asarray(out[:, :2].T.ravel())


def _axes(robot: RobotModel) -> tuple[Array, Array]:
    """Axes (n, 3, 3) and origins (n, 3) for :func:`lump_moments`, all joints at zero."""
    frame = walk(robot.nominal(), np.zeros((1, robot.dof)))
    axis, x = frame.joint_axis[0], frame.link_rotation[0, :, :, 0]
    return np.stack([x, np.cross(axis, x), axis], axis=1), frame.joint_origin[0]


def _have_effect(robot: RobotModel) -> Array:
    """Returns a mask (2 n,) of moments that load a drive in some posture."""
    nominal = robot.nominal()
    joints = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSTURES, robot.dof))
    weight = weight_torque(nominal, walk(nominal, joints))
    largest = np.abs(weight).max(axis=(0, 1)).ravel()
    return np.asarray(largest > 1e-6 * max(float(largest.max()), 1e-12))


PER_JOINT_GROUPS: Final = ("theta", "d", "a", "alpha", "beta", "gear")
"""Groups of the error vector with a prior scale that is learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorScales:
    """Standard deviation of each group of errors: those of a production industrial arm.

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

    def deviations(self, dof: int) -> Mapping[str, Array]:
        """Returns the sd of every parameter, by group of the error vector, SI."""
        per_joint = {name: np.full(dof, getattr(self, name)) for name in PER_JOINT_GROUPS}
        return {
            **per_joint,
            "base": np.repeat([self.base, self.base_rotation], 3),
            "tool": np.repeat([self.tool, self.tool_rotation], 3),
        }


def without_geometry(tables: MeanTables) -> MeanTables:
    """Returns the tables without errors of links; joint zeros, base and tool stay."""
    return without_errors(tables, ("d", "a", "alpha", "beta"))


def without_gear(tables: MeanTables) -> MeanTables:
    """Returns the tables without errors of gear ratios."""
    return without_errors(tables, ("gear",))


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
