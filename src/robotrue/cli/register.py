"""``robotrue register``: touched points in, the cell with its part frame out."""

from __future__ import annotations

import os
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import parse_cell, read_cell
from robotrue.cell.part import PartTable
from robotrue.cell.part_tables import with_part, with_urdf
from robotrue.cell.writer import cell_text
from robotrue.cli.calibrate import fit_settings
from robotrue.cli.console import emit_facts, emit_json, emit_table, say
from robotrue.cli.inputs import check_output
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.mesh import TriangleMesh, read_mesh
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.points import read_points
from robotrue.program.controller_frames import FORMS, ControllerFrame, controller_frame
from robotrue.store.model_file import ZIP, read_model, write_model
from robotrue.validation.registered_part import FoundFrame, RegisteredPart
from robotrue.validation.registration import register
from robotrue.validation.registration_settings import RegistrationSettings

UNITS: Final = {"mm": MM, "m": 1.0, "inch": 25.4 * MM}
SHOWN: Final = 40
"""Touches in the printed table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line says besides the files, in its own units."""

    touch_sigma_mm: float
    robot_sigma_mm: float | None
    tool_sigma_mm: float | None
    tolerance_mm: float | None
    probe_radius_mm: float
    fit: str
    mesh: Path | None
    mesh_unit: str
    model_out: Path | None
    frame_format: tuple[str, ...]
    frame_number: int


def run(
    cell_or_model: Path, points: Path, output: Path, options: Options, *, as_json: bool
) -> None:
    """Registers, writes the cell (and a model, where touching refined it), says what it found."""
    refined_path = options.model_out or output.with_name(f"{output.stem}_model.robotrue")
    inputs = [p for p in (cell_or_model, points, options.mesh) if p is not None]
    for path in (output, refined_path):
        check_output(path, inputs)
    for form in options.frame_format:
        controller_frame(np.eye(4), form, number=options.frame_number)  # refuses before any work
    if not 0.0 <= options.probe_radius_mm < 100.0:
        raise ConfigurationError(
            f"--probe-radius-mm is {options.probe_radius_mm:g} mm, expected 0 to 100 mm.",
            hint="--probe-radius-mm 3",
        )
    cell, model = _opened(cell_or_model)
    file = read_points(points)
    touches = replace(file.touches, radius=options.probe_radius_mm * MM)
    found = register(
        cell.robot.nominal() if model is None else model,
        touches,
        parts=file.parts,
        settings=_settings(cell, options),
    )
    model_file = _written_model(found, model, cell_or_model, refined_path, output)
    table = found.table(model_file=model_file, points_file=points.name, points_sha256=file.digest)
    data = _cell_bytes(cell, cell_or_model, model, table, output)
    if found.refined is not None:
        write_model(refined_path, found.refined, cell)
        say(
            f"touching moved the arm by {found.moved / MM:.3f} mm rms at the touches: refined "
            f"model written to {refined_path}; the frames belong to it"
        )
    write_atomic(output, data)
    say(f"registered cell written to {output}")
    frames = _frames(found, options)
    if as_json:
        emit_json(
            {
                "cell": str(output),
                "refined_model": None if found.refined is None else str(refined_path),
                **document(found),
                "frames": [_frame_document(name, frame) for name, frame in frames],
            }
        )
    else:
        _show(found, frames)


def _opened(path: Path) -> tuple[Cell, ErrorModel | None]:
    if read_bytes(path).startswith(ZIP):
        stored = read_model(path)
        return stored.cell, stored.model
    return read_cell(path), None


def _settings(cell: Cell, options: Options) -> RegistrationSettings:
    robot, tool, tolerance = (
        None if size is None else size * MM
        for size in (options.robot_sigma_mm, options.tool_sigma_mm, options.tolerance_mm)
    )
    return RegistrationSettings(
        touch=options.touch_sigma_mm * MM,
        robot=robot,
        tool_sigma=tool,
        tolerance=tolerance,
        fit=_fit(options.fit),
        T_flange_tool=cell.robot.T_flange_tool,
        mesh=_mesh(options),
        arm=fit_settings(cell),
    )


def _fit(word: str) -> Literal["auto", "frame", "joint"]:
    match word:
        case "auto" | "frame" | "joint":
            return word
    raise ConfigurationError(f"--fit {word!r}, expected auto, frame or joint.", hint="--fit auto")


def _mesh(options: Options) -> TriangleMesh | None:
    if options.mesh_unit not in UNITS:
        raise ConfigurationError(
            f"--mesh-unit {options.mesh_unit!r}, expected {', '.join(UNITS)}.",
            hint="--mesh-unit mm",
        )
    return None if options.mesh is None else read_mesh(options.mesh, unit=UNITS[options.mesh_unit])


def _written_model(
    found: RegisteredPart,
    model: ErrorModel | None,
    source: Path,
    refined: Path,
    output: Path,
) -> str:
    """Path of the model the frames belong to, relative to the cell file; empty for the nominal."""
    if found.refined is None and model is None:
        return ""
    path = source if found.refined is None else refined
    return Path(os.path.relpath(path.resolve(), output.parent.resolve())).as_posix()


def _cell_bytes(
    cell: Cell, source: Path, model: ErrorModel | None, table: PartTable, output: Path
) -> bytes:
    """The registered cell, read back before anything is written."""
    if model is not None:
        text = cell_text(cell)
    else:
        text = read_bytes(source).decode("utf-8-sig")
        text = with_urdf(text, _moved_urdf(text, source, output))
    data = with_part(text, table).encode()
    parse_cell(data, output)
    return data


