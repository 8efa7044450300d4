"""Squared exponential process with white noise: evidence, gradient and the best hyper-parameters.

    K = a^2 exp(-sum_j (x_j - x'_j)^2 / (2 l_j^2)) + diag((s^2 + v_i) / w_i)

theta = log of [l_1 .. l_d (one for all when isotropic), a, s]: lengths in the unit of the inputs,
amplitude a and noise s in the unit of the outputs; v_i noise variance and w_i weight of row i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.learners.marginal import Solved, solve
from robotrue.calibration.learners.posterior import Posterior, correlation, posterior
from robotrue.core.arrays import Array

_LENGTHS, _AMPLITUDES, _NOISES = (2e-2, 1e2), (1e-2, 1e2), (1e-4, 1e1)
"""What is searched, in standard deviations of the inputs and of the outputs."""
_START_NOISE = 0.1
PRIOR = (1.0, 1.5, 2.0)
"""Standard deviations of the weak prior on log length, log amplitude, log noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Training rows of one process.

    Attributes:
        inputs: (n, d) less ``centre``.
        outputs: (n, k).
        weight: (n,) positive.
        variance: (n,) known noise variance.
        centre: (d,) taken from the inputs.
        spread: (d,) their standard deviation, 1 where they do not vary.
        scale: Standard deviation of the outputs, 1 where they do not vary.
        isotropic: One length for all inputs.
        mean: "constant" (integrated out), "estimated" or "zero".
        repeats: A row of weight w stands for w equal rows, also in the evidence.
        prior: Whether theta has the weak prior.
    """

    inputs: Array
    outputs: Array
    weight: Array
    variance: Array
    centre: Array
    spread: Array
    scale: float
    isotropic: bool
    mean: str
    repeats: bool
    prior: bool

    def trend(self) -> Array:
        """Returns the column of the constant mean (n, 1), or none (n, 0)."""
        return np.ones((len(self.inputs), 0 if self.mean == "zero" else 1))


def rows(
    inputs: Array,
    outputs: Array,
    weight: Array,
    variance: Array,
    *,
    isotropic: bool,
    mean: str,
    repeats: bool,
    prior: bool,
) -> Rows:
    """Returns training rows (n, d), (n, k) with centre and spread; zero weights are left out."""
    used = weight > 0.0
    inputs, outputs, weight, variance = (
        inputs[used],
        outputs[used],
        weight[used],
        variance[used],
    )
    share = weight / weight.sum()
    centre = share @ inputs
    spread = np.sqrt(share @ (inputs - centre) ** 2)
    if isotropic:
        spread = np.full_like(spread, np.sqrt(np.mean(spread**2)))
    about = 0.0 if mean == "zero" else share @ outputs
    scale = float(np.sqrt(np.mean(share @ (outputs - about) ** 2)))
    tiny = np.finfo(np.float64).eps
    return Rows(
        inputs=inputs - centre,
        outputs=outputs,
        weight=weight,
        variance=variance,
        centre=centre,
        spread=np.where(spread > tiny * (1.0 + np.abs(centre)), spread, 1.0),
        scale=scale if scale > tiny * float(np.abs(outputs).max(initial=0.0)) else 1.0,
        isotropic=isotropic,
        mean=mean,
        repeats=repeats,
        prior=prior,
    )


def split(theta: Array, columns: int) -> tuple[Array, float, float]:
    """Returns lengths (d,), amplitude and noise of theta."""
    length = np.broadcast_to(np.exp(theta[:-2]), (columns,))
    return length, float(np.exp(theta[-2])), float(np.exp(theta[-1]))


def signal_covariance(data: Rows, theta: Array) -> Array:
    """Returns the covariance of the rows without noise, (n, n)."""
    length, amplitude, _ = split(theta, data.inputs.shape[1])
    z = data.inputs / length
    signal = correlation(z, z)
    np.fill_diagonal(signal, 1.0)
    signal *= amplitude**2
    return signal


def solved_rows(data: Rows, theta: Array, signal: Array) -> Solved:
    """Returns the rows solved against ``signal`` (n, n) and their noise.

    Raises:
        ObservabilityError: Rows that coincide and carry no noise.
    """
    noise = float(np.exp(theta[-1]))
    total = signal.copy()
    total.flat[:: len(total) + 1] += (noise**2 + data.variance) / data.weight
    integrated = data.mean != "estimated"
    return solve(total, data.outputs, data.trend(), integrated=integrated)


def log_evidence(data: Rows, theta: Array) -> tuple[float, Array]:
    """Returns log p(outputs | theta) and its gradient by theta.

    Raises:
        ObservabilityError: Rows that coincide and carry no noise.
    """
    signal = signal_covariance(data, theta)
    solved = solved_rows(data, theta, signal)
    length, _, noise = split(theta, data.inputs.shape[1])
    sensitivity = solved.sensitivity()
    signal *= sensitivity
    z = data.inputs / length
    by_length = signal.sum(axis=0) @ z**2 - np.einsum("ij,ij->j", z, signal @ z)
    by_noise = noise**2 * (sensitivity.diagonal() / data.weight).sum()
    if data.repeats:
        more = (data.weight - 1.0) * noise**2 / (noise**2 + data.variance)
        by_noise -= data.outputs.shape[1] * float(more.sum())
    if data.isotropic:
        by_length = by_length.sum(keepdims=True)
    gradient = np.concatenate([by_length, [signal.sum(), by_noise]])
    return evidence_of(data, theta, solved), gradient


def evidence_of(data: Rows, theta: Array, solved: Solved) -> float:
    """Returns log p(outputs | theta); with ``repeats``, of every row as often as its weight says.

    N(y; f, s^2)^w = N(y; f, s^2 / w) (2 pi s^2)^((1 - w) / 2) w^(-1 / 2).
    """
    if not data.repeats:
        return solved.log_evidence
    each = np.exp(2.0 * theta[-1]) + data.variance
    extra = (data.weight - 1.0) * np.log(2.0 * np.pi * each) + np.log(data.weight)
    return solved.log_evidence - float(0.5 * data.outputs.shape[1] * extra.sum())


def log_posterior(data: Rows, theta: Array) -> tuple[float, Array]:
    """Returns log evidence plus log prior of theta, up to a constant, and the gradient.

    The weak prior is log-normal about where the search begins.
    """
    value, gradient = log_evidence(data, theta)
    if not data.prior:
        return value, gradient
    start, _ = limits(data)
    lengths, amplitude, noise = PRIOR
    deviation = np.array([*[lengths] * (len(theta) - 2), amplitude, noise])
    off = np.where(np.isfinite(theta), (theta - start) / deviation, 0.0)  # a held zero is -inf
    return value - 0.5 * float(off @ off), gradient - off / deviation


def limits(data: Rows) -> tuple[Array, Array]:
    """Returns where the search of theta begins (p,) and its limits (p, 2)."""
    spread = data.spread[:1] if data.isotropic else data.spread
    unit = np.log(np.concatenate([spread, [data.scale, data.scale]]))
    lengths = len(spread)
    near = np.sqrt(data.inputs.shape[1])
    start = unit + np.log([*[near] * lengths, 1.0, _START_NOISE])
    widths = np.log([*[_LENGTHS] * lengths, _AMPLITUDES, _NOISES])
    return start, unit[:, None] + widths


def left_out(data: Rows, theta: Array) -> tuple[Array, Array]:
    """Returns residual (n, k) and variance (n,) of every row predicted from all others."""
    return solved_rows(data, theta, signal_covariance(data, theta)).left_out()


def posterior_of(data: Rows, theta: Array, solved: Solved) -> Posterior:
    """Returns the process given its rows, ready for prediction."""
    length, amplitude, _ = split(theta, data.inputs.shape[1])
    return posterior(
        solved,
        data.inputs,
        data.centre,
        length,
        amplitude,
        np.full(len(data.inputs), amplitude**2),
        np.ones(data.trend().shape[1]),
    )
