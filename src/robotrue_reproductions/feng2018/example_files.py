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
from robotrue.core.poses import apply, pose
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG, MM
from robotrue_reproductions.feng2018.machining_cell import (
    SIZE,
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
    "cell.toml", "round1.csv", "round2.csv", "round3.csv", "table.csv", "tool.csv", "blank.csv",
    "part.stl", "front.apt", "back.apt", "top.apt",
)  # fmt: skip
HALF: Final = np.array([110.0, 80.0, 110.0])
"""mm, half axes of the finished part, an egg in the middle of the block."""
SAWN: Final = 6.0
"""mm by which the saw cut the block short at its back."""
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
    _write_blank(folder / "blank.csv", cell, rng)
    _write_part(folder)


def _write_blank(path: Path, cell: FengCell, rng: np.random.Generator) -> None:
    """Four touches of each side of the block except its bottom, as the arm reads them."""
    rows = [f"{mark_line(SIMULATED)}name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm,nx,ny,nz"]
    size = SIZE / MM
    for axis, sign, name in (
        (0, -1, "left"), (0, 1, "right"), (1, -1, "front"), (1, 1, "back"), (2, 1, "top")
    ):  # fmt: skip
        normal = np.zeros(3)
        normal[axis] = sign
        for _ in range(4):
            point = rng.uniform(20.0, size - 20.0)
            point[axis] = size[axis] if sign > 0 else 0.0
            true = point - SAWN * normal * (name == "back")
            at = apply(cell.T_base_part, true * MM) / MM + 0.1 * rng.normal(size=3)
            numbers = [*(f"{v:.3f}" for v in (*point, *at)), *(f"{v:g}" for v in normal)]
            rows.append(",".join([name, *numbers]))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _write_part(folder: Path) -> None:
    """The egg as STL, and a raster over it from the front, the back and above."""
    middle = 0.5 * SIZE / MM
    along, up = np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    unit = np.array(
        [[[np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)] for u in along] for v in up]
    )
    grid = np.round(middle + HALF * unit, 6)
    lines = ["solid egg"]
    for i in range(12):
        for j in range(24):
            a, b, c, d = grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j]
            for face in ((a, b, c), (a, c, d)):
                if np.linalg.norm(np.cross(face[1] - face[0], face[2] - face[0])) > 1e-6:
                    lines += ["facet normal 0 0 0", "outer loop"]
                    lines += [f"vertex {x:.6f} {y:.6f} {z:.6f}" for x, y, z in face]
                    lines += ["endloop", "endfacet"]
    (folder / "part.stl").write_text("\n".join([*lines, "endsolid egg"]) + "\n")
    for name, axis, sign in (("front", 1, -1.0), ("back", 1, 1.0), ("top", 2, 1.0)):
        toward = np.zeros(3)
        toward[axis] = sign
        first, second = [k for k in range(3) if k != axis]
        goto = []
        steps = np.linspace(-130.0, 130.0, 14)
        for row, v in enumerate(np.linspace(-0.95, 0.95, 14) * (HALF[second] + 20.0)):
            for u in steps if row % 2 == 0 else steps[::-1]:
                point = middle.copy()
                point[first] += u
                point[second] += v
                depth = 1.0 - (u / HALF[first]) ** 2 - (v / HALF[second]) ** 2
                point[axis] += sign * HALF[axis] * np.sqrt(max(depth, 0.0))
                goto.append("GOTO/" + ",".join(f"{n:.4f}" for n in (*point, *toward)))
        head = f"UNITS/MM\nFEDRAT/3000,MMPM\nOPNAME/{name}"
        (folder / f"{name}.apt").write_text("\n".join([head, *goto, "FINI"]) + "\n")


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
