"""Forward kinematics and analytic Jacobians, vectorised over poses.

The chain is walked once as elementary rotations and translations. Each elementary transform leaves
its axis and origin behind; every derivative is then one cross product: a rotation about axis u
through p moves the tool point x by u x (x - p), a translation along u by u.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array
from robotrue.robot.model import RobotModel, moment_slice, parameter_slice

X, Y, Z = 0, 1, 2
LINK = -1
"""Number of a mark that is the frame of a link."""
_REACH_STEPS = 91  # postures of shoulder and of elbow that are tried for the reach
BLOCK = 4096  # poses walked at a time in forward(), so that the frame stays in the cache


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainState:
    """The chain at n poses: everything Jacobians and statics need. Base frame, m.

    Attributes:
        rotation: (n, 3, 3) R_base_tool.
        position: (n, 3) p_base_tool.
        param_axis: (n, P, 3) unit axis of each elementary error, NaN-free; P = 5 dof + 12
            (theta, d, a, alpha, beta per joint, then base and tool).
        param_origin: (n, P, 3) point the axis goes through.
        param_is_rotation: (P,) rotation or translation.
        link_rotation: (n, dof, 3, 3) link frames.
        link_position: (n, dof, 3) link origins.
        flange_rotation: (n, 3, 3).
        flange_position: (n, 3).
    """

    rotation: Array
    position: Array
    param_axis: Array
    param_origin: Array
    param_is_rotation: Array
    link_rotation: Array
    link_position: Array
    flange_rotation: Array
    flange_position: Array

    @property
    def joint_axis(self) -> Array:
        """(n, dof, 3) unit joint axes in base."""
        return self.param_axis[:, : self.link_position.shape[1]]

    @property
    def joint_origin(self) -> Array:
        """(n, dof, 3) points on the joint axes in base, m."""
        return self.param_origin[:, : self.link_position.shape[1]]

    @property
    def transforms(self) -> Array:
        """(n, 4, 4) T_base_tool."""
        out = np.zeros((len(self.position), 4, 4))
        out[:, :3, :3] = self.rotation
        out[:, :3, 3] = self.position
        out[:, 3, 3] = 1.0
        return out


class _Walker:
    """A frame walking down the chain; columns and origin are (3, n) arrays."""

    def __init__(self, n: int) -> None:
        self.columns = [np.repeat(np.eye(3)[:, [k]], n, axis=1) for k in range(3)]
        self.origin = np.zeros((3, n))

    def rotate(self, axis: int, angle: Array | float) -> tuple[Array, Array]:
        if isinstance(angle, float) and angle == 0.0:
            return self.columns[axis], self.origin
        j, k = (axis + 1) % 3, (axis + 2) % 3
        cosine, sine = np.cos(angle), np.sin(angle)
        cj, ck = self.columns[j], self.columns[k]
        if isinstance(angle, float) and abs(cosine) < 1e-16:  # a right angle of a DH table
            self.columns[j], self.columns[k] = sine * ck, -sine * cj
            return self.columns[axis], self.origin
        self.columns[j] = cosine * cj + sine * ck
        self.columns[k] = cosine * ck - sine * cj
        return self.columns[axis], self.origin

    def translate(self, axis: int, length: float) -> tuple[Array, Array]:
        before = self.origin
        if length == 0.0:
            return self.columns[axis], before
        self.origin = before + length * self.columns[axis]
        return self.columns[axis], before

    def place(self, transform: Array) -> None:
        if np.array_equal(transform, np.eye(4)):
            return
        stack = np.stack(self.columns, axis=1)  # (3, 3, n): [row, column, pose]
        self.origin = self.origin + np.einsum("rcn,c->rn", stack, transform[:3, 3])
        turned = np.einsum("rcn,ck->rkn", stack, transform[:3, :3])
        self.columns = [np.ascontiguousarray(turned[:, k]) for k in range(3)]

    def copy(self) -> _Walker:
        """Returns the frame as it is now; its arrays are replaced, never changed."""
        copy = object.__new__(_Walker)
        copy.columns, copy.origin = list(self.columns), self.origin
        return copy

    def rotation(self) -> Array:
        return np.moveaxis(np.stack(self.columns, axis=1), -1, 0)

    def position(self) -> Array:
        return np.ascontiguousarray(self.origin.T)


def joint_angles(robot: RobotModel, joints: Array, shift: Array | None = None) -> Array:
    """Returns theta (n, dof) rad from q (n, dof) rad, errors included.

    Args:
        robot: The arm with its errors.
        joints: (n, dof) rad, what the controller commands.
        shift: (n, dof) rad, added to q on the drive side (ripple, deflection).
    """
    q = np.asarray(joints, dtype=np.float64) * (1.0 + robot.error("gear"))
    if shift is not None:
        q = q + shift
    return q @ robot.joint_map.T + robot.theta + robot.error("theta")


def walk(robot: RobotModel, joints: Array, shift: Array | None = None) -> ChainState:
    """Returns the state of the chain at every pose.

    Args:
        robot: The arm; its ``errors`` are used (call on ``robot.nominal()`` for the controller's).
        joints: (n, dof) rad.
        shift: (n, dof) rad, see :func:`joint_angles`; compliance is *not* added here
            (see :func:`robotrue.robot.statics.deflect_arm`).
    """
    theta = joint_angles(robot, joints, shift)
    dof = robot.dof
    base, tool = 5 * dof, 5 * dof + 6
    walker, links, marks = _Walker(len(theta)), list[_Walker](), dict[int, tuple[Array, Array]]()
    for number, mark in _walk_chain(walker, robot, theta):
        if number == LINK:
            links.append(walker.copy())
        marks[number] = mark
    rotations = [link.rotation() for link in links]
    count = 5 * dof + 12
    is_rotation = np.zeros(count, dtype=bool)
    is_rotation[: 2 * dof] = np.repeat([True, False], dof)
    is_rotation[3 * dof : 5 * dof] = True
    is_rotation[base + 3 : base + 6] = True
    is_rotation[tool + 3 : tool + 6] = True
    return ChainState(
        rotation=walker.rotation(),
        position=walker.position(),
        param_axis=np.stack([marks[k][0].T for k in range(count)], axis=1),
        param_origin=np.stack([marks[k][1].T for k in range(count)], axis=1),
        param_is_rotation=is_rotation,
        link_rotation=np.stack(rotations, axis=1),
        link_position=np.stack([link.position() for link in links], axis=1),
        flange_rotation=rotations[-1],
        flange_position=links[-1].position(),
    )


def _walk_chain(
    walker: _Walker, robot: RobotModel, theta: Array
) -> Iterator[tuple[int, tuple[Array, Array]]]:
    """Walks down to the tool; yields number, axis and origin (3, n) of each elementary error.

    ``LINK`` replaces the number where a link's frame is reached. Nothing is stored here, so that a
    walk that needs the last frame alone stays in the cache.
    """
    dof = robot.dof
    d, a = (robot.d + robot.error("d")).tolist(), (robot.a + robot.error("a")).tolist()
    alpha = (robot.alpha + robot.error("alpha")).tolist()
    beta = (robot.beta + robot.error("beta")).tolist()
    yield from _error_pose(walker, robot.error("base"), 5 * dof)
    for i in range(dof):
        if robot.convention == "dh":
            yield i, walker.rotate(Z, theta[:, i])
            yield dof + i, walker.translate(Z, d[i])
            yield 2 * dof + i, walker.translate(X, a[i])
            yield 3 * dof + i, walker.rotate(X, alpha[i])
            yield 4 * dof + i, walker.rotate(Y, beta[i])
        else:
            yield 3 * dof + i, walker.rotate(X, alpha[i])
            yield 2 * dof + i, walker.translate(X, a[i])
            yield 4 * dof + i, walker.rotate(Y, beta[i])
            yield i, walker.rotate(Z, theta[:, i])
            yield dof + i, walker.translate(Z, d[i])
        yield LINK, (walker.origin, walker.origin)
    walker.place(robot.T_flange_tool)
    yield from _error_pose(walker, robot.error("tool"), 5 * dof + 6)


def _error_pose(
    walker: _Walker, values: Array, start: int
) -> Iterator[tuple[int, tuple[Array, Array]]]:
    for k in range(3):
        yield start + k, walker.translate(k, float(values[k]))
    for k in range(3):
        yield start + 3 + k, walker.rotate(k, float(values[3 + k]))


def forward(robot: RobotModel, joints: Array, shift: Array | None = None) -> Array:
    """Returns T_base_tool (n, 4, 4) of the rigid arm with its geometric errors.

    Args:
        robot: The arm; call on ``robot.nominal()`` for what the controller computes.
        joints: (n, dof) rad.
        shift: (n, dof) rad on the drive side.
    """
    theta = joint_angles(robot, joints, shift)
    out = np.zeros((len(theta), 4, 4))
    out[:, 3, 3] = 1.0
    for start in range(0, len(theta), BLOCK):
        block = theta[start : start + BLOCK]
        walker = _Walker(len(block))
        for _ in _walk_chain(walker, robot, block):
            pass
        part = out[start : start + BLOCK]
        for k in range(3):
            part[:, :3, k] = walker.columns[k].T
        part[:, :3, 3] = walker.origin.T
    return out


def joint_jacobian(robot: RobotModel, state: ChainState) -> Array:
    """Returns dx/dq (n, 6, dof): tool-point translation (m/rad), then rotation, in base."""
    columns = _columns(state, slice(0, robot.dof))
    return columns @ (robot.joint_map * (1.0 + robot.error("gear")))


def drive_jacobian(robot: RobotModel, state: ChainState) -> Array:
    """Returns dx/dshift (n, 6, dof): the tool twist per rad of drive-side ripple or deflection."""
    return _columns(state, slice(0, robot.dof)) @ robot.joint_map


def parameter_jacobian(
    robot: RobotModel,
    state: ChainState,
    joints: Array,
    torque: Array | None = None,
    weight: Array | None = None,
) -> Array:
    """Returns dx/derrors (n, 6, 9 dof + 12), linear part first, base frame.

    The rotation part is the left (base-frame) rotation vector per unit of the parameter.

    Args:
        robot: The arm.
        state: From :func:`walk` (or ``deflect_arm``) at the same joints.
        joints: (n, dof) rad, for the gear columns.
        torque: (n, dof) N m on the drives, for the compliance columns; zero if not given.
        weight: (n, dof, 2, dof) m^2/s^2 of :func:`robotrue.robot.statics.weight_torque`, for the
            columns of the first moments; zero if not given.
    """
    dof = robot.dof
    n = len(state.position)
    out = np.zeros((n, 6, len(robot.errors)))
    out[:, :, : 5 * dof] = _columns(state, slice(0, 5 * dof))
    out[:, :, -12:] = _columns(state, slice(5 * dof, 5 * dof + 12))
    drive = drive_jacobian(robot, state)
    out[:, :, parameter_slice(dof, "gear")] = drive * np.asarray(joints)[:, None, :]
    if torque is not None:
        out[:, :, parameter_slice(dof, "compliance")] = drive * torque[:, None, :]
    if weight is not None:
        soft = drive * robot.error("compliance")
        out[:, :, moment_slice(dof)] = soft @ weight.reshape(n, dof, 2 * dof)
    return out


def _columns(state: ChainState, which: slice) -> Array:
    axis = state.param_axis[:, which]
    arm = state.position[:, None, :] - state.param_origin[:, which]
    turning = state.param_is_rotation[which][None, :, None]
    linear = np.where(turning, np.cross(axis, arm), axis)
    angular = np.where(turning, axis, 0.0)
    return np.swapaxes(np.concatenate([linear, angular], axis=2), 1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Derivative of m observed numbers of n postures by the errors of the arm.

    Attributes:
        errors: (n, m, 9 dof + 12) by the error vector of the robot.
        drive: (n, m, dof) by a shift of the drive angles, per rad.
        shift: (n, m, 3) by a shift of the tool point in base, per m.
    """

    errors: Array
    drive: Array
    shift: Array


def sensitivity_of(robot: RobotModel, jacobian: Array) -> Sensitivity:
    """Returns what follows from d(observed)/d(error vector), (n, m, 9 dof + 12 or more)."""
    dof = robot.dof
    return Sensitivity(
        errors=jacobian[:, :, : len(robot.errors)],
        drive=jacobian[:, :, parameter_slice(dof, "theta")] @ robot.joint_map,
        shift=jacobian[:, :, parameter_slice(dof, "base")][:, :, :3],
    )


def wrist_reach(robot: RobotModel) -> float:
    """Returns the largest distance in m of the wrist from the first axis, to about 0.1 %.

    The wrist is where the last axis but one lies; shoulder and elbow are the axes that move it in a
    plane. :attr:`RobotModel.reach` is a bound that no posture exceeds, tool included.
    """
    elbow = 2 if robot.dof < 7 else 3
    low, high = robot.limits[:, 0], robot.limits[:, 1]
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    joints = np.zeros((_REACH_STEPS, _REACH_STEPS, robot.dof))
    joints[..., 1] = np.linspace(low[1], high[1], _REACH_STEPS)[:, None]
    joints[..., elbow] = np.linspace(low[elbow], high[elbow], _REACH_STEPS)[None]
    wrist = walk(robot.nominal(), joints.reshape(-1, robot.dof)).joint_origin[:, -2]
    return float(np.hypot(wrist[:, 0], wrist[:, 1]).max())
