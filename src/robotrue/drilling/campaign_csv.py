"""A campaign's record as CSV, TSV or workbook.

Columns, in any order: ``a_deg, b_deg`` (true tilt), ``force_N``, ``z_mm``, and the readings of
sensors 1 to k as ``d1_mm, d2_mm, ...`` (less their zero), as ``raw1_mm, ...`` or as
``raw1_counts, ...``. The last two need the foot's zero. Optionally ``approach``: a label of how the
foot came down; blank is the usual way.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign import Campaign, Clamps
from robotrue.drilling.campaign_plan import CampaignPlan
from robotrue.drilling.foot_file import FootSetup
from robotrue.drilling.head import AxisOrder
from robotrue.errors import ConfigurationError, FormatError
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.sheet_file import read_sheet

TILT: Final = ("a_deg", "b_deg")
CONDITIONS: Final = ("force_N", "z_mm")
APPROACH: Final = "approach"
LEFT: Final = ("left_a_deg", "left_b_deg")
HOLE: Final = "hole"
STEEPEST: Final = 45.0
"""deg; a tilt beyond it is in another unit or of another angle."""


def read_campaign(path: str | Path, setup: FootSetup, order: AxisOrder) -> tuple[Campaign, str]:
    """Returns the campaign in a file and the SHA-256 of the file.

    Raises:
        FormatError: A column that is missing or unknown, a cell that is not a finite number; with
            file and line.
        ConfigurationError: Raw readings without the foot's zero.
    """
    sheet = read_sheet(path)
    clamps = _clamps(sheet, setup, TILT)
    lines, tilt = sheet.lines, sheet.numbers(TILT)
    steep = np.flatnonzero(np.abs(tilt).max(axis=1) > STEEPEST)
    if len(steep):
        row = int(steep[0])
        raise FormatError(
            f"a tilt of {np.abs(tilt[row]).max():g} deg, up to {STEEPEST:g} deg is possible.",
            source=sheet.source,
            line=lines[row],
            hint="a_deg and b_deg are the surface's tilt against the spindle, in degrees.",
        )
    campaign = Campaign(
        clamps=clamps,
        tilt=tilt * DEG,
        order=order,
        source=sheet.source,
        lines=lines,
        provenance=sheet.provenance,
    )
    return campaign, sheet.digest


@dataclass(frozen=True, slots=True, kw_only=True)
class ProductionRecord:
    """Holes of production and what a reference measured after each move.

    Attributes:
        clamps: The n clamps.
        left: (n, 2) rad, tilt that remained.
        hole: n names.
        lines: (n,) of the file.
        provenance: Simulated or measured, and the file.
    """

    clamps: Clamps
    left: Array
    hole: tuple[str, ...]
    lines: tuple[int, ...]
    provenance: Provenance


def read_production(path: str | Path, setup: FootSetup) -> ProductionRecord:
    """Returns the holes in a file.

    Its columns are those of a campaign with ``left_a_deg, left_b_deg`` in place of the true tilt
    and, if need be, ``hole``.

    Raises:
        FormatError: As :func:`read_campaign`.
        ConfigurationError: As :func:`read_campaign`.
    """
    sheet = read_sheet(path)
    clamps = _clamps(sheet, setup, (*LEFT, HOLE))
    hole = tuple(str(i + 1) for i in range(len(sheet)))
    return ProductionRecord(
        clamps=clamps,
        left=sheet.numbers(LEFT) * DEG,
        hole=sheet.column(HOLE) if sheet.has(HOLE) else hole,
        lines=sheet.lines,
        provenance=sheet.provenance,
    )


def write_campaign(path: str | Path, campaign: Campaign) -> None:
    """Writes a campaign with readings less their zero, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    clamps = campaign.clamps
    sensors = [f"d{k + 1}_mm" for k in range(clamps.readings.shape[1])]
    rows: list[list[object]] = [[*TILT, *sensors, *CONDITIONS, APPROACH]]
    for i in range(len(campaign)):
        rows.append(
            [
                *(f"{v / DEG:.6f}" for v in campaign.tilt[i]),
                *(f"{v / MM:.6f}" for v in clamps.readings[i]),
                f"{clamps.force[i]:.3f}",
                f"{clamps.height[i] / MM:.3f}",
                clamps.approach[i],
            ]
        )
    write_atomic(path, (mark_line(campaign.provenance) + csv_text(rows)).encode())