def _moved_urdf(text: str, source: Path, output: Path) -> str:
    urdf = tomllib.loads(text).get("robot", {}).get("urdf", "")
    path = (source.parent / urdf).resolve()
    if Path(urdf).is_absolute() or source.parent.resolve() == output.parent.resolve():
        return str(urdf)
    return Path(os.path.relpath(path, output.parent.resolve())).as_posix()


def document(found: RegisteredPart) -> dict[str, Any]:
    """Returns JSON values: those of the first part at the top, all parts under ``parts``."""
    parts = [_part_document(frame) for frame in found.frames]
    first = dict(parts[0])
    if len(parts) > 1:
        first["residual_mm"] = _all_residuals(found)
        first["outliers"] = [name for part in parts for name in part["outliers"]]
    return {
        **first,
        "verdict": found.verdict,
        "reasons": [reason for part in parts for reason in part["reasons"]],
        "doubts": [*found.doubts, *(doubt for part in parts for doubt in part["doubts"])],
        "route": found.route,
        "model": found.identity.document(),
        "touched_with": found.touched_with.document(),
        "moved_mm": found.moved / MM,
        "parts": parts,
    }


def _all_residuals(found: RegisteredPart) -> Mapping[str, float]:
    """Residual by name over all parts; the part's name goes before one that is not alone."""
    names = [name for frame in found.frames for name in frame.registration.names]
    alone = len(set(names)) == len(names)
    return {
        (name if alone else f"{frame.name}/{name}"): float(length / MM)
        for frame in found.frames
        for name, length in zip(frame.registration.names, frame.registration.distances, strict=True)
    }


def _part_document(frame: FoundFrame) -> dict[str, Any]:
    fit = frame.registration
    T = fit.T_base_part
    return {
        "part": frame.name,
        "xyz_mm": (T[:3, 3] / MM).tolist(),
        "abc_deg": (abc_from_matrix(T[:3, :3]) / DEG).tolist(),
        "residual_mm": dict(zip(fit.names, (fit.distances / MM).tolist(), strict=True)),
        "rms_mm": fit.rms / MM,
        "outliers": list(fit.outliers),
        "covariance": fit.covariance.tolist(),
        "verdict": frame.verdict,
        "reasons": list(frame.reasons),
        "doubts": list(frame.doubts),
        "touches": len(fit.names),
        "sigma_mm": fit.sigma / MM,
        "misfit": fit.misfit,
        "with_arm": frame.with_arm,
        "machined_95_mm": dict(zip(fit.names, (frame.region / MM).tolist(), strict=True)),
    }


def _frames(found: RegisteredPart, options: Options) -> list[tuple[str, ControllerFrame]]:
    return [
        (
            frame.name,
            controller_frame(
                frame.registration.T_base_part,
                form,
                name=frame.name,
                number=min(options.frame_number + k, FORMS[form][1]),
            ),
        )
        for form in options.frame_format
        for k, frame in enumerate(found.frames)
    ]


def _frame_document(name: str, frame: ControllerFrame) -> dict[str, str]:
    return {"part": name, "system": frame.system, "order": frame.order, "text": frame.text}


def _show(found: RegisteredPart, frames: list[tuple[str, ControllerFrame]]) -> None:
    for frame in found.frames:
        fit, T = frame.registration, frame.registration.T_base_part
        sd = np.sqrt(np.diag(fit.covariance))
        emit_facts(
            f"{frame.name} in base, with {found.identity}",
            [
                ("x, y, z", _three(T[:3, 3] / MM, "mm")),
                ("A, B, C", _three(abc_from_matrix(T[:3, :3]) / DEG, "deg")),
                ("one sigma", f"{_three(sd[:3] / MM, 'mm')}; {_three(sd[3:] / DEG, 'deg')}"),
                ("touches", f"{len(fit.names)}, of which {len(fit.outliers)} not believed"),
                ("residual rms", f"{fit.rms / MM:.4f} mm"),
                (f"{_share(frame)}, 95 %", f"{frame.region.max() / MM:.3f} mm or better"),
                ("verdict", frame.verdict),
            ],
        )
        emit_table(
            "touches",
            ("", "residual mm", f"{_share(frame)}, 95 % mm", ""),
            [
                (name, f"{far / MM:.4f}", f"{reach / MM:.3f}", "" if good else "not believed")
                for name, far, reach, good in list(
                    zip(fit.names, fit.distances, frame.region, fit.believed, strict=True)
                )[:SHOWN]
            ],
        )
        for reason in frame.reasons:
            say(f"no-go: {reason}")
        for doubt in frame.doubts:
            say(f"note: {doubt}")
    for doubt in found.doubts:
        say(f"note: {doubt}")
    for _, controller in frames:
        _paste(controller)


def _share(frame: FoundFrame) -> str:
    """What the region at a touch is about: without joints the arm's share is not known."""
    return "machined there" if frame.with_arm else "frame there"


def _paste(frame: ControllerFrame) -> None:
    sys.stdout.write(frame.text + "\n")


def _three(values: Any, unit: str) -> str:
    return ", ".join(f"{float(v):.4f}" for v in values) + f" {unit}"
