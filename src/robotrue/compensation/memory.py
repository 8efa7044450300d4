"""Memory of the lanes: which quantity stands in which row, and what the kernels are given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotrue.core.arrays import Array, IntArray

LANES = 32
"""Targets abreast: the rows of a chain then stay in the nearest caches."""

# Rows of ``lane``: what is given per target.
TARGET, START, APPROACH, MASS, CENTRE, WRENCH = 0, 12, 18, 24, 25, 28
LANE_ROWS = 34
# Rows of ``work``.
JOINTS, TORQUE, MOMENT, TURNING = 0, 6, 12, 15
ERROR, SHIFT, TURN, TOLD_SHIFT, TOLD_TURN = 18, 24, 25, 26, 27
SMOOTH, SMOOTH_AT, STEP, PULL = 28, 31, 37, 43
SUM = 49  # of the ripple: four rows
WORK_ROWS = 53
# Rows of ``matrix``: Jacobian by rows, the inverse factor of the normal matrix, pivot, trace.
NORMAL, PIVOT, TRACE = 36, 72, 73
MATRIX_ROWS = 74
# Rows of a chain: frame i (x, y, z, origin) before the turn of joint i + 1; frame 6 is the tool.
TOOL = 72
CHAIN_ROWS = 84


class Arm(NamedTuple):
    """The calibrated arm with one tool; as in ``Pack``, matrices of poses flat."""

    nominal: Array  # (84,) C_0..C_6
    actual: Array  # (84,)
    zero: Array  # (6,)
    coupling: Array  # (6, 6)
    coupled: bool
    dtheta: Array  # (6,)
    gear: Array  # (6,)
    compliance: Array  # (6,)
    backlash: Array  # (6,)
    harmonics: Array  # (h,)
    consecutive: bool
    ripple: Array  # (h, 12)
    mass_out: Array  # (6,)
    com: Array  # (24,)
    flange: Array  # (12,)
    gravity: Array  # (3,)
    table: Array  # (b, 16 LANES), see _smooth
    scale: Array  # (12,)
    length: float


class Aim(NamedTuple):
    """When a lane has arrived and which postures are refused; see ``CompensationSettings``."""

    tolerance: float
    turn_tolerance: float
    min_singular_value: float
    min_wrist_sine: float
    reuse: float  # rad of joint motion below which the smooth residual is not computed again


class Asked(NamedTuple):
    """A chunk of targets, in and out; one row each, loads may be single rows."""

    target: Array  # (n, 12), written where axes were given
    nominal: Array  # (n, 6) rad
    approach: Array  # (n, 6)
    route: IntArray  # (n,)
    mass: Array
    com: Array
    wrench: Array
    code: IntArray  # (n,) out: Status, or STRAGGLER
    found: Array  # (n, 6) rad, out
    told: Array  # (n, 12) out: the command
    before: Array  # (n, 3) m, out
    after: Array  # (n, 3) m, out
    singular: Array  # (n,) out


class Space(NamedTuple):
    """Working memory of one thread: rows of LANES numbers, flat."""

    lane: Array
    work: Array
    matrix: Array
    told: Array  # nominal chain
    real: Array  # actual chain
    trig: Array  # sine and cosine of theta, nominal
    bent: Array  # of theta, actual
    own: Array  # of q
    angle: Array
    spare: Array
    waves: Array
    open: Array  # 1 where the lane has not arrived
    feature: Array
    bump: Array


def space() -> Space:
    """Returns working memory for one thread."""
    rows = {
        "lane": LANE_ROWS, "work": WORK_ROWS, "matrix": MATRIX_ROWS, "told": CHAIN_ROWS,
        "real": CHAIN_ROWS, "trig": 12, "bent": 12, "own": 12, "angle": 6, "spare": 6,
        "waves": 18, "open": 1, "feature": 1, "bump": 2,
    }  # fmt: skip
    return Space(**{name: np.zeros(rows[name] * LANES) for name in Space._fields})
