"""The posterior covariance of a linear model from few rows, without a matrix of all its columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from robotrue.core.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FewRows:
    """The covariance S (1 - B' K^-1 B) S of few rows, before its root is made.

    Attributes:
        kernel: (r, r) B B', given below its diagonal.
        columns: (r, p) B, whitened columns times their prior sd.
        sd: (p,) prior sd, the diagonal of S.
    """

    kernel: Array
    columns: Array
    sd: Array

    def root(self) -> Array:
        """Returns the root (p, p): the symmetric one of 1 - B' K^-1 B, times S."""
        shrink, left_vectors = self._shrink()
        turned = left_vectors.T @ self.columns
        whole = np.eye(len(self.sd)) - turned.T @ (turned * shrink[:, None])
        return np.asarray(whole * self.sd)

    def spread(self, columns: Array) -> Array:
        """Returns the covariance (n, m, m) of ``columns @ w`` for columns (n, m, p)."""
        n, m, size = columns.shape
        shrink, left_vectors = self._shrink()
        scaled = columns.reshape(n * m, size) * self.sd
        pulled = ((scaled @ self.columns.T @ left_vectors) * shrink) @ left_vectors.T
        half = (scaled - pulled @ self.columns).reshape(n, m, size)
        return np.asarray(half @ np.swapaxes(half, 1, 2))

    def _shrink(self) -> tuple[Array, Array]:
        """1 / (g (1 + g)), g^2 = 1 + s^2, with K = U (1 + s^2) U', and U."""
        square, left_vectors = eigh(self.kernel, driver="evd")
        grown = np.sqrt(1.0 + np.maximum(square, 0.0))
        return 1.0 / (grown * (1.0 + grown)), left_vectors
