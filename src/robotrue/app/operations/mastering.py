"""Find the axis that lost its zero from touches of one fixed point; no tracker is needed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.mastering_view import mastering_blocks, mastering_document
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import CellOrModel, ToolSigma, TouchSigma
from robotrue.core.units import MM
from robotrue.validation.validation_defaults import POINT_SIGMA_MM, TOUCH_MM


class MasteringRequest(Request):
    """Which touches, and what is known of point and tool."""

    cell: CellOrModel
    touches: Annotated[
        Path,
        InputFile(argument="TOUCHES", help="CSV of the touches of one fixed point, in joints."),
    ]
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    point_mm: Annotated[
        str | None,
        Option(
            help="X,Y,Z in base: the point as the arm touched it while it was good; only with it "
            "axis 1 shows."
        ),
    ] = None
    point_sigma_mm: Annotated[
        float, Option(help="One standard deviation per axis of that point.")
    ] = POINT_SIGMA_MM


def run(request: MasteringRequest, context: Context) -> PlainResult:
    """Judges the zeros of the axes.

    Raises:
        ConfigurationError: Touches without joints, or of several places; a point that is none.
        ObservabilityError: Too few touches, or too much alike.
        ImplausibleDataError: Touches that no one or two lost zeros explain.
        ModelMismatchError: Joints of another robot.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.app.registered import open_model
    from robotrue.app.touching_tool import settings_for_touches
    from robotrue.calibration.nominal import NominalModel
    from robotrue.core.provenance import merge
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.validation.mastering import check_mastering

    point = None
    if request.point_mm is not None:
        point = MM * parse_numbers("--point-mm", request.point_mm, 3, form="X,Y,Z")
    cell, model = open_model(context.cell_file(request.cell))
    arm = NominalModel(robot=cell.robot.nominal()) if model is None else model
    touches = read_points(request.touches).touches
    settings = settings_for_touches(cell, arm, request.touch_sigma_mm, request.tool_sigma_mm)
    found = check_mastering(
        arm, touches, settings, point=point, point_sigma=request.point_sigma_mm * MM
    )
    return PlainResult(
        values=mastering_document(found, cell.robot),
        shown=mastering_blocks(found, cell.robot, calibrated=model is not None),
        provenance=merge([touches.provenance]),
    )


OPERATION: Final = Operation(request=MasteringRequest, run=run)
