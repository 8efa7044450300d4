"""Linear Gaussian models whose prior scales and noise come from the marginal likelihood.

    y = F w + noise,   w_j ~ N(0, s_g(j)^2),   noise of channel c ~ N(0, tau_c)

With fixed columns F the data enter once, through F'F and F'y; after that every step costs p^3,
whatever the number of rows. Scales and noise move by MacKay's fixed point ("Bayesian
interpolation", 1992, eq. 4.9-4.10 and their groups): with gamma the number of parameters of a group
that the data determine,

    s_g^2 = (PULL r_g^2 + |w_g|^2) / (PULL + gamma_g)      tau_c = |y - F w|_c^2 / (n_c - gamma_c)

``r_g`` is the scale at rest: where a group has nothing to say it goes there instead of to zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ConvergenceError

PULL: Final = 0.5
"""Weight of the scale at rest in a learned one, in parameters."""
LEAST_GAIN: Final = 1.0
"""Gain in log evidence per step below which learning stops."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Weights that share one prior scale.

    Attributes:
        name: For reports.
        columns: (k,) their columns.
        sd: Prior standard deviation of each (or of the unit weight, see ``shape``).
        rest: Scale the group falls back to; zero keeps ``sd`` as it is.
        shape: (k,) relative size within the group; ones if empty.
    """

    name: str
    columns: IntArray
    sd: float
    rest: float = 0.0
    shape: Array = field(default_factory=lambda: np.empty(0))

    @property
    def learned(self) -> bool:
        """Whether the scale moves."""
        return self.rest > 0.0

    @property
    def unit(self) -> Array:
        """(k,) relative size of each weight."""
        return self.shape if len(self.shape) else np.ones(len(self.columns))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sums:
    """What the rows of one noise channel say.

    Attributes:
        gram: (p, p) F'F of the whitened rows.
        pull: (p,) F'y.
        power: y'y.
        count: Numbers that count, reduced by what the robust rule takes from a clean variance.
    """

    gram: Array
    pull: Array
    power: float
    count: float

    def without(self, other: Sums) -> Sums:
        """Returns the sums with some of their rows taken away."""
        return Sums(
            gram=self.gram - other.gram,
            pull=self.pull - other.pull,
            power=self.power - other.power,
            count=self.count - other.count,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """The posterior of a linear model.

    Attributes:
        mean: (p,).
        root: (p, p) R with posterior covariance R'R.
        groups: With the scales learned.
        noise: (c,) tau of each channel, relative to the whitening.
        determined: (g,) gamma of each group.
        evidence: Log marginal likelihood, up to the whitening's own constant.
        steps: Fixed-point steps taken.
    """

    mean: Array
    root: Array
    groups: tuple[Group, ...]
    noise: Array
    determined: Array
    evidence: float
    steps: int

    def scale(self, name: str) -> float:
        """Returns the learned sd of a group."""
        return next(g.sd for g in self.groups if g.name == name)


def sums_of(blocks: Iterable[tuple[Array, Array, float]], size: int) -> Sums:
    """Returns the sums over blocks of whitened rows.

    Args:
        blocks: (columns (k, p), values (k,), numbers that count) each.
        size: p.
    """
    gram, pull, power, count = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for columns, values, number in blocks:
        gram += columns.T @ columns
        pull += columns.T @ values
        power += float(values @ values)
        count += number
    return Sums(gram=gram, pull=pull, power=power, count=count)


def prior_sd(groups: Sequence[Group], size: int) -> Array:
    """Returns the prior sd (p,) that the groups give; a weight in no group is held at zero."""
    sd = np.zeros(size)
    for group in groups:
        sd[group.columns] = group.sd * group.unit
    return sd


def posterior(channels: Sequence[Sums], groups: Sequence[Group], noise: Array) -> Weights:
    """Returns the posterior at given scales and noise, with its evidence.

    Raises:
        ConvergenceError: The precision is not positive definite (rows with huge values).
    """
    size = len(channels[0].pull)
    sd = prior_sd(groups, size)
    precision = sum(s.gram / t for s, t in zip(channels, noise, strict=True))
    pull = sum(s.pull / t for s, t in zip(channels, noise, strict=True))
    scaled = np.asarray(precision) * sd[:, None]
    scaled *= sd
    scaled[np.diag_indices(size)] += 1.0
    factor, fault = dpotrf(scaled.T, lower=1, clean=1, overwrite_a=1)
    if fault:
        raise ConvergenceError(
            f"the normal matrix of {size} weights is not positive definite (column {fault}).",
            hint="look for wild rows or units in the measurements.",
        )
    inverse, _ = dtrtri(factor, lower=1)
    unit = inverse.T @ (inverse @ (sd * np.asarray(pull)))
    mean = sd * unit
    left = (inverse**2).sum(axis=0)  # posterior over prior variance
    misfit = [s.power - 2.0 * mean @ s.pull + mean @ s.gram @ mean for s in channels]
    evidence = -float(unit @ unit) / 2.0 - float(np.log(np.diagonal(factor)).sum())
    for s, t, m in zip(channels, noise, misfit, strict=True):
        evidence -= 0.5 * (s.count * float(np.log(2.0 * np.pi * t)) + float(m) / t)
    return Weights(
        mean=mean,
        root=inverse * sd,
        groups=tuple(groups),
        noise=np.asarray(noise, dtype=np.float64),
        determined=np.array([float((1.0 - left[g.columns]).sum()) for g in groups]),
        evidence=evidence,
        steps=0,
    )


def learn(
    channels: Sequence[Sums], groups: Sequence[Group], noise: Array, *, steps: int = 40
) -> Weights:
    """Returns the posterior at scales and noise of (locally) greatest evidence.

    Args:
        channels: Sums per noise channel.
        groups: Starting scales.
        noise: (c,) starting tau; 1 is the noise of the whitening.
        steps: Most fixed-point steps; learning also stops when a step gains less than
            :data:`LEAST_GAIN`.
    """
    best = posterior(channels, groups, noise)
    for step in range(1, steps + 1):
        groups, noise = _moved(best, channels)
        trial = posterior(channels, groups, noise)
        gain = trial.evidence - best.evidence
        best = replace(trial, steps=step)
        if step > 3 and gain < LEAST_GAIN:
            break
    return best


def _moved(at: Weights, channels: Sequence[Sums]) -> tuple[tuple[Group, ...], Array]:
    groups = []
    for group, seen in zip(at.groups, at.determined, strict=True):
        if group.learned:
            squares = float(((at.mean[group.columns] / group.unit) ** 2).sum())
            variance = (PULL * group.rest**2 + squares) / (PULL + max(seen, 0.0))
            group = replace(group, sd=float(np.sqrt(variance)))
        groups.append(group)
    noise = np.empty(len(channels))
    spent = _spent(at, channels)
    for k, s in enumerate(channels):
        misfit = float(s.power - 2.0 * at.mean @ s.pull + at.mean @ s.gram @ at.mean)
        noise[k] = max(misfit, 1e-30) / max(s.count - spent[k], 0.05 * s.count)
    return tuple(groups), noise


def _spent(at: Weights, channels: Sequence[Sums]) -> Array:
    """Degrees of freedom each channel gave; they sum to the number determined."""
    total = float(at.determined.sum())
    out = np.zeros(len(channels))
    for k in range(1, len(channels)):
        out[k] = float(np.einsum("ij,ij->", at.root @ channels[k].gram, at.root)) / at.noise[k]
    out[0] = total - out[1:].sum()
    return out


def spread(root: Array, columns: Array) -> Array:
    """Returns the covariance (n, m, m) of ``columns @ w`` for columns (n, m, p)."""
    n, m, size = columns.shape
    half = (columns.reshape(n * m, size) @ root.T).reshape(n, m, len(root))
    covariance: Array = half @ np.swapaxes(half, 1, 2)
    return covariance
