"""Frozen tables in archives: their arrays by name, and their other fields as JSON values."""

from __future__ import annotations

import functools
from collections.abc import Hashable
from dataclasses import field, fields, make_dataclass
from typing import TypeVar, cast, get_type_hints

import numpy as np

from robotrue.core.archive import Archive
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.document_decoder import decode
from robotrue.errors import ArchiveError

T = TypeVar("T", bound=Columns)


def pack_table(
    table: Columns, *, prefix: str = "", leave: tuple[str, ...] = ()
) -> tuple[dict[str, object], dict[str, Array]]:
    """Returns the fields of a table that are no arrays, and its arrays by prefix and name.

    Args:
        table: Its columns are arrays of numbers.
        prefix: Of the names of its arrays.
        leave: Fields that are stored in another way.
    """
    names = [each.name for each in fields(table) if each.init and each.name not in leave]
    values = {name: getattr(table, name) for name in names}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    others = {name: value for name, value in values.items() if name not in arrays}
    return others, {prefix + name: value for name, value in arrays.items()}


def unpack_table(
    kind: type[T],
    archive: Archive,
    stated: object,
    *,
    key: str = "",
    prefix: str = "",
    later: tuple[str, ...] = (),
    **given: object,
) -> T:
    """Returns the table that :func:`pack_table` took apart.

    Args:
        kind: Of the table.
        archive: Holds its arrays; none of them is empty.
        stated: JSON values of its other fields.
        key: Key of the values, for messages; empty for a whole document.
        prefix: Of the names of its arrays.
        later: Fields that archives written before do not have; they get their default.
        given: Fields that are stored in another way.

    Raises:
        ArchiveError: A value or an array is missing, of another type, or empty.
    """
    columns, record = _split_fields(cast(Hashable, kind), later, tuple(given))
    values = dict(vars(decode(record, stated, key=key)))
    for name, column in columns.items():
        if name in later and prefix + name not in archive.arrays:
            continue
        values[name] = archive.array(prefix + name, finite=not (column.nan or column.inf))
        if not values[name].size:  # it would be filled as one that is left out
            raise ArchiveError(f"{prefix}{name} is empty.")
    return kind(**values, **given)


@functools.cache
def _split_fields(
    kind: Hashable, later: tuple[str, ...], given: tuple[str, ...]
) -> tuple[dict[str, Column], type]:
    """The columns of a class, and a record of its other fields; without those that are given."""
    table = cast(type[Columns], kind)
    hints = get_type_hints(table, include_extras=True)
    known = [each for each in fields(table) if each.init and each.name not in given]
    columns = {
        each.name: hints[each.name].__metadata__[0]
        for each in known
        if hasattr(hints[each.name], "__metadata__")
    }
    others = [
        (each.name, hints[each.name], field(default=each.default))
        if each.name in later
        else (each.name, hints[each.name])
        for each in known
        if each.name not in columns
    ]
    return columns, make_dataclass(table.__name__, others, kw_only=True)
