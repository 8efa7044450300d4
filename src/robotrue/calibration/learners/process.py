"""Squared exponential process with white noise: of one domain, or of a target and its source.

    one domain    K = a^2 E + noise
    two domains   f_source = g,   f_target = rho g + h,   g and h independent, amplitudes a and b:
                  K = E times a^2 (both source), rho a^2 (one of each), rho^2 a^2 + b^2 (both
                  target), + noise of each domain
    E = exp(-sum_j (x_j - x'_j)^2 / (2 l_j^2)),   noise = diag((s^2 + v_i) / w_i)

theta = [log l_1 .. log l_d (one for all when isotropic), log a, log s], or with a source [log l ..,
log a, log b, rho, log s_target, log s_source]: lengths in the unit of the inputs, amplitudes and
noise in that of the outputs; v_i noise variance and w_i weight of row i.

Source: Kennedy and O'Hagan, Predicting the output from a complex computer code when fast
approximations are available, Biometrika 87 (2000), eq. 1-2, with lengths in common.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.learners.posterior import (
    ProcessPosterior,
    Solved,
    build_posterior,
    correlation,
    solve,
)
from robotrue.core.arrays import Array, BoolArray

_LENGTHS, _AMPLITUDES, _NOISES = (2e-2, 1e2), (1e-2, 1e2), (1e-4, 1e1)
"""What is searched, in standard deviations of the inputs and of the outputs."""
_START_NOISE = 0.1
_START_RHO, _RHO_LIMIT = 1.0, 3.0
_START_DIFFERENCE, _LEAST_DIFFERENCE = 0.3, 1e-3
_PRIOR_LENGTH, _PRIOR_AMPLITUDE, _PRIOR_NOISE, _PRIOR_RHO = 1.0, 1.5, 2.0, 1.0
"""Standard deviations of the weak prior on log length, log amplitude, log noise, and rho."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingRows:
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
        mean: "constant" or "per-domain" (integrated out), "estimated" or "zero".
        repeats: A row of weight w counts as w equal rows, also in the evidence.
        prior: Whether theta has the weak prior.
        target: (n,) which rows are of the target; all without a source.
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
    target: BoolArray

    @property
    def paired(self) -> bool:
        """True if there are rows of a source."""
        return not self.target.all()

    def trend(self) -> Array:
        """Returns the columns of the constant means (n, q): none, one, or source and target."""
        if self.mean == "per-domain" and self.paired:
            return np.column_stack([~self.target, self.target]).astype(np.float64)
        return np.ones((len(self.inputs), 0 if self.mean == "zero" else 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessParts:
    """Kernel parameters decoded from theta.

    Attributes:
        length: (d,).
        coupling: (2, 2) covariance of the functions of source and target at one place.
        noise: (2,) standard deviation, of source and target.
        rho: Factor of the source in the target; NaN without one.
        difference: Standard deviation of the target's difference from the source; NaN without a
            source.
    """

    length: Array
    coupling: Array
    noise: Array
    rho: float = float("nan")
    difference: float = float("nan")

    @property
    def amplitude(self) -> float:
        """Standard deviation of the target's function."""
        return float(np.sqrt(self.coupling[1, 1]))


def centre_rows(
    inputs: Array,
    outputs: Array,
    weight: Array,
    variance: Array | None = None,
    *,
    isotropic: bool,
    mean: str,
    prior: bool,
    repeats: bool = False,
    target: BoolArray | None = None,
) -> TrainingRows:
    """Returns training rows (n, d), (n, k) with centre and spread; no rows of zero weight."""
    used = weight > 0.0
    inputs, outputs, weight = inputs[used], outputs[used], weight[used]
    share = weight / weight.sum()
    centre = share @ inputs
    spread = np.sqrt(share @ (inputs - centre) ** 2)
    if isotropic:
        spread = np.full_like(spread, np.sqrt(np.mean(spread**2)))
    about = 0.0 if mean == "zero" else share @ outputs
    scale = float(np.sqrt(np.mean(share @ (outputs - about) ** 2)))
    tiny = np.finfo(np.float64).eps
    return TrainingRows(
        inputs=inputs - centre,
        outputs=outputs,
        weight=weight,
        variance=np.zeros(len(weight)) if variance is None else variance[used],
        centre=centre,
        spread=np.where(spread > tiny * (1.0 + np.abs(centre)), spread, 1.0),
        scale=scale if scale > tiny * float(np.abs(outputs).max(initial=0.0)) else 1.0,
        isotropic=isotropic,
        mean=mean,
        repeats=repeats,
        prior=prior,
        target=np.ones(len(weight), dtype=bool) if target is None else target[used],
    )


def split_theta(data: TrainingRows, theta: Array) -> ProcessParts:
    """Returns theta by name."""
    others = 5 if data.paired else 2
    length = np.broadcast_to(np.exp(theta[:-others]), (data.inputs.shape[1],))
    if not data.paired:
        amplitude, noise = np.exp(theta[-2:])
        coupling = np.full((2, 2), amplitude**2)
        return ProcessParts(length=length, coupling=coupling, noise=np.full(2, noise))
    source, difference = np.exp(theta[-5:-3])
    rho = float(theta[-3])
    share = np.array([1.0, rho])
    coupling = source**2 * np.outer(share, share) + np.diag([0.0, difference**2])
    return ProcessParts(
        length=length,
        coupling=coupling,
        noise=np.exp(theta[[-1, -2]]),
        rho=rho,
        difference=float(difference),
    )


def correlate_rows(data: TrainingRows, theta: Array) -> Array:
    """Returns the correlation E of all rows, (n, n)."""
    z = data.inputs / split_theta(data, theta).length
    near = correlation(z, z)
    np.fill_diagonal(near, 1.0)
    return near


def _couple(data: TrainingRows, coupling: Array, near: Array) -> Array:
    """Returns a matrix over the rows (n, n) times the covariance of their domains."""
    if not data.paired:
        return np.asarray(near * coupling[1, 1])
    domain = data.target.astype(np.int64)
    return np.asarray(near * coupling[np.ix_(domain, domain)])


def solve_rows(data: TrainingRows, theta: Array, near: Array | None = None) -> Solved:
    """Returns the rows solved against their covariance.

    Args:
        data: The rows.
        theta: (p,).
        near: Their correlation, where it is at hand.

    Raises:
        ObservabilityError: Rows that coincide and carry no noise.
    """
    parts = split_theta(data, theta)
    near = correlate_rows(data, theta) if near is None else near
    total = _couple(data, parts.coupling, near)
    white = parts.noise[data.target.astype(np.int64)] ** 2
    total.flat[:: len(total) + 1] += (white + data.variance) / data.weight
    return solve(total, data.outputs, data.trend(), integrated=data.mean != "estimated")


def log_evidence(data: TrainingRows, theta: Array) -> tuple[float, Array]:
    """Returns log p(outputs | theta) and its gradient by theta.

    Raises:
        ObservabilityError: Rows that coincide and carry no noise.
    """
    parts, near = split_theta(data, theta), correlate_rows(data, theta)
    solved = solve_rows(data, theta, near)
    sensitivity = solved.sensitivity()
    near *= sensitivity
    whole = _couple(data, parts.coupling, near)
    z = data.inputs / parts.length
    by_length = whole.sum(axis=0) @ z**2 - np.einsum("ij,ij->j", z, whole @ z)
    if data.isotropic:
        by_length = by_length.sum(keepdims=True)
    domains = np.stack([~data.target, data.target]).astype(np.float64)
    by_noise = parts.noise**2 * (domains @ (sensitivity.diagonal() / data.weight))
    if data.repeats:
        white = parts.noise[1] ** 2
        more = (data.weight - 1.0) * white / (white + data.variance)
        by_noise[1] -= data.outputs.shape[1] * float(more.sum())
    others = [whole.sum(), by_noise[1]]
    if data.paired:
        (of_source, both), (_, of_target) = domains @ near @ domains.T
        rho, square = parts.rho, parts.coupling[0, 0]
        others = [
            square * (of_source + 2.0 * rho * both + rho**2 * of_target),
            parts.difference**2 * of_target,
            square * (both + rho * of_target),
            by_noise[1],
            by_noise[0],
        ]
    return weigh_evidence(data, theta, solved), np.concatenate([by_length, others])


def weigh_evidence(data: TrainingRows, theta: Array, solved: Solved) -> float:
    """Returns log p(outputs | theta); with ``repeats``, of every row as often as its weight.

    N(y; f, s^2)^w = N(y; f, s^2 / w) (2 pi s^2)^((1 - w) / 2) w^(-1 / 2).
    """
    if not data.repeats:
        return solved.log_evidence
    each = np.exp(2.0 * theta[-1]) + data.variance
    extra = (data.weight - 1.0) * np.log(2.0 * np.pi * each) + np.log(data.weight)
    return solved.log_evidence - float(0.5 * data.outputs.shape[1] * extra.sum())


def log_posterior(data: TrainingRows, theta: Array) -> tuple[float, Array]:
    """Returns log evidence plus log prior of theta, up to a constant, and the gradient.

    The weak prior is log-normal (of rho: normal) about where the search begins.
    """
    value, gradient = log_evidence(data, theta)
    if not data.prior:
        return value, gradient
    start, _ = start_and_bounds(data)
    others = [_PRIOR_AMPLITUDE, _PRIOR_NOISE]
    if data.paired:
        others = [_PRIOR_AMPLITUDE, _PRIOR_AMPLITUDE, _PRIOR_RHO, _PRIOR_NOISE, _PRIOR_NOISE]
    lengths = [_PRIOR_LENGTH] * (len(theta) - len(others))
    deviation = np.array([*lengths, *others])
    off = np.where(np.isfinite(theta), (theta - start) / deviation, 0.0)  # a held zero is -inf
    return value - 0.5 * float(off @ off), gradient - off / deviation


def start_and_bounds(data: TrainingRows) -> tuple[Array, Array]:
    """Returns where the search of theta begins (p,) and its limits (p, 2)."""
    spread = data.spread[:1] if data.isotropic else data.spread
    unit = np.log(np.concatenate([spread, [data.scale, data.scale]]))
    lengths = len(spread)
    near = np.sqrt(data.inputs.shape[1])
    start = unit + np.log([*[near] * lengths, 1.0, _START_NOISE])
    bounds = unit[:, None] + np.log([*[_LENGTHS] * lengths, _AMPLITUDES, _NOISES])
    if not data.paired:
        return start, bounds
    amplitude, noise = start[-2], start[-1]
    own = amplitude + np.log(_START_DIFFERENCE)
    least = [amplitude + np.log(_LEAST_DIFFERENCE), bounds[-2, 1]]
    ends = [*bounds[:-1], least, [-_RHO_LIMIT, _RHO_LIMIT], bounds[-1], bounds[-1]]
    return np.array([*start[:-1], own, _START_RHO, noise, noise]), np.array(ends)


def left_out_rows(data: TrainingRows, theta: Array) -> tuple[Array, Array]:
    """Returns residual (m, k) and variance (m,) of target rows, each from all other rows.

    Of source rows where the only target row is needed for the target's own mean.
    """
    lonely = data.mean == "per-domain" and data.paired and data.target.sum() == 1
    chosen = ~data.target if lonely else data.target
    return solve_rows(data, theta).predict_left_out(chosen)


def process_posterior(
    data: TrainingRows, theta: Array, solved: Solved | None = None
) -> ProcessPosterior:
    """Returns the target's process given all rows, ready for prediction."""
    parts = split_theta(data, theta)
    return build_posterior(
        solve_rows(data, theta) if solved is None else solved,
        data.inputs,
        data.centre,
        parts.length,
        parts.amplitude,
        parts.coupling[1, data.target.astype(np.int64)],
        data.trend()[data.target][0],
    )
