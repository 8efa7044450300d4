"""A program whose targets are moved so that the actual tool lands where they were.

Per target: the nominal inverse picks the branch, Newton on the calibrated, loaded arm finds the
joints at which the *actual* tool stands on the target, and the nominal pose at those joints is what
the controller must be told. Arcs stay arcs and lines stay lines: targets move, none are added.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.tables import rigid_tables
from robotrue.compensation.chunks import Outcome, Standing, empty_outcome, solve_chunks
from robotrue.compensation.guessed import other_configurations
from robotrue.compensation.held_load import at_part
from robotrue.compensation.pack import Pack, pack_tables
from robotrue.compensation.plan import Plan, flange_poses, lay_out, new_words
from robotrue.compensation.predicted import by_prediction, covariances, predicted_error
from robotrue.compensation.result import Compensation
from robotrue.compensation.row_notes import RowNote, row_note
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.stance import Stance, first_stance
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.progress import Progress, unheard
from robotrue.core.units import UM
from robotrue.core.words import NO_WORD
from robotrue.program.program import Program, Reason, Replacement
from robotrue.robot.inverse_numeric import solve_global
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

SAME_TOOL = 1e-9  # m and rad by which a program's tool may differ from the measured one
_LEFT_ALONE, _UNSURE = 10, 99
"""Places of the notes."""


def compensate(
    model: ErrorModel,
    program: Program,
    *,
    settings: CompensationSettings | None = None,
    progress: Progress = unheard,
) -> Compensation:
    """Returns the targets to command so that the actual tool lands on those of the program.

    The result depends on the order of the targets only through the arm's configuration and, with
    backlash, through the direction each joint comes from. Targets that cannot be compensated keep
    their values and say why in their status.

    Args:
        model: Error of the robot. Where it has :meth:`~ErrorModel.mean_tables` the compiled route
            is taken, else Newton on its predictions.
        program: Targets in work frames and with tools that the reader has resolved.
        settings: Load, guards and tolerances.
        progress: Told how many targets are done, and of how many.

    Raises:
        ConfigurationError: The arm has not six joints, or the load does not fit the program.
        ModelMismatchError: Axis targets of another arm.

    Fails when: the controller corrects absolute accuracy itself; the correction is then made twice.
    """
    settings = settings or CompensationSettings()
    load = at_part(program, settings.load_for(len(program)))
    robot = model.robot.nominal()
    settings = with_start(robot, program.start, settings)
    measured = measured_tools(robot, program.T_flange_tool)
    tables = model.mean_tables(load)
    pack = pack_tables(tables or rigid_tables(robot), program.T_flange_tool, measured)
    plan = lay_out(robot, program, settings)
    outcome = empty_outcome(program, plan, covariance=settings.covariance)
    turn_known = True
    stance = None
    for part in solve_chunks(
        pack, program, plan, settings, load, outcome,
        partial(_search, robot, program), partial(_others, robot, program),
        error_at=None if tables else partial(predicted_error, model, program, load, measured),
    ):  # fmt: skip
        stance = stance or first_stance(robot, program, plan, settings, part)
        if tables is None:
            turn_known &= by_prediction(
                model, robot, program, plan, settings, load, measured, outcome, part
            )
        if settings.covariance:
            covariances(model, program, load, measured, outcome, part)
        progress("compensating", part.rows.stop, len(program))
    replacement, notes = replaced(robot, program, plan, settings, outcome)
    sentences = [str(note) for note in notes]
    if program.held.any():
        sentences.append(
            f"{int(program.held.sum())} targets carry the part to a tool that stands in the cell; "
            "shifts and errors told of them are those of the part's frame."
        )
    if not turn_known:
        sentences.append(
            "the model knows no rotation error at some targets; their rotation was kept as nominal."
        )
    return Compensation(
        replacement=replacement,
        status=outcome.status,
        predicted_error_before=outcome.before,
        predicted_error_after=outcome.after,
        shift=outcome.shift,
        turn=outcome.turn,
        joints=outcome.joints,
        covariance=outcome.covariance,
        singular_value=outcome.singular,
        stance=stance,
        notes=tuple(sentences),
    )


def compensate_part(
    model: ErrorModel | None,
    robot: RobotModel,
    pack: Pack,
    measured: BoolArray,
    program: Program,
    settings: CompensationSettings,
    load: Load,
    standing: Standing,
) -> tuple[Plan, Outcome, Stance | None]:
    """Returns plan, outcome and first stance of consecutive targets; ``standing`` moves on.

    Args:
        model: For covariances; None where the settings do not ask for them.
        robot: The nominal arm.
        pack: Tables of the model, for the tools of the program.
        measured: (t,) which of the tools is the measured one.
        program: The targets.
        settings: Guards and tolerances.
        load: One row, or one per target of this part.
        standing: Where the arm is before them, renewed in place.
    """
    plan = lay_out(robot, program, settings, begun=bool(standing.begun[0]), words=standing.words)
    standing.begun[0] |= (plan.route != Route.SKIP).any()
    standing.words[: len(plan.words)] = plan.words
    outcome = empty_outcome(program, plan, covariance=settings.covariance)
    stance, been = None, bool(standing.branch[3])
    for part in solve_chunks(
        pack, program, plan, settings, load, outcome,
        partial(_search, robot, program), partial(_others, robot, program), standing,
    ):  # fmt: skip
        if not been:
            stance = stance or first_stance(robot, program, plan, settings, part)
        if model is not None and settings.covariance:
            covariances(model, program, load, measured, outcome, part)
    return plan, outcome, stance


def with_start(
    robot: RobotModel, start: Array, settings: CompensationSettings
) -> CompensationSettings:
    """Returns the settings with the arm at home where its program says it starts, if it does."""
    if len(start) != robot.dof or robot.controller is None:
        return settings
    return replace(settings, home=robot.controller.to_model(start[None])[0])


def measured_tools(robot: RobotModel, T_flange_tool: Array) -> BoolArray:
    """Returns (t,) which tools are the one the model was measured with."""
    return np.array(
        [np.allclose(t, robot.T_flange_tool, rtol=0.0, atol=SAME_TOOL) for t in T_flange_tool]
    )


def _search(robot: RobotModel, program: Program, row: int, near: Array) -> Array | None:
    """Returns nominal joints (6,) rad of a target by search from many postures, or None."""
    tool = robot.with_tool(program.T_flange_tool[program.tool[row]])
    T_frame_tool = pose(program.rotation[row], program.position[row])
    T_base_tool = program.T_base_frame[program.frame[row]] @ T_frame_tool
    found = solve_global(tool, T_base_tool[None], near=near)
    return found.joints[0] if found.converged[0] else None


def _others(robot: RobotModel, program: Program, rows: IntArray, joints: Array) -> Array:
    """Returns the other configurations (m, k, 6) rad of targets."""
    return other_configurations(robot, flange_poses(program, rows), joints)


def replaced(
    robot: RobotModel,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    outcome: Outcome,
) -> tuple[Replacement, tuple[RowNote, ...]]:
    """Returns what the writer is to put in place of the targets, and what is to be said of them."""
    n = len(program)
    notes = list(plan.notes)
    changed = outcome.status == Status.COMPENSATED
    new = np.broadcast_to(np.int64(NO_WORD), program.words.shape)
    worded = plan.worded[changed[plan.worded]]
    if len(worded):
        new = np.array(new)
        new[worded], said = new_words(robot, program, worded, outcome.joints[worded])
        notes.extend(said)
    axes = program.axes
    moved = np.flatnonzero(changed & (plan.route == Route.AXES))
    if len(moved) and robot.controller is not None:
        axes = np.array(program.axes)
        axes[moved] = robot.controller.to_controller(outcome.joints[moved])
    notes.extend(_notes(program, settings, outcome))
    replacement = Replacement(
        changed=changed,
        position=outcome.position,
        rotation=outcome.rotation.reshape(n, 3, 3),
        axes=axes,
        words=new,
    )
    return replacement, tuple(notes)


def _notes(program: Program, settings: CompensationSettings, outcome: Outcome) -> list[RowNote]:
    """Returns one note for each status that means a target was left alone, and for doubts."""
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
                "outside what the calibration knows, predicted to %.0f um (1 sigma) where "
                f"{settings.max_sigma / UM:.0f} um is allowed; measure poses there."
            )
            worst = float(np.nanmax(sigma) / UM)
            notes.append(row_note(program, rows, text, worst=worst, rank=_UNSURE))
    return notes
