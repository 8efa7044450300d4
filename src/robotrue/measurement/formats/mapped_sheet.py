"""The columns of a sheet that a mapping names, as numbers in the file's units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import FormatError
from robotrue.measurement.formats.mapping import GROUPS, ColumnMapping
from robotrue.measurement.formats.sheet import Sheet, column_key

_NUMBERED: Final = re.compile(r"(?P<stem>.*?)(?P<number>\d+)(?P<unit>\D*)")
_UNIT_WORDS: Final[Mapping[str, str]] = {
    **{word: word for word in ("mm", "m", "um", "inch", "deg", "rad")},
    **{"µm": "um", "in": "inch", "degree": "deg", "degrees": "deg", "°": "deg"},
}
"""Words of a row of units, and what mappings call them."""


class MappedSheet:
    """The columns a mapping names in a sheet, as numbers.

    Raises:
        FormatError: On the first column that is missing, unknown or not a number.
    """

    def __init__(self, sheet: Sheet, mapping: ColumnMapping) -> None:
        self.sheet = sheet
        self.mapping = mapping
        self._constants = {column_key(name): value for name, value in mapping.constants.items()}
        for group in GROUPS:
            names = [name for name in getattr(mapping, group) if name]
            missing = [name for name in names if not self._has(name)]
            whole = group not in mapping.optional or len(missing) < len(names)
            if missing and whole:
                hint = f"name the columns in a mapping (layout here: {mapping.name!r})."
                raise sheet.lacking_columns(missing, hint)
        if not mapping.ignore_other:
            sheet.refuse_others((*mapping.columns(), *mapping.ignore))
        self._refuse_further_joint()
        self._check_units()

    def __len__(self) -> int:
        return len(self.sheet)

    def _has(self, name: str) -> bool:
        return self.sheet.has(name) or column_key(name) in self._constants

    def _refuse_further_joint(self) -> None:
        """Raises for a column that is numbered as the next joint: an arm of one more joint."""
        if not self.mapping.joints:
            return
        last = _NUMBERED.fullmatch(column_key(self.mapping.joints[-1]))
        if last is None or not self.mapping.header:
            return
        further = f"{last['stem']}{int(last['number']) + 1}{last['unit']}"
        if self.sheet.has(further) and further not in map(column_key, self._named_columns()):
            count = len(self.mapping.joints)
            raise self.sheet.fault(
                f"column {further!r} continues the joints {self.mapping.joints[0]} to "
                f"{self.mapping.joints[-1]}, of which mapping {self.mapping.name!r} names {count}.",
                f'name it among the joints, or pass over it: ignore = ["{further}"].',
            )

    def _named_columns(self) -> tuple[str, ...]:
        return (*self.mapping.columns(), *self.mapping.ignore)

    def _check_units(self) -> None:
        """Raises where the row of units contradicts the unit of the mapping."""
        stated = dict(zip(map(column_key, self.sheet.header), self.sheet.units, strict=False))
        for group, unit in (
            ("joints", self.mapping.joints_unit),
            ("position", self.mapping.position_unit),
            ("rotation", self.mapping.rotation_unit),
        ):
            for name in () if group in self.mapping.factors else getattr(self.mapping, group):
                word = stated.get(column_key(name), "")
                if word in _UNIT_WORDS and _UNIT_WORDS[word] != unit:
                    raise self.sheet.fault(
                        f"column {name!r} is in {word} by the row of units, in {unit} by mapping "
                        f"{self.mapping.name!r}.",
                        f'state {group}_unit = "{_UNIT_WORDS[word]}" in the mapping.',
                    )

    def present(self, group: str) -> bool:
        """Returns True if the file (or a constant) has the group."""
        names = getattr(self.mapping, group)
        return bool(names) and all(self._has(name) for name in names)

    def numbers(self, group: str, *, absent: float | None = None) -> Array:
        """Returns the group's columns (n, k) in the file's units, every value finite.

        Args:
            group: A field of the mapping.
            absent: What all values are where the file has no such columns; None: they are there.
        """
        names = getattr(self.mapping, group)
        if absent is not None and not self.present(group):
            return np.full((len(self), self.mapping.count(group)), absent)
        factor = self.mapping.factors.get(group, 1.0)
        return np.stack([factor * self.column(name) for name in names], axis=1)

    def whole(self, group: str) -> IntArray:
        """Returns a column of whole numbers from 0 (n,); zeros where the file has none."""
        values = self.numbers(group, absent=0.0)[:, 0]
        bad = (values != np.round(values)) | (values < 0)
        self.check(group, values[:, None], bad, "a number 0, 1, 2 ...")
        return values.astype(np.int64)

    def column(self, name: str) -> Array:
        """Returns a column (n,) in the file's unit, every value finite.

        Raises:
            FormatError: An invalid cell.
        """
        if not self.sheet.has(name):
            return np.full(len(self), self._constants[column_key(name)])
        values = self.sheet.parse(name)
        for row in np.flatnonzero(~np.isfinite(values)).tolist():
            cell = self.sheet.column(name)[row]
            raise self.fault(row, name, _describe_cell(cell, self.sheet.decimal))
        return values

    def check(self, group: str, values: Array, bad: npt.ArrayLike, expected: str) -> None:
        """Passes if no value (n, k) of a group is bad (n, k).

        Raises:
            FormatError: The first that is, with what is expected.
        """
        for row, k in np.argwhere(np.reshape(bad, values.shape)).tolist():
            name = getattr(self.mapping, group)[k]
            raise self.fault(row, name, f"{values[row, k]:g}, expected {expected}")

    def fault(self, row: int, name: str, what: str) -> FormatError:
        """Returns the error for one cell: file, line, column and content."""
        return self.sheet.fault(
            f"column {name!r} is {what}.", "correct or delete that row.", row=row
        )


def _describe_cell(cell: str, decimal: str) -> str:
    if not cell:
        return "blank, expected a number"
    if "," in cell or "." in cell:
        return f"{cell!r}, expected a number with decimal mark {decimal!r} and no separators"
    return f"{cell!r}, expected a finite number"
