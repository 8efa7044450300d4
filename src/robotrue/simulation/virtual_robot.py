"""A robot whose truth is known: nominal arm, identified-type errors, and what no model contains.

What a real arm does and no error model here contains exactly are smooth functions of a seed. Every
size is for level 1 and grows with the level; level 2 gives the attitude sensitivity of the
machining robot of Deng et al. 2022, Table 5. All amounts are **assumed**: they are chosen in the
range measured on industrial arms, not identified on one.

=================  ==========================================================================
joint harmonics    1 and 2 cycles per turn, 20..100 and 10..60 urad, 1.5 times that in the wrist
gear ripple        20..45 cycles per turn, not a whole number, 4..16 urad
gravity backlash   15..50 urad times tanh(torque / torque_0), joints that carry gravity
approach backlash  5..15 urad times the sign of the last motion of joint 1
stiffening         compliance falls by 2..6 % per 1000 N m of load (per 100 N m in the wrist)
upper arm bending  joint 3 turns by 50..120 nrad per N m of torque on joint 2
base tilt          base turns by 10..30 nrad per N m of overturning moment, x and y apart
thermal drift      base shift and joints 2, 3: Ornstein-Uhlenbeck, 1 h, 5 um and 3 urad (1 sigma)
=================  ==========================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.robot.forward import ChainState, walk
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load, torque_at

_DRIFT_WAVES: Final = 64
_DRIFT_TIME: Final = 3600.0  # s
_DRIFT_SIGMA: Final = np.array([5e-6, 5e-6, 5e-6, 3e-6, 3e-6])  # m m m rad rad at level 1


@dataclass(frozen=True, slots=True, kw_only=True)
class UnmodelledEffects(Columns):
    """One arm's un-modelled behaviour, drawn once.

    Attributes:
        seed: Seed of the draw; also of the thermal drift of every campaign.
        level: Factor on all effects; 0 is an arm the models describe exactly.
        cycles: (dof, h) cycles per turn of each harmonic.
        sine: (dof, h) rad.
        cosine: (dof, h) rad.
        backlash: (dof,) rad, times tanh(torque / torque_0).
        torque_0: (dof,) N m.
        approach: (dof,) rad, times the sign of the last motion.
        stiffening: (dof,) 1 / (N m): ``compliance * (1 - stiffening * |torque|)``, above 1/2.
        bending: rad / (N m): turn of joint 3 per torque on joint 2.
        tilt: (2,) rad / (N m) about base x and y.
    """

    seed: int
    level: float
    cycles: Annotated[Array, Column("dof h")]
    sine: Annotated[Array, Column("dof h")]
    cosine: Annotated[Array, Column("dof h")]
    backlash: Annotated[Array, Column("dof")]
    torque_0: Annotated[Array, Column("dof")]
    approach: Annotated[Array, Column("dof")]
    stiffening: Annotated[Array, Column("dof")]
    bending: float
    tilt: Annotated[Array, Column("2")]


def draw_unmodelled(seed: int, *, level: float, dof: int = 6) -> UnmodelledEffects:
    """Returns the un-modelled behaviour of one arm; equal seeds give equal arms.

    Args:
        seed: Any non-negative integer.
        level: Factor on every size in the table above; 0 switches all of it off.
        dof: Number of joints; the last three are taken for the wrist.

    Raises:
        ConfigurationError: The level is negative.
    """
    if not level >= 0.0:
        raise ConfigurationError(f"level {level}, expected 0 or more.", hint="level=2.")
    rng = np.random.default_rng([seed, 11])
    wrist = np.arange(dof) >= dof - 3
    low, high = np.array([2e-5, 1e-5, 0.4e-5]), np.array([10e-5, 6e-5, 1.6e-5])
    amplitude = rng.uniform(low, high, (dof, 3))
    amplitude[:, :2] *= np.where(wrist, 1.5, 1.0)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, (dof, 3))
    cycles = np.tile([1.0, 2.0, 0.0], (dof, 1))
    cycles[:, 2] = rng.uniform(20.0, 45.0, dof)
    approach = np.zeros(dof)
    approach[0] = rng.uniform(0.5e-5, 1.5e-5)
    per_newton_metre = np.where(wrist, 1e-2, 1e-3)
    return UnmodelledEffects(
        seed=seed,
        level=level,
        cycles=cycles,
        sine=level * amplitude * np.cos(phase),
        cosine=level * amplitude * np.sin(phase),
        backlash=level * rng.uniform(1.5e-5, 5e-5, dof),
        torque_0=np.where(wrist, 15.0, 150.0),
        approach=level * approach,
        stiffening=level * rng.uniform(0.02, 0.06, dof) * per_newton_metre,
        bending=level * float(rng.uniform(50e-9, 120e-9)),
        tilt=level * rng.uniform(10e-9, 30e-9, 2),
    )


def drive_shift(
    effects: UnmodelledEffects, joints: Array, torque: Array, compliance: Array, approach: Array
) -> Array:
    """Returns the un-modelled drive-side shift (n, dof) in rad: harmonics, backlash, bending.

    Args:
        effects: The arm's behaviour.
        joints: (n, dof) rad, commanded.
        torque: (n, dof) N m, load on the drives.
        compliance: (dof,) rad/(N m), what a linear spring would have.
        approach: (n, dof) sign of the last motion, 0 = unknown.
    """
    phase = joints[:, :, None] * effects.cycles
    ripple = np.sum(effects.sine * np.sin(phase) + effects.cosine * np.cos(phase), axis=2)
    gravity = effects.backlash * np.tanh(torque / effects.torque_0)
    softer = np.minimum(effects.stiffening * np.abs(torque), 0.5)
    shift: Array = ripple + gravity + effects.approach * approach - compliance * torque * softer
    shift[:, 2] += effects.bending * torque[:, 1]
    return shift


def thermal_drift(effects: UnmodelledEffects, time: Array, campaign: int) -> tuple[Array, Array]:
    """Returns base shift (n, 3) m and turn of joints 2, 3 (n, 2) rad at times of a campaign.

    A sum of 64 waves with frequencies from a Cauchy density: its covariance over phases is
    ``sigma^2 exp(-|t| / 1 h)``, an Ornstein-Uhlenbeck process that needs no time grid.

    Args:
        effects: The arm's behaviour.
        time: (n,) s since the campaign began.
        campaign: Number of the campaign; campaigns drift independently.
    """
    rng = np.random.default_rng([effects.seed, 13, campaign])
    frequency = np.tan(np.pi * (rng.uniform(size=(5, _DRIFT_WAVES)) - 0.5)) / _DRIFT_TIME
    phase = rng.uniform(0.0, 2.0 * np.pi, (5, _DRIFT_WAVES))
    waves = np.cos(np.asarray(time)[:, None, None] * frequency + phase).sum(axis=2)
    drift = effects.level * _DRIFT_SIGMA * np.sqrt(2.0 / _DRIFT_WAVES) * waves
    return drift[:, :3], drift[:, 3:]


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualRobot:
    """A simulated arm. The user of the cell sees ``nominal``; everything else is the truth.

    Attributes:
        name: Name of the simulated robot.
        nominal: Model of the controller and the user: geometry, masses, no errors.
        actual: The true arm: geometric errors, compliances, true masses.
        payload: True payload.
        effects: The rest of the truth.
        repeatability: m, 1 sigma per axis of the scatter of repeated visits.
    """

    name: str
    nominal: RobotModel
    actual: RobotModel
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
        load: Payload and wrench; None is its own payload with no wrench.
        approach: (n, dof) sign of the last motion; None is unknown, 0.
        time: (n,) s since the campaign began; None leaves thermal drift out.
        campaign: Number of the campaign, for the drift.
        T_flange_tool: (4, 4) requested point; None is the tool of the robot model.

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
    """Returns the controller's tool poses, T_base_tool (n, 4, 4)."""
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
