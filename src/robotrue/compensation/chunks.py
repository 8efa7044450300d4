"""Solves a program a chunk at a time: nominal joints, guesses that matter, inversion, guards."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from robotrue.compensation.arm_state import PARTED, ArmState
from robotrue.compensation.calibrated_arm import WORK_DTYPE, Chunk, InversionLimits, Outcome
from robotrue.compensation.guessed import (
    configuration_known,
    mark_guesses_that_matter,
    other_configurations,
)
from robotrue.compensation.inversion_kernels import predict_errors, solve_targets
from robotrue.compensation.nominal_kernels import choose_joints, follow_joints, write_base_targets
from robotrue.compensation.plan import Plan, flange_poses
from robotrue.compensation.predicted import (
    correct_by_prediction,
    predicted_error,
    write_covariances,
)
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.setup import CompensationSetup
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.program.program import Program
from robotrue.robot.inverse_numeric import solve_global
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

CHUNK: Final = 1 << 13
"""Targets solved at a time; only results grow with the program."""
REUSE: Final = 50.0
"""rad of joint motion per m of tolerance: at a gradient of 1 mm/rad a twentieth of it."""
MOST_REUSE: Final = 1e-5
"""rad."""


class SolvedChunk(NamedTuple):
    """Targets of a program that are solved.

    Attributes:
        rows: Which they are.
        nominal: (m, 6) rad, their nominal joints; NaN where there are none.
        rotation_known: Whether the model knows the rotation error at all of them.
    """

    rows: slice
    nominal: Array
    rotation_known: bool


def empty_outcome(program: Program, plan: Plan, *, covariance: bool) -> Outcome:
    """Returns room for the outcome of a program; its values are set chunk by chunk."""
    n = len(program)
    return Outcome(
        position=np.empty((n, 3)),
        rotation=np.empty((n, 9)),
        joints=np.empty((n, 6)),
        status=np.array(plan.status),
        before=np.empty((n, 3)),
        after=np.empty((n, 3)),
        shift=np.empty((n, 3)),
        turn=np.empty(n),
        singular=np.empty(n),
        covariance=np.empty((n if covariance else 0, 3, 3)),
    )


def solve_chunks(
    setup: CompensationSetup,
    program: Program,
    plan: Plan,
    load: Load,
    outcome: Outcome,
    state: ArmState,
) -> Iterator[SolvedChunk]:
    """Yields each chunk after its targets were solved into ``outcome``.

    Args:
        setup: Model and settings.
        program: The targets.
        plan: Their treatment.
        load: One row or one per target.
        outcome: Written.
        state: Where the arm is before the first target, changed in place.
    """
    work = np.zeros(1, WORK_DTYPE)
    for start in range(0, len(program), CHUNK):
        rows = slice(start, min(start + CHUNK, len(program)))
        part = Outcome._make(column[rows] for column in outcome)
        _write_unsolved(part, program, plan, rows)
        chunk = _solve(setup, program, plan, load, part, state, rows, work)
        rotation_known = setup.has_tables or correct_by_prediction(
            setup, load, program, chunk, inversion_limits(setup.settings), start, part
        )
        write_covariances(setup, program, load, chunk, start, part)
        yield SolvedChunk(rows, chunk.nominal, rotation_known)


def _write_unsolved(part: Outcome, program: Program, plan: Plan, rows: slice) -> None:
    """Writes a chunk of the outcome before anything is solved: its targets as they stand."""
    part.position[:] = program.position[rows]
    part.rotation[:] = program.rotation[rows].reshape(-1, 9)
    for unknown in (part.joints, part.before, part.after, part.singular, part.covariance):
        unknown[:] = np.nan
    part.shift[:], part.turn[:] = 0.0, 0.0
    first, last = np.searchsorted(plan.rows, (rows.start, rows.stop))
    part.joints[plan.rows[first:last] - rows.start] = plan.joints[first:last]


def _solve(
    setup: CompensationSetup,
    program: Program,
    plan: Plan,
    load: Load,
    part: Outcome,
    state: ArmState,
    rows: slice,
    work: np.ndarray[tuple[int], np.dtype[np.void]],
) -> Chunk:
    """Solves one chunk into its part of the outcome; returns what was inverted."""
    settings, reached = setup.settings, bool(state.get("reached"))
    chunk = _base_targets(program, plan, load, part, rows)
    _write_nominal(setup, program, chunk, part, state, rows, work)
    follow_joints(
        chunk.nominal, chunk.route, reached, settings.approach == "path",
        settings.max_joint_step, state.record, chunk.approach, chunk.jump,
    )  # fmt: skip
    wanted = (chunk.route != Route.SKIP) & (chunk.route != Route.PASS)
    targets = np.flatnonzero(wanted & np.isfinite(chunk.nominal[:, 0]))
    known = configuration_known(plan.known[rows], int(state.get("configuration")))
    mark_guesses_that_matter(
        known, plan.known[rows], targets, chunk.nominal, chunk.approach,
        partial(_other_joints, setup.robot, program, rows.start),
        partial(_error_at, setup, program, load, chunk, rows.start, work), settings.alike,
    )  # fmt: skip
    state.set("configuration", known[-1])
    parted = known[targets] == PARTED
    part.status[targets[parted]] = Status.UNCHANGED_CONFIGURATION
    bump = np.empty((2, len(setup.arm.half_square)))
    solve_targets(
        setup.arm, chunk, inversion_limits(settings), targets[~parted], bump, work, part
    )  # fmt: skip
    return chunk


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


def _base_targets(program: Program, plan: Plan, load: Load, part: Outcome, rows: slice) -> Chunk:
    """Returns the targets of a chunk in base, their joints not yet known."""
    count = rows.stop - rows.start
    target = np.empty((count, 3, 4))
    route, frame = np.array(plan.route[rows]), np.array(program.frame[rows])
    write_base_targets(program.T_base_frame, frame, route, part.rotation, part.position, target)
    mass, com, wrench = (
        np.array(column[rows] if len(column) > 1 else column)
        for column in (load.mass, load.com, load.wrench)
    )
    return Chunk(
        frames=program.T_base_frame,
        frame=frame,
        tool=np.array(program.tool[rows]),
        route=route,
        target=target,
        nominal=np.full((count, 6), np.nan),
        approach=np.zeros((count, 6)),
        jump=np.zeros(count, dtype=np.bool_),
        mass=mass,
        com=com,
        wrench=wrench,
    )


def _write_nominal(
    setup: CompensationSetup,
    program: Program,
    chunk: Chunk,
    part: Outcome,
    state: ArmState,
    rows: slice,
    work: np.ndarray[tuple[int], np.dtype[np.void]],
) -> None:
    """Writes the nominal joints of the chunk; marks targets out of reach.

    Targets that Newton does not reach from the one before are searched for from many postures;
    they get the route that this makes of them.
    """
    arms, route, near = setup.arm.arms, chunk.route, state.record["near"][0]
    choose = partial(
        choose_joints, arms, chunk.target, route, chunk.tool, part.joints, state.record, work,
        chunk.nominal,
    )  # fmt: skip
    row = choose(0)
    while row < len(route):
        joints = _search(setup.robot, program, rows.start + row, np.array(near))
        if joints is None:
            part.status[row], route[row] = Status.UNCHANGED_UNREACHABLE, Route.SKIP
        else:
            part.joints[row] = joints
            jump = state.get("reached") and route[row] == Route.LINEAR
            jump = jump and np.abs(joints - near).max() > setup.settings.max_joint_step
            route[row] = Route.PASS if jump else Route.GIVEN
            if jump:
                part.status[row] = Status.UNCHANGED_BRANCH_JUMP
        row = choose(row)
    missing = (route != Route.SKIP) & np.isnan(chunk.nominal[:, 0])
    part.status[missing] = Status.UNCHANGED_UNREACHABLE


def _search(robot: RobotModel, program: Program, row: int, near: Array) -> Array | None:
    """Returns nominal joints (6,) rad of a target by search from many postures, or None."""
    tool = robot.with_tool(program.T_flange_tool[program.tool[row]])
    T_frame_tool = pose(program.rotation[row], program.position[row])
    T_base_tool = program.T_base_frame[program.frame[row]] @ T_frame_tool
    solution = solve_global(tool, T_base_tool[None], near=near)
    return solution.joints[0] if solution.converged[0] else None


def _other_joints(
    robot: RobotModel, program: Program, first: int, rows: IntArray, joints: Array
) -> Array:
    """Returns the other configurations (m, k, 6) rad of targets of a chunk."""
    return other_configurations(robot, flange_poses(program, rows + first), joints)


def _error_at(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    chunk: Chunk,
    first: int,
    work: np.ndarray[tuple[int], np.dtype[np.void]],
    rows: IntArray,
    joints: Array,
    approach: Array,
) -> Array:
    """Returns the predicted error (m, 3) m of targets of a chunk, at other joints."""
    if setup.model is not None and not setup.has_tables:
        return predicted_error(setup, program, load, rows + first, joints, approach)
    error = np.empty((len(rows), 3))
    there = chunk._replace(
        tool=chunk.tool[rows],
        nominal=np.ascontiguousarray(joints),
        approach=approach,
        target=chunk.target[rows],
        **{
            name: getattr(chunk, name)[rows]
            for name in ("mass", "com", "wrench")
            if len(getattr(chunk, name)) > 1
        },
    )
    bump = np.empty((2, len(setup.arm.half_square)))
    predict_errors(setup.arm, there, np.arange(len(rows)), bump, work, error)
    return error
