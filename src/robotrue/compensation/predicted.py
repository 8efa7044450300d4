"""What only the model's ``predict`` can say: errors without flat tables, and covariances."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.compensation.chunks import Outcome, Part
from robotrue.compensation.newton import Corrected, correct_rows, load_rows
from robotrue.compensation.plan import Plan
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import inverse
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.program.program import Program
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load


def by_prediction(
    model: ErrorModel,
    robot: RobotModel,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    load: Load,
    measured: BoolArray,
    outcome: Outcome,
    part: Part,
) -> bool:
    """Compensates, in place, the targets of a chunk that the nominal pass found free of guards.

    Returns:
        Whether the model gave a rotation error everywhere it was asked.
    """
    known = True
    fine = np.flatnonzero(outcome.status[part.rows] == Status.UNCHANGED_NO_ERROR)
    for tool, local in _by_tool(program, part, fine):
        rows = part.rows.start + local
        corrected = correct_rows(
            model,
            robot.with_tool(program.T_flange_tool[tool]),
            bool(measured[tool]),
            part.nominal[local],
            load_rows(load, rows),
            part.approach[local],
            (settings.tolerance, settings.turn_tolerance),
        )
        known = known and bool(corrected.rotation_known.all())
        _write(robot, program, plan, settings, outcome, rows, corrected, part.nominal[local])
    return known


def predicted_error(
    model: ErrorModel,
    program: Program,
    load: Load,
    measured: BoolArray,
    rows: IntArray,
    joints: Array,
    approach: Array,
) -> Array:
    """Returns the error (m, 3) m that the model predicts at joints (m, 6) rad of some targets."""
    out = np.full((len(rows), 3), np.nan)
    for tool in np.unique(program.tool[rows]):
        mine = np.flatnonzero(program.tool[rows] == tool)
        out[mine] = model.predict(
            Query(
                joints=joints[mine],
                load=load_rows(load, rows[mine]),
                approach=approach[mine],
                T_flange_tool=None if measured[tool] else program.T_flange_tool[tool],
            )
        ).error
    return out


def _write(
    robot: RobotModel,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    outcome: Outcome,
    rows: IntArray,
    corrected: Corrected,
    nominal: Array,
) -> None:
    """Applies the guards and writes what passed them."""
    shift = corrected.T_base_tool[:, :3, 3] - corrected.T_base_target[:, :3, 3]
    turned = corrected.T_base_tool[:, :3, :3] @ np.swapaxes(
        corrected.T_base_target[:, :3, :3], 1, 2
    )
    turn = np.linalg.norm(rotation_vector_from_matrix(turned), axis=1)
    size = np.linalg.norm(shift, axis=1)
    low, high = robot.limits[:, 0], robot.limits[:, 1]
    both = np.stack([corrected.joints, nominal])
    inside = ((both >= low) & (both <= high)).all(axis=(0, 2))
    status = np.select(
        [
            ~corrected.converged,
            (size < settings.min_shift) & (turn < settings.min_shift),
            (size > settings.max_shift) | (turn > settings.max_turn),
            ~inside,
        ],
        [
            int(Status.UNCHANGED_NOT_CONVERGED),
            int(Status.UNCHANGED_NO_ERROR),
            int(Status.UNCHANGED_STEP),
            int(Status.UNCHANGED_JOINT_LIMIT),
        ],
        default=int(Status.COMPENSATED),
    )
    outcome.status[rows] = status
    outcome.before[rows] = corrected.before
    outcome.after[rows] = corrected.before
    keep = status == Status.COMPENSATED
    done = rows[keep]
    outcome.after[done] = corrected.after[keep]
    outcome.joints[done] = corrected.joints[keep]
    outcome.shift[done] = shift[keep]
    outcome.turn[done] = turn[keep]
    posed = keep & (plan.route[rows] != Route.AXES)
    done = rows[posed]
    frame = inverse(program.T_base_frame[program.frame[done]]) @ corrected.T_base_tool[posed]
    outcome.position[done] = frame[:, :3, 3]
    outcome.rotation[done] = frame[:, :3, :3].reshape(-1, 9)


def covariances(
    model: ErrorModel,
    program: Program,
    load: Load,
    measured: BoolArray,
    outcome: Outcome,
    part: Part,
) -> None:
    """Writes the covariance of the actual position at the joints of a chunk's targets, in place."""
    known = np.flatnonzero(np.isfinite(outcome.joints[part.rows]).all(axis=1))
    for tool, local in _by_tool(program, part, known):
        rows = part.rows.start + local
        predicted = model.predict(
            Query(
                joints=outcome.joints[rows],
                load=load_rows(load, rows),
                approach=part.approach[local],
                T_flange_tool=None if measured[tool] else program.T_flange_tool[tool],
            )
        )
        outcome.covariance[rows] = predicted.covariance


def _by_tool(program: Program, part: Part, local: IntArray) -> Iterator[tuple[int, IntArray]]:
    tools = program.tool[part.rows][local]
    for tool in np.unique(tools):
        yield int(tool), local[tools == tool]
