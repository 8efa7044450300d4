"""The zero of a foot: its sensors' readings on a calibration tool that is square to the spindle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tomlkit

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM, UM
from robotrue.drilling.campaign_csv import FORMS
from robotrue.drilling.foot import plane_under
from robotrue.drilling.foot_file import FootSetup
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.formats.sheet_file import read_sheet

SEAT: Final = "seat"
"""Column that names each time the tool was put on; its rows share what the seat is off."""
FEWEST: Final = 5
"""Rows, or seats, from which a deviation is told."""
OUTLYING: Final = 6.0
"""Robust deviations beyond which a row is no reading of the tool at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FootZero(Columns):
    """Mean readings on the calibration tool.

    Attributes:
        zero: (k,) m.
        sigma: (k,) m, standard deviation of that mean, from repetition alone.
        scatter: (k,) m, of one reading about the mean of its seat.
        tilt_sigma: (2,) rad, what the zero leaves uncertain of every tilt a, b.
        counts: Whether the file states counts.
        rows: How many were averaged.
        seats: How often the tool was put on; 0 where the file does not say.
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
    deviation is that of the mean of seats, so that it holds what putting the tool on repeats.

    Raises:
        FormatError: A column is missing, or a cell is not a finite number; with file and line.
        ConfigurationError: Counts, and the foot file does not say how long one is.
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
    counts = forms[0].endswith("_counts")
    if counts and setup.count is None:
        raise ConfigurationError(
            "readings in counts, and the foot does not say how long a count is.",
            source=setup.source,
            hint="count_um = 1.0",
        )
    names = tuple(forms[0].format(k + 1) for k in range(len(setup.foot.radius)))
    sheet.refuse_others((*names, SEAT))
    raw = sheet.numbers(names) * ((setup.count or MM) if counts else MM)
    seat = np.array(sheet.column(SEAT)) if sheet.has(SEAT) else None
    groups = np.arange(len(raw)) if seat is None else np.unique(seat, return_inverse=True)[1]
    seats = int(groups.max(initial=-1)) + 1
    if seats < FEWEST:
        what = "rows" if seat is None else "seats of the tool"
        raise ObservabilityError(
            f"{seats} {what}, at least {FEWEST} are needed to state how well the zero repeats.",
            source=sheet.source,
            hint="put the tool on again, read, and name each time in the column seat.",
        )
    off = np.abs(raw - np.median(raw, axis=0))
    limit = OUTLYING * np.maximum(1.4826 * np.median(off, axis=0), setup.foot.reading_sigma)
    if (far := np.argwhere(off > limit)).size:
        row, k = far[0].tolist()
        raise ImplausibleDataError(
            f"sensor {k + 1} reads {raw[row, k] / MM:.4f} mm, {off[row, k] / UM:.1f} um off its "
            f"median; the others are within {limit[k] / UM:.1f} um.",
            source=sheet.source,
            line=sheet.lines[row],
            hint="clean the tool, put it on again and replace the row.",
        )
    means = np.array([raw[groups == g].mean(axis=0) for g in range(seats)])
    sigma = np.std(means, axis=0, ddof=1) / np.sqrt(seats)
    within = raw - means[groups] if len(raw) > seats else raw - raw.mean(axis=0)
    freedom = len(raw) - (seats if len(raw) > seats else 1)
    slopes = np.linalg.pinv(setup.foot.design)[:2]
    return FootZero(
        zero=means.mean(axis=0),
        sigma=sigma,
        scatter=np.sqrt(np.sum(within**2, axis=0) / freedom),
        tilt_sigma=np.sqrt(slopes**2 @ sigma**2)[::-1],
        counts=counts,
        rows=len(raw),
        seats=0 if seat is None else seats,
        provenance=sheet.provenance,
    )


def zero_residual(found: FootZero, setup: FootSetup) -> float:
    """Returns the largest deviation (m) of the zero from a plane; 0 with three sensors."""
    return float(np.abs(plane_under(setup.foot, found.zero).residual).max())


def with_zero(text: str, found: FootZero, setup: FootSetup) -> str:
    """Returns the text of a foot file with another zero; everything else stays as it is.

    Args:
        text: Of the foot file.
        found: The zero.
        setup: What the file says.
    """
    document = tomlkit.parse(text)
    foot = document["foot"]
    for key in ("zero_mm", "zero_counts", "zero_sigma_um"):
        if key in foot:
            del foot[key]
    size, name = (setup.count or UM, "zero_counts") if found.counts else (MM, "zero_mm")
    foot[name] = np.round(found.zero / size, 6).tolist()
    foot["zero_sigma_um"] = np.round(np.maximum(found.sigma / UM, 1e-6), 6).tolist()
    return tomlkit.dumps(document)
