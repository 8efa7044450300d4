"""Points on the table of a positioner that an instrument has seen at several angles.

As CSV: ``point`` (name or number), ``e1_deg`` to ``e6_deg`` of the rotary axes that carry it,
``x_mm, y_mm, z_mm``; ``sx_mm, sy_mm, sz_mm`` (one sigma) and ``station`` if known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, count_rows
from robotrue.core.conditions import EXTERNAL_AXES
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.measurement.formats.canonical import POSITION
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.measurement_set import MeasurementFrame

ANGLES: Final = tuple(f"e{i + 1}_deg" for i in range(EXTERNAL_AXES))
_SIGMAS: Final = ("sx_mm", "sy_mm", "sz_mm")
_STATION: Final = "station"


@dataclass(frozen=True, slots=True, kw_only=True)
class TableSet(Columns):
    """n readings of points on a table.

    Attributes:
        point: (n,) number of the point.
        names: (p,) of the points.
        external: (n, 6) rad, axes that are stated; NaN of others.
        position: (n, 3) m in ``frame``.
        covariance: (n, 3, 3) m^2 of ``position``: the instrument alone, in ``frame``.
        frame: Of the positions.
        station: (n,) index of the instrument set-up.
        source: File they came from.
        lines: (n,) one-based line in it.
        provenance: Simulated or measured, instrument and file.
    """

    point: Annotated[IntArray, Column("n")]
    names: Annotated[tuple[str, ...], Column("p")]
    external: Annotated[Array, Column("n 6", unit="rad", nan=True)]
    position: Annotated[Array, Column("n 3", unit="m")]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2")]
    frame: MeasurementFrame = "base"
    station: Annotated[IntArray, Column("n", fill=0)] = EMPTY
    source: str = ""
    lines: Annotated[IntArray, Column("n", fill=count_rows)] = EMPTY
    provenance: Provenance = MEASURED

    def _check_rules(self) -> None:
        """Checks that every reading is of a named point."""
        if len(self) and not 0 <= self.point.min() <= self.point.max() < len(self.names):
            raise ShapeError(f"{len(self.names)} points, numbered from 0; a row has another.")

    def __len__(self) -> int:
        return len(self.point)


def read_table_points(
    path: str | Path, *, frame: MeasurementFrame, instrument: Callable[[Array], Array]
) -> TableSet:
    """Returns the points of a CSV, TSV, TXT or workbook file.

    Args:
        path: The file.
        frame: Of its positions.
        instrument: Covariance (n, 3, 3) m^2 of positions (n, 3) m, where the file states no sigma.

    Raises:
        FormatError: A column is missing or unknown, or a cell is no number.
    """
    sheet = read_sheet(path)
    stated = [name for name in ANGLES if sheet.has(name)]
    hint = (
        "columns of points on a table are point, e1_deg or e2_deg ... of the axes that turn it, "
        "x_mm, y_mm, z_mm, sx_mm, sy_mm, sz_mm and station."
    )
    sheet.check_columns(
        [("point",), tuple(stated) or ANGLES[1:2], POSITION], [_SIGMAS, (_STATION,)], hint
    )
    external = np.full((len(sheet), EXTERNAL_AXES), np.nan)
    external[:, [ANGLES.index(name) for name in stated]] = sheet.numbers(stated) * DEG
    position = sheet.numbers(POSITION) * MM
    covariance = instrument(position)
    if sheet.has(_SIGMAS[0]):
        covariance = (sheet.numbers(_SIGMAS) * MM)[:, :, None] ** 2 * np.eye(3)
    words = sheet.words("point")
    names = tuple(dict.fromkeys(words))
    station = sheet.numbers([_STATION])[:, 0] if sheet.has(_STATION) else np.zeros(len(sheet))
    return TableSet(
        point=np.array([names.index(word) for word in words]),
        names=names,
        external=external,
        position=position,
        covariance=covariance,
        frame=frame,
        station=station.astype(np.int64),
        source=sheet.source,
        lines=np.array(sheet.lines),
        provenance=sheet.provenance,
    )
