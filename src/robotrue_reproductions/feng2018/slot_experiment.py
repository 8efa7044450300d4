"""Slots and a contour cut from two sides in the virtual cell, compared with the truth.

Slots: four, parallel, at block x = 80, 160, 240, 320 mm, y = 100 mm, read at nine heights z from 20
to 380 mm; the step is along block x. Contour: the outline of a free-form body in the plane
y = 100 mm, roughed from both sides and met there; the step is along its outward normal. Everything
is simulated: one visit for every point, each with the arm's repeatability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.units import MM
from robotrue.robot.model import RobotModel
from robotrue.validation.slot_test import Frames, SlotEvaluation, SlotTest, evaluate_slots
from robotrue_reproductions.feng2018.machining_cell import (
    SIZE,
    FengCell,
    Posture,
    attitude,
    compensated_joints,
    machine,
)

SLOTS: Final = np.array([80.0, 160.0, 240.0, 320.0]) * MM
"""Block x of the slots."""
HEIGHTS: Final = np.linspace(20.0, 380.0, 9) * MM
MIDDLE: Final = 0.5 * SIZE[1]
"""Block y where the halves meet."""
ACROSS: Final = np.array([1.0, 0.0, 0.0])
CHECKED: Final = np.stack(
    np.meshgrid(*(np.linspace(0.0, edge, n) for edge, n in zip(SIZE, (4, 3, 4), strict=True)),
                indexing="ij"), axis=-1
).reshape(-1, 3)  # fmt: skip
"""(48, 3) m, points spread over the block for comparison with the truth, part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotSide(Columns):
    """How one side is cut.

    Attributes:
        cell: The truth, with the block as it is clamped for this side.
        posture: Side the tool comes from.
        model: What the program's poses become joints with: a robot without errors runs as the
            controller does, an error model compensates.
        T_base_part: (4, 4) the block's frame known to the user.
    """

    cell: FengCell
    posture: Posture
    model: ErrorModel | RobotModel
    T_base_part: Annotated[Array, Column("4 4")]


def both_sides(
    cell: FengCell, model: ErrorModel | RobotModel, T_base_part: Array
) -> tuple[SlotSide, SlotSide]:
    """Returns both sides cut in one clamping, with one model and in one frame (4, 4)."""
    first, second = (
        SlotSide(cell=cell, posture=posture, model=model, T_base_part=T_base_part)
        for posture in ("R", "L")
    )
    return first, second


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotResult:
    """A simulated slot test, and the truth a real one does not have.

    Attributes:
        measured: The steps, as a gauge would read them.
        evaluation: Their result.
        error: (2, 48, 3) m, where the tip truly goes less where it should, at :data:`CHECKED`,
            part axes, first and second side; repeatability aside.
    """

    measured: SlotTest
    evaluation: SlotEvaluation
    error: Array

    @property
    def mismatch(self) -> float:
        """Mean size of the four steps, m."""
        return self.evaluation.mismatch

    @property
    def side_rms(self) -> tuple[float, float]:
        """Root mean square error of each side, m."""
        first, second = np.sqrt((self.error**2).sum(axis=2).mean(axis=1))
        return float(first), float(second)

    @property
    def rms(self) -> float:
        """Root mean square error of both sides, m."""
        return float(np.sqrt((self.error**2).sum(axis=2).mean()))


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourResult:
    """The sculpture test: two sides of one body meet on its outline.

    Attributes:
        step: (n,) m, first side less second along the outward normal.
        points: (n, 3) m in part.
    """

    step: Array
    points: Array

    @property
    def mismatch(self) -> float:
        """Mean size of the step, m."""
        return float(np.abs(self.step).mean())

    @property
    def worst(self) -> float:
        """Largest size of the step, m."""
        return float(np.abs(self.step).max())


def reach_points(side: SlotSide, p_part: Array, rng: np.random.Generator | None = None) -> Array:
    """Returns where the tip truly goes (n, 3) m in part for nominal points (n, 3) m in part.

    The tool keeps the attitude of the side's posture, base axes.
    """
    turn = np.broadcast_to(attitude(side.posture), (len(p_part), 3, 3))
    wanted = pose(turn, apply(side.T_base_part, p_part))
    joints = compensated_joints(side.model, wanted, side.posture)
    return apply(inverse(side.cell.T_base_part), machine(side.cell, joints, rng))


def slot_points() -> Array:
    """Returns the points (4, 9, 3) m in part at which the slots are read."""
    x, z = np.meshgrid(SLOTS, HEIGHTS, indexing="ij")
    return np.stack([x, np.full_like(x, MIDDLE), z], axis=-1)


def cut_slots(first: SlotSide, second: SlotSide, rng: np.random.Generator) -> SlotResult:
    """Returns the slot test of two sides.

    Args:
        first: Of them.
        second: The same cell and clamping, or the block clamped again.
        rng: Of the repeatability.
    """
    points = slot_points()
    asked = np.concatenate([points.reshape(-1, 3), CHECKED])
    both = np.array([reach_points(side, asked) for side in (first, second)])
    count = points.shape[0] * points.shape[1]
    visited = both[:, :count].copy()
    for k, side in enumerate((first, second)):
        visited[k] += side.cell.sizes.repeatability * rng.normal(size=(count, 3))
    step = ((visited[0] - visited[1]) @ ACROSS).reshape(points.shape[:2])
    measured = SlotTest(
        step=step,
        names=tuple(f"x {x / MM:.0f} mm" for x in SLOTS),
        across=ACROSS,
        R_part_first=_in_part(first),
        R_part_second=_in_part(second),
        frames=_frames(first, second),
    )
    return SlotResult(
        measured=measured,
        evaluation=evaluate_slots(measured),
        error=frozen(both[:, count:] - CHECKED, (2, len(CHECKED), 3), "error"),
    )


def contour(count: int = 72) -> tuple[Array, Array]:
    """Returns points (n, 3) m of the body's outline in part and its outward normals (n, 3).

    r = 150 mm (1 + .12 cos 2w + .08 sin 3w) about the middle of the block, in the plane y = 100 mm.
    """
    w = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    r = 150.0 * MM * (1.0 + 0.12 * np.cos(2.0 * w) + 0.08 * np.sin(3.0 * w))
    slope = 150.0 * MM * (-0.24 * np.sin(2.0 * w) + 0.24 * np.cos(3.0 * w))
    zero = np.zeros_like(w)
    points = 0.5 * SIZE + np.stack([r * np.cos(w), zero, r * np.sin(w)], axis=1)
    along = np.stack(
        [slope * np.cos(w) - r * np.sin(w), zero, slope * np.sin(w) + r * np.cos(w)], axis=1
    )
    normals = np.stack([along[:, 2], zero, -along[:, 0]], axis=1)
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


def cut_contour(first: SlotSide, second: SlotSide, rng: np.random.Generator) -> ContourResult:
    """Returns the sculpture test of two sides; arguments as for :func:`cut_slots`."""
    points, normals = contour()
    apart = reach_points(first, points, rng) - reach_points(second, points, rng)
    return ContourResult(step=np.einsum("ni,ni->n", apart, normals), points=points)


def _in_part(side: SlotSide) -> Array:
    return np.asarray(side.T_base_part[:3, :3].T @ attitude(side.posture))


def _frames(first: SlotSide, second: SlotSide) -> Frames:
    same = np.array_equal(first.T_base_part, second.T_base_part) and np.array_equal(
        first.cell.T_base_part, second.cell.T_base_part
    )
    return "shared" if same else "one per side"
