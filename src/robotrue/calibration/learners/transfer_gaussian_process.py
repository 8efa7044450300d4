"""Gaussian process that learns a target from few rows and from the rows of a source."""

from __future__ import annotations

from functools import partial
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data

from robotrue.calibration.learners.checks import check_words, logarithm, source_rows
from robotrue.calibration.learners.gaussian_process import GaussianProcess
from robotrue.calibration.learners.process import rows
from robotrue.calibration.learners.search import best
from robotrue.calibration.learners.transfer_process import (
    TransferRows,
    left_out,
    log_evidence,
    log_posterior,
    parts,
    posterior_of,
    start_and_bounds,
)
from robotrue.calibration.learners.trust import inflation
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError, ShapeError

_JUDGED = 3
"""Target rows below which nothing can be said against the source."""


class TransferGaussianProcess(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """Process of the target = rho times the process of the source + a difference of its own.

    All outputs share the hyper-parameters and must have one unit. rho = 0 learns from target rows
    alone, rho = 1 without difference pools both. A hyper-parameter that is given is held.

    Without source rows it is a :class:`GaussianProcess`. It falls back to one when target rows,
    each predicted from all others, are more probable without the source than with it.

    Args:
        kernel: "ard" has one length for each input, "isotropic" one for all.
        mean: "per-domain" has a constant for each domain, "constant" one for both, integrated out
            with a flat prior; "zero" none.
        length: Number or (d,), in the unit of the inputs.
        amplitude: Standard deviation of the source's function.
        difference: Standard deviation of what the target has of its own; may be zero.
        rho: What the target takes over of the source.
        noise: Standard deviation of the white noise of target rows.
        source_noise: Standard deviation of the white noise of source rows.
        fall_back: False: the source is used whatever the target rows say.
        prior: "weak" or "none", as :class:`GaussianProcess`; the weak one has rho within 1 of 1
            and the difference about 0.3 standard deviations of the outputs, within e^1.5.
        intervals: "marginal" or "plug-in", as :class:`GaussianProcess`.
        restarts: Further searches from random places.
        random_state: Seed of the restarts.

    Attributes:
        used_source_: Whether predictions come from both domains.
        advantage_: Mean log probability of a target number given all other rows, less the same
            without source rows; NaN where it was not compared.
        rho_: What was learned, as the arguments; NaN when the source is not used.
        correlation_: Of target and source function at one place.
        length_: (d,).
        amplitude_: Standard deviation of the target's function.
        difference_: Of what it has of its own.
        noise_: Of a target row.
        source_noise_: Of a source row.
        inflation_: Factor on predictive variances by ``intervals``.
        log_marginal_likelihood_: Of all rows used.
    """

    def __init__(
        self,
        kernel: Literal["ard", "isotropic"] = "ard",
        mean: Literal["per-domain", "constant", "zero"] = "per-domain",
        length: npt.ArrayLike | None = None,
        amplitude: float | None = None,
        difference: float | None = None,
        rho: float | None = None,
        noise: float | None = None,
        source_noise: float | None = None,
        fall_back: bool = True,
        prior: Literal["weak", "none"] = "weak",
        intervals: Literal["marginal", "plug-in"] = "marginal",
        restarts: int = 0,
        random_state: int | np.random.RandomState | None = 0,
    ) -> None:
        self.kernel = kernel
        self.mean = mean
        self.length = length
        self.amplitude = amplitude
        self.difference = difference
        self.rho = rho
        self.noise = noise
        self.source_noise = source_noise
        self.fall_back = fall_back
        self.prior = prior
        self.intervals = intervals
        self.restarts = restarts
        self.random_state = random_state

    def fit(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        sample_weight: npt.ArrayLike | None = None,
        X_source: npt.ArrayLike | None = None,
        y_source: npt.ArrayLike | None = None,
        source_weight: npt.ArrayLike | None = None,
    ) -> Self:
        """Returns itself, fitted to target rows and, if given, source rows.

        Args:
            X: (m, d) target inputs.
            y: (m,) or (m, k) target outputs.
            sample_weight: (m,); a row of weight w has the noise variance over w.
            X_source: (n, d).
            y_source: (n,) or (n, k).
            source_weight: (n,).

        Raises:
            ConfigurationError: A parameter that is not one of its words, or out of range.
            ShapeError: Source and target of different shape, or weights that are negative.
            ObservabilityError: Rows that coincide and carry no noise.
            ValueError: What scikit-learn's own checks refuse.
        """
        self._check()
        inputs, values = validate_data(
            self,
            X,
            y,
            multi_output=True,
            y_numeric=True,
            dtype=np.float64,
            ensure_min_samples=2 if X_source is None else 1,
        )
        self._flat = np.ndim(values) == 1
        outputs = np.asarray(values, dtype=np.float64).reshape(len(inputs), -1)
        weight = _check_sample_weight(sample_weight, inputs, dtype=np.float64)
        self._alone: GaussianProcess | None = None
        self.advantage_ = float("nan")
        if X_source is None:
            if y_source is not None or source_weight is not None:
                raise ShapeError("y_source or source_weight without X_source.")
            self._fit_alone(inputs, outputs, weight)
            return self
        source, source_outputs = source_rows(X_source, y_source, inputs.shape[1], outputs.shape[1])
        before = _check_sample_weight(source_weight, source, dtype=np.float64)
        self._fit_both(inputs, outputs, weight, source, source_outputs, before)
        if self.fall_back and np.count_nonzero(weight) >= _JUDGED:
            self._compare(inputs, outputs, weight)
        return self

    def predict(
        self,
        X: npt.ArrayLike,
        return_std: bool = False,
        return_cov: bool = False,
        noisy: bool = True,
    ) -> Any:
        """Returns the target's mean (m,) or (m, k), and on request how far to trust it.

        Args:
            X: (m, d).
            return_std: Also the standard deviation, of the shape of the mean.
            return_cov: Also the covariance between all rows, (m, m) or (m, m, k).
            noisy: The deviation is that of a measurement, with the learned noise; False: of the
                function.

        Raises:
            ConfigurationError: Both deviation and covariance asked for.
        """
        check_is_fitted(self)
        if return_std and return_cov:
            raise ConfigurationError("return_std and return_cov are one or the other.")
        inputs = validate_data(self, X, reset=False, dtype=np.float64)
        if self._alone is not None:
            found = self._alone.predict(inputs, return_std, return_cov, noisy)
            if not (return_std or return_cov):
                return self._shaped(found)
            return tuple(self._shaped(part) for part in found)
        white = self.noise_**2 if noisy else 0.0
        if return_cov:
            mean, spread = self._posterior.mean(inputs), self._posterior.covariance(inputs)
            spread = self.inflation_ * (spread + white * np.eye(len(inputs)))
            each = np.repeat(spread[:, :, None], mean.shape[1], axis=2)
            return self._shaped(mean), self._shaped(each)
        if not return_std:
            return self._shaped(self._posterior.mean(inputs))
        mean, variance = self._posterior.mean_and_variance(inputs)
        deviation = np.sqrt(self.inflation_ * (variance + white))
        return self._shaped(mean), self._shaped(np.repeat(deviation[:, None], mean.shape[1], 1))

    def _fit_both(
        self,
        inputs: Array,
        outputs: Array,
        weight: Array,
        source: Array,
        source_outputs: Array,
        before: Array,
    ) -> None:
        together = np.concatenate([before, weight])
        if together.min() < 0.0 or not (weight.any() and before.any()):
            raise ShapeError(
                f"weights are zero or more, and some of each domain are more; the least is "
                f"{together.min():g}."
            )
        target = np.arange(len(together)) >= len(before)
        data = TransferRows(
            rows=rows(
                np.concatenate([source, inputs]),
                np.concatenate([source_outputs, outputs]),
                together,
                np.zeros(len(together)),
                isotropic=self.kernel == "isotropic",
                mean="zero" if self.mean == "zero" else "constant",
                repeats=False,
                prior=self.prior == "weak",
            ),
            target=target[together > 0.0],
            apart=self.mean == "per-domain",
        )
        held = self._held(inputs.shape[1])
        start, bounds = start_and_bounds(data)
        objective = partial(log_posterior, data)
        random = check_random_state(self.random_state)
        theta = best(objective, start, bounds, held, self.restarts, random)
        self.inflation_ = 1.0
        if self.intervals == "marginal":
            missed = partial(left_out, data)
            self.inflation_ = inflation(objective, missed, theta, bounds, np.isnan(held))
        self._posterior, self._target = posterior_of(data, theta), left_out(data, theta)
        learned = parts(theta, inputs.shape[1])
        self.used_source_ = True
        self.rho_, self.correlation_ = learned.rho, 0.0
        if learned.amplitude > 0.0:
            self.correlation_ = learned.rho * learned.source / learned.amplitude
        self.length_, self.amplitude_ = learned.length.copy(), learned.amplitude
        self.difference_ = learned.difference
        self.noise_, self.source_noise_ = learned.target_noise, learned.source_noise
        self.log_marginal_likelihood_ = log_evidence(data, theta)[0]

    def _fit_alone(self, inputs: Array, outputs: Array, weight: Array) -> None:
        """Learns from target rows only."""
        self._alone = self._target_only().fit(inputs, outputs, sample_weight=weight)
        self.used_source_ = False
        self.rho_ = self.correlation_ = self.difference_ = self.source_noise_ = float("nan")
        for name in ("length_", "amplitude_", "noise_", "inflation_", "log_marginal_likelihood_"):
            setattr(self, name, getattr(self._alone, name))

    def _compare(self, inputs: Array, outputs: Array, weight: Array) -> None:
        """Falls back when target rows are more probable without the source."""
        alone = self._target_only().fit(inputs, outputs, sample_weight=weight)
        missed = alone.left_out()
        factors = self.inflation_, float(alone.inflation_)
        self.advantage_ = _log_probability(*self._target, factors[0]) - _log_probability(
            *missed, factors[1]
        )
        if self.advantage_ < 0.0:
            self._fit_alone(inputs, outputs, weight)

    def _target_only(self) -> GaussianProcess:
        return GaussianProcess(
            kernel=self.kernel,
            mean="zero" if self.mean == "zero" else "constant",
            length=self.length,
            noise=self.noise,
            prior=self.prior,
            intervals=self.intervals,
            restarts=self.restarts,
            random_state=self.random_state,
        )

    def _held(self, columns: int) -> Array:
        """Returns theta of what is given, NaN where something is to be learned."""
        rho = np.nan if self.rho is None else float(self.rho)
        count = columns if self.kernel == "ard" else 1
        return np.concatenate(
            [
                logarithm("length", self.length, count),
                logarithm("amplitude", self.amplitude, 1),
                logarithm("difference", self.difference, 1, zero=True),
                [rho],
                logarithm("noise", self.noise, 1, zero=True),
                logarithm("source_noise", self.source_noise, 1, zero=True),
            ]
        )

    def _check(self) -> None:
        check_words(self, "kernel", ("ard", "isotropic"))
        check_words(self, "mean", ("per-domain", "constant", "zero"))
        check_words(self, "prior", ("weak", "none"))
        check_words(self, "intervals", ("marginal", "plug-in"))

    def _shaped(self, values: Array) -> Array:
        return values[..., 0] if self._flat else values


def _log_probability(residual: Array, variance: Array, factor: float) -> float:
    """Returns the mean log density of residuals (m, k) with variances (m,) times a factor."""
    wide = factor * variance[:, None]
    return float(-0.5 * np.mean(residual**2 / wide + np.log(2.0 * np.pi * wide)))
