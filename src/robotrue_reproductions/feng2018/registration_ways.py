"""Ways to tie a program to the block, from the drawing to one estimate of arm, tool and frame.

Each way takes a :class:`Session`, everything that was touched and measured in one cell, and
returns the two sides as they will be cut. All ways of a session share its touches, so that they
differ by the method alone. Simulated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import (
    ProbingEstimate,
    ProbingSettings,
    estimate_probing,
    model_of_estimate,
)
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings
from robotrue.cell.registration.baselines import fit_feature_frame
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, displacement_columns, fit_rigid, pose
from robotrue.core.provenance import Provenance
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue_reproductions.feng2018.machining_cell import (
    START,
    T_BASE_DRAWN,
    T_BASE_FLIPPED,
    CellSizes,
    FengCell,
    Posture,
    feng_cell,
    flip_block,
    touch,
    touch_points,
    tracker_poses,
    with_tool_change,
)
from robotrue_reproductions.feng2018.planned_touches import TIP, touch_planned
from robotrue_reproductions.feng2018.slot_experiment import SlotSide, both_sides

MOST: Final = 30
"""Touches on each of the three sides in a session."""
SPINDLE: Final = 1.5 * DEG
"""rad about each axis, by which the spindle is askew before anybody has looked at it; assumed."""
CORNER: Final = np.array([[10.0, 0.0, 10.0], [390.0, 0.0, 10.0], [10.0, 0.0, 390.0]]) * MM
"""K, L, M (3, 3) m in part: a right angle of 380 mm on the front."""
BACK_CORNER: Final = (
    np.array([[390.0, 200.0, 10.0], [10.0, 200.0, 10.0], [390.0, 200.0, 390.0]]) * MM
)
"""The same on the back."""
_STEPS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Touches:
    """Touches of one side.

    Attributes:
        points: (n, 3) m in part, nominal.
        joints: (n, 6) rad at the touch.
    """

    points: Array
    joints: Array

    def first(self, count: int) -> Touches:
        """Returns the first touches of the side."""
        return Touches(points=self.points[:count], joints=self.joints[:count])


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """Everything touched and measured in one cell.

    Attributes:
        cell: The truth.
        sides: Touches of every side, :data:`MOST` each.
        corner: Touches of :data:`CORNER`, from the front.
        calibrated: Error model from the tracker; None where there is no tracker.
        changed: The same block touched with another tool: cell and touches.
        turned: The block clamped again, its back to the front: cell, touches of points on the back
            in posture R, and of :data:`BACK_CORNER`.
    """

    cell: FengCell
    sides: Mapping[Posture, Touches]
    corner: Touches
    calibrated: ErrorModel | None
    changed: tuple[FengCell, Mapping[Posture, Touches]]
    turned: tuple[FengCell, Touches, Touches]

    @property
    def nominal(self) -> RobotModel:
        """The controller's arm."""
        return self.cell.nominal


def session(
    seed: int, *, sizes: CellSizes | None = None, method: str | None = "ripple", poses: int = 60
) -> Session:
    """Returns the session of a seed.

    Args:
        seed: Of cell, touches and tracker.
        sizes: Of errors and noise.
        method: Of :data:`robotrue.calibration.methods.METHODS`, for the tracker's poses; None: no
            tracker.
        poses: That the tracker measures.
    """
    cell = feng_cell(seed, sizes)
    rng = np.random.default_rng([seed, 43])
    sides = _touch_sides(cell, rng)
    corner = Touches(points=CORNER, joints=touch(cell, CORNER, "R", rng))
    other = with_tool_change(cell, rng)
    turned = flip_block(cell, rng)
    back = touch_points("L", MOST, rng)
    calibrated = None
    measured = tracker_poses(cell, rng, count=poses)
    if method is not None:
        settings = FitSettings(repeatability=cell.sizes.repeatability * RP_PER_SIGMA)
        calibrated = fit(cell.nominal, measured, method=method, settings=settings)
    return Session(
        cell=cell,
        sides=sides,
        corner=corner,
        calibrated=calibrated,
        changed=(other, _touch_sides(other, rng)),
        turned=(
            turned,
            Touches(points=back, joints=touch(turned, back, "R", rng)),
            Touches(points=BACK_CORNER, joints=touch(turned, BACK_CORNER, "R", rng)),
        ),
    )


def _touch_sides(cell: FengCell, rng: np.random.Generator) -> dict[Posture, Touches]:
    out: dict[Posture, Touches] = {}
    for posture in START:
        points = touch_points(posture, MOST, rng)
        out[posture] = Touches(points=points, joints=touch(cell, points, posture, rng))
    return out


