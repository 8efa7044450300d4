"""Two programs target by target: moved targets, their shifts, and the predicted errors.

The second program is the first with other numbers, as compensation writes it. With a model of the
arm every target also has its predicted error before (the first program, unchanged) and after (the
second one, against the targets of the first), with the covariance of the latter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell, frame_table
from robotrue.compensation.compensate import compensate
from robotrue.compensation.process_force import DescribedForce, state_forces
from robotrue.compensation.result import mean_and_max
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, UM
from robotrue.errors import ModelMismatchError
from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.program.target_poses import target_poses
from robotrue.robot.statics import NO_LOAD, Load

STILL_POSITION: Final = 1e-9
"""m; numbers that differ by less were printed alike."""
STILL_ANGLE: Final = 1e-10


class TargetChange(IntEnum):
    """Kinds of change of a target."""

    SAME = 0
    MOVED = 1
    WORDS = 2  # the same place, another configuration word
    UNREADABLE = 3  # the reader could not make a pose of it in either program


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference(Columns):
    """n targets of two programs. NaN where a target has no pose or the arm cannot take it.

    Attributes:
        change: (n,) :class:`TargetChange`.
        line: (n,) one-based line in the first program.
        line_after: (n,) in the second.
        shift: (n, 3) m in base, second minus first; axis targets have none.
        turn: (n,) rad between the attitudes; for axis targets the largest change of an axis.
        error_before: (n, 3) m in base, predicted, actual minus wanted; empty without a model.
        error_after: (n, 3) m in base, the same with the second program; empty likewise.
        covariance: (n, 3, 3) m^2 about ``error_after``; empty likewise.
        joints: (n, 6) rad of the first program, compensated, model's sense; NaN without a model.
    """

    change: Annotated[IntArray, Column("n")]
    line: Annotated[IntArray, Column("n")]
    line_after: Annotated[IntArray, Column("n")]
    shift: Annotated[Array, Column("n 3", unit="m", nan=True)]
    turn: Annotated[Array, Column("n", unit="rad", nan=True)]
    error_before: Annotated[Array, Column("m 3", unit="m", nan=True)]
    error_after: Annotated[Array, Column("m 3", unit="m", nan=True)]
    covariance: Annotated[Array, Column("m 3 3", unit="m^2", nan=True)]
    joints: Annotated[Array, Column("n 6", unit="rad", nan=True, fill=np.nan)] = EMPTY

    @property
    def axis_target(self) -> BoolArray:
        """(n,) targets that state axes and no place: they turn, and have no shift."""
        return np.asarray(~np.isfinite(self.shift).all(axis=1) & np.isfinite(self.turn))

    @property
    def has_errors(self) -> bool:
        """True if a model predicted the errors."""
        return len(self.error_before) == len(self.change) > 0

    def summary(self) -> dict[str, object]:
        """Returns JSON values: counts, size of the shifts, predicted errors; um and deg."""
        moved = self.change == TargetChange.MOVED
        number = np.bincount(self.change, minlength=len(TargetChange))
        out: dict[str, object] = {
            "targets": len(self.change),
            **{c.name.lower(): int(number[c]) for c in TargetChange},
            "shift_um": mean_and_max(np.linalg.norm(self.shift[moved], axis=1) / UM),
            "turn_deg": mean_and_max(self.turn[moved] / DEG),
        }
        if self.has_errors:
            for name in ("before", "after"):
                error = getattr(self, f"error_{name}")
                out[f"predicted_error_{name}_um"] = mean_and_max(np.linalg.norm(error, axis=1) / UM)
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
    T_first, T_second = target_poses(first), target_poses(second)
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
    before, after, covariance = np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3, 3))
    joints = EMPTY
    if model is not None:
        settings = CompensationSettings(load=load, home=np.empty(0) if home is None else home)
        here = compensate(model, first, settings=settings)
        there = compensate(model, second, settings=replace(settings, covariance=True))
        before = np.where(posed[:, None], here.predicted_error_before, np.nan)
        after = shift + np.where(posed[:, None], there.predicted_error_before, np.nan)
        covariance = np.where(np.isfinite(after)[..., None], there.covariance, np.nan)
        joints = here.joints
    return Difference(
        change=_changes(first, second, shift, turn, posed | axis),
        line=first.line,
        line_after=second.line,
        shift=shift,
        turn=turn,
        error_before=before,
        error_after=after,
        covariance=covariance,
        joints=joints,
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


def _changes(
    first: Program, second: Program, shift: Array, turn: Array, readable: BoolArray
) -> IntArray:
    change = np.full(len(first), int(TargetChange.SAME), dtype=np.int64)
    if first.words.shape == second.words.shape:
        change[(first.words != second.words).any(axis=1)] = TargetChange.WORDS
    far = np.linalg.norm(np.nan_to_num(shift), axis=1) > STILL_POSITION
    change[far | (np.nan_to_num(turn) > STILL_ANGLE)] = TargetChange.MOVED
    change[~readable] = TargetChange.UNREADABLE
    return change


def compare_jobs(
    before: Sequence[Path],
    after: Sequence[Path],
    cell: Cell | None,
    model: ErrorModel | None,
    force: Array | DescribedForce,
    home: Array,
) -> list[tuple[str, Difference]]:
    """Returns name and difference of each file of two jobs.

    Args:
        before: Programs as CAM made them.
        after: The same with other numbers.
        cell: Frames, tools and payload; None to compare numbers alone.
        model: For predicted errors; None without.
        force: (6,) N, N m on the tool for all targets, empty for none; or a description.
        home: (6,) rad, start posture; empty where none is stated.

    Raises:
        ModelMismatchError: Jobs of another number of files, or other programs.
    """
    frames = FrameTable() if cell is None else frame_table(cell)
    jobs = read_job(before, frames), read_job(after, frames)
    if len(jobs[0]) != len(jobs[1]):
        raise ModelMismatchError(
            f"{before[0].name} is a job of {len(jobs[0])} files, {after[0].name} of "
            f"{len(jobs[1])}.",
            source=after[0],
            hint="put the companions of both programs beside them.",
        )
    if cell is None:
        return [(a.name, difference(a, b)) for a, b in zip(*jobs, strict=True)]
    found = []
    for a, b, stated in zip(*jobs, state_forces(force, jobs[0]), strict=True):
        wrench = np.atleast_2d(stated.wrench) if stated.wrench.size else cell.payload.wrench
        load = replace(cell.payload, wrench=wrench)
        found.append((a.name, difference(a, b, model=model, load=load, home=home)))
    return found
