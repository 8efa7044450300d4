"""Prediction of a squared exponential process at many places.

With z = (x - centre) / length, E = exp(-|z - z_i|^2 / 2) over the training rows:

    mean = offset + a^2 E alpha
    variance = a^2 - |a^2 E L^-T|^2 + (1 - a^2 E K^-1 1)^2 / (1'K^-1 1)

(with "reach" for the first a^2 of each row where rows of two kinds are learned from).

E comes from one product of [z, 1, -|z|^2/2] with [z_i, -|z_i|^2/2, 1] and one exponential, in
blocks of rows that stay in cache; L^-T is upper triangular and multiplied by blocks of columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from robotrue.calibration.learners.marginal import Solved
from robotrue.core.arrays import Array

_ROWS, _COLUMNS = 512, 64


def correlation(z: Array, other: Array) -> Array:
    """Returns exp(-|z - other|^2 / 2), (m, n), of inputs (m, d) and (n, d) over their lengths."""
    exponents = _left(z) @ _right(other)
    np.minimum(exponents, 0.0, out=exponents)  # coinciding rows must not exceed one by rounding
    return np.asarray(np.exp(exponents, out=exponents))


def _left(z: Array) -> Array:
    half = -0.5 * np.einsum("ij,ij->i", z, z)
    return np.column_stack([z, np.ones(len(z)), half])


def _right(z: Array) -> Array:
    half = -0.5 * np.einsum("ij,ij->i", z, z)
    return np.column_stack([z, half, np.ones(len(z))]).T


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """What a fitted process knows, ready for prediction.

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
        exponents = _left((inputs - self.centre) / self.length) @ self.places
        return np.asarray(np.exp(exponents, out=exponents))


def posterior(
    solved: Solved,
    inputs: Array,
    centre: Array,
    length: Array,
    amplitude: float,
    reach: Array,
    trend: Array,
) -> Posterior:
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
    return Posterior(
        centre=centre,
        length=length,
        places=_right(inputs / length),
        weights=reach[:, None] * solved.alpha,
        offset=trend @ solved.trend,
        root=np.ascontiguousarray(reach[:, None] * inverse.T),
        trend=known,
        trend_ahead=ahead,
        amplitude=amplitude,
    )