def tips(model: ErrorModel | RobotModel, joints: Array) -> Array:
    """Returns the tip predicted by a model, (n, 3) m in base."""
    if isinstance(model, RobotModel):
        return np.asarray(forward(model, joints)[:, :3, 3])
    believed = forward(model.robot, joints)[:, :3, 3] + model.predict(Query(joints=joints)).error
    return np.asarray(believed)


def as_drawn(s: Session) -> tuple[SlotSide, SlotSide]:
    """Returns both sides cut where the drawing has the block."""
    return both_sides(s.cell, s.nominal, T_BASE_DRAWN)


def three_points(s: Session, model: ErrorModel | RobotModel) -> tuple[SlotSide, SlotSide]:
    """Returns the paper's way: a feature frame on three points of the front, K exact."""
    found = fit_feature_frame(
        s.corner.points, tips(model, s.corner.joints), sigma=s.cell.sizes.touch
    )
    return both_sides(s.cell, model, found.T_base_part)


def front(s: Session, model: ErrorModel | RobotModel, count: int = 20) -> tuple[SlotSide, SlotSide]:
    """Returns one frame from points of the front alone, all counting equally."""
    return both_sides(s.cell, model, _frame(model, s.sides["R"].first(count)))


def all_sides(
    s: Session, model: ErrorModel | RobotModel, count: int = 30
) -> tuple[SlotSide, SlotSide]:
    """Returns one frame from points of all three sides."""
    return both_sides(s.cell, model, _frame(model, together(s.sides, count)))


def frame_per_side(
    s: Session, model: ErrorModel | RobotModel, count: int = 10
) -> tuple[SlotSide, SlotSide]:
    """Returns each side cut in its own frame, from its own touches, in its own posture."""
    first, second = (
        SlotSide(
            cell=s.cell,
            posture=posture,
            model=model,
            T_base_part=_frame(model, s.sides[posture].first(count)),
        )
        for posture in ("R", "L")
    )
    return first, second


def frame_and_tip(s: Session, count: int = 30) -> tuple[SlotSide, SlotSide]:
    """Returns frame and tool tip from one fit, kinematics nominal."""
    robot, place = _frame_and_tip(s.nominal, together(s.sides, count))
    return both_sides(s.cell, robot, place)


def tool_not_refitted(s: Session, model: ErrorModel, count: int = 30) -> tuple[SlotSide, SlotSide]:
    """Returns both sides after a tool change that is not in the model."""
    cell, sides = s.changed
    return both_sides(cell, model, _frame(model, together(sides, count)))


def probing_only(s: Session, count: int = 30) -> tuple[SlotSide, SlotSide]:
    """Returns arm, tool tip and frame from touches alone: one estimate, no tracker."""
    return _cut_estimated(s.cell, s.nominal, together(s.sides, count), tool_sigma=TIP)


def probing_planned(s: Session, count: int = 30) -> tuple[SlotSide, SlotSide]:
    """Returns the same with touches planned for the two sides that will be cut."""
    return _cut_estimated(s.cell, s.nominal, _touch_planned(s.cell, count), tool_sigma=TIP)


def joint_estimate(s: Session, model: ErrorModel, count: int = 30) -> tuple[SlotSide, SlotSide]:
    """Returns the calibrated arm and the frame in one estimate with the touches."""
    return _cut_estimated(s.cell, model, together(s.sides, count), tool_sigma=0.0)


def tool_refitted(s: Session, model: ErrorModel, count: int = 30) -> tuple[SlotSide, SlotSide]:
    """Returns the same after a tool change, with the deviation of the new tip stated."""
    cell, sides = s.changed
    return _cut_estimated(cell, model, together(sides, count), tool_sigma=TIP)


def tool_refitted_planned(
    s: Session, model: ErrorModel, count: int = 30
) -> tuple[SlotSide, SlotSide]:
    """Returns the same with planned touches."""
    cell = s.changed[0]
    return _cut_estimated(cell, model, _touch_planned(cell, count), tool_sigma=TIP)


def probing_set(touches: Touches) -> ProbingSet:
    """Returns touches as the estimator takes them."""
    names = tuple(str(i + 1) for i in range(len(touches.points)))
    return ProbingSet(
        names=names,
        point=touches.points,
        joints=touches.joints,
        source="simulated touches",
        provenance=Provenance(simulated=True, instrument="touch probe"),
    )


