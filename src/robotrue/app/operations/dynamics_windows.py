"""Cut the records of a milling pass into the windows that `dynamics fit` learns from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult, count
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import (
    BETWEEN,
    DIRECTION,
    Between,
    Direction,
    StaticTest,
    table_output,
)
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import MM, UM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.dynamics_inputs import ReadForce
    from robotrue.core.arrays import Array
    from robotrue.dynamics.dry_run import DryRun
    from robotrue.dynamics.pass_windows import PassRecords
    from robotrue.dynamics.windows import WindowSet
    from robotrue.robot.model import RobotModel


class DynamicsWindowsRequest(Request):
    """Records, mounting of the sensors, and the length of the windows."""

    force: Annotated[Path, InputFile(argument="FORCE")]
    """Force of the pass: CSV (t_s,fx_N,fy_N,fz_N), TDMS, MAT, UFF."""
    cell: Annotated[Path, InputFile()]
    """cell.toml with arm and tool."""
    joints: Annotated[Path, InputFile()]
    """Joints of the pass, t_s and j1_deg.. (model) or a1_deg.. (displayed)."""
    frf: Annotated[Path, InputFile()]
    """Frequency response for the prediction, axes of base."""
    spindle_rpm: float
    """Speed of the spindle."""
    output: Annotated[Path, table_output()]
    """CSV of the windows to write."""
    laser: Annotated[Path | None, InputFile()] = None
    """Displacement along --direction: t_s and d_um or d_mm."""
    dry_laser: Annotated[Path | None, InputFile()] = None
    """The same for the dry run."""
    dry_joints: Annotated[Path | None, InputFile()] = None
    """Joints of the dry run."""
    onto: Annotated[Path | None, InputFile()] = None
    """Windows of earlier passes, to prepend."""
    name: str = "1"
    """Name of the pass."""
    carried_by: Literal["base", "tool", "spindle"] = "base"
    """Mounting of the dynamometer: base, tool, or spindle (rotating)."""
    sensor_axes: str = "x,y,z"
    """Directions of its x, y, z in the frame of its mounting, such as -y,x,z."""
    spindle_angle: Annotated[Path | None, InputFile()] = None
    """For a rotating dynamometer: t_s,angle_deg about the tool's z."""
    on_part: bool = False
    """The dynamometer measures the force on the part, not on the tool."""
    keep_zero: bool = False
    """Do not subtract its zero before and after the cut."""
    window_s: float | None = None
    """Length of a window, rounded to whole turns; default 1."""
    edges: Annotated[Path | None, InputFile()] = None
    """Windows as start_s,end_s instead, in times of the force."""
    joints_shift_s: float = 0.0
    """Added to times of the joints, for those of the force."""
    laser_shift_s: float = 0.0
    """Added to times of the laser, for those of the force."""
    static_um_per_n: StaticTest = None
    between: Between = BETWEEN
    direction: Direction = DIRECTION


@operation()
def run(request: DynamicsWindowsRequest, context: Context) -> PlainResult:
    """Cuts the windows, writes them, and reports the stages of the pass."""
    from robotrue.app.dynamics_inputs import parse_static
    from robotrue.dynamics.formats.dynamics_csv import read_windows, write_windows
    from robotrue.dynamics.formats.frf_table import read_frf
    from robotrue.dynamics.frf import with_static
    from robotrue.dynamics.interpolation import fit_curve
    from robotrue.dynamics.pass_windows import cut_windows
    from robotrue.dynamics.windows import FEWEST, check_units, concatenate_windows

    frf = with_static(read_frf(request.frf), parse_static(request.static_um_per_n))
    records, read = _read_records(request, frf.provenance)
    edges = _edges(request, read, records)
    for remark in read.remarks:
        context.note(remark)
    windows = cut_windows(records, edges, fit_curve(frf, request.between))
    check_units(windows)
    whole = windows
    if request.onto is not None:
        earlier = read_windows(request.onto)
        if request.name in earlier.pass_names:
            raise ConfigurationError(
                f"a pass {request.name!r} is in {request.onto} already.", hint="--name NEW"
            )
        whole = concatenate_windows([earlier, windows])
    if len(whole) < FEWEST:
        context.note(f"{count(len(whole), 'window')}: `dynamics fit` needs {FEWEST} or more")
    output = context.output(request.output)
    write_windows(output, whole)
    result = (records, read, windows, len(whole), output)
    return PlainResult(
        values=_document(*result),
        shown=(_facts(*result),),
        provenance=merge([whole.provenance]),
    )


