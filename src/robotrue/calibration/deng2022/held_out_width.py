"""How wide the stated uncertainty of a pose model is: learned on rows that a fit did not see.

The copies of the source in the sub-spaces repeat the same measurements, and H_j is fitted to the
target rows, so the variance of eq. 32 is too small. One factor on it makes the mean squared error
of held-out rows, in units of their stated variance, equal to one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.optimize import brentq

from robotrue.calibration.deng2022.committee import Committee
from robotrue.calibration.deng2022.domains import Labelled
from robotrue.core.arrays import Array
from robotrue.core.units import MM

FOLDS: Final = 20
"""Parts of the target rows, each held out once."""
_LIMITS: Final = (-7.0, 14.0)
"""Natural logarithms between which the factor is searched."""


def held_out_inflation(
    committee: Committee, rows: Labelled, carry: Callable[[Labelled], Array], white: float
) -> float:
    """Returns the factor on the predictive variance of a committee, from held-out target rows.

    Kernel and weights are those of all rows; the alignment of the source is fitted anew without the
    rows held out, and the processes predict them from all others in closed form. Neighbours in
    angle about joint 1 are held out apart, so each sub-space keeps its other rows.

    Args:
        committee: Of the target domain; the target rows are its last.
        rows: Target rows.
        carry: Returns the source errors (k n, 3) m in all sub-spaces, aligned to a part of them.
        white: m, sd per axis of what a single visit adds to the process.
    """
    count = len(rows.errors)
    first = len(committee.inputs) - count
    order = np.argsort(np.arctan2(rows.features[:, 1], rows.features[:, 0]), kind="stable")
    fold = np.empty(count, dtype=np.int64)
    fold[order] = np.arange(count) % min(FOLDS, count)
    parts = [np.flatnonzero(fold == k) for k in range(int(fold.max()) + 1)]
    labels = [
        np.concatenate([carry(rows.take(np.flatnonzero(fold != k))), rows.errors]) / MM
        for k in range(len(parts))
    ]
    rounds = len(committee.betas)
    each, variance = np.empty((rounds, count, 3)), np.empty((rounds, count))
    for k in range(rounds):
        precision = committee.precision(k)
        for test, values in zip(parts, labels, strict=True):
            at = first + test
            covariance = np.linalg.inv(precision[np.ix_(at, at)])
            each[k, test] = values[at] - covariance @ (precision[at] @ values)
            noise = committee.noise**2 / committee.weights[k, at]
            variance[k, test] = np.maximum(np.diagonal(covariance) - noise, 0.0)
    predicted, spread = committee.mix_rounds(each, variance)
    missed = rows.errors - predicted * MM
    return solve_inflation(missed, spread * MM**2 + white**2, rows.covariance)


def left_out_inflation(committee: Committee, rows: Labelled, white: float) -> float:
    """Returns the factor of a single process, from each row left out in closed form.

    Args:
        committee: Of one process.
        rows: It was fitted to.
        white: m, sd per axis of what a single visit adds to the process.
    """
    missed, variance = committee.learners[0].predict_left_out()
    process = np.maximum(variance - committee.noise**2, 0.0) * MM**2
    return solve_inflation(missed * MM, process + white**2, rows.covariance)


def solve_inflation(missed: Array, variance: Array, covariance: Array) -> float:
    """Returns f so that missed^2 / (f variance + instrument) is one in the mean over rows and axes.

    Args:
        missed: (n, 3) m.
        variance: (n,) m^2 of a prediction, per axis.
        covariance: (n, 3, 3) m^2 of the instrument.
    """
    squared = np.sum(missed**2, axis=1) / 3.0
    instrument = np.trace(covariance, axis1=1, axis2=2) / 3.0

    def excess(logarithm: float) -> float:
        return float(np.mean(squared / (np.exp(logarithm) * variance + instrument))) - 1.0

    low, high = _LIMITS
    if excess(low) <= 0.0:
        return float(np.exp(low))
    if excess(high) >= 0.0:
        return float(np.exp(high))
    return float(np.exp(brentq(excess, low, high)))
