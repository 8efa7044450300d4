"""What an estimate needs of a pose, in machine code: rotations, levers, what a wrench bends.

The slow wrench w = (F, M) on the tool point bends joint j of compliance c_j by c_j (a_j.F + b_j.M),
with a_j, b_j the tool point's way and turn per drive. With h_j the way at the pose of the
frequency response, turned along with its axes::

    K_j = a_j (own a_j, b_j)^T - h_j (h_j, 0)^T      added = sum_j c_j K_j w
    T   = sum_j c_j a_j (a_j, b_j)^T + R rest R^T    still = T w

``own`` is 1, or 0 where the response itself knows the arm at every pose.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compiled
from robotrue.online.sensing_joints import chain

BASE, TOOL, SENSOR = 0, 1, 2
"""Frames a force comes in."""
# where things stand in the numbers of a pose
READ, LEVER, TURNED, ADDED, STILL, PHYSICS, SPREAD, ZERO = 0, 9, 12, 21, 39, 57, 60, 168
POSE_SIZE: Final = 171


class Constants(NamedTuple):
    """Models as the kernels take them.

    Attributes:
        table: (dof, 5) theta, d, a, sine and cosine of alpha.
        modified: Craig's convention.
        joint_map: (dof, dof).
        limits: (dof, 2) rad.
        T_flange_tool: (4, 4) m.
        T_flange_sensor: (4, 4) m.
        held: (12,) weight in base, centre, force offset, moment offset.
        compliance: (dof,) rad/(N m).
        covariance: (dof, dof).
        home: (dof,) rad, pose of the response; NaN without.
        home_jacobian: (3, dof) m/rad at it, in the response's axes; zero without.
        rest: (3, 3) m/N in the response's axes: its static deflection less that of the arm there.
        learned: (dof + 12,) compliance times factor, g, direction, lowest and highest force.
        own: 1 where the arm's compliance is added to the response, 0 where it is in it.
        turns: Whether the response turns with the tool.
        zero: N, standard deviation of the sensor's zero.
        projected: Whether what the joints are unsure of counts only across ``direction``.
    """

    table: Array
    modified: bool
    joint_map: Array
    limits: Array
    T_flange_tool: Array
    T_flange_sensor: Array
    held: Array
    compliance: Array
    covariance: Array
    home: Array
    home_jacobian: Array
    rest: Array
    learned: Array
    own: float
    turns: bool
    zero: float
    projected: bool


@compiled(EXACT)
def posed(joints: Array, frame: int, c: Constants, out: Array) -> None:
    """Writes the numbers of a pose (POSE_SIZE,).

    Args:
        joints: (dof,) rad.
        frame: BASE, TOOL or SENSOR: axes of the force that comes.
        c: Models.
        out: READ (3, 3) rotation of the force's axes in base; LEVER (3,) m from its origin to the
            tool point, base; TURNED (3, 3) rotation of the response's axes; ADDED (3, 6),
            STILL (3, 6) m/N and m/(N m); PHYSICS (3,) m/N along the learned direction; SPREAD
            (3, 6, 6) variance per wrench squared; ZERO (3,) m^2.
    """
    n = len(joints)
    rotation, place, tip = np.empty((3, 3)), np.empty(3), np.empty(3)
    axis, origin = np.empty((n, 3)), np.empty((n, 3))
    chain(joints, c.table, c.modified, c.joint_map, rotation, place, axis, origin)
    _turn(rotation, c.T_flange_sensor if frame == SENSOR else c.T_flange_tool, frame, READ, out)
    _turn(rotation, c.T_flange_tool, TOOL if c.turns else BASE, TURNED, out)
    for r in range(3):
        tip[r] = place[r]
        out[LEVER + r] = 0.0
        for k in range(3):
            tip[r] += rotation[r, k] * c.T_flange_tool[k, 3]
            if frame == SENSOR:
                gap = c.T_flange_tool[k, 3] - c.T_flange_sensor[k, 3]
                out[LEVER + r] += rotation[r, k] * gap
    way, turn = np.zeros((n, 3)), np.zeros((n, 3))
    for k in range(n):
        ux, uy, uz = axis[k, 0], axis[k, 1], axis[k, 2]
        ax, ay, az = tip[0] - origin[k, 0], tip[1] - origin[k, 1], tip[2] - origin[k, 2]
        for j in range(n):
            m = c.joint_map[k, j]
            way[j, 0] += m * (uy * az - uz * ay)
            way[j, 1] += m * (uz * ax - ux * az)
            way[j, 2] += m * (ux * ay - uy * ax)
            for r in range(3):
                turn[j, r] += m * axis[k, r]
    _bending(n, c, way, turn, out)


@compiled(EXACT)
def _bending(n: int, c: Constants, way: Array, turn: Array, out: Array) -> None:
    """Writes ADDED, STILL, PHYSICS, SPREAD and ZERO from the tool point's way and turn (n, 3)."""
    dx, dy, dz = c.learned[n + 3], c.learned[n + 4], c.learned[n + 5]
    for a in range(ADDED, POSE_SIZE):
        out[a] = 0.0
    push, home = np.zeros((n, 3, 6)), np.zeros((n, 3))
    for j in range(n):
        along = c.learned[j] * (dx * way[j, 0] + dy * way[j, 1] + dz * way[j, 2])
        for r in range(3):
            out[PHYSICS + r] += along * way[j, r]
            for k in range(3):
                home[j, r] += out[TURNED + 3 * r + k] * c.home_jacobian[k, j]
        for r in range(3):
            for k in range(6):
                other = way[j, k] if k < 3 else turn[j, k - 3]
                size = way[j, r] * other
                out[STILL + 6 * r + k] += c.compliance[j] * size
                if k < 3:
                    size = c.own * size - home[j, r] * home[j, k]
                push[j, r, k] = size
                out[ADDED + 6 * r + k] += c.compliance[j] * size
        if c.projected:
            for k in range(6):
                size = dx * push[j, 0, k] + dy * push[j, 1, k] + dz * push[j, 2, k]
                push[j, 0, k] -= dx * size
                push[j, 1, k] -= dy * size
                push[j, 2, k] -= dz * size
    for r in range(3):
        out[PHYSICS + r] -= c.learned[n + r]
        across = 1.0 - c.learned[n + 3 + r] ** 2 if c.projected else 1.0
        for k in range(3):
            size = 0.0
            for a in range(3):
                for b in range(3):
                    size += out[TURNED + 3 * r + a] * c.rest[a, b] * out[TURNED + 3 * k + b]
            out[STILL + 6 * r + k] += size
            out[ZERO + r] += across * (out[STILL + 6 * r + k] * c.zero) ** 2
        for i in range(n):
            for j in range(n):
                size = c.covariance[i, j]
                if size != 0.0:
                    for a in range(36):
                        out[SPREAD + 36 * r + a] += size * push[i, r, a // 6] * push[j, r, a % 6]


@compiled(EXACT)
def _turn(rotation: Array, T: Array, frame: int, at: int, out: Array) -> None:
    """Writes the rotation of a frame on the flange in base from ``at`` on; of base the identity."""
    for r in range(3):
        for k in range(3):
            size = 1.0 if r == k else 0.0
            if frame != BASE:
                size = 0.0
                for a in range(3):
                    size += rotation[r, a] * T[a, k]
            out[at + 3 * r + k] = size
