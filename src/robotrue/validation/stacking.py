"""Weights of candidates by what they said of held-out poses before these were seen.

The weights a maximise sum_i log sum_k a_k p_ik, p_ik the density that candidate k gave row i (Yao,
Vehtari, Simpson and Gelman 2018): a candidate that is right where the others are wrong keeps a
share, one that adds nothing loses it. A prior of :data:`PRIOR_ROWS` rows spread evenly leaves every
candidate the share that so few rows cannot deny it. Densities are those of Student's law with
:data:`FREEDOM` degrees, so no single row decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.special import gammaln

from robotrue.core.arrays import Array
from robotrue.validation.metrics import squared_distance

PRIOR_ROWS: Final = 1.0
FREEDOM: Final = 8.0
STEPS: Final = 300
"""Of expectation and maximisation; each raises the score."""


def student_scores(residuals: Array, covariances: Array) -> Array:
    """Returns the log density (n,) of residuals (n, 3) m under Student's law, in log(1/m^3).

    Args:
        residuals: Measured minus predicted.
        covariances: (n, 3, 3) m^2, scale of the law.

    Raises:
        ShapeError: A covariance that is not positive definite.
    """
    distance = squared_distance(residuals, covariances)
    size = np.linalg.slogdet(covariances)[1]
    constant = gammaln((FREEDOM + 3.0) / 2.0) - gammaln(FREEDOM / 2.0)
    constant -= 1.5 * np.log(np.pi * FREEDOM)
    tail = -0.5 * (FREEDOM + 3.0) * np.log1p(distance / FREEDOM)
    return np.asarray(constant - 0.5 * size + tail)


def stack_weights(scores: Sequence[Array]) -> Array:
    """Returns the weight (k,) of each candidate, their sum one.

    Args:
        scores: (n,) log densities of the same held-out rows, one array for each candidate.
    """
    logs = np.stack(scores, axis=1)
    density = np.exp(logs - logs.max(axis=1, keepdims=True))
    rows, count = density.shape
    weights = np.full(count, 1.0 / count)
    for _ in range(STEPS):
        share = density * weights
        share /= share.sum(axis=1, keepdims=True)
        weights = (share.sum(axis=0) + PRIOR_ROWS / count) / (rows + PRIOR_ROWS)
    return weights
