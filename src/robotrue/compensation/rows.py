"""Kernels that go through the rows of a chunk: into base, motion between targets, the command."""

from __future__ import annotations

import math

from robotrue.compensation.compiled import EXACT, compiled
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, BoolArray, IntArray

SKIP, LINEAR, PASS, AXES = (
    int(Route.SKIP), int(Route.LINEAR), int(Route.PASS), int(Route.AXES),
)  # fmt: skip
DONE, NO_ERROR = int(Status.COMPENSATED), int(Status.UNCHANGED_NO_ERROR)
LIMIT, JUMP = int(Status.UNCHANGED_JOINT_LIMIT), int(Status.UNCHANGED_BRANCH_JUMP)
STEP = int(Status.UNCHANGED_STEP)
STILL = 1e-7  # rad of joint motion that has no direction


@compiled(EXACT, borrows=True)
def enter_base(
    frames: Array, frame: IntArray, route: IntArray, rotation: Array, position: Array, out: Array
) -> None:
    """Writes the targets (n, 12) in base: rotation row by row, position in m."""
    for r in range(len(route)):
        if route[r] == SKIP or route[r] == PASS or route[r] == AXES:
            continue
        f = frame[r]
        for i in range(3):
            a, b, c = frames[f, 3 * i], frames[f, 3 * i + 1], frames[f, 3 * i + 2]
            for j in range(3):
                out[r, 3 * i + j] = (
                    a * rotation[r, j] + b * rotation[r, 3 + j] + c * rotation[r, 6 + j]
                )
            out[r, 9 + i] = (
                frames[f, 9 + i] + a * position[r, 0] + b * position[r, 1] + c * position[r, 2]
            )


@compiled(EXACT, borrows=True)
def follow(
    nominal: Array, route: IntArray, been: bool, follow_approach: bool, max_joint_step: float,
    joints: Array, sign: Array, approach: Array, jump: BoolArray,
) -> None:  # fmt: skip
    """Writes the sign of the last motion of every joint, and where a straight move jumps.

    Args:
        nominal: (n, 6) rad, NaN where the arm does not go.
        route: (n,) :class:`Route`.
        been: The arm has been somewhere before the chunk.
        follow_approach: Otherwise every sign is 0, unknown.
        max_joint_step: rad.
        joints: (6,) rad before the chunk; renewed.
        sign: (6,) of the last motion; renewed.
        approach: (n, 6), written.
        jump: (n,), written.
    """
    for r in range(len(route)):
        if route[r] == SKIP or not nominal[r, 0] == nominal[r, 0]:
            continue
        widest = 0.0
        for k in range(6):
            change = nominal[r, k] - joints[k]
            widest = max(widest, abs(change))
            if not follow_approach or not been:
                sign[k] = 0.0
            elif abs(change) > STILL:
                sign[k] = 1.0 if change > 0.0 else -1.0
            joints[k] = nominal[r, k]
            approach[r, k] = sign[k]
        jump[r] = route[r] == LINEAR and been and widest > max_joint_step
        been = True


@compiled(EXACT, borrows=True)
def command(
    limits: Array, bounds: Array, frames: Array, frame: IntArray, route: IntArray, rows: IntArray,
    jump: BoolArray, code: IntArray, target: Array, nominal: Array, found: Array, told: Array,
    before: Array, status: IntArray, joints: Array, after: Array, shift: Array, turn: Array,
    rotation: Array, position: Array,
) -> None:  # fmt: skip
    """Writes what becomes of the rows that were inverted: status, and the command where done.

    Args:
        limits: (6, 2) rad.
        bounds: (3,) least correction in m and rad, largest shift in m, largest turn in rad.
        frames: (f, 12) work frames in base.
        frame: (n,) index of the frame.
        route: (n,) :class:`Route`.
        rows: (k,) the rows concerned.
        jump: (n,) a straight move that jumps.
        code: (n,) :class:`Status` of the inversion.
        target: (n, 12) in base.
        nominal: (n, 6) rad.
        found: (n, 6) rad, joints of the command.
        told: (n, 12) the command in base.
        before: (n, 3) m.
        status: (n,) written.
        joints: (n, 6) rad, written.
        after: (n, 3) m, put back to ``before`` where nothing is commanded.
        shift: (n, 3) m, written where done.
        turn: (n,) rad, likewise.
        rotation: (n, 9) in the frame, likewise.
        position: (n, 3) m, likewise.
    """
    for r in rows:
        moved, turned, state = 0.0, 0.0, code[r]
        if state == DONE:
            moved, turned = _distance(told, target, r)
            if moved < bounds[0] and turned < bounds[0]:
                state = NO_ERROR
            elif moved > bounds[1] or turned > bounds[2]:
                state = STEP
            else:
                for k in range(6):
                    low, high = limits[k, 0], limits[k, 1]
                    if not (low <= found[r, k] <= high and low <= nominal[r, k] <= high):
                        state = LIMIT
        if jump[r]:
            state = JUMP
        status[r] = state
        for k in range(6):
            joints[r, k] = found[r, k] if state == DONE else nominal[r, k]
        if state != DONE:
            for k in range(3):
                after[r, k] = before[r, k]
            continue
        for k in range(3):
            shift[r, k] = told[r, 9 + k] - target[r, 9 + k]
        turn[r] = turned
        if route[r] != AXES:
            _into_frame(frames, frame[r], told, r, rotation, position)


@compiled(EXACT, borrows=True)
def _distance(told: Array, target: Array, r: int) -> tuple[float, float]:
    """Returns m and rad between two poses."""
    shift = turn = trace = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        d = told[r, 9 + i] - target[r, 9 + i]
        e = 0.0
        for c in range(3):
            e += told[r, 3 * k + c] * target[r, 3 * j + c]
            e -= told[r, 3 * j + c] * target[r, 3 * k + c]
            trace += told[r, 3 * i + c] * target[r, 3 * i + c]
        shift += d * d
        turn += e * e
    turn = 0.5 * math.sqrt(turn)
    if trace < 1.0:  # more than a quarter turn
        turn = math.atan2(turn, 0.5 * (trace - 1.0))
    return math.sqrt(shift), turn


@compiled(EXACT, borrows=True)
def _into_frame(
    frames: Array, f: int, pose: Array, r: int, rotation: Array, position: Array
) -> None:
    """Writes row ``r`` of base poses in work frame coordinates."""
    x, y, z = pose[r, 9] - frames[f, 9], pose[r, 10] - frames[f, 10], pose[r, 11] - frames[f, 11]
    for i in range(3):
        a, b, c = frames[f, i], frames[f, 3 + i], frames[f, 6 + i]
        for j in range(3):
            rotation[r, 3 * i + j] = a * pose[r, j] + b * pose[r, 3 + j] + c * pose[r, 6 + j]
        position[r, i] = a * x + b * y + c * z
