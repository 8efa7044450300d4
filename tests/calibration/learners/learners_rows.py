"""Smooth rows with three outputs, and the covariance of the paper's kernel written plainly."""

from __future__ import annotations

import numpy as np

NOISE = 0.03


def truth(X: np.ndarray) -> np.ndarray:
    return np.c_[
        np.sin(2.0 * X[:, 0]) + 0.3 * X[:, 1] ** 2,
        np.cos(X[:, 2]) + X[:, 3],
        X[:, 0] * X[:, 1] - 0.5 * X[:, 2],
    ]


def rows(n: int, seed: int, noise: float = NOISE) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    X = random.uniform(-1.0, 1.0, (n, 4)) * [1.0, 2.0, 1.0, 5.0]
    return X, truth(X) + noise * random.normal(size=(n, 3))


def kernel(A: np.ndarray, B: np.ndarray, length: np.ndarray | float) -> np.ndarray:
    """exp(-|a - b|^2 / 2), inputs over their lengths, from differences."""
    return np.exp(-0.5 * (((A[:, None] - B[None]) / length) ** 2).sum(axis=2))
