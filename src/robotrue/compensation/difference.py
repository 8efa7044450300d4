"""Two programs target by target: what moved, by how much, and what the model expects of each.

The second program is the first with other numbers, as compensation writes it. With a model of the
arm every target also has its predicted error before (the first program, as it stands) and after
(where the second one lands, against what the first one wants), with the covariance of the latter.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.compensation.compensate import compensate
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, UM
from robotrue.errors import ModelMismatchError
from robotrue.program.program import Program, Reason
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry
from robotrue.robot.statics import NO_LOAD, Load

STILL_POSITION: Final = 1e-9
"""m; numbers that differ by less were printed alike."""
STILL_ANGLE: Final = 1e-10
STILL_JOINT: Final = 1e-7
"""rad of joint motion that has no direction."""


class Change(IntEnum):
    """What became of a target."""

    SAME = 0
    MOVED = 1
    WORDS = 2  # the same place, another configuration word
    UNREADABLE = 3  # the reader could not make a pose of it in either program


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """n targets of two programs. NaN where a target has no pose or the arm cannot take it.

    Attributes:
        change: (n,) :class:`Change`.
        line: (n,) one-based line in the first program.
        line_after: (n,) in the second.
        shift: (n, 3) m in base, second minus first; axis targets have none.
        turn: (n,) rad between the attitudes; for axis targets the largest change of an axis.
        error_before: (n, 3) m in base, predicted, actual minus wanted; empty without a model.
        error_after: (n, 3) m in base, the same with the second program; empty likewise.
        covariance: (n, 3, 3) m^2 about ``error_after``; empty likewise.
    """

    change: IntArray
    line: IntArray
    line_after: IntArray
    shift: Array
    turn: Array
    error_before: Array
    error_after: Array
    covariance: Array

    def __post_init__(self) -> None:
        """Checks shapes and freezes."""
        n = len(self.change)
        for name in ("change", "line", "line_after"):
            value = frozen(getattr(self, name), (n,), name, dtype=np.int64)
            object.__setattr__(self, name, value)
        m = n if len(self.error_before) else 0
        for name, shape in (
            ("shift", (n, 3)),
            ("turn", (n,)),
            ("error_before", (m, 3)),
            ("error_after", (m, 3)),
            ("covariance", (m, 3, 3)),
        ):
            value = frozen(getattr(self, name), shape, name, allow_nan=True)
            object.__setattr__(self, name, value)

    @property
    def axis_target(self) -> BoolArray:
        """(n,) targets that state axes and no place: they turn, and have no shift."""
        return np.asarray(~np.isfinite(self.shift).all(axis=1) & np.isfinite(self.turn))

    @property
    def has_errors(self) -> bool:
        """Whether a model spoke."""
        return len(self.error_before) == len(self.change) > 0

    def summary(self) -> dict[str, object]:
        """Returns JSON values: counts, size of the shifts, predicted errors; um and deg."""
        moved = self.change == Change.MOVED
        number = np.bincount(self.change, minlength=len(Change))
        out: dict[str, object] = {
            "targets": len(self.change),
            **{c.name.lower(): int(number[c]) for c in Change},
            "shift_um": _sizes(np.linalg.norm(self.shift[moved], axis=1) / UM),
            "turn_deg": _sizes(self.turn[moved] / DEG),
        }
        if self.has_errors:
            for name in ("before", "after"):
                error = getattr(self, f"error_{name}")
                out[f"predicted_error_{name}_um"] = _sizes(np.linalg.norm(error, axis=1) / UM)
        return out


def difference(
    first: Program,
    second: Program,
    *,
    model: ErrorModel | None = None,
    load: Load = NO_LOAD,
    home: Array | None = None,
) -> Difference:
    """Returns what the second program changes of the first.

    Args:
        first: As CAM made it.
        second: The same with other numbers; the same frames and tools.
        model: Error of the arm, for the predicted errors.
        load: Payload and wrench, one row or one per target.
        home: (6,) rad, where the arm is before the first target; empty or None: not stated, and
            targets at which it matters get no predicted error.

    Raises:
        ModelMismatchError: The programs have another number of targets, or other motions.
    """
    _require_alike(first, second)
    T_first, T_second = _in_base(first), _in_base(second)
    shift = T_second[:, :3, 3] - T_first[:, :3, 3]
    turned = np.full((len(first), 3), np.nan)
    posed = np.asarray(np.isfinite(T_first + T_second).all(axis=(1, 2)))
    turned[posed] = rotation_vector_from_matrix(
        T_second[posed, :3, :3] @ np.swapaxes(T_first[posed, :3, :3], 1, 2)
    )
    turn = np.linalg.norm(turned, axis=1)
    axis = np.asarray(first.reason == Reason.JOINT_TARGET)
    if axis.any():
        turn[axis] = np.abs(second.axes[axis] - first.axes[axis]).max(axis=1)
    empty = np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3, 3))
    errors = (
        empty
        if model is None
        else _errors(
            model, first, T_first, T_second, posed, load, np.empty(0) if home is None else home
        )
    )
    return Difference(
        change=_changes(first, second, shift, turn, posed | axis),
        line=first.line,
        line_after=second.line,
        shift=shift,
        turn=turn,
        error_before=errors[0],
        error_after=errors[1],
        covariance=errors[2],
    )


def _require_alike(first: Program, second: Program) -> None:
    if len(first) != len(second):
        raise ModelMismatchError(
            f"{second.name} has {len(second)} targets, {first.name} has {len(first)}: not the same "
            "program with other numbers.",
            hint="compare a program with what robotrue made of it.",
        )
    other = np.flatnonzero(first.motion != second.motion)
    if len(other):
        raise ModelMismatchError(
            f"the target of line {first.line[other[0]]} of {first.name} is reached by another "
            f"motion in line {second.line[other[0]]} of {second.name}.",
            hint="compare a program with what robotrue made of it.",
        )


def _in_base(program: Program) -> Array:
    """(n, 4, 4) tool in base; NaN where the target has no pose or no known frame."""
    frame = program.frame
    known = (frame >= 0) & (frame < len(program.T_base_frame))
    out = np.full((len(program), 4, 4), np.nan)
    T_frame_tool = pose(program.rotation[known], program.position[known])
    out[known] = program.T_base_frame[frame[known]] @ T_frame_tool
    return out


def _changes(
    first: Program, second: Program, shift: Array, turn: Array, readable: BoolArray
) -> IntArray:
    change = np.full(len(first), int(Change.SAME), dtype=np.int64)
    if first.words.shape == second.words.shape:
        change[(first.words != second.words).any(axis=1)] = Change.WORDS
    far = np.linalg.norm(np.nan_to_num(shift), axis=1) > STILL_POSITION
    change[far | (np.nan_to_num(turn) > STILL_ANGLE)] = Change.MOVED
    change[~readable] = Change.UNREADABLE
    return change


def _errors(
    model: ErrorModel,
    first: Program,
    T_first: Array,
    T_second: Array,
    posed: BoolArray,
    load: Load,
    home: Array,
) -> tuple[Array, Array, Array]:
    """Predicted errors of both programs against the first one's targets, and the covariance."""
    joints = compensate(model, first, settings=CompensationSettings(load=load, home=home)).joints
    n = len(first)
    before, after = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    covariance = np.full((n, 3, 3), np.nan)
    posed = np.asarray(posed & np.isfinite(joints).all(axis=1))
    approach = _approach(joints)
    robot = model.robot.nominal()
    for k, tool in enumerate(first.T_flange_tool):
        rows = np.flatnonzero(posed & (first.tool == k))
        if not len(rows):
            continue
        own = np.allclose(tool, robot.T_flange_tool, rtol=0.0, atol=1e-9)
        other = None if own else tool
        for T, out in ((T_first, before), (T_second, after)):
            q = _joints(robot.with_tool(tool), T[rows], joints[rows])
            able = np.isfinite(q).all(axis=1)
            mine = rows[able]
            here = load.take(mine)
            seen = model.predict(
                Query(joints=q[able], approach=approach[mine], T_flange_tool=other, load=here)
            )
            out[mine] = T[mine, :3, 3] - T_first[mine, :3, 3] + seen.error
            covariance[mine] = seen.covariance
    return before, after, covariance


