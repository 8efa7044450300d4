"""Tool point and tool axis by touches, and the cell and controller lines that have them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, Note, PlainResult, Table, Text
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import (
    CellOrModel,
    ToolFormats,
    ToolNumber,
    ToolSigma,
    TouchSigma,
    cell_output,
)
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import SQUARE_DEG, TOOL_NUMBER, TOUCH_MM

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.core.arrays import Array
    from robotrue.validation.tool_calibration import CalibratedAxis, CalibratedTool


class ToolPointRequest(Request):
    """Touches for the tool point, and their uncertainty."""

    cell: CellOrModel
    touches: Annotated[Path, InputFile(argument="TOUCHES")]
    """CSV of the touches with the tool, in joints."""
    table: Annotated[Path | None, InputFile()] = None
    """CSV of the probe's touches of the table, in joints; [tool] of CELL is the probe. Default:
    all touches are of one fixed point."""
    output: Annotated[Path | None, cell_output()] = None
    """Also write the cell with the tool in place of the probe."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    tolerance_mm: float | None = None
    """Tolerance on the uncertainty of the tool point, for the verdict."""
    tool_format: ToolFormats = ()
    tool_number: ToolNumber = TOOL_NUMBER


@operation("tool_point")
def find_point(request: ToolPointRequest, context: Context) -> PlainResult:
    """Find the tool point from touches of a calibrated table, or of one fixed point.

    Raises:
        ConfigurationError: A format of tools, or touches without joints or table.
        ObservabilityError: Too few touches or orientations.
        ImplausibleDataError: A touch that cannot be of this table.
    """
    import numpy as np

    from robotrue.app.registered import cell_with_tool, open_arm
    from robotrue.app.touch_settings import registration_settings
    from robotrue.core.poses import pose
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.robot.configuration import axis_relation
    from robotrue.validation.tool_calibration import calibrate_tool

    _require_tool_formats(request.tool_format, request.tool_number)
    source = context.cell_file(request.cell)
    cell, arm = open_arm(source)
    read = partial(read_points, relation=axis_relation(cell.robot))
    touches = read(request.touches).touches
    table = None if request.table is None else read(request.table).touches
    found = calibrate_tool(
        arm,
        touches,
        table=table,
        settings=registration_settings(
            cell, request.touch_sigma_mm, tool_sigma_mm=request.tool_sigma_mm
        ),
    )
    T = pose(cell.robot.T_flange_tool[:3, :3], found.p_flange_tool)
    texts = _tool_texts(T, request.tool_format, request.tool_number)
    if request.output is not None:
        data = cell_with_tool(cell, source, T, request.output)
        context.write(request.output, data, "cell with the tool")
    known = found.region <= (request.tolerance_mm or np.inf) * MM
    verdict = "" if request.tolerance_mm is None else "holds" if known else "is not known to it"
    return PlainResult(
        values=_point_document(found, texts, verdict),
        shown=_point_blocks(found, texts, verdict, request.tolerance_mm),
        provenance=merge([each.provenance for each in (touches, table) if each is not None]),
    )


def _point_document(
    found: CalibratedTool, texts: tuple[tuple[str, str], ...], verdict: str
) -> dict[str, object]:
    return {
        "xyz_mm": (found.p_flange_tool / MM).tolist(),
        "covariance_mm2": (found.covariance / MM**2).tolist(),
        "region_95_mm": found.region / MM,
        "residual_mm": {
            name: float((row @ row) ** 0.5) / MM
            for name, row in zip(found.names, found.residuals, strict=True)
        },
        "rms_mm": found.rms / MM,
        "from": "fixed point" if found.table is None else "table",
        "verdict": verdict or None,
        "doubts": list(found.doubts),
        "tools": [{"system": system, "text": text} for system, text in texts],
    }


