"""Files of the virtual cell as its user would have them, for the how-to pages. Simulated.

    python -m robotrue_reproductions.feng2018.example_files [FOLDER] [--seed N]

writes a cell, three rounds of touches of three points, and what is named in :data:`FILES`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG, MM
from robotrue_reproductions.feng2018.machining_cell import (
    FengCell,
    Posture,
    feng_cell,
    touch,
)
from robotrue_reproductions.feng2018.registration_ways import CORNER

SIMULATED: Final = Provenance(simulated=True, instrument="virtual cell")
CELL: Final = """schema = 1
[robot]
preset = "KUKA KR160 R1570"
[tool]  # the probe
xyz_mm = [0, 0, 300]
[base]  # where the drawing has the block
xyz_mm = [800, -100, 400]
[repeatability]
mm = 0.1
"""
HEAD: Final = "name,px_mm,py_mm,pz_mm,j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg"
LEAN: Final = 5.0 * DEG
"""Of the wrist from touch to touch."""
FILES: Final = (
    "cell.toml", "round1.csv", "round2.csv", "round3.csv", "table.csv", "tool.csv"
)  # fmt: skip
TIP: Final = np.array([8.3, -5.2, 240.4]) * MM
"""Of the tool in ``tool.csv``."""
TABLE: Final = np.array([[10, 0, 10], [390, 0, 10], [10, 0, 390], [390, 0, 390]]) * MM


def write_example(folder: Path, seed: int = 1) -> None:
    """Writes the files of a cell."""
    cell = feng_cell(seed)
    rng = np.random.default_rng([seed, 79])
    (folder / "cell.toml").write_text(CELL, encoding="utf-8")
    for number in (1, 2, 3):
        _write(folder / f"round{number}.csv", cell, CORNER, "R", ("K", "L", "M"), rng)
    names = ("A", "B", "C", "D")
    _write(folder / "table.csv", cell, TABLE, "R", names, rng)
    _write(folder / "tool.csv", with_tool(cell, TIP), TABLE, "R", names, rng)


def with_tool(cell: FengCell, tip: Array) -> FengCell:
    """Returns the cell with another tool, of which the controller knows the place to 10 mm."""
    actual = replace(
        cell.robot.actual, T_flange_tool=pose(cell.robot.actual.T_flange_tool[:3, :3], tip)
    )
    nominal = cell.robot.nominal.with_tool(pose(np.eye(3), np.round(tip, 2)))
    return replace(cell, robot=replace(cell.robot, actual=actual, nominal=nominal))


def _write(
    path: Path,
    cell: FengCell,
    points: Array,
    posture: Posture,
    names: tuple[str, ...],
    rng: np.random.Generator,
) -> None:
    """One file of touches in joints, numbers as a pendant shows them."""
    joints = touch(cell, points, posture, rng, tilt=LEAN) / DEG
    rows = [
        ",".join([name, *(f"{v:g}" for v in p), *(f"{v:.4f}" for v in q)])
        for name, p, q in zip(names, points / MM, joints, strict=True)
    ]
    path.write_text("\n".join([f"{mark_line(SIMULATED)}{HEAD}", *rows]) + "\n", encoding="utf-8")


def main() -> None:
    """Writes into the folder of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    write_example(asked.folder, asked.seed)


if __name__ == "__main__":
    main()
