"""Where the arm works, read from programs: with the program's own tools, or refused in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.cell import Cell
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.errors import ReachError
from robotrue.planning.work_area import program_postures, read_machining
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset

Z = np.array([0.0, 0.0, 1.0])
TARGETS = np.array([[1000.0, 0.0, 900.0], [1000.0, 100.0, 900.0]]) * MM


def tool(length_mm: float) -> np.ndarray:
    return pose(np.eye(3), length_mm * MM * Z)


def cell() -> Cell:
    return Cell(robot=preset("KUKA KR160 R1570").with_tool(tool(100.0)))


def program(folder: Path, moves: str, length_mm: float) -> Path:
    path = folder / "job.src"
    path.write_text(
        "DEF job( )\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n"
        f"$TOOL={{X 0,Y 0,Z {length_mm:g},A 0,B 0,C 0}}\n{moves}END\n"
    )
    return path


@pytest.mark.parametrize("length_mm", [100.0, 200.0])
def test_a_program_is_posed_with_its_own_tool(tmp_path: Path, length_mm: float) -> None:
    moves = "".join("LIN {{X {:g},Y {:g},Z {:g},A 0,B 90,C 0}}\n".format(*p / MM) for p in TARGETS)
    path, arm = program(tmp_path, moves, length_mm), cell()
    machining, _ = read_machining(arm, [path], {0: np.eye(4)}, ("part",), tip_axis=Z)
    for joints in (machining.joints, program_postures(arm, path).joints):
        tip = forward(arm.robot.with_tool(tool(length_mm)), joints)[:, :3, 3]
        np.testing.assert_allclose(tip, TARGETS, atol=1e-9)


def test_a_program_of_axis_targets_alone_has_no_work_area(tmp_path: Path) -> None:
    path = program(tmp_path, "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\n", 100.0)
    with pytest.raises(ReachError, match="no target of this program gives a posture"):
        program_postures(cell(), path)
