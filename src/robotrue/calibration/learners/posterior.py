"""Gaussian rows with a given covariance and a linear trend: evidence, rows left out, prediction.

    y = H b + f,   f ~ N(0, K)
    "constant":  b integrated out with a flat prior
                 log p = -1/2 (y'Py + log|K| + log|H'K^-1 H| + (n - q) log 2 pi)
    "estimated": b at its generalised least squares value, log p = log N(y; Hb, K)
    P = K^-1 - K^-1 H (H'K^-1 H)^-1 H'K^-1

Prediction of a squared exponential process at many places, with z = (x - centre) / length and
E = exp(-|z - z_i|^2 / 2) over the training rows:

    mean = offset + a^2 E alpha
    variance = a^2 - |a^2 E L^-T|^2 + (1 - a^2 E K^-1 1)^2 / (1'K^-1 1)

(with "reach" for the first a^2 of each row where rows of two kinds are learned from).
E comes from one product of [z, 1, -|z|^2/2] with [z_i, -|z_i|^2/2, 1] and one exponential, in
blocks of rows that stay in cache; L^-T is upper triangular and multiplied by blocks of columns.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), eq. 2.30, 2.45, 5.9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ObservabilityError

_ROWS, _COLUMNS = 512, 64


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

    def predict_left_out(self, chosen: BoolArray | None = None) -> tuple[Array, Array]:
        """Returns residual (m, k) and variance (m,) of chosen rows, each from all others."""
        square = np.einsum("ij,ij->i", self.alpha, self.alpha)
        precision = (square - self.sensitivity().diagonal()) / self.alpha.shape[1]
        which = slice(None) if chosen is None else chosen
        variance = 1.0 / precision[which]
        return self.alpha[which] * variance[:, None], variance

    def whiten_rows(self, rows: Array) -> Array:
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
            "rows too similar for their noise.",
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


def correlation(z: Array, other: Array) -> Array:
    """Returns exp(-|z - other|^2 / 2), (m, n), of inputs (m, d) and (n, d) over their lengths."""
    exponents = _left_factor(z) @ _right_factor(other)
    np.minimum(exponents, 0.0, out=exponents)  # coinciding rows must not exceed one by rounding
    return np.asarray(np.exp(exponents, out=exponents))


def _left_factor(z: Array) -> Array:
    half = -0.5 * np.einsum("ij,ij->i", z, z)
    return np.column_stack([z, np.ones(len(z)), half])


def _right_factor(z: Array) -> Array:
    half = -0.5 * np.einsum("ij,ij->i", z, z)
    return np.column_stack([z, half, np.ones(len(z))]).T


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessPosterior:
    """State of a fitted process, ready for prediction.

    Attributes:
        centre: (d,) of the inputs.
        length: (d,) in the unit of the inputs.
        places: (d + 2, n) training rows as the right factor of the exponents.
        weights: (n, k) a^2 alpha.
        offset: (k,) mean far from all rows.
        root: (n, n) a^2 L^-T, upper triangular.
        trend: (n, q) a^2 K^-1 H S^-T with S S' = H'K^-1 H; no columns unless integrated out.
        trend_ahead: (q,) S^-1 h, h the trend columns at the places predicted.
        amplitude: a.
    """

    centre: Array
    length: Array
    places: Array
    weights: Array
    offset: Array
    root: Array
    trend: Array
    trend_ahead: Array
    amplitude: float

    def mean(self, inputs: Array) -> Array:
        """Returns the mean (m, k) at inputs (m, d)."""
        out = np.empty((len(inputs), self.weights.shape[1]))
        for start in range(0, len(inputs), _ROWS):
            rows = slice(start, start + _ROWS)
            np.matmul(self._correlations(inputs[rows]), self.weights, out=out[rows])
        out += self.offset
        return out

    def mean_and_variance(self, inputs: Array) -> tuple[Array, Array]:
        """Returns mean (m, k) and variance (m,) of the function at inputs (m, d)."""
        mean = np.empty((len(inputs), self.weights.shape[1]))
        variance = np.full(len(inputs), self.amplitude**2)
        columns = range(0, len(self.root), _COLUMNS)
        blocks = [
            (stop, np.ascontiguousarray(self.root[:stop, start:stop]))
            for start in columns
            for stop in [min(start + _COLUMNS, len(self.root))]
        ]
        for start in range(0, len(inputs), _ROWS):
            rows = slice(start, start + _ROWS)
            near = self._correlations(inputs[rows])
            np.matmul(near, self.weights, out=mean[rows])
            for stop, block in blocks:
                known = near[:, :stop] @ block
                variance[rows] -= np.einsum("ij,ij->i", known, known)
            variance[rows] += ((self.trend_ahead - near @ self.trend) ** 2).sum(axis=1)
        mean += self.offset
        return mean, np.maximum(variance, 0.0, out=variance)

    def covariance(self, inputs: Array) -> Array:
        """Returns the covariance of the function between all inputs, (m, m)."""
        z = (inputs - self.centre) / self.length
        near = self._correlations(inputs)
        known = near @ self.root
        out = self.amplitude**2 * correlation(z, z) - known @ known.T
        left = self.trend_ahead - near @ self.trend
        out += left @ left.T
        return 0.5 * (out + out.T)

    def _correlations(self, inputs: Array) -> Array:
        exponents = _left_factor((inputs - self.centre) / self.length) @ self.places
        return np.asarray(np.exp(exponents, out=exponents))


def build_posterior(
    solved: Solved,
    inputs: Array,
    centre: Array,
    length: Array,
    amplitude: float,
    reach: Array,
    trend: Array,
) -> ProcessPosterior:
    """Returns the posterior of a process.

    Args:
        solved: Training rows, their noise on the diagonal of the covariance.
        inputs: (n, d) of these rows, less ``centre``.
        centre: (d,).
        length: (d,).
        amplitude: Prior standard deviation at the places predicted.
        reach: (n,) covariance of each row with a place predicted that has the same inputs.
        trend: (q,) the trend columns' values at the places predicted.
    """
    inverse, _ = lapack.dtrtri(solved.lower, lower=1)
    known: Array = np.zeros((len(inputs), 0))
    ahead: Array = np.zeros(0)
    if solved.integrated and len(trend):
        known = np.asarray(np.linalg.solve(solved.trend_lower, solved.trend_rows.T).T)
        known = known * reach[:, None]
        ahead = np.asarray(np.linalg.solve(solved.trend_lower, trend))
    return ProcessPosterior(
        centre=centre,
        length=length,
        places=_right_factor(inputs / length),
        weights=reach[:, None] * solved.alpha,
        offset=trend @ solved.trend,
        root=np.ascontiguousarray(reach[:, None] * inverse.T),
        trend=known,
        trend_ahead=ahead,
        amplitude=amplitude,
    )
