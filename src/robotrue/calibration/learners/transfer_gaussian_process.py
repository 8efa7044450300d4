"""Gaussian process that learns a target from few rows and from the rows of a source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from sklearn.utils import check_random_state

from robotrue.calibration.learners.gaussian_process import GaussianProcess
from robotrue.calibration.learners.process import (
    centre_rows,
    left_out_rows,
    log_evidence,
    process_posterior,
    split_theta,
)
from robotrue.calibration.learners.regressor import ProcessRegressor, logarithm
from robotrue.core.arrays import Array
from robotrue.errors import ShapeError

_JUDGED = 3
"""Target rows below which the source cannot be rejected."""


@dataclass(eq=False, repr=False)
class TransferGaussianProcess(ProcessRegressor):
    """Process of the target = rho times the process of the source + a separate difference.

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
        difference: Standard deviation of the separate difference; may be zero.
        rho: Factor of the source's process in the target.
        noise: Standard deviation of the white noise of target rows.
        source_noise: Standard deviation of the white noise of source rows.
        fall_back: False: the source is used regardless of the target rows.
        prior: "weak" or "none", as :class:`GaussianProcess`; the weak one has rho within 1 of 1
            and the difference about 0.3 standard deviations of the outputs, within e^1.5.
        intervals: "marginal" or "plug-in", as :class:`GaussianProcess`.
        restarts: Further searches from random places.
        random_state: Seed of the restarts.

    Attributes:
        used_source_: Whether predictions come from both domains.
        advantage_: Mean log probability of a target number given all other rows, less the same
            without source rows; NaN where it was not compared.
        rho_: Learned value of the argument; NaN when the source is not used.
        correlation_: Of target and source function at one place.
        length_: (d,).
        amplitude_: Standard deviation of the target's function.
        difference_: Standard deviation of the separate difference.
        noise_: Of a target row.
        source_noise_: Of a source row.
        inflation_: Factor on predictive variances by ``intervals``.
        log_marginal_likelihood_: Of all rows used.
    """

    kernel: Literal["ard", "isotropic"] = "ard"
    mean: Literal["per-domain", "constant", "zero"] = "per-domain"
    length: npt.ArrayLike | None = None
    amplitude: float | None = None
    difference: float | None = None
    rho: float | None = None
    noise: float | None = None
    source_noise: float | None = None
    fall_back: bool = True
    prior: Literal["weak", "none"] = "weak"
    intervals: Literal["marginal", "plug-in"] = "marginal"
    restarts: int = 0
    random_state: int | np.random.RandomState | None = 0

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
        inputs, outputs, weight = self._read_rows(
            X, y, sample_weight, least=2 if X_source is None else 1
        )
        self.advantage_ = float("nan")
        source = self._read_source(X_source, y_source, source_weight, (inputs, outputs))
        if source is None:
            self._use_target_alone(self._target_only().fit(inputs, outputs, sample_weight=weight))
            return self
        self._fit_both((inputs, outputs, weight), source)
        if self.fall_back and np.count_nonzero(weight) >= _JUDGED:
            self._compare(inputs, outputs, weight)
        return self

    def _fit_both(
        self, target: tuple[Array, Array, Array], source: tuple[Array, Array, Array]
    ) -> None:
        """Learns from inputs, outputs and weights of both domains."""
        weight, before = target[2], source[2]
        inputs, outputs, together = (
            np.concatenate([s, t]) for s, t in zip(source, target, strict=True)
        )
        if together.min() < 0.0 or not (weight.any() and before.any()):
            raise ShapeError(
                f"weights are zero or more, and some of each domain are more; the least is "
                f"{together.min():g}."
            )
        of_target = np.arange(len(together)) >= len(before)
        data = centre_rows(
            inputs,
            outputs,
            together,
            isotropic=self.kernel == "isotropic",
            mean=self.mean,
            prior=self.prior == "weak",
            target=of_target,
        )
        theta, self.inflation_ = self._search(
            data, self._fixed_theta(inputs.shape[1]), check_random_state(self.random_state)
        )
        self._posteriors, self._missed = (
            [process_posterior(data, theta)],
            left_out_rows(data, theta),
        )
        learned = split_theta(data, theta)
        self.used_source_ = True
        self.rho_, self.correlation_ = learned.rho, 0.0
        if learned.amplitude > 0.0:
            self.correlation_ = learned.coupling[0, 1] / np.sqrt(
                learned.coupling[0, 0] * learned.coupling[1, 1]
            )
        self.length_, self.amplitude_ = learned.length.copy(), learned.amplitude
        self.difference_ = learned.difference
        self.source_noise_, self.noise_ = learned.noise.tolist()
        self.log_marginal_likelihood_ = log_evidence(data, theta)[0]

    def _use_target_alone(self, alone: GaussianProcess) -> None:
        """Copies the process learned from target rows only."""
        self.used_source_ = False
        self.rho_ = self.correlation_ = self.difference_ = self.source_noise_ = float("nan")
        self._posteriors = alone._posteriors
        for name in ("length_", "amplitude_", "noise_", "inflation_", "log_marginal_likelihood_"):
            setattr(self, name, getattr(alone, name))

    def _compare(self, inputs: Array, outputs: Array, weight: Array) -> None:
        """Falls back when target rows are more probable without the source."""
        alone = self._target_only().fit(inputs, outputs, sample_weight=weight)
        self.advantage_ = _log_probability(*self._missed, self.inflation_) - _log_probability(
            *alone.predict_left_out(), float(alone.inflation_)
        )
        if self.advantage_ < 0.0:
            self._use_target_alone(alone)

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

    def _fixed_theta(self, columns: int) -> Array:
        """Returns theta of the fixed parameters, NaN for parameters to be learned."""
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


def _log_probability(residual: Array, variance: Array, factor: float) -> float:
    """Returns the mean log density of residuals (m, k) with variances (m,) times a factor."""
    wide = factor * variance[:, None]
    return float(-0.5 * np.mean(residual**2 / wide + np.log(2.0 * np.pi * wide)))