def _read_records(
    request: DynamicsWindowsRequest, response: Provenance
) -> tuple[PassRecords, ReadForce]:
    """All records of the pass on one clock, force in base axes."""
    from robotrue.app.dynamics_inputs import (
        parse_direction,
        read_laser,
        read_pass_force,
        read_pass_joints,
    )
    from robotrue.cell.config import read_cell
    from robotrue.dynamics.dynamometer import CarriedBy, Dynamometer, parse_axes
    from robotrue.dynamics.pass_windows import PassRecords, check_clocks

    if not request.spindle_rpm > 0.0:
        raise ConfigurationError(f"--spindle-rpm {request.spindle_rpm:g}, expected above zero.")
    robot, spindle = read_cell(request.cell).robot, request.spindle_rpm / 60.0
    sensor = Dynamometer(
        axes=parse_axes(request.sensor_axes),
        carried=CarriedBy(request.carried_by),
        reaction=request.on_part,
    )
    joints, origin = read_pass_joints(request.joints, robot, request.joints_shift_s)
    read = read_pass_force(
        request.force, sensor, joints, spindle,
        angle_file=request.spindle_angle, keep_zero=request.keep_zero,
    )  # fmt: skip
    origins, laser = [origin, read.force.provenance, response], None
    if request.laser is not None:
        laser, own = read_laser(request.laser, request.laser_shift_s)
        origins.append(own)
    dry = _read_dry(request, robot, origins)
    records = PassRecords(
        name=request.name,
        force=read.force,
        joints=joints,
        laser=laser,
        dry=dry,
        spindle=spindle,
        direction=parse_direction(request.direction),
        zero_taken=not request.keep_zero,
        provenance=merge(origins),
    )
    check_clocks(records)
    return records, read


def _read_dry(
    request: DynamicsWindowsRequest, robot: RobotModel, origins: list[Provenance]
) -> DryRun | None:
    """The dry run, if it is stated; its origin is added."""
    from robotrue.app.dynamics_inputs import read_dry_run

    stated = (request.dry_laser is not None, request.dry_joints is not None)
    if any(stated) and (not all(stated) or request.laser is None):
        raise ConfigurationError(
            "a dry run is a laser record and its joints, beside the laser of the cut.",
            hint="--laser, --dry-laser and --dry-joints together.",
        )
    if request.dry_laser is None or request.dry_joints is None:
        return None
    dry, own = read_dry_run(request.dry_laser, request.dry_joints, robot)
    origins.append(own)
    return dry


def _edges(request: DynamicsWindowsRequest, read: ReadForce, records: PassRecords) -> Array:
    """Start and end of the windows (k, 2) s."""
    from robotrue.dynamics.formats.dynamics_csv import read_edges
    from robotrue.dynamics.pass_windows import WINDOW, even_windows

    if request.edges is None:
        length = WINDOW if request.window_s is None else request.window_s
        return even_windows(read.stages, records, length)
    if request.window_s is not None:
        raise ConfigurationError("--edges and --window-s both set the windows.")
    return read_edges(request.edges)


def _stages(read: ReadForce) -> dict[str, tuple[float, float]]:
    """Begin and end of each stage of the pass, s."""
    stages = read.stages
    return {
        "entry": (stages.entry, stages.steady),
        "steady": (stages.steady, stages.leaving),
        "exit": (stages.leaving, stages.end),
    }


def _mean_measured(windows: WindowSet) -> float | None:
    """Mean measured error, um; None where no window was measured."""
    import numpy as np

    measured = windows.measured[np.isfinite(windows.measured)]
    return float(measured.mean()) / UM if len(measured) else None


def _path_lengths(records: PassRecords, read: ReadForce) -> dict[str, float]:
    """Returns the path length of the tool in each stage, mm."""
    from robotrue.dynamics.pass_windows import path_between

    return {name: path_between(records.joints, *part) / MM for name, part in _stages(read).items()}


def _document(
    records: PassRecords, read: ReadForce, windows: WindowSet, rows: int, output: Path
) -> dict[str, object]:
    return {
        "output_csv": str(output),
        "pass": records.name,
        "windows": len(windows),
        "rows": rows,
        "stages_s": {name: list(part) for name, part in _stages(read).items()},
        "path_mm": _path_lengths(records, read),
        "level_N": read.stages.level,
        "air_N": read.stages.air,
        "zero_before_N": read.zeros[0].tolist(),
        "zero_behind_N": read.zeros[1].tolist(),
        "predicted_um": float(windows.predicted.mean()) / UM,
        "measured_um": _mean_measured(windows),
        "dry_run": records.dry is not None,
    }


def _facts(
    records: PassRecords, read: ReadForce, windows: WindowSet, rows: int, output: Path
) -> Facts:
    paths, stages, error = _path_lengths(records, read), read.stages, _mean_measured(windows)
    before, behind = (", ".join(f"{v:.2f}" for v in zero) for zero in read.zeros)
    measured = "not measured" if error is None else f"{error:.2f} um"
    less = "" if records.dry is None else ", less the dry run"
    return Facts(
        title=f"pass {records.name}: {count(len(windows), 'window')}",
        rows=(
            *(
                (name, f"{a:.3f} to {b:.3f} s, {paths[name]:.2f} mm")
                for name, (a, b) in _stages(read).items()
            ),
            ("force rms", f"{stages.level:.1f} N in the cut, {stages.air:.2f} N in the air"),
            ("zero subtracted, N", f"{before} before; {behind} behind"),
            ("predicted error, mean", f"{float(windows.predicted.mean()) / UM:.2f} um"),
            ("measured error, mean", measured + less),
            ("written", f"{output}, {count(rows, 'window')}"),
        ),
    )
