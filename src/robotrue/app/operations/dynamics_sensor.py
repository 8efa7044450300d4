"""Find what hangs on a force sensor at the flange: mass, centre of mass, offsets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block, Facts
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import model_output
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.dynamics.flange_sensor import HeldTool


class DynamicsSensorRequest(Request):
    """Which readings say what hangs on a sensor."""

    poses: Annotated[
        Path,
        InputFile(argument="POSES", help="Readings at rest, one row per pose of the wrist (CSV)."),
    ]
    output: Annotated[Path | None, model_output("Mass, centre and offsets to write.")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldToolFound:
    """What hangs on a sensor.

    Attributes:
        tool: Its mass and centre, and the offsets of the sensor.
        poses: Rows.
        remarks: What deserves attention.
        provenance: Of the readings.
    """

    tool: HeldTool
    poses: int
    remarks: tuple[str, ...]
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values in kg, mm, N and N m."""
        tool = self.tool
        return {
            "poses": self.poses,
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
            "notes": list(self.remarks),
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the same with deviations."""
        tool = self.tool
        force, force_sd = _three(tool.force_offset), _three(tool.force_offset_sd)
        yield Facts(
            title=f"what hangs on the sensor, from {self.poses} poses",
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


def run(request: DynamicsSensorRequest, context: Context) -> HeldToolFound:
    """Identifies what hangs there, and writes it."""
    from robotrue.core.archive import write_archive
    from robotrue.core.provenance import read_provenance
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
    return HeldToolFound(tool=tool, poses=len(readings), remarks=remarks, provenance=origin)


OPERATION: Final = Operation(request=DynamicsSensorRequest, run=run)
