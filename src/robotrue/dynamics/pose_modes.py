"""Modes of the arm at any pose, from lumped masses and the stiffness of its joints.

    M(q) eta'' + K eta = J(q)^T f,    M phi = phi / omega^2 K,    phi^T M phi = 1

M comes from the links' masses, centres and inertias, J is the tool's Jacobian, both in the
coordinates of the drives: with a parallel rod joint 2 moves the links beyond it without turning
them, as in ``joint_map`` of the robot model. K is the stiffness of the joints. Damping is given
mode by mode: no model of joints predicts it. M is computed in machine code: 20 microseconds, where
array operations take a millisecond, and a stream recomputes its modes ten to fifty times a second.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, Records
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.dynamics.oscillators import Oscillators, real_modes
from robotrue.errors import ModelMismatchError, ReachError, ShapeError
from robotrue.robot.chain import ORIGIN, Z, chain_dtype, link_frames, links_of
from robotrue.robot.chain_kernels import add_first_moment, walk, write_jacobian
from robotrue.robot.model import RobotModel

LIMIT_SLACK: Final = 1e-6
"""rad; how far beyond a joint limit a pose still counts as inside."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlexibleArm(Columns):
    """An arm of stiff links and flexible joints.

    Attributes:
        robot: Kinematics, limits and tool; masses and centres of the links are its own.
        link_inertia: (n, 3, 3) kg m^2 about each link's centre of mass, in its DH frame.
        stiffness: (n,) N m/rad of the joints, on the side of the drives.
        damping: (n,) part of critical, of the modes by rising frequency.
        payload_mass: kg at the flange.
        payload_com: (3,) m, its centre in the flange frame.
        payload_inertia: (3, 3) kg m^2 about it, in flange axes.
    """

    robot: RobotModel
    link_inertia: Annotated[Array, Column("n 3 3", unit="kg m^2")]
    stiffness: Annotated[Array, Column("n", unit="N m/rad")]
    damping: Annotated[Array, Column("n")]
    payload_mass: float = 0.0
    payload_com: Annotated[Array, Column("3", unit="m", fill=0.0)] = EMPTY
    payload_inertia: Annotated[Array, Column("3 3", unit="kg m^2", fill=0.0)] = EMPTY
    _links: Records = field(init=False, repr=False)
    _bodies: tuple[Array, Array, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Checks signs, packs the bodies for the kernel."""
        self._check_columns(n=self.robot.dof)
        if not (self.stiffness > 0.0).all():
            raise ShapeError(f"stiffness {self.stiffness} N m/rad, expected above zero.")
        if not ((self.damping > 0.0) & (self.damping < 1.0)).all():
            raise ShapeError(f"damping {self.damping}, expected above 0 and below 1 of critical.")
        if not self.robot.link_mass.sum() + self.payload_mass > 0.0:
            raise ModelMismatchError(
                f"{self.robot.name} has no link masses: without masses there are no modes.",
                hint="state link_mass, link_com and link_inertia, or fit modes to hammer tests.",
            )
        object.__setattr__(self, "_links", links_of(self.robot.nominal()))
        object.__setattr__(self, "_bodies", _bodies_of(self))

    def mass_and_jacobian(self, joints: Array) -> tuple[Array, Array]:
        """Returns M (n, n) kg m^2 and the tool's Jacobian (6, n), in drive coordinates.

        Args:
            joints: (n,) rad.
        """
        robot, n = self.robot, self.robot.dof
        mass, chain = np.empty((n, n)), np.zeros(1, chain_dtype(n))
        chain["theta"][0] = robot.joint_map @ joints + robot.theta
        write_mass_matrix(self._links, chain, *self._bodies, mass)
        drives = robot.joint_map
        return drives.T @ mass @ drives, chain["jacobian"][0] @ drives


def _bodies_of(arm: FlexibleArm) -> tuple[Array, Array, Array]:
    """Returns centres (n, 4), masses (n,) and inertias (n, 3, 3) of the links, payload included.

    They are in the frames turned by the joints; a centre ends in 1.
    """
    robot, frames = arm.robot, link_frames(arm.robot)
    rotation, mass = frames[:, :3, :3], np.array(robot.link_mass)
    inertia = np.where(mass[:, None, None] > 0.0, arm.link_inertia, 0.0)
    centre = np.array(robot.link_com)
    if arm.payload_mass > 0.0:  # one body with the last link, in whose frame the flange is
        total = mass[-1] + arm.payload_mass
        together = (mass[-1] * centre[-1] + arm.payload_mass * arm.payload_com) / total
        inertia[-1] += arm.payload_inertia
        inertia[-1] += _shift_inertia(mass[-1], centre[-1] - together)
        inertia[-1] += _shift_inertia(arm.payload_mass, arm.payload_com - together)
        mass[-1], centre[-1] = total, together
    inertia = rotation @ inertia @ np.swapaxes(rotation, 1, 2)
    centre = np.einsum("nij,nj->ni", rotation, centre) + frames[:, :3, 3]
    return np.column_stack([centre, np.ones(robot.dof)]), mass, np.ascontiguousarray(inertia)


def _shift_inertia(mass: float, away: Array) -> Array:
    """Returns the inertia (3, 3) kg m^2 of a mass about a point ``away`` (3,) m from it."""
    return np.asarray(mass * (away @ away * np.eye(3) - np.outer(away, away)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseModes:
    """Modes at one pose.

    Attributes:
        joints: (n,) rad.
        frequency: (n,) Hz, undamped, rising.
        damping: (n,) part of critical.
        shape: (n, n) joint shapes by columns, kg^-1/2 m^-1 rad, mass-normalised.
        jacobian: (6, n) of the tool, m/rad and rad/rad.
        stiffness: (n,) N m/rad.
    """

    joints: Array
    frequency: Array
    damping: Array
    shape: Array
    jacobian: Array
    stiffness: Array

    def oscillators(self) -> Oscillators:
        """Returns the modes as the tool feels them, forces and displacements in base axes."""
        return real_modes(self.frequency, self.damping, (self.jacobian[:3] @ self.shape).T)

    def carry(self, before: PoseModes) -> Array:
        """Returns (n, n), normal coordinates here from those before: the joints stay in place.

        For :meth:`robotrue.dynamics.streaming.ModalFilter.change`.
        """
        omega = 2.0 * np.pi * self.frequency[:, None]
        return np.asarray((self.shape.T * self.stiffness) @ before.shape / omega**2)

    @property
    def static(self) -> Array:
        """(6, 6) tool twist over wrench, m/N and so on: J K^-1 J^T, joints alone."""
        return np.asarray((self.jacobian / self.stiffness) @ self.jacobian.T)


def pose_modes(arm: FlexibleArm, joints: Array) -> PoseModes:
    """Returns the modes at a pose (n,) rad.

    Raises:
        ReachError: A joint beyond its limit, or not finite: the model is not valid there.

    Fails when: links or bearings are more compliant than the joints: frequencies come out too high.
    """
    q = np.asarray(joints, dtype=np.float64)
    limits = arm.robot.limits
    if q.shape != (arm.robot.dof,):
        raise ShapeError(f"joints have shape {q.shape}, expected ({arm.robot.dof},).")
    inside = (q >= limits[:, 0] - LIMIT_SLACK) & (q <= limits[:, 1] + LIMIT_SLACK)
    if not inside.all():
        i = int(np.flatnonzero(~inside)[0])
        raise ReachError(
            f"joint {i + 1} at {np.rad2deg(q[i]):.3f} deg, limits "
            f"{np.rad2deg(limits[i, 0]):.1f} to {np.rad2deg(limits[i, 1]):.1f} deg: "
            "no modes outside.",
            hint="check units (rad) and the sense of the joint.",
        )
    mass, jacobian = arm.mass_and_jacobian(q)
    soft = 1.0 / np.sqrt(arm.stiffness)
    # K^-1/2 M K^-1/2 v = v / omega^2: symmetric, and the largest come out as the lowest modes.
    period, vector = np.linalg.eigh(soft[:, None] * mass * soft)
    omega = 1.0 / np.sqrt(period[::-1])
    shape = soft[:, None] * vector[:, ::-1] * omega
    return PoseModes(
        joints=q,
        frequency=omega / (2.0 * np.pi),
        damping=arm.damping,
        shape=shape,
        jacobian=jacobian,
        stiffness=arm.stiffness,
    )


@compile_kernel(EXACT)
def write_mass_matrix(
    links: Records, chains: Records, centre: Array, weight: Array, inertia: Array, mass: Array
) -> None:
    """Walks a chain and writes its Jacobian, and its mass matrix (n, n) kg m^2 about the joints.

    Args:
        links: (1,) of :func:`robotrue.robot.chain.links_dtype`.
        chains: (1,) of :func:`robotrue.robot.chain.chain_dtype`, with its angles.
        centre: (n, 4) m of each body in the frame turned by its joint; then 1.
        weight: (n,) kg.
        inertia: (n, 3, 3) kg m^2 about the centre, in that frame.
        mass: Written.
    """
    chain = chains[0]
    walk(links[0], chain)
    write_jacobian(chain)
    n, frame = len(chain.theta), chain.frame
    linear, turned, place = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    mass[:] = 0.0
    for i in range(n):
        if weight[i] <= 0.0:
            continue
        place[:] = 0.0
        add_first_moment(frame[i], centre[i], place)
        for j in range(i + 1):
            for r in range(3):
                u, v = (r + 1) % 3, (r + 2) % 3
                linear[j, r] = frame[j, u, Z] * (place[v] - frame[j, v, ORIGIN])
                linear[j, r] -= frame[j, v, Z] * (place[u] - frame[j, u, ORIGIN])
            _write_turned(frame[i], inertia[i], frame[j], turned[j])
        for j in range(i + 1):
            for k in range(j + 1):
                for r in range(3):
                    mass[j, k] += weight[i] * linear[j, r] * linear[k, r]
                    mass[j, k] += frame[j, r, Z] * turned[k, r]
    for j in range(n):
        for k in range(j):
            mass[k, j] = mass[j, k]


@compile_kernel(EXACT)
def _write_turned(body: Array, inertia: Array, joint: Array, out: Array) -> None:
    """Writes R I R^T z (3,): the body's angular momentum per speed of a joint, in base."""
    local, momentum = np.zeros(3), np.zeros(3)
    for a in range(3):
        for r in range(3):
            local[a] += body[r, a] * joint[r, Z]
    for a in range(3):
        for b in range(3):
            momentum[a] += inertia[a, b] * local[b]
    for r in range(3):
        out[r] = body[r, 0] * momentum[0] + body[r, 1] * momentum[1] + body[r, 2] * momentum[2]
