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
    read, turned = out[READ:LEVER].reshape(3, 3), out[TURNED:ADDED].reshape(3, 3)
    _turn(rotation, c.T_flange_sensor if frame == SENSOR else c.T_flange_tool, frame, read)
    _turn(rotation, c.T_flange_tool, TOOL if c.turns else BASE, turned)
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
        x = axis[k]
        arm = np.cross(x, tip - origin[k])
        for j in range(n):
            m = c.joint_map[k, j]
            for r in range(3):
                way[j, r] += m * arm[r]
                turn[j, r] += m * x[r]
    _bending(n, c, way, turn, turned, out)


@compiled(EXACT)
def _bending(n: int, c: Constants, way: Array, turn: Array, turned: Array, out: Array) -> None:
    added, still = out[ADDED:STILL].reshape(3, 6), out[STILL:PHYSICS].reshape(3, 6)
    spread, d = out[SPREAD:ZERO].reshape(3, 6, 6), c.learned[n + 3 : n + 6]
    out[ADDED:POSE_SIZE] = 0.0
    push, home = np.zeros((n, 3, 6)), np.zeros((n, 3))
    for j in range(n):
        along = d[0] * way[j, 0] + d[1] * way[j, 1] + d[2] * way[j, 2]
        for r in range(3):
            out[PHYSICS + r] += c.learned[j] * along * way[j, r]
            for k in range(3):
                home[j, r] += turned[r, k] * c.home_jacobian[k, j]
        for r in range(3):
            for k in range(3):
                push[j, r, k] = c.own * way[j, r] * way[j, k] - home[j, r] * home[j, k]
                push[j, r, 3 + k] = way[j, r] * turn[j, k]
                still[r, k] += c.compliance[j] * way[j, r] * way[j, k]
                still[r, 3 + k] += c.compliance[j] * push[j, r, 3 + k]
            for k in range(6):
                added[r, k] += c.compliance[j] * push[j, r, k]
        if c.projected:
            for k in range(6):
                size = d[0] * push[j, 0, k] + d[1] * push[j, 1, k] + d[2] * push[j, 2, k]
                for r in range(3):
                    push[j, r, k] -= d[r] * size
    for r in range(3):
        out[PHYSICS + r] -= c.learned[n + r]
        for k in range(3):
            for a in range(3):
                for b in range(3):
                    still[r, k] += turned[r, a] * c.rest[a, b] * turned[k, b]
    for r in range(3):
        for k in range(3):
            out[ZERO + r] += (still[r, k] * c.zero) ** 2
        if c.projected:
            out[ZERO + r] *= 1.0 - d[r] * d[r]
        for i in range(n):
            for j in range(n):
                size = c.covariance[i, j]
                if size != 0.0:
                    for a in range(6):
                        for b in range(6):
                            spread[r, a, b] += size * push[i, r, a] * push[j, r, b]


@compiled(EXACT)
def _turn(rotation: Array, T: Array, frame: int, out: Array) -> None:
    """Writes the rotation of a frame on the flange in base; of base itself the identity."""
    for r in range(3):
        for k in range(3):
            if frame == BASE:
                out[r, k] = 1.0 if r == k else 0.0
            else:
                out[r, k] = (
                    rotation[r, 0] * T[0, k] + rotation[r, 1] * T[1, k] + rotation[r, 2] * T[2, k]
                )
