"""Linear Gaussian models whose prior scales and noise come from the marginal likelihood.

    y = F w + noise,   w_j ~ N(0, s_g(j)^2),   noise of channel c ~ N(0, tau_c)

With fixed columns F the data enter once, through F'F and F'y; after that every step costs p^3,
whatever the number of rows. Scales and noise are learned by
:mod:`robotrue.calibration.scale_learning`.

Few rows are kept as they are: with K = 1 + B B', B the whitened columns times their prior scales,
every step costs r^2 p for r numbers instead of p^3 (same posterior, Woodbury).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg.blas import dsyrk, dtrmm
from scipy.linalg.lapack import dpotrf, dtrtri

from robotrue.calibration.few_rows import FewRows
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import ConvergenceError

FEW_PER_COLUMN: Final = 0.6
"""Numbers per column up to which the rows are stored in addition to their sums."""
PROBES: Final = 64
"""Of the trace that gives the degrees of freedom of a channel."""
PANEL: Final = 64
"""Rows of a large matrix that are scaled at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorGroup:
    """Weights that share one prior scale.

    Attributes:
        name: For reports.
        columns: (k,) their columns.
        sd: Prior standard deviation of each (or of the unit weight, see ``shape``).
        rest: Scale the group falls back to; zero keeps ``sd`` as it is.
        shape: (k,) relative size within the group; ones if empty.
        hold: How firmly the scale is held to that at rest and to the other held groups: 2 over the
            prior variance of log(sd^2). Zero is MacKay's rule with a pull towards that at rest.
    """

    name: str
    columns: IntArray
    sd: float
    rest: float = 0.0
    shape: Array = field(default_factory=lambda: np.empty(0))
    hold: float = 0.0

    @property
    def learned(self) -> bool:
        """True if the scale is learned."""
        return self.rest > 0.0

    @property
    def unit(self) -> Array:
        """(k,) relative size of each weight."""
        return self.shape if len(self.shape) else np.ones(len(self.columns))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sums:
    """Sufficient statistics of the rows of one noise channel.

    Attributes:
        gram: (p, p) F'F of the whitened rows; empty where the rows are kept, see
            :meth:`whole_gram`.
        pull: (p,) F'y.
        power: y'y.
        count: Numbers that count, reduced by what the robust rule takes from a clean variance.
        columns: (r, p) the rows themselves where there are few; empty otherwise.
        values: (r,) of those rows.
        least: tau below which the rows would be better than their instrument and one visit.
    """

    gram: Array
    pull: Array
    power: float
    count: float
    columns: Array = field(default_factory=lambda: np.empty((0, 0)))
    values: Array = field(default_factory=lambda: np.empty(0))
    least: float = 0.0

    @property
    def few(self) -> bool:
        """True if the rows themselves are stored."""
        return len(self.values) > 0

    def whole_gram(self) -> Array:
        """Returns F'F (p, p), made from the rows where they are kept."""
        return self.columns.T @ self.columns if self.few else self.gram

    def power_by_column(self) -> Array:
        """Returns the diagonal (p,) of F'F."""
        if self.few:
            return np.asarray(np.einsum("ij,ij->j", self.columns, self.columns))
        return np.diagonal(self.gram)

    def misfit(self, mean: Array) -> float:
        """Returns the sum of the squares that weights (p,) leave of the values."""
        if self.few:
            left = self.values - self.columns @ mean
            return float(left @ left)
        return float(self.power - 2.0 * mean @ self.pull + mean @ self.gram @ mean)

    def part(self, kept: BoolArray) -> Sums:
        """Returns the sums over some of the columns (p,)."""
        return replace(
            self,
            gram=self.gram if self.few else self.gram[np.ix_(kept, kept)],
            pull=self.pull[kept],
            columns=self.columns[:, kept] if self.few else self.columns,
        )

    def without(self, other: Sums) -> Sums:
        """Returns the sums without some of their rows; the rows are not stored."""
        gram = other.whole_gram()
        return Sums(
            gram=np.subtract(self.whole_gram(), gram, out=gram if other.few else None),
            pull=self.pull - other.pull,
            power=self.power - other.power,
            count=self.count - other.count,
            least=self.least,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """The posterior of a linear model.

    Attributes:
        mean: (p,).
        root: (p, p) R with posterior covariance R'R; empty where only ``few`` knows it.
        groups: With the scales learned.
        noise: (c,) tau of each channel, relative to the whitening.
        determined: (g,) gamma of each group.
        spent: (c,) degrees of freedom that each channel gave; they sum to the number determined.
        evidence: Log marginal likelihood, up to the whitening's own constant.
        steps: Fixed-point steps taken.
        few: The covariance of few rows.
    """

    mean: Array
    root: Array
    groups: tuple[PriorGroup, ...]
    noise: Array
    determined: Array
    spent: Array
    evidence: float
    steps: int
    few: FewRows | None = field(default=None, repr=False)

    def spread(self, columns: Array) -> Array:
        """Returns the covariance (n, m, m) of ``columns @ w`` for columns (n, m, p)."""
        return spread(self.root, columns) if self.few is None else self.few.spread(columns)

    def with_root(self) -> Weights:
        """Returns the same with its root made."""
        return self if self.few is None else replace(self, root=self.few.root(), few=None)

    def scale(self, name: str) -> float:
        """Returns the learned sd of a group."""
        return self.scales()[name]

    def scales(self) -> dict[str, float]:
        """Returns the learned sd of every group by its name."""
        return {g.name: g.sd for g in self.groups}


class SumsBuilder:
    """Adds up the rows of one noise channel, block by block, over p columns."""

    def __init__(self, size: int) -> None:
        self._gram, self._pull = np.zeros((0, 0)), np.zeros(size)
        self._power, self._count = 0.0, 0.0
        self._rows = 0
        self._kept: list[tuple[Array, Array]] = []

    def add(self, columns: Array, values: Array, count: float) -> None:
        """Adds whitened rows: columns (k, p), values (k,), numbers that count."""
        self._pull += columns.T @ values
        self._power += float(values @ values)
        self._count += count
        self._rows += len(values)
        self._kept.append((columns, values))
        if self._few:
            return
        if not self._gram.size:
            self._gram = np.zeros((len(self._pull), len(self._pull)), order="F")
        for rows, _ in self._kept:
            if not len(rows):
                continue
            self._gram = dsyrk(1.0, rows.T, beta=1.0, c=self._gram, overwrite_c=1)
        self._kept.clear()

    @property
    def _few(self) -> bool:
        return self._rows <= FEW_PER_COLUMN * len(self._pull)

    def sums(self) -> Sums:
        """Returns the sums of the rows so far; the rows too where they are few."""
        size = len(self._pull)
        gram = _mirror(self._gram) if self._rows else np.zeros((size, size))
        found = Sums(gram=gram, pull=self._pull, power=self._power, count=self._count)
        if not self._kept:
            return found
        return replace(
            found,
            columns=np.concatenate([columns for columns, _ in self._kept]),
            values=np.concatenate([values for _, values in self._kept]),
        )


def _mirror(upper: Array) -> Array:
    """The symmetric matrix of an upper triangle, made in its place."""
    for start in range(0, len(upper), PANEL):
        rows, rest = slice(start, start + PANEL), slice(start + PANEL, None)
        block = upper[rows, rows]
        upper[rows, rows] = np.triu(block) + np.triu(block, 1).T
        upper[rest, rows] = upper[rows, rest].T
    return upper.T  # in the order of rows


def sums_of(blocks: Iterable[tuple[Array, Array, float]], size: int) -> Sums:
    """Returns the sums over blocks of whitened rows.

    Args:
        blocks: (columns (k, p), values (k,), numbers that count) each.
        size: p.
    """
    builder = SumsBuilder(size)
    for columns, values, count in blocks:
        builder.add(columns, values, count)
    return builder.sums()


def prior_sd(groups: Sequence[PriorGroup], size: int) -> Array:
    """Returns the prior sd (p,) that the groups give; a weight in no group is held at zero."""
    sd = np.zeros(size)
    for group in groups:
        sd[group.columns] = group.sd * group.unit
    return sd


def posterior(
    channels: Sequence[Sums],
    groups: Sequence[PriorGroup],
    noise: Array,
) -> Weights:
    """Returns the posterior at given scales and noise, with its evidence; few rows make no root.

    Args:
        channels: Sums per noise channel.
        groups: Scales.
        noise: (c,) tau.

    Raises:
        ConvergenceError: The precision is not positive definite (rows with huge values).
    """
    if all(s.few for s in channels):
        return _posterior_of_few(channels, groups, noise)
    size = len(channels[0].pull)
    sd = prior_sd(groups, size)
    pull = sum(s.pull / t for s, t in zip(channels, noise, strict=True))
    factor, fault = dpotrf(_scale_precision(channels, sd, noise).T, lower=1, clean=1, overwrite_a=1)
    if fault:
        raise ConvergenceError(
            f"the normal matrix of {size} weights is not positive definite (column {fault}).",
            hint="look for wild rows or units in the measurements.",
        )
    log_precision = float(np.log(np.diagonal(factor)).sum())
    inverse, _ = dtrtri(factor, lower=1, overwrite_c=1)
    unit = inverse.T @ (inverse @ (sd * np.asarray(pull)))
    mean = sd * unit
    left = np.einsum("ji,ji->i", inverse, inverse)  # posterior over prior variance
    evidence = -float(unit @ unit) / 2.0 - log_precision
    spent = np.zeros(len(channels))
    if len(channels) > 1:
        half = inverse.T @ _probes(size)
        half *= sd[:, None]
        for k in range(1, len(channels)):
            turned = channels[k].whole_gram() @ half
            spent[k] = float(np.vdot(half, turned)) / (PROBES * noise[k])
    inverse *= sd
    return _weights(channels, groups, noise, mean, left, inverse, evidence, spent)


@lru_cache(maxsize=2)
def _probes(size: int) -> Array:
    """Signs (size, PROBES) whose mean of z'Az estimates the trace of A, the same at every call.

    A is a posterior covariance times what one channel shows, whose trace is at most the numbers
    determined: its error, sqrt(2 trace / PROBES), is below a thousandth of the channel's numbers
    (Hutchinson 1990). The trace by a product of two matrices costs a third of a posterior.
    """
    return np.where(np.random.default_rng(0).random((size, PROBES)) < 0.5, -1.0, 1.0)


def _scale_precision(channels: Sequence[Sums], sd: Array, noise: Array) -> Array:
    """The upper triangle of 1 + S (sum of gram / tau) S, some rows at a time: they stay in cache.

    What is below the triangle is not set.
    """
    size = len(sd)
    scaled = np.empty((size, size))
    grams = [channel.whole_gram() for channel in channels]
    for start in range(0, size, PANEL):
        rows = slice(start, start + PANEL)
        panel = grams[0][rows, start:] * (sd[rows] / noise[0])[:, None]
        for gram, t in zip(grams[1:], noise[1:], strict=True):
            panel += gram[rows, start:] * (sd[rows] / t)[:, None]
        np.multiply(panel, sd[start:], out=scaled[rows, start:])
    scaled[np.diag_indices(size)] += 1.0
    return scaled


def _posterior_of_few(
    channels: Sequence[Sums], groups: Sequence[PriorGroup], noise: Array
) -> Weights:
    """The same posterior from K = 1 + B B' = L L', B = whitened columns times prior sd.

    A channel has spent the trace of 1 - K^-1 over its own rows.
    """
    sd = prior_sd(groups, len(channels[0].pull))
    scale = 1.0 / np.sqrt(np.asarray(noise))
    columns = np.concatenate([s.columns * (a * sd) for s, a in zip(channels, scale, strict=True)])
    values = np.concatenate([s.values * a for s, a in zip(channels, scale, strict=True)])
    if not np.isfinite(columns).all():
        raise ConvergenceError(
            f"the rows of {len(sd)} weights are not finite.",
            hint="look for wild rows or units in the measurements.",
        )
    kernel = dsyrk(1.0, columns.T, trans=1, lower=1)  # its lower triangle
    factor, fault = dpotrf(kernel + np.eye(len(kernel)), lower=1, clean=1)
    if fault:
        raise ConvergenceError(
            f"the covariance of {len(kernel)} numbers is not positive definite (row {fault}).",
            hint="look for wild rows or units in the measurements.",
        )
    inverse, _ = dtrtri(factor, lower=1)
    turned = dtrmm(1.0, inverse, columns.T, side=1, lower=1, trans_a=1)  # its columns are rows
    unit = turned @ (inverse @ values)
    left = np.maximum(1.0 - np.einsum("ij,ij->i", turned, turned), 0.0)
    few = FewRows(kernel=kernel, columns=columns, sd=sd)
    root = np.empty((0, 0))
    evidence = -float(unit @ unit) / 2.0 - float(np.log(np.diagonal(factor)).sum())
    given = 1.0 - (inverse**2).sum(axis=0)
    ends = np.cumsum([len(s.values) for s in channels])
    spent = np.array([float(part.sum()) for part in np.split(given, ends[:-1])])
    weights = _weights(channels, groups, noise, sd * unit, left, root, evidence, spent)
    return replace(weights, few=few)


def _weights(
    channels: Sequence[Sums],
    groups: Sequence[PriorGroup],
    noise: Array,
    mean: Array,
    left: Array,
    root: Array,
    evidence: float,
    spent: Array,
) -> Weights:
    """Assembles a posterior; ``left`` is posterior over prior variance.

    The first channel has spent what the others have not.
    """
    for s, t in zip(channels, noise, strict=True):
        evidence -= 0.5 * (s.count * float(np.log(2.0 * np.pi * t)) + s.misfit(mean) / t)
    determined = np.array([float((1.0 - left[g.columns]).sum()) for g in groups])
    return Weights(
        mean=mean,
        root=root,
        groups=tuple(groups),
        noise=np.asarray(noise, dtype=np.float64),
        determined=determined,
        spent=np.array([determined.sum() - spent[1:].sum(), *spent[1:]]),
        evidence=evidence,
        steps=0,
    )


def spread(root: Array, columns: Array) -> Array:
    """Returns the covariance (n, m, m) of ``columns @ w`` for columns (n, m, p)."""
    n, m, size = columns.shape
    half = (columns.reshape(n * m, size) @ root.T).reshape(n, m, len(root))
    covariance: Array = half @ np.swapaxes(half, 1, 2)
    return covariance
