"""The default correction: known causes with learned sizes, a smooth residual, one evidence.

A Gaussian process. The sensors share its hyper-parameters and nothing else. With few clamps the
groups carry it; with many the residual learns the remainder.

The error of each sensor is a sum of groups, each a few columns with independent normal coefficients
of one deviation per group, a smooth residual, and noise:

    1; a, b; F; z; F a, F b; F^2; a^2, a b, b^2; (1, t_a, t_b) exp(-F / F_0); residual; noise.

Each machine position that is an input is one more group of one column and one more cause of the
residual.

t is the direction of the tilt from where the foot hangs at rest, (a_0, b_0). The foot is free when
it meets the skin and turns towards it until the joint's friction stops it: it lags by an angle that
the growing clamp force reduces, along its turn. That is the group with exp(-F / F_0); no polynomial
has its edge at rest.

The deviations are learned by the evidence, with priors for typical feet: offsets of tenths of a
millimetre, a fifth of that per degree, almost nothing from the height.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.learners.posterior import Solved, correlation, solve
from robotrue.calibration.learners.search import inflation_factor, search_theta
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM, UM
from robotrue.drilling.campaign import Conditions
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Position
from robotrue.errors import ShapeError

WIDTHS: Final = np.log(np.array([1.0, 0.1, 0.5, 0.02, 0.05, 0.2, 0.0025, 0.1]) * MM)
"""Log deviation of the coefficients of offset, tilt, force, height, force x tilt, force^2, tilt^2
and friction, m per unit of the column, where the search begins."""
_G: Final = len(WIDTHS)
REST_AMPLITUDE: Final = 10.0 * UM
WIDE: Final = 0.2 * MM
REST: Final = np.log(np.array([REST_AMPLITUDE, 4.0, 4.0, 1.0, 7.0]))
"""Log amplitude (m) and lengths (deg, deg, kN, 100 mm) of the smooth residual."""
FADING: Final = float(np.log(0.6))
"""Log of F_0 in kN."""
SPREAD: Final = np.array([1.0] * len(WIDTHS) + [1.0, 0.7, 0.7, 0.7, 1.0, 0.5, 0.3, 0.3, 0.7])
"""Deviation of the prior of each of theta: log widths, rest, F_0; a_0 and b_0 in deg; log noise."""
_NOISE: Final = len(SPREAD) - 1
"""Index of the log noise; after it the log widths of the inputs, then their log lengths."""
INPUT: Final = np.log(np.array([0.03 * MM, 3.0]))
"""Log width (m per unit) and log length (units) of a machine position: 30 deg, 3 m."""
INPUT_SPREAD: Final = np.array([1.0, 0.7])
STILL: Final = 0.02  # deg: a tilt seen smaller than this has no sure direction


def groups(c: Conditions, fading: float, rest: Array) -> list[Array]:
    """Returns the columns (n, .) of each group, in the order of :data:`WIDTHS`.

    Args:
        c: Causes of n clamps.
        fading: kN, clamp force that takes the friction's share down to 1/e.
        rest: (2,) deg, tilt the readings show where the foot hangs at rest.
    """
    a, b, force, one = c.a, c.b, c.force, np.ones_like(c.a)
    parts = (
        [one],
        [a, b],
        [force],
        [c.height],
        [force * a, force * b],
        [force**2],
        [a * a, a * b, b * b],
    )
    return [*(np.stack(part, axis=-1) for part in parts), _friction(c, fading, rest)[0]]


def friction_by_rest(c: Conditions, fading: float, rest: Array) -> Array:
    """Returns the derivative (2, n, 3) of the friction columns by the rest position, 1/deg."""
    columns, x, y, size = _friction(c, fading, rest)
    fades = columns[:, 0]
    by_a = np.stack([-(y**2 + STILL**2), x * y], axis=-1)
    by_b = np.stack([x * y, -(x**2 + STILL**2)], axis=-1)
    out = np.zeros((2, len(x), 3))
    out[:, :, 1:] = (fades / size**3)[:, None] * np.stack([by_a, by_b])
    return out


def _friction(c: Conditions, fading: float, rest: Array) -> tuple[Array, Array, Array, Array]:
    """Returns friction columns (n, 3), travel (n,) in a and b from rest, and its length."""
    x, y = c.a - rest[0], c.b - rest[1]
    size = np.sqrt(x**2 + y**2 + STILL**2)
    fades = np.exp(-c.force / fading)
    return np.stack([fades, fades * x / size, fades * y / size], axis=-1), x, y, size


def start(reading_sigma: float, *, rest_alone: bool, inputs: int = 0) -> Array:
    """Returns theta (17 + 2 inputs,) where the search begins: its prior mean.

    With ``rest_alone`` the smooth residual replaces the groups: all groups but the offset are zero,
    and the residual starts as wide as the error.
    """
    rest = REST + np.array([np.log(WIDE / REST_AMPLITUDE), 0.0, 0.0, 0.0, 0.0]) * rest_alone
    base = [WIDTHS, rest, [FADING, 0.0, 0.0, np.log(reading_sigma)]]
    return np.concatenate([*base, np.repeat(INPUT, inputs)])


def fix_values(*, rest_alone: bool, inputs: int = 0) -> Array:
    """Returns theta (17 + 2 inputs,): the values that are not learned, NaN where they are."""
    out = np.full(len(SPREAD) + 2 * inputs, np.nan)
    if rest_alone:
        out[1 : len(WIDTHS)] = -np.inf
        out[len(WIDTHS) + 5 : _NOISE] = FADING, 0.0, 0.0
        out[_NOISE + 1 : _NOISE + 1 + inputs] = -np.inf
    return out


def prior_spread(inputs: int) -> Array:
    """Returns the deviation (17 + 2 inputs,) of the prior of theta."""
    return np.concatenate([SPREAD, np.repeat(INPUT_SPREAD, inputs)])


def bounds(mean: Array) -> Array:
    """Returns the limits (p, 2) of theta: four deviations of the prior on either side."""
    spread = prior_spread((len(mean) - len(SPREAD)) // 2)
    return np.stack([mean - 4.0 * spread, mean + 4.0 * spread], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicsCorrection(Columns):
    """The learned error of every sensor.

    Attributes:
        causes: The n clamps it was learned from.
        errors: (n, k) m, their reading errors.
        theta: (17 + 2 inputs,) log hyper-parameters in the order of :data:`SPREAD`, then widths and
            lengths of the inputs; -inf: absent.
        widening: Factor on the variance, because few clamps determine the hyper-parameters poorly.
        inputs: Machine positions among the causes.
        corrects: What the errors are of.
    """

    causes: Annotated[Conditions, Column("n")]
    errors: Annotated[Array, Column("n k", unit="m")]
    theta: Annotated[Array, Column("t", inf=True)]
    widening: float = 1.0
    inputs: tuple[Position, ...] = ()
    corrects: Corrects = CORRECTS

    def _check_rules(self) -> None:
        """Checks the values."""
        if not self.widening > 0.0:
            raise ShapeError(f"widening is {self.widening:g}, expected above 0.")
        expected = len(SPREAD) + 2 * len(self.inputs)
        if len(self.theta) != expected:
            raise ShapeError(f"theta has {len(self.theta)} values, expected {expected}.")

    def predict(self, c: Conditions) -> tuple[Array, Array]:
        """Returns the expected error (m, k) m and its variance (m,) m^2 without the readings' own.

        The sensors share the variance, for they share causes and hyper-parameters.
        """
        known = signal_covariance(self.theta, self.causes, self.causes, self.inputs)
        solved = _solve_errors(self.theta, known, self.errors)
        across = signal_covariance(self.theta, c, self.causes, self.inputs)
        spread = solved.whiten_rows(across.T)
        own = _own(self.theta, c, self.inputs)
        variance = np.maximum(own - np.sum(spread**2, axis=0), 0.0)
        noise = float(np.exp(2.0 * self.theta[_NOISE]))
        return across @ solved.alpha, variance + (self.widening - 1.0) * (variance + noise)

    @property
    def noise(self) -> Array:
        """(k,) m, deviation of one reading that no cause explains."""
        return np.full(self.errors.shape[1], float(np.exp(self.theta[_NOISE])))


def fit_physics(
    causes: Conditions,
    errors: Array,
    reading_sigma: float,
    *,
    rest_alone: bool = False,
    inputs: tuple[Position, ...] = (),
    corrects: Corrects = CORRECTS,
) -> PhysicsCorrection:
    """Returns the correction of largest evidence times prior.

    Args:
        causes: n clamps.
        errors: (n, k) m, measured less theoretical readings.
        reading_sigma: m, scatter of a reading: the prior mean of the noise.
        rest_alone: A plain Gaussian process: offset, smooth residual and noise only.
        inputs: Machine positions among the causes.
        corrects: What the errors are of.

    Raises:
        ObservabilityError: Clamps too alike for the scatter of the readings.
    """
    mean = start(reading_sigma, rest_alone=rest_alone, inputs=len(inputs))
    fixed = fix_values(rest_alone=rest_alone, inputs=len(inputs))
    free, width = np.isnan(fixed), prior_spread(len(inputs))

    def log_posterior(theta: Array) -> tuple[float, Array]:
        value, gradient = log_evidence(theta, causes, errors, inputs)
        off = np.where(free, (theta - mean) / width, 0.0)
        return value - 0.5 * float(off @ off), gradient - off / width

    def leave_out(theta: Array) -> tuple[Array, Array]:
        covariance = signal_covariance(theta, causes, causes, inputs)
        return _solve_errors(theta, covariance, errors).predict_left_out()

    limits = bounds(mean)
    theta = search_theta(log_posterior, mean, limits, fixed)
    widening = inflation_factor(log_posterior, leave_out, theta, limits, free)
    return PhysicsCorrection(
        causes=causes,
        errors=errors,
        theta=theta,
        widening=widening,
        inputs=inputs,
        corrects=corrects,
    )


def log_evidence(
    theta: Array, causes: Conditions, errors: Array, inputs: tuple[Position, ...] = ()
) -> tuple[float, Array]:
    """Returns the log evidence of all sensors and its gradient (17 + 2 inputs,) by theta."""
    fading, place = _friction_of(theta)
    parts, rest = _covariance_parts(theta, causes, causes, inputs)
    noise, more = float(np.exp(2.0 * theta[_NOISE])), len(inputs)
    solved = _solve_errors(theta, np.add.reduce(parts) + rest, errors)
    half = 0.5 * solved.sensitivity()
    gradient = np.empty(len(theta))
    by_width = [2.0 * np.sum(half * part) for part in parts]
    gradient[:_G], gradient[_NOISE + 1 : _NOISE + 1 + more] = by_width[:_G], by_width[_G:]
    weighted = half * rest
    gradient[_G] = 2.0 * weighted.sum()
    z = _scale_causes(theta, causes, inputs)
    by_length = 2.0 * (weighted.sum(axis=0) @ z**2 - np.einsum("ij,ij->j", z, weighted @ z))
    gradient[_G + 1 : _G + 5], gradient[_NOISE + 1 + more :] = by_length[:4], by_length[4:]
    faded = (causes.force[:, None] + causes.force) / fading
    gradient[_G + 5] = np.sum(half * parts[_G - 1] * faded)
    moved = friction_by_rest(causes, fading, place)
    turned = 2.0 * np.exp(2.0 * theta[_G - 1]) * (half @ _friction(causes, fading, place)[0])
    gradient[_G + 6 : _G + 8] = np.einsum("inj,nj->i", moved, turned)
    gradient[_NOISE] = 2.0 * noise * np.trace(half)
    return solved.log_evidence, gradient


def signal_covariance(
    theta: Array, c: Conditions, other: Conditions, inputs: tuple[Position, ...] = ()
) -> Array:
    """Returns the covariance (m, n) m^2 of what is not noise between two sets of clamps."""
    parts, rest = _covariance_parts(theta, c, other, inputs)
    return np.asarray(np.add.reduce([rest, *parts]))


def _covariance_parts(
    theta: Array, c: Conditions, other: Conditions, inputs: tuple[Position, ...]
) -> tuple[list[Array], Array]:
    """(m, n) covariance of each group and of each input, and of the smooth residual."""
    places = _scale_causes(theta, c, inputs), _scale_causes(theta, other, inputs)
    rest = np.exp(2.0 * theta[_G]) * correlation(*places)
    own, others = (_all_groups(theta, each, inputs) for each in (c, other))
    widths = _widths(theta, len(inputs))
    parts = [np.exp(2.0 * w) * (g @ h.T) for w, g, h in zip(widths, own, others, strict=True)]
    return parts, np.asarray(rest)


def _all_groups(theta: Array, c: Conditions, inputs: tuple[Position, ...]) -> list[Array]:
    """Columns (n, .) of each group, then (n, 1) of each input."""
    return [*groups(c, *_friction_of(theta)), *c.positions(inputs).T[:, :, None]]


def _widths(theta: Array, inputs: int) -> Array:
    """Log widths of the groups, then of the inputs."""
    return np.concatenate([theta[:_G], theta[_NOISE + 1 : _NOISE + 1 + inputs]])


def _scale_causes(theta: Array, c: Conditions, inputs: tuple[Position, ...]) -> Array:
    """(n, 4 + inputs) causes over the lengths of the smooth residual."""
    length = np.concatenate([theta[_G + 1 : _G + 5], theta[_NOISE + 1 + len(inputs) :]])
    return np.asarray(np.concatenate([c.table, c.positions(inputs)], axis=1) / np.exp(length))


def _solve_errors(theta: Array, covariance: Array, errors: Array) -> Solved:
    """Solves errors (n, k) against their covariance (n, n) with the noise added."""
    noise = np.exp(2.0 * theta[_NOISE]) * np.eye(len(errors))
    return solve(covariance + noise, errors, np.empty((len(errors), 0)))


def _own(theta: Array, c: Conditions, inputs: tuple[Position, ...]) -> Array:
    """(m,) variance of what is not noise."""
    out = np.full(len(c.a), np.exp(2.0 * theta[_G]))
    widths = _widths(theta, len(inputs))
    for width, g in zip(widths, _all_groups(theta, c, inputs), strict=True):
        out += np.exp(2.0 * width) * np.sum(g**2, axis=1)
    return out


def _friction_of(theta: Array) -> tuple[float, Array]:
    """Returns F_0 in kN and the rest position (2,) in deg."""
    return float(np.exp(theta[_G + 5])), theta[_G + 6 : _G + 8]
