"""Find the tool axis from two gauges about a fixed point or on a table, or from squarings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts, Text
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import (
    CellOrModel,
    ToolFormats,
    ToolNumber,
    TouchSigma,
    cell_output,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import SQUARE_DEG, TOOL_NUMBER, TOUCH_MM

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.core.provenance import Provenance
    from robotrue.validation.tool_calibration import CalibratedAxis


class ToolAxisRequest(Request):
    """Which touches to find the tool axis from."""

    cell: CellOrModel
    touches: Annotated[
        tuple[Path, ...],
        InputFile(
            argument="TOUCHES...",
            help="Short gauge and long gauge about a fixed point, or one file of squarings.",
        ),
    ]
    table: Annotated[
        Path | None,
        InputFile(
            help="CSV of the probe's touches of the table, in joints; [tool] of CELL is the probe. "
            "The gauges then touch points of it. None: each touches a fixed point."
        ),
    ] = None
    normal: Annotated[
        str | None, Option(help="x,y,z in base: normal of the plane that the tool was squared on.")
    ] = None
    x_along: Annotated[
        str, Option(help="x,y,z in the flange: what x of the tool frame is turned towards.")
    ] = "1,0,0"
    output: Annotated[
        Path | None, cell_output("Also write the cell with z of [tool] along the axis.")
    ] = None
    touch_sigma_mm: TouchSigma = TOUCH_MM
    square_sigma_deg: Annotated[
        float, Option(help="One standard deviation per axis of one squaring.")
    ] = SQUARE_DEG
    tool_format: ToolFormats = ()
    tool_number: ToolNumber = TOOL_NUMBER


def run(request: ToolAxisRequest, context: Context) -> PlainResult:
    """Finds the axis; the tool point stays as it is.

    Raises:
        ConfigurationError: Neither two gauges nor a plane, or a format of tools.
        ObservabilityError: Gauges too alike, or too few orientations.
        ImplausibleDataError: A touch or squaring that is not of the others' kind.
    """
    import numpy as np

    from robotrue.app.registered import open_model
    from robotrue.app.tool_view import require_tool_formats, tool_texts, write_tool
    from robotrue.calibration.nominal import NominalModel
    from robotrue.cell.registration.tool import tool_frame
    from robotrue.core.arrays import parse_number_list

    require_tool_formats(request.tool_format, request.tool_number)
    source = context.cell_file(request.cell)
    cell, model = open_model(source)
    arm = NominalModel(robot=cell.robot) if model is None else model
    found, origin = _find(request, cell, arm)
    T = tool_frame(
        cell.robot.T_flange_tool[:3, 3], found.axis_in_flange, parse_number_list(request.x_along)
    )
    texts = tool_texts(T, request.tool_format, request.tool_number)
    if request.output is not None:
        output = context.output(request.output)
        write_tool(cell, source, T, output)
        context.wrote("cell with the tool", output)
    x, y, z = found.axis_in_flange
    tilt = float(np.arccos(np.clip(z, -1.0, 1.0)))
    sd = np.sqrt(np.diag(found.covariance)) / DEG
    facts = [
        ("out of the spindle", f"{x:+.6f}, {y:+.6f}, {z:+.6f} in the flange"),
        ("from the flange's z", f"{tilt / DEG:.4f} deg"),
        ("one sigma", ", ".join(f"{v:.4f}" for v in sd) + " deg"),
        ("known, 95 %", f"within {found.region / DEG:.4f} deg"),
    ]
    if len(found.residuals):
        facts.append(("worst squaring", f"{found.residuals.max() / DEG:.4f} deg from the mean"))
    return PlainResult(
        values={
            "axis_in_flange": found.axis_in_flange.tolist(),
            "covariance_deg2": (found.covariance / DEG**2).tolist(),
            "region_95_deg": found.region / DEG,
            "residual_deg": (found.residuals / DEG).tolist(),
            "tools": [{"system": system, "text": text} for system, text in texts],
        },
        shown=(
            Facts(title="tool axis", rows=tuple(facts)),
            *(Text(f"{text}\n") for _, text in texts),
        ),
        provenance=origin,
    )


def _find(
    request: ToolAxisRequest, cell: Cell, arm: ErrorModel
) -> tuple[CalibratedAxis, Provenance]:
    from robotrue.core.arrays import parse_number_list
    from robotrue.core.provenance import merge
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.planning.information import settings_of
    from robotrue.validation.registration_frame import RegistrationSettings
    from robotrue.validation.tool_calibration import axis_between, axis_on_plane

    if request.normal is not None and request.table is not None:
        raise ConfigurationError(
            "--normal with --table: a tool is squared on a plane, or gauges touch a table.",
            hint="SHORT.csv LONG.csv --table TABLE.csv, or SQUARED.csv --normal 0,0,1",
        )
    needed = 2 if request.normal is None else 1
    if len(request.touches) != needed:
        raise ConfigurationError(
            f"{len(request.touches)} files of touches"
            f"{'' if request.normal is None else ' with --normal'}, expected {needed}.",
            hint="SHORT.csv LONG.csv, or SQUARED.csv --normal 0,0,1",
        )
    files = [read_points(path).touches for path in request.touches]
    table = None if request.table is None else read_points(request.table).touches
    settings = RegistrationSettings(
        touch=request.touch_sigma_mm * MM,
        T_flange_tool=cell.robot.T_flange_tool,
        arm=settings_of(cell),
    )
    known = files if table is None else [*files, table]
    origin = merge([each.provenance for each in known])
    if request.normal is None:
        return axis_between(arm, files[0], files[1], table=table, settings=settings), origin
    normal = parse_number_list(request.normal)
    if normal.size != 3:
        raise ConfigurationError(
            f"--normal {request.normal!r}, expected three numbers.", hint="--normal 0,0,1"
        )
    sigma = request.square_sigma_deg * DEG
    return axis_on_plane(arm, files[0], normal, sigma=sigma, settings=settings), origin


OPERATION: Final = Operation(request=ToolAxisRequest, run=run)
