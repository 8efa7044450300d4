"""Two processes, one of which is learned from the other: evidence and gradient.

    f_source = g,   f_target = rho g + h,   g and h independent, amplitudes a and b, common lengths

    covariance of two rows = exp(-sum_j (x_j - x'_j)^2 / (2 l_j^2)) times
        a^2            source and source
        rho a^2        source and target
        rho^2 a^2 + b^2  target and target

and white noise of each domain on the diagonal, over the weight of the row. theta = [log l_1 ..
log l_d (one for all when isotropic), log a, log b, rho, log s_target, log s_source].

Source: Kennedy and O'Hagan, Predicting the output from a complex computer code when fast
approximations are available, Biometrika 87 (2000), eq. 1-2, with lengths in common.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.learners.marginal import Solved, solve
from robotrue.calibration.learners.posterior import Posterior, correlation, posterior
from robotrue.calibration.learners.process import PRIOR, Rows, limits
from robotrue.core.arrays import Array, BoolArray

OTHERS = 5
"""Entries of theta that are not lengths."""
_START_RHO, _RHO_PRIOR, _RHO_LIMIT = 1.0, 1.0, 3.0
_START_DIFFERENCE, _LEAST_DIFFERENCE = 0.3, 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferRows:
    """Rows of both domains.

    Attributes:
        rows: Of both; its mean says whether the one trend column is there at all.
        target: (n,) which are target rows.
        apart: Each domain has its own constant mean.
    """

    rows: Rows
    target: BoolArray
    apart: bool

    def trend(self) -> Array:
        """Returns the columns of the constant means (n, q): none, one, or source and target."""
        if not self.apart:
            return self.rows.trend()
        return np.column_stack([~self.target, self.target]).astype(np.float64)

    def ahead(self) -> Array:
        """Returns the trend columns at a target place, (q,)."""
        return np.asarray(self.trend()[self.target][0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """What theta says: lengths (d,), amplitudes, rho, noise of each domain."""

    length: Array
    source: float
    difference: float
    rho: float
    target_noise: float
    source_noise: float

    @property
    def amplitude(self) -> float:
        """Standard deviation of the target's function."""
        return float(np.hypot(self.rho * self.source, self.difference))


def parts(theta: Array, columns: int) -> Parts:
    """Returns theta by name."""
    source, difference, target_noise, source_noise = np.exp(theta[[-5, -4, -2, -1]]).tolist()
    return Parts(
        length=np.broadcast_to(np.exp(theta[:-OTHERS]), (columns,)),
        source=source,
        difference=difference,
        rho=float(theta[-3]),
        target_noise=target_noise,
        source_noise=source_noise,
    )


def _noise(data: TransferRows, p: Parts) -> Array:
    """Returns the noise variance of every row, (n,)."""
    white = np.where(data.target, p.target_noise, p.source_noise) ** 2
    return np.asarray((white + data.rows.variance) / data.rows.weight)


def _solved(data: TransferRows, p: Parts) -> tuple[Solved, Array]:
    """Returns the rows solved against their covariance, and their correlation (n, n)."""
    z = data.rows.inputs / p.length
    near = correlation(z, z)
    np.fill_diagonal(near, 1.0)
    share = np.where(data.target, p.rho, 1.0)
    total = near * (p.source**2 * np.outer(share, share))
    total += near * (p.difference**2 * np.outer(data.target, data.target))
    total.flat[:: len(total) + 1] += _noise(data, p)
    return solve(total, data.rows.outputs, data.trend()), near


def log_evidence(data: TransferRows, theta: Array) -> tuple[float, Array]:
    """Returns log p(outputs of both domains | theta) and its gradient by theta.

    Raises:
        ObservabilityError: Rows that coincide and carry no noise.
    """
    p = parts(theta, data.rows.inputs.shape[1])
    solved, near = _solved(data, p)
    sensitivity = solved.sensitivity()
    near *= sensitivity
    target, source = data.target.astype(np.float64), (~data.target).astype(np.float64)
    to_target = near @ target
    both, of_target, of_source = source @ to_target, target @ to_target, source @ near @ source
    share = source + p.rho * target
    near *= p.source**2 * np.outer(share, share) + p.difference**2 * np.outer(target, target)
    z = data.rows.inputs / p.length
    by_length = near.sum(axis=0) @ z**2 - np.einsum("ij,ij->j", z, near @ z)
    if data.rows.isotropic:
        by_length = by_length.sum(keepdims=True)
    by_noise = sensitivity.diagonal() / data.rows.weight
    others = [
        p.source**2 * (of_source + 2.0 * p.rho * both + p.rho**2 * of_target),
        p.difference**2 * of_target,
        p.source**2 * (both + p.rho * of_target),
        p.target_noise**2 * (target @ by_noise),
        p.source_noise**2 * (source @ by_noise),
    ]
    return solved.log_evidence, np.concatenate([by_length, others])


def start_and_bounds(data: TransferRows) -> tuple[Array, Array]:
    """Returns where the search begins (p,) and its limits (p, 2), of theta."""
    begin, ends = limits(data.rows)
    amplitude, noise = begin[-2], begin[-1]
    start = np.array([*begin[:-1], amplitude + np.log(_START_DIFFERENCE), _START_RHO, noise, noise])
    least = [amplitude + np.log(_LEAST_DIFFERENCE), ends[-2, 1]]
    bounds = [*ends[:-1], least, [-_RHO_LIMIT, _RHO_LIMIT], ends[-1], ends[-1]]
    return start, np.array(bounds)


def log_posterior(data: TransferRows, theta: Array) -> tuple[float, Array]:
    """Returns log evidence plus log prior of theta, up to a constant, and the gradient."""
    value, gradient = log_evidence(data, theta)
    if not data.rows.prior:
        return value, gradient
    start, _ = start_and_bounds(data)
    lengths, amplitude, noise = PRIOR
    count = len(theta) - OTHERS
    deviation = np.array([*[lengths] * count, amplitude, amplitude, _RHO_PRIOR, noise, noise])
    off = np.where(np.isfinite(theta), (theta - start) / deviation, 0.0)  # a held zero is -inf
    return value - 0.5 * float(off @ off), gradient - off / deviation


def left_out(data: TransferRows, theta: Array) -> tuple[Array, Array]:
    """Returns residual (m, k) and variance (m,) of target rows, each from all other rows.

    Of source rows where the only target row is needed for the target's own mean.
    """
    solved, _ = _solved(data, parts(theta, data.rows.inputs.shape[1]))
    lonely = data.apart and data.target.sum() == 1
    return solved.left_out(~data.target if lonely else data.target)


def posterior_of(data: TransferRows, theta: Array) -> Posterior:
    """Returns the target's process given all rows, ready for prediction."""
    p = parts(theta, data.rows.inputs.shape[1])
    solved, _ = _solved(data, p)
    return posterior(
        solved,
        data.rows.inputs,
        data.rows.centre,
        p.length,
        p.amplitude,
        np.where(data.target, p.amplitude**2, p.rho * p.source**2),
        data.ahead(),
    )
