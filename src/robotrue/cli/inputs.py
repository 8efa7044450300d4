"""What commands read that are not made from requests: measurements, loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotrue.app import measured_rows
from robotrue.cell.cell import Cell
from robotrue.cli.console import TERMINAL
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError
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


def parse_wrench(text: str) -> Array:
    """Returns (6,) N, N m from ``FX,FY,FZ[,MX,MY,MZ]``.

    Raises:
        ConfigurationError: Not three or six numbers.
    """
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    if numbers.size not in (3, 6) or not np.isfinite(numbers).all():
        raise ConfigurationError(
            f"wrench {text!r}, expected 3 or 6 numbers in N and N m.", hint="--wrench 120,-40,-60"
        )
    return np.concatenate([numbers, np.zeros(6 - numbers.size)])
