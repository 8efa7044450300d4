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
            frame[i + 1, r, X] = x * c[X, X] + y * c[Y, X] + z * c[Z, X]
            frame[i + 1, r, Y] = x * c[X, Y] + y * c[Y, Y] + z * c[Z, Y]
            frame[i + 1, r, Z] = x * c[X, Z] + y * c[Y, Z] + z * c[Z, Z]
            frame[i + 1, r, ORIGIN] = (
                x * c[X, ORIGIN] + y * c[Y, ORIGIN] + z * c[Z, ORIGIN] + frame[i, r, ORIGIN]
            )


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
    frame, tool, gravity = chain.frame, chain.frame[-1], masses.gravity
    last = len(chain.theta) - 1
    m0, m1, m2 = first_moment(frame[last], payload)
    for j in range(last + 1):
        i = last - j
        c0, c1, c2 = first_moment(frame[i], masses.moment[i])
        m0, m1, m2 = m0 + c0, m1 + c1, m2 + c2
        mass = masses.outboard[i] + payload[3]
        # Moment about the joint's origin: weights at their centres, wrench at the tool.
        a0, a1, a2 = (
            m0 - mass * frame[i, X, ORIGIN],
            m1 - mass * frame[i, Y, ORIGIN],
            m2 - mass * frame[i, Z, ORIGIN],
        )
        l0, l1, l2 = (
            tool[X, ORIGIN] - frame[i, X, ORIGIN],
            tool[Y, ORIGIN] - frame[i, Y, ORIGIN],
            tool[Z, ORIGIN] - frame[i, Z, ORIGIN],
        )
        t0 = a1 * gravity[2] - a2 * gravity[1] + l1 * wrench[2] - l2 * wrench[1] + wrench[3]
        t1 = a2 * gravity[0] - a0 * gravity[2] + l2 * wrench[0] - l0 * wrench[2] + wrench[4]
        t2 = a0 * gravity[1] - a1 * gravity[0] + l0 * wrench[1] - l1 * wrench[0] + wrench[5]
        chain.torque[i] = frame[i, X, Z] * t0 + frame[i, Y, Z] * t1 + frame[i, Z, Z] * t2


@compile_kernel(EXACT, inline=True)
def first_moment(frame: Array, moment: Array) -> tuple[float, float, float]:
    """Returns the first moment kg m in base of one given in a frame, with its mass behind it."""
    a, b, c, mass = moment[0], moment[1], moment[2], moment[3]
    return (
        a * frame[0, X] + b * frame[0, Y] + c * frame[0, Z] + mass * frame[0, ORIGIN],
        a * frame[1, X] + b * frame[1, Y] + c * frame[1, Z] + mass * frame[1, ORIGIN],
        a * frame[2, X] + b * frame[2, Y] + c * frame[2, Z] + mass * frame[2, ORIGIN],
    )


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
    x = y = z = trace = 0.0
    for column in range(3):
        p0, p1, p2 = pose[0, column], pose[1, column], pose[2, column]
        t0, t1, t2 = target[0, column], target[1, column], target[2, column]
        x += t1 * p2 - t2 * p1
        y += t2 * p0 - t0 * p2
        z += t0 * p1 - t1 * p0
        trace += p0 * t0 + p1 * t1 + p2 * t2
    error[3], error[4], error[5] = 0.5 * x, 0.5 * y, 0.5 * z
    squared = 0.0
    for r in range(3):
        error[r] = pose[r, ORIGIN] - target[r, ORIGIN]
        squared += error[r] * error[r]
    turned = 0.25 * (x * x + y * y + z * z)
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
