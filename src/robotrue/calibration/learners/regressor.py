"""Base of all learners: scikit-learn's parameters and rows, and prediction."""

from __future__ import annotations

from functools import partial
from typing import Any, Final, Literal, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import (
    _check_sample_weight,
    check_array,
    check_is_fitted,
    validate_data,
)

from robotrue.calibration.learners.posterior import ProcessPosterior
from robotrue.calibration.learners.process import (
    TrainingRows,
    left_out_rows,
    log_posterior,
    start_and_bounds,
)
from robotrue.calibration.learners.search import inflation_factor, search_theta
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError, ShapeError

_LEAST: Final = {"restarts": 0, "rounds": 1}
"""Least of the parameters that are counts."""


class Regressor(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """Reads rows of one or several outputs, of a target and perhaps of a source."""

    def _check_parameters(self) -> None:
        """Checks words, which the annotations list, and counts.

        Raises:
            ConfigurationError: One that is not allowed.
        """
        for name, hint in get_type_hints(type(self).__init__).items():
            words = get_args(hint)
            if get_origin(hint) is Literal and getattr(self, name) not in words:
                raise ConfigurationError(
                    f"{name} is {getattr(self, name)!r}; allowed are {', '.join(words)}."
                )
        for name, least in _LEAST.items():
            value = getattr(self, name, least)
            if value < least:
                raise ConfigurationError(f"{name} is {value}, expected {least} or more.")

    def _read_rows(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        sample_weight: npt.ArrayLike | None,
        *,
        least: int = 1,
    ) -> tuple[Array, Array, Array]:
        """Returns inputs (n, d), outputs (n, k) and weights (n,), after checking the parameters."""
        self._check_parameters()
        inputs, values = validate_data(
            self,
            X,
            y,
            multi_output=True,
            y_numeric=True,
            dtype=np.float64,
            ensure_min_samples=least,
        )
        self._flat = np.ndim(values) == 1
        outputs = np.asarray(values, dtype=np.float64).reshape(len(inputs), -1)
        return inputs, outputs, _check_sample_weight(sample_weight, inputs, dtype=np.float64)

    def _read_source(
        self,
        X: npt.ArrayLike | None,
        y: npt.ArrayLike | None,
        sample_weight: npt.ArrayLike | None,
        target: tuple[Array, Array],
    ) -> tuple[Array, Array, Array] | None:
        """Returns inputs, outputs and weights of source rows that look like the target's.

        Raises:
            ShapeError: They do not, or some of them are missing.
            ValueError: NaN or text, from scikit-learn's own checks.
        """
        columns, outputs = target[0].shape[1], target[1].shape[1]
        if X is None:
            if y is not None or sample_weight is not None:
                raise ShapeError("y_source or source_weight without X_source.")
            return None
        if y is None:
            raise ShapeError("X_source without y_source.")
        inputs = check_array(X, dtype=np.float64)
        values = check_array(y, dtype=np.float64, ensure_2d=False)
        values = values.reshape(len(values), -1)
        if inputs.shape[1] != columns or values.shape != (len(inputs), outputs):
            raise ShapeError(
                f"source rows have {inputs.shape} inputs and {values.shape} outputs, expected "
                f"(any, {columns}) and (as many, {outputs})."
            )
        return inputs, values, _check_sample_weight(sample_weight, inputs, dtype=np.float64)

    def _drop_axis(self, values: Array) -> Array:
        """Returns values (..., k), without the last axis where one output came without it."""
        return values[..., 0] if self._flat else values


class ProcessRegressor(Regressor):
    """Predicts from one process for all outputs, or from one for each."""

    intervals: Literal["marginal", "plug-in"]
    restarts: int
    _posteriors: list[ProcessPosterior]
    noise_: Any
    inflation_: Any

    def predict(
        self,
        X: npt.ArrayLike,
        return_std: bool = False,
        return_cov: bool = False,
        noisy: bool = True,
    ) -> Any:
        """Returns the mean (m,) or (m, k), and on request its uncertainty.

        Args:
            X: (m, d), of the target where there is a source too.
            return_std: Also the standard deviation, of the shape of the mean.
            return_cov: Also the covariance between all rows, (m, m) or (m, m, k).
            noisy: The deviation is that of a measurement, with the learned noise; False: of the
                function.

        Raises:
            ConfigurationError: Both deviation and covariance are requested.
        """
        check_is_fitted(self)
        if return_std and return_cov:
            raise ConfigurationError("return_std and return_cov are one or the other.")
        inputs = validate_data(self, X, reset=False, dtype=np.float64)
        noise = np.atleast_1d(self.noise_) ** 2 * noisy
        factor = np.atleast_1d(self.inflation_)
        if not return_std:
            mean = np.concatenate([p.mean(inputs) for p in self._posteriors], axis=1)
            if not return_cov:
                return self._drop_axis(mean)
            spread = [
                f * (p.covariance(inputs) + s * np.eye(len(inputs)))
                for p, s, f in zip(self._posteriors, noise, factor, strict=True)
            ]
            return self._drop_axis(mean), self._spread(np.stack(spread, axis=-1), mean)
        both = [p.mean_and_variance(inputs) for p in self._posteriors]
        mean = np.concatenate([m for m, _ in both], axis=1)
        variance = factor * (np.column_stack([v for _, v in both]) + noise)
        return self._drop_axis(mean), self._spread(np.sqrt(variance), mean)

    def _spread(self, values: Array, mean: Array) -> Array:
        """Returns values (..., 1 or k) for each of the k outputs."""
        each = np.broadcast_to(values, (*values.shape[:-1], mean.shape[1])).copy()
        return self._drop_axis(each)

    def _search(
        self, data: TrainingRows, held: Array, random: np.random.RandomState
    ) -> tuple[Array, float]:
        """Returns the best theta (p,) of some rows, and the factor on their variances.

        Args:
            data: The rows.
            held: (p,) what is given; NaN is learned.
            random: Of the restarts.
        """
        start, bounds = start_and_bounds(data)
        value = partial(log_posterior, data)
        theta = search_theta(value, start, bounds, held, restarts=self.restarts, random=random)
        if self.intervals == "plug-in":
            return theta, 1.0
        left_out = partial(left_out_rows, data)
        return theta, inflation_factor(value, left_out, theta, bounds, np.isnan(held))


def logarithm(name: str, value: npt.ArrayLike | None, size: int, *, zero: bool = False) -> Array:
    """Returns log of a number or (size,) numbers as (size,); NaN when None, -inf of zero.

    Raises:
        ShapeError: Another number of values.
        ConfigurationError: A value that is negative or not finite, or zero where not allowed.
    """
    if value is None:
        return np.full(size, np.nan)
    number = np.asarray(value, dtype=np.float64)
    if number.ndim > 1 or number.size not in (1, size):
        raise ShapeError(f"{name} has shape {number.shape}, expected () or ({size},).")
    if not (np.isfinite(number) & ((number >= 0.0) if zero else (number > 0.0))).all():
        least = "zero or more" if zero else "a positive number"
        raise ConfigurationError(f"{name} is {value}, expected {least}.")
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.broadcast_to(number, (size,))))


def row_values(values: npt.ArrayLike | None, count: int, name: str) -> Array:
    """Returns (count,) values of zero or more, zeros when None.

    Raises:
        ShapeError: Another number of values, or values that are negative or not finite.
    """
    if values is None:
        return np.zeros(count)
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (count,):
        raise ShapeError(f"{name} has shape {array.shape}, expected ({count},).")
    if not (np.isfinite(array) & (array >= 0.0)).all():
        raise ShapeError(f"{name} has values that are negative or not finite.")
    return array
