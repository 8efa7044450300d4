"""Inversion of any error model through its ``predict``, for all targets at once.

The route for models without flat tables. Chord Newton with the nominal Jacobian: the error of a
robot is a thousandth of its pose, so each step takes the miss down by about as much.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.robot.forward import joint_jacobian, walk
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

ITERATIONS: Final = 15


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
            load=load_rows(load, open_),
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


def load_rows(load: Load, rows: IntArray | slice) -> Load:
    """Returns the load at some targets; single rows stay single."""
    mass, com, wrench = (
        part[rows] if len(part) > 1 else part for part in (load.mass, load.com, load.wrench)
    )
    return Load(mass=mass, com=com, wrench=wrench)
