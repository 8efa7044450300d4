"""Frozen tables of columns: shapes declared with the fields, checked once, cut by rows.

A noun of the product that holds arrays inherits from :class:`Columns` and declares for each array
its shape, in sizes shared by all fields of one object, and its unit::

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Touches(Columns):
        names: Annotated[tuple[str, ...], Column("n")]
        point: Annotated[Array, Column("n 3", unit="m")]
        normal: Annotated[Array, Column("n 3", fill=np.nan)] = EMPTY
        radius: float = 0.0

The element type is that of the annotation (``Array``, ``IntArray``, ``BoolArray``, ...). The first
column that names a size sets it. ``n`` counts the rows; a table inside a table that shares its rows
needs ``__len__``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Final,
    NamedTuple,
    Self,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import BoolArray, IntArray
from robotrue.core.json_values import json_values
from robotrue.errors import ShapeError

ROWS: Final = "n"
"""The size that counts the rows of a table."""
FREE: Final = "_"
"""A dimension that no other field shares."""
Rows: TypeAlias = slice | IntArray | BoolArray
"""Which rows: a slice, indices or a mask."""
Values: TypeAlias = npt.NDArray[np.generic]
"""An array of any element type."""
Size: TypeAlias = int | str | None
"""A dimension: a number, a name, or None where it is free."""
Sizes: TypeAlias = dict[Size, int]
Fill: TypeAlias = float | str | Callable[..., Any] | None


EMPTY: Final[Any] = ()
"""Default of a column that may be left out; its ``fill`` then takes its place."""


def count_rows(rows: int) -> IntArray:
    """Returns 1, 2, ... ``rows``: the ``fill`` of a column of row numbers."""
    return np.arange(1, rows + 1)


@dataclass(frozen=True, slots=True)
class Column:
    """Shape and meaning of one field, as metadata of ``Annotated``.

    Attributes:
        shape: Sizes in words: numbers, names shared within one object (``n``, ``dof``) and ``_``.
        unit: SI unit of the values, for the reader.
        nan: NaN is allowed and means "not known".
        inf: Infinity is allowed and means "no limit".
        fill: What an array or table without rows becomes: a value for every element, or a function
            of the sizes that returns it (``np.eye``, :func:`count_rows`; a lambda finds no
            globals here). Without it an empty array has to fit.
    """

    shape: str
    unit: str = ""
    nan: bool = False
    inf: bool = False
    fill: Fill = None


class _Field(NamedTuple):
    """A field with a :class:`Column`, read once per class."""

    name: str
    sizes: tuple[Size, ...]
    dtype: np.dtype[np.generic] | None
    """Element type; None where the field is a tuple or a table."""
    refused: Callable[[Values], BoolArray] | None
    """The function that marks values not allowed; None where all are."""
    fill: Fill
    to_tuple: Callable[[Iterable[object]], tuple[object, ...]] | None


@dataclass(frozen=True, slots=True)
class Columns:
    """Base of frozen dataclasses with arrays: checks shapes and values, and freezes.

    An array that is writeable or of another type is copied, so it cannot change afterwards. Rules
    between the values belong in :meth:`_check_rules`, which finds every array frozen.
    """

    def __post_init__(self) -> None:
        """Checks and freezes every declared column, then checks the rules of the class.

        Raises:
            ShapeError: A column of another shape, or a value that is not finite.
        """
        self._check_columns()
        self._check_rules()

    def _check_columns(self, **known: int) -> None:
        """Checks and freezes every declared column.

        A class with sizes that no column states, such as the joints of a robot, has its own
        ``__post_init__``, which calls this with them.

        Args:
            known: Such sizes by name.

        Raises:
            ShapeError: A column of another shape, or a value that is not finite.
        """
        owner = type(self)
        sizes: Sizes = dict(known.items())
        for field in _FIELDS.get(owner) or _read_fields(owner):
            value = getattr(self, field.name)
            if value is None:
                continue
            checked = _check_column(owner, field, value, sizes)
            if checked is not value:
                object.__setattr__(self, field.name, checked)

    def _check_rules(self) -> None:
        """Checks rules beyond shapes; none by default."""

    def _set_column(self, name: str, values: npt.ArrayLike) -> None:
        """Replaces a column by values of the same shape; for a class that normalises its input."""
        field = next(f for f in _read_fields(type(self)) if f.name == name)
        sizes: Sizes = {}
        _check_shape(type(self), field, np.shape(getattr(self, name)), sizes)
        object.__setattr__(self, name, _check_column(type(self), field, values, sizes))

    def take(self, rows: Rows) -> Self:
        """Returns the table of some rows, in their order; fields without rows stay as they are."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        for field in _read_fields(type(self)):
            value = values.get(field.name)
            if value is not None and field.sizes[:1] == (ROWS,):
                values[field.name] = _take_rows(value, rows)
        return type(self)(**values)

    def document(self) -> dict[str, object]:
        """Returns the fields as JSON values, in SI; a number that is not finite is None."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if not f.name.startswith("_")}
        return {name: _json_document(value) for name, value in values.items()}


T = TypeVar("T", bound=Columns)


def concat(tables: Sequence[T], **merged: object) -> T:
    """Returns the rows of several tables in one.

    Args:
        tables: One or more.
        merged: Values of fields that are not simply joined, such as a merged provenance.

    Raises:
        ShapeError: No table, or a field without rows that differs between them.
    """
    if not tables:
        raise ShapeError("tables to join: none, expected one or more.")
    first = tables[0]
    by_name = {field.name: field for field in _read_fields(type(first))}
    values: dict[str, object] = {}
    for name in (f.name for f in fields(first) if f.init and f.name not in merged):
        parts = [getattr(table, name) for table in tables]
        field = by_name.get(name)
        if field is not None and field.sizes[:1] == (ROWS,) and parts[0] is not None:
            values[name] = _join_column(parts)
            continue
        if not all(_are_equal(parts[0], part) for part in parts[1:]):
            raise ShapeError(
                f"{type(first).__name__}.{name} differs between the tables to join, expected one "
                "value."
            )
        values[name] = parts[0]
    return type(first)(**values, **merged)


def _join_column(parts: list[Any]) -> object:
    if isinstance(parts[0], Columns):
        return concat(parts)
    if isinstance(parts[0], tuple):
        return tuple(value for part in parts for value in part)
    return _freeze(np.concatenate(parts))


def _are_equal(one: object, other: object) -> bool:
    if one is other:
        return True
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and np.array_equal(one, other)
    if isinstance(one, Columns):
        return type(one) is type(other) and all(
            _are_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one)
        )
    return bool(one == other)


def _take_rows(value: Values | Columns | tuple[object, ...], rows: Rows) -> object:
    if isinstance(value, np.ndarray):
        return _freeze(value[rows])
    if isinstance(value, Columns):
        return value.take(rows)
    if isinstance(rows, slice):
        return value[rows]
    return tuple(value[k] for k in np.arange(len(value))[rows])


def _freeze(array: Values) -> Values:
    array.flags.writeable = False
    return array


def _json_document(value: object) -> object:
    document = getattr(value, "document", None)
    if document is not None:
        return document()
    if isinstance(value, list | tuple):
        return [_json_document(each) for each in value]
    return json_values(value)


def _check_column(owner: type, field: _Field, value: Any, sizes: Sizes) -> object:
    """Returns the value frozen; sizes that it states first are added to the known ones.

    Links build blocks at some thousand a second: the usual case makes no generator and no call
    that it can do without.
    """
    name, wanted, dtype, refused, fill, to_tuple = field
    if dtype is None:
        table = value if to_tuple is None else to_tuple(value)
        if fill is not None and not len(table):
            rows = sizes.get(wanted[0], 0)
            table = fill(rows) if callable(fill) else (fill,) * rows
        _check_shape(owner, field, (len(table),), sizes)
        return table
    if type(value) is np.ndarray and value.dtype == dtype and not value.flags.writeable:
        array = value
    else:
        array = np.array(value, dtype=dtype)
    if array.size == 0:
        array = _fill_empty(field, array, sizes)
    if array.shape != tuple(map(sizes.get, wanted)):
        _check_shape(owner, field, array.shape, sizes)
    if refused is not None and np.count_nonzero(bad := refused(array)):
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(
            f"{owner.__name__}.{name}{list(where)} is {array[where]}, expected a finite number."
        )
    if array is not value:
        array.flags.writeable = False
    return array


def _check_shape(owner: type, field: _Field, shape: tuple[int, ...], sizes: Sizes) -> None:
    """Passes if the shape fits; a size met for the first time is set by its column.

    Numbers are entered as sizes under themselves, so that one look-up serves both.

    Raises:
        ShapeError: It does not fit.
    """
    for wanted in field.sizes:
        if isinstance(wanted, int):
            sizes[wanted] = wanted
    fits = len(shape) == len(field.sizes)
    if fits:
        for wanted, size in zip(field.sizes, shape, strict=True):
            fits &= wanted is None or sizes.setdefault(wanted, size) == size
    if not fits:
        expected = ", ".join(str(sizes.get(wanted, "any")) for wanted in field.sizes)
        raise ShapeError(f"{owner.__name__}.{field.name} has shape {shape}, expected ({expected}).")


def _fill_empty(field: _Field, empty: Values, sizes: Sizes) -> Values:
    """Returns the default for an empty array, as far as its sizes are known.

    A list without rows has no second dimension; it gets that of its column.
    """
    shape = [s if isinstance(s, int) else sizes.get(s) for s in field.sizes]
    known = [size for size in shape if size is not None]
    if field.fill is None or len(known) < len(shape):
        rest = [size or 0 for size in shape[1:]]
        return np.empty((0, *rest), dtype=empty.dtype) if empty.shape == (0,) else empty
    if callable(field.fill):
        return np.array(field.fill(*shape), dtype=empty.dtype)
    return np.full(known, field.fill, dtype=empty.dtype)


def _to_text(values: Iterable[object]) -> tuple[str, ...]:
    return tuple(map(str, values))


def _is_not_finite(array: Values) -> BoolArray:
    return np.logical_not(np.isfinite(array))


_REFUSED: Final[dict[tuple[bool, bool], Callable[[Values], BoolArray] | None]] = {
    (False, False): _is_not_finite,
    (True, False): np.isinf,
    (False, True): np.isnan,
    (True, True): None,
}
"""By whether NaN and infinity are allowed."""
_FIELDS: Final[dict[type, tuple[_Field, ...]]] = {}


def _read_fields(table: type) -> tuple[_Field, ...]:
    """Returns the declared columns of a class; its annotations are read once."""
    if table not in _FIELDS:
        hints = get_type_hints(table, include_extras=True)
        _FIELDS[table] = tuple(
            _read_field(name, hint.__metadata__[0], hint.__origin__)
            for name, hint in hints.items()
            if get_origin(hint) is Annotated and isinstance(hint.__metadata__[0], Column)
        )
    return _FIELDS[table]


def _read_field(name: str, column: Column, kind: object) -> _Field:
    sizes = tuple(
        None if word == FREE else int(word) if word.isdigit() else word
        for word in column.shape.split()
    )
    if get_origin(kind) in (Union, UnionType):
        kind = next(each for each in get_args(kind) if each is not NoneType)
    dtype, refused, to_tuple = None, None, None
    if get_origin(kind) is tuple:
        to_tuple = _to_text if get_args(kind)[0] is str else tuple
    if get_origin(kind) is np.ndarray:
        dtype = np.dtype(get_args(get_args(kind)[1])[0])
        refused = _REFUSED[column.nan, column.inf] if dtype.kind in "fc" else None
    return _Field(name, sizes, dtype, refused, column.fill, to_tuple)
