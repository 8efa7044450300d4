"""Everything the paper measured, on one simulated arm: Tables 5, 8, 9, 11 and the switches."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.calibration.deng2022.joined import PoseModel
from robotrue.calibration.deng2022.readings import DengReadings, TargetRule
from robotrue.calibration.deng2022.transfer_gpr import fit_deng2022, fit_pose_gpr
from robotrue.calibration.model import ErrorModel, Query
from robotrue.compensation.compensate import compensate
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.formats import read_program, write_program
from robotrue.program.program import Program
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch
from robotrue.simulation.flange_hole import FlangeHole, check_rows, hole_program
from robotrue.simulation.milling import dry_run, mill_hole
from robotrue.simulation.plans import (
    POSTURE,
    VALIDATION,
    Region,
    random_joints,
    region_poses,
    with_attitude,
)
from robotrue.simulation.presets import VirtualCell, raw_error
from robotrue_reproductions.deng2022 import scenarios
from robotrue_reproductions.deng2022.sampling_plan import paper_domains, paper_plan
from robotrue_reproductions.deng2022.scenarios import Scenario

SWITCHES: Final[dict[str, dict[str, Any]]] = {
    "as chosen": {},
    "T_j by least squares": {"transform": "least-squares"},
    "H_j on all six pose numbers": {"inputs": "pose"},
    "H_j shrinks to zero": {"shrink_to": "zero"},
    "lambda 1e-3": {"ridge": "fixed", "ridge_value": 1e-3},
    "lambda 10": {"ridge": "fixed", "ridge_value": 10.0},
    "omega_m on rows of eq. 13": {"alignment_weights": "rows"},
    "one round, no boosting": {"rounds": 1},
    "eq. 19, each copy of a source row counts": {"source_start": "same"},
    "eq. 20 without omega_m": {"boosting_weights": "none"},
    "eq. 20 with the mean omega_m": {"boosting_weights": "mean"},
    "eq. 22 over all rows": {"error_over": "all"},
    "eq. 24 literal": {"source_weights": "literal"},
    "eq. 24 Pardoe": {"source_weights": "pardoe"},
    "eq. 25 literal": {"combination": "literal"},
    "H_j to zero, copies counted, no omega_m": {
        "shrink_to": "zero",
        "source_start": "same",
        "boosting_weights": "none",
    },
    "eq. 22, 24, 25 literal": {
        "error_over": "all",
        "source_weights": "literal",
        "combination": "literal",
    },
    "isotropic kernel": {"kernel": "isotropic"},
}
"""Readings compared; each differs from the default in what is named."""
RULES: Final[dict[str, TargetRule]] = {
    "rule 3: corners and boundary": "boundary",
    "space-filling target poses": "space-filling",
}
"""Other choices of the 16 poses in each sub-space; by default they are drawn."""
TURNS: Final = (5.0, 10.0, 15.0)
"""deg, Table 5."""
LEVELS: Final = 12
"""mm of depth that are milled; the paper's 30 mm take three times as long and give the same."""
_FIXED_LENGTH: Final = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmResults:
    """One arm. Lengths in m; (mean, max, std) of 3-D errors except where noted.

    Attributes:
        accuracy: By method of Table 8 and comparison.
        switches: Mean error of Tr-GPR by reading; empty unless requested.
        attitude: (3, 3) change of error for turns of 5, 10, 15 deg (columns) about rx, ry, rz.
        dry: Before and after, Table 9.
        hole: Before and after, Table 11: position x, y, total, contour mean, max, std.
        counts: Source, target, validation poses, Tables 6 and 7.
    """

    accuracy: dict[str, Array]
    switches: dict[str, float]
    attitude: Array
    dry: dict[str, Array]
    hole: dict[str, Array]
    counts: dict[str, int]


