"""Find where the part stands from touched points, and tie it to the model of the arm."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block
from robotrue.app.request import InputFile, Option, Output, Request
from robotrue.app.request_fields import (
    CellOrModel,
    FrameFormats,
    FrameNumber,
    PartTolerance,
    ToolSigma,
    TouchSigma,
    cell_output,
)
from robotrue.core.provenance import Provenance
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

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.core.surfaces import TriangleMesh
    from robotrue.program.controller_frames import ControllerFrame
    from robotrue.validation.registered_part import RegisteredPart
    from robotrue.validation.registration_frame import RegistrationSettings

UNITS: Final = {"mm": MM, "m": 1.0, "inch": 25.4 * MM}


class RegisterRequest(Request):
    """Which touches to find the part from, and how sure they are."""

    cell: CellOrModel
    points: Annotated[Path, InputFile(argument="POINTS", help="CSV of the touches.")]
    output: Annotated[Path, cell_output("Registered cell to write.")]
    touch_sigma_mm: TouchSigma = TOUCH_MM
    robot_sigma_mm: Annotated[
        float | None, Option(help="Of the arm over the part; default: what its model says.")
    ] = None
    tool_sigma_mm: ToolSigma = None
    tolerance_mm: PartTolerance = None
    probe_radius_mm: Annotated[float, Option(help="Of the probe's ball.")] = PROBE_RADIUS_MM
    fit: Annotated[
        Literal["auto", "frame", "joint"],
        Option(help="auto; frame: leave the arm as it is; joint: arm, tool and frame."),
    ] = REGISTRATION_FIT
    method: Annotated[
        Literal["touches", "feng2018", "three-two-one"],
        Option(
            help="touches: all count; feng2018: three points, right angle at the first; "
            "three-two-one: six touches of three faces."
        ),
    ] = REGISTRATION_METHOD
    mesh: Annotated[
        Path | None, InputFile(help="The part (STL): touches with a normal lie on it.")
    ] = None
    mesh_unit: Annotated[str, Option(help="mm, m or inch.")] = MESH_UNIT
    model_out: Annotated[
        Path | None,
        Output(
            what="a robotrue file",
            suffixes=(".robotrue",),
            help="Refined model, where touching moved the arm; default: beside the cell.",
        ),
    ] = None
    frame_format: FrameFormats = ()
    frame_number: FrameNumber = FRAME_NUMBER


@dataclass(frozen=True, slots=True, kw_only=True)
class Registered:
    """A part that was found in its cell.

    Attributes:
        found: Its frames, and the model they belong to.
        frames: The same in the words of controllers, with the name of the part.
        output: Registered cell that was written.
        refined_model: Model that was written, where touching moved the arm.
        provenance: Of the touches and the model.
    """

    found: RegisteredPart
    frames: tuple[tuple[str, ControllerFrame], ...]
    output: Path
    refined_model: Path | None
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values; mm, deg."""
        from robotrue.app.registration_view import frames_document, registration_document

        return {
            "cell": str(self.output),
            "refined_model": None if self.refined_model is None else str(self.refined_model),
            **registration_document(self.found),
            "frames": frames_document(self.frames),
        }

    def blocks(self) -> Iterable[Block]:
        """Returns each frame, its touches, what is against it, and the lines for controllers."""
        from robotrue.app.registration_view import registration_blocks

        return registration_blocks(self.found, [frame.text for _, frame in self.frames])


def run(request: RegisterRequest, context: Context) -> Registered:
    """Registers, and writes the cell and, where touching refined the arm, its model.

    Raises:
        ConfigurationError: A unit, a format of frames or a radius that cannot be.
        ObservabilityError: Touches that do not fix the part.
    """
    from dataclasses import replace

    from robotrue.app.registered import open_model
    from robotrue.app.registered_cell_file import model_file_of, registered_cell, relative_name
    from robotrue.app.registration_view import write_frames
    from robotrue.calibration.nominal import NominalModel
    from robotrue.core.files import write_atomic
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.store.model_file import write_model
    from robotrue.validation.part_registration import register

    output, source = context.output(request.output), context.cell_file(request.cell)
    refined_path = request.model_out or output.with_name(f"{output.stem}_model.robotrue")
    _check_request(request, source, refined_path)
    cell, model = open_model(source)
    file = read_points(request.points)
    found = register(
        NominalModel(robot=cell.robot) if model is None else model,
        replace(file.touches, radius=request.probe_radius_mm * MM),
        parts=file.parts,
        settings=_settings(cell, request),
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
            f"touching moved the arm by {found.moved / MM:.3f} mm rms at the touches: refined "
            f"model written to {refined_path}; the frames belong to it"
        )
    write_atomic(output, data)
    context.wrote("registered cell", output)
    return Registered(
        found=found,
        frames=frames,
        output=output,
        refined_model=refined,
        provenance=found.provenance,
    )


def _check_request(request: RegisterRequest, source: Path, refined: Path) -> None:
    """Refuses, before any work, what cannot be written or stated."""
    import numpy as np

    from robotrue.app.outputs import check_output
    from robotrue.program.controller_frames import controller_frame

    check_output(refined, [p for p in (source, request.points, request.mesh) if p is not None])
    for form in request.frame_format:
        controller_frame(np.eye(4), form, number=request.frame_number)
    if not 0.0 <= request.probe_radius_mm < 100.0:
        raise ConfigurationError(
            f"--probe-radius-mm is {request.probe_radius_mm:g} mm, expected 0 to 100 mm.",
            hint="--probe-radius-mm 3",
        )


def _settings(cell: Cell, request: RegisterRequest) -> RegistrationSettings:
    from robotrue.planning.information import settings_of
    from robotrue.validation.registration_frame import RegistrationSettings

    robot, tool, tolerance = (
        None if size is None else size * MM
        for size in (request.robot_sigma_mm, request.tool_sigma_mm, request.tolerance_mm)
    )
    return RegistrationSettings(
        touch=request.touch_sigma_mm * MM,
        robot=robot,
        tool_sigma=tool,
        tolerance=tolerance,
        fit=request.fit,
        method=request.method,
        T_flange_tool=cell.robot.T_flange_tool,
        mesh=_mesh(request),
        arm=settings_of(cell),
    )


def _mesh(request: RegisterRequest) -> TriangleMesh | None:
    from robotrue.core.surfaces import read_mesh

    if request.mesh_unit not in UNITS:
        raise ConfigurationError(
            f"--mesh-unit {request.mesh_unit!r}, expected {', '.join(UNITS)}.",
            hint="--mesh-unit mm",
        )
    return None if request.mesh is None else read_mesh(request.mesh, unit=UNITS[request.mesh_unit])


OPERATION: Final = Operation(request=RegisterRequest, run=run)
