"""Errors that only the model's ``predict`` gives: without flat tables, and covariances.

Models without tables are inverted by chord Newton with the nominal Jacobian, all targets of a chunk
at once: the error of a robot is a thousandth of its pose, so each step takes the miss down by about
as much.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.model import Query
from robotrue.compensation.calibrated_arm import Chunk, InversionLimits, Outcome
from robotrue.compensation.inversion_kernels import write_predicted
from robotrue.compensation.settings import CompensationSetup
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, IntArray
from robotrue.core.conditions import no_conditions
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.program.program import Program
from robotrue.robot.forward import joint_jacobian, walk
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
        Whether the model gave a rotation error everywhere; it is taken as zero elsewhere.

    Fails when: the model's error changes by more than its own size within its own reach; such
    targets come back as not converged.
    """
    fine = np.flatnonzero(outcome.status == Status.UNCHANGED_NO_ERROR)
    known = [
        _correct_rows(setup, program, load, chunk, limits, tool, rows, outcome)
        for tool, rows in _by_tool(chunk.tool, fine)
        if setup.model is not None
    ]
    return all(known)


def _correct_rows(
    setup: CompensationSetup,
    program: Program,
    load: Load,
    chunk: Chunk,
    limits: InversionLimits,
    tool: int,
    rows: IntArray,
    outcome: Outcome,
) -> bool:
    """Moves the predicted tool to the nominal pose of targets (n,) that have one tool."""
    robot = setup.robot.with_tool(program.T_flange_tool[tool])
    q = np.array(chunk.nominal[rows])
    start = walk(robot, q)
    lever = np.linalg.inv(joint_jacobian(robot, start))
    command = np.array(start.transforms)
    before, after = np.empty((len(q), 3)), np.empty((len(q), 3))
    converged = np.zeros(len(q), dtype=np.bool_)
    rotation_known = True
    open_ = np.arange(len(q))
    for iteration in range(ITERATIONS):
        if not len(open_) or setup.model is None:
            break
        some = rows[open_]
        query = _query(setup, program, load, tool, some, q[open_], chunk.approach[some])
        predicted = setup.model.predict(query)
        state = walk(robot, q[open_])
        turn_known = np.asarray(np.isfinite(predicted.rotation_error).all(axis=1))
        turn = np.where(turn_known[:, None], predicted.rotation_error, 0.0)
        rotation = matrix_from_rotation_vector(turn) @ state.rotation
        miss = state.position + predicted.error - start.position[open_]
        twist = rotation_vector_from_matrix(rotation @ np.swapaxes(start.rotation[open_], 1, 2))
        if iteration == 0:
            before[:], rotation_known = miss, bool(turn_known.all())
        after[open_], command[open_] = miss, state.transforms
        done = np.linalg.norm(miss, axis=1) < limits.tolerance
        done &= np.linalg.norm(twist, axis=1) < limits.turn_tolerance
        converged[open_[done]] = True
        open_ = open_[~done]
        error = np.concatenate([miss, twist], axis=1)[~done]
        q[open_] -= (lever[open_] @ error[..., None])[..., 0]
    write_predicted(
        setup.arm, chunk, limits, rows, converged, q, command, np.array(start.transforms), before,
        after, outcome,
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
    """Returns the query for the model at targets with one tool.

    Raises:
        ConfigurationError: The model has a rail, and a target does not state where the arm is.
    """
    conditions = no_conditions(len(rows))
    if program.external is not None:
        conditions = replace(conditions, external=program.external[rows])
    if setup.model is not None:
        setup.model.require_stated(conditions)
    return Query(
        joints=joints,
        load=load.take(rows),
        approach=approach,
        conditions=conditions,
        T_flange_tool=None if setup.measured[tool] else program.T_flange_tool[tool],
    )


def _by_tool(tool: IntArray, rows: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yields the tools of some rows, and the rows of each."""
    for index in np.unique(tool[rows]).tolist():
        yield index, rows[tool[rows] == index]
