"""Treatment of each target of a program, decided before any number is computed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route, RowNote, Status, row_note
from robotrue.core.arm_words import NO_WORD, Maker
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import inverse, pose
from robotrue.errors import ModelMismatchError
from robotrue.program.program import Motion, Program, Reason
from robotrue.robot.configuration import (
    branch_fits,
    branch_words,
    configuration_words,
    on_turn,
    renew_words,
)
from robotrue.robot.inverse import inverse_batch, inverse_branches
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry

CALLED = {"kuka": "S and T", "abb": "confdata", "fanuc": "CONFIG", "yaskawa": "RCONF"}
MISCOUNTED, ASTRAY, UNUSED, CROSSED = 0, 1, 2, 3
"""Places of the notes."""
_ALIKE = 1e-6
"""rad between joints that are one solution."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Treatment of n targets.

    Attributes:
        route: (n,) :class:`Route`.
        status: (n,) :class:`Status` of unchanged ones, ``COMPENSATED`` for the others.
        joints: (n, 6) rad, model's sense, of targets whose joints are known beforehand; else NaN.
        worded: (k,) targets whose configuration words are to be renewed.
        known: (n,) 1 where the arm's configuration is known from here on, -1 where from here on it
            is not, 0 where it is what it was before.
        notes: Remarks for the user.
    """

    route: IntArray
    status: IntArray
    joints: Array
    worded: IntArray
    known: IntArray
    notes: tuple[RowNote, ...]


def lay_out(
    robot: RobotModel, program: Program, settings: CompensationSettings, state: ArmState
) -> Plan:
    """Returns the plan for consecutive targets of a program.

    Args:
        robot: The nominal arm.
        program: The targets.
        settings: Whether axis targets count.
        state: Whether there were targets before these, and the last words that name a branch;
            changed to what holds after them.

    Raises:
        ModelMismatchError: Axis targets of an arm with another number of joints.
    """
    n = len(program)
    route = np.where(program.motion == Motion.PTP, int(Route.FREE), int(Route.LINEAR))
    status = np.full(n, int(Status.COMPENSATED), dtype=np.int64)
    joints = np.full((n, 6), np.nan)
    axis = np.asarray(program.reason == Reason.JOINT_TARGET)
    blocked = np.asarray(program.reason != Reason.NONE) & ~axis
    blocked |= ~axis & ~_has_pose(program)
    lost = _axes_in_a_lost_frame(robot, program)
    miscounted = _note_miscounted(robot, program, np.flatnonzero(axis | lost))
    if miscounted:
        lost[:] = False
    else:
        _write_axis_joints(robot, program, np.flatnonzero(axis | lost), joints)
    stated = np.isfinite(joints[:, 0])
    blocked |= axis & ~stated
    route[stated] = int(Route.AXES if settings.axis_targets else Route.PASS)
    if not settings.axis_targets:
        status[stated] = Status.UNCHANGED_AXIS_TARGET
    route[blocked] = Route.SKIP
    route[lost & stated] = Route.PASS
    status[blocked] = Status.UNCHANGED_SOURCE
    before = np.array(state.words)
    by_words = _by_words(robot, program, route, bool(state.get("begun")), before)
    state.set("begun", state.get("begun") or (route != Route.SKIP).any())
    state.words[: len(by_words.last)] = by_words.last
    joints[by_words.rows] = by_words.joints
    route[by_words.rows] = Route.GIVEN
    known = np.where(np.isin(route, [Route.GIVEN, Route.PASS, Route.AXES]), 1, 0)
    known[by_words.changed] = -1
    if not len(settings.home):  # empty words do not undo the user's choice
        known[by_words.astray] = -1
    return Plan(
        route=route.astype(np.int64),
        status=status,
        joints=joints,
        worded=_with_words(robot, program, route, by_words.rows),
        known=known,
        notes=miscounted + by_words.notes,
    )


def _note_miscounted(robot: RobotModel, program: Program, rows: IntArray) -> tuple[RowNote, ...]:
    """Returns a note if axis targets are not this arm's joints.

    Fanuc's J3 is the angle of the forearm to the horizontal; it stays while J2 turns.
    """
    if program.words_of != "fanuc" or not len(rows):
        return ()
    if robot.controller.coupling.size or not np.array_equal(robot.joint_map, np.eye(robot.dof)):
        return ()
    text = (
        f"Fanuc counts J3 from the horizontal, {robot.name} counts it from the arm before it; "
        'axis targets are not used. State [robot] maker = "fanuc" in the cell.'
    )
    return (row_note(program, rows, text, rank=MISCOUNTED),)


def _has_pose(program: Program) -> BoolArray:
    known = _finite(program.position)
    known &= _finite(program.rotation)
    frames = np.asarray(np.isfinite(program.T_base_frame).all(axis=(1, 2)))
    tools = np.asarray(np.isfinite(program.T_flange_tool).all(axis=(1, 2)))
    for index, good in ((program.frame, frames), (program.tool, tools)):
        inside = np.asarray((index >= 0) & (index < len(good)))
        if inside.all() and good.all():
            continue
        known &= inside
        known[inside] &= good[index[inside]]
    return np.asarray(known)


def _finite(values: Array) -> BoolArray:
    """Returns (n,) whether all values of a row are finite; nearly always all of them are."""
    finite = np.isfinite(values)
    if finite.all():
        return np.ones(len(values), dtype=np.bool_)
    return np.asarray(finite.reshape(len(values), -1).all(axis=1))


def _write_axis_joints(robot: RobotModel, program: Program, rows: IntArray, joints: Array) -> None:
    """Writes the joints of axis targets whose tool is known."""
    if not len(rows):
        return
    axes = program.axes[rows]
    if axes.shape[1] != robot.dof:
        raise ModelMismatchError(
            f"axis targets with {axes.shape[1]} axes for {robot.name}, which has {robot.dof}.",
            source=program.name,
            line=int(program.line[rows[0]]),
        )
    whole = np.isfinite(axes).all(axis=1) & _tool_known(program, rows)
    joints[rows[whole]] = robot.controller.to_model(axes[whole])


def _axes_in_a_lost_frame(robot: RobotModel, program: Program) -> BoolArray:
    """Returns the axis targets whose tool a called routine may have changed: the arm goes there."""
    if program.axes.shape[1] != robot.dof:
        return np.zeros(len(program), np.bool_)
    lost = program.reason == Reason.UNKNOWN_FRAME
    return np.asarray(lost & np.isfinite(program.axes).all(axis=1))


def _tool_known(program: Program, rows: IntArray) -> BoolArray:
    index = program.tool[rows]
    inside = (index >= 0) & (index < len(program.T_flange_tool))
    tools = np.asarray(np.isfinite(program.T_flange_tool).all(axis=(1, 2)))
    return np.asarray(inside & tools[np.where(inside, index, 0)])


@dataclass(frozen=True, slots=True, kw_only=True)
class _WordChoice:
    """Configurations that the words of targets state.

    Attributes:
        last: (b,) those that name the branch, of the last target that has any.
        rows: (k,) targets whose joints they choose.
        joints: (k, 6) rad of those.
        astray: (m,) targets whose words lead to no solution.
        changed: (m,) targets with other words than those before, which cannot be interpreted.
        notes: Remarks for the user.
    """

    last: IntArray
    rows: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    joints: Array = field(default_factory=lambda: np.empty((0, 6)))
    astray: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    changed: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    notes: tuple[RowNote, ...] = ()


def _by_words(
    robot: RobotModel, program: Program, route: IntArray, under_way: bool, before: IntArray
) -> _WordChoice:
    """Returns the targets whose words choose the nominal joints, and those joints (k, 6) rad.

    Joint moves, and the first target when it is a straight one: straight moves keep the branch.
    Where the meaning of the words for this arm is not known, a joint move with other words than
    those before leads to an unknown configuration.
    """
    maker = program.words_of
    last = before[: branch_words(maker, program.words[:0]).shape[1]]
    asked = np.asarray(route == Route.FREE)
    if maker == "" or (maker == "kuka" and not asked.any()):
        return _WordChoice(last=last)
    spoken = (program.words != NO_WORD).any(axis=1)
    asked &= spoken
    begun = np.flatnonzero(route != Route.SKIP)
    if len(begun) and maker != "kuka" and not under_way:  # KUKA reads S and T of joint moves alone
        asked[begun[0]] |= bool(spoken[begun[0]] and route[begun[0]] == Route.LINEAR)
    rows = np.flatnonzero(asked)
    if not len(rows):
        return _WordChoice(last=last)
    told = np.concatenate([last[None], branch_words(maker, program.words[rows])])
    if robot.maker != maker or opw_geometry(robot) is None:
        other = np.asarray((told[1:] != told[:-1]).any(axis=1))
        first = np.asarray((told[:-1] == NO_WORD).all(axis=1))
        note = row_note(program, rows, _note_unused(robot, maker), rank=UNUSED)
        return _WordChoice(
            astray=rows[other & first], changed=rows[other & ~first], last=told[-1], notes=(note,)
        )
    joints, reached, fits = _fitting(robot, program, rows)
    # Words that leave the branch open choose nothing: the nearest to the target before does.
    good = fits == 1
    astray = rows[reached & (fits == 0)]
    notes: tuple[RowNote, ...] = ()
    if len(astray):
        text = (
            f"no solution has the {CALLED[maker]} written there; "
            "the solution nearest to the previous target was used."
        )
        notes = (row_note(program, astray, text, rank=ASTRAY),)
    return _WordChoice(
        rows=rows[good], joints=joints[good], astray=astray, last=told[-1], notes=notes
    )  # fmt: skip


def _fitting(
    robot: RobotModel, program: Program, rows: IntArray
) -> tuple[Array, BoolArray, IntArray]:
    """Returns joints (k, 6) rad that fit the words, whether any do, and the number of branches."""
    maker, wanted = program.words_of, program.words[rows]
    options = inverse_branches(robot, flange_poses(program, rows))
    reached = np.asarray(np.isfinite(options).all(axis=2))
    have = np.full((*options.shape[:2], program.words.shape[1]), NO_WORD)
    have[reached] = configuration_words(robot, maker, options[reached])
    fits = reached & branch_fits(maker, wanted, have)
    for branch in range(options.shape[1]):
        turned, good = on_turn(robot, maker, options[:, branch], wanted)
        options[:, branch] = turned
        fits[:, branch] &= good
    joints: Array = options[np.arange(len(rows)), np.argmax(fits, axis=1)]
    # A stretched wrist or arm gives the same joints twice: that is one branch.
    apart = np.abs(options - joints[:, None]).max(axis=2)
    count = (fits & ~(apart < _ALIKE)).sum(axis=1) + fits.any(axis=1)
    return joints, np.asarray(reached.any(axis=1)), count.astype(np.int64)


def _note_unused(robot: RobotModel, maker: Maker) -> str:
    """Returns the note on words that cannot be interpreted for this arm."""
    if robot.maker != maker:
        stated = "not stated" if robot.maker == "generic" else f"{robot.maker!r}"
        return (
            f"{CALLED[maker]} are not used: the maker of {robot.name} is {stated}. State [robot] "
            f'maker = "{maker}" in the cell it is calibrated with.'
        )
    return f"{CALLED[maker]} are not used: {robot.name} has no spherical wrist."


def flange_poses(program: Program, rows: IntArray) -> Array:
    """(k, 4, 4) flange in base of the chosen targets."""
    T_flange_tool = program.T_flange_tool[program.tool[rows]]
    T_frame_tool = pose(program.rotation[rows], program.position[rows])
    out: Array = program.T_base_frame[program.frame[rows]] @ T_frame_tool @ inverse(T_flange_tool)
    return out


def _with_words(robot: RobotModel, program: Program, route: IntArray, chosen: IntArray) -> IntArray:
    """Returns the targets whose words must stay true: KUKA's joint moves, all others of any."""
    maker = program.words_of
    if maker == "kuka" or robot.maker != maker or opw_geometry(robot) is None:
        return chosen
    spoken = (program.words != NO_WORD).any(axis=1)
    posed = np.isin(route, [Route.FREE, Route.LINEAR, Route.GIVEN])
    return np.flatnonzero(spoken & posed)


