"""Touched points from a table: which columns hold the name and the coordinates, and their unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.measurement.formats.sheet_file import read_sheet


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchColumns:
    """Which column is what.

    Attributes:
        name: Of the touched feature; repeated touches carry the same.
        position: x, y, z.
        unit: m per unit of the file.
    """

    name: str = "name"
    position: tuple[str, str, str] = ("x_mm", "y_mm", "z_mm")
    unit: float = MM


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchedPoints(Columns):
    """Single touches, in the order of the file.

    Attributes:
        names: (n) of the features.
        position: (n, 3) m.
    """

    names: Annotated[tuple[str, ...], Column("n")]
    position: Annotated[Array, Column("n 3", unit="m")]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanTouches:
    """One point per feature, in the order they were first touched.

    Attributes:
        names: (n) of the features.
        position: (n, 3) m, mean of the touches.
        count: (n,) touches of each.
        scatter: (3,) m, pooled standard deviation of one touch per axis; NaN where nothing was
            touched twice.
    """

    names: tuple[str, ...]
    position: Array
    count: Array
    scatter: Array


def read_touches(path: str | Path, columns: TouchColumns | None = None) -> TouchedPoints:
    """Returns the touches of a CSV, TSV or workbook.

    Args:
        path: The file.
        columns: Of the file; default: ``name, x_mm, y_mm, z_mm``.

    Raises:
        FormatError: A column is missing or a cell is not a finite number; with its line.
    """
    wanted = TouchColumns() if columns is None else columns
    sheet = read_sheet(path)
    position = sheet.numbers(wanted.position, named_by=wanted.name) * wanted.unit
    return TouchedPoints(names=sheet.words(wanted.name), position=position)


def mean_touches(touches: TouchedPoints) -> MeanTouches:
    """Returns the mean of all touches of each feature, and how much single touches scatter."""
    order = list(dict.fromkeys(touches.names))
    index = np.array([order.index(name) for name in touches.names])
    count = np.bincount(index, minlength=len(order)).astype(np.float64)
    total = np.zeros((len(order), 3))
    np.add.at(total, index, touches.position)
    mean = total / count[:, None]
    spare = len(index) - len(order)
    square = ((touches.position - mean[index]) ** 2).sum(axis=0)
    return MeanTouches(
        names=tuple(order),
        position=mean,
        count=count,
        scatter=np.sqrt(square / spare) if spare else np.full(3, np.nan),
    )
