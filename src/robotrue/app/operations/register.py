"""Locate the part by probing, and link its frame to the model of the arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.outputs import check_output
from robotrue.app.presentation import PlainResult
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import (
    CellOrModel,
    FrameFormats,
    FrameNumber,
    PartTolerance,
    ToolSigma,
    TouchSigma,
    cell_output,
)
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import (
    FRAME_NUMBER,
    MESH_UNIT,
    PROBE_RADIUS_MM,
    REGISTRATION_FIT,
    REGISTRATION_METHOD,
    TOUCH_MM,
)


class RegisterRequest(Request):
    """Probing points to locate the part with, and their uncertainty."""

    cell: CellOrModel
    points: Annotated[Path, InputFile(argument="POINTS")]
    """CSV of the touches."""
    output: Annotated[Path, cell_output()]
    """Registered cell to write."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    robot_sigma_mm: float | None = None
    """Standard deviation of the arm over the part; default: from its model."""
    tool_sigma_mm: ToolSigma = None
    tolerance_mm: PartTolerance = None
    probe_radius_mm: float = PROBE_RADIUS_MM
    """Radius of the probe's ball."""
    fit: Literal["auto", "frame", "joint"] = REGISTRATION_FIT
    """auto; frame: the arm stays unchanged; joint: estimates arm, tool and frame."""
    method: Literal["touches", "feng2018", "three-two-one"] = REGISTRATION_METHOD
    """touches: all count; feng2018: three points, right angle at the first; three-two-one: six
    touches of three faces."""
    mesh: Annotated[Path | None, InputFile()] = None
    """The part (STL): touches with a normal lie on it."""
    mesh_unit: str = MESH_UNIT
    """mm, m or inch."""
    model_out: Annotated[Path | None, Output(what="a robotrue file", suffixes=(".robotrue",))] = (
        None
    )
    """Refined model, if probing refined the arm; default: beside the cell."""
    frame_format: FrameFormats = ()
    frame_number: FrameNumber = FRAME_NUMBER


@operation()
def run(request: RegisterRequest, context: Context) -> PlainResult:
    """Registers, and writes the cell and, where touching refined the arm, its model.

    Raises:
        ConfigurationError: An invalid unit, format of frames or radius.
        ObservabilityError: Touches that do not fix the part.
    """
    from robotrue.app.registered import model_file_of, open_arm, registered_cell, relative_name
    from robotrue.app.registration_view import (
        frames_document,
        registration_blocks,
        registration_document,
        write_frames,
    )
    from robotrue.app.touch_settings import mesh_scale, registration_settings
    from robotrue.core.surfaces import read_mesh
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.robot.configuration import axis_relation
    from robotrue.store.model_file import write_model
    from robotrue.validation.part_registration import register

    output, source = context.output(request.output), context.cell_file(request.cell)
    refined_path = request.model_out or output.with_name(f"{output.stem}_model.robotrue")
    _check_request(request, source, refined_path)
    unit = mesh_scale(request.mesh_unit)
    cell, arm = open_arm(source)
    file = read_points(request.points, axis_relation(cell.robot))
    found = register(
        arm,
        replace(file.touches, radius=request.probe_radius_mm * MM),
        parts=file.parts,
        settings=registration_settings(
            cell,
            request.touch_sigma_mm,
            robot_sigma_mm=request.robot_sigma_mm,
            tool_sigma_mm=request.tool_sigma_mm,
            tolerance_mm=request.tolerance_mm,
            fit=request.fit,
            method=request.method,
            mesh=None if request.mesh is None else read_mesh(request.mesh, unit=unit),
        ),
    )
    frames = write_frames(found.frames, request.frame_format, request.frame_number)
    refined = None if found.refined is None else refined_path
    used = refined or model_file_of(cell, source)
    table = found.table(
        model_file="" if used is None else relative_name(used, output),
        points_file=request.points.name,
        points_sha256=file.digest,
    )
    data = registered_cell(cell, source, table, output)
    if found.refined is not None:
        write_model(refined_path, found.refined, cell)
        context.inform(
            f"probing changed the arm by {found.moved / MM:.3f} mm rms at the touches: refined "
            f"model written to {refined_path}; the frames belong to it"
        )
    context.write(output, data, "registered cell")
    return PlainResult(
        values={
            "cell": str(output),
            "refined_model": None if refined is None else str(refined),
            **registration_document(found),
            "frames": frames_document(frames),
        },
        shown=tuple(registration_blocks(found, [frame.text for _, frame in frames])),
        provenance=found.provenance,
    )


def _check_request(request: RegisterRequest, source: Path, refined: Path) -> None:
    """Refuses, before any work, what cannot be written or stated."""
    import numpy as np

    from robotrue.program.controller_frames import controller_frame

    check_output(refined, [p for p in (source, request.points, request.mesh) if p is not None])
    for form in request.frame_format:
        controller_frame(np.eye(4), form, number=request.frame_number)
    if not 0.0 <= request.probe_radius_mm < 100.0:
        raise ConfigurationError(
            f"--probe-radius-mm is {request.probe_radius_mm:g} mm, expected 0 to 100 mm.",
            hint="--probe-radius-mm 3",
        )
