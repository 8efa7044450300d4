"""The zero of a foot: its sensors' readings on a calibration tool that is square to the spindle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tomlkit
from scipy.special import stdtrit

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign_csv import FORMS, unit_of_readings
from robotrue.drilling.foot import exchanged_columns, plane_under, sensor_orders
from robotrue.drilling.foot_file import FootSetup
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.formats.sheet import Sheet
from robotrue.measurement.formats.sheet_file import read_sheet

SEAT: Final = "seat"
"""Column that names each mounting of the tool; its rows share what the seat is off."""
FEWEST: Final = 5
"""Fewest rows, or seats, that give a deviation."""
OUTLYING: Final = 6.0
"""Robust deviations off its seat beyond which a row is no reading of the tool at rest."""
EXCHANGED: Final = 0.1
"""Share of the move from the old zero that another order of the columns leaves if it is right."""
FALSE_ALARM: Final = 1e-3
"""Share of sound files of which a seat is refused; few seats do not know their deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FootZero(Columns):
    """Mean readings on the calibration tool.

    Attributes:
        zero: (k,) m.
        sigma: (k,) m, standard deviation of that mean, from repetition alone.
        scatter: (k,) m, of one reading about the mean of its seat.
        tilt_sigma: (2,) rad, what the zero leaves uncertain of every tilt a, b: of the tilt of
            each seat, because a tool that sits askew moves all sensors together.
        counts: Whether the file states counts.
        rows: Number averaged.
        seats: Number of mountings of the tool; 0 where the file does not state it.
        provenance: Of the file.
    """

    zero: Annotated[Array, Column("k", unit="m")]
    sigma: Annotated[Array, Column("k", unit="m")]
    scatter: Annotated[Array, Column("k", unit="m")]
    tilt_sigma: Annotated[Array, Column("2", unit="rad")]
    counts: bool
    rows: int
    seats: int
    provenance: Provenance


def read_zero(path: str | Path, setup: FootSetup) -> FootZero:
    """Returns the zero in a file of readings on the calibration tool.

    Columns: ``raw1_mm, ...`` or ``raw1_counts, ...`` and optionally ``seat``. With seats the
    deviation is that of the mean of seats, so that it includes the repeatability of mounting the
    tool.

    Raises:
        FormatError: A column is missing, or a cell is not a finite number; with file and line.
        ConfigurationError: Counts, and the foot file does not state the length of a count.
        ObservabilityError: Too few rows or seats.
        ImplausibleDataError: A row far off the others.
    """
    sheet = read_sheet(path)
    forms = [form for form in FORMS[1:] if sheet.has(form.format(1))]
    if len(forms) != 1:
        raise sheet.fault(
            f"{'two forms of' if forms else 'no'} raw readings among {', '.join(sheet.header)}.",
            "raw1_mm, raw2_mm, ... or raw1_counts, raw2_counts, ... as the sensors show them.",
        )
    names = tuple(forms[0].format(k + 1) for k in range(len(setup.foot.radius)))
    sheet.refuse_others((*names, SEAT))
    raw = sheet.numbers(names) * unit_of_readings(forms[0], setup)
    seat = np.array(sheet.column(SEAT)) if sheet.has(SEAT) else None
    groups = np.arange(len(raw)) if seat is None else np.unique(seat, return_inverse=True)[1]
    seats = int(groups.max(initial=-1)) + 1
    if seats < FEWEST:
        what = "rows" if seat is None else "seats of the tool"
        raise ObservabilityError(
            f"{seats} {what}, at least {FEWEST} are needed to state the repeatability of the zero.",
            source=sheet.source,
            hint="put the tool on again, read, and name each time in the column seat.",
        )
    _refuse_outliers(raw, groups, setup, sheet)
    means = np.array([raw[groups == g].mean(axis=0) for g in range(seats)])
    sigma = np.std(means, axis=0, ddof=1) / np.sqrt(seats)
    within = raw - means[groups] if len(raw) > seats else raw - raw.mean(axis=0)
    freedom = len(raw) - (seats if len(raw) > seats else 1)
    return FootZero(
        zero=means.mean(axis=0),
        sigma=sigma,
        scatter=np.sqrt(np.sum(within**2, axis=0) / freedom),
        tilt_sigma=_tilt_sigma(setup, means),
        counts=forms[0].endswith("_counts"),
        rows=len(raw),
        seats=0 if seat is None else seats,
        provenance=sheet.provenance,
    )


