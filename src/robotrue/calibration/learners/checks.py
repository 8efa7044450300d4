"""What the estimators ask of their parameters and of source rows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from sklearn.utils.validation import check_array

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError, ShapeError


def check_words(estimator: object, name: str, words: tuple[str, ...]) -> None:
    """Checks that a parameter is one of its words.

    Raises:
        ConfigurationError: It is not.
    """
    value = getattr(estimator, name)
    if value not in words:
        raise ConfigurationError(f"{name} is {value!r}; allowed are {', '.join(words)}.")


def check_count(name: str, value: int, least: int) -> None:
    """Checks that a count is large enough.

    Raises:
        ConfigurationError: It is not.
    """
    if value < least:
        raise ConfigurationError(f"{name} is {value}, expected {least} or more.")


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


def source_rows(
    X: npt.ArrayLike, y: npt.ArrayLike | None, columns: int, outputs: int
) -> tuple[Array, Array]:
    """Returns source inputs (n, columns) and outputs (n, outputs).

    Raises:
        ShapeError: Source rows that do not look like the target's.
        ValueError: NaN or text, from scikit-learn's own checks.
    """
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
    return inputs, values
