"""Solves some targets of a program: nominal joints, guesses that matter, inversion, guards."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from robotrue.compensation.arm_state import PARTED, ArmState
from robotrue.compensation.calibrated_arm import (
    WORK_DTYPE,
    Chunk,
    InversionLimits,
    Outcome,
    WorkArray,
)
from robotrue.compensation.guessed import (
    configuration_known,
    mark_guesses_that_matter,
    other_configurations,
)
from robotrue.compensation.inversion_kernels import invert_targets, predict_errors
from robotrue.compensation.nominal_kernels import choose_joints, follow_joints, write_base_targets
from robotrue.compensation.plan import Plan, flange_poses
from robotrue.compensation.predicted import (
    correct_by_prediction,
    predicted_error,
    write_covariances,
)
from robotrue.compensation.settings import CompensationSettings, CompensationSetup
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.program.program import Program
from robotrue.robot.inverse_numeric import solve_global
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

REUSE: Final = 50.0
"""rad of joint motion per m of tolerance: at a gradient of 1 mm/rad a twentieth of it."""
MOST_REUSE: Final = 1e-5
"""rad."""


def solve_targets(
    setup: CompensationSetup,
    program: Program,
    plan: Plan,
    load: Load,
    state: ArmState,
    outcome: Outcome,
) -> tuple[Array, bool]:
    """Writes what becomes of consecutive targets.

    Args:
        setup: Model and settings.
        program: The targets.
        plan: Their treatment.
        load: One row or one per target.
        state: Where the arm is before the first target, changed in place.
        outcome: The targets as they stand; written.

    Returns:
        Nominal joints (n, 6) rad, NaN where there are none, and whether the model knows the
        rotation error at all of the targets.
    """
    settings, reached = setup.settings, bool(state.get("reached"))
    outcome.status[:], outcome.joints[:] = plan.status, plan.joints
    chunk = _base_targets(program, plan, load, outcome)
    work = np.zeros(1, WORK_DTYPE)
    _write_nominal(setup, program, chunk, outcome, state, work)
    follow_joints(
        chunk.nominal, chunk.route, reached, settings.approach == "path",
        settings.max_joint_step, state.record, chunk.approach, chunk.jump,
    )  # fmt: skip
    wanted = (chunk.route != Route.SKIP) & (chunk.route != Route.PASS)
    targets = np.flatnonzero(wanted & np.isfinite(chunk.nominal[:, 0]))
    known = configuration_known(plan.known, state.get("configuration"))
    mark_guesses_that_matter(
        known, plan.known, targets, chunk.nominal, chunk.approach,
        partial(_other_joints, setup.robot, program),
        partial(_error_at, setup, program, load, chunk, work), settings.alike,
    )  # fmt: skip
    state.set("configuration", known[-1])
    parted = known[targets] == PARTED
    outcome.status[targets[parted]] = Status.UNCHANGED_CONFIGURATION
    bump, limits = np.empty((2, len(setup.arm.half_square))), inversion_limits(settings)
    invert_targets(setup.arm, chunk, limits, targets[~parted], bump, work, outcome)
    rotation_known = setup.has_tables or correct_by_prediction(
        setup, program, load, chunk, limits, outcome
    )
    write_covariances(setup, program, load, chunk, outcome)
    return chunk.nominal, rotation_known


def inversion_limits(settings: CompensationSettings) -> InversionLimits:
    """Returns the settings as the inversion reads them."""
    return InversionLimits(
        tolerance=settings.tolerance,
        turn_tolerance=settings.turn_tolerance,
        min_singular_value=settings.min_singular_value,
        min_wrist_sine=float(np.sin(settings.min_wrist_angle)),
        min_shift=settings.min_shift,
        max_shift=settings.max_shift,
        max_turn=settings.max_turn,
        reuse=min(REUSE * settings.tolerance, MOST_REUSE),
    )


def _base_targets(program: Program, plan: Plan, load: Load, outcome: Outcome) -> Chunk:
    """Returns the targets in base, their joints not yet known.

    All columns are copies that can be written: a kernel is compiled for one kind of array.
    """
    n = len(program)
    target, frame, route = np.empty((n, 3, 4)), np.array(program.frame), np.array(plan.route)
    write_base_targets(
        program.T_base_frame, frame, route, outcome.rotation, outcome.position, target
    )
    return Chunk(
        frames=program.T_base_frame,
        frame=frame,
        tool=np.array(program.tool),
        route=route,
        target=target,
        nominal=np.full((n, 6), np.nan),
        approach=np.zeros((n, 6)),
        jump=np.zeros(n, dtype=np.bool_),
        mass=np.array(load.mass),
        com=np.array(load.com),
        wrench=np.array(load.wrench),
    )


def _write_nominal(
    setup: CompensationSetup,
    program: Program,
    chunk: Chunk,
    outcome: Outcome,
    state: ArmState,
    work: WorkArray,
) -> None:
    """Writes the nominal joints of the targets; marks those out of reach.

    Targets that Newton does not reach from the one before are searched for from many postures;
    they get the route that this makes of them.
    """
    arms, route, near = setup.arm.arms, chunk.route, state.record["near"][0]
    choose = partial(
        choose_joints, arms, chunk.target, route, chunk.tool, outcome.joints, state.record, work,
        chunk.nominal,
    )  # fmt: skip
    row = choose(0)
    while row < len(route):
        joints = _search(setup.robot, program, row, np.array(near))
        if joints is None:
            outcome.status[row], route[row] = Status.UNCHANGED_UNREACHABLE, Route.SKIP
        else:
            outcome.joints[row] = joints
            jump = state.get("reached") and route[row] == Route.LINEAR
            jump = jump and np.abs(joints - near).max() > setup.settings.max_joint_step
            route[row] = Route.PASS if jump else Route.GIVEN
            if jump:
                outcome.status[row] = Status.UNCHANGED_BRANCH_JUMP
        row = choose(row)
    missing = (route != Route.SKIP) & np.isnan(chunk.nominal[:, 0])
    outcome.status[missing] = Status.UNCHANGED_UNREACHABLE


def _search(robot: RobotModel, program: Program, row: int, near: Array) -> Array | None:
    """Returns nominal joints (6,) rad of a target by search from many postures, or None."""
    tool = robot.with_tool(program.T_flange_tool[program.tool[row]])
    T_frame_tool = pose(program.rotation[row], program.position[row])
    T_base_tool = program.T_base_frame[program.frame[row]] @ T_frame_tool
    solution = solve_global(tool, T_base_tool[None], near=near)
    return solution.joints[0] if solution.converged[0] else None


def _other_joints(robot: RobotModel, program: Program, rows: IntArray, joints: Array) -> Array:
    """Returns the other configurations (m, k, 6) rad of some targets."""
    return other_configurations(robot, flange_poses(program, rows), joints)


def _error_at(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    chunk: Chunk,
    work: WorkArray,
    rows: IntArray,
    joints: Array,
    approach: Array,
) -> Array:
    """Returns the predicted error (m, 3) m of some targets at other joints."""
    if setup.model is not None and not setup.has_tables:
        return predicted_error(setup, program, load, rows, joints, approach)
    error = np.empty((len(rows), 3))
    mass, com, wrench = (
        column[rows] if len(column) > 1 else column
        for column in (chunk.mass, chunk.com, chunk.wrench)
    )
    moved = chunk._replace(
        tool=chunk.tool[rows],
        nominal=np.ascontiguousarray(joints),
        approach=approach,
        target=chunk.target[rows],
        mass=mass,
        com=com,
        wrench=wrench,
    )
    bump = np.empty((2, len(setup.arm.half_square)))
    predict_errors(setup.arm, moved, np.arange(len(rows)), bump, work, error)
    return error
