"""A campaign's record as CSV, TSV or workbook.

Columns, in any order: ``a_deg, b_deg`` (true tilt), ``force_N``, ``z_mm``, and the readings of
sensors 1 to k as ``d1_mm, d2_mm, ...`` (less their zero), as ``raw1_mm, ...`` or as ``raw1_counts,
...``. The last two need the foot's zero. Optionally ``approach``: a label of how the foot came
down, blank for the usual way; and the machine position: ``X_mm, Y_mm`` and ``axis_A_deg,
axis_B_deg`` as it counts them. ``plate`` names the plate, as a planned sheet does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign import Campaign, Clamps
from robotrue.drilling.campaign_checks import check_campaign
from robotrue.drilling.campaign_plan import CampaignPlan
from robotrue.drilling.foot_file import FootSetup, read_foot
from robotrue.drilling.foot_model import NormalModel, use_zero
from robotrue.drilling.head import AxisOrder
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError
from robotrue.measurement.formats.sheet import Sheet, column_key, write_columns
from robotrue.measurement.formats.sheet_file import read_sheet

TILT: Final = ("a_deg", "b_deg")
CONDITIONS: Final = ("force_N", "z_mm")
APPROACH: Final = "approach"
PLACE: Final = ("X_mm", "Y_mm")
PLATE: Final = "plate"
"""Name of the plate a clamp is on, for people; what it faces follows from tilt and axes."""
AXES: Final = ("axis_A_deg", "axis_B_deg")
LEFT: Final = ("left_a_deg", "left_b_deg")
HOLE: Final = "hole"
VERSION: Final = "version"
FORMS: Final = ("d{}_mm", "raw{}_mm", "raw{}_counts")
"""Names of the readings of sensor 1, 2, ...: less their zero, raw as lengths, raw as counts."""
FORMS_HINT: Final = f"one of {', '.join(form.format(1) + ', ...' for form in FORMS)}."
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
    clamps, tilt = _read_clamps(sheet, setup, TILT), sheet.numbers(TILT)
    steep = np.flatnonzero(np.abs(tilt).max(axis=1) > STEEPEST)
    if len(steep):
        row = int(steep[0])
        raise FormatError(
            f"a tilt of {np.abs(tilt[row]).max():g} deg, up to {STEEPEST:g} deg is possible.",
            source=sheet.source,
            line=sheet.lines[row],
            hint="a_deg and b_deg are the surface's tilt against the spindle, in degrees.",
        )
    campaign = Campaign(
        clamps=clamps,
        tilt=tilt * DEG,
        order=order,
        source=sheet.source,
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
        source: The file.
        provenance: Simulated or measured, and the file.
    """

    clamps: Clamps
    left: Array
    hole: tuple[str, ...]
    source: str
    provenance: Provenance


def read_production(
    path: str | Path, setup: FootSetup, *, version: int | None = None
) -> ProductionRecord:
    """Returns the holes in a file.

    Its columns are those of a campaign with ``left_a_deg, left_b_deg`` in place of the true tilt
    and, if need be, ``hole`` and ``version``: of the model that moved the hole, as `drill run`
    answers and its journal states it.

    Args:
        path: The file.
        setup: Of the foot.
        version: Of the model they refine; not compared without.

    Raises:
        ModelMismatchError: A hole that an older or newer model moved.
        FormatError: As :func:`read_campaign`.
        ConfigurationError: As :func:`read_campaign`.
    """
    sheet = read_sheet(path)
    counted = tuple(str(i + 1) for i in range(len(sheet)))
    holes = sheet.column(HOLE) if sheet.has(HOLE) else counted
    if version is not None and sheet.has(VERSION):
        _check_versions(sheet, holes, version)
    return ProductionRecord(
        clamps=_read_clamps(sheet, setup, (*LEFT, HOLE, VERSION)),
        left=sheet.numbers(LEFT) * DEG,
        hole=holes,
        source=sheet.source,
        provenance=sheet.provenance,
    )


def _check_versions(sheet: Sheet, holes: tuple[str, ...], version: int) -> None:
    moved = sheet.numbers((VERSION,))[:, 0]
    others = np.flatnonzero(moved != version)
    if len(others):
        row = int(others[0])
        age = "older" if moved[row] < version else "newer"
        raise ModelMismatchError(
            f"version {moved[row]:g} of the model moved hole {holes[row]}, this is version "
            f"{version}: {len(others)} of {len(moved)} references are {age} than the model.",
            source=sheet.source,
            line=sheet.lines[row],
            hint="the model of that version, or only the holes that this one moved.",
        )