def arm_results(name: str, seed: int, *, quick: bool = False) -> ArmResults:
    """Returns all results of one simulated arm.

    Args:
        name: Scenario.
        seed: Of the arm and everything drawn for it.
        quick: No switches, a hole of 5 mm.

    Raises:
        ReachError: The arm cannot take a pose of the plan.
    """
    case = scenarios.scenario(name, seed)
    rows, check = scenarios.paper(case), scenarios.check(case)
    source, target = rows.subset(rows.group == 0), rows.subset(rows.group == 1)
    model = _transfer(case, source, target)
    switches: dict[str, float] = {}
    if not quick:
        for label, values in SWITCHES.items():
            other = _reread(case, model, source, target, values)
            switches[label] = float(_statistics(_compute_residuals(other, check))[0])
        for label, rule in RULES.items():
            other = _with_rule(case, rule)
            switches[label] = float(_statistics(_compute_residuals(other, check))[0])
    dry, hole = _program_runs(case, model, levels=5 if quick else LEVELS)
    return ArmResults(
        accuracy=_accuracy(case, model, rows, check),
        switches=switches,
        attitude=_attitude_sensitivity(case),
        dry=dry,
        hole=hole,
        counts={
            "source": len(source),
            "target": len(target),
            "validation": len(case.plan.validation),
            "complete": len(source) * (1 + len(paper_domains(case.attitude).sub_spaces)),
        },
    )


def _transfer(
    case: Scenario,
    source: MeasurementSet,
    target: MeasurementSet,
    *,
    inflation: float | None = None,
    **values: Any,
) -> PoseModel:
    return fit_deng2022(
        case.cell.known.measured_robot,
        source,
        target,
        paper_domains(case.attitude),
        case.settings,
        DengReadings(attitude=case.attitude, **values),
        inflation=inflation,
    )


def _with_rule(case: Scenario, rule: TargetRule) -> PoseModel:
    """The model of a plan with target poses of another rule, measured again."""
    robot = case.cell.known.measured_robot
    plan = paper_plan(robot, case.seed, case.attitude, rule=rule)
    rows = scenarios.paper(replace(case, plan=plan))
    source, target = rows.subset(rows.group == 0), rows.subset(rows.group == 1)
    return _transfer(case, source, target, inflation=1.0)


def _reread(
    case: Scenario,
    model: PoseModel,
    source: MeasurementSet,
    target: MeasurementSet,
    values: dict[str, Any],
) -> PoseModel:
    """The model under other readings; eq. 25 only combines what is there already."""
    if set(values) - {"combination"}:
        return _transfer(case, source, target, inflation=1.0, **values)
    first, *rest = model.experts
    committee = replace(first.committee, **values)
    return replace(model, experts=(replace(first, committee=committee), *rest))


def _accuracy(
    case: Scenario, model: PoseModel, rows: MeasurementSet, check: MeasurementSet
) -> dict[str, Array]:
    """Table 8 and what it should have been compared with."""
    robot, inside = case.cell.known.measured_robot, with_attitude(VALIDATION, case.attitude)
    complete = scenarios.validation(case)
    few = scenarios.measure_joints(case, random_joints(robot, 50, seed=case.seed, region=inside))
    everywhere = with_attitude(Region(), case.attitude)
    fixed = DengReadings(mean="zero", kernel="isotropic", length=_FIXED_LENGTH)
    models: dict[str, ErrorModel] = {
        "GPR-50": fit_pose_gpr(robot, few, inside, case.settings),
        "GPR-378": fit_pose_gpr(robot, complete, inside, case.settings),
        "Tr-GPR": model,
        "GPR pooled, same 206": fit_pose_gpr(robot, rows, everywhere, case.settings),
        "GPR-50, zero mean, fixed 100 mm": fit_pose_gpr(robot, few, inside, case.settings, fixed),
        "GPR-378, zero mean, fixed 100 mm": fit_pose_gpr(
            robot, complete, inside, case.settings, fixed
        ),
    }
    raw = scenarios.raw_errors(case, check)
    offset = raw - scenarios.raw_errors(case, few).mean(axis=0)
    out = {"before": _statistics(raw)}
    out |= {label: _statistics(_compute_residuals(m, check)) for label, m in models.items()}
    out["mean error of 50 subtracted"] = _statistics(offset)
    out["floor"] = np.array([scenarios.floor(case), np.nan, np.nan])
    return out