def estimate_cell(
    cell: FengCell, model: ErrorModel | RobotModel, touches: Touches, *, tool_sigma: float
) -> ProbingEstimate:
    """Returns the one estimate of arm, tip and frame from touches of a cell.

    Args:
        cell: Its stated noise is used by the estimate.
        model: Calibrated, or the nominal arm.
        touches: Of one clamping.
        tool_sigma: m per axis, deviation of the tip.
    """
    settings = ProbingSettings(
        touch_sigma=cell.sizes.touch,
        tool_sigma=tool_sigma,
        priors=FitSettings(repeatability=cell.sizes.repeatability * RP_PER_SIGMA),
    )
    arm = NominalModel(robot=model) if isinstance(model, RobotModel) else model
    return estimate_probing(arm, probing_set(touches), settings)


def turned_as_drawn(s: Session) -> tuple[SlotSide, SlotSide]:
    """Returns the block cut from the front, turned, and cut from the front again, as drawn."""
    return _cut_turned(s, s.nominal, T_BASE_DRAWN, T_BASE_FLIPPED)


def turned_three_points(s: Session, model: ErrorModel | RobotModel) -> tuple[SlotSide, SlotSide]:
    """Returns the same with three touched points in each clamping, K exact."""
    before, after = (
        fit_feature_frame(t.points, tips(model, t.joints), sigma=s.cell.sizes.touch).T_base_part
        for t in (s.corner, s.turned[2])
    )
    return _cut_turned(s, model, before, after)


def turned_points(
    s: Session, model: ErrorModel | RobotModel, count: int = 20
) -> tuple[SlotSide, SlotSide]:
    """Returns the same with many touched points in each clamping."""
    first, second = s.sides["R"].first(count), s.turned[1].first(count)
    return _cut_turned(s, model, _frame(model, first), _frame(model, second))


def with_spindle_askew(seed: int) -> Session:
    """Returns a session without tracker whose spindle is askew: the state before anything."""
    return session(seed, sizes=CellSizes(spindle=SPINDLE), method=None)


def together(sides: Mapping[Posture, Touches], count: int) -> Touches:
    """Returns ``count`` touches, a third from each side."""
    each = [sides[posture].first(count // len(START)) for posture in START]
    return Touches(
        points=np.concatenate([t.points for t in each]),
        joints=np.concatenate([t.joints for t in each]),
    )


def _frame(model: ErrorModel | RobotModel, touches: Touches) -> Array:
    return fit_rigid(touches.points, tips(model, touches.joints))


def _cut_estimated(
    cell: FengCell, model: ErrorModel | RobotModel, touches: Touches, *, tool_sigma: float
) -> tuple[SlotSide, SlotSide]:
    found = estimate_cell(cell, model, touches, tool_sigma=tool_sigma)
    return both_sides(cell, model_of_estimate(found), found.T_base_part[0])


def _touch_planned(cell: FengCell, count: int) -> Touches:
    points, joints = touch_planned(cell, count, np.random.default_rng([cell.seed, 61, count]))
    return Touches(points=points, joints=joints)


def _cut_turned(
    s: Session, model: ErrorModel | RobotModel, before: Array, after: Array
) -> tuple[SlotSide, SlotSide]:
    return (
        SlotSide(cell=s.cell, posture="R", model=model, T_base_part=before),
        SlotSide(cell=s.turned[0], posture="R", model=model, T_base_part=after),
    )


def _frame_and_tip(robot: RobotModel, touches: Touches) -> tuple[RobotModel, Array]:
    """Gauss-Newton over the frame's six and the tip's three numbers."""
    tool = robot.T_flange_tool.copy()
    T = fit_rigid(touches.points, tips(robot, touches.joints))
    turn = forward(robot, touches.joints)[:, :3, :3] @ tool[:3, :3].T
    n = len(touches.points)
    for _ in range(_STEPS):
        now = robot.with_tool(tool)
        residual = tips(now, touches.joints) - apply(T, touches.points)
        lever = touches.points @ T[:3, :3].T
        frame = displacement_columns(lever)
        rows = np.concatenate([frame, -turn], axis=-1).reshape(3 * n, 9)
        step = np.linalg.lstsq(rows, residual.ravel(), rcond=None)[0]
        turned = matrix_from_rotation_vector(step[3:6]) @ T[:3, :3]
        T = pose(turned, T[:3, 3] + step[:3])
        tool[:3, 3] += step[6:]
    return robot.with_tool(tool), T