def _point_blocks(
    found: CalibratedTool,
    texts: tuple[tuple[str, str], ...],
    verdict: str,
    tolerance_mm: float | None,
) -> tuple[Block, ...]:
    import numpy as np

    x, y, z = found.p_flange_tool / MM
    sx, sy, sz = np.sqrt(np.diag(found.covariance)) / MM
    facts = [
        ("x, y, z", f"{x:.4f}, {y:.4f}, {z:.4f} mm in the flange"),
        ("one sigma", f"{sx:.4f}, {sy:.4f}, {sz:.4f} mm"),
        ("known, 95 %", f"within {found.region / MM:.3f} mm"),
        ("residual rms", f"{found.rms / MM:.4f} mm"),
    ]
    if verdict:
        facts.append((f"tolerance {tolerance_mm:g} mm", verdict))
    way = "about a fixed point" if found.table is None else "from the table"
    return (
        Facts(title=f"tool point, {way}", rows=tuple(facts)),
        Table(
            title="touches",
            columns=("", "residual mm"),
            rows=tuple(
                (name, f"{np.linalg.norm(row) / MM:.4f}")
                for name, row in zip(found.names, found.residuals, strict=True)
            ),
        ),
        *(Note(f"note: {doubt}") for doubt in found.doubts),
        *(Text(f"{text}\n") for _, text in texts),
    )


class ToolAxisRequest(Request):
    """Touches for the tool axis, and their uncertainty."""

    cell: CellOrModel
    touches: Annotated[tuple[Path, ...], InputFile(argument="TOUCHES...")]
    """Short gauge and long gauge about a fixed point, or one file of squarings."""
    table: Annotated[Path | None, InputFile()] = None
    """CSV of the probe's touches of the table, in joints; [tool] of CELL is the probe. The
    gauges then touch points of the table. Default: each touches a fixed point."""
    normal: str | None = None
    """x,y,z in base: normal of the plane of the squarings."""
    x_along: str = "1,0,0"
    """x,y,z in the flange: direction for x of the tool frame."""
    output: Annotated[Path | None, cell_output()] = None
    """Also write the cell with z of [tool] along the axis."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    square_sigma_deg: float = SQUARE_DEG
    """Standard deviation of one squaring per axis."""
    tool_format: ToolFormats = ()
    tool_number: ToolNumber = TOOL_NUMBER


@operation("tool_axis")
def find_axis(request: ToolAxisRequest, context: Context) -> PlainResult:
    """Find the tool axis from two gauges about a fixed point or on a table, or from squarings.

    Raises:
        ConfigurationError: Neither two gauges nor a plane, or a format of tools.
        ObservabilityError: Gauges too alike, or too few orientations.
        ImplausibleDataError: A touch or squaring that is not of the others' kind.
    """
    import numpy as np

    from robotrue.app.registered import cell_with_tool, open_arm
    from robotrue.cell.registration.tool import tool_frame
    from robotrue.core.arrays import parse_number_list

    _require_tool_formats(request.tool_format, request.tool_number)
    source = context.cell_file(request.cell)
    cell, arm = open_arm(source)
    found, origin = _fit_axis(request, cell, arm)
    T = tool_frame(
        cell.robot.T_flange_tool[:3, 3], found.axis_in_flange, parse_number_list(request.x_along)
    )
    texts = _tool_texts(T, request.tool_format, request.tool_number)
    if request.output is not None:
        data = cell_with_tool(cell, source, T, request.output)
        context.write(request.output, data, "cell with the tool")
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


def _fit_axis(
    request: ToolAxisRequest, cell: Cell, arm: ErrorModel
) -> tuple[CalibratedAxis, Provenance]:
    from robotrue.app.touch_settings import registration_settings
    from robotrue.core.arrays import parse_number_list
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.robot.configuration import axis_relation
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
    read = partial(read_points, relation=axis_relation(cell.robot))
    files = [read(path).touches for path in request.touches]
    table = None if request.table is None else read(request.table).touches
    settings = registration_settings(cell, request.touch_sigma_mm)
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


def _tool_texts(
    T_flange_tool: Array, formats: Sequence[str], number: int
) -> tuple[tuple[str, str], ...]:
    """The controller's name and its lines for each requested format."""
    from robotrue.program.controller_frames import controller_tool

    found = [controller_tool(T_flange_tool, form, number=number) for form in formats]
    return tuple((each.system, each.text) for each in found)


def _require_tool_formats(formats: Sequence[str], number: int) -> None:
    """Rejects a format of tools before any work.

    Raises:
        ConfigurationError: No controller is called so, or its table has no such number.
    """
    import numpy as np

    _tool_texts(np.eye(4), formats, number)