def write_sheet(path: str | Path, plan: CampaignPlan, sensors: int) -> None:
    """Writes a planned campaign with empty readings, to be filled in on the machine.

    Raises:
        FormatError: The file cannot be written.
    """
    names = [f"d{k + 1}_mm" for k in range(sensors)]
    rows: list[list[object]] = [[*TILT, *names, *CONDITIONS, APPROACH]]
    for i in range(len(plan)):
        rows.append(
            [
                *(f"{v / DEG:.4f}" for v in plan.tilt[i]),
                *[""] * sensors,
                f"{plan.force[i]:g}",
                f"{plan.height[i] / MM:g}",
                "",
            ]
        )
    write_atomic(path, csv_text(rows).encode())


def subtract_zeros(values: Array, setup: FootSetup, *, counts: bool) -> Array:
    """Returns raw readings (n, k), mm or counts, as readings less their zero in m.

    Raises:
        ConfigurationError: The foot file has no zero, or no size of a count.
    """
    if setup.zero is None:
        raise ConfigurationError(
            "raw readings, and the foot has no zero.",
            source=setup.source,
            hint="put the readings on the mandrel or calibration plane into zero_mm or "
            "zero_counts; a zero that is guessed is a tilt of every hole.",
        )
    if counts and setup.count is None:
        raise ConfigurationError(
            "readings in counts, and the foot does not say how long a count is.",
            source=setup.source,
            hint="count_um = 1.0",
        )
    size = (setup.count or 0.0) if counts else MM
    return np.asarray(values * size - setup.zero)


def _clamps(sheet: Sheet, setup: FootSetup, beside: tuple[str, ...]) -> Clamps:
    """The readings and conditions of every row; ``beside`` are the other columns known."""
    readings = _readings(sheet, setup, beside)
    force, height = sheet.numbers(CONDITIONS).T
    return Clamps(readings=readings, force=force, height=height * MM, approach=_approach(sheet))


def _readings(sheet: Sheet, setup: FootSetup, beside: tuple[str, ...]) -> Array:
    sensors = len(setup.foot.radius)
    have = {column_key(name) for name in sheet.header}
    forms = {
        form: tuple(form.format(k + 1) for k in range(sensors))
        for form in ("d{}_mm", "raw{}_mm", "raw{}_counts")
    }
    present = [form for form, names in forms.items() if column_key(names[0]) in have]
    if len(present) != 1:
        said = "several forms of readings" if present else "no readings"
        raise FormatError(
            f"{said} among the columns {', '.join(sheet.header)}.",
            source=sheet.source,
            line=sheet.header_line,
            hint=f"one of {', '.join(names[0] + ', ...' for names in forms.values())}.",
        )
    form = present[0]
    known = {column_key(n) for n in (*forms[form], *beside, *CONDITIONS, APPROACH)}
    unknown = [name for name in sheet.header if column_key(name) not in known]
    if unknown:
        raise FormatError(
            f"column {unknown[0]!r} is not known for a foot of {sensors} sensors.",
            source=sheet.source,
            line=sheet.header_line,
            hint=f"{', '.join((*beside, *forms[form], *CONDITIONS, APPROACH))}.",
        )
    values = sheet.numbers(forms[form])
    if form == "d{}_mm":
        return values * MM
    return subtract_zeros(values, setup, counts=form == "raw{}_counts")


def _approach(sheet: Sheet) -> tuple[str, ...]:
    return sheet.column(APPROACH) if sheet.has(APPROACH) else ()
