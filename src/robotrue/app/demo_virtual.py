"""The whole job on a virtual cell, with all files for repeating it.

The virtual robot is a simulation. All output of the demo about it is marked so.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from robotrue.app.context import Context
from robotrue.app.demo_page import demo_content, demo_results, demo_tables
from robotrue.calibration.methods import METHODS, fit
from robotrue.calibration.model import ErrorModel, with_summary
from robotrue.cell.cell import Cell, frame_table
from robotrue.cell.config import read_cell
from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM, UM
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.planning.information import settings_of
from robotrue.program.formats import read_program, write_program
from robotrue.program.program import Program
from robotrue.report.demo_result import Chosen, DemoResult, HoleRuns, write_report
from robotrue.simulation.flange_hole import FlangeHole, check_rows, hole_program
from robotrue.simulation.milling import dry_run, mill_hole
from robotrue.simulation.plans import VALIDATION, Region, random_joints
from robotrue.simulation.presets import STIFFNESS, VirtualCell, deng2022, reflector_at_tool
from robotrue.simulation.virtual_tracker import measure
from robotrue.store.model_file import write_model
from robotrue.validation.selection import select
from robotrue.validation.validate import validate

CALIBRATION_POSES: Final = 80
HELD_OUT_POSES: Final = 50
REGION: Final = Region(turn=(20 * DEG, 20 * DEG, 40 * DEG))
CHECK_LEVEL: Final = 15
Share: TypeAlias = Callable[[str, float], None]
"""Called with the next step and the finished share of the job, 0 to 1."""


def tell_share(context: Context, text: str, done: float) -> None:
    """Reports the next step and the finished share of the job, 0 to 1."""
    context.step(text, round(100.0 * done), 100)


def run_virtual_demo(out_dir: Path, context: Context, *, seed: int) -> DemoResult:
    """Returns the demo on the virtual KR160: measured, calibrated, compensated, measured again.

    Writes ``cell.toml``, ``calibration.csv``, ``held_out.csv``, ``flange_hole.src``,
    ``model.robotrue``, ``flange_hole_compensated.src``, ``demo.html`` and ``results.json``.

    Args:
        out_dir: Folder, created if missing; files of the same names are replaced.
        context: Called before each step.
        seed: Of the virtual cell and all its noise.

    Raises:
        FormatError: The folder cannot be written to.
    """
    tell = partial(tell_share, context)
    out_dir.mkdir(parents=True, exist_ok=True)
    tell("measuring the virtual cell", 0.0)
    virtual, hole = reflector_at_tool(deng2022(seed)), FlangeHole()
    write_virtual_cell(virtual, hole, out_dir)
    cell = read_cell(out_dir / "cell.toml")
    training = context.measurements(cell, [out_dir / "calibration.csv"])
    chosen = choose_model(
        cell, training, lambda text, done: tell(f"calibrating: {text}", 0.05 + 0.6 * done)
    )
    write_model(out_dir / "model.robotrue", chosen.model, cell)
    tell("validating on poses not used in the fit", 0.68)
    held_out = context.measurements(cell, [out_dir / "held_out.csv"])
    report = validate(chosen.model, held_out, payload=cell.payload)
    tell("compensating the flange-hole program", 0.72)
    program, driven, compensation = compensate_program(
        chosen.model, cell, out_dir / "flange_hole.src", out_dir / "flange_hole_compensated.src"
    )
    tell("running the program on the virtual cell, before and after", 0.85)
    runs = run_hole(virtual, hole, program, driven)
    tell("writing the page", 0.97)
    tables = demo_tables(report, runs)
    results = demo_results(seed, chosen, report, runs, compensation)
    content = demo_content(
        seed=seed, hole=hole, chosen=chosen, report=report, runs=runs, tables=tables
    )
    page = write_report(out_dir, content, results)
    tell("done", 1.0)
    return DemoResult(folder=out_dir, page=page, results=results, tables=tables, simulated=True)


def write_virtual_cell(virtual: VirtualCell, hole: FlangeHole, folder: Path) -> None:
    """Writes what an engineer at this cell would have: cell file, two campaigns, the program."""
    write_atomic(folder / "cell.toml", cell_toml(virtual.known).encode())
    robot = virtual.known.measured_robot
    campaigns = (
        ("calibration", CALIBRATION_POSES, REGION),
        ("held_out", HELD_OUT_POSES, VALIDATION),
    )
    for number, (name, count, region) in enumerate(campaigns):
        joints = random_joints(robot, count, seed=virtual.seed + 1000 * number, region=region)
        taken = measure(
            virtual.robot,
            virtual.tracker,
            joints,
            seed=virtual.seed,
            campaign=number,
            T_flange_tool=virtual.T_flange_target,
            name=f"simulated {name} seed={virtual.seed}",
        )
        write_canonical(folder / f"{name}.csv", taken)
    write_atomic(folder / "flange_hole.src", hole_program(hole, virtual.known.robot))


def cell_toml(cell: Cell) -> str:
    """Returns the cell file of a virtual KR160 cell."""
    tool, target = cell.robot.T_flange_tool, cell.T_flange_target
    position = np.zeros(3) if cell.tracker_position is None else cell.tracker_position
    spec = cell.tracker
    return "\n".join(
        [
            "# virtual cell: simulated, made by `robotrue demo`; masses are assumed",
            "schema = 1",
            "[robot]",
            'preset = "KUKA KR160 R1570"',
            f"stiffness_Nm_per_rad = {_numbers(STIFFNESS, 1.0)}",
            "[tool]",
            f"xyz_mm = {_numbers(tool[:3, 3], MM)}",
            f"abc_deg = {_numbers(abc_from_matrix(tool[:3, :3]), DEG)}",
            "[payload]",
            f"mass_kg = {cell.payload.mass[0]:.6g}",
            f"centre_of_mass_mm = {_numbers(cell.payload.com[0], MM)}",
            "[target]",
            f"xyz_mm = {_numbers(target[:3, 3], MM)}",
            f"sigma_mm = {cell.target_sigma / MM:.6g}",
            "[tracker]",
            'frame = "base"',
            f"xyz_mm = {_numbers(position, MM)}",
            f"sigma_um = {spec.range_bound / spec.divisor / UM:.6g}",
            f"sigma_um_per_m = {spec.range_bound_per_m / spec.divisor / UM:.6g}",
            "[repeatability]",
            f"mm = {cell.repeatability / MM:.6g}",
            "",
        ]
    )


def choose_model(cell: Cell, training: MeasurementSet, step: Share) -> Chosen:
    """Returns the method that wins on held-out poses, fitted on all rows."""
    robot, settings = cell.measured_robot, settings_of(cell)
    candidates = {name: partial(fit, robot, method=name, settings=settings) for name in METHODS}
    selection = select(
        candidates,
        training,
        payload=cell.payload,
        progress=lambda text, done, total: step(text, done / total),
    )
    model = with_summary(candidates[selection.winner](training), {"selection": selection.summary()})
    return Chosen(model=model, selection=selection)


def compensate_program(
    model: ErrorModel, cell: Cell, source: Path, target: Path
) -> tuple[Program, Program, Compensation]:
    """Returns the program, its compensated copy as read back from the file, and the details."""
    program = read_program(source, frame_table(cell))
    settings = CompensationSettings(load=cell.payload)
    result = compensate(model, program, settings=settings)
    write_atomic(target, write_program(program, result.replacement))
    return program, read_program(target, frame_table(cell)), result


def run_hole(virtual: VirtualCell, hole: FlangeHole, program: Program, driven: Program) -> HoleRuns:
    """Returns dry run and hole of the program as it was and as compensated."""
    rows = check_rows(program, hole, CHECK_LEVEL)
    return HoleRuns(
        dry_before=dry_run(virtual, program, program, rows, campaign=2),
        dry_after=dry_run(virtual, program, driven, rows, campaign=3),
        hole_before=mill_hole(virtual, hole, program, program, campaign=4),
        hole_after=mill_hole(virtual, hole, program, driven, campaign=5),
    )


def _numbers(values: Array, unit: float) -> str:
    return "[" + ", ".join(f"{v / unit:.9g}" for v in values) + "]"
