"""How far off, and how sure, the learned model is on blocks of rows it did not see.

Within the training rows alone: the rows are cut into contiguous blocks in the order they were
measured, each block is predicted from the others at the learned scales and noise, and the
covariance is multiplied by the factor that makes 95 % of the rows fall into their 95 % region.
Taking a block away is exact and needs no new fit: with S the
posterior of all rows, F the block's weighted rows, N their noise and e what they are off by,

    w' = w - S F' (N - F S F')^-1 e,      S' = S + S F' (N - F S F')^-1 F S
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from robotrue.calibration.design import Design
from robotrue.calibration.evidence import Weights
from robotrue.calibration.robust import chi_point
from robotrue.core.arrays import Array

BLOCKS: Final = 10
LEVEL: Final = 0.95
LARGEST: Final = 100.0
"""Largest factor on a covariance: ten times the standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Rows predicted from the other blocks, base or tracker frame, in the rows' order.

    Attributes:
        error: (n, 3) m, measured minus predicted.
        model: (n, 3, 3) m^2, parameters, residual and white noise.
        instrument: (n, 3, 3) m^2.
        inflation: Factor on ``model`` for the stated coverage.
    """

    error: Array
    model: Array
    instrument: Array
    inflation: float

    @property
    def mean(self) -> float:
        """Mean 3-D error, m."""
        return float(np.linalg.norm(self.error, axis=1).mean())

    def coverage(self, factor: float) -> float:
        """Returns the share of rows in their 95 % region, the model's part times ``factor``."""
        return float((_squared(self, factor) <= chi_point(LEVEL, 3) ** 2).mean())


@dataclass(frozen=True, slots=True, kw_only=True)
class _Taken:
    """What taking a block away does, in coordinates where the posterior of all rows is I.

    Attributes:
        step: (p,) to be subtracted from the weights.
        transform: Takes columns (k, p) to G with G G' their covariance without the block.
    """

    step: Array
    transform: Callable[[Array], Array]


def _taken(rows: Array, values: Array, tau: Array) -> _Taken:
    """Takes weighted rows (k, p) and their residuals (k,) of noise (k,) away.

    By whichever is smaller of (N - F F') (k, k) and (I - F' N^-1 F) (p, p).
    """
    root = np.sqrt(tau)
    whole, off = rows / root[:, None], values / root
    if len(rows) < rows.shape[1]:
        factor = np.linalg.cholesky(np.eye(len(rows)) - whole @ whole.T)
        wider = solve_triangular(factor, whole, lower=True).T
        step = wider @ solve_triangular(factor, off, lower=True)
        return _Taken(step=step, transform=lambda c: np.hstack([c, c @ wider]))
    factor = np.linalg.cholesky(np.eye(rows.shape[1]) - whole.T @ whole)
    step = solve_triangular(factor, whole.T @ off, lower=True)
    return _Taken(
        step=solve_triangular(factor, step, lower=True, trans=1),
        transform=lambda c: solve_triangular(factor, c.T, lower=True).T,
    )


def held_out(design: Design, fit: Weights, uncarried: Array, repeatability: float) -> HeldOut:
    """Returns every row predicted from the other blocks, and the factor on the covariance.

    Args:
        design: The linear model.
        fit: At the learned scales.
        uncarried: (rows,) m^2, variance of the smooth residual that its centres do not carry.
        repeatability: m, sd per axis, part of the rows' stated covariance.
    """
    count = len(design.weights)
    blocks = min(BLOCKS, max(2, count // 6))
    fold = np.arange(count) * blocks // count
    error, model, instrument = np.zeros((count, 3)), *np.zeros((2, count, 3, 3))
    for k in range(blocks):
        items = list(design.rows(fold == k))
        halves = [_flat(i.columns) @ fit.root.T for i in items]
        offs = [i.values - i.columns @ fit.mean for i in items]
        roots = [np.repeat(np.sqrt(design.weights[i.rows]), i.values.shape[1]) for i in items]
        taken = _taken(
            np.concatenate([h * r[:, None] for h, r in zip(halves, roots, strict=True)]),
            np.concatenate([o.ravel() * r for o, r in zip(offs, roots, strict=True)]),
            np.concatenate([np.tile(_per_number(o, fit.noise), len(o)) for o in offs]),
        )
        for item, half, off in zip(items, halves, offs, strict=True):
            points = _flat(half.reshape(*off.shape, -1)[:, :3])
            lower, back = item.lower[:, :3, :3], np.swapaxes(item.lower[:, :3, :3], 1, 2)
            moved = off[:, :3] + (points @ taken.step).reshape(-1, 3)
            wide = taken.transform(points).reshape(len(off), 3, -1)
            spread = wide @ np.swapaxes(wide, 1, 2) + fit.noise[0] * np.eye(3)
            known = item.instrument[:, :3, :3] - repeatability**2 * np.eye(3)
            error[item.rows] = (lower @ moved[:, :, None])[:, :, 0]
            model[item.rows] = lower @ spread @ back - known
            instrument[item.rows] = known
    model += uncarried[:, None, None] * np.eye(3)
    found = HeldOut(error=error, model=model, instrument=instrument, inflation=1.0)
    return HeldOut(error=error, model=model, instrument=instrument, inflation=_factor(found))


def _flat(columns: Array) -> Array:
    return np.ascontiguousarray(columns.reshape(-1, columns.shape[-1]))


def _per_number(off: Array, noise: Array) -> Array:
    return np.repeat(noise, 3)[: off.shape[1]]


def _squared(found: HeldOut, factor: float) -> Array:
    covariance = factor * found.model + found.instrument
    solved = np.linalg.solve(covariance, found.error[:, :, None])[:, :, 0]
    squared: Array = (found.error * solved).sum(axis=1)
    return squared


def _factor(found: HeldOut) -> float:
    """Bisection in the logarithm; coverage grows with the factor."""
    low, high = -np.log(4.0), np.log(LARGEST)
    for _ in range(40):
        middle = 0.5 * (low + high)
        if found.coverage(float(np.exp(middle))) < LEVEL:
            low = middle
        else:
            high = middle
    return float(np.exp(high))
