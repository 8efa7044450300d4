"""Robust rules: weights of rows by their residual, and selection of readings that agree.

The weight rule, on the length r of a row's whitened residual of m numbers (chi with m degrees):

- r up to the 99 % point: full weight;
- beyond it: weight c / r (Huber), so its pull stays constant;
- beyond the 99.9999 % point (5.5 for a point in space): weight zero, the row is reported.

``"gaussian"`` gives every row full weight.

Agreeing readings are found by graduated non-convexity with truncated least squares: Yang,
Antonante, Tzoumas, Carlone 2020, "Graduated non-convexity for robust spatial perception", eq. 14-16
(the surrogate, its start and its weights). Deterministic: the first pass is an ordinary fit, every
further one follows from it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.special import fdtri, gammaincinv

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError

Loss: TypeAlias = Literal["huber", "gaussian"]
LOSSES: Final = ("huber", "gaussian")
BEND: Final = 0.99
CUT: Final = 0.999999
LEVEL: Final = 0.95


def weights(length: Array, size: int, loss: Loss) -> Array:
    """Returns the weight (n,) of rows with whitened residual length ``length`` (n,)."""
    if loss == "gaussian":
        return np.ones_like(length)
    bend, cut = chi_point(BEND, size), chi_point(CUT, size)
    safe = np.maximum(length, 1e-300)
    return np.where(length <= bend, 1.0, np.where(length <= cut, bend / safe, 0.0))


@cache
def chi_point(probability: float, size: int) -> float:
    """Returns the length that a Gaussian of ``size`` whitened numbers stays below."""
    return float(np.sqrt(2.0 * gammaincinv(size / 2.0, probability)))


def student_factor(freedom: float) -> float:
    """Returns the factor on a covariance of three numbers whose scale rests on ``freedom`` numbers.

    The 95 % region of Student's law over that of the Gaussian: 3 F(3, freedom) / chi^2(3), one for
    many numbers (Gelman and others 2013, "Bayesian Data Analysis", section 3.2).
    """
    return float(3.0 * fdtri(3.0, freedom, LEVEL) / chi_point(LEVEL, 3) ** 2)


def robust_variance(length: Array, size: int) -> float:
    """Returns the variance per number from the median row, unmoved by half the rows."""
    return float((np.median(length) / chi_point(0.5, size)) ** 2)


@cache
def consistency(size: int, loss: Loss) -> float:
    """Returns E[w r^2] / m under the Gaussian: what the rule takes from a clean variance."""
    if loss == "gaussian":
        return 1.0
    r = np.linspace(0.0, chi_point(CUT, size), 4001)
    density = r ** (size - 1) * np.exp(-(r**2) / 2.0)
    step = r[1] - r[0]
    mass = float(density.sum() * step)
    return float((weights(r, size, loss) * r**2 * density).sum() * step / mass / size)


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
