"""What commands read that are not made from requests: measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.app import measured_rows
from robotrue.cell.cell import Cell
from robotrue.cli.console import TERMINAL
from robotrue.measurement.measurement_set import MeasurementSet


def measured(
    cell: Cell,
    paths: Sequence[Path],
    mapping: Path | None,
    *,
    minimum: int = measured_rows.FEWEST_ROWS,
) -> MeasurementSet:
    """Returns all files as one set; see :func:`robotrue.app.measured_rows.read_together`."""
    return measured_rows.read_together(cell, paths, mapping, reporter=TERMINAL, minimum=minimum)


def joined(
    cell: Cell,
    sets: Sequence[MeasurementSet],
    names: Sequence[str],
    *,
    minimum: int = measured_rows.FEWEST_ROWS,
) -> MeasurementSet:
    """Returns sets as one; see :func:`robotrue.app.measured_rows.join_rows`."""
    return measured_rows.join_rows(cell, sets, names, reporter=TERMINAL, minimum=minimum)
