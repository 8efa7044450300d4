"""Inversion of the calibrated arm, one target after the other, and the guards on its command.

Newton from the nominal joints. The Jacobian is renewed wherever a step takes off less than nine
tenths of the error; nearly always the first serves for all steps.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.calibrated_arm import CalibratedArm, Chunk, InversionLimits, Outcome
from robotrue.compensation.deflection_kernels import locate
from robotrue.compensation.nominal_kernels import write_drive_jacobian, write_step
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.robot.chain import ORIGIN, Record, X, Y, Z
from robotrue.robot.chain_kernels import deviation, invert_matrix, write_jacobian

AXES = int(Route.AXES)
DONE, NO_ERROR = int(Status.COMPENSATED), int(Status.UNCHANGED_NO_ERROR)
UNREACHABLE = int(Status.UNCHANGED_UNREACHABLE)
NOT_CONVERGED = int(Status.UNCHANGED_NOT_CONVERGED)
SINGULAR, WRIST = int(Status.UNCHANGED_SINGULAR), int(Status.UNCHANGED_WRIST_SINGULAR)
LIMIT, JUMP = int(Status.UNCHANGED_JOINT_LIMIT), int(Status.UNCHANGED_BRANCH_JUMP)
STEP = int(Status.UNCHANGED_STEP)
ITERATIONS = 25
SLOW = 0.1
"""Part of the error that a step may leave before the Jacobian is renewed."""
REACHED = 1e-7
"""m and rad by which the nominal arm may miss a target that it reaches."""
LOST = 1e3
"""Error beyond which no step leads back."""


@compile_kernel(EXACT)
def invert_targets(
    model: CalibratedArm,
    chunk: Chunk,
    limits: InversionLimits,
    rows: IntArray,
    bump: Array,
    work: Record,
    outcome: Outcome,
) -> None:
    """Inverts the arm for targets of a chunk, and writes their status and commands.

    Args:
        model: ``CalibratedArm``.
        chunk: ``Chunk``; its targets are written where axes are given.
        limits: ``InversionLimits``.
        rows: (k,) the targets.
        bump: (2, m) work space, two numbers per centre of the smooth residual.
        work: (1,) of ``WORK_DTYPE``.
        outcome: ``Outcome`` of the chunk, written.
    """
    w = work[0]
    for n in rows:
        arm = model.arms[chunk.tool[n]]
        _read_target(arm, chunk, n, w)
        locate(model, arm, limits.reuse, bump, w)
        if chunk.route[n] == AXES:
            for r in range(3):
                for k in range(4):
                    w.target[r, k] = chunk.target[n, r, k] = w.nominal.frame[6, r, k]
        status = UNREACHABLE
        shift, turn = deviation(w.nominal.frame[6], w.target, w.error)
        if shift < REACHED and turn < REACHED:
            status = _invert(model, arm, limits, bump, w)
            outcome.singular[n] = w.singular
            for r in range(3):
                outcome.before[n, r], outcome.after[n, r] = w.before[r], w.error[r]
        write_command(
            arm, chunk, limits, n, status, w.joints, w.nominal.frame[6], w.target, w.error, outcome
        )  # fmt: skip


@compile_kernel(EXACT)
def predict_errors(
    model: CalibratedArm, chunk: Chunk, rows: IntArray, bump: Array, work: Record, error: Array
) -> None:
    """Writes actual minus nominal position (k, 3) m at the nominal joints of some targets."""
    w = work[0]
    for k in range(len(rows)):
        arm = model.arms[chunk.tool[rows[k]]]
        _read_target(arm, chunk, rows[k], w)
        locate(model, arm, 0.0, bump, w)
        for r in range(3):
            error[k, r] = w.actual.frame[6, r, ORIGIN] - w.nominal.frame[6, r, ORIGIN]


@compile_kernel(EXACT)
def _read_target(arm: Record, chunk: Chunk, n: int, w: Record) -> None:
    """Writes a target with its joints and its load into the working memory."""
    for r in range(3):
        for k in range(4):
            w.target[r, k] = chunk.target[n, r, k]
    wrench = chunk.wrench[n if len(chunk.wrench) > 1 else 0]
    com = chunk.com[n if len(chunk.com) > 1 else 0]
    mass = chunk.mass[n if len(chunk.mass) > 1 else 0]
    for k in range(6):
        w.joints[k], w.approach[k] = chunk.nominal[n, k], chunk.approach[n, k]
        w.wrench[k], w.residual_at[k] = wrench[k], np.inf
    for r in range(3):
        centre = arm.flange[r, ORIGIN]
        for k in range(3):
            centre += arm.flange[r, k] * com[k]
        w.payload[r] = mass * centre
    w.payload[3] = mass


@compile_kernel(EXACT)
def _invert(
    model: CalibratedArm, arm: Record, limits: InversionLimits, bump: Array, w: Record
) -> int:
    """Moves ``joints`` until the actual tool is on the target; returns DONE or why it is not.

    Writes ``before`` m, ``singular`` and ``error``: what the nominal joints and what the joints
    found leave.
    """
    shift, turn = deviation(w.actual.frame[6], w.target, w.error)
    for r in range(3):
        w.before[r] = w.error[r]
    w.singular = 0.0
    if not _renew_inverse(arm, w):
        return SINGULAR
    squared = 0.0
    for i in range(6):
        for k in range(6):
            squared += w.inverse[i, k] * w.inverse[i, k]
    w.singular = 1.0 / math.sqrt(squared)
    if _wrist_sine(w.nominal.frame) < limits.min_wrist_sine:
        return WRIST
    if w.singular < limits.min_singular_value:
        return SINGULAR
    for _ in range(ITERATIONS):
        if shift < limits.tolerance and turn < limits.turn_tolerance:
            return DONE
        size = shift + arm.length * turn
        if not size < LOST:
            return NOT_CONVERGED
        write_step(arm, w)
        for i in range(6):
            w.joints[i] -= w.step[i]
        locate(model, arm, limits.reuse, bump, w)
        shift, turn = deviation(w.actual.frame[6], w.target, w.error)
        if shift + arm.length * turn > SLOW * size and not _renew_inverse(arm, w):
            return SINGULAR
    return NOT_CONVERGED


@compile_kernel(EXACT)
def _renew_inverse(arm: Record, w: Record) -> bool:
    """Writes the inverse Jacobian of the actual arm at the joints; False if it is singular."""
    write_jacobian(w.actual)
    write_drive_jacobian(arm, w.actual.jacobian, w)
    for i in range(6):
        for r in range(6):
            w.jacobian[r, i] *= 1.0 + arm.gear[i]
    return invert_matrix(w.jacobian, w.pivot, w.inverse)


@compile_kernel(EXACT)
def _wrist_sine(frame: Array) -> float:
    """Returns the sine between axes 4 and 6."""
    squared = 0.0
    for r in range(3):
        u, v = (r + 1) % 3, (r + 2) % 3
        across = frame[3, u, Z] * frame[5, v, Z] - frame[3, v, Z] * frame[5, u, Z]
        squared += across * across
    return math.sqrt(squared)


@compile_kernel(EXACT)
def write_command(
    arm: Record, chunk: Chunk, limits: InversionLimits, n: int, status: int, joints: Array,
    command: Array, target: Array, error: Array, outcome: Outcome,
) -> None:  # fmt: skip
    """Writes status and, if inverted, command of one target.

    Args:
        arm: Of ``ARM_DTYPE``.
        chunk: ``Chunk``.
        limits: ``InversionLimits``.
        n: Row of the target.
        status: :class:`Status` of the inversion.
        joints: (6,) rad of the command.
        command: (3, 4) tool in base.
        target: (3, 4) likewise.
        error: (6,) work space.
        outcome: ``Outcome``; ``after`` is reset to ``before`` where nothing is commanded.
    """
    moved = turned = 0.0
    if status == DONE:
        moved, turned = deviation(command, target, error)
        if moved < limits.min_shift and turned < limits.min_shift:
            status = NO_ERROR
        elif moved > limits.max_shift or turned > limits.max_turn:
            status = STEP
        else:
            for k in range(6):
                low, high = arm.limits[k, 0], arm.limits[k, 1]
                if not (low <= joints[k] <= high and low <= chunk.nominal[n, k] <= high):
                    status = LIMIT
    if chunk.jump[n]:
        status = JUMP
    outcome.status[n] = status
    if status != DONE:
        for k in range(6):
            outcome.joints[n, k] = chunk.nominal[n, k]
        for r in range(3):
            outcome.after[n, r] = outcome.before[n, r]
        return
    for k in range(6):
        outcome.joints[n, k] = joints[k]
    for r in range(3):
        outcome.shift[n, r] = command[r, ORIGIN] - target[r, ORIGIN]
    outcome.turn[n] = turned
    if chunk.route[n] != AXES:
        _write_in_frame(chunk.frames[chunk.frame[n]], command, n, outcome)


@compile_kernel(EXACT)
def write_predicted(
    model: CalibratedArm, chunk: Chunk, limits: InversionLimits, rows: IntArray,
    converged: BoolArray, joints: Array, command: Array, target: Array, before: Array,
    after: Array, outcome: Outcome,
) -> None:  # fmt: skip
    """Writes status and commands of targets that were inverted elsewhere; columns of k rows."""
    error = np.empty(6)
    for k in range(len(rows)):
        n = rows[k]
        for r in range(3):
            outcome.before[n, r], outcome.after[n, r] = before[k, r], after[k, r]
        status = DONE if converged[k] else NOT_CONVERGED
        arm = model.arms[chunk.tool[n]]
        write_command(
            arm, chunk, limits, n, status, joints[k], command[k], target[k], error, outcome
        )  # fmt: skip


@compile_kernel(EXACT)
def _write_in_frame(T_base_frame: Array, pose: Array, n: int, outcome: Outcome) -> None:
    """Writes a base pose as row ``n`` of the commands in work frame coordinates."""
    T = T_base_frame
    x = pose[X, ORIGIN] - T[X, ORIGIN]
    y = pose[Y, ORIGIN] - T[Y, ORIGIN]
    z = pose[Z, ORIGIN] - T[Z, ORIGIN]
    for r in range(3):
        a, b, c = T[X, r], T[Y, r], T[Z, r]
        for k in range(3):
            outcome.rotation[n, 3 * r + k] = a * pose[X, k] + b * pose[Y, k] + c * pose[Z, k]
        outcome.position[n, r] = a * x + b * y + c * z
