"""Force records as CSV, MAT, TDMS or UFF (through npTDMS and pyuff, extra ``dynamics``).

CSV: ``t_s,fx_N,fy_N,fz_N``, in any order; other columns are refused. MAT: ``fx_N, fy_N, fz_N`` with
``t_s`` or ``rate_Hz``. TDMS: three channels of one group called ``fx, fy, fz`` (or ``Fx [N]``:
letters only count), each with its unit as property ``unit_string`` (N or kN), in brackets or as
``fx_N``, and its clock as ``wf_increment`` or in a channel ``t_s`` beside them. UFF: dataset 58
over time, see :mod:`robotrue.dynamics.formats.uff_signals`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line, read_provenance
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
from robotrue.dynamics.formats.uff_signals import check_one_clock, read_force_histories
from robotrue.errors import FormatError, ImplausibleDataError

FORCE_SUFFIXES: Final = (".csv", ".txt", ".tdms", ".mat", *UFF_SUFFIXES)
COLUMNS: Final = ("t_s", "fx_N", "fy_N", "fz_N")
_BARE: Final = re.compile(r"(t|time|f[xyz])([ _(\[].*)?", re.IGNORECASE)
_UNITS: Final = {"n": 1.0, "newton": 1.0, "newtons": 1.0, "kn": 1e3}
_CHANNEL: Final = re.compile(r"\s*f[ _]?([xyz])\s*(?:[\[(_ ]\s*(\w+)\s*[\])]?)?\s*", re.IGNORECASE)


def read_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    """Returns the force record of a CSV, TDMS, MAT or UFF file, and what is odd but harmless.

    Raises:
        FormatError: Unreadable, of an unknown suffix, a column, channel or variable that is
            missing, without its unit or not known, a sample that is no finite number; with its
            line where there are lines.
        ImplausibleDataError: An uneven clock or a sensor that cannot be right.
        MissingExtraError: TDMS without npTDMS, UFF without pyuff.
    """
    suffix = check_suffix(path, FORCE_SUFFIXES)
    readers = {".tdms": _read_tdms, ".mat": _read_mat} | dict.fromkeys(UFF_SUFFIXES, _read_uff)
    return readers.get(suffix, _read_csv)(path)


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


def _read_csv(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    table = read_column_table(path)
    bare = [name for name in table.names if name not in COLUMNS and _BARE.fullmatch(name)]
    if bare:
        raise table.fault(
            f"column {bare[0]!r} in another unit or in none; expected {','.join(COLUMNS)}.",
            "convert to s and N and say so in the name: fx_N.",
        )
    table.require(
        COLUMNS,
        hint="a force that was not measured cannot be taken as zero; write zeros if it is.",
    )
    clock = even_rate(table.column("t_s"), path, table.line)
    return _build_record(path, table.stack(COLUMNS[1:]), clock, table.provenance, table.line)


def _read_mat(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    variables = read_mat(path)
    columns = [mat_column(variables, "fx_N", path)]
    n = len(columns[0])
    columns += [mat_column(variables, f"f{axis}_N", path, n) for axis in "yz"]
    if "rate_Hz" in variables:
        clock = 0.0, float(mat_column(variables, "rate_Hz", path, 1)[0])
    else:
        clock = even_rate(mat_column(variables, "t_s", path, n), path)
    return _build_record(path, np.column_stack(columns), clock)


def _read_tdms(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
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


def _read_uff(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
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
    step = channel.properties.get("wf_increment")
    if step is None and times is not None:
        start, rate = even_rate(np.asarray(times[:], dtype=np.float64), path)
        return start, 1.0 / rate
    if step is None or not float(step) > 0.0:
        raise FormatError(
            f"channel {channel.name!r} has no clock (wf_increment).",
            source=path,
            hint="record it as a waveform, or put times in a channel t_s.",
        )
    return float(channel.properties.get("wf_start_offset", 0.0)), float(step)


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