def write_campaign(path: str | Path, campaign: Campaign) -> None:
    """Writes a campaign with readings less their zero, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    clamps = campaign.clamps
    columns: dict[str, Sequence[str]] = dict(
        zip(TILT, (_print(tilt / DEG, ".6f") for tilt in campaign.tilt.T), strict=True)
    )
    columns |= {f"d{k + 1}_mm": _print(d / MM, ".6f") for k, d in enumerate(clamps.readings.T)}
    conditions = (_print(clamps.force, ".3f"), _print(clamps.height / MM, ".3f"))
    columns |= dict(zip(CONDITIONS, conditions, strict=True)) | {APPROACH: clamps.approach}
    for names, values in ((PLACE, clamps.place / MM), (AXES, clamps.axes / DEG)):
        if np.isfinite(values).all():
            columns |= dict(zip(names, (_print(v, ".6f") for v in values.T), strict=True))
    write_columns(path, columns, campaign.provenance)


def write_sheet(path: str | Path, plan: CampaignPlan, sensors: int) -> None:
    """Writes a planned campaign with empty readings, to be filled in on the machine.

    Raises:
        FormatError: The file cannot be written.
    """
    blank = [""] * len(plan)
    columns: dict[str, Sequence[str]] = dict(
        zip(TILT, (_print(tilt / DEG, ".4f") for tilt in plan.tilt.T), strict=True)
    )
    columns |= {f"d{k + 1}_mm": blank for k in range(sensors)}
    conditions = (_print(plan.force, "g"), _print(plan.height / MM, "g"))
    columns |= dict(zip(CONDITIONS, conditions, strict=True)) | {APPROACH: blank}
    if np.isfinite(plan.axes).all():
        columns = {PLATE: plan.plate, **columns}
        columns |= dict(zip(AXES, (_print(v / DEG, ".4f") for v in plan.axes.T), strict=True))
    write_columns(path, columns, MEASURED)


def readings_less_zero(raw: Array, form: str, setup: FootSetup) -> Array:
    """Returns readings (n, k) m less their zero of values (n, k) in one of :data:`FORMS`.

    Raises:
        ConfigurationError: Raw readings, and the foot file has no zero, or no size of a count.
    """
    if form == FORMS[0]:
        return raw * MM
    if setup.zero is None:
        raise ConfigurationError(
            "raw readings, and the foot has no zero.",
            source=setup.source,
            hint="put the readings on the mandrel or calibration plane into zero_mm or "
            "zero_counts; a guessed zero tilts every hole.",
        )
    return np.asarray(raw * unit_of_readings(form, setup) - setup.zero)


def unit_of_readings(form: str, setup: FootSetup) -> float:
    """Returns m per unit of readings in one of :data:`FORMS`.

    Raises:
        ConfigurationError: Counts, and the foot file does not state the length of a count.
    """
    if not form.endswith("_counts"):
        return MM
    if setup.count is None:
        raise ConfigurationError(
            "readings in counts, and the foot does not state the length of a count.",
            source=setup.source,
            hint="count_um = 1.0",
        )
    return setup.count


def setup_of(model: NormalModel, path: Path, foot: Path | None) -> FootSetup:
    """Returns the setup readings are read with: the foot file's zero, the model's sensors.

    Args:
        model: What the readings are for.
        path: Its file, for messages.
        foot: Foot file; None for readings less their zero.

    Raises:
        ConfigurationError: A foot whose sensors are elsewhere.
    """
    if foot is None:
        return FootSetup(foot=model.foot, head=model.head, count=None, zero=None, source=str(path))
    stated = read_foot(foot)
    same = len(stated.foot.radius) == len(model.foot.radius) and np.allclose(
        stated.foot.seat, model.foot.seat, rtol=0.0, atol=1.0 * UM
    )
    if not same:
        raise ConfigurationError(
            f"the sensors of {foot.name} are in other places than those of the model.",
            source=foot,
            hint="pass the foot file of the campaign, or fit again.",
        )
    return stated


def read_test(
    model: NormalModel, path: Path, rows: Path, foot: Path | None
) -> tuple[NormalModel, Campaign, str]:
    """Returns a model for the zero of a test, its checked clamps, and the SHA-256 of their file.

    Args:
        model: To be evaluated.
        path: Its file, for messages.
        rows: The clamps.
        foot: As in :func:`setup_of`.
    """
    setup = setup_of(model, path, foot)
    test, digest = read_campaign(rows, setup, model.head.order)
    check_campaign(model.foot, test)
    return use_zero(model, setup.taken_zero), test, digest


def _read_clamps(sheet: Sheet, setup: FootSetup, beside: tuple[str, ...]) -> Clamps:
    """The readings and conditions of every row; ``beside`` are the other columns known."""
    sensors = len(setup.foot.radius)
    forms = [form for form in FORMS if sheet.has(form.format(1))]
    if len(forms) != 1:
        said = "several forms of readings" if forms else "no readings"
        raise sheet.fault(f"{said} among the columns {', '.join(sheet.header)}.", FORMS_HINT)
    names = tuple(forms[0].format(k + 1) for k in range(sensors))
    known = (*beside, *names, *CONDITIONS, APPROACH, PLATE, *PLACE, *AXES)
    keys = set(map(column_key, known))
    unknown = [name for name in sheet.header if column_key(name) not in keys]
    if unknown:
        raise sheet.fault(
            f"column {unknown[0]!r} is unknown for a foot of {sensors} sensors.",
            f"{', '.join(known)}.",
        )
    force, height = sheet.numbers(CONDITIONS).T
    return Clamps(
        readings=readings_less_zero(sheet.numbers(names), forms[0], setup),
        force=force,
        height=height * MM,
        approach=sheet.column(APPROACH) if sheet.has(APPROACH) else (),
        place=_read_places(sheet, PLACE) * MM,
        axes=_read_places(sheet, AXES) * DEG,
    )


def _read_places(sheet: Sheet, names: tuple[str, str]) -> Array:
    """(n, 2) machine positions in the file's units; NaN without both columns.

    Raises:
        FormatError: One column without the other, or a cell that is not a finite number.
    """
    if not any(sheet.has(name) for name in names):
        return np.full((len(sheet), 2), np.nan)
    return sheet.numbers(names)


def _print(values: Array, digits: str) -> list[str]:
    return [f"{value:{digits}}" for value in values]
