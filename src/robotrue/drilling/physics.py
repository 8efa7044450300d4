"""The default correction: known causes with learned sizes, a smooth rest, one evidence.

A Gaussian process whose covariance is the sum over the groups of ``physics_prior``. The sensors
share its hyper-parameters and nothing else. With few clamps the groups carry it, with many the rest
learns what they leave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.learners.posterior import Solved, correlation, solve
from robotrue.calibration.learners.search import inflation_factor, search_theta
from robotrue.core.arrays import Array, frozen
from robotrue.drilling.physics_prior import (
    SPREAD,
    WIDTHS,
    bounds,
    fix_values,
    friction_by_rest,
    groups,
    start,
)
from robotrue.drilling.terms import Conditions
from robotrue.errors import ShapeError

_G = len(WIDTHS)


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicsCorrection:
    """The learned error of every sensor.

    Attributes:
        causes: The n clamps it was learned from.
        errors: (n, k) m, their reading errors.
        theta: (17,) log hyper-parameters in the order of ``physics_prior``; -inf: not there.
        widening: Factor on the variance, for hyper-parameters are known no better than few clamps
            tell.
    """

    causes: Conditions
    errors: Array
    theta: Array
    widening: float = 1.0

    def __post_init__(self) -> None:
        """Freezes."""
        n = len(self.causes.a)
        object.__setattr__(self, "errors", frozen(self.errors, (n, None), "errors"))
        theta = np.array(self.theta, dtype=np.float64)
        if theta.shape != SPREAD.shape or np.isnan(theta).any():
            raise ShapeError(f"theta {theta}, expected {SPREAD.size} numbers.")
        if not self.widening > 0.0:
            raise ShapeError(f"widening is {self.widening:g}, expected above 0.")
        theta.flags.writeable = False
        object.__setattr__(self, "theta", theta)

    def predict(self, c: Conditions) -> tuple[Array, Array]:
        """Returns the expected error (m, k) m and its variance (m,) m^2 without the readings' own.

        The sensors share the variance, for they share causes and hyper-parameters.
        """
        solved = _solve_readings(self.theta, self.causes, self.errors)
        across = _signal(self.theta, c, self.causes)
        spread = solved.whitened(across.T)
        own = _own(self.theta, c)
        variance = np.maximum(own - np.sum(spread**2, axis=0), 0.0)
        noise = float(np.exp(2.0 * self.theta[-1]))
        return across @ solved.alpha, variance + (self.widening - 1.0) * (variance + noise)

    @property
    def noise(self) -> Array:
        """(k,) m, deviation of one reading that no cause explains."""
        return np.full(self.errors.shape[1], float(np.exp(self.theta[-1])))


def fit_physics(
    causes: Conditions, errors: Array, reading_sigma: float, *, rest_alone: bool = False
) -> PhysicsCorrection:
    """Returns the correction of largest evidence times prior.

    Args:
        causes: n clamps.
        errors: (n, k) m, measured less theoretical readings.
        reading_sigma: m, scatter of a reading: the prior mean of the noise.
        rest_alone: A plain Gaussian process: offset, smooth rest and noise only.

    Raises:
        ObservabilityError: Clamps too alike for the scatter of the readings.
    """
    mean = start(reading_sigma, rest_alone=rest_alone)
    fixed = fix_values(rest_alone=rest_alone)
    free = np.isnan(fixed)

    def log_posterior(theta: Array) -> tuple[float, Array]:
        value, gradient = log_evidence(theta, causes, errors)
        off = np.where(free, (theta - mean) / SPREAD, 0.0)
        return value - 0.5 * float(off @ off), gradient - off / SPREAD

    def left_out(theta: Array) -> tuple[Array, Array]:
        return _solve_readings(theta, causes, errors).left_out()

    limits = bounds(mean)
    theta = search_theta(log_posterior, mean, limits, fixed, 0, np.random.RandomState(0))
    widening = inflation_factor(log_posterior, left_out, theta, limits, free)
    return PhysicsCorrection(causes=causes, errors=errors, theta=theta, widening=widening)


def log_evidence(theta: Array, causes: Conditions, errors: Array) -> tuple[float, Array]:
    """Returns the log evidence of all sensors and its gradient (17,) by theta."""
    fading, place = _friction_of(theta)
    columns = groups(causes, fading, place)
    parts = [np.exp(2.0 * width) * (g @ g.T) for width, g in zip(theta[:_G], columns, strict=True)]
    rest = _rest(theta, causes, causes)
    noise = float(np.exp(2.0 * theta[-1]))
    n = len(errors)
    covariance = np.add.reduce(parts) + rest + noise * np.eye(n)
    solved = solve(covariance, errors, np.empty((n, 0)))
    half = 0.5 * solved.sensitivity()
    gradient = np.empty(len(theta))
    gradient[:_G] = [2.0 * np.sum(half * part) for part in parts]
    weighted = half * rest
    gradient[_G] = 2.0 * weighted.sum()
    z = causes.table / np.exp(theta[_G + 1 : _G + 5])
    gradient[_G + 1 : _G + 5] = 2.0 * (
        weighted.sum(axis=0) @ z**2 - np.einsum("ij,ij->j", z, weighted @ z)
    )
    faded = (causes.force[:, None] + causes.force) / fading
    gradient[_G + 5] = np.sum(half * parts[-1] * faded)
    moved = friction_by_rest(causes, fading, place)
    turned = 2.0 * np.exp(2.0 * theta[_G - 1]) * (half @ columns[-1])
    gradient[_G + 6 : _G + 8] = np.einsum("inj,nj->i", moved, turned)
    gradient[-1] = 2.0 * noise * np.trace(half)
    return solved.log_evidence, gradient


def prior_covariance(theta: Array, c: Conditions) -> Array:
    """Returns the covariance (n, n) m^2 of the errors at causes before any is measured."""
    return _signal(theta, c, c)


def _solve_readings(theta: Array, causes: Conditions, errors: Array) -> Solved:
    covariance = _signal(theta, causes, causes) + np.exp(2.0 * theta[-1]) * np.eye(len(errors))
    return solve(covariance, errors, np.empty((len(errors), 0)))


def _signal(theta: Array, c: Conditions, other: Conditions) -> Array:
    """(m, n) covariance of what is not noise between two sets of clamps."""
    own, others = (groups(each, *_friction_of(theta)) for each in (c, other))
    out = _rest(theta, c, other)
    for width, g, h in zip(theta[:_G], own, others, strict=True):
        out += np.exp(2.0 * width) * (g @ h.T)
    return out


def _own(theta: Array, c: Conditions) -> Array:
    """(m,) variance of what is not noise."""
    out = np.full(len(c.a), np.exp(2.0 * theta[_G]))
    for width, g in zip(theta[:_G], groups(c, *_friction_of(theta)), strict=True):
        out += np.exp(2.0 * width) * np.sum(g**2, axis=1)
    return out


def _friction_of(theta: Array) -> tuple[float, Array]:
    """F_0 in kN and the rest position (2,) deg."""
    return float(np.exp(theta[_G + 5])), theta[_G + 6 : _G + 8]


def _rest(theta: Array, c: Conditions, other: Conditions) -> Array:
    """(m, n) covariance of the smooth rest."""
    length = np.exp(theta[_G + 1 : _G + 5])
    out: Array = np.exp(2.0 * theta[_G]) * correlation(c.table / length, other.table / length)
    return out
