"""The loop over targets: nominal joints, inversion of the calibrated arm, guards, command."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robotrue.compensation.branches import closed_joints, deviation, iterated_joints, place
from robotrue.compensation.compiled import EXACT, compiled
from robotrue.compensation.kernels import (
    chain,
    invert6,
    jacobian,
    joint_torque,
    mix,
    ripple,
    smooth,
    turn_sincos,
)
from robotrue.compensation.pack import Pack
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


class Work(NamedTuple):
    """Scratch memory of one target."""

    sines: Array  # (10, 6)
    poses: Array  # (5, 12)
    axes: Array  # (5, 6, 3)
    matrices: Array  # (3, 6, 6)
    small: Array  # (8, 18)
    clenshaw: Array  # (3, 12)
    bumps: Array  # (2, m)
    bump: Array  # (3,)
    last: Array  # (3,)


@compiled(EXACT)
def evaluate(
    p: Pack, w: Work, tool: int, joints: Array, approach: Array,
    mass: float, com: Array, wrench: Array,
) -> None:  # fmt: skip
    """Writes the nominal pose (``poses[0]``) and the actual one without smooth part (``poses[1]``).

    ``sines[0]`` and ``sines[1]`` hold sin q and cos q on entry; ``axes[0], axes[1]`` hold the
    actual joint axes and origins on return, ``axes[2], axes[3]`` the nominal ones.
    """
    sine, cosine, shift = w.sines[2], w.sines[3], w.sines[4]
    if p.coupled:
        for i in range(6):
            shift[i] = joints[i]
        mix(p.coupling, shift)
        for i in range(6):
            sine[i], cosine[i] = math.sin(shift[i] + p.zero[i]), math.cos(shift[i] + p.zero[i])
    else:
        for i in range(6):
            s, c = w.sines[0, i], w.sines[1, i]
            sine[i] = s * p.zero_cosine[i] + c * p.zero_sine[i]
            cosine[i] = c * p.zero_cosine[i] - s * p.zero_sine[i]
    flange = w.last
    chain(
        p.nominal, p.nominal_end[tool], sine, cosine, p.com, w.axes[2], w.axes[3], w.axes[4],
        flange_of(p, com, w.bump), flange, w.poses[0],
    )  # fmt: skip
    joint_torque(
        w.axes[2], w.axes[3], w.axes[4], p.mass_out, p.gravity, mass, flange, wrench,
        w.poses[0], shift,
    )  # fmt: skip
    if p.coupled:
        mix(p.coupling.T, shift)
    for i in range(6):
        shift[i] = p.compliance[i] * shift[i] + p.gear[i] * joints[i] + p.backlash[i] * approach[i]
    ripple(p, joints, w.sines[0], w.sines[1], w.clenshaw, shift)
    if p.coupled:
        mix(p.coupling, shift)
    for i in range(6):
        shift[i] += p.dtheta[i]
    turn_sincos(sine, cosine, shift, w.sines[5], w.sines[6])
    chain(
        p.actual, p.actual_end[tool], w.sines[5], w.sines[6], p.com[:0], w.axes[0], w.axes[1],
        w.axes[4], flange, flange, w.poses[1],
    )  # fmt: skip


@compiled(EXACT)
def flange_of(p: Pack, com: Array, out: Array) -> Array:
    """Returns the payload's centre (3,) m in the frame turned by joint 6, written to ``out``."""
    f = p.flange
    for i in range(3):
        out[i] = f[9 + i] + f[3 * i] * com[0] + f[3 * i + 1] * com[1] + f[3 * i + 2] * com[2]
    return out


@compiled(EXACT)
def invert_target(
    p: Pack, g: Guard, w: Work, tool: int, target: Array, axes_given: bool, start: Array,
    approach: Array, mass: float, com: Array, wrench: Array, out: Array, before: Array,
    after: Array,
) -> tuple[int, float]:  # fmt: skip
    """Writes the joints that put the actual tool on the target; status and singular value.

    Chord Newton: the Jacobian of the nominal posture serves until it no longer takes off nine
    tenths of the error. ``w.poses[0]`` is the command on return, ``w.poses[2]`` the target.
    """
    step, moved = w.sines[7], w.sines[8]
    base_sine, base_cosine = w.small[6, :6], w.small[7, :6]
    error, offset = w.small[0, :6], w.small[1, :3]
    for i in range(6):
        out[i] = start[i]
        base_sine[i], base_cosine[i] = math.sin(start[i]), math.cos(start[i])
        step[i] = 0.0
        moved[i] = np.inf
    status, singular, size_before = LOST, np.nan, np.inf
    for iteration in range(ITERATIONS):
        turn_sincos(base_sine, base_cosine, step, w.sines[0], w.sines[1])
        evaluate(p, w, tool, out, approach, mass, com, wrench)
        widest = 0.0
        for i in range(6):
            widest = max(widest, abs(step[i] - moved[i]))
        if widest > REUSE or not widest == widest:
            smooth(p, w.sines[0], w.sines[1], w.bumps, offset)
            for i in range(6):
                moved[i] = step[i]
        for i in range(3):
            w.poses[1, 9 + i] += offset[i]
        if iteration == 0 and axes_given:
            target[:] = w.poses[0]
        shift, turn = deviation(w.poses[1], target, error)
        for i in range(3):
            after[i] = error[i]
        if iteration == 0:
            for i in range(3):
                before[i] = error[i]
            miss, twist = deviation(w.poses[0], target, w.sines[9])
            if not (miss < 1e-7 and twist < 1e-7):
                return UNREACHABLE, singular
        size = shift + p.length * turn
        if iteration == 0 or size > 0.1 * size_before:
            jacobian(p, w.axes[0], w.axes[1], w.poses[1], w.matrices[0])
            if not invert6(w.matrices[0], w.matrices[1], w.matrices[2]):
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
        for i in range(6):
            total = 0.0
            for k in range(3):
                total += w.matrices[2, i, k] * error[k] / p.length
                total += w.matrices[2, i, k + 3] * error[k + 3]
            step[i] -= total
            out[i] = start[i] + step[i]
    return status, singular


