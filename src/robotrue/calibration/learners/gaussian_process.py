"""Gaussian process regression as a scikit-learn estimator.

Names of the paper this package reproduces (Deng et al. 2022, eq. 27-32) are reached by
``kernel="isotropic"``, ``denominator="literal"`` (eq. 28 divides by 2 sigma_l, not by its square),
``mean="constant"`` (eq. 27) or ``mean="zero"`` (eq. 31 drops it), and ``predict(noisy=False)``
(eq. 32 is the variance of the function, without the noise of a measurement).
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from robotrue.calibration.learners.posterior import Solved
from robotrue.calibration.learners.process import (
    TrainingRows,
    centre_rows,
    correlate_rows,
    left_out_rows,
    log_evidence,
    process_posterior,
    solve_rows,
    split_theta,
    weigh_evidence,
)
from robotrue.calibration.learners.regressor import ProcessRegressor, logarithm, row_values
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError, ShapeError


@dataclass(eq=False, repr=False)
class GaussianProcess(ProcessRegressor):
    """Squared exponential process with white noise and a constant or zero mean.

    A hyper-parameter that is given is held; the others are learned by marginal likelihood. All are
    in the unit of what was passed to :meth:`fit`. The learned noise is at least 1e-4 standard
    deviations of the outputs.

    Args:
        kernel: "ard" has one length for each input, "isotropic" one for all.
        mean: "constant" is integrated out with a flat prior, "estimated" is set to its generalised
            least squares value, "zero" is none.
        shared: One set of hyper-parameters for all outputs, which then must have one unit; or one
            for each output.
        length: Number or (d,), in the unit of the inputs.
        amplitude: Standard deviation of the function.
        noise: Standard deviation of the white noise.
        denominator: "squared" is exp(-d^2 / 2 length^2), "literal" exp(-d^2 / 2 length).
        weights: A row of weight w has the noise variance of the row over w. "precision" leaves it
            at that; "repeats" also counts it as w rows when hyper-parameters are learned, so that
            weight 2 is the row twice.
        prior: "weak" is log-normal: lengths about sqrt(d) standard deviations of their input
            within a factor e, amplitude about that of the outputs within e^1.5, noise about a tenth
            of it within e^2. It matters with few rows only. "none" is marginal likelihood alone.
        intervals: "marginal" widens them for what few rows leave open about the hyper-parameters
            that were learned; "plug-in" takes these as known.
        optimise: False: nothing is learned; length, amplitude and noise must be given.
        restarts: Further searches from random places.
        random_state: Seed of the restarts.

    Attributes:
        length_: (d,), or (k, d) when not shared.
        amplitude_: Number, or (k,).
        noise_: Number, or (k,).
        mean_: (k,) constant mean of each output.
        log_marginal_likelihood_: At these, summed over the outputs.
        inflation_: Number, or (k,): factor on predictive variances by ``intervals``.
        output_correlation_: (k, k) of the outputs about the process, from whitened residuals.
    """

    kernel: Literal["ard", "isotropic"] = "ard"
    mean: Literal["constant", "estimated", "zero"] = "constant"
    shared: bool = True
    length: npt.ArrayLike | None = None
    amplitude: float | None = None
    noise: float | None = None
    denominator: Literal["squared", "literal"] = "squared"
    weights: Literal["precision", "repeats"] = "precision"
    prior: Literal["weak", "none"] = "weak"
    intervals: Literal["marginal", "plug-in"] = "marginal"
    optimise: bool = True
    restarts: int = 0
    random_state: int | np.random.RandomState | None = 0

    def fit(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        sample_weight: npt.ArrayLike | None = None,
        noise_variance: npt.ArrayLike | None = None,
    ) -> Self:
        """Returns itself, fitted to inputs (n, d) and outputs (n,) or (n, k).

        Args:
            X: (n, d).
            y: (n,) or (n, k).
            sample_weight: (n,); rows of weight zero are left out.
            noise_variance: (n,) known variance of each row, besides the learned noise.

        Raises:
            ConfigurationError: A parameter that is not one of its words, or out of range.
            ShapeError: Weights or variances that are negative or of another shape.
            ObservabilityError: Rows that coincide and carry no noise.
            ValueError: What scikit-learn's own checks refuse: NaN, text, one row.
        """
        inputs, outputs, weight = self._read_rows(X, y, sample_weight, least=2)
        variance = row_values(noise_variance, len(inputs), "noise_variance")
        if weight.min() < 0.0 or not weight.any():
            raise ShapeError(
                f"sample_weight has minimum {weight.min():g} and sum {weight.sum():g}; "
                "weights are zero or more, and some are more."
            )
        held = self._fixed_theta(inputs.shape[1])
        random = check_random_state(self.random_state)
        groups = [outputs] if self.shared else [outputs[:, [j]] for j in range(outputs.shape[1])]
        self._rows: list[TrainingRows] = [
            centre_rows(
                inputs,
                group,
                weight,
                variance,
                isotropic=self.kernel == "isotropic",
                mean=self.mean,
                repeats=self.weights == "repeats",
                prior=self.prior == "weak",
            )
            for group in groups
        ]
        both = [self._search(data, held, random) for data in self._rows]
        self._theta, factors = [theta for theta, _ in both], np.array([f for _, f in both])
        self.inflation_ = float(factors[0]) if len(factors) == 1 else factors
        self._correlations = [
            correlate_rows(data, theta) for data, theta in zip(self._rows, self._theta, strict=True)
        ]
        self._learn()
        return self

    def reweight(self, sample_weight: Array) -> GaussianProcess:
        """Returns this process with other weights on the rows of its fit, without learning again.

        Args:
            sample_weight: (n,) of the rows that had a weight, all positive.

        Raises:
            ShapeError: Another number of weights, or weights that are not positive.
        """
        check_is_fitted(self)
        weight = row_values(sample_weight, len(self._rows[0].inputs), "sample_weight")
        if not weight.min() > 0.0:
            raise ShapeError("sample_weight has a zero, expected positive weights.")
        other = copy(self)
        other._rows = [replace(data, weight=weight) for data in self._rows]
        other._learn()
        return other

    def predict_left_out(self) -> tuple[Array, Array]:
        """Returns residual (n, k) and variance (n,) of every row predicted from all others.

        With the hyper-parameters of all rows; rows of weight zero are ignored.

        Raises:
            ConfigurationError: Several outputs with their own hyper-parameters.
        """
        check_is_fitted(self)
        return left_out_rows(self._only(), self._theta[0])

    def log_marginal_likelihood(
        self, theta: npt.ArrayLike | None = None, eval_gradient: bool = False
    ) -> Any:
        """Returns the log evidence, and on request its gradient, of a shared fit or one output.

        Args:
            theta: (p,) logarithms of lengths, amplitude and noise; those learned when None.
            eval_gradient: Also the gradient (p,).

        Raises:
            ConfigurationError: Several outputs with their own hyper-parameters.
        """
        check_is_fitted(self)
        data = self._only()
        at = self._theta[0] if theta is None else np.asarray(theta, dtype=np.float64)
        value, gradient = log_evidence(data, at)
        return (value, gradient) if eval_gradient else value

    def _only(self) -> TrainingRows:
        if len(self._rows) != 1:
            raise ConfigurationError(
                f"{len(self._rows)} outputs with a theta each.", hint="shared=True, or one output."
            )
        return self._rows[0]

    def _learn(self) -> None:
        """Sets everything learned from rows and theta."""
        each = list(zip(self._rows, self._theta, strict=True))
        solved = [
            solve_rows(data, theta, near)
            for (data, theta), near in zip(each, self._correlations, strict=True)
        ]
        self._posteriors = [process_posterior(*e, s) for e, s in zip(each, solved, strict=True)]
        self.log_marginal_likelihood_ = float(
            sum(weigh_evidence(*e, s) for e, s in zip(each, solved, strict=True))
        )
        length = np.array([split_theta(data, theta).length for data, theta in each])
        theta = np.exp(self._theta)
        if self.denominator == "literal":
            length = length**2
        one = len(theta) == 1
        self.length_ = length[0] if one else length
        self.amplitude_ = float(theta[0, -2]) if one else theta[:, -2]
        self.noise_ = float(theta[0, -1]) if one else theta[:, -1]
        self.mean_ = np.concatenate([p.offset for p in self._posteriors])
        white = np.concatenate(
            [s.whiten_rows(_residuals(d, s)) for s, d in zip(solved, self._rows, strict=True)],
            axis=1,
        )
        size = np.sqrt(np.einsum("ij,ij->j", white, white))
        size = np.where(size > 0.0, size, 1.0)
        self.output_correlation_ = (white / size).T @ (white / size)
        np.fill_diagonal(self.output_correlation_, 1.0)

    def _fixed_theta(self, columns: int) -> Array:
        """Returns theta of the fixed parameters, NaN for parameters to be learned."""
        if not self.optimise:
            for name in ("length", "amplitude", "noise"):
                if getattr(self, name) is None:
                    raise ConfigurationError(
                        f"optimise=False with {name} not given.", hint=f"state {name}."
                    )
        length = logarithm("length", self.length, columns if self.kernel == "ard" else 1)
        return np.concatenate(
            [
                0.5 * length if self.denominator == "literal" else length,
                logarithm("amplitude", self.amplitude, 1),
                logarithm("noise", self.noise, 1, zero=True),
            ]
        )


def _residuals(data: TrainingRows, solved: Solved) -> Array:
    return np.asarray(data.outputs - data.trend() @ solved.trend)
