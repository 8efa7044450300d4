"""Recorded signals and forces with their times: CSV, TDMS, MAT or UFF, units in the names.

Columns of a CSV, channels of a TDMS file or variables of a MAT file are called alike: ``t_s`` and
e.g. ``j1_deg`` .. ``j6_deg`` or ``d_um``. Others next to them are left alone. Channels of a TDMS
file may state their clock as ``wf_increment`` instead of ``t_s``, as variables may as ``rate_Hz``;
time histories of a universal file (dataset 58 over time) have one each, see
:mod:`robotrue.dynamics.formats.uff_signals`.

Of forces, a CSV has ``t_s,fx_N,fy_N,fz_N``, in any order; other columns are refused. MAT:
``fx_N, fy_N, fz_N`` with ``t_s`` or ``rate_Hz``. TDMS: three channels of one group called ``fx, fy,
fz`` (or ``Fx [N]``: letters only count), each with its unit as property ``unit_string`` (N or kN),
in brackets or as ``fx_N``. TDMS is read through npTDMS and UFF through pyuff (extra ``dynamics``).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.files import write_atomic
from robotrue.core.provenance import MEASURED, Provenance, mark_line, read_provenance
from robotrue.dynamics.force import ForceRecord, check_force
from robotrue.dynamics.formats.column_table import (
    TdmsChannel,
    check_suffix,
    even_rate,
    finite_samples,
    mat_column,
    read_column_table,
    read_mat,
    read_tdms_groups,
    table_bytes,
)
from robotrue.dynamics.formats.uff import UFF_SUFFIXES
from robotrue.dynamics.formats.uff_signals import (
    check_one_clock,
    read_force_histories,
    read_named_histories,
)
from robotrue.dynamics.frf import ComplexArray
from robotrue.errors import FormatError, ImplausibleDataError

SIGNAL_SUFFIXES: Final = (".csv", ".txt", ".tdms", ".mat", *UFF_SUFFIXES)
TIME: Final = "t_s"
COLUMNS: Final = ("t_s", "fx_N", "fy_N", "fz_N")
_BARE: Final = re.compile(r"(t|time|f[xyz])([ _(\[].*)?", re.IGNORECASE)
_UNITS: Final = {"n": 1.0, "newton": 1.0, "newtons": 1.0, "kn": 1e3}
_CHANNEL: Final = re.compile(r"\s*f[ _]?([xyz])\s*(?:[\[(_ ]\s*(\w+)\s*[\])]?)?\s*", re.IGNORECASE)


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
    signals = readers.get(suffix, _read_csv)(path, choices)
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
    values = _stack_variables(variables, names, path)
    if TIME in variables or "rate_Hz" not in variables:
        time = mat_column(variables, TIME, path, len(values))
    else:
        time = np.arange(len(values)) / mat_column(variables, "rate_Hz", path, 1)[0]
    return Signals(
        time=time,
        names=tuple(names),
        values=values,
        source=str(path),
        provenance=read_provenance(path),
    )


def _read_tdms(path: str | Path, choices: Sequence[Sequence[str]]) -> Signals:
    channels = {c.name.strip(): c for group in read_tdms_groups(path) for c in group}
    names = _choose(path, list(channels), choices)
    columns = [np.asarray(channels[name][:], dtype=np.float64) for name in names]
    if TIME in channels:
        time = np.asarray(channels[TIME][:], dtype=np.float64)
    else:
        start, step = _waveform_clock(channels[names[0]], path)
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


def _stack_variables(
    variables: Mapping[str, ComplexArray], names: Sequence[str], path: str | Path
) -> Array:
    """Columns (n, k) of a MAT file, all as long as the first."""
    first = mat_column(variables, names[0], path)
    others = [mat_column(variables, name, path, len(first)) for name in names[1:]]
    return np.column_stack([first, *others])


def _waveform_clock(channel: TdmsChannel, path: str | Path) -> tuple[float, float]:
    """Start and step, s, that a channel of a TDMS file states."""
    step = float(channel.properties.get("wf_increment", 0.0))
    if not step > 0.0:
        raise FormatError(
            f"channel {channel.name!r} has no clock (wf_increment).",
            source=path,
            hint=f"record it as a waveform, or put times in a channel {TIME}.",
        )
    return float(channel.properties.get("wf_start_offset", 0.0)), step


def read_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    """Returns the force record of a CSV, TDMS, MAT or UFF file, and what is odd but harmless.

    Raises:
        FormatError: Unreadable, of an unknown suffix, a column, channel or variable that is
            missing, without its unit or not known, a sample that is no finite number; with its
            line where there are lines.
        ImplausibleDataError: An uneven clock or an implausible sensor.
        MissingExtraError: TDMS without npTDMS, UFF without pyuff.
    """
    suffix = check_suffix(path, SIGNAL_SUFFIXES)
    readers = {".tdms": _read_tdms_force, ".mat": _read_mat_force}
    readers |= dict.fromkeys(UFF_SUFFIXES, _read_uff_force)
    return readers.get(suffix, _read_csv_force)(path)


def write_force_csv(path: str | Path, record: ForceRecord) -> None:
    """Writes a record, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    table = table_bytes(list(COLUMNS), np.column_stack([record.time, record.force]))
    write_atomic(path, mark_line(record.provenance).encode() + table)


