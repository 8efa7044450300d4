"""TrAdaBoost.R2: boosting of a regressor on target rows with the help of source rows.

Deng et al. 2022, eq. 19-26, with a switch for every equation that can be read in several ways:

======  =======================================================================================
eq. 19  source rows have no initial weight as printed; here 1 / (n + m) times ``source_weight``
eq. 20  ``|w (y - G)|`` is over all outputs: one error and one weight for each row. w is one
        for all rows (``output_weights``), or one for each row and output (``error_weights``)
eq. 22  weights sum to one over source and target, so that few target rows never reach the limit
        of 0.5: ``error_over="all"`` as printed, "target" divides by the target's share
eq. 23  target rows: weight times beta^(1 - e); Pardoe and Stone: beta^(-e), the same up to the
        target's share of the whole
eq. 24  ln(1 / beta) for every source row, whatever its error, and far above a target row:
        ``source_weights="literal"``. "frozen" leaves them as they are; "decay" multiplies by
        beta_s^e, beta_s = 1 / (1 + sqrt(2 ln n / N)); "pardoe" does so too, with beta^(-e) for the
        target and errors relative to the largest of all rows
eq. 25  sum of ln(1 / beta) times the median of beta G has the wrong scale:
        ``combination="literal"``; "weighted-median" is the median of G with weights ln(1 / beta)
======  =======================================================================================

Sources: Deng et al. 2022, section 2.2; Pardoe and Stone, Boosting for regression transfer, ICML
2010, algorithms 2 and 3; Drucker, Improving regressors using boosting techniques, ICML 1997.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted, validate_data

from robotrue.calibration.learners.gaussian_process import GaussianProcess
from robotrue.calibration.learners.regressor import Regressor
from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ShapeError

_LEAST_ERROR, _LEAST_WEIGHT = 1e-12, 1e-12


@dataclass(eq=False, repr=False)
class TrAdaBoostR2(Regressor):
    """Boosted regressor with one weight per row, for one or several outputs.

    Args:
        estimator: Any regressor whose ``fit`` takes ``sample_weight``; None is a
            :class:`GaussianProcess`. It is given weights of mean one.
        rounds: Largest number of learners (N).
        source_weights: Reading of eq. 24.
        error_over: Reading of eq. 22.
        combination: Reading of eq. 25.
        output_weights: (k,) measurement weights of eq. 20, ones when None.
        hyper_parameters: "first-round" learns those of a :class:`GaussianProcess` once and solves
            the other rounds with the same kernel; "each-round" learns them again.

    Attributes:
        estimators_: Learners kept, first round first.
        betas_: (T,) beta of each.
        errors_: (T,) weighted error of each, eq. 22.
        weights_: (T, n + m) weights each was fitted with, source rows first, sum one.
    """

    estimator: Any = None
    rounds: int = 10
    source_weights: Literal["frozen", "literal", "pardoe", "decay"] = "frozen"
    error_over: Literal["target", "all"] = "target"
    combination: Literal["weighted-median", "literal"] = "weighted-median"
    output_weights: npt.ArrayLike | None = None
    hyper_parameters: Literal["first-round", "each-round"] = "first-round"

    def fit(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        sample_weight: npt.ArrayLike | None = None,
        X_source: npt.ArrayLike | None = None,
        y_source: npt.ArrayLike | None = None,
        source_weight: npt.ArrayLike | None = None,
        error_weights: npt.ArrayLike | None = None,
        source_error_weights: npt.ArrayLike | None = None,
    ) -> Self:
        """Returns itself, fitted to target rows and, if given, source rows.

        Args:
            X: (m, d) target inputs.
            y: (m,) or (m, k) target outputs.
            sample_weight: (m,) initial weights of target rows; eq. 19 has sigma_in where
                sub-spaces overlap and sigma_non elsewhere.
            X_source: (n, d) source inputs, moved into the target's space beforehand.
            y_source: (n,) or (n, k) source outputs.
            source_weight: (n,) initial weights of source rows, ones when None.
            error_weights: (m, k) measurement weights of eq. 20, of each target row; ones when None.
            source_error_weights: (n, k), of each source row.

        Raises:
            ConfigurationError: A parameter that is not one of its words, or out of range.
            ShapeError: Source and target of different shape, or weights of another shape.
            ValueError: What scikit-learn's own checks refuse.
        """
        inputs, outputs, weight = self._read_rows(X, y, sample_weight)
        count = len(inputs)
        scale = self._error_scale(error_weights, outputs.shape)
        source = self._read_source(X_source, y_source, source_weight, (inputs, outputs))
        if source is not None:
            scale = np.concatenate(
                [self._error_scale(source_error_weights, source[1].shape), scale]
            )
            inputs, outputs, weight = (
                np.concatenate(both) for both in zip(source, (inputs, outputs, weight), strict=True)
            )
        target = np.arange(len(inputs)) >= len(inputs) - count
        used = weight > 0.0
        if weight.min() < 0.0 or not (used & target).any():
            raise ShapeError(
                "initial weights are zero or more, and those of some target rows are more; "
                f"the least is {weight.min():g}."
            )
        self._boost(inputs[used], outputs[used], weight[used], target[used], scale[used])
        return self

    def predict(self, X: npt.ArrayLike, return_std: bool = False) -> Any:
        """Returns the combined prediction (m,) or (m, k), eq. 25, and on request its deviation.

        The deviation is that of the mixture of all learners with weights ln(1 / beta): their own,
        and the spread between them. It needs learners with ``predict(return_std=True)``.
        """
        check_is_fitted(self)
        inputs = validate_data(self, X, reset=False, dtype=np.float64)
        each = self._each(inputs)
        combined = combine_rounds(each, self.betas_, self.combination)
        if not return_std:
            return self._drop_axis(combined)
        share = round_shares(self.betas_)
        own = np.array([e.predict(inputs, return_std=True)[1] for e in self.estimators_])
        own = own.reshape(each.shape)
        centre = np.tensordot(share, each, axes=1)
        variance = np.tensordot(share, own**2 + (each - centre) ** 2, axes=1)
        return self._drop_axis(combined), self._drop_axis(np.sqrt(variance))

    def _boost(
        self, inputs: Array, outputs: Array, weight: Array, target: BoolArray, scale: Array
    ) -> None:
        rows, source = len(inputs), ~target
        decay = 1.0 / (1.0 + np.sqrt(2.0 * np.log(max(source.sum(), 1)) / self.rounds))
        weight = weight / weight.sum()
        self.estimators_: list[Any] = []
        betas, errors, weights = [], [], []
        for _ in range(self.rounds):
            learner = self._learner(inputs, outputs, np.maximum(weight * rows, _LEAST_WEIGHT))
            predicted = np.asarray(learner.predict(inputs)).reshape(rows, -1)
            miss = np.linalg.norm(scale * (outputs - predicted), axis=1)
            judged = target | (self.source_weights == "pardoe")
            largest = float(miss[judged].max())
            error = np.minimum(miss / largest, 1.0) if largest > 0.0 else np.zeros(rows)
            total = float((error * weight)[target].sum())
            if self.error_over == "target":
                total /= float(weight[target].sum())
            if total > 0.5 and self.estimators_:
                break
            beta = max(total, _LEAST_ERROR) / (1.0 - min(total, 0.5 - _LEAST_ERROR))
            self.estimators_.append(learner)
            betas.append(min(beta, 1.0 - _LEAST_ERROR))
            errors.append(total)
            weights.append(weight)
            if total > 0.5 or largest == 0.0:
                break
            weight = self._next(weight, error, target, beta, float(decay))
        self.betas_, self.errors_ = np.array(betas), np.array(errors)
        self.weights_ = np.array(weights)

    def _next(
        self, weight: Array, error: Array, target: BoolArray, beta: float, decay: float
    ) -> Array:
        """Returns the weights of the next round, sum one: eq. 23 and 24."""
        out, source = weight.copy(), ~target
        if self.source_weights == "pardoe":
            out[target] *= beta ** -error[target]
        else:
            out[target] *= beta ** (1.0 - error[target])
        if self.source_weights == "frozen":
            out[target] *= weight[target].sum() / out[target].sum()
        elif self.source_weights == "literal":
            out[source] = np.log(1.0 / beta)
        else:
            out[source] *= decay ** error[source]
        return np.asarray(out / out.sum())

    def _learner(self, inputs: Array, outputs: Array, weight: Array) -> Any:
        once = self.hyper_parameters == "first-round"
        if once and self.estimators_ and isinstance(self.estimators_[0], GaussianProcess):
            return self.estimators_[0].reweight(weight)
        learner = GaussianProcess() if self.estimator is None else clone(self.estimator)
        values = outputs[:, 0] if self._flat else outputs
        return learner.fit(inputs, values, sample_weight=weight)

    def _each(self, inputs: Array) -> Array:
        """Returns the prediction of every learner, (T, m, k)."""
        first = self.estimators_[0]
        if self.hyper_parameters == "first-round" and isinstance(first, GaussianProcess):
            parts = []
            for same in zip(*(e._posteriors for e in self.estimators_), strict=True):
                joint = replace(
                    same[0],
                    weights=np.concatenate([p.weights for p in same], axis=1),
                    offset=np.concatenate([p.offset for p in same]),
                )
                parts.append(joint.mean(inputs).reshape(len(inputs), len(same), -1))
            return np.moveaxis(np.concatenate(parts, axis=2), 1, 0)
        each = [np.asarray(e.predict(inputs)).reshape(len(inputs), -1) for e in self.estimators_]
        return np.stack(each)

    def _error_scale(self, stated: npt.ArrayLike | None, shape: tuple[int, ...]) -> Array:
        """Returns the weights (rows, k) of errors in eq. 20: those of rows times of outputs."""
        scale = np.ones(shape)
        for name, value, wanted in (
            ("output_weights", self.output_weights, shape[1:]),
            ("error weights", stated, shape),
        ):
            if value is None:
                continue
            given = np.asarray(value, dtype=np.float64)
            if given.shape != wanted or not (np.isfinite(given) & (given >= 0.0)).all():
                raise ShapeError(
                    f"{name} of shape {given.shape}, expected {wanted} numbers of zero or more."
                )
            scale = scale * given
        return scale


def combine_rounds(each: Array, betas: Array, combination: str) -> Array:
    """Returns the combined prediction (m, k) of rounds (T, m, k) with betas (T,), eq. 25."""
    confidence = np.log(1.0 / betas)
    if combination == "literal":
        return np.asarray(confidence.sum() * np.median(betas[:, None, None] * each, axis=0))
    return weighted_median(each, confidence)


def round_shares(betas: Array) -> Array:
    """Returns the share (T,) of each round in the mixture of all: ln(1 / beta), sum one."""
    confidence = np.log(1.0 / betas)
    return np.asarray(confidence / confidence.sum())


def weighted_median(values: Array, weights: Array) -> Array:
    """Returns the weighted median over the first axis of values (T, ...), weights (T,).

    The smallest value at which the weights of it and of all below reach half of their sum.
    """
    order = np.argsort(values, axis=0, kind="stable")
    reached = np.cumsum(weights[order], axis=0) >= 0.5 * weights.sum()
    chosen = np.take_along_axis(order, reached.argmax(axis=0)[None], axis=0)
    return np.asarray(np.take_along_axis(values, chosen, axis=0)[0])
