"""An arm on a rail of six metres, to practise on. Simulated.

    python -m robotrue.simulation.rail_practice FOLDER [--seed N]

writes ``cell.toml``, ``measured.csv`` (90 poses along the rail, seen by a tracker whose frame is
not known), ``check.csv`` (60 others) and ``part.src``, a program that states E1. The arm is that of
:mod:`robotrue.simulation.warm_shift`, cold. The rail is .1 mm/m too long or too short and its
direction 1 mrad off (one sigma). Its profiles are waves of 3 to 15 m, .1 mm and .05 mrad in the
root mean square, of any phase: none is a function of the error model. All sizes are assumed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.conditions import EXTERNAL_AXES, Rail
from robotrue.core.poses import pose
from robotrue.core.provenance import Provenance
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import MM
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.simulation.warm_shift import (
    CELL,
    REPEATABILITY,
    TRACKER,
    arm_as_built,
    joints_of,
    points_of,
)

TRAVEL: Final = 6.0
DIRECTION: Final = np.array([0.0, 1.0, 0.0])
"""In base, as the cell states it."""
SCALE: Final = 1e-4
MISALIGNED: Final = 1e-3
WAVES: Final = 5
LENGTHS: Final = (3.0, 15.0)
"""m, of the waves of the profiles."""
PROFILE: Final = 0.1 * MM
TURNS: Final = 5e-5
"""rad."""
T_TRACKER_BASE: Final = pose(
    matrix_from_rotation_vector(np.array([0.01, -0.02, 0.8])), np.array([4.0, -3.0, 0.5])
)
POSES: Final = 90
CHECKED: Final = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class RailArm:
    """An arm and its rail as they are.

    Attributes:
        robot: With its errors.
        slope: (3,) m/m, of the base off the stated rail, base axes.
        length: (6, w) m, waves of the profiles: shifts and turns of the base.
        phase: (6, w) rad.
    """

    robot: RobotModel
    slope: Array
    length: Array
    phase: Array

    def points(self, joints: Array, place: Array) -> Array:
        """Where the reflector is, (n, 3) m, in the base as the rail is stated to carry it."""
        sizes = np.repeat([PROFILE, TURNS], 3) * np.sqrt(2.0 / WAVES)
        angle = 2.0 * np.pi * place[:, None, None] / self.length + self.phase
        motion = sizes * np.sin(angle).sum(axis=2)
        turn = matrix_from_rotation_vector(motion[:, 3:])
        point = (turn @ points_of(self.robot, joints)[:, :, None])[:, :, 0]
        return np.asarray(point + motion[:, :3] + place[:, None] * self.slope)


def draw_rail(nominal: RobotModel, rng: np.random.Generator) -> RailArm:
    """An arm and a rail as they were built."""
    slope = np.array([MISALIGNED, SCALE, MISALIGNED]) * rng.standard_normal(3)
    return RailArm(
        robot=arm_as_built(nominal, rng),
        slope=slope,
        length=rng.uniform(*LENGTHS, (6, WAVES)),
        phase=rng.uniform(0.0, 2.0 * np.pi, (6, WAVES)),
    )


def measure_rail(
    nominal: RobotModel, arm: RailArm, count: int, rng: np.random.Generator, *, still: bool = False
) -> tuple[MeasurementSet, Array]:
    """Returns rows of a tracker, and the true reflector positions, (n, 3) m, both in its frame.

    Args:
        nominal: For the postures.
        arm: The truth.
        count: Rows.
        rng: Of postures, places and noise.
        still: The arm stays where its base is as stated, without a rail in the data.
    """
    joints = joints_of(nominal, count, rng)
    place = np.zeros(count) if still else rng.uniform(0.0, TRAVEL, count)
    true = arm.points(joints, place) + place[:, None] * DIRECTION
    true = true @ T_TRACKER_BASE[:3, :3].T + T_TRACKER_BASE[:3, 3]
    external = np.full((count, EXTERNAL_AXES), np.nan)
    if not still:
        external[:, 0] = place
    noise = np.hypot(REPEATABILITY, TRACKER)
    rows = MeasurementSet(
        joints=joints,
        position=true + rng.normal(0.0, noise, true.shape),
        covariance=np.tile(TRACKER**2 * np.eye(3), (count, 1, 1)),
        frame="tracker",
        external=external,
        rail=None if still else Rail(number=1, direction=DIRECTION),
        provenance=Provenance(simulated=True, instrument="virtual tracker"),
    )
    return rows, np.asarray(true)


RAIL_CELL: Final = f"""{CELL}
[tracker]
frame = "unknown"
[[controller.external]]
axis = 1
along = [0, 1, 0]
carries = ["robot"]
"""
PROGRAM: Final = """DEF part()
$TOOL = {X 0, Y 0, Z 0, A 0, B 0, C 0}
$BASE = {X 0, Y 0, Z 0, A 0, B 0, C 0}
PTP {A1 0, A2 -90, A3 90, A4 0, A5 30, A6 0, E1 500}
LIN {X 1200, Y 500, Z 900, A 0, B 90, C 0, E1 500}
LIN {X 1200, Y 2500, Z 900, A 0, B 90, C 0, E1 2500}
END
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes the files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args(arguments)
    asked.folder.mkdir(parents=True, exist_ok=True)
    rng, nominal = np.random.default_rng(asked.seed), preset("KR160")
    arm = draw_rail(nominal, rng)
    for name, count in (("measured.csv", POSES), ("check.csv", CHECKED)):
        write_canonical(asked.folder / name, measure_rail(nominal, arm, count, rng)[0])
    (asked.folder / "cell.toml").write_text(RAIL_CELL, encoding="utf-8")
    (asked.folder / "part.src").write_text(PROGRAM, encoding="utf-8")


if __name__ == "__main__":
    main()