def _build_record(
    path: str | Path,
    force: Array,
    clock: tuple[float, float],
    provenance: Provenance | None = None,
    line_of: Callable[[int], int] | None = None,
) -> tuple[ForceRecord, tuple[str, ...]]:
    """The record of forces (n, 3) N at a clock (start s, rate 1/s), checked."""
    record = ForceRecord(
        start=clock[0],
        rate=clock[1],
        force=force,
        source=str(path),
        provenance=read_provenance(path) if provenance is None else provenance,
    )
    return record, check_force(record, line_of)


def _read_csv_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    table = read_column_table(path)
    bare = [name for name in table.names if name not in COLUMNS and _BARE.fullmatch(name)]
    if bare:
        raise table.fault(
            f"column {bare[0]!r} in another unit or in none; expected {','.join(COLUMNS)}.",
            "convert to s and N and name the unit: fx_N.",
        )
    table.require(
        COLUMNS,
        hint="an unmeasured force is not assumed to be zero; write zeros if it is.",
    )
    clock = even_rate(table.column("t_s"), path, table.line)
    return _build_record(path, table.stack(COLUMNS[1:]), clock, table.provenance, table.line)


def _read_mat_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    variables = read_mat(path)
    force = _stack_variables(variables, COLUMNS[1:], path)
    if "rate_Hz" in variables:
        clock = 0.0, float(mat_column(variables, "rate_Hz", path, 1)[0])
    else:
        clock = even_rate(mat_column(variables, TIME, path, len(force)), path)
    return _build_record(path, force, clock)


def _read_tdms_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    channels = _tdms_channels(path)
    _check_axes(channels, path, hint="name the three channels fx, fy and fz.")
    times = channels.pop("t", None)
    clocks = {axis: _channel_clock(channel, times, path) for axis, channel in channels.items()}
    if len(set(clocks.values())) > 1:
        raise ImplausibleDataError(
            f"clocks differ (start s, step s): {sorted(set(clocks.values()))}.",
            source=path,
            hint="record the three channels in one task.",
        )
    columns = [_channel_force(channels[axis], path) for axis in "xyz"]
    if len({len(column) for column in columns}) > 1:
        raise FormatError(
            f"fx, fy and fz have {', '.join(str(len(c)) for c in columns)} samples.", source=path
        )
    start, step = clocks["x"]
    return _build_record(path, np.column_stack(columns), (start, 1.0 / step))


def _read_uff_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    histories, provenance = read_force_histories(path)
    _check_axes(histories, path, hint="give the three channels the directions 1, 2 and 3.")
    clock = even_rate(check_one_clock(histories, path), path)
    force = np.column_stack([histories[axis].values for axis in "xyz"])
    return _build_record(path, force, clock, provenance)


def _check_axes(found: Container[str], path: str | Path, hint: str) -> None:
    """Passes if there is a channel along each axis."""
    missing = [f"f{axis}" for axis in "xyz" if axis not in found]
    if missing:
        raise FormatError(f"no channel {', '.join(missing)}.", source=path, hint=hint)


def _tdms_channels(path: str | Path) -> dict[str, TdmsChannel]:
    found: dict[str, TdmsChannel] = {}
    for group in read_tdms_groups(path):
        for channel in group:
            if channel.name.strip() == "t_s":
                found["t"] = channel
            named = _CHANNEL.fullmatch(channel.name)
            if named is None:
                continue
            axis = named[1].lower()
            if axis in found:
                raise FormatError(
                    f"two channels f{axis}: {found[axis].path} and {channel.path}.",
                    source=path,
                    hint="keep one group of channels.",
                )
            found[axis] = channel
    return found


def _channel_clock(
    channel: TdmsChannel, times: TdmsChannel | None, path: str | Path
) -> tuple[float, float]:
    if "wf_increment" not in channel.properties and times is not None:
        start, rate = even_rate(np.asarray(times[:], dtype=np.float64), path)
        return start, 1.0 / rate
    return _waveform_clock(channel, path)


def _channel_force(channel: TdmsChannel, path: str | Path) -> Array:
    named = _CHANNEL.fullmatch(channel.name)
    unit = channel.properties.get("unit_string") or (named[2] if named is not None else None)
    scale = _UNITS.get(str(unit).strip().lower()) if unit else None
    if scale is None:
        raise FormatError(
            f"channel {channel.name!r} is in {unit or 'no unit'}, expected N or kN.",
            source=path,
            hint="give the channel its scale and unit_string N; volts and counts are not forces.",
        )
    values = np.asarray(channel[:], dtype=np.float64)
    return np.asarray(scale * finite_samples(values, repr(channel.name), path), dtype=np.float64)
