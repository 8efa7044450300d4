"""A calibration as a Gaussian over all its coefficients: what new measurements are added to.

    w = [robot errors, ripple, backlash, smooth weights, nuisances]      w ~ N(mean, R'R)

R is any root of the covariance. Rows ``z = H w + e``, e ~ N(0, I), change it without ever forming
the covariance: with R H' = U diag(s) V' (thin)

    R  <-  R - U diag(1 - 1/sqrt(1 + s^2)) U' R

which is the exact square root of ``S - S H' (H S H' + I)^-1 H S`` (Andrews 1968; Bierman 1977,
ch. V). Nothing can become indefinite, and the order of the rows does not matter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.linalg import qr, svd

from robotrue.calibration.smooth import SmoothBasis
from robotrue.core.arrays import Array
from robotrue.robot.model import RobotModel

ROWS: Final = 300
"""Numbers conditioned on at a time."""
WIDE: Final = 1.3
"""Rows of the root over its columns from which it is made square again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A calibrated arm as mean and root over named columns.

    Attributes:
        robot: The nominal arm.
        cycles: (h,) of the ripple.
        basis: Centres of the smooth residual, if any.
        amplitude: m, prior sd of the smooth residual.
        mean: (p,) SI, in the order of the module's first line.
        root: (r, p) R.
        white: m, sd per axis of white noise beyond instrument and repeatability.
        repeatability: m, sd per axis.
        inflation: Factor on the covariance of predictions.
        T_tracker_base: Of the set-ups the model knows.
        reflectors: Further reflectors of the last rows: where, and the root (r, 3) over the place,
            along its own axes. What moves the root afterwards must leave them out.
        nuisances: Columns at the end that leave with the rows that brought them.
    """

    robot: RobotModel
    cycles: Array
    basis: SmoothBasis | None
    amplitude: float
    mean: Array
    root: Array
    white: float
    repeatability: float
    inflation: float
    T_tracker_base: Mapping[int, Array]
    nuisances: int = 0
    reflectors: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def starts(self) -> tuple[int, int, int, int]:
        """First column of ripple, backlash, smooth weights and nuisances."""
        dof = self.robot.dof
        ripple = len(self.robot.errors)
        backlash = ripple + 2 * dof * len(self.cycles)
        smooth = backlash + dof
        return ripple, backlash, smooth, smooth + 3 * self.centres

    @property
    def centres(self) -> int:
        """Number of centres of the smooth residual."""
        return 0 if self.basis is None else len(self.basis.centres)

    @property
    def errors(self) -> Array:
        """Robot errors at the mean (7 dof + 12,) SI."""
        return self.mean[: len(self.robot.errors)]

    @property
    def variance(self) -> Array:
        """(p,) variance of every column."""
        return np.asarray((self.root**2).sum(axis=0))


def conditioned(belief: Belief, columns: Array, values: Array) -> Belief:
    """Returns the belief after whitened rows ``values = columns @ w + e``, e ~ N(0, I).

    Args:
        belief: Before.
        columns: (m, p).
        values: (m,).
    """
    mean, root = belief.mean.copy(), belief.root
    for start in range(0, len(values), ROWS):
        part = slice(start, start + ROWS)
        left, size, right = svd(root @ columns[part].T, full_matrices=False, lapack_driver="gesdd")
        turned = left.T @ root
        off = right @ (values[part] - columns[part] @ mean)
        mean = mean + turned.T @ (size / (1.0 + size**2) * off)
        root = root - left @ ((1.0 - 1.0 / np.sqrt(1.0 + size**2))[:, None] * turned)
    return replace(belief, mean=mean, root=root)


def widened(belief: Belief, variance: Array) -> Belief:
    """Returns the belief with independent variance (p,) added to its columns."""
    extra = np.flatnonzero(variance > 0.0)
    rows = np.zeros((len(extra), len(belief.mean)))
    rows[np.arange(len(extra)), extra] = np.sqrt(variance[extra])
    return replace(belief, root=np.vstack([belief.root, rows]))


def with_nuisances(belief: Belief, sd: Array) -> Belief:
    """Returns the belief with columns of zero mean and the given sd (k,) added at its end."""
    r, p = belief.root.shape
    root = np.zeros((r + len(sd), p + len(sd)))
    root[:r, :p] = belief.root
    root[r + np.arange(len(sd)), p + np.arange(len(sd))] = sd
    mean = np.concatenate([belief.mean, np.zeros(len(sd))])
    return replace(belief, mean=mean, root=root, nuisances=belief.nuisances + len(sd))


def with_centres(belief: Belief, basis: SmoothBasis) -> Belief:
    """Returns the belief over a basis that begins with the centres it had.

    The columns of a basis are nested: the first ones do not change when centres are added, so the
    new weights simply stand at zero, with no variance yet.
    """
    _, _, _, end = belief.starts
    extra = 3 * (len(basis.centres) - belief.centres)
    return replace(
        belief,
        basis=basis,
        mean=np.insert(belief.mean, np.full(extra, end), 0.0),
        root=np.insert(belief.root, np.full(extra, end), 0.0, axis=1),
    )


def with_harmonics(belief: Belief, count: int) -> Belief:
    """Returns the belief with at least ``count`` harmonics; new ones at zero without variance."""
    h, dof = len(belief.cycles), belief.robot.dof
    if count <= h:
        return belief
    ripple = belief.starts[0]
    where = ripple + np.repeat(2 * h * np.arange(1, dof + 1), 2 * (count - h))
    return replace(
        belief,
        cycles=np.arange(1.0, count + 1.0),
        mean=np.insert(belief.mean, where, 0.0),
        root=np.insert(belief.root, where, 0.0, axis=1),
    )


def compressed_root(root: Array) -> Array:
    """Returns a root with no more rows than columns that say anything, where that saves much."""
    used = np.flatnonzero((root != 0.0).any(axis=0))
    if len(root) <= WIDE * len(used):
        return root
    triangle = qr(root[:, used], mode="r")[0][: len(used)]
    out = np.zeros((len(triangle), root.shape[1]))
    out[:, used] = triangle
    return out
