"""Floor and oscillation of the three-point recursion in the virtual cell. Simulated.

The error of a pass is the worst of the three points: where the tip truly goes when the model's
points are run, less where the part's are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.registration.rounds import Adjustment
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import apply, pose
from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel
from robotrue_reproductions.feng2018.machining_cell import (
    T_BASE_DRAWN,
    CellSizes,
    FengCell,
    attitude,
    compensated_joints,
    machine,
    touch,
)
from robotrue_reproductions.feng2018.registration_ways import CORNER, tips
from robotrue_reproductions.feng2018.slot_experiment import CHECKED
from robotrue_reproductions.feng2018.three_point_recursion import adjust_recursively

PASSES: Final = 20
SETTLED: Final = 5
"""First pass that counts for floor and oscillation."""
STOP: Final = 0.2 * MM
"""The paper's position tolerance."""
_ARM: Final = 1.2 * MM
"""Error of the arm; a leaning wrist changes what it and the tip do by the sine of the lean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorCase:
    """Errors in a run of the recursion.

    Attributes:
        name: Of the case.
        sizes: Of errors and noise.
        tilt: rad, lean of the wrist from touch to touch.
        calibrated: Probe and run through a calibrated model.
    """

    name: str
    sizes: CellSizes
    tilt: float = 5.0 * DEG
    calibrated: bool = False


def _sizes(touch: float, tip: float, repeatability: float = 0.03, arm: float = 1.0) -> CellSizes:
    return CellSizes(touch=touch * MM, tip=tip * MM, repeatability=repeatability * MM, arm=arm)


CASES: Final = (
    FloorCase(name="no noise, same posture", sizes=_sizes(0.0, 0.0, 0.0), tilt=0.0),
    FloorCase(name="touch .1, repeatability .03 mm", sizes=_sizes(0.1, 0.0), tilt=0.0),
    FloorCase(name="+ wrist leans 5 deg", sizes=_sizes(0.1, 0.0)),
    FloorCase(name="+ tip .3 mm per axis", sizes=_sizes(0.1, 0.3)),
    FloorCase(name="+ tip 1 mm per axis", sizes=_sizes(0.1, 1.0)),
    FloorCase(name="touch .3 mm, by eye", sizes=_sizes(0.3, 0.3)),
    FloorCase(name="arm 3 times worse", sizes=_sizes(0.1, 0.3, arm=3.0)),
    FloorCase(name="calibrated, probe and run", sizes=_sizes(0.1, 0.3), calibrated=True),
)
"""From a clean arm to a calibrated one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorRun:
    """One cell's recursion.

    Attributes:
        error: (passes + 1,) m, true worst error of each run, the first as drawn.
        block: m, rms error over the block from the front at the end.
        own: What the recursion reports of itself when it may stop.
    """

    error: Array
    block: float
    own: Adjustment

    @property
    def late(self) -> Array:
        """Errors of the settled passes, m."""
        return self.error[SETTLED:]


def run_recursion(
    case: FloorCase, cell: FengCell, model: ErrorModel | RobotModel, rng: np.random.Generator
) -> FloorRun:
    """Returns the recursion of one cell, twice: all passes, and stopped by its own rule.

    Args:
        case: Errors; its sizes must be those of the cell.
        cell: The truth.
        model: The arm as probe and run have it.
        rng: Of the touching.
    """
    part = apply(cell.T_base_part, CORNER)
    turn = np.broadcast_to(attitude("R"), (3, 3, 3))
    errors: list[float] = []

    def probe(run: Array) -> Array:
        ran = machine(cell, compensated_joints(model, pose(turn, run), "R"), rng)
        errors.append(float(np.linalg.norm(ran - part, axis=1).max()))
        return tips(model, touch(cell, CORNER, "R", rng, tilt=case.tilt))

    wrist = case.tilt * (case.sizes.tip + _ARM * case.sizes.arm)
    sigma = float(np.linalg.norm([case.sizes.touch, case.sizes.repeatability, wrist]))
    found = adjust_recursively(
        CORNER, T_BASE_DRAWN, probe, sigma=sigma, position_tolerance=0.0, settled=99, most=PASSES
    )
    error = np.array(errors)
    own = adjust_recursively(CORNER, T_BASE_DRAWN, probe, sigma=sigma, position_tolerance=0.0)
    wide = np.broadcast_to(attitude("R"), (len(CHECKED), 3, 3))
    wanted = pose(wide, apply(found.T_base_part, CHECKED))
    off = machine(cell, compensated_joints(model, wanted, "R")) - apply(cell.T_base_part, CHECKED)
    return FloorRun(
        error=frozen(error, (None,), "error"),
        block=float(np.sqrt((off**2).sum(axis=1).mean())),
        own=own,
    )
