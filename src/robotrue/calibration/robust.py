"""Robust weights: the distance at which a row counts less, and at which it does not count.

The rule, on the length r of a row's whitened residual of m numbers (chi with m degrees):

- r up to the 99 % point: full weight;
- beyond it: weight c / r (Huber), so its pull stays constant;
- beyond the 99.9999 % point (5.5 for a point in space): weight zero, the row is reported.

``"gaussian"`` gives every row full weight.
"""

from __future__ import annotations

from functools import cache
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.special import fdtri, gammaincinv

from robotrue.core.arrays import Array

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
