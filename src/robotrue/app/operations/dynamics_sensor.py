"""Identify the load on a flange force sensor: mass, centre of mass, offsets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import model_output
from robotrue.core.provenance import read_provenance
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.dynamics.flange_sensor import HeldTool


class DynamicsSensorRequest(Request):
    """Readings of the force sensor at rest, in several poses."""

    poses: Annotated[Path, InputFile(argument="POSES")]
    """Readings at rest, one row per pose of the wrist (CSV)."""
    output: Annotated[Path | None, model_output()] = None
    """File of mass, centre and offsets to write."""


@operation()
def run(request: DynamicsSensorRequest, context: Context) -> PlainResult:
    """Identifies the load on the sensor, and writes it."""
    from robotrue.core.archive import write_archive
    from robotrue.dynamics.flange_sensor import held_tool_remarks, identify_held_tool
    from robotrue.dynamics.formats.dynamics_csv import read_sensor_csv

    R_base_sensor, readings = read_sensor_csv(request.poses)
    origin = read_provenance(request.poses)
    tool = replace(identify_held_tool(R_base_sensor, readings), provenance=origin)
    remarks = tuple(held_tool_remarks(tool))
    for remark in remarks:
        context.note(remark)
    if request.output is not None:
        output = context.output(request.output)
        write_archive(output, tool.to_archive(source=str(request.poses)))
        context.inform(f"written to {output}")
    values = {**_document(tool, len(readings)), "notes": list(remarks)}
    return PlainResult(values=values, shown=(_facts(tool, len(readings)),), provenance=origin)


def _document(tool: HeldTool, poses: int) -> dict[str, object]:
    return {
        "poses": poses,
        "condition": tool.condition,
        "mass_kg": tool.mass,
        "mass_sd_kg": tool.mass_sd,
        "centre_mm": tool.centre / MM,
        "centre_sd_mm": tool.centre_sd / MM,
        "force_offset_N": tool.force_offset,
        "force_offset_sd_N": tool.force_offset_sd,
        "moment_offset_Nm": tool.moment_offset,
        "weight_in_base_N": tool.weight_in_base,
        "force_noise_N": tool.force_noise,
        "moment_noise_Nm": tool.moment_noise,
    }


def _facts(tool: HeldTool, poses: int) -> Facts:
    force, force_sd = _three(tool.force_offset), _three(tool.force_offset_sd)
    return Facts(
        title=f"what hangs on the sensor, from {poses} poses",
        rows=(
            ("mass", f"{tool.mass:.3f} +- {tool.mass_sd:.3f} kg"),
            ("centre", f"{_three(tool.centre / MM)} +- {_three(tool.centre_sd / MM)} mm"),
            ("force offset", f"{force} +- {force_sd} N"),
            ("moment offset", f"{_three(tool.moment_offset, 3)} N m"),
            ("noise", f"{tool.force_noise:.2g} N, {tool.moment_noise:.2g} N m"),
            ("condition of the poses", f"{tool.condition:.2f}"),
        ),
    )


def _three(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{v:.{digits}f}" for v in values)
