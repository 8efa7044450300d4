"""Drift scales from the target rows: marginal likelihood in observation space, with its curvature.

For m numbers z = H w + noise every scale enters one m x m matrix,

    K = k^2 A'A + sum_g s_g^2 H_g unit_g^2 H_g' + noise,      A = R D H',    y = z - H D mean

so that a step costs m^3, whatever the source measured. The Hessian at the optimum says how well
the scales are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from robotrue.calibration.belief import Belief
from robotrue.calibration.drift import Drift, carried, shape_variance
from robotrue.calibration.new_rows import NUISANCE_SD, Piece
from robotrue.core.arrays import Array, IntArray

STEPS: Final = 60
DIFFERENCE: Final = 1e-2
"""Step of the logarithm of a scale in differences."""
WIDEST: Final = 6.0
"""Largest logarithm by which a scale may leave its default: a factor of 400."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack:
    """Rows in SI, one under the other.

    Attributes:
        columns: (m, p + nuisances).
        values: (m,).
        known: (m, m) covariance of instrument and repeatability, over the robust weights.
        white: (m,) how often the white noise of lengths adds, over the robust weights.
        row: (m,) row of the set.
    """

    columns: Array
    values: Array
    known: Array
    white: Array
    row: IntArray


def stacked(pieces: Sequence[Piece], weights: Array) -> Stack:
    """Returns the rows with weight as one stack."""
    columns, values, white, row, blocks = [], [], [], [], []
    for piece in pieces:
        for i in np.flatnonzero(weights[piece.rows] > 0.0):
            u = weights[piece.rows[i]]
            columns.append(piece.columns[i])
            values.append(piece.values[i])
            white.append(piece.white[0] / u)
            row.append(np.full(len(piece.values[i]), piece.rows[i]))
            blocks.append(piece.covariance[i] / u)
    size = sum(map(len, values))
    known = np.zeros((size, size))
    start = 0
    for block in blocks:
        part = slice(start, start + len(block))
        known[part, part] = block
        start += len(block)
    return Stack(
        columns=np.concatenate(columns),
        values=np.concatenate(values),
        known=known,
        white=np.concatenate(white),
        row=np.concatenate(row),
    )


class _Problem:
    """The matrices of one stack; scales are as in ``Drift.names``."""

    def __init__(self, drift: Drift, stack: Stack) -> None:
        belief = drift.belief
        ripple, _, smooth, end = belief.starts
        columns = stack.columns[:, :end]
        parts = (slice(0, ripple), slice(ripple, smooth), slice(smooth, end))
        roots = [belief.root[:, p] @ columns[:, p].T for p in parts]
        self.gram = [[a.T @ b for b in roots] for a in roots]
        self.means = [columns[:, p] @ belief.mean[p] for p in parts]
        nuisance = stack.columns[:, end:]
        self.fixed = stack.known + NUISANCE_SD**2 * nuisance @ nuisance.T
        self.values, self.white = stack.values, np.diag(stack.white)
        waves, smooths = shape_variance(belief)
        smooths[drift.field] = 0.0
        self.shapes = [(columns * v) @ columns.T for v in (waves, smooths)]
        fresh = columns[:, drift.field]
        self.added = [fresh @ fresh.T] + [
            (columns[:, g.columns] * g.unit**2) @ columns[:, g.columns].T for g in drift.groups
        ]
        self.drift = drift

    def matrices(self, log_scale: Array) -> tuple[Array, list[Array], Array, list[Array]]:
        """K, dK of every scale, y, and dy of ripple and smooth."""
        scale = np.exp(log_scale)
        angle = np.arctan(scale[2:4])
        c, s = np.cos(angle), np.sin(angle)
        d = np.array([1.0, c[0], c[1]])
        trusted = sum(d[i] * d[j] * self.gram[i][j] for i in range(3) for j in range(3))
        trusted = scale[0] ** 2 * np.asarray(trusted)
        slopes = [2.0 * trusted, 2.0 * scale[1] ** 2 * self.white]
        y = self.values - self.means[0] - c[0] * self.means[1] - c[1] * self.means[2]
        moved = []
        total = self.fixed + trusted + scale[1] ** 2 * self.white
        for k in (0, 1):
            half = np.asarray(sum(d[j] * self.gram[k + 1][j] for j in range(3)))
            turn = -(s[k] ** 2) * c[k]
            slope = scale[0] ** 2 * turn * (half + half.T)
            slopes.append(slope + 2.0 * s[k] ** 2 * c[k] ** 2 * self.shapes[k])
            moved.append(-turn * self.means[k + 1])
            total = total + s[k] ** 2 * self.shapes[k]
        for value, part in zip(scale[4:], self.added, strict=True):
            total = total + value**2 * part
            slopes.append(2.0 * value**2 * part)
        return total, slopes, y, moved

    def objective(self, log_scale: Array) -> tuple[float, Array]:
        """Minus the log posterior of the scales and its gradient."""
        total, slopes, y, moved = self.matrices(log_scale)
        factor = cho_factor(total, lower=True)
        alpha = cho_solve(factor, y)
        inverse = cho_solve(factor, np.eye(len(y)))
        weight = 0.5 * (inverse - np.outer(alpha, alpha))
        off = (log_scale - self.drift.rest) / self.drift.log_sd
        value = float(np.log(np.diagonal(factor[0])).sum()) + 0.5 * float(y @ alpha + off @ off)
        gradient = np.array([float((weight * slope).sum()) for slope in slopes])
        gradient[2:4] += [float(alpha @ m) for m in moved]
        return value, gradient + off / self.drift.log_sd


