"""Identify the axis of a spindle from a reflector on it: direction and point in the flange."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult, Text
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import cell_output
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.cell.spindle_axis import SpindleAxis
    from robotrue.core.arrays import Array

REFLECTOR_SIGMA_UM: Final = 15.0
"""Of one coordinate of a reflector, as a laser tracker measures it at a few metres."""


class SpindleAxisRequest(Request):
    """Measured reflector points, and the pose of the robot."""

    points: Annotated[Path, InputFile(argument="POINTS")]
    """x_mm, y_mm, z_mm of one reflector at steps of the turn: in the flange frame, or in base
    with --robot."""
    sigma_um: Annotated[float, Field(gt=0.0)] = REFLECTOR_SIGMA_UM
    """Standard deviation of one coordinate of one point."""
    robot: Annotated[Path | None, InputFile()] = None
    """The points are in base: calibrated model, or cell.toml (nominal arm)."""
    joints_deg: str | None = None
    """With --robot: its joints during the turn, in the model's sense."""
    length_mm: float = 0.0
    """Distance from the circle's plane along the axis to the tool's tip."""
    cell: Annotated[Path | None, InputFile()] = None
    """cell.toml that gets the tool from the axis."""
    output: Annotated[Path | None, cell_output(renews="cell")] = None
    """With --cell: cell.toml to write, with this [tool]."""


@operation()
def run(request: SpindleAxisRequest, context: Context) -> PlainResult:
    """Fits the circle of the reflector and gives the spindle's axis in the flange.

    Raises:
        FormatError: A column that is missing or no number; with file and line.
        ConfigurationError: --robot without --joints-deg, or -o without --cell.
        ObservabilityError: Too few points, or too short an arc.
        ImplausibleDataError: Points that are on no circle.
    """
    from robotrue.cell.spindle_axis import fit_spindle_axis
    from robotrue.measurement.formats.sheet_file import read_sheet

    if (request.cell is None) != (request.output is None):
        raise ConfigurationError("--cell and -o go together.", hint="--cell cell.toml -o cell.toml")
    sheet = read_sheet(request.points)
    T_base_flange, origins = _flange(request)
    T_flange_base = _invert(T_base_flange)
    points = sheet.numbers(("x_mm", "y_mm", "z_mm")) * MM
    points = points @ T_flange_base[:3, :3].T + T_flange_base[:3, 3]
    found = fit_spindle_axis(points, request.sigma_um * UM, source=sheet.source)
    tool = _tool_table(found, request.length_mm * MM)
    if request.cell is not None and request.output is not None:
        from robotrue.cell.toml_edit import with_table

        text = with_table(request.cell.read_text(encoding="utf-8"), "tool", tool)
        context.write(request.output, text, "[tool]")
    return PlainResult(
        values=_document(found, tool),
        shown=(Facts(title="Spindle axis in the flange", rows=_facts(found)), Text(_snippet(tool))),
        provenance=merge([sheet.provenance, *origins]),
    )


def _flange(request: SpindleAxisRequest) -> tuple[Array, list[Provenance]]:
    """Actual T_base_flange (4, 4); the identity where the points are in the flange."""
    import numpy as np

    from robotrue.app.number_options import parse_numbers
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.drilling.robot_adjust import actual_pose
    from robotrue.robot.forward import forward

    if request.robot is None:
        if request.joints_deg is not None:
            raise ConfigurationError("--joints-deg without --robot.", hint="--robot MODEL")
        return np.eye(4), []
    cell, model = open_model(request.robot)
    if request.joints_deg is None:
        raise ConfigurationError(
            "--robot without --joints-deg: state the joints of the robot.",
            source=request.robot,
            hint="--joints-deg J1,J2,J3,J4,J5,J6",
        )
    robot = cell.robot if model is None else model.robot
    stated = request.joints_deg
    joints = parse_numbers("--joints-deg", stated, robot.dof, form="J1,..,J6") * DEG
    T_base_tool: Array = forward(robot.nominal(), joints[None])[0]
    if model is not None:
        T_base_tool, _ = actual_pose(model, joints, cell.payload)
    T_base_flange: Array = T_base_tool @ _invert(robot.T_flange_tool)
    return T_base_flange, [provenance_used(cell, model)]


def _invert(pose: Array) -> Array:
    import numpy as np

    out: Array = np.asarray(np.linalg.inv(pose), dtype=np.float64)
    return out


def _tool_table(found: SpindleAxis, length: float) -> dict[str, object]:
    """``[tool]`` of a cell: z along the axis, x nearest to the flange's x."""
    import numpy as np

    from robotrue.cell.toml_edit import round_digits
    from robotrue.core.rotations import abc_from_matrix

    z = found.direction
    across = np.eye(3) - np.outer(z, z)
    x = across[:, int(np.argmax(np.diag(across)))] if abs(z[0]) > 0.99 else across[:, 0]
    x = x / np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(z, x), z])
    return {
        "xyz_mm": round_digits(np.round((found.centre + length * z) / MM, 6)),
        "abc_deg": round_digits(np.round(abc_from_matrix(rotation) / DEG, 9)),
    }


def _snippet(tool: dict[str, object]) -> str:
    return "[tool]\n" + "".join(f"{name} = {value}\n" for name, value in tool.items())


def _document(found: SpindleAxis, tool: dict[str, object]) -> dict[str, object]:
    import numpy as np

    return {
        "direction": found.direction.tolist(),
        "direction_sigma_deg": found.angle_sigma / DEG,
        "point_mm": (found.centre / MM).tolist(),
        "point_sigma_mm": (np.sqrt(np.diag(found.covariance_centre)) / MM).tolist(),
        "radius_mm": found.radius / MM,
        "arc_deg": found.arc / DEG,
        "scatter_um": found.scatter / UM,
        "points": len(found.residual),
        "tool": tool,
    }


def _facts(found: SpindleAxis) -> tuple[tuple[str, str], ...]:
    import numpy as np

    sigma = np.sqrt(np.diag(found.covariance_centre)) / MM
    point = ", ".join(f"{v:.4f} +- {s:.4f}" for v, s in zip(found.centre / MM, sigma, strict=True))
    direction = ", ".join(f"{v:+.7f}" for v in found.direction)
    return (
        ("direction", f"{direction} +- {found.angle_sigma / DEG:.5f} deg"),
        ("point", f"{point} mm"),
        ("circle", f"radius {found.radius / MM:.4f} mm, {found.arc / DEG:.0f} deg of the turn"),
        ("scatter", f"{found.scatter / UM:.1f} um of one coordinate, {len(found.residual)} points"),
    )
