"""What only the model's ``predict`` can say: errors without flat tables, and covariances.

Models without tables are inverted by chord Newton with the nominal Jacobian, all targets of a chunk
at once: the error of a robot is a thousandth of its pose, so each step takes the miss down by about
as much.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.compensation.calibrated_arm import Chunk, InversionLimits, Outcome
from robotrue.compensation.inversion_kernels import write_predicted
from robotrue.compensation.setup import CompensationSetup
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.program.program import Program
from robotrue.robot.forward import joint_jacobian, walk
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

ITERATIONS: Final = 15


def correct_by_prediction(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    chunk: Chunk,
    limits: InversionLimits,
    outcome: Outcome,
) -> bool:
    """Compensates the targets that the nominal pass found free of guards.

    Args:
        setup: With a model.
        program: The targets.
        load: Of them.
        chunk: Solved with the nominal arm.
        limits: Of the inversion.
        outcome: Changed.

    Returns:
        Whether the model gave a rotation error everywhere.
    """
    if setup.model is None:
        return True
    rotation_known = True
    fine = np.flatnonzero(outcome.status == Status.UNCHANGED_NO_ERROR)
    for tool, rows in _by_tool(chunk.tool, fine):
        corrected = correct_rows(
            setup.model,
            setup.robot.with_tool(program.T_flange_tool[tool]),
            bool(setup.measured[tool]),
            chunk.nominal[rows],
            load.take(rows),
            chunk.approach[rows],
            (limits.tolerance, limits.turn_tolerance),
        )
        rotation_known = rotation_known and bool(corrected.rotation_known.all())
        write_predicted(
            setup.arm, chunk, limits, rows, corrected.converged, corrected.joints,
            corrected.T_base_tool, np.array(corrected.T_base_target), corrected.before,
            corrected.after, outcome,
        )  # fmt: skip
    return rotation_known


def predicted_error(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    rows: IntArray,
    joints: Array,
    approach: Array,
) -> Array:
    """Returns the error (m, 3) m that the model predicts at joints (m, 6) rad of some targets."""
    error = np.full((len(rows), 3), np.nan)
    if setup.model is None:
        return error
    for tool, local in _by_tool(program.tool[rows], np.arange(len(rows))):
        query = _query(setup, program, load, tool, rows[local], joints[local], approach[local])
        error[local] = setup.model.predict(query).error
    return error


def write_covariances(
    setup: CompensationSetup, program: Program, load: Load, chunk: Chunk, outcome: Outcome
) -> None:
    """Writes the covariance of the actual position at the joints of the targets."""
    if setup.model is None or not setup.settings.covariance:
        return
    reached = np.flatnonzero(np.isfinite(outcome.joints).all(axis=1))
    for tool, rows in _by_tool(chunk.tool, reached):
        query = _query(setup, program, load, tool, rows, outcome.joints[rows], chunk.approach[rows])
        outcome.covariance[rows] = setup.model.predict(query).covariance


def _query(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    tool: int,
    rows: IntArray,
    joints: Array,
    approach: Array,
) -> Query:
    """Returns what the model is asked at targets that have one tool."""
    return Query(
        joints=joints,
        load=load.take(rows),
        approach=approach,
        T_flange_tool=None if setup.measured[tool] else program.T_flange_tool[tool],
    )


def _by_tool(tool: IntArray, rows: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yields the tools of some rows, and the rows of each."""
    for index in np.unique(tool[rows]).tolist():
        yield index, rows[tool[rows] == index]


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrected:
    """Commands for n targets.

    Attributes:
        joints: (n, 6) rad.
        T_base_tool: (n, 4, 4) the command: nominal pose at those joints.
        T_base_target: (n, 4, 4) the targets.
        before: (n, 3) m, error at the nominal joints.
        after: (n, 3) m, what is left.
        converged: (n,) position and rotation within their tolerances.
        rotation_known: (n,) False where the model gave no rotation error; it is taken as zero.
    """

    joints: Array
    T_base_tool: Array
    T_base_target: Array
    before: Array
    after: Array
    converged: BoolArray
    rotation_known: BoolArray


def correct_rows(
    model: ErrorModel,
    robot: RobotModel,
    measured_tool: bool,
    joints: Array,
    load: Load,
    approach: Array,
    tolerance: tuple[float, float],
) -> Corrected:
    """Returns the commands that put the predicted tool on the nominal pose of ``joints``.

    Args:
        model: Predicts the error.
        robot: The nominal arm with the program's tool.
        measured_tool: The tool is the point the model was measured at.
        joints: (n, 6) rad, nominal joints of the targets.
        load: One row or n rows.
        approach: (n, 6) sign of the last motion.
        tolerance: m and rad.

    Fails when: the model's error changes by more than its own size within its own reach; such
    targets come back as not converged.
    """
    start = walk(robot, joints)
    lever = np.linalg.inv(joint_jacobian(robot, start))
    q = np.array(joints)
    command = np.array(start.transforms)
    before, after = np.empty((len(q), 3)), np.empty((len(q), 3))
    converged = np.zeros(len(q), dtype=np.bool_)
    known = np.ones(len(q), dtype=np.bool_)
    open_ = np.arange(len(q))
    for iteration in range(ITERATIONS):
        if not len(open_):
            break
        query = Query(
            joints=q[open_],
            load=load.take(open_),
            approach=approach[open_],
            T_flange_tool=None if measured_tool else robot.T_flange_tool,
        )
        predicted = model.predict(query)
        state = walk(robot, q[open_])
        turn_known = np.asarray(np.isfinite(predicted.rotation_error).all(axis=1))
        turn = np.where(turn_known[:, None], predicted.rotation_error, 0.0)
        rotation = matrix_from_rotation_vector(turn) @ state.rotation
        miss = state.position + predicted.error - start.position[open_]
        twist = rotation_vector_from_matrix(rotation @ np.swapaxes(start.rotation[open_], 1, 2))
        if iteration == 0:
            before[:] = miss
            known[:] = turn_known
        after[open_] = miss
        command[open_] = state.transforms
        done = np.linalg.norm(miss, axis=1) < tolerance[0]
        done &= np.linalg.norm(twist, axis=1) < tolerance[1]
        converged[open_[done]] = True
        left = ~done
        open_ = open_[left]
        error = np.concatenate([miss, twist], axis=1)[left]
        q[open_] -= (lever[open_] @ error[..., None])[..., 0]
    return Corrected(
        joints=q,
        T_base_tool=command,
        T_base_target=start.transforms,
        before=before,
        after=after,
        converged=converged,
        rotation_known=known,
    )
