"""Force records as TDMS, through npTDMS (extra ``dynamics``).

Three channels of one group are called ``fx, fy, fz`` (or ``Fx [N]``: letters only count), each with
its unit as property ``unit_string`` (N or kN), in brackets or as ``fx_N``, and its clock as
``wf_increment`` or in a channel ``t_s`` beside them.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.provenance import read_provenance
from robotrue.dynamics.clock import even_rate
from robotrue.dynamics.force import ForceRecord, check_force
from robotrue.errors import FormatError, ImplausibleDataError, MissingExtraError

_UNITS: Final = {"n": 1.0, "newton": 1.0, "newtons": 1.0, "kn": 1e3}
_TIME: Final = "t_s"
_NAME: Final = re.compile(r"\s*f[ _]?([xyz])\s*(?:[\[(_ ]\s*(\w+)\s*[\])]?)?\s*", re.IGNORECASE)


def read_force_tdms(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    """Returns the record of a file, checked, and what is odd about it but harmless.

    Raises:
        FormatError: Unreadable, a channel missing or twice, without unit or clock, of another
            length, or a sample that is no number.
        ImplausibleDataError: Clocks that differ, or a sensor that cannot be right.
        MissingExtraError: npTDMS is not installed.
    """
    channels = _channels(path)
    missing = [f"f{axis}" for axis in "xyz" if axis not in channels]
    if missing:
        raise FormatError(
            f"no channel {', '.join(missing)}.",
            source=path,
            hint="name the three channels fx, fy and fz.",
        )
    times = channels.pop("t", None)
    clocks = {axis: _clock(channel, times, path) for axis, channel in channels.items()}
    if len(set(clocks.values())) > 1:
        raise ImplausibleDataError(
            f"clocks differ (start s, step s): {sorted(set(clocks.values()))}.",
            source=path,
            hint="record the three channels in one task.",
        )
    columns = [_values(channels[axis], path) for axis in "xyz"]
    if len({len(column) for column in columns}) > 1:
        raise FormatError(
            f"fx, fy and fz have {', '.join(str(len(c)) for c in columns)} samples.", source=path
        )
    start, step = clocks["x"]
    record = ForceRecord(
        start=start,
        rate=1.0 / step,
        force=np.column_stack(columns),
        source=str(path),
        provenance=read_provenance(path),
    )
    return record, check_force(record)


def _channels(path: str | Path) -> dict[str, Any]:
    try:
        import nptdms
    except ImportError as cause:
        raise MissingExtraError(
            "TDMS needs npTDMS.", hint="pip install 'robotrue[dynamics]'"
        ) from cause
    try:
        file = nptdms.TdmsFile.read(io.BytesIO(read_bytes(path)))
    except FormatError:
        raise
    except Exception as cause:  # npTDMS raises whatever its parsing meets
        raise FormatError(
            f"cannot be read as TDMS ({type(cause).__name__}: {cause}).", source=path
        ) from cause
    found: dict[str, Any] = {}
    for group in file.groups():
        for channel in group.channels():
            if channel.name.strip() == _TIME:
                found["t"] = channel
            named = _NAME.fullmatch(channel.name)
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


def _clock(channel: Any, times: Any, path: str | Path) -> tuple[float, float]:
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


def _values(channel: Any, path: str | Path) -> Array:
    named = _NAME.fullmatch(channel.name)
    unit = channel.properties.get("unit_string") or (named[2] if named is not None else None)
    scale = _UNITS.get(str(unit).strip().lower()) if unit else None
    if scale is None:
        raise FormatError(
            f"channel {channel.name!r} is in {unit or 'no unit'}, expected N or kN.",
            source=path,
            hint="give the channel its scale and unit_string N; volts and counts are not forces.",
        )
    values = np.asarray(channel[:], dtype=float)
    if not np.isfinite(values).all():
        bad = int(np.argmin(np.isfinite(values)))
        raise FormatError(
            f"sample {bad} of {channel.name!r} is {values[bad]}, expected a finite number.",
            source=path,
            hint="cut the record before it.",
        )
    return np.asarray(scale * values, dtype=np.float64)
