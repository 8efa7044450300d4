"""One MAP estimator for every calibration: Gauss-Newton over named blocks with Gaussian priors.

At a linearisation the posterior of the step x is Gaussian with precision

    A = diag(1 / sd^2) + sum_i u_i J_i^T N_i^-1 J_i,      N_i = C_i + sum_c noise_c diag(white_c)

Robust weights u, the white noise and the prior scales are iterated to their joint fixed point on
the linear problem (MacKay 1992, "The evidence framework", eq. 4.9-4.10, for scales and noise by the
gradient of the evidence); then the state moves and everything is linearised again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dtrtri

from robotrue.calibration.observations import (
    CHANNELS,
    Linearisation,
    Observation,
    join_chunks,
    linearise_all,
)
from robotrue.calibration.parameters import ParameterLayout, State, difference, retract
from robotrue.calibration.scale_learning import scale_groups
from robotrue.calibration.settings import Prior, SolverSettings
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.robust import Loss, consistency, robust_variance, weights
from robotrue.errors import ConvergenceError, ObservabilityError

INNER: Final = 60
"""Scale updates per linearisation."""
SETTLED: Final = 5e-3
"""Relative change of variances, and of weights, that ends them."""
LEARNING: Final = 15
"""Linearisations that move scales, noise and weights; what still moves then is posture alone."""
STILL: Final = 1e-2
"""Change of the predicted numbers of any row, over their noise, below which the fit has settled."""
LEAST_DAMPING: Final = 1.0
MOST_DAMPING: Final = 1e15
"""Of a step, in prior precisions: the first tried, and the one at which no step is left."""
OVERSHOT: Final = 0.6
"""Share of a step with the least misfit below which the step is shortened to it."""
NOISE_FLOOR: Final = 1e-18
"""m^2 or rad^2: below a nanometre noise means nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """Result of the estimator.

    Attributes:
        layout: The parameter vector.
        state: MAP point.
        prior: With the learned scales.
        covariance: (P, P) of the step about ``state``, SI; zero where fixed.
        information: (P, P) J^T W J of the data alone, zero where fixed.
        noise: (2,) learned white variance of lengths (m^2) and angles (rad^2), per axis.
        residuals: Per observation (n, m) m or rad.
        weights: Per observation (n,) robust weight; 0 is screened out.
        chi2: Sum of the weighted whitened squares.
        numbers: Count of numbers with weight above zero.
        evidence: Log marginal likelihood of the linearised problem, screened rows left out.
        iterations: Linearisations used.
    """

    layout: ParameterLayout
    state: State
    prior: Prior
    covariance: Array
    information: Array
    noise: Array
    residuals: tuple[Array, ...]
    weights: tuple[Array, ...]
    chi2: float
    numbers: int
    evidence: float
    iterations: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """A state and the rows linearised there."""

    state: State
    data: tuple[Linearisation, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scales:
    """Scales that the inner loop updates besides the step."""

    noise: Array
    sd: Array
    weights: tuple[Array, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Solution:
    """Solution of one linear problem."""

    step: Array
    right: Array
    scaled_covariance: Array
    information: Array
    whitened: tuple[Array, ...]
    lengths: tuple[Array, ...]
    noise_trace: Array
    noise_power: Array
    log_noise: float
    log_precision: float


def maximise(
    observations: Sequence[Observation],
    prior: Prior,
    layout: ParameterLayout,
    settings: SolverSettings,
) -> Posterior:
    """Returns the MAP point, its covariance and the learned scales.

    Args:
        observations: At least one, with at least one row.
        prior: Its centre is the starting point.
        layout: The parameter vector.
        settings: Robust rule, learning, tolerance.

    Raises:
        ObservabilityError: No rows, or no free parameter.
        ConvergenceError: Still moving after ``max_iterations``, or no step lowers the misfit.
    """
    if not any(len(o.rows) for o in observations) or not prior.free.any():
        raise ObservabilityError(
            f"nothing to estimate: {sum(len(o.rows) for o in observations)} rows, "
            f"{int(prior.free.sum())} free parameters."
        )
    centre, free = prior.centre, prior.free
    point = _Point(state=centre, data=linearise_all(observations, layout, centre))
    scales = _first_scales(point.data, prior, free, settings)
    damping = 0.0
    for iteration in range(1, settings.max_iterations + 1):
        offset = difference(layout, point.state, centre)[free]
        if iteration <= LEARNING:
            scales, solution = _settle(point.data, offset, prior, free, scales, settings)
        else:  # long steps and scales may chase each other; held scales leave one misfit to lower
            solution = _solve(point.data, offset, free, scales, settings)
        change = _position_change(point.data, solution, free, scales)
        point, step, damping = _descend(
            observations, prior, layout, point, scales, solution, damping, iteration
        )
        size = float(np.max(np.abs(step) / _posterior_sd(solution, scales)))
        if (size < settings.tolerance and damping == 0.0) or change < STILL:
            offset = difference(layout, point.state, centre)[free]
            solution = _solve(point.data, offset, free, scales, settings)
            return _finish(point, observations, layout, prior, scales, solution, iteration)
        damping = 0.0 if damping < LEAST_DAMPING else damping / 10.0
    raise ConvergenceError(
        f"still moving after {settings.max_iterations} iterations: the next step moves a predicted "
        f"number by {change:.2g} of its noise, allowed {STILL:g}.",
        hint="check units, joint signs and the reflector, or allow more iterations.",
    )


def _descend(
    observations: Sequence[Observation],
    prior: Prior,
    layout: ParameterLayout,
    point: _Point,
    scales: _Scales,
    solution: _Solution,
    damping: float,
    iteration: int,
) -> tuple[_Point, Array, float]:
    """Returns the next point, its step over the free parameters, and the damping it took."""
    centre, free = prior.centre, prior.free

    def try_step(step: Array) -> tuple[_Point, float]:
        whole = np.zeros(layout.size)
        whole[free] = step
        state = retract(layout, point.state, whole)
        data = linearise_all(observations, layout, state)
        misfit = _objective(data, difference(layout, state, centre)[free], scales)
        return _Point(state=state, data=data), misfit

    before = _objective(point.data, difference(layout, point.state, centre)[free], scales)
    allowed = before * (1.0 + 1e-9) + 1e-9
    while damping < MOST_DAMPING:
        step = _solve_damped(solution.information, solution.right, scales.sd, damping)
        trial, after = try_step(step)
        if after > allowed:  # the same step, bent along the valley
            bend = scales.sd * _curvature(point.data, trial.data, step, free, scales)
            step = step + _solve_damped(solution.information, bend, scales.sd, damping)
            trial, after = try_step(step)
        if after <= allowed:
            # Steps that overshoot jump to and fro over the lowest point and gain next to nothing.
            fall = float(step @ (solution.right / scales.sd))
            curve = after - before + 2.0 * fall  # of the parabola through both ends
            if 0.0 < fall < OVERSHOT * curve:
                shorter = fall / curve * step
                nearer, least = try_step(shorter)
                if least < after:
                    return nearer, shorter, damping
            return trial, step, damping
        damping = max(10.0 * damping, LEAST_DAMPING)
    raise ConvergenceError(
        f"no step lowers the misfit (iteration {iteration}).",
        hint="check units, joint signs and the tracker frame of the measurements.",
    )


def _curvature(
    data: Sequence[Linearisation],
    moved: Sequence[Linearisation],
    step: Array,
    free: BoolArray,
    scales: _Scales,
) -> Array:
    """J' N^-1 (what a step did to the residuals beyond its linear part), per free parameter."""
    out = np.zeros(len(step))
    for item, there, u in zip(data, moved, scales.weights, strict=True):
        inverse, _ = _whitener(item, scales.noise)
        jacobian = item.jacobian[:, :, free]
        beyond = there.residual - item.residual + jacobian @ step
        force = np.swapaxes(inverse, 1, 2) @ (inverse @ beyond[:, :, None]) * u[:, None, None]
        out += np.einsum("nmp,nm->p", jacobian, force[:, :, 0])
    return out


def _position_change(
    data: Sequence[Linearisation], solution: _Solution, free: BoolArray, scales: _Scales
) -> float:
    """Largest change of a row's predicted numbers by the undamped step, over their noise.

    Along a direction that no row shows, a step of any size changes nothing here: the prior decides.
    """
    largest = 0.0
    for item in data:
        inverse, _ = _whitener(item, scales.noise)
        moved = inverse @ (item.jacobian[:, :, free] @ solution.step)[:, :, None]
        largest = max(largest, float(np.linalg.norm(moved, axis=1).max(initial=0.0)))
    return largest


def _whitener(item: Linearisation, noise: Array) -> tuple[Array, Array]:
    """Inverse Cholesky factors (n, m, m) and log determinants (n,) of the covariances."""
    m = item.residual.shape[1]
    lower = np.linalg.cholesky(item.covariance + (noise @ item.white) * np.eye(m))
    log_det = 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    return np.linalg.inv(lower), log_det


def _solve(
    data: Sequence[Linearisation],
    offset: Array,
    free: BoolArray,
    scales: _Scales,
    settings: SolverSettings,
) -> _Solution:
    """Solves the linear problem at fixed scales, with the sums that noise learning needs."""
    count = len(offset)
    information, gradient = np.zeros((count, count)), np.zeros(count)
    log_noise = 0.0
    kept = []
    for item, u in zip(data, scales.weights, strict=True):
        inverse, log_det = _whitener(item, scales.noise)
        n, m = item.residual.shape
        z0 = (inverse @ item.residual[:, :, None])[:, :, 0]
        jacobian = inverse @ item.jacobian[:, :, free]
        root = np.sqrt(u)[:, None]
        flat = (jacobian * root[:, :, None]).reshape(n * m, count)
        information += flat.T @ flat
        gradient += flat.T @ (z0 * root).reshape(-1)
        log_noise += float(log_det[u > 0.0].sum())
        kept.append((inverse, z0, jacobian))
    sd = scales.sd
    precision = np.eye(count) + sd[:, None] * information * sd
    lower = np.linalg.cholesky(precision)
    inverse_lower, _ = dtrtri(lower, lower=1)
    scaled_covariance = inverse_lower.T @ inverse_lower
    right = sd * gradient - offset / sd
    step = sd * (inverse_lower.T @ (inverse_lower @ right))
    whitened = tuple(z0 - jacobian @ step for _, z0, jacobian in kept)
    trace, power = np.zeros(CHANNELS), np.zeros(CHANNELS)
    if settings.learn_noise:
        covariance = sd[:, None] * scaled_covariance * sd
        for item, u, (inverse, _, jacobian), z in zip(
            data, scales.weights, kept, whitened, strict=True
        ):
            sums = _noise_sums(item, u, inverse, jacobian, z, covariance, settings.loss)
            power, trace = power + sums[0], trace + sums[1]
    return _Solution(
        step=step,
        right=right,
        scaled_covariance=scaled_covariance,
        information=information,
        whitened=whitened,
        lengths=tuple(np.linalg.norm(z, axis=1) for z in whitened),
        noise_trace=trace,
        noise_power=power,
        log_noise=log_noise,
        log_precision=2.0 * float(np.log(np.diagonal(lower)).sum()),
    )


def _noise_sums(
    item: Linearisation,
    u: Array,
    inverse: Array,
    jacobian: Array,
    z: Array,
    covariance: Array,
    loss: Loss,
) -> tuple[Array, Array]:
    """Returns per white variance of some rows the power (2,) of N^-1 r and its expected trace.

    Args:
        item: The rows.
        u: (n,) their weights.
        inverse: (n, m, m) inverse Cholesky factor of N.
        jacobian: (n, m, p) whitened.
        z: (n, m) whitened residual after the step.
        covariance: (p, p) of the step.
        loss: The robust rule.
    """
    back = np.swapaxes(inverse, 1, 2)
    force = (back @ z[:, :, None])[:, :, 0]  # N^-1 r
    pull = back @ jacobian  # N^-1 J
    flat = pull.reshape(-1, len(covariance))  # one product, not one per row
    spread = np.einsum("kp,kp->k", flat @ covariance, flat).reshape(z.shape)
    diagonal = np.einsum("nkm,nkm->nm", inverse, inverse)  # diag N^-1
    live = consistency(z.shape[1], loss) * (u > 0.0)[:, None]
    power = item.white @ (u[:, None] * force**2).sum(axis=0)
    return power, item.white @ (live * diagonal - u[:, None] * spread).sum(axis=0)


def _first_scales(
    data: Sequence[Linearisation], prior: Prior, free: BoolArray, settings: SolverSettings
) -> _Scales:
    """Scales to start from: full weights, and noise read off the median row of a plain fit."""
    noise = np.zeros(CHANNELS)
    for item in data:
        if not np.isfinite(item.residual).all():
            raise ObservabilityError("a residual is not finite.", hint="look for NaN in the data.")
    ones = tuple(np.ones(len(item.residual)) for item in data)
    scales = _Scales(noise=np.full(CHANNELS, NOISE_FLOOR), sd=prior.sd[free], weights=ones)
    if not settings.learn_noise:
        return replace(scales, noise=noise)
    plain = replace(settings, learn_noise=False)
    solution = _solve(data, np.zeros(int(free.sum())), free, scales, plain)
    for channel in range(CHANNELS):
        lengths, typical = [], []
        for item in data:
            mine = np.flatnonzero(item.white[channel])
            if len(mine):
                rest = item.residual[:, mine] - item.jacobian[:, mine][:, :, free] @ solution.step
                spread = float(item.white[channel, mine[0]])
                lengths.append(np.linalg.norm(rest, axis=1) / np.sqrt(spread))
                typical.append(len(mine))
        if lengths:
            noise[channel] = robust_variance(np.concatenate(lengths), min(typical))
    return replace(scales, noise=np.maximum(noise, NOISE_FLOOR))


def _settle(
    data: Sequence[Linearisation],
    offset: Array,
    prior: Prior,
    free: BoolArray,
    scales: _Scales,
    settings: SolverSettings,
) -> tuple[_Scales, _Solution]:
    """Iterates weights, noise and prior scales on the linear problem to their fixed point."""
    instrument = np.array([_instrument(data, channel) for channel in range(CHANNELS)])
    base, group = prior.sd[free], prior.group[free]
    for _ in range(INNER):
        solution = _solve(data, offset, free, scales, settings)
        new_weights = tuple(
            weights(length, z.shape[1], settings.loss)
            for length, z in zip(solution.lengths, solution.whitened, strict=True)
        )
        noise = scales.noise
        if settings.learn_noise:
            ratio = np.where(
                solution.noise_trace > 0.0,
                solution.noise_power
                / np.where(solution.noise_trace > 0.0, solution.noise_trace, 1.0),
                1.0,
            )
            noise = np.maximum(noise * np.clip(ratio, 0.01, 100.0), NOISE_FLOOR)
        sd = scales.sd
        if settings.learn_scales:
            known = 1.0 - np.diagonal(solution.scaled_covariance)
            sd = scale_groups(offset + solution.step, known, base, group)
        change = max(
            float(np.max(np.abs(noise - scales.noise) / (noise + instrument))),
            float(np.max(np.abs(sd / scales.sd - 1.0))),
            max(
                float(np.max(np.abs(a - b), initial=0.0))
                for a, b in zip(new_weights, scales.weights, strict=True)
            ),
        )
        if change < SETTLED:
            break
        scales = _Scales(noise=noise, sd=sd, weights=new_weights)
    return scales, solution


def _instrument(data: Sequence[Linearisation], channel: int) -> float:
    """Mean variance per axis that the covariances state, m^2 or rad^2."""
    parts = [
        np.diagonal(item.covariance, axis1=1, axis2=2)[:, item.white[channel] > 0.0].ravel()
        for item in data
    ]
    known = np.concatenate(parts)
    return max(float(known.mean()) if len(known) else 1.0, NOISE_FLOOR)


def _objective(data: Sequence[Linearisation], offset: Array, scales: _Scales) -> float:
    """Weighted misfit plus prior at fixed scales."""
    return _misfit(data, scales) + float(((offset / scales.sd) ** 2).sum())


def _misfit(data: Sequence[Linearisation], scales: _Scales) -> float:
    """Sum of the weighted whitened squares."""
    total = 0.0
    for item, u in zip(data, scales.weights, strict=True):
        inverse, _ = _whitener(item, scales.noise)
        z = (inverse @ item.residual[:, :, None])[:, :, 0]
        total += float(u @ (z**2).sum(axis=1))
    return total


def _posterior_sd(solution: _Solution, scales: _Scales) -> Array:
    return scales.sd * np.sqrt(np.diagonal(solution.scaled_covariance))


def _solve_damped(information: Array, right: Array, sd: Array, damping: float) -> Array:
    """Step (A + damping)^-1 right in prior-scaled parameters, unscaled.

    Damped by the prior and not by diag A: the arm's nonlinearity shows along directions the data
    do not see, where steps are long; relative to diag A these would be frozen first.
    """
    damped = sd[:, None] * information * sd
    damped[np.diag_indices(len(sd))] += 1.0 + damping
    step: Array = sd * cho_solve(cho_factor(damped, lower=True), right)
    return step


def _finish(
    point: _Point,
    observations: Sequence[Observation],
    layout: ParameterLayout,
    prior: Prior,
    scales: _Scales,
    solution: _Solution,
    iterations: int,
) -> Posterior:
    """Expands the pieces to full, named shape."""
    state, data = point.state, point.data
    free = prior.free
    where = np.ix_(free, free)
    covariance, information = np.zeros((2, layout.size, layout.size))
    covariance[where] = scales.sd[:, None] * solution.scaled_covariance * scales.sd
    information[where] = solution.information
    sd = prior.sd.copy()
    sd[free] = scales.sd
    chi2, numbers = _misfit(data, scales), 0
    for item, u in zip(data, scales.weights, strict=True):
        numbers += int((u > 0.0).sum()) * item.residual.shape[1]
    offset = difference(layout, state, prior.centre)[free]
    evidence = -0.5 * (
        chi2
        + float(((offset / scales.sd) ** 2).sum())
        + solution.log_noise
        + solution.log_precision
        + numbers * float(np.log(2.0 * np.pi))
    )
    return Posterior(
        layout=layout,
        state=state,
        prior=replace(prior, sd=sd),
        covariance=covariance,
        information=information,
        noise=scales.noise,
        residuals=join_chunks([item.residual for item in data], observations),
        weights=join_chunks(list(scales.weights), observations),
        chi2=chi2,
        numbers=numbers,
        evidence=evidence,
        iterations=iterations,
    )
