"""Mass matrix of an arm of lumped masses, in machine code.

All joints at once are a matter of 20 microseconds here and of a millisecond in array operations,
and a stream wants its modes anew ten to fifty times a second.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compiled
from robotrue.robot.chain import ORIGIN, Z
from robotrue.robot.chain_kernels import first_moment, walk, write_jacobian


@compiled(EXACT)
def write_mass_matrix(
    links: Any, chains: Any, centre: Array, weight: Array, inertia: Array, mass: Array
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
    linear, turned = np.empty((n, 3)), np.empty((n, 3))
    mass[:] = 0.0
    for i in range(n):
        if weight[i] <= 0.0:
            continue
        place = first_moment(frame[i], centre[i])
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


@compiled(EXACT)
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
