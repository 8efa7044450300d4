"""How much wider intervals are because hyper-parameters are not known.

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

import numpy as np

from robotrue.calibration.learners.search import LogPosterior
from robotrue.core.arrays import Array, BoolArray

_ENOUGH, _STEP, _WIDEST = 50, 1e-3, 2.0
"""Numbers per hyper-parameter that make the factor superfluous; step and largest sd of theta."""


def inflation(
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
    axes = np.eye(len(theta))[free]
    down = np.array([log_posterior(theta - _STEP * axis)[1][free] for axis in axes])
    up = np.array([log_posterior(theta + _STEP * axis)[1][free] for axis in axes])
    curvature = (down - up) / (2.0 * _STEP)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    deviation = 1.0 / np.sqrt(np.maximum(values, _WIDEST**-2))
    total = np.repeat(variance[:, None], residual.shape[1], axis=1)
    for part in (vectors * deviation).T:
        for sign in (-1.0, 1.0):
            there = theta.copy()
            there[free] = np.clip(theta[free] + sign * part, *bounds[free].T)
            moved, other = left_out(there)
            total += 0.5 * ((moved - residual) ** 2 + (other - variance)[:, None])
    return max(1.0, float(np.mean(total / variance[:, None])))