def learned_drift(drift: Drift, stack: Stack) -> Drift:
    """Returns the drift with the scales that the rows make most probable, and their covariance."""
    problem = _Problem(drift, stack)
    start = np.clip(drift.log_scale, drift.rest - WIDEST, drift.rest + WIDEST)
    found = minimize(
        problem.objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(drift.rest - WIDEST, drift.rest + WIDEST, strict=True)),
        options={"maxiter": STEPS},
    )
    at = np.asarray(found.x)
    curvature = np.empty((len(at), len(at)))
    for k in range(len(at)):
        step = np.zeros(len(at))
        step[k] = DIFFERENCE
        ahead, behind = problem.objective(at + step)[1], problem.objective(at - step)[1]
        curvature[k] = (ahead - behind) / (2.0 * DIFFERENCE)
    # Whitened by the prior the curvature of a proper posterior is about 1 or more; a saddle of
    # the Gaussian approximation is taken for "not better known than before".
    unit = drift.log_sd[:, None] * (0.5 * (curvature + curvature.T)) * drift.log_sd
    values, vectors = np.linalg.eigh(unit)
    half = drift.log_sd[:, None] * vectors / np.sqrt(np.maximum(values, 1.0))
    return replace(drift, log_scale=at, log_cov=half @ half.T)


def left_out(drift: Drift, stack: Stack) -> tuple[IntArray, Array, IntArray]:
    """Returns row numbers (n,), whitened lengths (n,) and sizes (n,) of rows left out in turn.

    Each row is predicted from all others at the drift's scales; with K^-1 at hand that is one
    small solve a row (Rasmussen and Williams 2006, eq. 5.12, in blocks).
    """
    total, _, y, _ = _Problem(drift, stack).matrices(drift.log_scale)
    precision = np.linalg.inv(total)
    alpha = precision @ y
    rows = np.unique(stack.row)
    lengths, sizes = np.empty(len(rows)), np.empty(len(rows), dtype=np.int64)
    for i, row in enumerate(rows):
        mine = np.flatnonzero(stack.row == row)
        block = precision[np.ix_(mine, mine)]
        lengths[i] = float(
            np.sqrt(max(float(alpha[mine] @ np.linalg.solve(block, alpha[mine])), 0.0))
        )
        sizes[i] = len(mine)
    return rows, lengths, sizes


def mean_slopes(drift: Drift, stack: Stack) -> Array:
    """Returns d(posterior mean)/d(log scale) (scales, p + nuisances) by central differences."""
    problem = _Problem(drift, stack)
    out = []
    for k in range(len(drift.log_scale)):
        step = np.zeros(len(drift.log_scale))
        step[k] = DIFFERENCE
        ahead = _mean(drift, stack, problem, drift.log_scale + step)
        behind = _mean(drift, stack, problem, drift.log_scale - step)
        out.append((ahead - behind) / (2.0 * DIFFERENCE))
    return np.array(out)


def _mean(drift: Drift, stack: Stack, problem: _Problem, log_scale: Array) -> Array:
    belief: Belief = drift.belief
    end = belief.starts[3]
    total, _, y, _ = problem.matrices(log_scale)
    alpha = cho_solve(cho_factor(total, lower=True), y)
    pull = stack.columns.T @ alpha
    scale = np.exp(log_scale)
    keep, variance = carried(drift, scale)
    through = scale[0] ** 2 * keep * (belief.root.T @ (belief.root @ (keep * pull[:end])))
    mean = keep * belief.mean + through + variance * pull[:end]
    return np.concatenate([mean, NUISANCE_SD**2 * pull[end:]])
