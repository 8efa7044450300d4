"""What only the model's ``predict`` can say: errors without flat tables, and covariances."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robotrue.calibration.model import Query
from robotrue.compensation.calibrated_arm import Chunk, InversionLimits, Outcome
from robotrue.compensation.inversion_kernels import write_predicted
from robotrue.compensation.newton import correct_rows, load_rows
from robotrue.compensation.setup import CompensationSetup
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, IntArray
from robotrue.program.program import Program
from robotrue.robot.statics import Load


def correct_by_prediction(
    setup: CompensationSetup,
    load: Load,
    program: Program,
    chunk: Chunk,
    limits: InversionLimits,
    first: int,
    part: Outcome,
) -> bool:
    """Compensates the targets of a chunk that the nominal pass found free of guards.

    Args:
        setup: With a model.
        load: Of the program.
        program: The targets.
        chunk: Those of the chunk, solved with the nominal arm.
        limits: Of the inversion.
        first: Row of the first target of the chunk.
        part: Outcome of the chunk, changed.

    Returns:
        Whether the model gave a rotation error everywhere.
    """
    if setup.model is None:
        return True
    rotation_known = True
    fine = np.flatnonzero(part.status == Status.UNCHANGED_NO_ERROR)
    for tool, rows in _by_tool(chunk.tool, fine):
        corrected = correct_rows(
            setup.model,
            setup.robot.with_tool(program.T_flange_tool[tool]),
            bool(setup.measured[tool]),
            chunk.nominal[rows],
            load_rows(load, first + rows),
            chunk.approach[rows],
            (limits.tolerance, limits.turn_tolerance),
        )
        rotation_known = rotation_known and bool(corrected.rotation_known.all())
        write_predicted(
            setup.arm, chunk, limits, rows, corrected.converged, corrected.joints,
            corrected.T_base_tool, np.array(corrected.T_base_target), corrected.before,
            corrected.after, part,
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
    setup: CompensationSetup, program: Program, load: Load, chunk: Chunk, first: int, part: Outcome
) -> None:
    """Writes the covariance of the actual position at the joints of a chunk's targets."""
    if setup.model is None or not setup.settings.covariance:
        return
    reached = np.flatnonzero(np.isfinite(part.joints).all(axis=1))
    for tool, rows in _by_tool(chunk.tool, reached):
        query = _query(
            setup, program, load, tool, first + rows, part.joints[rows], chunk.approach[rows]
        )
        part.covariance[rows] = setup.model.predict(query).covariance


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
        load=load_rows(load, rows),
        approach=approach,
        T_flange_tool=None if setup.measured[tool] else program.T_flange_tool[tool],
    )


def _by_tool(tool: IntArray, rows: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yields the tools of some rows, and the rows of each."""
    for index in np.unique(tool[rows]).tolist():
        yield index, rows[tool[rows] == index]
