"""The loop over targets: nominal joints, inversion of the calibrated arm, guards, command."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robotrue.compensation.branches import closed_joints, deviation, iterated_joints
from robotrue.compensation.compiled import EXACT, compiled
from robotrue.compensation.kernels import (
    chain,
    invert6,
    jacobian,
    joint_torque,
    mix,
    mix_back,
    ripple,
    smooth,
    turn_sincos,
)
from robotrue.compensation.pack import Pack
from robotrue.compensation.scratch import Scratch
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, IntArray

SKIP, LINEAR, GIVEN = int(Route.SKIP), int(Route.LINEAR), int(Route.GIVEN)
PASS, AXES = int(Route.PASS), int(Route.AXES)
DONE, NO_ERROR = int(Status.COMPENSATED), int(Status.UNCHANGED_NO_ERROR)
UNREACHABLE, LIMIT = int(Status.UNCHANGED_UNREACHABLE), int(Status.UNCHANGED_JOINT_LIMIT)
SINGULAR, WRIST = int(Status.UNCHANGED_SINGULAR), int(Status.UNCHANGED_WRIST_SINGULAR)
JUMP, STEP = int(Status.UNCHANGED_BRANCH_JUMP), int(Status.UNCHANGED_STEP)
LOST = int(Status.UNCHANGED_NOT_CONVERGED)

ITERATIONS = 25
REUSE = 1e-6  # rad of joint motion below which the smooth residual is not evaluated again
STILL = 1e-7  # rad of joint motion that has no direction


class Guard(NamedTuple):
    """What a correction may be, SI; see ``CompensationSettings``."""

    tolerance: float
    turn_tolerance: float
    max_shift: float
    max_turn: float
    min_shift: float
    min_singular_value: float
    min_wrist_sine: float
    max_joint_step: float
    follow_approach: bool


class Rows(NamedTuple):
    """One chunk of a program. Positions in m in the target's own frame.

    Attributes:
        position: (n, 3), replaced by the command where compensated.
        rotation: (n, 9) likewise.
        joints: (n, 6) rad in: chosen joints where the route has them; out: commanded joints.
        route: (n,) :class:`Route`.
        frame: (n,) index into ``frames``.
        tool: (n,) index of the tool.
        frames: (f, 12) work frames in base.
        mass: (n or 1,) kg.
        com: (n or 1, 3) m.
        wrench: (n or 1, 6) N, N m.
        status: (n,) :class:`Status`, written where the route is not ``SKIP`` or ``PASS``.
        before: (n, 3) m, base: error without compensation.
        after: (n, 3) m, base: error with what is commanded now.
        shift: (n, 3) m, base, of the command.
        turn: (n,) rad, rotation of the command.
        nominal: (n, 6) rad, nominal joints of the target.
        approach: (n, 6) sign of the last motion of each joint.
        singular: (n,) smallest singular value, a lower bound within a factor 2.5.
    """

    position: Array
    rotation: Array
    joints: Array
    route: IntArray
    frame: IntArray
    tool: IntArray
    frames: Array
    mass: Array
    com: Array
    wrench: Array
    status: IntArray
    before: Array
    after: Array
    shift: Array
    turn: Array
    nominal: Array
    approach: Array
    singular: Array


class State(NamedTuple):
    """What one chunk hands to the next: where the arm is.

    Attributes:
        joints: (6,) rad of the target before.
        approach: (6,) sign of the last motion.
        branch: (4,) shoulder, elbow, flip of the target before (0 unknown), and 1 once the arm
            has been anywhere.
    """

    joints: Array
    approach: Array
    branch: IntArray


@compiled(EXACT)
def evaluate(
    p: Pack, w: Scratch, joints: Array, approach: Array, mass: float, wrench: Array, f: int
) -> None:
    """Writes the nominal pose ``told`` and the actual one without smooth part, ``real``.

    ``sine`` and ``cosine`` hold those of q, ``centre`` the payload's centre behind joint 6; the
    axes and origins of both chains are left behind.
    """
    if p.coupled:
        for i in range(6):
            w.shift[i] = joints[i]
        mix(p.coupling, w.shift)
        for i in range(6):
            w.theta_sine[i] = math.sin(w.shift[i] + p.zero[i])
            w.theta_cosine[i] = math.cos(w.shift[i] + p.zero[i])
    else:
        for i in range(6):
            s, c = w.sine[i], w.cosine[i]
            w.theta_sine[i] = s * p.zero_cosine[i] + c * p.zero_sine[i]
            w.theta_cosine[i] = c * p.zero_cosine[i] - s * p.zero_sine[i]
    chain(
        w.nominal, w.theta_sine, w.theta_cosine, True, p.com, w.centre, w.told_axis,
        w.told_origin, w.moment, w.payload, w.told,
    )  # fmt: skip
    joint_torque(
        w.told_axis, w.told_origin, w.moment, p.mass_out, p.gravity, mass, w.payload, wrench, f,
        w.told, w.shift,
    )  # fmt: skip
    if p.coupled:
        mix_back(p.coupling, w.shift)
    for i in range(6):
        w.shift[i] *= p.compliance[i]
        w.shift[i] += p.gear[i] * joints[i] + p.backlash[i] * approach[i]
    ripple(p, joints, w.sine, w.cosine, w.shift)
    if p.coupled:
        mix(p.coupling, w.shift)
    for i in range(6):
        w.shift[i] += p.dtheta[i]
    turn_sincos(w.theta_sine, w.theta_cosine, w.shift, w.bent_sine, w.bent_cosine)
    chain(
        w.actual, w.bent_sine, w.bent_cosine, False, p.com, w.centre, w.axis, w.origin,
        w.moment, w.payload, w.real,
    )  # fmt: skip


@compiled(EXACT)
def take_tool(p: Pack, w: Scratch, tool: int) -> None:
    """Puts a tool on both chains."""
    for k in range(12):
        w.nominal[6, k] = p.nominal_end[tool, k]
        w.actual[6, k] = p.actual_end[tool, k]


@compiled(EXACT)
def take_payload(p: Pack, w: Scratch, com: Array, c: int) -> None:
    """Writes the payload's centre in the frame turned by joint 6."""
    for i in range(3):
        total = p.flange[9 + i]
        for k in range(3):
            total += p.flange[3 * i + k] * com[c, k]
        w.centre[i] = total


