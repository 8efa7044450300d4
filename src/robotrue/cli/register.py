"""``robotrue register``: touched points in, the cell with its part frame out."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.app.registered import opened
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import parse_cell
from robotrue.cell.part import PartTable
from robotrue.cell.part_tables import part_tables
from robotrue.cell.toml_edit import rename_files, with_part
from robotrue.cli.console import emit_json, say, say_mark
from robotrue.cli.register_view import document, frame_document, show
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.mesh import TriangleMesh, read_mesh
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.part_points import read_points
from robotrue.planning.information import settings_of
from robotrue.program.controller_frames import ControllerFrame, controller_frame
from robotrue.store.model_file import ZIP, write_model
from robotrue.validation.part_registration import register
from robotrue.validation.registered_part import RegisteredPart
from robotrue.validation.registration_settings import RegistrationSettings

UNITS: Final = {"mm": MM, "m": 1.0, "inch": 25.4 * MM}


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
    cell, model = opened(cell_or_model)
    file = read_points(points)
    touches = replace(file.touches, radius=options.probe_radius_mm * MM)
    found = register(
        NominalModel(robot=cell.robot) if model is None else model,
        touches,
        parts=file.parts,
        settings=_settings(cell, options),
    )
    frames = _frames(found, options)
    used = refined_path if found.refined is not None else _model_path(cell, cell_or_model)
    model_file = "" if used is None else _relative(used, output)
    table = found.table(model_file=model_file, points_file=points.name, points_sha256=file.digest)
    data = _cell_bytes(cell, cell_or_model, table, output)
    if found.refined is not None:
        write_model(refined_path, found.refined, cell)
        say(
            f"touching moved the arm by {found.moved / MM:.3f} mm rms at the touches: refined "
            f"model written to {refined_path}; the frames belong to it"
        )
    write_atomic(output, data)
    say_mark(found.provenance)
    say(f"registered cell written to {output}")
    if as_json:
        emit_json(
            {
                "cell": str(output),
                "refined_model": None if found.refined is None else str(refined_path),
                **document(found),
                "frames": [frame_document(name, frame) for name, frame in frames],
            },
            found.provenance,
        )
    else:
        show(found, frames)


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
        arm=settings_of(cell),
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


def _model_path(cell: Cell, source: Path) -> Path | None:
    """The file of the model that was given, itself or through a registered cell; None: nominal."""
    if read_bytes(source).startswith(ZIP):
        return source
    if cell.part is None or cell.part.identity.kind == "nominal":
        return None
    return source.parent / cell.part.model_file


def _relative(path: Path, output: Path) -> str:
    """A path as the file that is written names it."""
    return Path(os.path.relpath(path.resolve(), output.parent.resolve())).as_posix()


def _cell_bytes(cell: Cell, source: Path, table: PartTable, output: Path) -> bytes:
    """Returns the registered cell, read back before anything is written."""
    if not read_bytes(source).startswith(ZIP):
        text = rename_files(cell.text, partial(_moved, source=source, output=output))
    elif cell.text and not cell.files:
        text = cell.text
    else:  # the files that it names are in the model file, not beside the output
        text = cell_text(cell)
    data = with_part(text, part_tables(table)).encode()
    parse_cell(data, output)
    return data


def _moved(name: str, source: Path, output: Path) -> str:
    """A path that one cell file names, as another names it."""
    path = (source.parent / name).resolve()
    if Path(name).is_absolute() or source.parent.resolve() == output.parent.resolve():
        return str(name)
    return Path(os.path.relpath(path, output.parent.resolve())).as_posix()


def _frames(found: RegisteredPart, options: Options) -> list[tuple[str, ControllerFrame]]:
    return [
        (
            frame.name,
            controller_frame(
                frame.registration.T_base_part,
                form,
                name=frame.name,
                number=options.frame_number + k,
            ),
        )
        for form in options.frame_format
        for k, frame in enumerate(found.frames)
    ]
