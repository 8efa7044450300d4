"""Solves some targets of a program: nominal joints, ambiguous configurations, inversion, guards.

A pose states the tool's position and orientation. The arm's configuration follows from the
program's words, its axis values, the start posture of the user, or the target before. Without any
of them the configuration is a guess, on which all targets depend up to the next one that states it.
The guess is harmless while the predicted errors of all configurations inside the joint limits
agree; targets from the first one on where they differ are left alone.
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from robotrue.compensation.arm_state import GUESSED, KNOWN, PARTED, ArmState
from robotrue.compensation.calibrated_arm import (
    WORK_DTYPE,
    Chunk,
    InversionLimits,
    Outcome,
    WorkArray,
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
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.program.program import Program
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.inverse_numeric import all_solutions, solve, solve_global
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry
from robotrue.robot.statics import Load

_TURN: Final = 2.0 * np.pi
_SLACK: Final = 1e-9  # rad; rounding of a joint at its limit
_ALIKE: Final = 1e-6  # rad between joints that are one solution
_BATCHES: Final = (1, 63, 960)
"""Rows looked at together; the first is nearly always enough."""
REUSE: Final = 50.0
"""rad of joint motion per m of tolerance: at a gradient of 1 mm/rad a twentieth of it."""
MOST_REUSE: Final = 1e-5
"""rad."""


def configuration_known(known: IntArray, before: int) -> IntArray:
    """Returns ``KNOWN`` or ``GUESSED`` of each target (n,), before any error is computed.

    Args:
        known: (n,) see :attr:`robotrue.compensation.plan.Plan.known`.
        before: That of the target before.
    """
    last = np.maximum.accumulate(np.where(known != 0, np.arange(len(known)), -1))
    here = np.where(known[last] > 0, KNOWN, GUESSED)
    return np.where(last < 0, before, here).astype(np.int64)


def other_configurations(robot: RobotModel, T_base_flange: Array, joints: Array) -> Array:
    """Returns the other configurations (m, k, 6) rad inside the limits; NaN where there is none.

    The other branches, each at the turns nearest to the joints, and the same branch with one joint
    a whole turn on. Of an arm without closed branches those that a search finds at the first pose
    and that lead on to the others.

    Args:
        robot: The nominal arm.
        T_base_flange: (m, 4, 4).
        joints: (m, 6) rad of the configuration that is not another one.
    """
    bare = robot.with_tool(np.eye(4))
    if opw_geometry(robot) is not None:
        branches = inverse_branches(bare, T_base_flange, reference=joints)
    else:
        branches = _search_branches(bare, T_base_flange, joints)
    lower, upper = robot.limits[:, 0] - _SLACK, robot.limits[:, 1] + _SLACK
    with np.errstate(invalid="ignore"):
        branches = branches - _TURN * np.ceil(np.maximum(branches - upper, 0.0) / _TURN)
        branches = branches + _TURN * np.ceil(np.maximum(lower - branches, 0.0) / _TURN)
    turned = np.concatenate([_TURN * np.eye(6), -_TURN * np.eye(6)])
    options = np.concatenate([branches, joints[:, None] + turned], axis=1)
    inside = ((options >= lower) & (options <= upper)).all(axis=2)
    other = np.abs(options - joints[:, None]).max(axis=2) > _ALIKE
    return np.where((inside & other)[..., None], options, np.nan)


def _search_branches(bare: RobotModel, T_base_flange: Array, joints: Array) -> Array:
    """Returns the solutions of the first pose, followed to the others, (m, k, 6) rad."""
    seeds = all_solutions(bare, T_base_flange[:1])[0]
    out = np.full((len(joints), len(seeds), 6), np.nan)
    for k, seed in enumerate(seeds):
        found = solve(bare, T_base_flange, seed)
        q = found.joints - _TURN * np.rint((found.joints - joints) / _TURN)
        out[found.converged, k] = q[found.converged]
    return out


def solve_targets(
    setup: CompensationSetup,
    program: Program,
    plan: Plan,
    load: Load,
    state: ArmState,
    outcome: Outcome,
) -> tuple[Array, bool]:
    """Solves consecutive targets and writes their outcomes.

    Args:
        setup: Model and settings.
        program: The targets.
        plan: Their treatment.
        load: One row or one per target.
        state: Where the arm is before the first target, changed in place.
        outcome: The unchanged targets; written.

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
    _mark_guesses_that_matter(setup, program, load, chunk, work, plan.known, targets, known)
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


def _mark_guesses_that_matter(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    chunk: Chunk,
    work: WorkArray,
    known: IntArray,
    rows: IntArray,
    configuration: IntArray,
) -> None:
    """Marks, in place, where guessed configurations begin to matter, up to the next that is known.

    Args:
        setup: Model, and m by which errors may differ.
        program: The n targets.
        load: Of them.
        chunk: With the joints of the guess.
        work: (1,) of ``WORK_DTYPE``.
        known: (n,) of the plan.
        rows: (m,) targets that are to be compensated.
        configuration: (n,) of :func:`configuration_known`, changed.
    """
    alike = setup.settings.alike
    if not alike < np.inf:
        return
    error_at = partial(_error_at, setup, program, load, chunk, work)

    def differ(some: IntArray) -> BoolArray:
        """Returns at which of some targets another configuration has another error."""
        nominal, approach = chunk.nominal[some], chunk.approach[some]
        own = error_at(some, nominal, approach)
        options = other_configurations(setup.robot, flange_poses(program, some), nominal)
        far = np.zeros(len(some), dtype=np.bool_)
        for k in range(options.shape[1]):
            left = np.flatnonzero(~far & np.isfinite(options[:, k, 0]))
            if len(left):
                error = error_at(some[left], options[left, k], approach[left])
                far[left] = np.linalg.norm(error - own[left], axis=1) > alike
        return far

    run = np.cumsum(known != 0)
    asked = rows[configuration[rows] == GUESSED]
    for number in np.unique(run[asked]):
        guessed, at = asked[run[asked] == number], 0
        while at < len(guessed):
            size = _BATCHES[min(int(np.searchsorted((1, 64), at, side="right")), 2)]
            some = guessed[at : at + size]
            far = differ(some)
            if far.any():
                first = int(some[np.argmax(far)])
                configuration[first:][run[first:] == number] = PARTED
                break
            at += size


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
