"""Mass matrix and tool Jacobian of an arm of lumped masses, in machine code.

All joints at once are a matter of 20 microseconds here and of a millisecond in array operations,
and a stream wants its modes anew ten to fifty times a second.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compiled


@compiled(EXACT)
def mass_and_jacobian(
    joints: Array,
    table: Array,
    modified: bool,
    joint_map: Array,
    bodies: Array,
    T_flange_tool: Array,
    mass: Array,
    jacobian: Array,
) -> None:
    """Writes the mass matrix (n, n) kg m^2 and dx/dq of the tool (6, n) m/rad, rad/rad, in base.

    Args:
        joints: (n,) rad, the drives' coordinates.
        table: (n, 4) theta, d, a, alpha.
        modified: Craig's convention instead of the standard one.
        joint_map: (n, n), angles of the chain from the drives' coordinates.
        bodies: (n + 1, 13) mass kg, centre (3) m, inertia about it (9) kg m^2, in the link's own
            frame; the last is what the flange carries.
        T_flange_tool: (4, 4).
        mass: To write to.
        jacobian: To write to.
    """
    n = len(joints)
    axis, origin = np.empty((n, 3)), np.empty((n, 3))
    rotation, place = np.eye(3), np.zeros(3)
    linear, angular = np.empty((3, n)), np.empty((3, n))
    chain, tool = np.zeros((n, n)), np.zeros((6, n))
    inertia, turned = np.empty((3, 3)), np.empty((3, n))
    for i in range(n):
        theta = table[i, 0]
        for j in range(n):
            theta += joint_map[i, j] * joints[j]
        sa, ca = math.sin(table[i, 3]), math.cos(table[i, 3])
        link(theta, table[i, 1], table[i, 2], sa, ca, modified, rotation, place, axis[i], origin[i])
        last = i + 1 if i + 1 < n else n + 1
        for b in range(i, last):
            weight = bodies[b, 0]
            if weight <= 0.0:
                continue
            _columns(i + 1, axis, origin, rotation, place, bodies[b, 1:4], linear, angular)
            for r in range(3):  # R I R^T
                for c in range(3):
                    total = 0.0
                    for k in range(3):
                        for m in range(3):
                            total += rotation[r, k] * bodies[b, 4 + 3 * k + m] * rotation[c, m]
                    inertia[r, c] = total
            for j in range(i + 1):
                for r in range(3):
                    turned[r, j] = (
                        inertia[r, 0] * angular[0, j]
                        + inertia[r, 1] * angular[1, j]
                        + inertia[r, 2] * angular[2, j]
                    )
            for j in range(i + 1):
                for k in range(j + 1):
                    total = 0.0
                    for r in range(3):
                        total += weight * linear[r, j] * linear[r, k] + angular[r, j] * turned[r, k]
                    chain[j, k] += total
    _columns(n, axis, origin, rotation, place, T_flange_tool[:3, 3], linear, angular)
    for j in range(n):
        for r in range(3):
            tool[r, j], tool[3 + r, j] = linear[r, j], angular[r, j]
        for k in range(j):
            chain[k, j] = chain[j, k]
    for p in range(n):
        for q in range(n):
            total = 0.0
            for j in range(n):
                for k in range(n):
                    total += joint_map[j, p] * chain[j, k] * joint_map[k, q]
            mass[p, q] = total
        for r in range(6):
            total = 0.0
            for j in range(n):
                total += tool[r, j] * joint_map[j, p]
            jacobian[r, p] = total


@compiled(EXACT)
def link(
    theta: float,
    d: float,
    a: float,
    sa: float,
    ca: float,
    modified: bool,
    rotation: Array,
    place: Array,
    axis: Array,
    origin: Array,
) -> None:
    """Moves the frame ``rotation``, ``place`` over one link; writes the joint's axis and origin.

    Args:
        theta: rad, angle of the joint in the chain.
        d: m.
        a: m.
        sa: Sine of alpha.
        ca: Its cosine.
        modified: Craig's convention instead of the standard one.
        rotation: (3, 3), changed.
        place: (3,) m, changed.
        axis: (3,), written.
        origin: (3,) m, written.
    """
    st, ct = math.sin(theta), math.cos(theta)
    if modified:  # Rx(alpha) Tx(a) Rz(theta) Tz(d)
        for r in range(3):
            place[r] += a * rotation[r, 0]
            y, z = rotation[r, 1], rotation[r, 2]
            rotation[r, 1], rotation[r, 2] = ca * y + sa * z, ca * z - sa * y
    for r in range(3):
        axis[r], origin[r] = rotation[r, 2], place[r]
    for r in range(3):
        x, y = rotation[r, 0], rotation[r, 1]
        rotation[r, 0], rotation[r, 1] = ct * x + st * y, ct * y - st * x
        place[r] += d * rotation[r, 2]
    if not modified:
        for r in range(3):
            place[r] += a * rotation[r, 0]
            y, z = rotation[r, 1], rotation[r, 2]
            rotation[r, 1], rotation[r, 2] = ca * y + sa * z, ca * z - sa * y


@compiled(EXACT)
def _columns(
    count: int,
    axis: Array,
    origin: Array,
    rotation: Array,
    place: Array,
    local: Array,
    linear: Array,
    angular: Array,
) -> None:
    """Writes the Jacobian columns of the first ``count`` joints for a point of the present link."""
    px = (
        place[0] + rotation[0, 0] * local[0] + rotation[0, 1] * local[1] + rotation[0, 2] * local[2]
    )
    py = (
        place[1] + rotation[1, 0] * local[0] + rotation[1, 1] * local[1] + rotation[1, 2] * local[2]
    )
    pz = (
        place[2] + rotation[2, 0] * local[0] + rotation[2, 1] * local[1] + rotation[2, 2] * local[2]
    )
    for j in range(count):
        ux, uy, uz = axis[j, 0], axis[j, 1], axis[j, 2]
        ax, ay, az = px - origin[j, 0], py - origin[j, 1], pz - origin[j, 2]
        linear[0, j] = uy * az - uz * ay
        linear[1, j] = uz * ax - ux * az
        linear[2, j] = ux * ay - uy * ax
        angular[0, j], angular[1, j], angular[2, j] = ux, uy, uz
