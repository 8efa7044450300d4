"""Drift scales from the target rows: marginal likelihood in observation space, with its curvature.

For m numbers z = H w + noise every scale enters one m x m matrix,

    K = k^2 A'A + sum_g s_g^2 H_g unit_g^2 H_g' + noise,      A = R D H',    y = z - H D mean

so that a step costs m^3, whatever the source measured. The Hessian at the optimum gives the
uncertainty of the scales.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robotrue.calibration.drift_prior import SourceDrift, carry_over
from robotrue.calibration.learners.search import deviation_axes, search_theta
from robotrue.calibration.new_rows import NUISANCE_SD, left_out_lengths
from robotrue.calibration.observations import LinearRows
from robotrue.core.arrays import Array, IntArray, as_range

STEPS: Final = 60
UNSEEN: Final = 1.0
"""m^2 or rad^2, noise of numbers that count for nothing."""
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
        known: (m, m) covariance of instrument and repeatability.
        white: (m,) multiple of the white noise of lengths.
        row: (m,) row of the set.
    """

    columns: Array
    values: Array
    known: Array
    white: Array
    row: IntArray


def stack_rows(pieces: Sequence[LinearRows]) -> Stack:
    """Returns the rows as one stack."""
    blocks = [block for piece in pieces for block in piece.covariance]
    known = np.zeros((sum(map(len, blocks)),) * 2)
    start = 0
    for block in blocks:
        part = slice(start, start + len(block))
        known[part, part] = block
        start += len(block)
    return Stack(
        columns=np.concatenate([p.columns.reshape(-1, p.columns.shape[2]) for p in pieces]),
        values=np.concatenate([p.values.ravel() for p in pieces]),
        known=known,
        white=np.concatenate([np.tile(p.white[0], len(p.rows)) for p in pieces]),
        row=np.concatenate([np.repeat(p.rows, p.values.shape[1]) for p in pieces]),
    )


class DriftEvidence:
    """The matrices of one stack, linearised once; scales are as in ``Drift.names``.

    Products with the source's root are made once; weights and scales only choose and add.
    """

    def __init__(self, drift: SourceDrift, stack: Stack) -> None:
        belief = drift.belief
        end = belief.end
        columns = stack.columns[:, :end]
        waves, field = belief.columns_by_carry("waves"), belief.columns_by_carry("field")
        parts = (np.setdiff1d(np.arange(end), np.concatenate([waves, field])), waves, field)
        roots = [belief.root[:, p] @ columns[:, p].T for p in map(as_range, parts)]
        fresh, nuisance = columns[:, drift.field], stack.columns[:, end:]
        self._drift, self._stack = drift, stack
        self._gram = [[a.T @ b for b in roots] for a in roots]
        self._means = [columns[:, p] @ belief.mean[p] for p in parts]
        self._shapes = [(columns * v) @ columns.T for v in (drift.waves, drift.smooths)]
        self._added = [fresh @ fresh.T] + [
            (columns[:, g.columns] * g.unit**2) @ columns[:, g.columns].T for g in drift.groups
        ]
        self._loose = NUISANCE_SD**2 * nuisance @ nuisance.T
        self.weigh(np.ones(len(stack.values)))

    def weigh(self, u: Array) -> None:
        """Sets the robust weights (m,) of the numbers; those of zero are as good as unseen."""
        root = np.sqrt(np.where(u > 0.0, u, 1.0))
        self._known = self._stack.known / np.outer(root, root)
        self._known[np.diag_indices(len(u))] += np.where(u > 0.0, 0.0, UNSEEN)
        self._white = np.diag(np.where(u > 0.0, self._stack.white / root**2, 0.0))

    def matrices(self, log_scale: Array) -> tuple[Array, list[Array], Array, list[Array]]:
        """K, dK of every scale, y, and dy of ripple and smooth."""
        scale = np.exp(log_scale)
        angle = np.arctan(scale[2:4])
        c, s = np.cos(angle), np.sin(angle)
        d = np.array([1.0, c[0], c[1]])
        trusted = scale[0] ** 2 * sum(
            d[i] * d[j] * self._gram[i][j] for i in range(3) for j in range(3)
        )
        slopes = [2.0 * trusted, 2.0 * scale[1] ** 2 * self._white]
        total = trusted + scale[1] ** 2 * self._white + self._known + self._loose
        moved = []
        for k in (0, 1):
            half = scale[0] ** 2 * sum(d[j] * self._gram[k + 1][j] for j in range(3))
            turn = -(s[k] ** 2) * c[k]
            slope = turn * (half + half.T) + 2.0 * s[k] ** 2 * c[k] ** 2 * self._shapes[k]
            slopes.append(slope)
            moved.append(-turn * self._means[k + 1])
            total = total + s[k] ** 2 * self._shapes[k]
        for value, part in zip(scale[4:], self._added, strict=True):
            total = total + value**2 * part
            slopes.append(2.0 * value**2 * part)
        y = self._stack.values - sum(x * m for x, m in zip(d, self._means, strict=True))
        return total, slopes, y, moved

    def plain_noise(self, log_scale: Array) -> Array:
        """Returns the change of the noise in K (m, m) under full weight; negative or zero."""
        plain = np.exp(2.0 * log_scale[1]) * np.diag(self._stack.white) + self._stack.known
        return np.asarray(plain - np.exp(2.0 * log_scale[1]) * self._white - self._known)

    def log_posterior(self, log_scale: Array) -> tuple[float, Array]:
        """Log posterior of the scales, up to a constant, and its gradient."""
        total, slopes, y, moved = self.matrices(log_scale)
        factor = cho_factor(total, lower=True)
        alpha = cho_solve(factor, y)
        inverse = cho_solve(factor, np.eye(len(y)))
        weight = 0.5 * (np.outer(alpha, alpha) - inverse)
        off = (log_scale - self._drift.rest) / self._drift.log_sd
        value = -float(np.log(np.diagonal(factor[0])).sum()) - 0.5 * float(y @ alpha + off @ off)
        gradient = np.array([float((weight * slope).sum()) for slope in slopes])
        gradient[2:4] -= [float(alpha @ m) for m in moved]
        return value, gradient - off / self._drift.log_sd

    def means(self, log_scales: Array) -> Array:
        """Posterior means (k, p + nuisances) at k scales; the root is read once for all."""
        belief = self._drift.belief
        end = belief.end
        pulls, keeps, direct = [], [], []
        for log_scale in log_scales:
            total, _, y, _ = self.matrices(log_scale)
            pull = self._stack.columns.T @ cho_solve(cho_factor(total, lower=True), y)
            scale = np.exp(log_scale)
            keep, variance = carry_over(self._drift, scale)
            pulls.append(pull)
            keeps.append(scale[0] * keep)
            direct.append(keep * belief.mean + variance * pull[:end])
        pulled, kept = np.array(pulls), np.array(keeps)
        through = kept * ((kept * pulled[:, :end]) @ belief.root.T @ belief.root)
        return np.hstack([np.array(direct) + through, NUISANCE_SD**2 * pulled[:, end:]])


