"""Principal components of columns of different units (Jin et al. 2022, eq. 3-6).

Divisor N - 1, eigenvalues from large to small, as many components as carry 95 % of the variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ImplausibleDataError, ShapeError

SHARE: Final = 0.95
COLUMNS: Final = (
    "j1_deg", "j2_deg", "j3_deg", "j4_deg", "j5_deg", "j6_deg", "f_peak_N", "f_mean_N",
)  # fmt: skip


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
        """Returns the kept components (n, count) of columns (n, m): eq. 4 and 5."""
        return np.asarray(self.standardise(columns) @ self.loadings[:, : self.count])


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
