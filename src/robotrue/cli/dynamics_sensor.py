"""``robotrue dynamics sensor``: readings at rest in, what hangs on the force sensor out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_facts, emit_json, say, say_mark
from robotrue.core.archive import write_archive
from robotrue.core.arrays import Array
from robotrue.core.provenance import read_provenance
from robotrue.core.units import MM
from robotrue.dynamics.flange_sensor import held_tool_remarks, identify_held_tool
from robotrue.dynamics.formats.sensor_csv import read_sensor_csv


def run(poses: Path, output: Path | None, *, as_json: bool) -> None:
    """Identifies, says, writes."""
    if output is not None:
        check_output(output, [poses])
    R_base_sensor, readings = read_sensor_csv(poses)
    origin = read_provenance(poses)
    tool = replace(identify_held_tool(R_base_sensor, readings), provenance=origin)
    say_mark(origin)
    remarks = held_tool_remarks(tool)
    for remark in remarks:
        say(f"note: {remark}")
    if output is not None:
        write_archive(output, tool.to_archive(source=str(poses)))
        say(f"written to {output}")
    if as_json:
        emit_json(
            {
                "poses": len(readings),
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
                "notes": list(remarks),
            },
            origin,
        )
        return

    def three(values: Array, digits: int = 2) -> str:
        return ", ".join(f"{v:.{digits}f}" for v in values)

    emit_facts(
        f"what hangs on the sensor, from {len(readings)} poses",
        [
            ("mass", f"{tool.mass:.3f} +- {tool.mass_sd:.3f} kg"),
            ("centre", f"{three(tool.centre / MM)} +- {three(tool.centre_sd / MM)} mm"),
            ("force offset", f"{three(tool.force_offset)} +- {three(tool.force_offset_sd)} N"),
            ("moment offset", f"{three(tool.moment_offset, 3)} N m"),
            ("noise", f"{tool.force_noise:.2g} N, {tool.moment_noise:.2g} N m"),
            ("condition of the poses", f"{tool.condition:.2f}"),
        ],
        origin,
    )