@compiled(EXACT)
def invert_target(
    p: Pack, g: Guard, w: Scratch, axes_given: bool, start: Array, approach: Array,
    mass: float, wrench: Array, f: int, before: Array, after: Array, row: int,
) -> tuple[int, float]:  # fmt: skip
    """Writes the joints that put the actual tool on the target; status and singular value.

    Chord Newton: the Jacobian of the nominal posture serves until it no longer takes off nine
    tenths of the error. ``w.joints`` and the command ``w.told`` are the result.
    """
    for i in range(6):
        w.joints[i] = start[i]
        w.start_sine[i], w.start_cosine[i] = math.sin(start[i]), math.cos(start[i])
        w.step[i] = 0.0
    status, singular, size_before = LOST, np.nan, np.inf
    for iteration in range(ITERATIONS):
        turn_sincos(w.start_sine, w.start_cosine, w.step, w.sine, w.cosine)
        evaluate(p, w, w.joints, approach, mass, wrench, f)
        widest = 0.0
        for i in range(6):
            widest = max(widest, abs(w.step[i] - w.smooth_at[i]))
        if iteration == 0 or not widest <= REUSE:
            smooth(p, w.sine, w.cosine, w.bump_power, w.bump, w.smooth)
            for i in range(6):
                w.smooth_at[i] = w.step[i]
        for i in range(3):
            w.real[9 + i] += w.smooth[i]
        if iteration == 0 and axes_given:
            for i in range(12):
                w.target[i] = w.told[i]
        if iteration == 0:
            miss, twist = deviation(w.told, w.target, w.error)
            if not (miss < 1e-7 and twist < 1e-7):
                return UNREACHABLE, singular
        shift, turn = deviation(w.real, w.target, w.error)
        for i in range(3):
            after[row, i] = w.error[i]
            if iteration == 0:
                before[row, i] = w.error[i]
        size = shift + p.length * turn
        if iteration == 0 or size > 0.1 * size_before:
            jacobian(p, w.axis, w.origin, w.real, w.jacobian)
            if not invert6(w.jacobian, w.order, w.inverse):
                return SINGULAR, 0.0
            if iteration == 0:
                status, singular = _posture(g, w)
                if status != DONE:
                    return status, singular
                status = LOST
        if shift < g.tolerance and turn < g.turn_tolerance:
            return DONE, singular
        if not size < 1e3:
            return LOST, singular
        size_before = size
        scale = 1.0 / p.length
        for i in range(6):
            total = 0.0
            for k in range(3):
                total += w.inverse[i, k] * w.error[k] * scale
                total += w.inverse[i, k + 3] * w.error[k + 3]
            w.step[i] -= total
            w.joints[i] = start[i] + w.step[i]
    return status, singular


@compiled(EXACT)
def _posture(g: Guard, w: Scratch) -> tuple[int, float]:
    """Returns the status of the posture and a lower bound of the smallest singular value."""
    squares = 0.0
    for i in range(6):
        for k in range(6):
            squares += w.inverse[i, k] * w.inverse[i, k]
    singular = 1.0 / math.sqrt(squares)
    a = w.told_axis
    x = a[3, 1] * a[5, 2] - a[3, 2] * a[5, 1]
    y = a[3, 2] * a[5, 0] - a[3, 0] * a[5, 2]
    z = a[3, 0] * a[5, 1] - a[3, 1] * a[5, 0]
    if math.sqrt(x * x + y * y + z * z) < g.min_wrist_sine:
        return WRIST, singular
    return (SINGULAR if singular < g.min_singular_value else DONE), singular