def _approach(joints: Array) -> Array:
    """Sign (n, dof) of the last motion of every joint into each target; 0 before the first."""
    out = np.zeros_like(joints)
    known = np.flatnonzero(np.isfinite(joints).all(axis=1))
    step = np.diff(joints[known], axis=0)
    moved = np.abs(step) > STILL_JOINT
    # A joint that stands still keeps the side it came from.
    last = np.maximum.accumulate(np.where(moved, np.arange(len(step))[:, None], -1), axis=0)
    sign = np.take_along_axis(np.sign(step), np.maximum(last, 0), axis=0)
    out[known[1:]] = np.where(last < 0, 0.0, sign)
    return out


def _joints(robot: RobotModel, T_base_tool: Array, near: Array) -> Array:
    """Nominal joints (n, dof) rad of poses, nearest to others; NaN where there are none."""
    if opw_geometry(robot) is not None:
        flange = robot.with_tool(np.eye(4))
        return inverse_batch(flange, T_base_tool @ inverse(robot.T_flange_tool), near=near)
    found = solve(robot, T_base_tool, near)
    return np.where(found.converged[:, None], found.joints, np.nan)


def _sizes(values: Array) -> dict[str, float] | None:
    """Mean and largest; None (null) without any."""
    known = values[np.isfinite(values)]
    return {"mean": float(known.mean()), "max": float(known.max())} if len(known) else None
