"""Moves the targets of a program so that the actual tool reaches the original ones.

Per target: the nominal inverse picks the branch, Newton on the calibrated, loaded arm finds the
joints at which the *actual* tool is on the target, and the nominal pose at those joints is the new
target. Arcs stay arcs and lines stay lines: targets move, none are added.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.calibrated_arm import Outcome
from robotrue.compensation.plan import Plan, lay_out, new_words
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import (
    CompensationSettings,
    CompensationSetup,
    compensation_setup,
)
from robotrue.compensation.stance import first_stance
from robotrue.compensation.status import Route, RowNote, Status, merge_notes, row_note
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, IntArray
from robotrue.core.progress import Progress, unheard
from robotrue.core.units import UM
from robotrue.program.program import Program, Reason, Replacement
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

CHUNK: Final = 1 << 13
"""Targets solved at a time; only results grow with the program."""
_LEFT_ALONE, _UNSURE = 10, 99
"""Places of the notes."""


def compensate(
    model: ErrorModel,
    program: Program,
    *,
    settings: CompensationSettings | None = None,
) -> Compensation:
    """Returns the targets to command so that the actual tool lands on those of the program.

    The result depends on the order of the targets only through the arm's configuration and, with
    backlash, through the direction each joint comes from. Targets that cannot be compensated keep
    their values, with the cause in their status.

    Args:
        model: Error of the robot. Where it has :meth:`~ErrorModel.mean_tables` they are inverted
            in compiled code, else Newton runs on its predictions.
        program: Targets in work frames and with tools that the reader has resolved.
        settings: Load, guards and tolerances.

    Raises:
        ConfigurationError: The arm has not six joints, or the load does not fit the program.
        ModelMismatchError: Axis targets of another arm.

    Fails when: the controller corrects absolute accuracy itself; the correction is then made twice.
    """
    settings = settings or CompensationSettings()
    load = load_about_part_origin(program, settings.load_for(len(program)))
    setup = compensation_setup(
        model, program.T_flange_tool, program.start, settings, program.external
    )
    return compensate_targets(setup, program, load, setup.start_state())


def compensate_targets(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    state: ArmState,
    progress: Progress = unheard,
) -> Compensation:
    """Returns :func:`compensate` of consecutive targets of a program.

    Args:
        setup: Of the program.
        program: The targets.
        load: One row, or one per target of these.
        state: The arm before them; changed in place to the arm after them.
        progress: Called with the number of targets done and the total.

    Raises:
        ModelMismatchError: Axis targets of another arm.
    """
    from robotrue.compensation.solve_targets import solve_targets  # compiles: when needed

    robot, settings, n = setup.robot, setup.settings, len(program)
    outcome = empty_outcome(program, n, covariance=settings.covariance)
    axes, words = np.array(program.axes), np.full_like(program.words, NO_WORD)
    notes: list[RowNote] = []
    stance, rotation_known = None, True
    for start in range(0, n, CHUNK):
        rows = slice(start, min(start + CHUNK, n))
        here = program if n <= CHUNK else program.take(rows)
        part = Outcome._make(column[rows] for column in outcome)
        reached = bool(state.get("reached"))
        plan = lay_out(robot, here, settings, state)
        nominal, known = solve_targets(setup, here, plan, load.take(rows), state, part)
        if not reached:
            stance = first_stance(robot, here, plan, settings, nominal) or stance
        rotation_known &= known
        notes += plan.notes
        notes += _write_axes_and_words(robot, here, plan, part, axes[rows], words[rows])
        notes += _notes(here, settings, part)
        progress("compensating", rows.stop, n)
    changed = outcome.status == Status.COMPENSATED
    for column in (*outcome, axes, words, changed):  # frozen here, so that they are not copied
        column.flags.writeable = False
    return Compensation(
        replacement=Replacement(
            changed=changed,
            position=outcome.position,
            rotation=outcome.rotation.reshape(n, 3, 3),
            axes=axes,
            words=words,
        ),
        status=outcome.status,
        predicted_error_before=outcome.before,
        predicted_error_after=outcome.after,
        shift=outcome.shift,
        turn=outcome.turn,
        joints=outcome.joints,
        covariance=outcome.covariance,
        singular_value=outcome.singular,
        stance=stance,
        row_notes=merge_notes(notes),
        remarks=_remarks(program, rotation_known=rotation_known),
    )


def load_about_part_origin(program: Program, load: Load) -> Load:
    """Returns the load with the wrench on a part that the robot holds about the part's origin.

    The wrench of such a target is what the tool does to the part, at the tool point; the frame the
    robot moves is the part's, so that the moment about its origin is m + (p_tool - p_part) x f.

    Args:
        program: Targets; those that are not held keep their wrench.
        load: One row, or one per target.
    """
    if not program.held.any() or not load.wrench.any():
        return load
    wrench = np.array(np.broadcast_to(load.wrench, (len(program), 6)))
    rows = np.flatnonzero(program.held & np.isfinite(program.position).all(axis=1))
    R_base_tool = program.T_base_frame[program.frame[rows], :3, :3]
    lever: Array = -np.einsum("nij,nj->ni", R_base_tool, program.position[rows])
    wrench[rows, 3:] += np.cross(lever, wrench[rows, :3])
    return replace(load, wrench=wrench)


def empty_outcome(program: Program, n: int, *, covariance: bool) -> Outcome:
    """Returns the outcome before anything is solved: the n targets unchanged."""
    return Outcome(
        position=np.array(program.position),
        rotation=np.array(program.rotation).reshape(n, 9),
        joints=np.full((n, 6), np.nan),
        status=np.zeros(n, dtype=np.int64),
        before=np.full((n, 3), np.nan),
        after=np.full((n, 3), np.nan),
        shift=np.zeros((n, 3)),
        turn=np.zeros(n),
        singular=np.full(n, np.nan),
        covariance=np.full((n if covariance else 0, 3, 3), np.nan),
    )


def _write_axes_and_words(
    robot: RobotModel, program: Program, plan: Plan, outcome: Outcome, axes: Array, words: IntArray
) -> tuple[RowNote, ...]:
    """Writes the axes and the configuration words of new targets; returns notes on them."""
    changed = outcome.status == Status.COMPENSATED
    moved = np.flatnonzero(changed & (plan.route == Route.AXES))
    if len(moved):
        axes[moved] = robot.controller.to_controller(outcome.joints[moved])
    worded = plan.worded[changed[plan.worded]]
    if not len(worded):
        return ()
    words[worded], renewed = new_words(robot, program, worded, outcome.joints[worded])
    return renewed


def _remarks(program: Program, *, rotation_known: bool) -> tuple[str, ...]:
    """Returns the notes that belong to no line."""
    remarks = []
    if program.held.any():
        remarks.append(
            f"{int(program.held.sum())} targets carry the part to a fixed tool in the cell; their "
            "shifts and errors are in the part's frame."
        )
    if not rotation_known:
        remarks.append(
            "the model has no rotation error at some targets; their rotation stays nominal."
        )
    return tuple(remarks)


def _notes(program: Program, settings: CompensationSettings, outcome: Outcome) -> list[RowNote]:
    """Returns one note for each status of an unchanged target, and for warnings."""
    notes = []
    count = np.bincount(outcome.status, minlength=len(Status))
    for status in Status:
        if not count[status] or status in (
            Status.COMPENSATED,
            Status.UNCHANGED_NO_ERROR,
            Status.UNCHANGED_AXIS_TARGET,
        ):
            continue
        rows = np.flatnonzero(outcome.status == status)
        rank = _LEFT_ALONE + status
        if status != Status.UNCHANGED_SOURCE:
            text = f"unchanged, {status.explanation}."
            notes.append(row_note(program, rows, text, rank=rank))
            continue
        for reason in np.unique(program.reason[rows]).tolist():
            text = f"unchanged, {Reason(reason).explanation}."
            mine = rows[program.reason[rows] == reason]
            notes.append(row_note(program, mine, text, rank=rank))
    if len(outcome.covariance):
        sigma = np.sqrt(np.trace(outcome.covariance, axis1=1, axis2=2))
        rows = np.flatnonzero(sigma > settings.max_sigma)
        if len(rows):
            text = (
                "outside the range of the calibration, predicted to %.0f um (1 sigma) where "
                f"{settings.max_sigma / UM:.0f} um is allowed; measure poses there."
            )
            worst = float(np.nanmax(sigma) / UM)
            notes.append(row_note(program, rows, text, worst=worst, rank=_UNSURE))
    return notes
