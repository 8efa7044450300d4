"""One rigid correction of each work frame, for targets that cannot be rewritten one by one.

A target that the program computes keeps its numbers, but moves with its work frame. The known
targets of that frame determine the best frame and its residual.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.compensation.result import Compensation, MeanAndMax, mean_and_max
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import displacement_columns, inverse, pose
from robotrue.core.rotations import (
    abc_from_matrix,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM, UM
from robotrue.program.controller_files import print_abc, print_mm
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.program.target_poses import target_poses

FEWEST: Final = 3
"""Known targets that a frame is fitted to."""
LEVER: Final = 0.1
"""m from the tip at which a deviation of attitude counts as much as one of the tip itself."""
COMPUTED: Final = (Reason.EXPRESSION, Reason.RELATIVE)
"""Why a target cannot be rewritten although it moves with its frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameCorrection:
    """A work frame fitted to the known targets of a program.

    Attributes:
        program: File name.
        name: Of the frame in the controller; empty where it is not known by one.
        T_world_before: (4, 4) the frame in the controller's world, as the program has it.
        T_world_after: (4, 4) the frame to state in its place.
        computed: Targets in it that the program computes.
        fitted: Known targets it is fitted to.
        before: (fitted,) m, predicted error of the tip with the program as it is.
        after: (fitted,) m, the same with the frame corrected.
    """

    program: str
    name: str
    T_world_before: Array
    T_world_after: Array
    computed: int
    fitted: int
    before: Array
    after: Array

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        before, after = (mean_and_max(values / UM) for values in (self.before, self.after))
        return {
            "file": self.program,
            "frame": self.name,
            **_numbers("before", self.T_world_before),
            **_numbers("after", self.T_world_after),
            "computed_targets": self.computed,
            "fitted_targets": self.fitted,
            "predicted_error_before_um": before,
            "predicted_error_after_um": after,
        }

    def sentence(self) -> str:
        """Returns one sentence: which frame to state, and what it leaves."""
        before, after = (_largest_mm(mean_and_max(v)) for v in (self.before, self.after))
        name = f" {self.name}" if self.name else ""
        one = self.computed == 1
        kept = "target is unchanged" if one else "targets are unchanged"
        return (
            f"{self.computed} computed {kept}. To move {'it' if one else 'them'} too, run the "
            f"original program with work frame{name} {_print_frame(self.T_world_after)} in place "
            f"of {_print_frame(self.T_world_before)}: predicted error at its {self.fitted} known "
            f"targets {after} mm max instead of {before} mm."
        )


def fit_frames(
    program: Program, result: Compensation, table: FrameTable
) -> tuple[FrameCorrection, ...]:
    """Returns a correction for each work frame with computed targets and enough known ones.

    The rigid motion of the frame is the least-squares fit to the correction of the tip and, at
    ``LEVER`` from it, of the attitude; so a path on one line does not leave the turn about that
    line open.

    Args:
        program: As it was read.
        result: Of compensating it.
        table: Frames the controller holds; their names are those of the corrections.
    """
    left = result.status == Status.UNCHANGED_SOURCE
    left = left & np.isin(program.reason, COMPUTED) & ~program.held
    known = (result.status == Status.COMPENSATED) & np.isfinite(result.shift).all(axis=1)
    known = known & np.isfinite(program.position).all(axis=1) & ~program.held
    found = []
    for frame in np.unique(program.frame[left]).tolist():
        here = known & (program.frame == frame)
        if 0 <= frame < len(program.T_base_frame) and here.sum() >= FEWEST:
            computed = int((left & (program.frame == frame)).sum())
            found.append(_fit_frame(program, result, table, frame, here, computed))
    return tuple(found)


def _fit_frame(
    program: Program,
    result: Compensation,
    table: FrameTable,
    frame: int,
    here: BoolArray,
    computed: int,
) -> FrameCorrection:
    T_base_frame = program.T_base_frame[frame]
    tip = target_poses(program.take(here))[:, :3, 3]
    R = T_base_frame[:3, :3]
    turned = result.replacement.rotation[here] @ np.swapaxes(program.rotation[here], 1, 2)
    turn = rotation_vector_from_matrix(R @ turned @ R.T)
    shift, center = result.shift[here], tip.mean(axis=0)
    T_moved = _fit_motion(tip, shift, turn, center)
    moved = (tip - center) @ T_moved[:3, :3].T + T_moved[:3, 3] - tip
    corrected = T_moved @ pose(R, T_base_frame[:3, 3] - center)
    to_world = inverse(table.T_base_world)
    return FrameCorrection(
        program=program.name,
        name=_name_frame(table, T_base_frame),
        T_world_before=to_world @ T_base_frame,
        T_world_after=to_world @ corrected,
        computed=computed,
        fitted=int(here.sum()),
        before=np.linalg.norm(shift, axis=1),
        after=np.linalg.norm(shift - moved, axis=1),
    )


def _fit_motion(tip: Array, shift: Array, turn: Array, center: Array) -> Array:
    """Returns (4, 4) that takes places about ``center`` to where the tips are to be, base axes."""
    columns = displacement_columns(tip - center)
    attitude = np.zeros((len(tip), 3, 6))
    attitude[:, :, 3:] = LEVER * np.eye(3)
    rows = np.concatenate([columns.reshape(-1, 6), attitude.reshape(-1, 6)])
    wanted = np.concatenate([shift.ravel(), LEVER * turn.ravel()])
    motion = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    return pose(matrix_from_rotation_vector(motion[3:]), center + motion[:3])


def _name_frame(table: FrameTable, T_base_frame: Array) -> str:
    """Returns the controller's name or number of a frame; empty where none or several fit."""
    same = [name for name, T in table.bases.items() if np.allclose(T, T_base_frame, atol=1e-9)]
    return same[0] if len(same) == 1 else ""


def _numbers(when: str, T: Array) -> dict[str, list[float]]:
    return {
        f"xyz_{when}_mm": (T[:3, 3] / MM).tolist(),
        f"abc_{when}_deg": (abc_from_matrix(T[:3, :3]) / DEG).tolist(),
    }


def _print_frame(T: Array) -> str:
    values = (*print_mm(T[:3, 3] / MM), *print_abc(T[:3, :3]))
    return " ".join(f"{letter} {value}" for letter, value in zip("XYZABC", values, strict=True))


def _largest_mm(sizes: MeanAndMax | None) -> str:
    return "unknown" if sizes is None else f"{sizes['max'] / MM:.3f}"
