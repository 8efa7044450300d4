"""Recorded signals with their times: CSV, TDMS, MAT or UFF, units in the names.

Columns of a CSV, channels of a TDMS file or variables of a MAT file are called alike: ``t_s`` and
e.g. ``j1_deg`` .. ``j6_deg`` or ``d_um``. Others beside them are left alone. Channels of a TDMS
file may state their clock as ``wf_increment`` instead of ``t_s``, as variables may as ``rate_Hz``;
time histories of a universal file have one each, see :mod:`robotrue.dynamics.formats.uff_signals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance, read_provenance
from robotrue.dynamics.formats.column_table import (
    check_suffix,
    finite_samples,
    mat_column,
    read_column_table,
    read_mat,
    read_tdms_groups,
)
from robotrue.dynamics.formats.uff import UFF_SUFFIXES
from robotrue.dynamics.formats.uff_signals import check_one_clock, read_named_histories
from robotrue.errors import FormatError, ImplausibleDataError

SIGNAL_SUFFIXES: Final = (".csv", ".txt", ".tdms", ".mat", *UFF_SUFFIXES)
TIME: Final = "t_s"


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals(Columns):
    """Signals on one clock.

    Attributes:
        time: (n,) s, rising.
        names: (k,) as in the file, with their units.
        values: (n, k) in those units.
        source: Path as given.
        provenance: Simulated or measured, and the file.
    """

    time: Annotated[Array, Column("n", unit="s")]
    names: Annotated[tuple[str, ...], Column("k")]
    values: Annotated[Array, Column("n k")]
    source: str
    provenance: Provenance = MEASURED

    def __len__(self) -> int:
        return len(self.time)


def read_signals(path: str | Path, choices: Sequence[Sequence[str]]) -> Signals:
    """Returns the first of several sets of signals that a file holds whole.

    Args:
        path: CSV, TDMS, MAT or UFF.
        choices: Names of the signals of each set.

    Raises:
        FormatError: Unreadable, of an unknown suffix, without any of the sets or a clock, a sample
            that is no finite number; with its line where there are lines.
        ImplausibleDataError: Times that do not rise, or clocks that differ.
        MissingExtraError: TDMS without npTDMS, UFF without pyuff.
    """
    suffix = check_suffix(path, SIGNAL_SUFFIXES)
    readers = {".tdms": _read_tdms, ".mat": _read_mat} | dict.fromkeys(UFF_SUFFIXES, _read_uff)
    read = readers.get(suffix, _read_csv)
    signals = read(path, choices)
    falls = np.flatnonzero(np.diff(signals.time) <= 0.0)
    if len(signals) < 2 or falls.size:
        k = int(falls[0]) if falls.size else 0
        shown = ", ".join(f"{v:.9g}" for v in signals.time[k : k + 2])
        raise ImplausibleDataError(
            f"sample {k}: times {shown} s, expected two or more that rise.",
            source=path,
            hint="sort the record out at the recorder.",
        )
    return signals


def _choose(path: str | Path, held: Sequence[str], choices: Sequence[Sequence[str]]) -> list[str]:
    """The first set of names that are all held."""
    for names in choices:
        if set(names) <= set(held):
            return list(names)
    known = " or ".join(",".join(names) for names in choices)
    raise FormatError(
        f"signals {', '.join(held) or 'none'}; expected {TIME} and {known}.",
        source=path,
        hint="units are parts of the names: rename and convert.",
    )


def _read_csv(path: str | Path, choices: Sequence[Sequence[str]]) -> Signals:
    table = read_column_table(path)
    names = _choose(path, table.names, choices)
    if TIME not in table.names:
        raise table.fault(f"no column {TIME}.", "times in s.")
    return Signals(
        time=table.column(TIME),
        names=tuple(names),
        values=table.stack(names),
        source=str(path),
        provenance=table.provenance,
    )


def _read_mat(path: str | Path, choices: Sequence[Sequence[str]]) -> Signals:
    variables = read_mat(path)
    names = _choose(path, list(variables), choices)
    first = mat_column(variables, names[0], path)
    rest = [mat_column(variables, name, path, len(first)) for name in names[1:]]
    if TIME in variables or "rate_Hz" not in variables:
        time = mat_column(variables, TIME, path, len(first))
    else:
        time = np.arange(len(first)) / mat_column(variables, "rate_Hz", path, 1)[0]
    return Signals(
        time=time,
        names=tuple(names),
        values=np.column_stack([first, *rest]),
        source=str(path),
        provenance=read_provenance(path),
    )


def _read_tdms(path: str | Path, choices: Sequence[Sequence[str]]) -> Signals:
    channels = {c.name.strip(): c for group in read_tdms_groups(path) for c in group}
    names = _choose(path, list(channels), choices)
    columns = [np.asarray(channels[name][:], dtype=np.float64) for name in names]
    first = channels[names[0]]
    if TIME in channels:
        time = np.asarray(channels[TIME][:], dtype=np.float64)
    else:
        step = float(first.properties.get("wf_increment", 0.0))
        if not step > 0.0:
            raise FormatError(
                f"channel {names[0]!r} has no clock (wf_increment).",
                source=path,
                hint=f"record it as a waveform, or put times in a channel {TIME}.",
            )
        start = float(first.properties.get("wf_start_offset", 0.0))
        time = np.asarray(start + step * np.arange(len(columns[0])))
    for name, column in zip(names, columns, strict=True):
        finite_samples(column, repr(name), path, len(time))
    return Signals(
        time=time,
        names=tuple(names),
        values=np.column_stack(columns),
        source=str(path),
        provenance=read_provenance(path),
    )


def _read_uff(path: str | Path, choices: Sequence[Sequence[str]]) -> Signals:
    histories, provenance = read_named_histories(path)
    names = _choose(path, list(histories), choices)
    chosen = {name: histories[name] for name in names}
    return Signals(
        time=check_one_clock(chosen, path),
        names=tuple(names),
        values=np.column_stack([history.values for history in chosen.values()]),
        source=str(path),
        provenance=provenance,
    )
