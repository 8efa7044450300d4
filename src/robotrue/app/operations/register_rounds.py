"""Adjust the part's frame at the machine: run, touch, correct, repeat until nothing is left."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block
from robotrue.app.request import InputFile, Option, Request
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
from robotrue.validation.validation_defaults import FRAME_NUMBER, REGISTRATION_METHOD, TOUCH_MM

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.cell.registration.rounds import RoundsResult
    from robotrue.program.controller_frames import ControllerFrame
    from robotrue.validation.registered_part import RegisteredPart
    from robotrue.validation.registration_frame import RegistrationSettings


class RegisterRoundsRequest(Request):
    """Which rounds were touched, and the frame of the first."""

    cell: CellOrModel
    rounds: Annotated[
        tuple[Path, ...],
        InputFile(
            argument="ROUND...", help="CSV of the touches of each round, the first one first."
        ),
    ]
    output: Annotated[Path, cell_output("Cell with the frame for the next run.")]
    frame: Annotated[
        str | None,
        Option(help="X,Y,Z,A,B,C of the part in the first run; default: what CELL says."),
    ] = None
    method: Annotated[
        Literal["touches", "feng2018"],
        Option(help="touches: all count; feng2018: three points, right angle at the first."),
    ] = REGISTRATION_METHOD
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    tolerance_mm: PartTolerance = None
    frame_format: FrameFormats = ()
    frame_number: FrameNumber = FRAME_NUMBER


@dataclass(frozen=True, slots=True, kw_only=True)
class AdjustedInRounds:
    """A part after rounds of running and touching.

    Attributes:
        found: Its frame, and the model it belongs to.
        rounds: What each round showed.
        frames: The frame in the words of controllers, with the name of the part.
        output: Cell that was written.
        provenance: Of the touches and the model.
    """

    found: RegisteredPart
    rounds: RoundsResult
    frames: tuple[tuple[str, ControllerFrame], ...]
    output: Path
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values; mm, deg."""
        from robotrue.app.registration_view import frames_document, registration_document
        from robotrue.app.rounds_view import rounds_document

        return {
            "cell": str(self.output),
            **registration_document(self.found),
            **rounds_document(self.rounds),
            "frames": frames_document(self.frames),
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the rounds, the frame, what is against it, and the lines for controllers."""
        from robotrue.app.registration_view import registration_blocks
        from robotrue.app.rounds_view import rounds_blocks

        yield from rounds_blocks(self.rounds)
        yield from registration_blocks(self.found, [frame.text for _, frame in self.frames])


def run(request: RegisterRoundsRequest, context: Context) -> AdjustedInRounds:
    """Adjusts, and writes the cell for the next run.

    Raises:
        ConfigurationError: A format of frames, or nothing says where the part stood at first.
        ObservabilityError: Touches that do not fix the part.
        ImplausibleDataError: Rounds that are not of one part.
    """
    import numpy as np

    from robotrue.app.registered import open_model
    from robotrue.app.registered_cell_file import model_file_of, registered_cell, relative_name
    from robotrue.app.registration_view import write_frames
    from robotrue.calibration.nominal import NominalModel
    from robotrue.core.files import write_atomic
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.planning.work_area import rough_frames
    from robotrue.program.controller_frames import controller_frame
    from robotrue.validation.registration_rounds import register_in_rounds

    output, source = context.output(request.output), context.cell_file(request.cell)
    for form in request.frame_format:
        controller_frame(np.eye(4), form, number=request.frame_number)  # refuses before any work
    cell, model = open_model(source)
    files = [read_points(path) for path in request.rounds]
    for path, file in zip(request.rounds, files, strict=True):
        if len(file.parts) > 1:
            raise ConfigurationError(
                f"touches of {len(file.parts)} parts: {', '.join(file.parts)}.",
                source=path,
                hint="one part, or one side, at a time.",
            )
    name = files[0].parts[0]
    found, rounds = register_in_rounds(
        NominalModel(robot=cell.robot) if model is None else model,
        [file.touches for file in files],
        rough_frames(cell, request.frame, (name,))[0],
        name=name,
        settings=_settings(request, cell),
    )
    used = model_file_of(cell, source)
    table = found.table(
        model_file="" if used is None else relative_name(used, output),
        points_file=request.rounds[-1].name,
        points_sha256=files[-1].digest,
    )
    write_atomic(output, registered_cell(cell, source, table, output))
    context.wrote("cell for the next run", output)
    return AdjustedInRounds(
        found=found,
        rounds=rounds,
        frames=write_frames(found.frames, request.frame_format, request.frame_number),
        output=output,
        provenance=found.provenance,
    )


def _settings(request: RegisterRoundsRequest, cell: Cell) -> RegistrationSettings:
    from robotrue.planning.information import settings_of
    from robotrue.validation.registration_frame import RegistrationSettings

    tool, tolerance = (
        None if size is None else size * MM
        for size in (request.tool_sigma_mm, request.tolerance_mm)
    )
    return RegistrationSettings(
        touch=request.touch_sigma_mm * MM,
        tool_sigma=tool,
        tolerance=tolerance,
        method=request.method,
        fit="frame",
        T_flange_tool=cell.robot.T_flange_tool,
        arm=settings_of(cell),
    )


OPERATION: Final = Operation(request=RegisterRoundsRequest, run=run)
