"""``robotrue plan``: which poses to measure, as a table and as a program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.app.registered import provenance_of_file
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cell.frame_table import frame_table
from robotrue.cli.console import count, emit_json, emit_table, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.poses import pose
from robotrue.core.progress import Progress, unheard
from robotrue.core.provenance import Provenance
from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, ModelMismatchError, ReachError
from robotrue.planning.information import Postures
from robotrue.planning.pose_plan import PlanSettings, PosePlan, plan_poses
from robotrue.planning.sheet import plan_sheet
from robotrue.program.formats import read_job
from robotrue.program.formats.krl_measure import Trigger, measuring_program
from robotrue.program.program import Program, Reason
from robotrue.robot.configuration import controller_axes
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.statics import Load
from robotrue.store.model_file import read_model

CYLINDER: Final = ("angle_deg", "height_mm", "radius_mm")
CUBE: Final = ("x_mm", "y_mm", "z_mm")
EXAMPLE: Final = "angle_deg=-20..20,radius_mm=800..1400,height_mm=700..1200"
MOST_TARGETS: Final = 2000
"""Targets of a program that are looked at, evenly over the file."""
SHOWN: Final = (4, 6, 8, 10, 15, 20, 25, 30, 40, 50, 60, 80, 100)
"""Numbers of poses in the printed table."""
APPROACH: Final = {"one-side": "one side", "as-it-comes": "as it comes"}


def run(
    cell_path: Path,
    output: Path,
    *,
    poses: int,
    criterion: str,
    region: str | None,
    within: str | None,
    program_targets: Path | None,
    model_path: Path | None,
    payloads: Sequence[str],
    approach: str,
    candidates: int,
    tolerance_um: float,
    seed: int,
    program: Path | None,
    trigger_output: int,
    report: Path | None,
    as_json: bool,
) -> None:
    """Chooses the poses and writes them; prints what accuracy to expect of them."""
    inputs = [p for p in (cell_path, program_targets, model_path) if p is not None]
    for target in [p for p in (output, program, report) if p is not None]:
        check_output(target, inputs)
    cell = read_cell(cell_path)
    plan = planned(
        cell,
        poses,
        criterion=criterion,
        region=region,
        within=within,
        program_targets=program_targets,
        model_path=model_path,
        payloads=payloads,
        approach=approach,
        candidates=candidates,
        tolerance_um=tolerance_um,
        seed=seed,
    )
    origin = provenance_of_file(model_path)
    say_mark(origin)
    text = None if program is None else program_text(cell, plan, program, trigger_output)
    write_atomic(output, plan_sheet(plan))
    say(f"{count(len(plan), 'pose')} written to {output}: fill in what the tracker reads")
    if program is not None and text is not None:
        write_atomic(program, text)
        say(f"program written to {program}")
    if report is not None:
        from robotrue.cli.plan_page import plan_page

        write_atomic(report, plan_page(cell, plan, origin).encode())
        say(f"report written to {report}")
    for note in plan.notes:
        say(f"note: {note}")
    if plan.stopped:
        say(f"stopped at {len(plan)}: the next pose would gain less than {tolerance_um:g} um")
    if as_json:
        emit_json({"poses_csv": str(output), **document(plan)}, origin)
    else:
        _show(plan, origin)


def planned(
    cell: Cell,
    poses: int,
    *,
    criterion: str,
    region: str | None,
    within: str | None,
    program_targets: Path | None,
    model_path: Path | None,
    payloads: Sequence[str],
    approach: str,
    candidates: int,
    tolerance_um: float,
    seed: int,
    told: Progress = unheard,
) -> PosePlan:
    """Returns the poses, chosen by what the options of the command say.

    Raises:
        ConfigurationError: An option that cannot be.
        ReachError: Nothing can be measured, or the program is out of reach.
    """
    if approach not in APPROACH:
        raise ConfigurationError(
            f"approach {approach!r}, expected {' or '.join(APPROACH)}.", hint="--approach one-side"
        )
    if region is not None and program_targets is not None:
        raise ConfigurationError(
            "--region and --program-targets both say where the arm will work.",
            hint="leave one of them out.",
        )
    if not tolerance_um >= 0.0:
        raise ConfigurationError(
            f"tolerance {tolerance_um:g} um, expected 0 or more.", hint="--tolerance-um 1"
        )
    settings = PlanSettings(
        criterion="D" if criterion == "D" else _criterion(criterion),
        candidates=candidates,
        within=None if within is None else parse_region("--within", within),
        work=None if region is None else parse_region("--region", region),
        approach="one side" if approach == "one-side" else "as it comes",
        enough=tolerance_um * UM,
        loads=tuple(_payload(text) for text in payloads),
        seed=seed,
    )
    work, tool = None, None
    if program_targets is not None:
        work, tool = _work_of(cell, program_targets), cell.robot.T_flange_tool
    return plan_poses(
        cell,
        poses,
        settings=settings,
        model=None if model_path is None else read_model(model_path).model,
        work=work,
        T_flange_tool=tool,
        progress=told,
    )


def parse_region(option: str, text: str) -> Region:
    """Returns the region of e.g. ``angle_deg=-20..20,radius_mm=800..1400,height_mm=700..1200``.

    Raises:
        ConfigurationError: Other names, or limits that are no numbers.
    """
    limits: dict[str, tuple[float, float]] = {}
    try:
        for part in text.split(","):
            name, _, values = part.strip().partition("=")
            low, high = (float(v) for v in values.split(".."))
            limits[name] = (low, high)
    except ValueError:
        limits = {}
    kind = tuple(sorted(limits))
    if kind not in (CYLINDER, CUBE) or any(not low < high for low, high in limits.values()):
        raise ConfigurationError(
            f"{option} {text!r}, expected three ranges LOW..HIGH of angle_deg, radius_mm, "
            "height_mm or of x_mm, y_mm, z_mm.",
            hint=f"{option} {EXAMPLE}",
        )
    sized = {
        name.rpartition("_")[0]: (low * _size(name), high * _size(name))
        for name, (low, high) in limits.items()
    }
    return CylinderRegion(**sized) if kind == CYLINDER else CubeRegion(**sized)


def _size(name: str) -> float:
    return DEG if name.endswith("deg") else MM


def _criterion(text: str) -> Any:
    if text != "I":
        raise ConfigurationError(f"criterion {text!r}, expected I or D.", hint="--criterion I")
    return "I"


def _payload(text: str) -> Load:
    """A load state from ``KG`` or ``KG,X,Y,Z`` (mm in the flange frame)."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    if numbers.size not in (1, 4) or not np.isfinite(numbers).all() or numbers[0] < 0.0:
        raise ConfigurationError(
            f"payload {text!r}, expected KG or KG,X,Y,Z with the centre of mass in mm.",
            hint="--payload 50,0,0,120",
        )
    centre = np.zeros(3) if numbers.size == 1 else numbers[1:] * MM
    return Load(mass=numbers[:1], com=centre[None])


