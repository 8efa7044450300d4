"""Measured poses: from files, from tables, from arrays."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from robotrue.app.presentation import Block
from robotrue.app.reporting import Message
from robotrue.core.csv_text import csv_text
from robotrue.core.provenance import Provenance, mark_line, provenance_from
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.library.cell_object import RobotCell, read_cell
from robotrue.library.objects_context import ObjectsContext
from robotrue.library.operation_call import open_context
from robotrue.library.presented import Presented
from robotrue.measurement.formats.canonical import canonical_columns
from robotrue.measurement.measurement_set import MeasurementSet, concatenate

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture

PROVENANCE: Final = "robotrue_provenance"
"""Key in the attributes of a DataFrame: what is simulated stays marked."""
CellSource: TypeAlias = str | Path | RobotCell
"""A cell, or the path of its cell.toml."""
TableSource: TypeAlias = Union[str, Path, "pd.DataFrame"]
"""A file, or a table with the same columns."""
MeasuredSource: TypeAlias = Union[str, Path, "pd.DataFrame", "Measurements"]
"""Measured poses, or a file or table of them."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Measurements(Presented):
    """Measured poses; ``data[mask]`` and ``data[::5]`` select rows.

    Attributes:
        rows: The poses, SI.
        messages: Messages of the reader.
    """

    rows: MeasurementSet
    messages: tuple[Message, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, chosen: slice | npt.ArrayLike) -> Measurements:
        """Returns the chosen rows: a slice, indices or a mask."""
        every = np.arange(len(self.rows))
        rows = every[chosen] if isinstance(chosen, slice) else every[np.asarray(chosen)]
        return Measurements(rows=self.rows.subset(np.atleast_1d(rows)), messages=self.messages)

    @property
    def joints_deg(self) -> npt.NDArray[np.float64]:
        """(n, dof) deg, commanded, of the robot model."""
        return self.rows.joints / DEG

    @property
    def points_mm(self) -> npt.NDArray[np.float64]:
        """(n, 3) mm, measured, in the frame of the data."""
        return self.rows.position / MM

    @property
    def provenance(self) -> Provenance:
        """Instrument and files."""
        return self.rows.provenance

    def blocks(self) -> Iterable[Block]:
        """Returns counts, extent and noise."""
        from robotrue.app.file_contents import document_blocks, measurement_document

        yield from document_blocks("data", measurement_document(self.rows))

    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per pose with the columns of a measurement file, at full precision.

        Raises:
            FormatError: Only some rows have an orientation or payload.
        """
        import pandas as pd

        columns = canonical_columns(self.rows)
        frame = pd.DataFrame({k: v if k == "set" else map(float, v) for k, v in columns.items()})
        frame.index = pd.Index(self.rows.source_row, name="source_row")
        frame.attrs[PROVENANCE] = self.provenance.to_document()
        return frame

    def plot(self) -> Picture:
        """Returns the measured points from above and from the side, and the joint angles."""
        from matplotlib.axes import Axes

        from robotrue.library.pictures import draw_places, make_picture
        from robotrue.report.figure import AFTER, Drawing

        def draw(axes: list[Axes]) -> None:
            (ax,) = axes
            scatter = np.random.default_rng(0).uniform(-0.3, 0.3, self.joints_deg.shape)
            numbers = np.arange(self.rows.dof) + 1 + scatter
            ax.plot(numbers, self.joints_deg, ".", color=AFTER, markersize=2)
            ax.set_xlabel("joint")
            ax.set_ylabel("angle in deg")

        title = f"{self._mark}{len(self)} measured poses"
        places = draw_places(self.rows.position, self.rows.frame)
        return make_picture([places, Drawing(draw=draw, height=2.6)], title=title)

    def _describe(self) -> str:
        names = len(self.rows.group_names)
        return f"measurements: {len(self)} poses, {names} set{'s' * (names > 1)}, {self.rows.frame}"


def read_measurements(
    cell: CellSource,
    *sources: TableSource,
    mapping: str | Path | None = None,
    joints_deg: npt.ArrayLike | None = None,
    points_mm: npt.ArrayLike | None = None,
) -> Measurements:
    """Returns measured poses from files, tables or two arrays, in the frame of the cell.

    Args:
        cell: Cell of the measurements.
        sources: Files, or tables with the columns of a measurement file; one or more.
        mapping: Column mapping (TOML) of files of another layout.
        joints_deg: (n, dof), commanded, instead of sources.
        points_mm: (n, 3), measured, with ``joints_deg``.

    Raises:
        FormatError: A file or table that cannot be read, with line and column.
        ShapeError: Arrays that do not belong together.
    """
    with open_context() as context:
        places = [place_table(context, each) for each in sources]
        if joints_deg is not None or points_mm is not None:
            places.append(_place_arrays(context, joints_deg, points_mm))
        if not places:
            raise ConfigurationError(
                "no measurements are stated.", hint="a file, or joints_deg=... and points_mm=..."
            )
        known = cell_of(cell).cell
        layout = None if mapping is None else Path(mapping)
        sets = [context.unchecked_rows(known, place, layout) for place in places]
        return Measurements(rows=concatenate(sets), messages=context.messages)


def cell_of(cell: CellSource) -> RobotCell:
    """Returns the cell, read if it is a path."""
    return cell if isinstance(cell, RobotCell) else read_cell(cell)


def place_cell(context: ObjectsContext, cell: CellSource) -> Path:
    """Returns the file of a cell; of a registered one its own, which names its model.

    Raises:
        ConfigurationError: A registered cell that was not read from a file, or whose file changed.
    """
    if not isinstance(cell, RobotCell):
        return Path(cell)
    return context.add_cell(cell.cell) if cell.cell.part is None else cell.require_file()


def place_measured(context: ObjectsContext, source: MeasuredSource) -> Path:
    """Returns the file of measured poses."""
    if isinstance(source, Measurements):
        return context.add_rows(source.rows)
    return place_table(context, source)


def place_table(context: ObjectsContext, source: TableSource) -> Path:
    """Returns the file of a table; the numbers of a table are written without rounding.

    Raises:
        ConfigurationError: Neither a path nor a table.
    """
    if isinstance(source, str | os.PathLike):
        return Path(source)
    if not hasattr(source, "to_csv"):
        raise ConfigurationError(
            f"{type(source).__name__} given, expected a path or a DataFrame.",
            hint="arrays go by name: joints_deg=..., points_mm=...",
        )
    path = context.new_file("table.csv")
    stated = source.attrs.get(PROVENANCE)
    mark = "" if stated is None else mark_line(provenance_from(stated))
    path.write_text(mark + source.to_csv(index=False), encoding="utf-8")
    return path


def place_columns(
    context: ObjectsContext, name: str, columns: Sequence[tuple[str, object]]
) -> Path:
    """Returns the CSV file of columns (n,); the numbers are written without rounding."""
    names = [column for column, _ in columns]
    values = [np.asarray(each, dtype=np.float64).tolist() for _, each in columns]
    path = context.new_file(name)
    rows = ([repr(value) for value in row] for row in zip(*values, strict=True))
    path.write_text(csv_text([names, *rows]), encoding="utf-8")
    return path


def named_columns(
    values: npt.ArrayLike, names: Sequence[str], what: str
) -> list[tuple[str, object]]:
    """Returns the columns of an array (n, k) by their names.

    Raises:
        ShapeError: Not one column per name.
    """
    array = np.atleast_2d(np.asarray(values, dtype=np.float64))
    if array.ndim != 2 or array.shape[1] != len(names):
        raise ShapeError(f"{what} has shape {array.shape}, expected (any, {len(names)}).")
    return list(zip(names, array.T, strict=True))


def joint_columns_deg(joints_deg: npt.ArrayLike) -> list[tuple[str, object]]:
    """Returns the columns ``j1_deg ..`` of joints (n, dof) deg."""
    array = np.atleast_2d(np.asarray(joints_deg, dtype=np.float64))
    names = [f"j{k + 1}_deg" for k in range(array.shape[-1])]
    return named_columns(array, names, "joints_deg")


def _place_arrays(
    context: ObjectsContext, joints_deg: npt.ArrayLike | None, points_mm: npt.ArrayLike | None
) -> Path:
    """The file of joints and points.

    Raises:
        ConfigurationError: One of them without the other.
        ShapeError: Arrays that do not belong together.
    """
    if joints_deg is None or points_mm is None:
        raise ConfigurationError(
            "joints_deg and points_mm belong together: one of them is missing."
        )
    joints = joint_columns_deg(joints_deg)
    points = named_columns(points_mm, ("x_mm", "y_mm", "z_mm"), "points_mm")
    counts = (len(np.atleast_2d(joints_deg)), len(np.atleast_2d(points_mm)))
    if counts[0] != counts[1]:
        raise ShapeError(f"{counts[0]} rows of joints_deg, {counts[1]} of points_mm.")
    return place_columns(context, "arrays.csv", [*joints, *points])