def _refuse_outliers(raw: Array, groups: IntArray, setup: FootSetup, sheet: Sheet) -> None:
    """Refuses a row far off its seat, then a seat far off the others.

    Raises:
        ImplausibleDataError: Such a row, with its line.
    """
    seats = int(groups.max()) + 1
    middle = np.array([np.median(raw[groups == g], axis=0) for g in range(seats)])
    off, floor = np.abs(raw - middle[groups]), setup.foot.reading_sigma
    limit = OUTLYING * np.maximum(1.4826 * np.median(off, axis=0), floor)
    limit, where = np.broadcast_to(limit, off.shape), "the median of its seat"
    if not (off > limit).any():
        off, limit = _seats_off(middle, floor)
        off, limit, where = off[groups], limit[groups], "the mean of the other seats"
    far = np.argwhere(off > limit)
    if not len(far):
        return
    row, k = far[0].tolist()
    raise ImplausibleDataError(
        f"sensor {k + 1} reads {raw[row, k] / MM:.4f} mm, {off[row, k] / UM:.1f} um off {where}; "
        f"{limit[row, k] / UM:.1f} um are allowed.",
        source=sheet.source,
        line=sheet.lines[row],
        hint="clean the tool, put it on again and replace the row.",
    )


def _seats_off(middle: Array, floor: float) -> tuple[Array, Array]:
    """Returns (n, k) m of each seat off the mean of the others, and the limit by Student's t."""
    count, sensors = middle.shape
    others = [np.delete(middle, g, axis=0) for g in range(count)]
    spread = np.array([np.std(rows, axis=0, ddof=1) for rows in others])
    off = np.abs(middle - np.array([rows.mean(axis=0) for rows in others]))
    quantile = float(stdtrit(count - 2.0, 1.0 - FALSE_ALARM / (2.0 * count * sensors)))
    return off, quantile * np.maximum(spread, floor) * np.sqrt(count / (count - 1.0))


def _tilt_sigma(setup: FootSetup, means: Array) -> Array:
    """(2,) rad of the mean of the seats' tilts, by Student's t: few seats do not know their own.

    The variance of t with n - 1 degrees of freedom is (n - 1) / (n - 3).
    """
    seats = len(means)
    slopes = means @ np.linalg.pinv(setup.foot.design)[:2].T
    few = (seats - 1.0) / (seats - 3.0)
    return np.asarray(np.std(slopes, axis=0, ddof=1)[::-1] * np.sqrt(few / seats))


def zero_residual(found: FootZero, setup: FootSetup) -> float:
    """Returns the largest deviation (m) of the zero from a plane; 0 with three sensors."""
    return float(np.abs(plane_under(setup.foot, found.zero).residual).max())


def check_exchange(found: FootZero, setup: FootSetup) -> None:
    """Checks that the new zero is not the old one with columns exchanged.

    Raises:
        ImplausibleDataError: Another order of the columns brings it back to the old one.
    """
    if setup.zero is None:
        return
    off, order = min(
        (
            (float(np.abs(found.zero[list(p)] - setup.zero).max()), p)
            for p in sensor_orders(len(found.zero))
        ),
        default=(np.inf, ()),
    )
    stated = float(np.abs(found.zero - setup.zero).max())
    repeats = float(np.maximum(found.scatter, setup.foot.reading_sigma).max())
    if off > EXCHANGED * stated or stated < OUTLYING * repeats:
        return
    raise ImplausibleDataError(
        f"the zero moved by {stated / MM:.4f} mm, by {off / MM:.4f} mm if "
        f"{exchanged_columns(order)}: sensors are exchanged.",
        source=setup.source,
        hint="exchange the columns, or the cables; without the old zero in the foot file the new "
        "one is not checked.",
    )


def with_zero(text: str, found: FootZero, setup: FootSetup) -> str:
    """Returns the text of a foot file with another zero; everything else stays as it is.

    Args:
        text: Of the foot file.
        found: The zero.
        setup: Content of the file.
    """
    document = tomlkit.parse(text)
    foot = document["foot"]
    for key in ("zero_mm", "zero_counts", "zero_sigma_um", "zero_tilt_sigma_deg"):
        if key in foot:
            del foot[key]
    size, name = (setup.count or UM, "zero_counts") if found.counts else (MM, "zero_mm")
    foot[name] = np.round(found.zero / size, 6).tolist()
    foot["zero_sigma_um"] = np.round(np.maximum(found.sigma / UM, 1e-6), 6).tolist()
    tilt_sigma = np.round(np.maximum(found.tilt_sigma / DEG, 1e-6), 6)
    foot["zero_tilt_sigma_deg"] = tilt_sigma.tolist()
    return tomlkit.dumps(document)
