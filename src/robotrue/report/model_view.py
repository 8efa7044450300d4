"""Properties of a model in shop units, for commands and pages."""

from __future__ import annotations

from typing import Final, TypedDict

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.training_summary import EstimatedParameter, TrainingSummary
from robotrue.core.units import DEG, MM
from robotrue.report.warning_groups import group_warnings
from robotrue.robot.model import UNITS, parameter_names

SHOP: Final = {"m": ("mm", MM), "rad": ("deg", DEG), "1": ("ppm", 1e-6)}
"""SI unit of an error parameter, and what a shop prints."""
MDEG: Final = 1e-3 * DEG


class GeometricRow(TypedDict):
    """A geometric error, see :func:`list_geometric_errors`."""

    value: float
    sd: float
    unit: str
    known: str


class StiffnessRow(TypedDict):
    """Stiffness and compliance of a drive, see :func:`stiffness`."""

    Nm_per_rad: float | None
    sd_Nm_per_rad: float | None
    compliance_rad_per_Nm: float
    compliance_sd_rad_per_Nm: float
    known: str


class DriveRow(TypedDict):
    """Ripple and backlash of a drive, see :func:`drive_errors`."""

    ripple_mdeg: float
    strongest: int | None
    backlash_mdeg: float


def list_geometric_errors(model: ErrorModel) -> dict[str, GeometricRow]:
    """Returns value, standard deviation, unit and class of every geometric error.

    Lengths in mm, angles in deg, gear ratios in 1e-6. ``known`` is ``seen``, ``weakly seen`` or
    ``prior only``; parameters the method does not estimate are left out.
    """
    out: dict[str, GeometricRow] = {}
    for name, row in _read_estimates(model).items():
        unit, size = SHOP.get(_si_unit(name), ("", 1.0))
        if unit:
            out[name] = {
                "value": row.value / size,
                "sd": row.sd / size,
                "unit": unit,
                "known": row.kind,
            }
    return out


def stiffness(model: ErrorModel) -> dict[str, StiffnessRow]:
    """Returns stiffness and standard deviation per joint, N m/rad; None where none is known.

    The estimate is of the compliance c; stiffness is 1/c with standard deviation sd(c)/c^2, which
    is meaningless where sd(c) is not well below c.
    """
    out: dict[str, StiffnessRow] = {}
    for name, row in _read_estimates(model).items():
        if not name.startswith("compliance"):
            continue
        value, sd = row.value, row.sd
        determined = value > 0.0 and sd < 0.5 * value
        out[f"joint {name.removeprefix('compliance')}"] = {
            "Nm_per_rad": 1.0 / value if determined else None,
            "sd_Nm_per_rad": sd / value**2 if determined else None,
            "compliance_rad_per_Nm": value,
            "compliance_sd_rad_per_Nm": sd,
            "known": row.kind,
        }
    return out


def drive_errors(model: ErrorModel) -> dict[str, DriveRow]:
    """Returns ripple and backlash of each joint of a model that has learned them, in 1e-3 deg.

    ``ripple_mdeg`` is the root mean square over a turn, ``strongest`` the cycles per revolution of
    the largest harmonic, ``backlash_mdeg`` half the gap between the two approach directions.
    """
    tables = model.mean_tables()
    if tables is None or not (len(tables.harmonics) or tables.backlash.any()):
        return {}
    size = np.hypot(tables.ripple_sin, tables.ripple_cos)
    rms = np.sqrt(0.5 * (size**2).sum(axis=1))
    return {
        f"joint {j + 1}": {
            "ripple_mdeg": float(rms[j] / MDEG),
            "strongest": int(tables.harmonics[int(size[j].argmax())]) if rms[j] > 0.0 else None,
            "backlash_mdeg": float(tables.backlash[j] / MDEG),
        }
        for j in range(tables.robot.dof)
    }


def result_facts(summary: TrainingSummary) -> list[tuple[str, str]]:
    """Returns what a calibration came to, in words and mm."""
    poses = f"{summary.rows or 'not recorded'}"
    screened = len(summary.screened_rows)
    if screened:
        poses += f", {screened} of them screened out"
    facts = [("method", summary.method or "not recorded"), ("poses", poses)]
    for size, name in (
        (summary.rms, "residual rms"),
        (summary.held_out_mean, "mean on held-out blocks"),
    ):
        if size is not None:
            facts.append((name, f"{size / MM:.4f} mm"))
    if summary.white_sd is not None:
        facts.append(("noise estimate per axis", _describe_noise(summary.white_sd)))
    verdict = summary.verdict or "not recorded"
    facts.append(("verdict", f"{verdict}: {VERDICTS[verdict]}" if verdict in VERDICTS else verdict))
    return facts


def _describe_noise(white: float) -> str:
    """White noise of an sd in m; an sd that rounds to zero means that the stated noise suffices."""
    text = f"{white / MM:.4f} mm"
    return "none beyond instrument and repeatability" if float(text.split()[0]) == 0.0 else text


VERDICTS: Final = {
    "determined": "the data determine every parameter the predictions depend on",
    "conditional": "read the warnings",
}


def remarks(model: ErrorModel) -> list[str]:
    """Returns what error terms learned, the warnings by cure, and the harmless parameters."""
    summary = model.training_summary()
    warnings = [f"warning: {line}" for line in group_warnings(model, summary.warnings)]
    return [*summary.terms, *warnings, *harmless_remark(summary)]


def harmless_remark(summary: TrainingSummary) -> list[str]:
    """Returns one sentence, or none, about what is unseen and does not matter."""
    names = sorted((unseen.name for unseen in summary.unseen if unseen.harmless), key=len)
    if not names:
        return []
    shown = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return [
        f"note: {len(names)} combination{'' if len(names) == 1 else 's'} of parameters "
        f"({shown}) cannot be separated; predicted positions are not affected. "
        "--json lists the remedy of each"
    ]


def _read_estimates(model: ErrorModel) -> dict[str, EstimatedParameter]:
    """The parameters of the summary, or, of a model that keeps no table there, its mean and sd."""
    stated = model.training_summary().parameters
    if stated is not None:
        return {
            name: parameter
            for name in parameter_names(model.robot.dof)
            if (parameter := stated.get(name)) is not None and parameter.kind != "fixed"
        }
    actual = model.mean_tables()
    if actual is None:
        return {}
    names, errors = parameter_names(actual.robot.dof), np.asarray(actual.robot.errors)
    belief = model.belief()
    spread = np.full(len(errors), np.nan)
    if belief is not None:
        spread = np.sqrt(belief.variance[: len(errors)])
    return {
        name: EstimatedParameter(value=float(value), sd=float(sd), kind="not recorded")
        for name, value, sd in zip(names, errors, spread, strict=True)
        if value != 0.0
    }


def _si_unit(name: str) -> str:
    group = name.rstrip("0123456789")
    unit = UNITS[group if group in UNITS else group.split("_")[0]]
    if unit == "m or rad":
        return "rad" if "_r" in name else "m"
    return unit
