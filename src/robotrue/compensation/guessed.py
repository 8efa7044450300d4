"""Targets at which nothing says how the arm stands: left alone where another stance matters.

A pose says where the tool is. Which of the arm's configurations takes it there follows from the
program's words, its axis values, the start posture of the user, or the target before. Where none
of them is there, the configuration is a guess, and everything up to the next target that says it
hangs on it. The guess does no harm while the predicted errors of all configurations inside the
joint limits are alike; from the first target on where they are not, it may.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from robotrue.compensation.arm_state import GUESSED, KNOWN, PARTED
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.inverse_numeric import all_solutions, solve
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry

Others: TypeAlias = Callable[[IntArray, Array], Array]
"""Other configurations (m, k, 6) rad of rows (m,) with joints (m, 6) rad; NaN where none is."""
ErrorAt: TypeAlias = Callable[[IntArray, Array, Array], Array]
"""Predicted error (m, 3) m at rows (m,), joints (m, 6) rad and signs of the last motion (m, 6)."""
_TURN: Final = 2.0 * np.pi
_SLACK: Final = 1e-9  # rad; rounding of a joint that stands at its limit
_ALIKE: Final = 1e-6  # rad between joints that are one solution
_BATCHES: Final = (1, 63, 960)
"""Rows looked at together; the first is nearly always enough."""


def configuration_known(known: IntArray, before: int) -> IntArray:
    """Returns ``KNOWN`` or ``GUESSED`` of each target (n,), before any error is computed.

    Args:
        known: (n,) see :attr:`robotrue.compensation.plan.Plan.known`.
        before: That of the target before.
    """
    last = np.maximum.accumulate(np.where(known != 0, np.arange(len(known)), -1))
    here = np.where(known[last] > 0, KNOWN, GUESSED)
    return np.where(last < 0, before, here).astype(np.int64)


def mark_guesses_that_matter(
    configuration: IntArray,
    known: IntArray,
    rows: IntArray,
    nominal: Array,
    approach: Array,
    others: Others,
    error_at: ErrorAt,
    alike: float,
) -> None:
    """Marks, in place, where guessed configurations begin to matter, up to the next that is known.

    Args:
        configuration: (n,) of :func:`configuration_known`, changed.
        known: (n,) likewise.
        rows: (m,) targets that are to be compensated.
        nominal: (n, 6) rad, joints of the guess.
        approach: (n, 6) sign of the last motion.
        others: The other configurations.
        error_at: Predicted errors.
        alike: m by which errors may differ.
    """
    if not alike < np.inf:
        return
    run = np.cumsum(known != 0)
    asked = rows[configuration[rows] == GUESSED]
    for number in np.unique(run[asked]):
        mine = asked[run[asked] == number]
        at = 0
        while at < len(mine):
            size = _BATCHES[min(int(np.searchsorted((1, 64), at, side="right")), 2)]
            some = mine[at : at + size]
            far = _differ(some, nominal[some], approach[some], others, error_at, alike)
            if far.any():
                first = int(some[np.argmax(far)])
                configuration[first:][run[first:] == number] = PARTED
                break
            at += size


def _differ(
    rows: IntArray, nominal: Array, approach: Array, others: Others, error_at: ErrorAt, alike: float
) -> BoolArray:
    """Returns at which rows (m,) another configuration has another error."""
    own = error_at(rows, nominal, approach)
    options = others(rows, nominal)
    far = np.zeros(len(rows), dtype=np.bool_)
    for k in range(options.shape[1]):
        left = np.flatnonzero(~far & np.isfinite(options[:, k, 0]))
        if len(left):
            error = error_at(rows[left], options[left, k], approach[left])
            far[left] = np.linalg.norm(error - own[left], axis=1) > alike
    return far


def other_configurations(robot: RobotModel, T_base_flange: Array, joints: Array) -> Array:
    """Returns the other configurations (m, k, 6) rad inside the limits; NaN where there is none.

    The other branches, each at the turns nearest to the joints, and the same branch with one joint
    a whole turn on. Of an arm without closed branches those that a search finds at the first pose
    and that lead on to the others.

    Args:
        robot: The nominal arm.
        T_base_flange: (m, 4, 4).
        joints: (m, 6) rad of the configuration that is not another one.
    """
    bare, geometry = robot.with_tool(np.eye(4)), opw_geometry(robot)
    if geometry is not None:
        branches = inverse_branches(bare, T_base_flange, reference=joints, geometry=geometry)
    else:
        branches = _search_branches(bare, T_base_flange, joints)
    lower, upper = robot.limits[:, 0] - _SLACK, robot.limits[:, 1] + _SLACK
    with np.errstate(invalid="ignore"):
        branches = branches - _TURN * np.ceil(np.maximum(branches - upper, 0.0) / _TURN)
        branches = branches + _TURN * np.ceil(np.maximum(lower - branches, 0.0) / _TURN)
    turned = np.concatenate([_TURN * np.eye(6), -_TURN * np.eye(6)])
    options = np.concatenate([branches, joints[:, None] + turned], axis=1)
    inside = ((options >= lower) & (options <= upper)).all(axis=2)
    other = np.abs(options - joints[:, None]).max(axis=2) > _ALIKE
    return np.where((inside & other)[..., None], options, np.nan)


def _search_branches(bare: RobotModel, T_base_flange: Array, joints: Array) -> Array:
    """Returns the solutions of the first pose, followed to the others, (m, k, 6) rad."""
    seeds = all_solutions(bare, T_base_flange[:1])[0]
    out = np.full((len(joints), len(seeds), 6), np.nan)
    for k, seed in enumerate(seeds):
        found = solve(bare, T_base_flange, seed)
        q = found.joints - _TURN * np.rint((found.joints - joints) / _TURN)
        out[found.converged, k] = q[found.converged]
    return out
