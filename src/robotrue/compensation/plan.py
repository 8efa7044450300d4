"""How each target of a program is to be treated, decided before any number is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.compensation.result import line_list
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import inverse, pose
from robotrue.errors import ModelMismatchError
from robotrue.program.program import Motion, Program, Reason
from robotrue.robot.configuration import EDGE, kuka_status_turn
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry

SHAPE_BITS = 7  # KUKA S: shoulder, elbow, wrist; bit 3 says how the point was taught


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Treatment of n targets.

    Attributes:
        route: (n,) :class:`Route`.
        status: (n,) :class:`Status` of those not to be touched, ``COMPENSATED`` for the rest.
        rows: (m,) targets whose joints are known beforehand.
        joints: (m, 6) rad of those, model's sense.
        worded: (k,) targets whose configuration words are to be renewed.
        notes: What the user should know.
    """

    route: IntArray
    status: IntArray
    rows: IntArray
    joints: Array
    worded: IntArray
    notes: tuple[str, ...]


def lay_out(robot: RobotModel, program: Program, settings: CompensationSettings) -> Plan:
    """Returns the plan for a program.

    Args:
        robot: The nominal arm.
        program: The targets.
        settings: Whether axis targets count.

    Raises:
        ModelMismatchError: Axis targets of an arm with another number of joints.
    """
    n = len(program)
    route = np.where(program.motion == Motion.PTP, int(Route.FREE), int(Route.LINEAR))
    status = np.full(n, int(Status.COMPENSATED), dtype=np.int64)
    axis = np.asarray(program.reason == Reason.JOINT_TARGET)
    blocked = np.asarray(program.reason != Reason.NONE) & ~axis
    blocked |= ~axis & ~_has_pose(program)
    joints_known = np.flatnonzero(axis)
    joints = np.empty((0, 6))
    if len(joints_known):
        joints, joints_known = _axis_joints(robot, program, joints_known)
        blocked |= axis & ~np.isin(np.arange(n), joints_known)
        route[joints_known] = int(Route.AXES if settings.axis_targets else Route.PASS)
        if not settings.axis_targets:
            status[joints_known] = Status.UNCHANGED_AXIS_TARGET
    route[blocked] = Route.SKIP
    status[blocked] = Status.UNCHANGED_SOURCE
    worded, chosen, notes = _by_words(robot, program, route)
    route[worded] = Route.GIVEN
    rows = np.concatenate([joints_known, worded])
    order = np.argsort(rows, kind="stable")
    return Plan(
        route=route.astype(np.int64),
        status=status,
        rows=rows[order],
        joints=np.concatenate([joints, chosen])[order],
        worded=worded,
        notes=notes,
    )


def _has_pose(program: Program) -> BoolArray:
    known = np.isfinite(program.position).all(axis=1)
    known &= np.isfinite(program.rotation).all(axis=(1, 2))
    frames = np.asarray(np.isfinite(program.T_base_frame).all(axis=(1, 2)))
    tools = np.asarray(np.isfinite(program.T_flange_tool).all(axis=(1, 2)))
    for index, good in ((program.frame, frames), (program.tool, tools)):
        inside = np.asarray((index >= 0) & (index < len(good)))
        known &= inside
        known[inside] &= good[index[inside]]
    return np.asarray(known)


def _axis_joints(robot: RobotModel, program: Program, rows: IntArray) -> tuple[Array, IntArray]:
    axes = program.axes[rows]
    if axes.shape[1] != robot.dof or robot.controller is None:
        raise ModelMismatchError(
            f"axis targets with {axes.shape[1]} axes for {robot.name}, which has {robot.dof}.",
            source=program.name,
            line=int(program.line[rows[0]]),
        )
    whole = np.isfinite(axes).all(axis=1) & _tool_known(program, rows)
    return robot.controller.to_model(axes[whole]), rows[whole]


