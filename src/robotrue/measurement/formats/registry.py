"""Measurement files by name or by their header: what ``robotrue calibrate CELL FILE`` calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.measurement.formats import ur5_jacobi, ur10_landgraf
from robotrue.measurement.formats.canonical import canonical_joints, canonical_mapping
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.sheet import Sheet, column_key, read_sheet
from robotrue.measurement.formats.table import read_table
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.tracker import Instrument

# The mapping that asks for more columns comes first: it is the more certain match.
MAPPINGS: Final[Mapping[str, ColumnMapping]] = MappingProxyType(
    {m.name: m for m in (ur10_landgraf.SERIES_B, ur10_landgraf.SERIES_A, ur5_jacobi.UR5)}
)
"""Known layouts by name; the canonical one depends on the number of joints and is not here."""


def read_measurements(
    path: str | Path,
    *,
    mapping: ColumnMapping | str | None = None,
    frame: MeasurementFrame | None = None,
    instrument: Instrument | None = None,
    ignore: Sequence[str] = (),
) -> MeasurementSet:
    """Returns the measurements of a CSV, TSV, TXT or workbook file.

    Args:
        path: The file.
        mapping: What the columns hold, or the name of a known layout; None tells it by the header
            (canonical columns, or a layout in ``MAPPINGS``).
        frame: Frame of the positions; None takes the mapping's (canonical: base).
        instrument: Covariance of a point where the file has no standard deviations.
        ignore: Columns to pass over in a canonical file.

    Raises:
        FormatError: The file is not what its mapping says, with line and column.
        ConfigurationError: No layout of that name.
    """
    sheet, chosen = open_sheet(path, mapping, ignore=ignore)
    return read_table(sheet, chosen, frame=frame, instrument=instrument)


def open_sheet(
    path: str | Path,
    mapping: ColumnMapping | str | None,
    *,
    positions: bool = True,
    ignore: Sequence[str] = (),
) -> tuple[Sheet, ColumnMapping]:
    """Returns the file's columns and the mapping that reads them.

    Raises:
        FormatError: Unreadable file, or no known layout has these columns.
        ConfigurationError: No layout of that name.
    """
    if isinstance(mapping, str) and mapping != "canonical":
        if mapping not in MAPPINGS:
            raise ConfigurationError(
                f"no measurement layout {mapping!r}; known are canonical, {', '.join(MAPPINGS)}."
            )
        mapping = MAPPINGS[mapping]
    if isinstance(mapping, ColumnMapping):
        sheet = read_sheet(
            path,
            delimiter=mapping.delimiter,
            decimal=mapping.decimal,
            encoding=mapping.encoding,
            skip_lines=mapping.skip_lines,
            header=mapping.header,
            worksheet=mapping.worksheet,
        )
        return sheet, mapping
    sheet = read_sheet(path)
    return _detect_mapping(sheet, mapping, positions, ignore)


def _detect_mapping(
    sheet: Sheet, name: str | None, positions: bool, ignore: Sequence[str]
) -> tuple[Sheet, ColumnMapping]:
    header = {column_key(column) for column in sheet.header}
    dof = canonical_joints(sheet.header)
    if dof or name == "canonical":
        dropped = {column_key(column) for column in ignore}
        kept = [i for i, column in enumerate(sheet.header) if column_key(column) not in dropped]
        thinned = replace(
            sheet,
            header=tuple(sheet.header[i] for i in kept),
            cells=tuple(tuple(row[i] for i in kept) for row in sheet.cells),
        )
        return thinned, canonical_mapping(dof or 6, positions=positions)
    for known in MAPPINGS.values():
        if header >= {column_key(column) for column in known.columns(required_only=True)}:
            return sheet, known
    raise FormatError(
        f"columns of no known layout: {', '.join(sheet.header)}.",
        source=sheet.source,
        line=sheet.header_line,
        hint="name them j1_deg..j6_deg, x_mm, y_mm, z_mm, or give a mapping.",
    )
