"""The best hyper-parameters of a log posterior with gradient, and what not knowing them costs.

With few rows several lengths and noises explain them equally well, and one choice of theta is
over-confident. Here theta has a normal distribution about its best value t, with the curvature of
the log posterior (Laplace), and each row is predicted from the others at t and one standard
deviation along each axis of that distribution:

    variance_i = v_i(t) + sum_j [((m_i(+j) - m_i(t))^2 + (m_i(-j) - m_i(t))^2) / 2
                                 + (v_i(+j) + v_i(-j)) / 2 - v_i(t)]
    inflation  = mean over rows and outputs of variance_i / v_i(t), at least 1

The one factor multiplies every predictive variance. Leaving a row out costs nothing: its residual
is alpha_i / P_ii and its variance 1 / P_ii.

Source: Rasmussen and Williams (2006), eq. 5.12; Kackar and Harville, JASA 79 (1984), for the term
of the mean.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize

from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ObservabilityError

LogPosterior: TypeAlias = Callable[[Array], tuple[float, Array]]
"""Value and gradient (p,) at theta (p,)."""
_STEPS, _FACTOR = 200, 10.0
_ENOUGH, _STEP, _WIDEST = 50, 1e-3, 2.0
"""Numbers per hyper-parameter that make the factor superfluous; step and largest sd of theta."""


def search_theta(
    log_posterior: LogPosterior,
    start: Array,
    bounds: Array,
    held: Array | None = None,
    *,
    restarts: int = 0,
    random: np.random.RandomState | None = None,
    steps: int = _STEPS,
) -> Array:
    """Returns theta (p,) of largest posterior within bounds (p, 2), found by L-BFGS-B.

    Entries of ``held`` (p,) that are not NaN stay as they are. The first search begins at
    ``start``, each restart at a random place within a factor of ten of it.
    """
    free = np.ones(len(start), dtype=bool) if held is None else np.isnan(held)
    theta = np.where(free, start, start if held is None else held)
    draws = np.random.RandomState(0) if random is None else random
    if not free.any():
        return theta

    worst = 0.0

    def downhill(part: Array) -> tuple[float, Array]:
        nonlocal worst
        trial = theta.copy()
        trial[free] = part
        try:
            value, gradient = log_posterior(trial)
        except ObservabilityError:
            return 2.0 * worst + 1.0, np.zeros(len(part))  # a step too far, but no cliff
        worst = max(worst, abs(value))
        return -value, -gradient[free]

    chosen, lowest = theta[free], np.inf
    for k in range(restarts + 1):
        begin = start[free]
        if k:
            begin = begin + np.log(_FACTOR) * draws.uniform(-1.0, 1.0, len(begin))
        found = minimize(
            downhill,
            np.clip(begin, *bounds[free].T),
            jac=True,
            method="L-BFGS-B",
            bounds=[(low, high) for low, high in bounds[free]],
            options={"maxiter": steps},
        )
        if found.fun < lowest:
            chosen, lowest = found.x, found.fun
    theta[free] = chosen
    return theta


def deviation_axes(
    slope: Callable[[Array], Array], theta: Array, unit: Array, *, step: float, least: float
) -> Array:
    """Returns A (p, p), A A' the covariance of theta by the curvature at its best value (Laplace).

    Args:
        slope: Gradient of the log posterior.
        theta: (p,) its best value.
        unit: (p,) in which the curvature is bounded.
        step: Of the differences.
        least: Least curvature used, in that unit; a saddle has less.
    """
    steps = step * np.eye(len(theta))
    curvature = np.array([slope(theta - axis) - slope(theta + axis) for axis in steps])
    whitened = unit[:, None] * (curvature + curvature.T) / (4.0 * step) * unit
    values, vectors = np.linalg.eigh(whitened)
    return np.asarray(unit[:, None] * vectors / np.sqrt(np.maximum(values, least)))


def inflation_factor(
    log_posterior: LogPosterior,
    left_out: Callable[[Array], tuple[Array, Array]],
    theta: Array,
    bounds: Array,
    free: BoolArray,
) -> float:
    """Returns the factor on predictive variances for the ``free`` (p,) entries of theta.

    1 without free entries, and from fifty numbers per free entry on, where it was measured to be
    below 1.02.

    Args:
        log_posterior: Of theta (p,), with gradient.
        left_out: Residual (n, k) and variance (n,) of rows predicted from all others at theta.
        theta: (p,) its best value.
        bounds: (p, 2) limits of the search.
        free: (p,) what was learned.
    """
    count = int(free.sum())
    residual, variance = left_out(theta)
    if not count or residual.size >= _ENOUGH * count:
        return 1.0

    def slope(part: Array) -> Array:
        there = theta.copy()
        there[free] = part
        return log_posterior(there)[1][free]

    axes = deviation_axes(slope, theta[free], np.ones(count), step=_STEP, least=_WIDEST**-2)
    total = np.repeat(variance[:, None], residual.shape[1], axis=1)
    for part in axes.T:
        for sign in (-1.0, 1.0):
            there = theta.copy()
            there[free] = np.clip(theta[free] + sign * part, *bounds[free].T)
            moved, other = left_out(there)
            total += 0.5 * ((moved - residual) ** 2 + (other - variance)[:, None])
    return max(1.0, float(np.mean(total / variance[:, None])))
