"""A virtual IRB 6660-205/1.9 that mills: masses, flexible joints, tool modes, straight passes, cut.

Source: Jin et al. 2022 for robot, path and cut (joints of Table 1). **Assumed**, since not printed:
masses and inertias, joint stiffness, damping, tool modes, the tool's place on the flange, cutting
coefficients of aluminium, runout; and that the material is to the right of the feed (the tool turns
in reverse): in up-milling only then are the signs of the printed mean force and error consistent in
the axes of this arm. Natural frequencies are those usual for arms of this size, 8.7 to 48 Hz at
mid-path.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.milling_force import milling_force
from robotrue.dynamics.oscillators import Oscillators, real_modes
from robotrue.dynamics.pose_modes import FlexibleArm
from robotrue.robot.forward import forward, walk
from robotrue.robot.inverse import inverse_path
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset

FIRST_ROW: Final = np.array([-26.174, -12.054, 52.467, -32.046, -56.636, 18.890]) * DEG
"""rad, first row of Table 1; the passes keep its attitude and branch."""
START: Final = np.array([1.02556, -0.40530, 0.960494])
"""m, flange at the start of the printed pass."""
FEED: Final = 5e-3
"""m/s, along base x."""
TOOL_POINT: Final = (0.32, 0.0, 0.16)
RATE: Final = 20e3
SPINDLE: Final = 60.0
TURN: Final = RATE / SPINDLE
"""Samples per turn of the spindle; three turns are a whole number of samples."""
TEETH: Final = 2
DEPTH: Final = 1 * MM
COEFFICIENTS: Final = CuttingCoefficients(
    tangential=1.35 * 796e6,
    radial=1.35 * 169e6,
    axial=1.35 * 222e6,
    tangential_edge=1.35 * 27.7e3,
    radial_edge=1.35 * 30.8e3,
    axial_edge=1.35 * 1.4e3,
)
RUNOUT: Final = 8 * UM
RUNOUT_SPREAD: Final = 0.15
_SLICES: Final = 4
_MIRROR: Final = np.array([1.0, -1.0, 1.0])
_TURNS: Final = 3
STIFFNESS: Final = 0.7e6 * np.array([1.9, 2.9, 2.4, 0.34, 0.26, 0.24])
"""N m/rad."""
STIFFNESS_SPREAD: Final = 0.05
STIFFNESS_BELIEF: Final = 0.30
"""Relative error of the user's stiffnesses, uniform."""
DAMPING: Final = np.array([0.035, 0.03, 0.03, 0.03, 0.025, 0.025])
SOFTENING: Final = (0.10, 40.0, 40.0)
"""K (1 - a tanh((|torque| - b) / c)), b and c in N m: joints get softer under load."""
_LINKS: Final = (  # origin at zero joints (m), mass (kg), centre from it (m), inertia (kg m^2)
    ((0.0, 0.0, 0.8145), 420.0, (0.10, 0.0, -0.15), (25.0, 30.0, 28.0)),
    ((0.3, 0.0, 0.8145), 230.0, (0.0, 0.0, 0.35), (16.0, 16.0, 4.0)),
    ((0.3, 0.0, 1.5145), 330.0, (-0.10, 0.0, 0.22), (14.0, 22.0, 20.0)),
    ((0.3, 0.0, 1.7945), 95.0, (0.45, 0.0, 0.0), (1.2, 8.0, 8.0)),
    ((1.193, 0.0, 1.7945), 45.0, (0.05, 0.0, 0.0), (0.5, 0.5, 0.5)),
)
_SPINDLE: Final = (60.0, (0.15, 0.0, 0.12), (1.0, 1.2, 1.2))
_TOOL: Final = (  # axis, Hz, part of critical, N/m
    (0, 520.0, 0.05, 1.1e7),
    (0, 1180.0, 0.03, 1.6e7),
    (0, 2350.0, 0.025, 2.2e7),
    (1, 560.0, 0.045, 1.0e7),
    (1, 1110.0, 0.035, 1.5e7),
    (1, 2280.0, 0.025, 2.0e7),
    (2, 900.0, 0.04, 6e7),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MillingArm:
    """True properties of one virtual arm, and its user's assumptions.

    Attributes:
        arm: The truth, joints as they are without load.
        stiffness_belief: (6,) N m/rad, from the user's data sheet.
        tool: Modes of tool and spindle.
    """

    arm: FlexibleArm
    stiffness_belief: Array
    tool: Oscillators

    def soften(self, torque: Array) -> FlexibleArm:
        """Returns the arm with its joints softened by process torques (6,) N m."""
        depth, centre, width = SOFTENING
        softer = 1.0 - depth * np.tanh((np.abs(torque) - centre) / width)
        return replace(self.arm, stiffness=self.arm.stiffness * softer)


def milling_arm(seed: int) -> MillingArm:
    """Returns the virtual arm of a seed: the stiffness is drawn, all else is as assumed."""
    rng = np.random.default_rng([seed, 101])
    true = STIFFNESS * np.exp(STIFFNESS_SPREAD * rng.standard_normal(6))
    believed = true * rng.uniform(1.0 - STIFFNESS_BELIEF, 1.0 + STIFFNESS_BELIEF, 6)
    return MillingArm(
        arm=_arm(true), stiffness_belief=np.asarray(believed), tool=tool_oscillators()
    )


def milling_robot() -> RobotModel:
    """Returns the kinematics a user knows: preset, tool point, no masses."""
    tool = np.eye(4)
    tool[:3, 3] = TOOL_POINT
    return replace(preset("ABB IRB 6660-205/1.9"), T_flange_tool=tool)


def tool_oscillators() -> Oscillators:
    """Returns the modes of tool and spindle, axis by axis."""
    axis, frequency, damping, stiffness = (np.array(column) for column in zip(*_TOOL, strict=True))
    shape = np.zeros((len(axis), 3))
    shape[np.arange(len(axis)), axis.astype(int)] = 2.0 * np.pi * frequency / np.sqrt(stiffness)
    return real_modes(frequency, damping, shape)


def pass_joints(along: Array, shift: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Returns the joints (n, 6) rad at places (n,) m along a pass.

    Args:
        along: (n,) m from its start, rising.
        shift: m in base y and z from the printed pass.

    Raises:
        ReachError: The arm cannot take a pose.
    """
    robot = milling_robot().nominal()
    poses = np.repeat(
        forward(replace(robot, T_flange_tool=np.eye(4)), FIRST_ROW[None]), len(along), 0
    )
    poses[:, :3, 3] = START + np.array([0.0, *shift])
    poses[:, 0, 3] += along
    return inverse_path(robot, poses @ robot.T_flange_tool, near=FIRST_ROW)


def _arm(stiffness: Array) -> FlexibleArm:
    """The masses, moved from frames at the joints into the DH frames of the model."""
    robot = milling_robot()
    zero = walk(robot, np.zeros((1, 6)))
    mass, com, inertia = np.zeros(6), np.zeros((6, 3)), np.zeros((6, 3, 3))
    for i, (origin, weight, centre, moments) in enumerate(_LINKS):
        rotation = zero.link_rotation[0, i]
        place = np.array(origin) + np.array(centre) - zero.link_position[0, i]
        mass[i], com[i] = weight, rotation.T @ place
        inertia[i] = rotation.T @ np.diag(moments) @ rotation
    payload_mass, payload_com, payload_inertia = _SPINDLE
    return FlexibleArm(
        robot=replace(robot, link_mass=mass, link_com=com),
        link_inertia=inertia,
        stiffness=stiffness,
        damping=DAMPING,
        payload_mass=payload_mass,
        payload_com=np.array(payload_com),
        payload_inertia=np.diag(payload_inertia),
    )


def milling_table(seed: int, finer: int) -> Array:
    """Returns the force (1000 finer, 3) N over three turns, ``finer`` times the sampling rate."""
    return force_table(draw_cutter(np.random.default_rng([seed, 102])), 1.0, finer)


def draw_cutter(rng: np.random.Generator) -> EndMill:
    """Returns a cutter with a random runout."""
    return EndMill(
        kind="flat",
        diameter=16 * MM,
        teeth=TEETH,
        helix=30 * DEG,
        runout=RUNOUT * float(np.exp(RUNOUT_SPREAD * rng.standard_normal())),
        runout_angle=float(rng.uniform(0.0, 2.0 * np.pi)),
    )


def force_table(cutter: EndMill, part: float, finer: int) -> Array:
    """Returns the force (1000 finer, 3) N over three turns at a part of the nominal depth."""
    count = round(_TURNS * TURN * finer)
    angle = np.asarray(2.0 * np.pi * np.arange(count) / (TURN * finer), dtype=np.float64)
    cut = CutterEngagement(
        mode="up",
        depth=DEPTH * part,
        width=6 * MM,
        feed_per_tooth=FEED / (SPINDLE * TEETH),
        spindle=SPINDLE,
    )
    return np.asarray(_MIRROR * milling_force(cutter, cut, COEFFICIENTS, angle, slices=_SLICES))