def _compute_residuals(model: ErrorModel, rows: MeasurementSet) -> Array:
    """Measured minus commanded minus predicted, (n, 3) m, as the paper measures."""
    commanded = forward(model.robot, rows.joints)[:, :3, 3]
    out: Array = rows.position - commanded - model.predict(Query(joints=rows.joints)).error
    return out


def _statistics(errors: Array) -> Array:
    size = np.linalg.norm(errors, axis=1)
    return np.array([size.mean(), size.max(), size.std(ddof=1)])


def _attitude_sensitivity(case: Scenario) -> Array:
    """Mean change of the noise-free error at 20 places when the attitude turns, (3, 3) m."""
    inside = with_attitude(replace(VALIDATION, turn=(0.0, 0.0, 0.0)), case.attitude)
    poses = region_poses(inside, 20, np.random.default_rng([case.seed, 41]))
    robot = case.cell.known.measured_robot
    out = np.full((3, 3), np.nan)
    straight = inverse_batch(robot, poses, near=POSTURE)
    for axis in range(3):
        for k, angle in enumerate(TURNS):
            turn = np.zeros((1, 3))
            turn[0, 2 - axis] = angle * DEG
            there = inverse_batch(
                robot, poses @ pose(matrix_from_abc(turn), np.zeros(3)), near=POSTURE
            )
            able = np.isfinite(straight).all(axis=1) & np.isfinite(there).all(axis=1)
            if able.any():
                change = raw_error(case.cell.robot, there[able]) - raw_error(
                    case.cell.robot, straight[able]
                )
                out[axis, k] = np.linalg.norm(change, axis=1).mean()
    return out


def _program_runs(
    case: Scenario, model: PoseModel, *, levels: int
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Tables 9 and 11: the flange hole before and after compensation by the transferred model."""
    cell = _mill_at_reflector(case.cell)
    hole = FlangeHole(
        T_base_part=pose(
            matrix_from_abc(np.array([8.0, 0.0, 0.0]) * DEG), np.array([0.92, -0.12, 0.80])
        ),
        depth=levels * MM,
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flange_hole.src"
        path.write_bytes(hole_program(hole, cell.known.robot))
        program = read_program(path)
        result = compensate(model, program, settings=CompensationSettings(load=cell.known.payload))
        path.write_bytes(write_program(program, result.replacement))
        driven = read_program(path)
    rows = check_rows(program, hole, (levels + 1) // 2)
    dry: dict[str, Array] = {}
    made: dict[str, Array] = {}
    runs: tuple[tuple[str, Program, int], ...] = (("before", program, 2), ("after", driven, 4))
    for label, run, campaign in runs:
        dry[label] = _statistics(dry_run(cell, program, run, rows, campaign=campaign))
        seen = mill_hole(cell, hole, program, run, campaign=campaign + 1)
        contour = np.abs(seen.contour)
        made[label] = np.array(
            [
                *np.abs(seen.position_error),
                seen.position,
                contour.mean(),
                contour.max(),
                contour.std(ddof=1),
            ]
        )
    return dry, made


def _mill_at_reflector(cell: VirtualCell) -> VirtualCell:
    """The cell with the tip of its end mill where the reflector was, spindle at 30 deg."""
    tool = pose(
        matrix_from_abc(np.array([0.0, 30.0, 0.0]) * DEG), cell.known.T_flange_target[:3, 3]
    )
    known = replace(cell.known, robot=cell.known.robot.with_tool(tool))
    robot = replace(
        cell.robot,
        nominal=cell.robot.nominal.with_tool(tool),
        actual=cell.robot.actual.with_tool(tool),
    )
    return replace(cell, known=known, robot=robot)
