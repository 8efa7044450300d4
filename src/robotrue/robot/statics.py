"""Torques on the drives and the deflection they cause.

Load torque is positive when it turns the joint in its positive sense, so a joint of compliance c
moves by +c * torque. Torques are taken at the nominal rigid posture: errors of a milliradian change
them by a thousandth, and the deflection stays linear in the compliances, so its Jacobian is exact.

Source: Deng et al. 2022, eq. 4-7, with SI units throughout.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns, Rows
from robotrue.robot.forward import BLOCK, ChainState, walk
from robotrue.robot.model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Load(Columns):
    """Payload and external wrench of the arm, at n poses or (n = 1) at all.

    Attributes:
        mass: (n,) kg, payload at the flange.
        com: (n, 3) m, its centre of mass in the flange frame.
        wrench: (n, 6) N, N m: force and moment on the tool, at the tool point, in base axes.
    """

    mass: Annotated[Array, Column("_", unit="kg")] = field(default_factory=lambda: np.zeros(1))
    com: Annotated[Array, Column("_ 3", unit="m")] = field(default_factory=lambda: np.zeros((1, 3)))
    wrench: Annotated[Array, Column("_ 6")] = field(default_factory=lambda: np.zeros((1, 6)))

    def take(self, rows: Rows) -> Load:
        """Returns the load at some of the poses; a single row serves all and stays single."""
        if len(self.mass) == len(self.com) == len(self.wrench) == 1:
            return self
        mass, com, wrench = (
            part if len(part) == 1 else part[rows] for part in (self.mass, self.com, self.wrench)
        )
        return Load(mass=mass, com=com, wrench=wrench)

    def fill_rows(self, mass: Array, wrench: Array, com: Array | None = None) -> Load:
        """Returns the load of n rows; missing values of a row are those of this payload.

        Args:
            mass: (n,) kg at the flange; NaN where not stated.
            wrench: (n, 6) N, N m.
            com: (n, 3) m in the flange frame, NaN where not stated; None: nowhere.
        """
        n = len(mass)
        own = np.broadcast_to(self.com, (n, 3))
        return Load(
            mass=np.where(np.isnan(mass), self.mass, mass),
            com=own if com is None else np.where(np.isnan(com), own, com),
            wrench=wrench,
        )


NO_LOAD = Load()


def drive_torque(robot: RobotModel, joints: Array, load: Load = NO_LOAD) -> Array:
    """Returns the load torque on each drive (n, dof) in N m: gravity, payload and wrench.

    Args:
        robot: The arm; what its links weigh is ``link_mass`` at ``link_com``, and ``moments``.
        joints: (n, dof) rad.
        load: Payload and wrench, one row or n rows.
    """
    nominal = robot.nominal()
    torque = np.empty((len(joints), robot.dof))
    for start in range(0, len(joints), BLOCK):
        rows = slice(start, start + BLOCK)
        torque[rows] = torque_at(robot, walk(nominal, joints[rows]), load.take(rows))
    return torque


def stated_torque(robot: RobotModel, joints: Array, load: Load) -> tuple[Array, Array]:
    """Returns :func:`drive_torque` without the moments, and :func:`weight_torque` of them.

    Args:
        robot: The arm; masses from ``link_mass`` at ``link_com``.
        joints: (n, dof) rad.
        load: Payload and wrench, one row or n rows.
    """
    nominal, dof = robot.nominal(), robot.dof
    torque, weight = np.empty((len(joints), dof)), np.empty((len(joints), dof, 2, dof))
    for start in range(0, len(joints), BLOCK):
        rows = slice(start, start + BLOCK)
        state = walk(nominal, joints[rows])
        torque[rows] = torque_at(nominal, state, load.take(rows))
        weight[rows] = weight_torque(nominal, state)
    return torque, weight


def torque_at(robot: RobotModel, state: ChainState, load: Load) -> Array:
    """Returns :func:`drive_torque` for a chain state already walked (nominal, rigid)."""
    axis, origin = state.joint_axis, state.joint_origin
    n = len(axis)
    centre = state.link_position + np.einsum("nlij,lj->nli", state.link_rotation, robot.link_com)
    # Mass and first moment of everything outboard of each joint, summed from the tip.
    mass_out = np.cumsum(robot.link_mass[::-1])[::-1]
    moment = robot.link_mass[None, :, None] * centre
    moment_out = np.cumsum(moment[:, ::-1], axis=1)[:, ::-1]
    arm_force = moment_out - mass_out[None, :, None] * origin
    torque = np.einsum("nik,nik->ni", axis, np.cross(arm_force, robot.gravity))
    offset = np.broadcast_to(load.com, (n, 3))
    payload = state.flange_position + np.einsum("nij,nj->ni", state.flange_rotation, offset)
    weight = np.broadcast_to(load.mass, (n,))[:, None] * robot.gravity
    torque += np.einsum("nik,nik->ni", axis, np.cross(payload[:, None] - origin, weight[:, None]))
    wrench = np.broadcast_to(load.wrench, (n, 6))
    lever = np.cross(state.position[:, None] - origin, wrench[:, None, :3])
    torque += np.einsum("nik,nik->ni", axis, lever + wrench[:, None, 3:])
    drives: Array = torque @ robot.joint_map
    if robot.moments.any():
        drives += add_moments(weight_torque(robot, state), robot.moments)
    return drives


def weight_torque(robot: RobotModel, state: ChainState) -> Array:
    """Returns the torque on each drive (n, dof, 2, dof) per first moment of each link, m^2/s^2.

    A moment of a link along its joint axis can be counted to the link before it, and so can its
    mass: of what the links weigh, torques show two numbers for each link (Gautier and Khalil 1990,
    "Direct calculation of minimum set of inertial parameters"). They are the first moment of all
    that the joint carries, as far as it turns with the link, in the plane across the joint axis:
    along x of the link frame, then along y, which is the joint axis times x.

    Args:
        robot: The arm; gravity and coupling of the joints count.
        state: Its chain without errors.
    """
    axis, x = state.joint_axis, state.link_rotation[:, :, :, 0]
    across = np.stack([x, np.cross(axis, x)], axis=1)
    turning = np.einsum("nix,nskx->nisk", axis, np.cross(across, robot.gravity))
    carried = np.tri(robot.dof).T[:, None, :]  # joint i carries the links from i on
    return np.asarray(np.einsum("ij,nisk->njsk", robot.joint_map, turning * carried))


def add_moments(weight: Array, moments: Array) -> Array:
    """Returns the torque (n, dof) N m of first moments (2 dof,) kg m by :func:`weight_torque`."""
    n, dof = weight.shape[:2]
    return np.asarray(weight.reshape(n, dof, 2 * dof) @ moments)


def deflect_arm(
    robot: RobotModel, joints: Array, load: Load = NO_LOAD, shift: Array | None = None
) -> tuple[ChainState, Array]:
    """Returns the chain of the actual, loaded arm and the drive torques (n, dof) N m.

    Args:
        robot: The arm with errors; ``compliance`` times torque is added on the drive side.
        joints: (n, dof) rad, commanded.
        load: Payload and wrench.
        shift: (n, dof) rad, further drive-side shift such as ripple.
    """
    torque = drive_torque(robot, joints, load)
    bend = torque * robot.error("compliance")
    return walk(robot, joints, bend if shift is None else bend + shift), torque
