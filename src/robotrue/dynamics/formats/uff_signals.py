"""Time histories of universal files: dataset 58 over time (abscissa 17, function type 0 or 1).

The name of a signal is its first identification line, with its unit in it (``j1_deg``) or as label
of the ordinate (``j1`` in ``deg``). A force may have any name: its specific data type (9 or 13)
identifies it, and its direction the axis, reversed if negative. So may a single displacement (8),
which is used as the laser's.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance
from robotrue.core.units import UM
from robotrue.dynamics.formats.column_table import finite_samples
from robotrue.dynamics.formats.uff import (
    FORCE_TYPES,
    FORCE_UNITS,
    LENGTH_UNITS,
    UffSet,
    read_direction,
    read_sets,
    sets_origin,
    unit_of,
    units_of_file,
)
from robotrue.errors import FormatError, ImplausibleDataError

_FUNCTIONS: Final = (0, 1)
_TIME: Final = 17
_DISPLACEMENT: Final = 8
_SECONDS: Final = ("", "s", "sec", "none")
_LABEL: Final = "ordinate_axis_units_lab"
_DIGITS: Final = 6
"""Of the step between samples, as the header of a set prints it."""
LASER_NAME: Final = "d_um"
"""What a single displacement is taken for."""


_Numbered: TypeAlias = tuple[int, UffSet]
_Units: TypeAlias = tuple[float | None, float | None]


class TimeHistory(NamedTuple):
    """A signal of a set in the unit of its name."""

    number: int
    name: str
    time: Array
    values: Array


def read_named_histories(path: str | Path) -> tuple[dict[str, TimeHistory], Provenance]:
    """Returns the signals of a file by their names, and where they come from.

    Raises:
        FormatError: Unreadable, no time history in it, two signals of one name, a sample that is
            no finite number.
        MissingExtraError: pyuff is not installed.
    """
    sets, (length, _), origin = _read_over_time(path)
    found: dict[str, TimeHistory] = {}
    for number, one in sets:
        history = _read_history(one, number, path)
        for name in {history.name, f"{history.name}_{str(one.get(_LABEL) or '').strip()}"}:
            _enter(found, name, history, path)
    moved = [(k, one) for k, one in sets if int(one["ordinate_spec_data_type"]) == _DISPLACEMENT]
    if len(moved) == 1 and not {LASER_NAME, "d_mm"} & set(found):
        number, one = moved[0]
        unit = unit_of(one, _LABEL, LENGTH_UNITS)
        unit = length if unit is None else unit
        if unit is not None:
            history = _read_history(one, number, path)
            found[LASER_NAME] = history._replace(values=history.values * (unit / UM))
    return found, origin


def read_force_histories(path: str | Path) -> tuple[dict[str, TimeHistory], Provenance]:
    """Returns the forces (N) of a file by axis, and where they come from.

    Raises:
        FormatError: Unreadable, no force over time in it, one without unit or direction, two along
            one axis, a sample that is no finite number.
        MissingExtraError: pyuff is not installed.
    """
    sets, (_, force), origin = _read_over_time(path)
    found: dict[str, TimeHistory] = {}
    for number, one in sets:
        if int(one["ordinate_spec_data_type"]) not in FORCE_TYPES:
            continue
        axis, sign = read_direction(one, "rsp_dir", number, path)
        unit = unit_of(one, _LABEL, FORCE_UNITS)
        unit = force if unit is None else unit
        if unit is None:
            raise FormatError(
                f"set {number} has no unit: label {one.get(_LABEL)!r}, and no dataset 164.",
                source=path,
                hint="export with units, N or kN; volts and counts are not forces.",
            )
        history = _read_history(one, number, path)
        _enter(found, axis, history._replace(values=history.values * (sign * unit)), path)
    if not found:
        raise FormatError(
            "no force over time in it (dataset 58, data type 9 or 13).",
            source=path,
            hint="give the channels their type before exporting.",
        )
    return found, origin


def check_one_clock(histories: Mapping[str, TimeHistory], path: str | Path) -> Array:
    """Returns the times (n,) s that all signals share.

    Raises:
        ImplausibleDataError: They differ.
    """
    first, *rest = histories.values()
    for other in rest:
        if len(other.time) != len(first.time) or not np.array_equal(other.time, first.time):
            raise ImplausibleDataError(
                f"set {other.number} ({other.name}) has another clock than set {first.number}: "
                f"{len(other.time)} samples from {other.time[0]:g} s and {len(first.time)} from "
                f"{first.time[0]:g} s.",
                source=path,
                hint="record the channels in one task.",
            )
    return first.time


def _enter(
    found: dict[str, TimeHistory], name: str, history: TimeHistory, path: str | Path
) -> None:
    """Enters a signal under its name, or refuses a second one."""
    if name in found:
        raise FormatError(
            f"set {history.number} is {name!r}, as set {found[name].number} is.",
            source=path,
            hint="keep one channel of each name and direction.",
        )
    found[name] = history


def _read_over_time(path: str | Path) -> tuple[list[_Numbered], _Units, Provenance]:
    """Number and set of every time history, length and force of the file, and its origin."""
    sets = read_sets(path)
    kept = [
        (number, one)
        for number, one in enumerate(sets, 1)
        if int(one.get("type", 0)) == 58
        and int(one["func_type"]) in _FUNCTIONS
        and int(one["abscissa_spec_data_type"]) == _TIME
    ]
    if not kept:
        raise FormatError(
            "no time history in it (dataset 58, function type 1, abscissa over time).",
            source=path,
            hint="export the recorded channels, not their spectra.",
        )
    return kept, units_of_file(sets), sets_origin(path, sets)


def _read_history(one: UffSet, number: int, path: str | Path) -> TimeHistory:
    """A signal in the unit of the file."""
    name = str(one.get("id1") or "").strip()
    shown = f"set {number} ({name})"
    label = str(one.get("abscissa_axis_units_lab") or "").strip()
    if label.lower() not in _SECONDS:
        raise FormatError(
            f"{shown} is over {label!r}, expected s.", source=path, hint="times in s."
        )
    raw = np.asarray(one["data"])
    if np.iscomplexobj(raw):
        raise FormatError(
            f"{shown} holds complex numbers.", source=path, hint="export the time signal."
        )
    values = finite_samples(np.asarray(raw, dtype=np.float64), shown, path)
    stated = int(one["num_pts"])
    if len(values) != stated or len(values) < 2:
        raise FormatError(
            f"{shown} has {len(values)} samples, its header says {stated}.",
            source=path,
            hint="export it again.",
        )
    if int(one["abscissa_spacing"]) == 0:
        time = np.asarray(one["x"], dtype=np.float64)
    else:
        rate = _whole_rate(float(one["abscissa_inc"]), shown, path)
        time = float(one["abscissa_min"]) + np.arange(len(values)) / rate
    return TimeHistory(number, name, time, values)


def _whole_rate(step: float, shown: str, path: str | Path) -> float:
    """Samples per second of a step (s) that was printed to six digits.

    1/51200 s is printed as 1.95312e-05, 0.26 ms off after 100 s: a whole rate within that rounding
    is the one that was meant.
    """
    if not step > 0.0:
        raise FormatError(
            f"{shown} has a step of {step:g} s.", source=path, hint="export it with its clock."
        )
    last = 10.0 ** (np.floor(np.log10(step)) - _DIGITS + 1)
    slack = 0.5 * last / step**2
    whole = float(np.round(1.0 / step))
    return whole if slack < 0.5 and abs(whole - 1.0 / step) <= 1.001 * slack else 1.0 / step