def _work_of(cell: Cell, path: Path) -> Postures:
    """The postures a program works in: its own targets, with its frames and tools.

    Raises:
        ReachError: The arm reaches none of them.
    """
    found = [_joints_of(cell, program) for program in read_job(path, frame_table(cell))]
    joints = np.concatenate(found)
    if not len(joints):
        raise ReachError(
            "no target of this program gives a posture of the arm.",
            source=path,
            hint="check its work frame and tool.",
        )
    return Postures(joints=joints, load=cell.payload)


def _joints_of(cell: Cell, program: Program) -> Array:
    usable = np.flatnonzero((program.reason == Reason.NONE) & np.isfinite(program.position[:, 0]))
    some = usable[np.unique(np.linspace(0, max(len(usable) - 1, 0), MOST_TARGETS).astype(int))][
        : len(usable)
    ]
    out = [np.empty((0, cell.robot.dof))]
    for tool in np.unique(program.tool[some]):
        mine = some[program.tool[some] == tool]
        targets = program.T_base_frame[program.frame[mine]] @ pose(
            program.rotation[mine], program.position[mine]
        )
        joints = inverse_batch(cell.robot.with_tool(program.T_flange_tool[tool]), targets)
        out.append(joints[np.isfinite(joints).all(axis=1)])
    return np.concatenate(out)


def program_text(cell: Cell, plan: PosePlan, path: Path, trigger_output: int) -> bytes:
    """Returns the KRL program that measures the poses.

    Raises:
        ModelMismatchError: The controller is no KUKA.
    """
    if cell.robot.maker != "kuka":
        raise ModelMismatchError(
            f"{cell.robot.name} is of maker {cell.robot.maker!r}; programs are written in KRL, for "
            "KUKA controllers.",
            hint="take the joints from the CSV.",
        )
    return measuring_program(
        path.stem,
        controller_axes(cell.robot, plan.joints),
        controller_axes(cell.robot, plan.pre),
        Trigger(output=trigger_output),
    )


def document(plan: PosePlan) -> dict[str, Any]:
    """Returns the plan as JSON values: mm, deg; keys as in the reference."""
    expected = plan.expected
    return {
        "poses": len(plan),
        "criterion": plan.criterion,
        "seed": plan.seed,
        "candidates": plan.candidates,
        "drawn": plan.drawn,
        "rejected": dict(plan.rejected),
        "stopped": plan.stopped,
        "expected_mean_mm": expected.mean / MM,
        "expected_rms_mm": expected.rms / MM,
        "random_mean_mm": expected.random_mean / MM,
        "random_low_mm": expected.random_low / MM,
        "random_high_mm": expected.random_high / MM,
        "floor_mean_mm": expected.floor_mean / MM,
        "joints_deg": plan.joints / DEG,
        "pre_position_deg": plan.pre / DEG,
        "approach": plan.approach.astype(int),
        "load": plan.load,
        "loads": [
            {"mass_kg": float(load.mass[0]), "centre_of_mass_mm": load.com[0] / MM}
            for load in plan.loads
        ],
        "commanded_mm": plan.position / MM,
        "rank": plan.rank,
        "travel_deg": plan.travel / DEG,
        "travel_as_chosen_deg": plan.travel_as_chosen / DEG,
        "notes": list(plan.notes),
    }


def _show(plan: PosePlan, origin: Provenance) -> None:
    n, expected = len(plan), plan.expected
    shown = sorted({k for k in SHOWN if k < n} | {n})
    rows = [
        [
            str(k),
            f"{expected.mean[k] / MM:.3f}",
            f"{expected.random_mean[k] / MM:.3f}",
            f"{expected.random_low[k] / MM:.3f} to {expected.random_high[k] / MM:.3f}",
        ]
        for k in shown
    ]
    emit_table(
        f"expected mean error, mm, of an arm of this type (floor {expected.floor_mean / MM:.3f})",
        ("poses", "planned", "random", "random, quartiles"),
        rows,
        provenance=origin,
    )
    lost = ", ".join(f"{reason} {number}" for reason, number in plan.rejected)
    say(f"{plan.candidates} candidates from {plan.drawn} postures{': ' + lost if lost else ''}")