def new_words(
    robot: RobotModel, program: Program, rows: IntArray, joints: Array
) -> tuple[IntArray, tuple[RowNote, ...]]:
    """Returns the words (k, w) to print for compensated targets, and a note on those renewed.

    Args:
        robot: The nominal arm.
        program: The targets.
        rows: (k,) the targets concerned.
        joints: (k, 6) rad, commanded.
    """
    maker, written = program.words_of, program.words[rows]
    after = configuration_words(robot, maker, joints)
    before = np.array(written)
    doubtful = np.flatnonzero(((after != written) & (written != NO_WORD)).any(axis=1))
    if len(doubtful):
        flange = robot.with_tool(np.eye(4))
        nominal = inverse_batch(
            flange, flange_poses(program, rows[doubtful]), near=joints[doubtful]
        )
        known = np.isfinite(nominal).all(axis=1)
        before[doubtful[known]] = configuration_words(robot, maker, nominal[known])
    words = renew_words(maker, written, before, after)
    crossed = rows[(words != NO_WORD).any(axis=1)]
    notes: tuple[RowNote, ...] = ()
    if len(crossed):
        text = (
            "the correction moves an axis across the boundary of a configuration word; "
            f"{CALLED[maker]} were renewed."
        )
        notes = (row_note(program, crossed, text, rank=CROSSED),)
    return words, notes
