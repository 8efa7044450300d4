"""The paper's regression: support vectors on principal components of joints and force.

Source: Jin, Sun, Tang, Li 2022, section 2; components by eq. 3-6: divisor N - 1, eigenvalues from
large to small, as many components as carry 95 % of the variance. Eight columns of one pass are two
numbers for the place on its line, peak and mean force: four components carry all of it. Over
several passes the rule drops directions of the pose. Kernel, C, gamma and epsilon are not printed:
a radial kernel with the three chosen by cross-validation inside the training windows.
Kept as the baseline; :mod:`robotrue.dynamics.deviation` is what robotrue uses.
"""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass
from typing import Annotated, Final, Protocol, Self

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.dynamics.windows import FEWEST, WindowSet
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError

SHARE: Final = 0.95
COLUMNS: Final = (
    "j1_deg", "j2_deg", "j3_deg", "j4_deg", "j5_deg", "j6_deg", "f_peak_N", "f_mean_N",
)  # fmt: skip
PENALTY: Final = (1.0, 10.0, 100.0)
GAMMA: Final = (0.03, 0.1, 0.3)
TUBE: Final = (0.05, 0.2)
"""Searched, with the deviation in its own standard deviations."""
FOLDS: Final = 5
LONGEST: Final = 200_000
"""Steps of the solver; a combination that has not converged by then is judged as it stands."""


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

    def scores(self, columns: Array) -> Array:
        """Returns the kept components (n, count) of columns (n, m): eq. 4 and 5."""
        standard = (np.asarray(columns) - self.mean) / self.deviation
        return np.asarray(standard @ self.loadings[:, : self.count])


def paper_columns(windows: WindowSet) -> Array:
    """Returns the paper's columns (n, dof + 2): joints in rad, peak and mean force in N.

    Standardisation takes the units out: degrees or radians make no difference.
    """
    return np.column_stack([windows.joints, windows.force_peak, windows.force_mean])


def components_of(columns: Array, *, share: float = SHARE) -> Components:
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
        count=count_components(value, share),
    )


def count_components(eigenvalues: Array, share: float = SHARE) -> int:
    """Returns how many of the eigenvalues, from the largest, carry a share of their sum."""
    carried = np.cumsum(eigenvalues) / np.sum(eigenvalues)
    return int(np.searchsorted(carried, share - 1e-12) + 1)


class _Regression(Protocol):
    """A regression of scikit-learn, which has no types."""

    def fit(self, scores: Array, values: Array, /) -> Self: ...

    def predict(self, scores: Array, /) -> Array: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperModel:
    """Deviation by support vectors on components.

    Attributes:
        components: Of the training windows.
        regression: The fitted support vector regression (scikit-learn).
        centre: m, mean deviation in training.
        scale: m, its standard deviation.
        chosen: C, gamma, epsilon.
    """

    components: Components
    regression: _Regression
    centre: float
    scale: float
    chosen: tuple[float, float, float]

    def predict(self, windows: WindowSet) -> Array:
        """Returns the error (n,) m of windows: predicted plus learned deviation (eq. 2)."""
        scores = self.components.scores(paper_columns(windows))
        return np.asarray(
            windows.predicted + self.centre + self.scale * self.regression.predict(scores)
        )


def fit_paper(windows: WindowSet, *, share: float = SHARE) -> PaperModel:
    """Returns the paper's regression of the deviation on joints, peak and mean force.

    Args:
        windows: Measured.
        share: Of the variance that the kept components carry.

    Raises:
        ObservabilityError: Too few windows.
        ImplausibleDataError: A column that does not vary.

    Fails when: it is asked for poses it has not seen; it then returns its mean and says nothing.
    """
    if len(windows) < FEWEST:
        raise ObservabilityError(f"{len(windows)} windows, {FEWEST} are the least.")
    components = components_of(paper_columns(windows), share=share)
    scores = components.scores(paper_columns(windows))
    centre = float(windows.deviation.mean())
    scale = float(windows.deviation.std()) or 1.0
    values = (windows.deviation - centre) / scale
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # judged by its held-out error instead
        chosen = _choose_settings(scores, values)
        regression = _machine(*chosen).fit(scores, values)
    return PaperModel(
        components=components,
        regression=regression,
        centre=centre,
        scale=scale,
        chosen=chosen,
    )


def _choose_settings(scores: Array, values: Array) -> tuple[float, float, float]:
    """C, gamma, epsilon of least squared error over shuffled folds inside the training windows."""
    from sklearn.model_selection import PredefinedSplit, cross_val_predict

    folds = PredefinedSplit(np.random.default_rng(0).permutation(len(values)) % FOLDS)

    def miss(trial: tuple[float, float, float]) -> float:
        guess = cross_val_predict(_machine(*trial), scores, values, cv=folds)
        return float(((guess - values) ** 2).sum())

    return min(itertools.product(PENALTY, GAMMA, TUBE), key=miss)


def _machine(penalty: float, gamma: float, tube: float) -> _Regression:
    from sklearn.svm import SVR

    machine: _Regression = SVR(kernel="rbf", C=penalty, gamma=gamma, epsilon=tube, max_iter=LONGEST)
    return machine
