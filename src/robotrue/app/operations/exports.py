"""Exports of the calibrated robot, and their stated losses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.outputs import check_output
from robotrue.app.presentation import PlainResult
from robotrue.app.request import Output, Request
from robotrue.app.request_fields import AT_TARGET, OUTPUT, CalibratedModel
from robotrue.core.files import write_atomic
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.report.export_losses import ExportableModel, Loss


class ExportRequest(Request):
    """Model to export, permitted losses, and the point of evaluation."""

    model: CalibratedModel
    output: Annotated[Path, Output(names=OUTPUT)]
    """File to write."""
    lossy: str = ""
    """Parts that the export may omit: geometry, gear, compliance, ripple, backlash, residual."""
    at: Literal["target", "tool"] = AT_TARGET
    """target (the measured point) or tool (of programs)."""

    @property
    def omitted(self) -> tuple[str, ...]:
        """Parts that the export may omit."""
        return tuple(part.strip() for part in self.lossy.split(",") if part.strip())


def _read_arm(request: ExportRequest, context: Context) -> ExportableModel:
    from robotrue.report.export_losses import prepare_export

    stored = context.model(request.model)
    tool = None if request.at == "target" else stored.cell.robot.T_flange_tool
    return prepare_export(stored.model, stored.cell.payload, T_flange_tool=tool)


def _write_files(
    request: ExportRequest,
    context: Context,
    arm: ExportableModel,
    files: Mapping[Path, str],
    loss: Loss,
) -> PlainResult:
    """Writes the text of each file; reports what all of them miss of the model."""
    for path in files:
        check_output(path, [context.model_file(request.model)])
    for path, text in files.items():
        write_atomic(path, text.encode("utf-8"))
    context.inform(f"written: {', '.join(str(path) for path in files)}")
    context.inform(f"misses the model by {loss.sizes}, over poses spread over its training range")
    values = {
        "written": [str(path) for path in files],
        "holds": list(arm.held),
        "misses_rms_mm": loss.rms / MM,
        "misses_largest_mm": loss.largest / MM,
    }
    return PlainResult(values=values, provenance=arm.provenance)


class ExportUrdfRequest(ExportRequest):
    """Model to write as a URDF."""

    output: Annotated[
        Path, Output(names=OUTPUT, what="a robot description", suffixes=(".urdf", ".xml"))
    ]
    """File to write."""


@operation("export_urdf")
def write_urdf(request: ExportUrdfRequest, context: Context) -> PlainResult:
    """Write a URDF of the calibrated arm, and the parameters outside URDF as JSON beside it.

    Raises:
        ConfigurationError: A part is lost that is not named, or a file would be written that is
            read; of the other exports, too.
    """
    from robotrue.report.export_description import export_urdf

    arm, output = _read_arm(request, context), context.output(request.output)
    both = export_urdf(arm, lossy=request.omitted)
    files = {output: both.urdf, output.with_suffix(".compliance.json"): both.side}
    return _write_files(request, context, arm, files, both.total)


class ExportDhRequest(ExportRequest):
    """Model to write as a DH table."""

    output: Annotated[Path, Output(names=OUTPUT, what="a CSV table", suffixes=(".csv",))]
    """File to write."""


@operation("export_dh")
def write_dh(request: ExportDhRequest, context: Context) -> PlainResult:
    """Write the calibrated DH table as CSV, with base and tool."""
    from robotrue.report.export_description import export_dh

    arm, output = _read_arm(request, context), context.output(request.output)
    table = export_dh(arm, lossy=request.omitted)
    return _write_files(request, context, arm, {output: table.text}, table.total)


class ExportControllerRequest(ExportRequest):
    """Model to write as parameters of the controller."""

    output: Annotated[
        Path, Output(names=OUTPUT, what="a sheet of the controller", suffixes=(".txt", ".json"))
    ]
    """File to write."""


@operation("export_controller")
def write_controller(request: ExportControllerRequest, context: Context) -> PlainResult:
    """Write joint zeros, tool and base fitted to the model: .json, or text for any other name."""
    from robotrue.report.export_controller import export_controller

    arm, output = _read_arm(request, context), context.output(request.output)
    sheet = export_controller(arm, lossy=request.omitted)
    text = sheet.json() if output.suffix.lower() == ".json" else sheet.text()
    return _write_files(request, context, arm, {output: text}, sheet.total)


class ExportUrRequest(ExportRequest):
    """Model of a Universal Robots arm to write as the kinematics of its ROS driver."""

    output: Annotated[Path, Output(names=OUTPUT, what="YAML", suffixes=(".yaml", ".yml"))]
    """File to write."""


@operation("export_ur")
def write_ur(request: ExportUrRequest, context: Context) -> PlainResult:
    """Write the kinematics file (YAML) of the ROS driver of a Universal Robots arm."""
    from robotrue.report.export_ur import export_ur

    arm, output = _read_arm(request, context), context.output(request.output)
    file = export_ur(arm, lossy=request.omitted)
    return _write_files(request, context, arm, {output: file.text}, file.total)
