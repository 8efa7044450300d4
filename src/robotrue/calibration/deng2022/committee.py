"""One expert of the joined model: a Gaussian process, or the rounds of a boosted one.

The training data of the rounds are stored: rows, weights, hyper-parameters. Everything else follows
by linear algebra, so that an archive restores the same expert independently of the code that chose
the weights.

The width of its stated uncertainty is learned on held-out rows. The copies of the source in the
sub-spaces repeat the same measurements, and H_j is fitted to the target rows, so the variance of
eq. 32 is too small. One factor on it makes the mean squared error of held-out rows, in units of
their stated variance, equal to one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import brentq

from robotrue.calibration.deng2022.domains import PRINTED_UNITS, Labelled
from robotrue.calibration.deng2022.readings import DengReadings, Kernel, Mean
from robotrue.calibration.learners.gaussian_process import GaussianProcess
from robotrue.calibration.learners.posterior import correlation
from robotrue.calibration.learners.tradaboost import TrAdaBoostR2, combine_rounds, round_shares
from robotrue.core.archive import Archive
from robotrue.core.archive_tables import unpack_table
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM

_LEAST_WEIGHT: Final = 1e-12  # as the boosting gives its learners


@dataclass(frozen=True, slots=True, kw_only=True)
class Committee(Columns):
    """Gaussian processes on the same rows with the same kernel and different weights.

    Attributes:
        inputs: (n, 6) pose features in mm and deg.
        errors: (n, 3) mm.
        weights: (T, n) of the rows in each round, positive.
        betas: (T,) of eq. 23; a single process has 1/e, the weight ln(1/beta) = 1.
        length: (6,) kernel lengths, mm and deg.
        amplitude: Standard deviation of the process, mm.
        noise: Standard deviation of the noise of a row with weight 1, mm.
        kernel: Reading of eq. 28.
        mean: Reading of eq. 27.
        combination: Reading of eq. 25.
        learners: The processes; they follow from all of the above, see :func:`restore_committee`.
    """

    inputs: Annotated[Array, Column("n 6", unit="mm, deg")]
    errors: Annotated[Array, Column("n 3", unit="mm")]
    weights: Annotated[Array, Column("rounds n")]
    betas: Annotated[Array, Column("rounds")]
    length: Annotated[Array, Column("6", unit="mm, deg")]
    amplitude: float
    noise: float
    kernel: Kernel
    mean: Mean
    combination: str
    learners: tuple[GaussianProcess, ...]

    def predict(self, features: Array) -> tuple[Array, Array]:
        """Returns the error (n, 3) m and its variance (n,) m^2 about the truth, noise left out.

        The variance is that of the mixture of the rounds, averaged over the axes.

        Args:
            features: (n, 6) m and rad.
        """
        X = features / PRINTED_UNITS
        found = [g.predict(X, return_std=True, noisy=False) for g in self.learners]
        each = np.stack([mean for mean, _ in found])
        variance = np.stack([std.mean(axis=1) ** 2 for _, std in found])
        combined, spread = self.mix_rounds(each, variance)
        return combined * MM, spread * MM**2

    def mix_rounds(self, each: Array, variance: Array) -> tuple[Array, Array]:
        """Returns the combined prediction (n, 3) mm of all rounds and its variance (n,) mm^2.

        Args:
            each: (T, n, 3) mm, prediction of each round.
            variance: (T, n) mm^2 of each round.
        """
        share = round_shares(self.betas)
        apart = np.mean((each - np.tensordot(share, each, axes=1)) ** 2, axis=2)
        combined = combine_rounds(each, self.betas, self.combination)
        return combined, np.asarray(np.tensordot(share, variance + apart, axes=1))

    def precision(self, k: int) -> Array:
        """Returns P (n, n) 1/mm^2 of round k: the rows' precision, with the constant mean removed.

        For any rows T, ``P_TT^-1 (P y)_T`` is their residual against a prediction from all other
        rows, and ``P_TT^-1`` its covariance, the noise of T included.
        """
        near = correlation(self.inputs / self.length, self.inputs / self.length)
        covariance = self.amplitude**2 * near
        covariance.flat[:: len(covariance) + 1] += self.noise**2 / self.weights[k]
        inverse = cho_solve(cho_factor(covariance, lower=True), np.eye(len(covariance)))
        if self.mean == "zero":
            return np.asarray(inverse)
        total = inverse.sum(axis=0)
        return np.asarray(inverse - np.outer(total, total) / total.sum())


def single(inputs: Array, errors: Array, readings: DengReadings) -> Committee:
    """Returns one Gaussian process on rows in m, rad and m, eq. 27-32.

    Args:
        inputs: (n, 6) pose features.
        errors: (n, 3) m.
        readings: Kernel, mean and length.
    """
    process = learner(readings).fit(inputs / PRINTED_UNITS, errors / MM)
    return _committee(
        inputs / PRINTED_UNITS,
        errors / MM,
        np.ones((1, len(inputs))),
        np.array([np.exp(-1.0)]),
        [process],
        readings,
    )


def boost(
    target: tuple[Array, Array],
    source: tuple[Array, Array],
    readings: DengReadings,
    *,
    target_weight: Array,
    source_weight: float = 1.0,
    error_weights: tuple[Array, Array] | None = None,
) -> Committee:
    """Returns the processes of all boosting rounds, eq. 19-25.

    Args:
        target: (m, 6) features and (m, 3) errors in m, rad.
        source: (k n, 6) and (k n, 3), transferred to the sub-spaces.
        readings: Switches.
        target_weight: (m,) initial weights of eq. 19, relative to a source row.
        source_weight: Initial weight of a source row, relative to a target row.
        error_weights: omega_m of eq. 20, (m, 3) of the target and (k n, 3) of the source; or None.
    """
    inputs = np.concatenate([source[0], target[0]]) / PRINTED_UNITS
    errors = np.concatenate([source[1], target[1]]) / MM
    booster = TrAdaBoostR2(
        estimator=_hold_kernel(inputs, errors, readings),
        rounds=readings.rounds,
        source_weights=readings.source_weights,
        error_over=readings.error_over,
        combination=readings.combination,
    ).fit(
        target[0] / PRINTED_UNITS,
        target[1] / MM,
        sample_weight=target_weight,
        X_source=source[0] / PRINTED_UNITS,
        y_source=source[1] / MM,
        source_weight=np.full(len(source[0]), source_weight),
        error_weights=None if error_weights is None else error_weights[0],
        source_error_weights=None if error_weights is None else error_weights[1],
    )
    return _committee(
        inputs,
        errors,
        booster.weights_ * len(booster.weights_[0]),
        booster.betas_,
        booster.estimators_,
        readings,
    )


def _hold_kernel(inputs: Array, errors: Array, readings: DengReadings) -> GaussianProcess:
    """The base learner with hyper-parameters learned on evenly spaced rows, and held.

    The transferred copies of the source repeat each other: all rows would take twenty times as long
    without further information.
    """
    if len(inputs) <= readings.kernel_rows:
        return learner(readings)
    some = np.linspace(0, len(inputs) - 1, readings.kernel_rows).round().astype(np.int64)
    found = learner(readings).fit(inputs[some], errors[some])
    length = np.asarray(found.length_)
    found.set_params(
        length=length[0] if readings.kernel == "isotropic" else length,
        amplitude=float(found.amplitude_),
        noise=float(found.noise_),
        optimise=False,
    )
    return found


def learner(readings: DengReadings) -> GaussianProcess:
    """Returns the base learner, eq. 27-32, not fitted: inputs mm and deg, outputs mm."""
    return GaussianProcess(
        kernel=readings.kernel,
        mean=readings.mean,
        length=readings.length,
        denominator=readings.denominator,
        intervals="plug-in",
    )


def restore_committee(archive: Archive, stated: object, prefix: str) -> Committee:
    """Returns the committee that ``pack_table`` took apart without its learners.

    Args:
        archive: Holds its arrays.
        stated: JSON values of its other fields.
        prefix: Of the names of its arrays.

    Raises:
        ArchiveError: A part is missing, or cannot be.
    """
    committee = unpack_table(Committee, archive, stated, prefix=prefix, learners=())
    isotropic = committee.kernel == "isotropic"
    process = GaussianProcess(
        kernel=committee.kernel,
        mean=committee.mean,
        length=committee.length[0] if isotropic else committee.length,
        amplitude=committee.amplitude,
        noise=committee.noise,
        intervals="plug-in",
        optimise=False,
    ).fit(committee.inputs, committee.errors, sample_weight=committee.weights[0])
    return replace(
        committee, learners=(process, *(process.reweight(w) for w in committee.weights[1:]))
    )


def _committee(
    inputs: Array,
    errors: Array,
    weights: Array,
    betas: Array,
    learners: Sequence[GaussianProcess],
    readings: DengReadings,
) -> Committee:
    process = learners[0]
    length = np.asarray(process.length_, dtype=np.float64)
    return Committee(
        inputs=inputs,
        errors=errors,
        weights=np.maximum(weights, _LEAST_WEIGHT),
        betas=betas,
        length=np.sqrt(length) if readings.denominator == "literal" else length,
        amplitude=float(process.amplitude_),
        noise=float(process.noise_),
        kernel=readings.kernel,
        mean=readings.mean,
        combination=readings.combination,
        learners=tuple(learners),
    )


FOLDS: Final = 20
"""Parts of the target rows, each held out once."""
_LIMITS: Final = (-7.0, 14.0)
"""Natural logarithms between which the factor is searched."""


def held_out_inflation(
    committee: Committee, rows: Labelled, carry: Callable[[Labelled], Array], white: float
) -> float:
    """Returns the factor on the predictive variance of a committee, from held-out target rows.

    Kernel and weights are those of all rows; the alignment of the source is fitted again without
    the rows held out, and the processes predict them from all others in closed form. Neighbours in
    angle about joint 1 are held out apart, so each sub-space keeps its other rows.

    Args:
        committee: Of the target domain; the target rows are its last.
        rows: Target rows.
        carry: Returns the source errors (k n, 3) m in all sub-spaces, aligned to a part of them.
        white: m, sd per axis that a single visit adds to the process.
    """
    count = len(rows.errors)
    first = len(committee.inputs) - count
    order = np.argsort(np.arctan2(rows.features[:, 1], rows.features[:, 0]), kind="stable")
    fold = np.empty(count, dtype=np.int64)
    fold[order] = np.arange(count) % min(FOLDS, count)
    parts = [np.flatnonzero(fold == k) for k in range(int(fold.max()) + 1)]
    labels = [
        np.concatenate([carry(rows.take(np.flatnonzero(fold != k))), rows.errors]) / MM
        for k in range(len(parts))
    ]
    rounds = len(committee.betas)
    each, variance = np.empty((rounds, count, 3)), np.empty((rounds, count))
    for k in range(rounds):
        precision = committee.precision(k)
        for test, values in zip(parts, labels, strict=True):
            at = first + test
            covariance = np.linalg.inv(precision[np.ix_(at, at)])
            each[k, test] = values[at] - covariance @ (precision[at] @ values)
            noise = committee.noise**2 / committee.weights[k, at]
            variance[k, test] = np.maximum(np.diagonal(covariance) - noise, 0.0)
    predicted, spread = committee.mix_rounds(each, variance)
    missed = rows.errors - predicted * MM
    return solve_inflation(missed, spread * MM**2 + white**2, rows.covariance)


def left_out_inflation(committee: Committee, rows: Labelled, white: float) -> float:
    """Returns the factor of a single process, from each row left out in closed form.

    Args:
        committee: Of one process.
        rows: It was fitted to.
        white: m, sd per axis that a single visit adds to the process.
    """
    missed, variance = committee.learners[0].predict_left_out()
    process = np.maximum(variance - committee.noise**2, 0.0) * MM**2
    return solve_inflation(missed * MM, process + white**2, rows.covariance)


def solve_inflation(missed: Array, variance: Array, covariance: Array) -> float:
    """Returns f so that missed^2 / (f variance + instrument) is one in the mean over rows and axes.

    Args:
        missed: (n, 3) m.
        variance: (n,) m^2 of a prediction, per axis.
        covariance: (n, 3, 3) m^2 of the instrument.
    """
    squared = np.sum(missed**2, axis=1) / 3.0
    instrument = np.trace(covariance, axis1=1, axis2=2) / 3.0

    def excess(logarithm: float) -> float:
        return float(np.mean(squared / (np.exp(logarithm) * variance + instrument))) - 1.0

    low, high = _LIMITS
    if excess(low) <= 0.0:
        return float(np.exp(low))
    if excess(high) >= 0.0:
        return float(np.exp(high))
    return float(np.exp(brentq(excess, low, high)))