@compiled(EXACT)
def _posture(g: Guard, w: Work) -> tuple[int, float]:
    """Returns the status of the posture and a lower bound of the smallest singular value."""
    squares = 0.0
    for i in range(6):
        for k in range(6):
            squares += w.matrices[2, i, k] * w.matrices[2, i, k]
    singular = 1.0 / math.sqrt(squares)
    a, b = w.axes[2, 3], w.axes[2, 5]
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    if math.sqrt(x * x + y * y + z * z) < g.min_wrist_sine:
        return WRIST, singular
    return (SINGULAR if singular < g.min_singular_value else DONE), singular


@compiled(EXACT)
def solve_rows(p: Pack, g: Guard, r: Rows, state: State, w: Work, first: int) -> int:
    """Solves the rows from ``first`` on; returns the number of rows, or the row that needs help.

    A row of an arm without closed inverse that Newton did not reach from the target before is
    returned; the caller may set its route to ``GIVEN`` with joints, or mark it, and go on.
    """
    closed = p.opw[0] == p.opw[0]
    target, command, back = w.poses[2], w.poses[3], w.poses[4]
    joints = w.small[5, :6]
    count = len(r.route)
    for i in range(first, count):
        route = r.route[i]
        if route == SKIP:
            continue
        tool = r.tool[i]
        chosen = route == GIVEN or route == PASS or route == AXES
        been = state.branch[3] != 0
        frame = r.frames[r.frame[i]]
        if route != PASS and route != AXES:
            back[:9] = r.rotation[i]
            back[9:] = r.position[i]
            place(frame, back, target)
        if chosen:
            joints[:] = r.joints[i]
            state.branch[0] = 0
        elif closed:
            settle = route != LINEAR or not been
            if not closed_joints(
                p, tool, target, state.joints, settle, state.branch, w.sines[0], w.sines[1],
                command, joints,
            ):  # fmt: skip
                r.status[i] = UNREACHABLE
                continue
        elif not iterated_joints(p, tool, target, state.joints, w.small, w.matrices, joints):
            return i
        widest = 0.0
        for k in range(6):
            change = joints[k] - state.joints[k]
            widest = max(widest, abs(change))
            if not g.follow_approach or not been:
                state.approach[k] = 0.0
            elif abs(change) > STILL:
                state.approach[k] = 1.0 if change > 0.0 else -1.0
            state.joints[k] = joints[k]
            r.nominal[i, k] = joints[k]
            r.approach[i, k] = state.approach[k]
        state.branch[3] = 1
        if route == PASS:
            continue
        m = i if r.mass.shape[0] > 1 else 0
        c = i if r.com.shape[0] > 1 else 0
        f = i if r.wrench.shape[0] > 1 else 0
        status, singular = invert_target(
            p, g, w, tool, target, route == AXES, state.joints, state.approach, r.mass[m],
            r.com[c], r.wrench[f], joints, r.before[i], r.after[i],
        )  # fmt: skip
        r.singular[i] = singular
        shift, turned = w.sines[9], 0.0
        if status == DONE:
            status, turned = _command_status(p, g, w, target, joints, state.joints)
        if route == LINEAR and been and widest > g.max_joint_step:
            status = JUMP
        r.status[i] = status
        if status != DONE:
            r.after[i] = r.before[i]
            r.joints[i] = state.joints
            continue
        r.joints[i] = joints
        r.shift[i] = shift[:3]
        r.turn[i] = turned
        if route != AXES:
            _into_frame(frame, w.poses[0], r.rotation[i], r.position[i])
    return count


@compiled(EXACT)
def _command_status(
    p: Pack, g: Guard, w: Work, target: Array, joints: Array, nominal: Array
) -> tuple[int, float]:
    """Returns what the guards say of a command, and its turn; its shift goes to ``sines[9]``."""
    shift, turn = deviation(w.poses[0], target, w.sines[9])
    if shift < g.min_shift and turn < g.min_shift:
        return NO_ERROR, turn
    if shift > g.max_shift or turn > g.max_turn:
        return STEP, turn
    for i in range(6):
        low, high = p.limits[i, 0], p.limits[i, 1]
        if not (low <= joints[i] <= high and low <= nominal[i] <= high):
            return LIMIT, turn
    return DONE, turn


@compiled(EXACT)
def _into_frame(frame: Array, pose: Array, rotation: Array, position: Array) -> None:
    """Writes a base pose (12,) in frame coordinates."""
    for i in range(3):
        a, b, c = frame[i], frame[3 + i], frame[6 + i]
        for j in range(3):
            rotation[3 * i + j] = a * pose[j] + b * pose[3 + j] + c * pose[6 + j]
        x, y, z = pose[9] - frame[9], pose[10] - frame[10], pose[11] - frame[11]
        position[i] = a * x + b * y + c * z


def scratch(p: Pack) -> Work:
    """Returns scratch memory for one thread."""
    return Work(
        sines=np.zeros((10, 6)),
        poses=np.zeros((5, 12)),
        axes=np.zeros((5, 6, 3)),
        matrices=np.zeros((3, 6, 6)),
        small=np.zeros((8, 18)),
        clenshaw=np.zeros((3, 12)),
        bumps=np.zeros((2, p.centre_bias.shape[0])),
        bump=np.zeros(3),
        last=np.zeros(3),
    )
