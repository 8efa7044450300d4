"""The serial arm in machine code, one pose at a time: frames, Jacobian, load torques.

A chain is a record of :func:`robotrue.robot.chain.chain_dtype`. Record fields have shapes that the
compiler knows, so the short loops run without overhead. SI, base frame.
"""

from __future__ import annotations

import math

from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.core.sines import write_sines
from robotrue.robot.chain import ORIGIN, Record, X, Y, Z

SINGULAR_PIVOT = 1e-13
"""Pivot of a 6x6 matrix below which it is singular to rounding."""


@compile_kernel(EXACT)
def walk(links: Record, chain: Record) -> None:
    """Writes ``frame`` of a chain from its ``theta``.

    Args:
        links: Record of :func:`robotrue.robot.chain.links_dtype`.
        chain: Record of :func:`robotrue.robot.chain.chain_dtype`.
    """
    frame, constant = chain.frame, links.constant
    write_sines(chain.theta, chain.sine, chain.cosine)
    for r in range(3):
        for column in range(4):
            frame[0, r, column] = constant[0, r, column]
    for i in range(len(chain.theta)):
        s, e, c = chain.sine[i], chain.cosine[i], constant[i + 1]
        for r in range(3):  # the rows of the rotation are independent of each other
            x, y, z = frame[i, r, X], frame[i, r, Y], frame[i, r, Z]
            x, y = e * x + s * y, e * y - s * x
            frame[i, r, X], frame[i, r, Y] = x, y
            for column in range(4):
                frame[i + 1, r, column] = x * c[X, column] + y * c[Y, column] + z * c[Z, column]
            frame[i + 1, r, ORIGIN] += frame[i, r, ORIGIN]


@compile_kernel(EXACT)
def write_jacobian(chain: Record) -> None:
    """Writes ``jacobian`` of a walked chain: m/rad, then rad/rad."""
    frame, jacobian, tool = chain.frame, chain.jacobian, chain.frame[-1]
    for i in range(len(chain.theta)):
        for r in range(3):
            u, v = (r + 1) % 3, (r + 2) % 3
            jacobian[r, i] = frame[i, u, Z] * (tool[v, ORIGIN] - frame[i, v, ORIGIN])
            jacobian[r, i] -= frame[i, v, Z] * (tool[u, ORIGIN] - frame[i, u, ORIGIN])
            jacobian[3 + r, i] = frame[i, r, Z]


@compile_kernel(EXACT)
def write_load_torque(masses: Record, payload: Array, wrench: Array, chain: Record) -> None:
    """Writes ``torque`` of a walked chain: link weights, payload and wrench about the axes.

    Args:
        masses: Record of :func:`robotrue.robot.chain.masses_dtype`.
        payload: (4,) first moment kg m in the frame turned by the last joint, and mass kg.
        wrench: (6,) N and N m on the tool, at the tool point.
        chain: Its ``frame`` is read.
    """
    frame, tool, moment = chain.frame, chain.frame[-1], chain.moment
    last = len(chain.theta) - 1
    moment[:] = 0.0
    add_first_moment(frame[last], payload, moment)
    for j in range(last + 1):
        i = last - j
        add_first_moment(frame[i], masses.moment[i], moment)
        mass, total = masses.outboard[i] + payload[3], 0.0
        for r in range(3):
            # Moment about the joint's origin: weights at their centres, wrench at the tool.
            u, v = (r + 1) % 3, (r + 2) % 3
            centre_u = moment[u] - mass * frame[i, u, ORIGIN]
            centre_v = moment[v] - mass * frame[i, v, ORIGIN]
            lever_u = tool[u, ORIGIN] - frame[i, u, ORIGIN]
            lever_v = tool[v, ORIGIN] - frame[i, v, ORIGIN]
            total += frame[i, r, Z] * (
                centre_u * masses.gravity[v] - centre_v * masses.gravity[u]
                + lever_u * wrench[v] - lever_v * wrench[u] + wrench[3 + r]
            )  # fmt: skip
        chain.torque[i] = total


@compile_kernel(EXACT, inline=True)
def add_first_moment(frame: Array, body: Array, moment: Array) -> None:
    """Adds the first moment kg m in base of a body: (3,) kg m in a frame, then its mass kg."""
    for r in range(3):
        along = 0.0
        for column in range(4):
            along += body[column] * frame[r, column]
        moment[r] += along


@compile_kernel(EXACT)
def deviation(pose: Array, target: Array, error: Array) -> tuple[float, float]:
    """Writes pose minus target (6,) m and rad; returns both lengths.

    The turn is the sine of the rotation vector, stretched to the angle beyond a quarter turn so
    that Newton steps stay long enough.

    Args:
        pose: (3, 4).
        target: (3, 4).
        error: Written.
    """
    trace = squared = turned = 0.0
    for r in range(3):
        u, v, twice = (r + 1) % 3, (r + 2) % 3, 0.0
        for column in range(3):
            twice += target[u, column] * pose[v, column] - target[v, column] * pose[u, column]
            trace += pose[r, column] * target[r, column]
        error[3 + r], error[r] = 0.5 * twice, pose[r, ORIGIN] - target[r, ORIGIN]
        turned += error[3 + r] * error[3 + r]
        squared += error[r] * error[r]
    turn = math.sqrt(turned)
    if trace < 1.0:
        stretch = math.atan2(turn, 0.5 * (trace - 1.0)) / max(turn, 1e-6)
        for r in range(3):
            error[3 + r] *= stretch
        turn *= stretch
    return math.sqrt(squared), turn


@compile_kernel(EXACT)
def invert_matrix(matrix: Array, pivot: Array, inverse: Array) -> bool:
    """Writes the inverse of a matrix (6, 6) by Gauss-Jordan with row pivots; False if singular.

    Args:
        matrix: Read.
        pivot: (6,) work space, integers.
        inverse: (6, 6), written.
    """
    for i in range(6):
        for j in range(6):
            inverse[i, j] = matrix[i, j]
    for k in range(6):
        best = k
        for i in range(k + 1, 6):
            if abs(inverse[i, k]) > abs(inverse[best, k]):
                best = i
        pivot[k] = best
        if not abs(inverse[best, k]) > SINGULAR_PIVOT:
            return False
        if best != k:
            for j in range(6):
                inverse[k, j], inverse[best, j] = inverse[best, j], inverse[k, j]
        scale = 1.0 / inverse[k, k]
        inverse[k, k] = 1.0
        for j in range(6):
            inverse[k, j] *= scale
        for i in range(6):
            if i != k:
                factor = inverse[i, k]
                inverse[i, k] = 0.0
                for j in range(6):
                    inverse[i, j] -= factor * inverse[k, j]
    for k in range(5, -1, -1):
        best = pivot[k]
        if best != k:
            for i in range(6):
                inverse[i, k], inverse[i, best] = inverse[i, best], inverse[i, k]
    return True


@compile_kernel(EXACT, inline=True)
def multiply(matrix: Array, vector: Array, out: Array) -> None:
    """Writes matrix (6, 6) @ vector (6,)."""
    for i in range(6):
        total = 0.0
        for k in range(6):
            total += matrix[i, k] * vector[k]
        out[i] = total
