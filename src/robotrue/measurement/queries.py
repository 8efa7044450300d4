"""Where a user asks for the error: joints, and what the arm carries there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.registry import open_sheet
from robotrue.measurement.formats.table import (
    MappedSheet,
    approach_columns,
    joint_columns,
    payload_column,
    wrench_columns,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class QueryTable(Columns):
    """n poses somebody asks about.

    Attributes:
        joints: (n, dof) rad, commanded.
        wrench: (n, 6) N, N m on the tool, at the tool point, base axes; zero if not given.
        approach: (n, dof) sign of the last motion of each joint; 0 = unknown.
        payload_mass: (n,) kg at the flange; NaN means "the cell's payload".
        source_row: (n,) one-based line in the file.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    wrench: Annotated[Array, Column("n 6")]
    approach: Annotated[Array, Column("n dof")]
    payload_mass: Annotated[Array, Column("n", unit="kg", nan=True)]
    source_row: Annotated[npt.NDArray[np.int64], Column("n")]

    def __len__(self) -> int:
        return len(self.joints)


def read_queries(path: str | Path, *, mapping: ColumnMapping | str | None = None) -> QueryTable:
    """Returns the queries in a file: canonical columns, of which only the joints are needed.

    A measurement file of any known layout will do as well; its positions are not looked at.

    Raises:
        FormatError: The file is not what its mapping says, with line and column.
    """
    sheet, chosen = open_sheet(path, mapping, positions=False)
    columns = MappedSheet(sheet, chosen)
    return QueryTable(
        joints=joint_columns(columns),
        wrench=wrench_columns(columns),
        approach=approach_columns(columns),
        payload_mass=payload_column(columns),
        source_row=np.array(sheet.lines),
    )
