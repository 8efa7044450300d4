"""Arrays that are checked once and never change again."""

from __future__ import annotations

from typing import TypeAlias, TypeVar, overload

import numpy as np
import numpy.typing as npt

from robotrue.errors import ShapeError

Array: TypeAlias = npt.NDArray[np.float64]
"""float64 array; shape, frame and unit are in the docstring of each use."""
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
Bytes: TypeAlias = npt.NDArray[np.uint8]
"""Bytes of a text."""
Ints: TypeAlias = npt.NDArray[np.int32]
"""Places in a text below 2 GiB."""
Integers: TypeAlias = npt.NDArray[np.integer]
"""Integers of any width."""
S = TypeVar("S", bound=np.generic)
Records: TypeAlias = np.ndarray[tuple[int], np.dtype[np.void]]
"""Records with named numbers, a row each; a kernel takes one of them as ``np.record``."""


@overload
def frozen(
    values: npt.ArrayLike, shape: tuple[int | None, ...], name: str, *, allow_nan: bool = False
) -> Array: ...


@overload
def frozen(
    values: npt.ArrayLike,
    shape: tuple[int | None, ...],
    name: str,
    *,
    dtype: type[S],
    allow_nan: bool = False,
) -> npt.NDArray[S]: ...


def frozen(
    values: npt.ArrayLike,
    shape: tuple[int | None, ...],
    name: str,
    *,
    dtype: type[np.generic] = np.float64,
    allow_nan: bool = False,
) -> npt.NDArray[np.generic]:
    """Returns ``values`` as a read-only array of the given shape.

    Args:
        values: Anything NumPy can read; copied only if it is writeable or of another type.
        shape: Expected shape; ``None`` leaves a dimension free.
        name: What the array is called in the message.
        dtype: Element type.
        allow_nan: NaN marks "not known" here.

    Raises:
        ShapeError: Wrong shape, or a value that is not finite.
    """
    if isinstance(values, np.ndarray) and values.dtype == dtype and not values.flags.writeable:
        array = values
    else:
        array = np.array(values, dtype=dtype)
    if array.shape != shape and not _fits(array.shape, shape):
        wanted = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        raise ShapeError(f"{name} has shape {array.shape}, expected {wanted}.")
    if array.dtype.kind == "f":
        bad = np.isinf(array) if allow_nan else ~np.isfinite(array)
        if np.count_nonzero(bad):
            where = tuple(int(i) for i in np.argwhere(bad)[0])
            raise ShapeError(f"{name}{list(where)} is {array[where]}, expected a finite number.")
    if array.flags.writeable:
        array.flags.writeable = False
    return array


def _fits(have: tuple[int, ...], want: tuple[int | None, ...]) -> bool:
    """True if a shape matches one with free dimensions."""
    if len(have) != len(want):
        return False
    for size, wanted in zip(have, want, strict=True):  # no generator: this is called very often
        if wanted is not None and size != wanted:
            return False
    return True


def parse_number_list(text: str) -> Array:
    """Returns the numbers (n,) of a text; empty where one of them is no finite number."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def as_range(places: IntArray) -> IntArray | slice:
    """Returns the places (k,) as a slice where they follow one another: no copies are made."""
    if len(places) and places[-1] - places[0] == len(places) - 1:
        return slice(int(places[0]), int(places[-1]) + 1)
    return places
