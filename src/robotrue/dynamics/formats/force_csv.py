"""Force records as CSV: ``t_s,fx_N,fy_N,fz_N``, in any order; other columns are refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.files import write_atomic
from robotrue.core.provenance import mark_line
from robotrue.dynamics.clock import even_rate
from robotrue.dynamics.force import ForceRecord, check_force
from robotrue.dynamics.formats.column_table import read_column_table, table_bytes

COLUMNS: Final = ("t_s", "fx_N", "fy_N", "fz_N")
_BARE: Final = re.compile(r"(t|time|f[xyz])([ _(\[].*)?", re.IGNORECASE)


def read_force_csv(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    """Returns the record of a file, checked, and what is odd about it but harmless.

    Raises:
        FormatError: A column that is missing, without its unit or not known; a cell that is no
            finite number; with its line.
        ImplausibleDataError: An uneven clock or a sensor that cannot be right.
    """
    table = read_column_table(path)
    for name in table.names:
        if name in COLUMNS:
            continue
        bare = _BARE.fullmatch(name)
        what = "in another unit or in none" if bare else "is not known"
        raise table.fault(
            f"column {name!r} {what}; expected {','.join(COLUMNS)}.",
            "convert to s and N and say so in the name: fx_N." if bare else "remove the column.",
        )
    for name in COLUMNS:
        if name not in table.names:
            raise table.fault(
                f"no column {name}; expected {','.join(COLUMNS)}.",
                "a force that was not measured cannot be taken as zero; write zeros if it is.",
            )
    start, rate = even_rate(table.column("t_s"), path, table.line)
    record = ForceRecord(
        start=start,
        rate=rate,
        force=table.stack(COLUMNS[1:]),
        source=str(path),
        provenance=table.provenance,
    )
    return record, check_force(record, table.line)


def write_force_csv(path: str | Path, record: ForceRecord) -> None:
    """Writes a record, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    table = table_bytes(list(COLUMNS), np.column_stack([record.time, record.force]))
    write_atomic(path, mark_line(record.provenance).encode() + table)
