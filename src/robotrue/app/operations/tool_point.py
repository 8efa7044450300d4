"""Find the tool point from touches of a calibrated table, or of one fixed point."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Block, Facts, Note, Table, Text
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import (
    CellOrModel,
    ToolFormats,
    ToolNumber,
    ToolSigma,
    TouchSigma,
    cell_output,
)
from robotrue.core.units import MM
from robotrue.validation.validation_defaults import TOOL_NUMBER, TOUCH_MM

if TYPE_CHECKING:
    from robotrue.validation.tool_calibration import CalibratedTool


class ToolPointRequest(Request):
    """Which touches to find the tool point from."""

    cell: CellOrModel
    touches: Annotated[
        Path, InputFile(argument="TOUCHES", help="CSV of the touches with the tool, in joints.")
    ]
    table: Annotated[
        Path | None,
        InputFile(
            help="CSV of the probe's touches of the table, in joints; [tool] of CELL is the probe. "
            "None: all touches are of one fixed point."
        ),
    ] = None
    output: Annotated[
        Path | None, cell_output("Also write the cell with the tool in place of the probe.")
    ] = None
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    tolerance_mm: Annotated[
        float | None, Option(help="What the tool point must be known to, for the verdict.")
    ] = None
    tool_format: ToolFormats = ()
    tool_number: ToolNumber = TOOL_NUMBER


def run(request: ToolPointRequest, context: Context) -> PlainResult:
    """Finds the tool point; the attitude of [tool] stays as it is.

    Raises:
        ConfigurationError: A format of tools, or touches without joints or table.
        ObservabilityError: Too few touches or orientations.
        ImplausibleDataError: A touch that cannot be of this table.
    """
    import numpy as np

    from robotrue.app.registered import open_model
    from robotrue.app.tool_view import require_tool_formats, tool_texts, write_tool
    from robotrue.calibration.nominal import NominalModel
    from robotrue.core.poses import pose
    from robotrue.core.provenance import merge
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.planning.information import settings_of
    from robotrue.validation.registration_frame import RegistrationSettings
    from robotrue.validation.tool_calibration import calibrate_tool

    require_tool_formats(request.tool_format, request.tool_number)
    source = context.cell_file(request.cell)
    cell, model = open_model(source)
    touches = read_points(request.touches).touches
    table = None if request.table is None else read_points(request.table).touches
    tool_sigma = None if request.tool_sigma_mm is None else request.tool_sigma_mm * MM
    found = calibrate_tool(
        NominalModel(robot=cell.robot) if model is None else model,
        touches,
        table=table,
        settings=RegistrationSettings(
            touch=request.touch_sigma_mm * MM,
            tool_sigma=tool_sigma,
            T_flange_tool=cell.robot.T_flange_tool,
            arm=settings_of(cell),
        ),
    )
    T = pose(cell.robot.T_flange_tool[:3, :3], found.p_flange_tool)
    texts = tool_texts(T, request.tool_format, request.tool_number)
    if request.output is not None:
        output = context.output(request.output)
        write_tool(cell, source, T, output)
        context.wrote("cell with the tool", output)
    known = found.region <= (request.tolerance_mm or np.inf) * MM
    verdict = "" if request.tolerance_mm is None else "holds" if known else "is not known to it"
    return PlainResult(
        values=_document(found, texts, verdict),
        shown=_blocks(found, texts, verdict, request.tolerance_mm),
        provenance=merge([each.provenance for each in (touches, table) if each is not None]),
    )


def _document(
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


def _blocks(
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


OPERATION: Final = Operation(request=ToolPointRequest, run=run)
