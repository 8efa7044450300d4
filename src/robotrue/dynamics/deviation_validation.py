"""Held-out error of a learned deviation: by blocks, passes, poses; and at random.

Windows of one pass are neighbours in everything. Split at random, each one held out lies between
two learned from, and any regression looks good; that row is printed because the paper printed it.

Of a hundred windows whose errors are alike, a 95 % band holds all or none. The share inside it is
that of a binomial of the independent windows: its variance, p (1 - p) / n, gives n.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import UM
from robotrue.dynamics.deviation import fit_deviation
from robotrue.dynamics.deviation_physics import CompliantArm, StaticCompliance
from robotrue.dynamics.paper_regression import fit_paper
from robotrue.dynamics.window_folds import QUESTIONS, folds
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError

TWO_SIDED_95: Final = 1.959964
DRAWS: Final = 2000
METHODS: Final = ("prediction", "paper", "deviation")

Estimate = Callable[[WindowSet, WindowSet], tuple[Array, Array | None]]
"""Training and test windows to error (m,) m and its covariance (m, m) m^2 or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShareByChance:
    """Share of windows inside a correct band, by chance.

    Attributes:
        shares: (draws,) drawn from the errors as the band's model has them.
    """

    shares: Array

    @property
    def range(self) -> tuple[float, float]:
        """The share lies between these two in 95 of 100 cases."""
        low, high = np.quantile(self.shares, [0.025, 0.975])
        return float(low), float(high)

    @property
    def effective(self) -> float:
        """Independent windows that would give a share as unsure."""
        mean, variance = float(self.shares.mean()), float(self.shares.var())
        return mean * (1.0 - mean) / max(variance, 1e-12)

    def below(self, share: float) -> float:
        """Returns the probability of a share less than this."""
        return float((self.shares < share).mean())


def share_by_chance(covariance: Array) -> ShareByChance:
    """Returns what a 95 % band of windows would hold.

    Args:
        covariance: (n, n) m^2 of their errors, as the band takes them; its diagonal is the band.
    """
    sd = np.sqrt(np.diag(covariance))
    value, vector = np.linalg.eigh(covariance / np.outer(sd, sd))
    drawn = np.random.default_rng(len(sd)).standard_normal((len(sd), DRAWS))
    errors = (vector * np.sqrt(np.maximum(value, 0.0))) @ drawn
    return ShareByChance(shares=np.asarray((np.abs(errors) <= TWO_SIDED_95).mean(axis=0)))


def join_shares(parts: Sequence[ShareByChance], windows: Sequence[int]) -> ShareByChance:
    """Returns the share of several sets of windows together, errors of different sets independent.

    Args:
        parts: Of each set.
        windows: In each set.
    """
    weight = np.asarray(windows, dtype=np.float64) / sum(windows)
    rng = np.random.default_rng(len(parts))
    mixed = [rng.permutation(part.shares) for part in parts]
    return ShareByChance(shares=np.asarray(weight @ np.array(mixed)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One method on one kind of split.

    Attributes:
        split: Key of :data:`QUESTIONS`.
        method: ``prediction`` (frequency response and force), ``paper``, ``deviation`` (ours).
        residual: (n,) m, estimated less measured, of all held-out windows.
        sd: (n,) m as stated, or None.
        by_chance: What share a band that is right would hold, or None.
    """

    split: str
    method: str
    residual: Array
    sd: Array | None
    by_chance: ShareByChance | None = None

    @property
    def rmse(self) -> float:
        """Root mean square, m."""
        return float(np.sqrt((self.residual**2).mean()))

    @property
    def coverage(self) -> float | None:
        """Part of windows inside the stated 95 % band, or None."""
        if self.sd is None:
            return None
        return float((np.abs(self.residual) <= TWO_SIDED_95 * self.sd).mean())

    def document(self) -> dict[str, object]:
        """Returns JSON values."""
        chance = self.by_chance
        low, high = (None, None) if chance is None else chance.range
        return {
            "split": self.split,
            "question": QUESTIONS[self.split],
            "method": self.method,
            "windows": len(self.residual),
            "rmse_um": self.rmse / UM,
            "mean_um": float(np.abs(self.residual).mean()) / UM,
            "max_um": float(np.abs(self.residual).max()) / UM,
            "coverage_95": self.coverage,
            "coverage_95_low": low,
            "coverage_95_high": high,
            "effective_windows": None if chance is None else chance.effective,
        }


def scores(
    windows: WindowSet,
    arm: CompliantArm,
    *,
    kinds: Sequence[str] = tuple(QUESTIONS),
    methods: Sequence[str] = METHODS,
    row: StaticCompliance | None = None,
    known: str | None = None,
    seed: int = 0,
) -> list[Score]:
    """Returns every method on every kind of split.

    Args:
        windows: Measured.
        arm: As stated.
        kinds: Of :data:`QUESTIONS`.
        methods: Of :data:`METHODS`.
        row: As of :func:`robotrue.dynamics.deviation.fit_deviation`.
        known: As of :func:`folds`.
        seed: As of :func:`folds`.

    Raises:
        ConfigurationError: No such split or method.
        ObservabilityError: Too few windows or passes.
    """
    out = []
    for kind in kinds:
        for method in methods:
            estimate = _estimate(method, arm, row)
            residual, stated = [], []
            for train, test in folds(windows, kind, known=known, seed=seed):
                held = windows.take(test)
                error, covariance = estimate(windows.take(train), held)
                residual.append(error - held.measured)
                stated += [] if covariance is None else [covariance]
            out.append(_score(kind, method, residual, stated))
    return out


def _score(kind: str, method: str, residual: list[Array], stated: list[Array]) -> Score:
    """The score of residuals fold by fold, and of their covariances where the method states any."""
    joined = np.concatenate(residual)
    if not stated:
        return Score(split=kind, method=method, residual=joined, sd=None)
    return Score(
        split=kind,
        method=method,
        residual=joined,
        sd=np.concatenate([np.sqrt(np.diag(each)) for each in stated]),
        by_chance=join_shares([share_by_chance(each) for each in stated], [*map(len, stated)]),
    )


def _estimate(method: str, arm: CompliantArm, row: StaticCompliance | None) -> Estimate:
    def deviation(train: WindowSet, test: WindowSet) -> tuple[Array, Array | None]:
        model = fit_deviation(train, arm, row=row)
        return model.predict(test).error, model.predict_covariance(test)

    def paper(train: WindowSet, test: WindowSet) -> tuple[Array, Array | None]:
        return fit_paper(train, arm).predict(test).error, None

    known: dict[str, Estimate] = {
        "prediction": lambda train, test: (test.predicted, None),
        "paper": paper,
        "deviation": deviation,
    }
    if method not in known:
        raise ConfigurationError(f"no method {method!r}; there are {', '.join(METHODS)}.")
    return known[method]