@compiled(EXACT)
def solve_rows(p: Pack, g: Guard, r: Rows, state: State, w: Scratch, first: int) -> int:
    """Solves the rows from ``first`` on; returns the number of rows, or the row that needs help.

    A row of an arm without closed inverse that Newton did not reach from the target before is
    returned; the caller may set its route to ``GIVEN`` with joints, or mark it, and go on.
    """
    closed = p.opw[0] == p.opw[0]
    count = len(r.route)
    tool_before = -1
    for k in range(6):
        for i in range(12):
            w.nominal[k, i], w.actual[k, i] = p.nominal[k, i], p.actual[k, i]
    for i in range(first, count):
        route, tool = r.route[i], r.tool[i]
        if route == SKIP:
            continue
        been = state.branch[3] != 0
        if tool != tool_before:
            take_tool(p, w, tool)
            tool_before = tool
        if route != PASS and route != AXES:
            _from_frame(r.frames, r.frame[i], r.rotation, r.position, i, w.target)
        if route == GIVEN or route == PASS or route == AXES:
            for k in range(6):
                w.joints[k] = r.joints[i, k]
            state.branch[0] = 0
        elif closed:
            settle = route != LINEAR or not been
            if not closed_joints(
                p, tool, w.target, state.joints, settle, state.branch, w.theta, w.trial, w.hand,
                w.joints,
            ):  # fmt: skip
                r.status[i] = UNREACHABLE
                continue
        elif not iterated_joints(p, w, w.target, state.joints, w.joints):
            return i
        widest = 0.0
        for k in range(6):
            change = w.joints[k] - state.joints[k]
            widest = max(widest, abs(change))
            if not g.follow_approach or not been:
                state.approach[k] = 0.0
            elif abs(change) > STILL:
                state.approach[k] = 1.0 if change > 0.0 else -1.0
            state.joints[k] = w.joints[k]
            r.nominal[i, k] = w.joints[k]
            r.approach[i, k] = state.approach[k]
        state.branch[3] = 1
        if route == PASS:
            continue
        m = i if r.mass.shape[0] > 1 else 0
        f = i if r.wrench.shape[0] > 1 else 0
        take_payload(p, w, r.com, i if r.com.shape[0] > 1 else 0)
        status, singular = invert_target(
            p, g, w, route == AXES, state.joints, state.approach, r.mass[m], r.wrench, f,
            r.before, r.after, i,
        )  # fmt: skip
        r.singular[i] = singular
        turn = 0.0
        if status == DONE:
            status, turn = _command_status(p, g, w, state.joints)
        if route == LINEAR and been and widest > g.max_joint_step:
            status = JUMP
        r.status[i] = status
        done = status == DONE
        for k in range(6):
            r.joints[i, k] = w.joints[k] if done else state.joints[k]
        if not done:
            for k in range(3):
                r.after[i, k] = r.before[i, k]
            continue
        for k in range(3):
            r.shift[i, k] = w.error[k]
        r.turn[i] = turn
        if route != AXES:
            _into_frame(r.frames, r.frame[i], w.told, r.rotation, r.position, i)
    return count


@compiled(EXACT)
def _command_status(p: Pack, g: Guard, w: Scratch, nominal: Array) -> tuple[int, float]:
    """Returns what the guards say of a command, and its turn; its shift goes to ``w.error``."""
    shift, turn = deviation(w.told, w.target, w.error)
    if shift < g.min_shift and turn < g.min_shift:
        return NO_ERROR, turn
    if shift > g.max_shift or turn > g.max_turn:
        return STEP, turn
    for i in range(6):
        low, high = p.limits[i, 0], p.limits[i, 1]
        if not (low <= w.joints[i] <= high and low <= nominal[i] <= high):
            return LIMIT, turn
    return DONE, turn


@compiled(EXACT)
def _from_frame(
    frames: Array, f: int, rotation: Array, position: Array, row: int, out: Array
) -> None:
    """Writes a pose in a work frame as a base pose (12,)."""
    for i in range(3):
        a, b, c = frames[f, 3 * i], frames[f, 3 * i + 1], frames[f, 3 * i + 2]
        for j in range(3):
            out[3 * i + j] = (
                a * rotation[row, j] + b * rotation[row, 3 + j] + c * rotation[row, 6 + j]
            )
        out[9 + i] = (
            frames[f, 9 + i] + a * position[row, 0] + b * position[row, 1] + c * position[row, 2]
        )


@compiled(EXACT)
def _into_frame(
    frames: Array, f: int, pose: Array, rotation: Array, position: Array, row: int
) -> None:
    """Writes a base pose (12,) in work frame coordinates."""
    x, y, z = pose[9] - frames[f, 9], pose[10] - frames[f, 10], pose[11] - frames[f, 11]
    for i in range(3):
        a, b, c = frames[f, i], frames[f, 3 + i], frames[f, 6 + i]
        for j in range(3):
            rotation[row, 3 * i + j] = a * pose[j] + b * pose[3 + j] + c * pose[6 + j]
        position[row, i] = a * x + b * y + c * z
