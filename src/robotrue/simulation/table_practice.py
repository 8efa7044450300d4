"""A rotary table next to an arm, to practise on. Simulated.

    python -m robotrue.simulation.table_practice FOLDER [--seed N]

writes ``cell.toml``, ``measured.csv`` (90 poses of the arm, seen by a tracker whose frame is not
known), ``table.csv`` (4 points on the table at 12 angles, seen by the same tracker) and
``part.src``, a program whose targets are on the table. The arm is that of
:mod:`robotrue.simulation.warm_shift`, cold. The axis of the table is off by .4 mm and tilted by
.4 mrad (one sigma, each way) against the cell, its reading has a scale of 20 ppm and, as its
run-out and wobble, harmonics one to four of 20 um and 20 urad over their order: the third and the
fourth are no functions of the error model. All sizes are assumed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.conditions import EXTERNAL_AXES
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.provenance import Provenance
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM, UM
from robotrue.measurement.formats.canonical import POSITION, write_canonical
from robotrue.measurement.formats.sheet import number_columns, write_columns
from robotrue.measurement.table_set import ANGLES, TableSet
from robotrue.program.external_axes import ExternalAxis
from robotrue.robot.presets import preset
from robotrue.simulation.rail_practice import (
    POSES,
    T_TRACKER_BASE,
    draw_rail,
    measure_rail,
)
from robotrue.simulation.warm_shift import CELL, TRACKER

AXIS: Final = ExternalAxis(
    number=2,
    direction=np.array([0.0, 0.0, 1.0]),
    point=np.array([1.1, 0.0, 0.3]),
    frames=("1",),
)
"""As the cell states it."""
OFF: Final = 0.4 * MM
TILT: Final = 4e-4
SCALE: Final = 2e-5
ORDERS: Final = np.arange(1, 5)
RUN_OUT: Final = 20.0 * UM
WOBBLE: Final = 2e-5
"""m and rad, amplitude of the first harmonic."""
SETTING: Final = 5e-6
"""rad, sd with which an angle is reached."""
POINTS: Final = np.array([[0.4, 0.0, 0.0], [0.0, 0.4, 0.1], [-0.35, -0.1, 0.25], [0.1, -0.4, 0.0]])
"""m, on the table, from the point on its axis."""
COUNT: Final = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class TableAsBuilt:
    """A table as it is.

    Attributes:
        stated: Its axis as the cell states it.
        axis: As it is.
        scale: Of its reading.
        amplitude: (6, h) m and rad, of the harmonics of run-out and wobble.
        phase: (6, h) rad.
    """

    stated: ExternalAxis
    axis: ExternalAxis
    scale: float
    amplitude: Array
    phase: Array

    def motion(self, angle: Array) -> Array:
        """Returns the motion (n, 4, 4) of the table in base from where it is at ``at``."""
        turned = (angle - self.axis.at) * (1.0 + self.scale)
        center = np.zeros(3) if self.axis.point is None else self.axis.point
        turn = matrix_from_rotation_vector(turned[:, None] * self.axis.direction)
        plain = pose(turn, center - turn @ center)
        first = self._run_out(np.array([self.axis.at]))
        return np.asarray(self._run_out(angle) @ plain @ inverse(first))

    def _run_out(self, angle: Array) -> Array:
        center = np.zeros(3) if self.axis.point is None else self.axis.point
        waves = np.cos(ORDERS * angle[:, None, None] + self.phase)
        motion = (self.amplitude * waves).sum(axis=2)
        turn = matrix_from_rotation_vector(motion[:, 3:])
        return pose(turn, motion[:, :3] + center - turn @ center)


def draw_table(rng: np.random.Generator, stated: ExternalAxis = AXIS) -> TableAsBuilt:
    """Returns a table as it was built and set up."""
    direction = stated.direction + np.cross(TILT * rng.standard_normal(3), stated.direction)
    center = np.zeros(3) if stated.point is None else stated.point
    return TableAsBuilt(
        stated=stated,
        axis=ExternalAxis(
            number=stated.number,
            direction=direction,
            point=center + OFF * rng.standard_normal(3),
            at=stated.at,
        ),
        scale=SCALE * rng.standard_normal(),
        amplitude=np.repeat([RUN_OUT, WOBBLE], 3)[:, None] / ORDERS * rng.standard_normal((6, 4)),
        phase=rng.uniform(0.0, 2.0 * np.pi, (6, 4)),
    )


def measure_table(
    table: TableAsBuilt,
    rng: np.random.Generator,
    *,
    points: Array = POINTS,
    angles: Array | None = None,
) -> TableSet:
    """Returns points (p, 3) m on the table, seen by a tracker at angles (a,) rad."""
    if angles is None:
        angles = np.arange(COUNT) * 2.0 * np.pi / COUNT - np.pi
    center = np.zeros(3) if table.stated.point is None else table.stated.point
    angle = np.repeat(angles, len(points))
    reached = np.repeat(angles + SETTING * rng.standard_normal(len(angles)), len(points))
    point = np.tile(np.arange(len(points)), len(angles))
    place = apply(table.motion(reached), (points + center)[point])
    seen = apply(T_TRACKER_BASE[None], place) + TRACKER * rng.standard_normal(place.shape)
    external = np.full((len(angle), EXTERNAL_AXES), np.nan)
    external[:, table.stated.number - 1] = angle
    return TableSet(
        point=point,
        names=tuple(f"P{k + 1}" for k in range(len(points))),
        external=external,
        position=seen,
        covariance=np.tile(TRACKER**2 * np.eye(3), (len(angle), 1, 1)),
        frame="tracker",
        provenance=Provenance(simulated=True, instrument="virtual tracker"),
    )


def write_table_points(path: Path, rows: TableSet) -> None:
    """Writes points on a table as the CSV that ``calibrate --table`` reads."""
    stated = [k for k in range(EXTERNAL_AXES) if np.isfinite(rows.external[:, k]).all()]
    columns = {"point": [rows.names[k] for k in rows.point.tolist()]}
    columns |= number_columns([ANGLES[k] for k in stated], rows.external[:, stated] / DEG)
    columns |= number_columns(POSITION, rows.position / MM)
    write_columns(path, columns, rows.provenance)


TABLE_CELL: Final = f"""{CELL}
[tracker]
frame = "unknown"
[[controller.base]]
number = 1
xyz_mm = [1100, 0, 300]
[[controller.external]]
axis = 2
about = [0, 0, 1]
through_mm = [1100, 0, 300]
at_deg = 0
carries = ["1"]
"""
PROGRAM: Final = """DEF part()
$TOOL = {X 0, Y 0, Z 0, A 0, B 0, C 0}
BAS(#EX_BASE, 1)
PTP {A1 0, A2 -90, A3 90, A4 0, A5 30, A6 0, E2 0}
LIN {X 200, Y 0, Z 200, A 0, B 180, C 0, E2 0}
LIN {X 200, Y 0, Z 200, A -90, B 180, C 0, E2 90}
LIN {X 200, Y 0, Z 200, A 160, B 180, C 0, E2 200}
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
    rows, _ = measure_rail(nominal, arm, POSES, rng, still=True)
    write_canonical(asked.folder / "measured.csv", rows)
    write_table_points(asked.folder / "table.csv", measure_table(draw_table(rng), rng))
    (asked.folder / "cell.toml").write_text(TABLE_CELL, encoding="utf-8")
    (asked.folder / "part.src").write_text(PROGRAM, encoding="utf-8")


if __name__ == "__main__":
    main()
