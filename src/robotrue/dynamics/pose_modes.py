"""Modes of the arm at any pose, from lumped masses and the stiffness of its joints.

    M(q) eta'' + K eta = J(q)^T f,    M phi = phi / omega^2 K,    phi^T M phi = 1

M comes from the links' masses, centres and inertias, J is the tool's Jacobian, both in the
coordinates of the drives: with a parallel rod joint 2 moves the links beyond it without turning
them, as in ``joint_map`` of the robot model. K is the stiffness of the joints. Damping is given
mode by mode: no model of joints predicts it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, Records
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.dynamics.oscillators import Oscillators, real_modes
from robotrue.errors import ModelMismatchError, ReachError, ShapeError
from robotrue.robot.chain import ORIGIN, Z, chain_dtype, link_frames, links_of
from robotrue.robot.chain_kernels import walk, write_jacobian
from robotrue.robot.model import RobotModel

LIMIT_SLACK: Final = 1e-6
"""rad; largest excess over a joint limit that still counts as inside."""


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
        """Checks signs, packs the bodies."""
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
        n, drives = self.robot.dof, self.robot.joint_map
        chain = np.zeros(1, chain_dtype(n))[0]
        chain["theta"] = drives @ joints + self.robot.theta
        walk(self._links[0], chain)
        write_jacobian(chain)
        centre, weight, inertia = self._bodies
        frame = chain["frame"][:n]
        axis, origin = frame[:, :, Z], frame[:, :, ORIGIN]
        place = (frame @ centre[:, :, None])[:, :, 0]
        carried = np.tri(n)[:, :, None]  # a joint moves the bodies from its own link on
        linear = np.cross(axis, place[:, None] - origin) * carried
        angular = (axis @ frame[:, :, : Z + 1]) * carried  # in the axes of each body
        mass = weight[:, None, None] * (linear @ np.swapaxes(linear, 1, 2))
        mass = np.sum(mass + angular @ inertia @ np.swapaxes(angular, 1, 2), axis=0)
        return drives.T @ mass @ drives, chain["jacobian"] @ drives


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
