"""Radial support vector regression: searched and solved by scikit-learn, kept as numbers.

What is fitted and what is read from a file are evaluated by the same few lines of NumPy.
"""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass
from typing import Annotated, Final, Protocol, Self

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns

PENALTY: Final = (1.0, 10.0, 100.0)
GAMMA: Final = (0.03, 0.1, 0.3)
TUBE: Final = (0.05, 0.2)
"""Searched, with the values in their own standard deviations."""
FOLDS: Final = 5
LONGEST: Final = 200_000
"""Steps of the solver; a combination that has not converged by then is judged as it stands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SupportVectors(Columns):
    """A radial support vector regression as numbers, in standard deviations of the deviation.

    Attributes:
        vectors: (s, k) scores of the windows that support it.
        weights: (s,) dual coefficients.
        intercept: Added to the sum over vectors.
        penalty: C.
        gamma: Of the kernel ``exp(-gamma |a - b|^2)``.
        tube: epsilon.
    """

    vectors: Annotated[Array, Column("s k")]
    weights: Annotated[Array, Column("s")]
    intercept: float
    penalty: float
    gamma: float
    tube: float

    def __len__(self) -> int:
        return len(self.weights)

    def values(self, scores: Array) -> Array:
        """Returns the regression (n,) at scores (n, k)."""
        return np.asarray(
            np.exp(-self.gamma * squared_distance(scores, self.vectors)) @ self.weights
            + self.intercept
        )


def fit_vectors(
    scores: Array, values: Array, trial: tuple[float, float, float] | None = None
) -> SupportVectors:
    """Returns the regression of values (n,) on scores (n, k).

    Args:
        scores: Learned from.
        values: In their standard deviations from their mean.
        trial: C, gamma, epsilon; without, they are searched for by cross-validation.
    """
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # judged by its held-out error instead
        chosen = choose_settings(scores, values) if trial is None else trial
        fitted = _machine(*chosen).fit(scores, values)
    penalty, gamma, tube = chosen
    return SupportVectors(
        vectors=fitted.support_vectors_,
        weights=fitted.dual_coef_[0],
        intercept=float(fitted.intercept_[0]),
        penalty=penalty,
        gamma=gamma,
        tube=tube,
    )


def squared_distance(one: Array, two: Array) -> Array:
    """Returns squared distances (n, m) of rows (n, k) and (m, k), each as a sum of squares."""
    return np.asarray(((one[:, None] - two) ** 2).sum(axis=2))


def choose_settings(scores: Array, values: Array) -> tuple[float, float, float]:
    """Returns C, gamma, epsilon of least squared error over shuffled folds of scores (n, k)."""
    from sklearn.model_selection import PredefinedSplit, cross_val_predict

    split = PredefinedSplit(np.random.default_rng(0).permutation(len(values)) % FOLDS)

    def miss(trial: tuple[float, float, float]) -> float:
        guess = cross_val_predict(_machine(*trial), scores, values, cv=split)
        return float(((guess - values) ** 2).sum())

    return min(itertools.product(PENALTY, GAMMA, TUBE), key=miss)


class _Regression(Protocol):
    """A regression of scikit-learn, which has no types."""

    support_vectors_: Array
    dual_coef_: Array
    intercept_: Array

    def fit(self, scores: Array, values: Array, /) -> Self: ...


def _machine(penalty: float, gamma: float, tube: float) -> _Regression:
    from sklearn.svm import SVR

    machine: _Regression = SVR(kernel="rbf", C=penalty, gamma=gamma, epsilon=tube, max_iter=LONGEST)
    return machine
