"""Learners of the regression of Jin et al. 2022: principal components and support vectors.

Components of columns of different units (eq. 3-6): divisor N - 1, eigenvalues from large to small,
as many components as carry 95 % of the variance. The radial support vector regression is searched
and solved by scikit-learn and kept as numbers: what is fitted and what is read from a file are
evaluated by the same few lines of NumPy.
"""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass
from typing import Annotated, Final, Protocol, Self

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ImplausibleDataError, ShapeError

SHARE: Final = 0.95
COLUMNS: Final = (
    "j1_deg", "j2_deg", "j3_deg", "j4_deg", "j5_deg", "j6_deg", "f_peak_N", "f_mean_N",
)  # fmt: skip
PENALTY: Final = (1.0, 10.0, 100.0)
GAMMA: Final = (0.03, 0.1, 0.3)
TUBE: Final = (0.05, 0.2)
"""Searched, with the values in their own standard deviations."""
FOLDS: Final = 5
LONGEST: Final = 200_000
"""Steps of the solver; a combination that has not converged by then is scored as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Components(Columns):
    """Standardisation and principal components of m columns.

    Attributes:
        mean: (m,) of each column.
        deviation: (m,) its standard deviation, divisor N - 1.
        eigenvalues: (m,) of the correlation matrix, falling.
        loadings: (m, m), components by columns; the entry of largest size is positive.
        count: Components kept.
    """

    mean: Annotated[Array, Column("m")]
    deviation: Annotated[Array, Column("m")]
    eigenvalues: Annotated[Array, Column("m")]
    loadings: Annotated[Array, Column("m m")]
    count: int

    @property
    def share(self) -> Array:
        """(m,) part of the variance that each component carries (eq. 6)."""
        return np.asarray(self.eigenvalues / self.eigenvalues.sum())

    def standardise(self, columns: Array) -> Array:
        """Returns columns (n, m) in standard deviations from their means: eq. 4."""
        return np.asarray((np.asarray(columns) - self.mean) / self.deviation)

    def scores(self, columns: Array) -> Array:
        """Returns the retained components (n, count) of columns (n, m): eq. 4 and 5."""
        return np.asarray(self.standardise(columns) @ self.loadings[:, : self.count])


def components_of(columns: Array) -> Components:
    """Returns the principal components of columns (n, m).

    Raises:
        ShapeError: Fewer than two rows.
        ImplausibleDataError: A column that does not vary has no standard deviation to divide by.
    """
    values = np.asarray(columns, dtype=np.float64)
    if values.ndim != 2 or len(values) < 2:
        raise ShapeError(f"columns have shape {values.shape}, expected two rows or more.")
    mean, deviation = values.mean(axis=0), values.std(axis=0, ddof=1)
    flat = np.flatnonzero(deviation <= 1e-12 * np.maximum(np.abs(mean), 1e-300))
    if flat.size:
        k = int(flat[0])
        name = COLUMNS[k] if values.shape[1] == len(COLUMNS) else f"column {k + 1}"
        raise ImplausibleDataError(
            f"{name} does not vary over {len(values)} windows; it cannot be standardised.",
            hint="leave the column out, or check its sensor.",
        )
    standard = (values - mean) / deviation
    value, vector = np.linalg.eigh(standard.T @ standard / (len(values) - 1))
    value, vector = value[::-1], vector[:, ::-1]
    largest = np.abs(vector).argmax(axis=0)
    vector = vector * np.sign(vector[largest, np.arange(len(value))])
    return Components(
        mean=mean,
        deviation=deviation,
        eigenvalues=np.maximum(value, 0.0),
        loadings=vector,
        count=count_components(value),
    )


def count_components(eigenvalues: Array) -> int:
    """Returns the number of largest eigenvalues that carry 95 % of their sum."""
    carried = np.cumsum(eigenvalues) / np.sum(eigenvalues)
    return int(np.searchsorted(carried, SHARE - 1e-12) + 1)


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
        warnings.simplefilter("ignore", ConvergenceWarning)  # its held-out error decides instead
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
