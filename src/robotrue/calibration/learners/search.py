"""The best hyper-parameters of a log posterior with gradient, some of them held."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize

from robotrue.core.arrays import Array
from robotrue.errors import ObservabilityError

LogPosterior: TypeAlias = Callable[[Array], tuple[float, Array]]
"""Value and gradient (p,) at theta (p,)."""
_STEPS, _FACTOR = 200, 10.0


def best(
    log_posterior: LogPosterior,
    start: Array,
    bounds: Array,
    held: Array,
    restarts: int,
    random: np.random.RandomState,
) -> Array:
    """Returns theta (p,) of largest posterior within bounds (p, 2), found by L-BFGS-B.

    Entries of ``held`` (p,) that are not NaN stay as they are. The first search begins at
    ``start``, each restart at a random place within a factor of ten of it.
    """
    free = np.isnan(held)
    theta = np.where(free, start, held)
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
            begin = begin + np.log(_FACTOR) * random.uniform(-1.0, 1.0, len(begin))
        found = minimize(
            downhill,
            np.clip(begin, *bounds[free].T),
            jac=True,
            method="L-BFGS-B",
            bounds=[(low, high) for low, high in bounds[free]],
            options={"maxiter": _STEPS},
        )
        if found.fun < lowest:
            chosen, lowest = found.x, found.fun
    theta[free] = chosen
    return theta
