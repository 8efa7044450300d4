"""``robotrue inspect``: what a file holds, told from its content and not its name."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_json, emit_table, say
from robotrue.core.files import read_bytes
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import FormatError
from robotrue.measurement.formats.registry import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.formats import detect, read_program
from robotrue.program.program import FrameTable, Motion, Program, Reason
from robotrue.robot.forward import forward
from robotrue.robot.model import UNITS, RobotModel, parameter_names
from robotrue.store.model_file import ModelFile, read_model


def run(path: Path, *, as_json: bool) -> None:
    """Prints what the file holds."""
    data = read_bytes(path)
    if data.startswith(b"PK") and path.suffix.lower() not in (".xlsx", ".xlsm", ".ods"):
        document = model_document(read_model(path))
    elif _is_cell(data):
        document = cell_document(read_cell(path))
    elif detect(data, path.name) is not None:
        document = program_document(read_program(path, FrameTable()))
    else:
        document = measurement_document(_measurements(path))
    if as_json:
        emit_json(document)
    else:
        _show(path, document)


def model_document(stored: ModelFile) -> dict[str, Any]:
    """Returns a model file's kind, training summary, identified errors and doubts."""
    actual = stored.model.mean_tables()
    errors = {} if actual is None else _identified(actual.robot)
    return {
        "holds": "error model",
        "kind": stored.archive.kind,
        "schema": stored.archive.schema,
        "robot": stored.model.robot.name,
        **dict(stored.model.training_summary()),
        "identified": errors,
    }


def cell_document(cell: Cell) -> dict[str, Any]:
    """Returns what was understood of a cell.toml."""
    robot = cell.robot
    home = forward(robot, np.zeros((1, robot.dof)))[0, :3, 3]
    return {
        "holds": "cell",
        "robot": robot.name,
        "convention": robot.convention,
        "reach_mm": robot.reach / MM,
        "tool_at_zero_mm": (home / MM).round(4).tolist(),
        "moving_mass_kg": float(robot.link_mass.sum()),
        "payload_kg": float(cell.payload.mass[0]),
        "limits_deg": (robot.limits / DEG).round(4).tolist(),
        "target_mm": (cell.T_flange_target[:3, 3] / MM).tolist(),
        "tracker_frame": cell.frame,
        "tracker": cell.tracker.name,
        "tracker_sigma_at_3m_um": float(cell.tracker.sigma_range(np.array(3.0))) / UM,
        "repeatability_mm": cell.repeatability / MM,
        "doubts": list(cell.doubts),
    }


def measurement_document(measurements: MeasurementSet) -> dict[str, Any]:
    """Returns counts, extent and noise of a measurement file."""
    span = np.ptp(measurements.position, axis=0) / MM
    sigma = np.sqrt(np.trace(measurements.covariance, axis1=1, axis2=2) / 3.0) / UM
    return {
        "holds": "measurements",
        "poses": len(measurements),
        "joints": measurements.dof,
        "frame": measurements.frame,
        "full_poses": int(measurements.has_rotation.sum()),
        "loaded_poses": int((np.abs(measurements.wrench).max(axis=1) > 0.0).sum()),
        "extent_mm": span.round(1).tolist(),
        "joint_range_deg": (
            np.stack([measurements.joints.min(axis=0), measurements.joints.max(axis=0)]) / DEG
        )
        .round(2)
        .tolist(),
        "mean_sigma_um": float(sigma.mean()),
        "sets": list(measurements.group_names),
        "sources": list(measurements.sources),
    }


def program_document(program: Program) -> dict[str, Any]:
    """Returns counts by motion and by reason of a program."""
    return {
        "holds": "program",
        "dialect": program.dialect,
        "targets": len(program),
        "motions": {m.name: int(c) for m in Motion if (c := (program.motion == m).sum())},
        "left_alone": {
            r.name: int(c)
            for r in Reason
            if r is not Reason.NONE and (c := (program.reason == r).sum())
        },
        "notes": list(program.notes),
    }


def _identified(robot: RobotModel) -> dict[str, str]:
    """The error vector in shop units: mm, deg, um/(kN m)."""
    out = {}
    for name, value in zip(parameter_names(robot.dof), robot.errors, strict=True):
        if value == 0.0:
            continue
        unit = UNITS[name.rstrip("0123456789").split("_")[0]]
        if unit == "m or rad":
            unit = "rad" if "_r" in name else "m"
        if unit == "m":
            out[name] = f"{value / MM:+.4f} mm"
        elif unit == "rad":
            out[name] = f"{value / DEG:+.5f} deg"
        elif unit == "1":
            out[name] = f"{value:+.3e}"
        else:
            out[name] = f"{value:.4e} rad/(N m)"
    return out


def _is_cell(data: bytes) -> bool:
    try:
        return "robot" in tomllib.loads(data.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return False


def _measurements(path: Path) -> MeasurementSet:
    try:
        return read_measurements(path)
    except FormatError as cause:
        raise FormatError(
            f"not a model, cell, program or measurement file that is known here ({cause.message})",
            source=path,
            line=cause.line,
            hint="robotrue inspect takes .rtm, cell.toml, KRL programs and measurement CSV.",
        ) from cause


def _show(path: Path, document: dict[str, Any]) -> None:
    rows = []
    later: list[str] = []
    for key, value in document.items():
        if isinstance(value, dict):
            rows += [(f"{key} {k}", str(v)) for k, v in value.items() if not isinstance(v, dict)]
        elif isinstance(value, list) and value and isinstance(value[0], str):
            later += [f"{key}: {line}" for line in value]
        else:
            rows.append((key, f"{value:.6g}" if isinstance(value, float) else str(value)))
    emit_table(path.name, ("", ""), rows)
    for line in later:
        say(line)
