"""A robot whose truth is known: nominal arm, identified-type errors, and what no model contains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ShapeError
from robotrue.robot.forward import ChainState, walk
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load, torque_at
from robotrue.simulation.unmodelled import UnmodelledEffects, drive_shift, thermal_drift


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualRobot:
    """A simulated arm. The user of the cell sees ``nominal``; everything else is the truth.

    Attributes:
        name: What it stands for.
        nominal: What the controller and the user believe: geometry, masses, no errors.
        actual: The true arm: geometric errors, compliances, true masses.
        known_payload: What the user believes hangs on the flange.
        payload: What truly hangs there.
        effects: The rest of the truth.
        repeatability: m, 1 sigma per axis of the scatter of repeated visits.
    """

    name: str
    nominal: RobotModel
    actual: RobotModel
    known_payload: Load
    payload: Load
    effects: UnmodelledEffects
    repeatability: float

    def __post_init__(self) -> None:
        """Checks that both arms have the same joints."""
        if self.nominal.dof != self.actual.dof:
            raise ShapeError(
                f"nominal arm has {self.nominal.dof} joints, the actual one {self.actual.dof}."
            )

    def payload_with(self, wrench: Array) -> Load:
        """Returns the true payload together with a wrench (n, 6) or (6,) N, N m on the tool."""
        return Load(
            mass=self.payload.mass, com=self.payload.com, wrench=np.reshape(wrench, (-1, 6))
        )


def actual_pose(
    virtual: VirtualRobot,
    joints: Array,
    load: Load | None = None,
    *,
    approach: Array | None = None,
    time: Array | None = None,
    campaign: int = 0,
    T_flange_tool: Array | None = None,
) -> Array:
    """Returns the true T_base_tool (n, 4, 4), repeatability aside.

    Args:
        virtual: The arm.
        joints: (n, dof) rad, commanded.
        load: What it carries and feels; None is its own payload with no wrench.
        approach: (n, dof) sign of the last motion; None is unknown, 0.
        time: (n,) s since the campaign began; None leaves thermal drift out.
        campaign: Number of the campaign, for the drift.
        T_flange_tool: (4, 4) point asked for; None is the tool of the robot model.

    Raises:
        ShapeError: An array whose rows do not belong to the joints.
    """
    joints = np.asarray(joints, dtype=np.float64)
    n, dof = len(joints), virtual.actual.dof
    if joints.shape != (n, dof):
        raise ShapeError(f"joints has shape {joints.shape}, expected (any, {dof}).")
    robot = virtual.actual
    if T_flange_tool is not None:
        robot = robot.with_tool(T_flange_tool)
    carried = virtual.payload if load is None else load
    rigid = walk(robot.nominal(), joints)
    torque = torque_at(robot, rigid, carried)
    compliance = robot.error("compliance")
    signs = np.zeros((n, dof)) if approach is None else np.asarray(approach, dtype=np.float64)
    if signs.shape != (n, dof):
        raise ShapeError(f"approach has shape {signs.shape}, expected ({n}, {dof}).")
    shift = compliance * torque + drive_shift(virtual.effects, joints, torque, compliance, signs)
    slide = np.zeros((n, 3))
    if time is not None:
        slide, turn = thermal_drift(virtual.effects, np.asarray(time), campaign)
        shift[:, 1:3] += turn
    state = walk(robot, joints, shift)
    moment = _overturning_moment(robot, rigid, carried)
    lean = np.zeros((n, 3))
    lean[:, :2] = virtual.effects.tilt * moment[:, :2]
    tilt = pose(matrix_from_rotation_vector(lean), slide)
    out: Array = tilt @ state.transforms
    return out


def nominal_pose(virtual: VirtualRobot, joints: Array, T_flange_tool: Array | None = None) -> Array:
    """Returns where the controller believes the tool is, T_base_tool (n, 4, 4)."""
    robot = virtual.nominal
    if T_flange_tool is not None:
        robot = robot.with_tool(T_flange_tool)
    return walk(robot, np.asarray(joints, dtype=np.float64)).transforms


def _overturning_moment(robot: RobotModel, state: ChainState, load: Load) -> Array:
    """Moment (n, 3) N m of all weights and the wrench about the base origin, base axes."""
    n = len(state.position)
    centre = state.link_position + np.einsum("nlij,lj->nli", state.link_rotation, robot.link_com)
    first = np.einsum("l,nli->ni", robot.link_mass, centre)
    offset = np.broadcast_to(load.com, (n, 3))
    carried = state.flange_position + np.einsum("nij,nj->ni", state.flange_rotation, offset)
    first = first + np.broadcast_to(load.mass, (n,))[:, None] * carried
    wrench = np.broadcast_to(load.wrench, (n, 6))
    moment: Array = (
        np.cross(first, robot.gravity) + np.cross(state.position, wrench[:, :3]) + wrench[:, 3:]
    )
    return moment
