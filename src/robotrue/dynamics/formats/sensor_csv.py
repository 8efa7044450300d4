"""Readings of a flange sensor at rest as CSV: one row per pose of the wrist.

``rx_deg, ry_deg, rz_deg`` (R_base_sensor = Rz(rz) Ry(ry) Rx(rx)) and ``fx_N, fy_N, fz_N, mx_Nm,
my_Nm, mz_Nm`` in the sensor frame, what acts on the sensor from the tool's side, each a mean at
rest.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import MEASURED, Provenance, mark_line
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG
from robotrue.dynamics.formats.column_table import read_column_table

ATTITUDE: Final = ("rx_deg", "ry_deg", "rz_deg")
WRENCH: Final = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
COLUMNS: Final = (*ATTITUDE, *WRENCH)


def read_sensor_csv(path: str | Path) -> tuple[Array, Array]:
    """Returns R_base_sensor (n, 3, 3) and readings (n, 6) N, N m of a file.

    Raises:
        FormatError: A column that is missing or not known, a cell that is no finite number; with
            its line.
    """
    table = read_column_table(path)
    table.require(COLUMNS, hint="angles in deg, forces in N, moments in N m.")
    return matrix_from_abc(table.stack(ATTITUDE[::-1]) * DEG), table.stack(WRENCH)


def sensor_csv(R_base_sensor: Array, readings: Array, provenance: Provenance = MEASURED) -> bytes:
    """Returns the file of rotations (n, 3, 3) and readings (n, 6) N, N m, with its mark."""
    angles = abc_from_matrix(R_base_sensor)[:, ::-1] / DEG
    rows = np.concatenate([angles, readings], axis=1)
    lines = [mark_line(provenance) + ",".join(COLUMNS)]
    lines += [",".join(f"{v:.6f}" for v in row) for row in rows.tolist()]
    return ("\n".join(lines) + "\n").encode()