def learn_drift(drift: SourceDrift, problem: DriftEvidence) -> SourceDrift:
    """Returns the drift with the scales that the rows make most probable, and their covariance."""
    bounds = drift.rest[:, None] + np.array([-WIDEST, WIDEST])
    best = search_theta(problem.log_posterior, drift.log_scale, bounds, steps=STEPS)
    # Whitened by the prior the curvature of a proper posterior is about 1 or more; a saddle of
    # the Gaussian approximation is taken for "not better known than before".
    axes = deviation_axes(
        lambda at: problem.log_posterior(at)[1], best, drift.log_sd, step=DIFFERENCE, least=1.0
    )
    return replace(drift, log_scale=best, log_cov=axes @ axes.T)


def leave_rows_out(
    drift: SourceDrift, problem: DriftEvidence, row: IntArray
) -> tuple[IntArray, Array, IntArray]:
    """Returns row numbers (n,), whitened lengths (n,) and sizes (n,) of rows left out in turn.

    Each row is predicted from all others at the drift's scales.

    Args:
        drift: Scales.
        problem: Rows and weights.
        row: (m,) row of the set each number belongs to.
    """
    total, _, y, _ = problem.matrices(drift.log_scale)
    plain = problem.plain_noise(drift.log_scale)
    rows = np.unique(row)
    blocks = [np.flatnonzero(row == k) for k in rows]
    lengths = left_out_lengths(total, y, blocks, plain)
    return rows, lengths, np.array([len(mine) for mine in blocks], dtype=np.int64)


def mean_slopes(drift: SourceDrift, problem: DriftEvidence) -> Array:
    """Returns d(posterior mean)/d(log scale) (scales, p + nuisances) by central differences."""
    steps = DIFFERENCE * np.eye(len(drift.log_scale))
    ahead, behind = np.split(
        problem.means(np.concatenate([drift.log_scale + steps, drift.log_scale - steps])), 2
    )
    return np.asarray((ahead - behind) / (2.0 * DIFFERENCE))
