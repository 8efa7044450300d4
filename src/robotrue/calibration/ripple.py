"""Joint ripple and backlash: errors of the drive angle that travel through the arm's own Jacobian.

    dq_i(q_i) = sum_N A_iN sin(N q_i) + B_iN cos(N q_i) + backlash_i * approach_i

Gears, bearings and encoders err periodically in the joint angle. What reaches the tool is the
drive error times dx/dq_i, so the coefficients are linear, and what was learned about a joint in one
part of the workspace holds in every other. N runs over whole cycles per revolution: on the range a
joint has moved through they make any curve up to their highest frequency. Each joint and band of N
has a variance of its own, learned from the data (:mod:`robotrue.calibration.evidence`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from robotrue.calibration.evidence import Group
from robotrue.core.arrays import Array

BANDS: Final = (1, 4, 8, 14, 20, 32, 45, 65, 97, 120, 137, 193, 251, 265)
"""First N of each band; narrow where drives err most, around the encoders' 128 and 256."""
LADDER: Final = (16, 64, 136, 264)
"""Highest N that is tried, one after the other, while the evidence grows."""
START: Final = 1e-5
START_FAST: Final = 3e-6
FAST: Final = 45
"""rad, sd of one coefficient from which learning starts, below and from ``FAST`` cycles."""
REST: Final = 1e-7
"""rad, sd to which a band falls back that the data do not ask for."""
LAW: Final = 5e-5
"""rad, sd of a coefficient at one cycle per revolution where rows are few: an eccentric encoder or
gear wheel errs by 10 arc seconds. At N cycles it is an N-th of that."""
HOLD: Final = 0.5
"""Of each band to that law, where rows are few: a factor of e in the scale is one sigma."""


def harmonics(count: int) -> Array:
    """Returns 1, 2, ..., ``count`` cycles per revolution."""
    return np.arange(1.0, count + 1.0)


def ripple_columns(drive: Array, joints: Array, cycles: Array) -> Array:
    """Returns d(row)/d(A, B), shape (n, m, 2 dof h), joint by joint, N by N, sine before cosine.

    Args:
        drive: (n, m, dof) derivative of the observed numbers by the drive angles.
        joints: (n, dof) rad, commanded.
        cycles: (h,) N.
    """
    phase = joints[:, :, None] * cycles
    waves = np.stack([np.sin(phase), np.cos(phase)], axis=-1)
    n, m, dof = drive.shape
    columns = drive[:, :, :, None] * waves.reshape(n, 1, dof, 2 * len(cycles))
    return np.asarray(columns.reshape(n, m, 2 * dof * len(cycles)), dtype=np.float64)


def ripple_groups(dof: int, count: int, start: int, *, few: bool = False) -> list[Group]:
    """Returns the groups of all joints and bands; their columns begin at ``start``.

    Args:
        dof: Number of joints.
        count: Highest harmonic.
        start: First column.
        few: The rows are too few to say the scale of each band: all are held to the law
            :data:`LAW` / N times one common factor.
    """
    cycles = harmonics(count)
    out = []
    for joint in range(dof):
        for low, high in pairwise(BANDS):
            chosen = np.flatnonzero((cycles >= low) & (cycles < high))
            if len(chosen):
                first = start + 2 * (joint * count + int(chosen[0]))
                group = Group(
                    name=f"ripple/{joint + 1}/{low}-{min(high - 1, count)}",
                    columns=np.arange(first, first + 2 * len(chosen)),
                    sd=START if low < FAST else START_FAST,
                    rest=REST,
                )
                if few:
                    size = LAW / low
                    falling = np.repeat(low / cycles[chosen], 2)
                    group = replace(group, sd=size, rest=size, shape=falling, hold=HOLD)
                out.append(group)
    return out


def ripple_shift(joints: Array, cycles: Array, sine: Array, cosine: Array) -> Array:
    """Returns the drive-side shift (n, dof) rad of coefficients (dof, h) rad."""
    phase = joints[:, :, None] * cycles
    shift: Array = (np.sin(phase) * sine + np.cos(phase) * cosine).sum(axis=2)
    return shift
