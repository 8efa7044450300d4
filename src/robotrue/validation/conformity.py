"""Conformity of a predicted error with a tolerance, the uncertainty counted against it.

Three answers::

    conforms   |e| + U <= T        fails   |e| - U > T        undecided   between

U is the radius that holds 95 % about the prediction, so the true error of a conforming target is
within T with at least 95 %. This is the guard band of ISO 14253-1 taken as a decision rule; each
target is checked by itself.

A target that states axes has no Cartesian position and no tolerance. It is counted separately and
not checked, unless the strict rule is requested, by which an unchecked target is not proven.
Without a checked target nothing is proven.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import ConfigurationError, ObservabilityError


class Conformity(IntEnum):
    """Verdict on a target."""

    CONFORMS = 0
    UNDECIDED = 1
    FAILS = 2
    UNKNOWN = 3  # nothing was predicted


def conformity(length: Array, bound: Array, tolerance: float) -> IntArray:
    """Returns the :class:`Conformity` of each target, (n,).

    Args:
        length: (n,) m, predicted error; NaN where nothing was predicted.
        bound: (n,) m, radius that holds 95 % about it; NaN likewise.
        tolerance: m, largest distance from where the target should be.

    Raises:
        ConfigurationError: A tolerance that is not above zero.
    """
    if not 0.0 < tolerance < np.inf:
        raise ConfigurationError(
            f"tolerance {tolerance / 1e-3:g} mm, expected above 0.", hint="--tolerance-mm 0.2"
        )
    out = np.full(len(length), int(Conformity.UNDECIDED), dtype=np.int64)
    out[length + bound <= tolerance] = Conformity.CONFORMS
    out[length - bound > tolerance] = Conformity.FAILS
    out[~np.isfinite(length + bound)] = Conformity.UNKNOWN
    return out


def to_judge(axis_target: BoolArray, *, strict: bool) -> BoolArray:
    """Returns which targets (n,) have a tolerance: those with a Cartesian position; strictly, all.

    Args:
        axis_target: (n,) targets that state axes.
        strict: Whether those count, too, as unproven targets.

    Raises:
        ObservabilityError: Every target states axes; there is no target to check.
    """
    if axis_target.all():
        raise ObservabilityError(
            f"all of {len(axis_target)} targets state axes: none names a place that a tolerance "
            "could be held to.",
            hint="check a program with linear or circular moves.",
        )
    return np.ones_like(axis_target) if strict else ~axis_target


def all_conform(states: IntArray) -> bool:
    """Returns true if there are checked targets, and every one of them conforms."""
    return bool(len(states) and (states == Conformity.CONFORMS).all())