def _tool_known(program: Program, rows: IntArray) -> BoolArray:
    index = program.tool[rows]
    inside = (index >= 0) & (index < len(program.T_flange_tool))
    tools = np.asarray(np.isfinite(program.T_flange_tool).all(axis=(1, 2)))
    return np.asarray(inside & tools[np.where(inside, index, 0)])


def _by_words(
    robot: RobotModel, program: Program, route: IntArray
) -> tuple[IntArray, Array, tuple[str, ...]]:
    """Returns the joint-move targets whose S and T choose the nominal joints, and those joints."""
    rows = np.flatnonzero((route == Route.FREE) & (program.status >= 0))
    nothing = np.empty(0, dtype=np.int64), np.empty((0, 6)), ()
    if robot.maker != "kuka" or not len(rows):
        return nothing
    geometry = opw_geometry(robot)
    if geometry is None:
        return nothing
    T_flange_tool = program.T_flange_tool[program.tool[rows]]
    T_frame_tool = pose(program.rotation[rows], program.position[rows])
    T_base_flange = (
        program.T_base_frame[program.frame[rows]] @ T_frame_tool @ inverse(T_flange_tool)
    )
    options = inverse_branches(robot, T_base_flange, geometry=geometry)
    reached = np.asarray(np.isfinite(options).all(axis=2))
    words = np.full(options.shape[:2], -1)
    words[reached], _ = kuka_status_turn(robot, options[reached])
    fits = np.asarray(reached & ((words & SHAPE_BITS) == (program.status[rows, None] & SHAPE_BITS)))
    found = fits.any(axis=1)
    joints = options[np.arange(len(rows)), np.argmax(fits, axis=1)]
    joints, turned = _on_turn(robot, joints, program.turn[rows])
    notes: tuple[str, ...] = ()
    astray = rows[reached.any(axis=1) & ~(found & turned)]
    if len(astray):
        notes = (
            f"{line_list(program, astray)}: no solution has the S and T written there; "
            "the nearest to the target before was taken.",
        )
    good = found & turned
    return rows[good], joints[good], notes


def _on_turn(robot: RobotModel, joints: Array, turn: IntArray) -> tuple[Array, BoolArray]:
    """Returns joints on the turn with the signs of the T word, and whether one is in limits."""
    out = np.array(joints)
    good = np.ones(len(joints), dtype=np.bool_)
    if robot.controller is None:
        return out, good
    for i in range(6):
        best = np.full(len(joints), np.inf)
        for k in (0, -1, 1):
            q = joints[:, i] + 2.0 * np.pi * k
            axis = robot.controller.sign[i] * q + robot.controller.offset[i]
            allowed = (turn < 0) | ((axis < 0.0) == ((turn >> i) & 1 == 1)) | (np.abs(axis) < EDGE)
            allowed &= (q >= robot.limits[i, 0] - 1e-9) & (q <= robot.limits[i, 1] + 1e-9)
            better = allowed & (np.abs(axis) < best)
            out[better, i] = q[better]
            best[better] = np.abs(axis)[better]
        good &= np.isfinite(best)
    return out, good


def new_words(
    robot: RobotModel, program: Program, rows: IntArray, joints: Array
) -> tuple[IntArray, IntArray, tuple[str, ...]]:
    """Returns S and T (k,) to print for compensated targets, -1 where they stay, and a warning.

    Args:
        robot: The nominal arm.
        program: The targets.
        rows: (k,) the targets concerned.
        joints: (k, 6) rad, commanded.
    """
    shape, signs = kuka_status_turn(robot, joints)
    old_shape, old_turn = program.status[rows], program.turn[rows]
    status = (shape & SHAPE_BITS) | (old_shape & ~SHAPE_BITS)
    status = np.where(status == old_shape, -1, status).astype(np.int64)
    turn = np.where((old_turn < 0) | (signs == old_turn), -1, signs).astype(np.int64)
    crossed = rows[turn >= 0]
    notes: tuple[str, ...] = ()
    if len(crossed):
        notes = (
            f"{line_list(program, crossed)}: an axis crosses zero with the correction; "
            "the turn word was renewed.",
        )
    return status, turn, notes
