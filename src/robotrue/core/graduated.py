"""Selection of consistent readings: graduated non-convexity with truncated least squares.

Yang, Antonante, Tzoumas, Carlone 2020, "Graduated non-convexity for robust spatial perception",
eq. 14-16 (the truncated least squares surrogate, its start and its weights). Deterministic: the
first pass is an ordinary fit, every further one follows from it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError

FASTER: Final = 1.4
"""Factor of the control parameter from pass to pass."""
PASSES: Final = 200
GAUSS_POINT: Final = 3.4
"""Length of a 3-D residual over one sigma per axis that 99.1 % of good points stay below."""
GAUSS_NORMAL: Final = 2.6
"""The same share for a residual along one direction."""


def agreeing(residual: Callable[[Array], Array], n: int, bound: float) -> BoolArray:
    """Returns which of n touches (n,) agree: the larger of two sets found in different ways.

    Graduated non-convexity, and dropping the worst touch until all fit; then every touch that lies
    within the bound of a set's own fit belongs to it. Few touches with many wrong ones make either
    way fail now and then, seldom both.

    Args:
        residual: From weights (n,) to residual lengths (n,) m after the weighted fit.
        n: How many.
        bound: m; longer residuals count as wrong.

    Raises:
        ConvergenceError: See ``weigh_touches``.
    """
    first = _grow_set(residual, weigh_touches(residual, n, bound) > 0.5, bound)
    if first.all():
        return first
    second = _grow_set(residual, _drop_worst(residual, n, bound), bound)
    return second if int(second.sum()) > int(first.sum()) else first


def _drop_worst(residual: Callable[[Array], Array], n: int, bound: float) -> BoolArray:
    keep = np.ones(n, dtype=bool)
    while 2 * int(keep.sum()) > n:
        length = np.where(keep, residual(keep.astype(float)), 0.0)
        worst = int(np.argmax(length))
        if length[worst] <= bound:
            break
        keep[worst] = False
    return keep


def _grow_set(residual: Callable[[Array], Array], keep: BoolArray, bound: float) -> BoolArray:
    """Returns the set that its own fit confirms; the one given if it never comes to rest."""
    now = keep
    for _ in range(10):
        if 2 * int(now.sum()) <= len(now):
            return keep
        new: BoolArray = residual(now.astype(float)) <= bound
        if (new == now).all():
            return now
        now = new
    return keep


def weigh_touches(residual: Callable[[Array], Array], n: int, bound: float) -> Array:
    """Returns weights (n,), each 0 or 1, of truncated least squares.

    Args:
        residual: From weights (n,) to residual lengths (n,) m after the weighted fit.
        n: How many.
        bound: m; longer residuals count as wrong.

    Raises:
        ConvergenceError: Weights between 0 and 1 after many passes.
    """
    weights = np.ones(n)
    squared = residual(weights) ** 2
    limit = bound**2
    largest = float(squared.max())
    if largest <= limit:
        return weights
    mu = limit / (2.0 * largest - limit)
    for _ in range(PASSES):
        low, high = mu / (mu + 1.0) * limit, (mu + 1.0) / mu * limit
        safe = np.maximum(squared, np.finfo(float).tiny)
        weights = np.clip(np.sqrt(limit * mu * (mu + 1.0) / safe) - mu, 0.0, 1.0)
        weights = np.where(squared <= low, 1.0, np.where(squared >= high, 0.0, weights))
        if not ((weights > 0.0) & (weights < 1.0)).any():
            return weights
        squared = residual(weights) ** 2
        mu *= FASTER
    raise ConvergenceError(
        f"{int(((weights > 0) & (weights < 1)).sum())} of {n} touches are neither accepted nor "
        f"rejected after {PASSES} passes at a bound of {bound / MM:.3g} mm.",
        hint="state the noise again; the bound excludes good touches.",
    )
