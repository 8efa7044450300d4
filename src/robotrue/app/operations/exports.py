"""Exports of the calibrated robot, and their stated losses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import Operation
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

    form: ClassVar[Literal["urdf", "dh", "controller", "ur"]]

    model: CalibratedModel
    output: Annotated[Path, Output(names=OUTPUT)]
    """File to write."""
    lossy: str = ""
    """Parts that the export may omit: geometry, gear, compliance, ripple, backlash, residual."""
    at: Literal["target", "tool"] = AT_TARGET
    """target (the measured point) or tool (of programs)."""


def export_arm(request: ExportRequest, context: Context) -> PlainResult:
    """Writes the files of an export in the form that its request asks for.

    Raises:
        ConfigurationError: A part is lost that is not named, or a file would be written that is
            read.
    """
    from robotrue.report.export_losses import prepare_export

    stored = context.model(request.model)
    tool = None if request.at == "target" else stored.cell.robot.T_flange_tool
    found = prepare_export(stored.model, stored.cell.payload, T_flange_tool=tool)
    files, loss = _files(request, found, context.output(request.output))
    for path in files:
        check_output(path, [context.model_file(request.model)])
    for path, text in files.items():
        write_atomic(path, text.encode("utf-8"))
    context.inform(f"written: {', '.join(str(path) for path in files)}")
    context.inform(f"misses the model by {loss.sizes}, over poses spread over its training range")
    values = {
        "written": [str(path) for path in files],
        "holds": list(found.held),
        "misses_rms_mm": loss.rms / MM,
        "misses_largest_mm": loss.largest / MM,
    }
    return PlainResult(values=values, provenance=found.provenance)


def _files(
    request: ExportRequest, found: ExportableModel, output: Path
) -> tuple[dict[Path, str], Loss]:
    """The text of each file, and what all of them miss of the model."""
    from robotrue.report.export_controller import export_controller
    from robotrue.report.export_description import export_dh, export_urdf
    from robotrue.report.export_ur import export_ur

    lossy = tuple(part.strip() for part in request.lossy.split(",") if part.strip())
    if request.form == "urdf":
        both = export_urdf(found, lossy=lossy)
        return {output: both.urdf, output.with_suffix(".compliance.json"): both.side}, both.total
    if request.form == "dh":
        table = export_dh(found, lossy=lossy)
        return {output: table.text}, table.total
    if request.form == "ur":
        file = export_ur(found, lossy=lossy)
        return {output: file.text}, file.total
    sheet = export_controller(found, lossy=lossy)
    text = sheet.json() if output.suffix.lower() == ".json" else sheet.text()
    return {output: text}, sheet.total


class ExportUrdfRequest(ExportRequest):
    """Model to write as a URDF."""

    form = "urdf"
    output: Annotated[
        Path, Output(names=OUTPUT, what="a robot description", suffixes=(".urdf", ".xml"))
    ]
    """File to write."""


EXPORT_URDF: Final = Operation(
    help="Write a URDF of the calibrated arm, and the parameters outside URDF as JSON beside it.",
    request=ExportUrdfRequest,
    run=export_arm,
)


class ExportDhRequest(ExportRequest):
    """Model to write as a DH table."""

    form = "dh"
    output: Annotated[Path, Output(names=OUTPUT, what="a CSV table", suffixes=(".csv",))]
    """File to write."""


EXPORT_DH: Final = Operation(
    help="Write the calibrated DH table as CSV, with base and tool.",
    request=ExportDhRequest,
    run=export_arm,
)


class ExportControllerRequest(ExportRequest):
    """Model to write as parameters of the controller."""

    form = "controller"
    output: Annotated[
        Path,
        Output(names=OUTPUT, what="a sheet of the controller", suffixes=(".txt", ".json")),
    ]
    """File to write."""


EXPORT_CONTROLLER: Final = Operation(
    help="Write joint zeros, tool and base fitted to the model: .json, or text for any other name.",
    request=ExportControllerRequest,
    run=export_arm,
)


class ExportUrRequest(ExportRequest):
    """Model of a Universal Robots arm to write as the kinematics of its ROS driver."""

    form = "ur"
    output: Annotated[Path, Output(names=OUTPUT, what="YAML", suffixes=(".yaml", ".yml"))]
    """File to write."""


EXPORT_UR: Final = Operation(
    help="Write the kinematics file (YAML) of the ROS driver of a Universal Robots arm.",
    request=ExportUrRequest,
    run=export_arm,
)
