"""Evidence of Gaussian rows with a given covariance and a linear trend.

    y = H b + f,   f ~ N(0, K)
    "constant":  b integrated out with a flat prior
                 log p = -1/2 (y'Py + log|K| + log|H'K^-1 H| + (n - q) log 2 pi)
    "estimated": b at its generalised least squares value, log p = log N(y; Hb, K)
    P = K^-1 - K^-1 H (H'K^-1 H)^-1 H'K^-1

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), eq. 2.30, 2.45, 5.9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ObservabilityError


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """Rows solved against their covariance.

    Attributes:
        lower: (n, n) Cholesky factor L of K.
        alpha: (n, k) P y.
        trend: (q, k) generalised least squares value of b.
        trend_rows: (n, q) K^-1 H.
        trend_lower: (q, q) Cholesky factor of H'K^-1 H.
        log_evidence: Summed over the k outputs.
        integrated: Whether b was integrated out.
    """

    lower: Array
    alpha: Array
    trend: Array
    trend_rows: Array
    trend_lower: Array
    log_evidence: float
    integrated: bool

    def sensitivity(self) -> Array:
        """Returns W (n, n): the derivative of the evidence by K is W / 2."""
        outputs = self.alpha.shape[1]
        inverse, _ = lapack.dpotri(self.lower, lower=1)
        diagonal = inverse.diagonal().copy()
        inverse = inverse + inverse.T  # above its diagonal dpotri leaves the zeros of L
        np.fill_diagonal(inverse, diagonal)
        if self.integrated and self.trend_rows.shape[1]:
            spread = np.linalg.solve(self.trend_lower, self.trend_rows.T)
            inverse -= spread.T @ spread
        return np.asarray(self.alpha @ self.alpha.T - outputs * inverse)

    def left_out(self, chosen: BoolArray | None = None) -> tuple[Array, Array]:
        """Returns residual (m, k) and variance (m,) of chosen rows, each from all others."""
        square = np.einsum("ij,ij->i", self.alpha, self.alpha)
        precision = (square - self.sensitivity().diagonal()) / self.alpha.shape[1]
        which = slice(None) if chosen is None else chosen
        variance = 1.0 / precision[which]
        return self.alpha[which] * variance[:, None], variance

    def whitened(self, rows: Array) -> Array:
        """Returns L^-1 rows, (n, any)."""
        return np.asarray(lapack.dtrtrs(self.lower, rows, lower=1)[0])


def solve(covariance: Array, values: Array, trend: Array, *, integrated: bool = True) -> Solved:
    """Returns values (n, k) solved against covariance (n, n) with trend columns (n, q).

    Raises:
        ObservabilityError: The covariance is not positive definite.

    Fails when: rows coincide and carry no noise.
    """
    rows, outputs = values.shape
    lower, fault = lapack.dpotrf(covariance.T, lower=1, clean=1)
    if fault:
        raise ObservabilityError(
            f"the covariance of {rows} rows is not positive definite at row {fault}: "
            "rows too alike for the noise they carry.",
            hint="a larger noise or noise_variance, or one row for each place.",
        )
    solved, _ = lapack.dpotrs(lower, np.concatenate([values, trend], axis=1), lower=1)
    alpha: Array = solved[:, :outputs]
    trend_rows = solved[:, outputs:]
    columns = trend.shape[1]
    coefficients: Array = np.zeros((columns, outputs))
    trend_lower: Array = np.zeros((columns, columns))
    log_det = 2.0 * float(np.log(lower.diagonal()).sum())
    free = rows
    if columns:
        trend_lower = lapack.dpotrf(trend.T @ trend_rows, lower=1, clean=1)[0]
        half = np.linalg.solve(trend_lower, trend.T @ alpha)
        coefficients = np.linalg.solve(trend_lower.T, half)
        alpha = np.asarray(alpha - trend_rows @ coefficients)
        if integrated:
            log_det += 2.0 * float(np.log(trend_lower.diagonal()).sum())
            free -= columns
    fitted = float(np.sum(alpha * values))
    return Solved(
        lower=lower,
        alpha=alpha,
        trend=coefficients,
        trend_rows=trend_rows,
        trend_lower=trend_lower,
        log_evidence=-0.5 * (fitted + outputs * (log_det + free * float(np.log(2.0 * np.pi)))),
        integrated=integrated,
    )
