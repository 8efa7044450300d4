"""The RoboDK script on a made-up station whose poses are matrices of RoboDK's own package."""

from __future__ import annotations

import runpy
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotrue.cell.config import read_cell
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

robomath = pytest.importorskip("robodk.robomath")
robolink = pytest.importorskip("robodk.robolink")
SCRIPT = Path(__file__).parents[2] / "examples" / "robodk" / "robotrue_robodk.py"
script = runpy.run_path(str(SCRIPT))

STUB = """import sys
from pathlib import Path
*files, _, out = sys.argv[3:]
assert sys.argv[1] == "compensate" and sys.argv[2].endswith("m.robotrue"), sys.argv
for file in map(Path, files):
    (Path(out) / file.name).write_bytes(file.read_bytes() + b"; compensated")
"""


@dataclass(eq=False)
class Item:
    """An item of the station."""

    name: str
    pose: Any = None
    parent: Any = None
    made: dict[str, str] = field(default_factory=dict)

    def Name(self) -> str:
        return self.name

    def Parent(self) -> Any:
        return self.parent

    def Valid(self) -> bool:
        return True

    def PoseAbs(self) -> Any:
        return self.pose if self.parent is None else self.parent.PoseAbs() * self.pose

    def PoseTool(self) -> Any:
        return self.pose

    def JointLimits(self) -> tuple[Any, Any, float]:
        return robomath.Mat([-185.0] * 6), robomath.Mat([185.0] * 6), 0.0

    def MakeProgram(self, folder: str, mode: int) -> tuple[bool, str, bool]:
        assert mode == robolink.RUNMODE_MAKE_ROBOTPROG
        for name, text in self.made.items():
            (Path(folder) / name).write_text(text)
        return bool(self.made), "no post processor", False


@dataclass
class Station:
    """The calls of a Robolink that the script makes."""

    items: dict[int, list[Item]]
    added: list[str] = field(default_factory=list)

    def ItemList(self, kind: int) -> list[Item]:
        return self.items.get(kind, [])

    def AddFile(self, path: str) -> Item:
        self.added.append(path)
        return Item(path)


def station(name: str = "KUKA KR 160 R1570") -> Station:
    pose = robomath.KUKA_2_Pose
    base = Item("Robot base", pose([1000, 200, 500, 30, 10, -5]))
    fixture = Item("Fixture 3", pose([800, -100, 450, 15, 20, -40]), base)
    clamp = Item("Aufspannung \u00dc", pose([10, 20, 30, 10, 90, 30]), fixture)  # B = 90 deg
    floor = Item("Floor", pose([0, 0, 0, 0, 0, 0]))
    tool = pose([1.5, 0, 215.5, 0, 30, 180])
    robot = Item(name, tool, base)
    return Station(
        {
            robolink.ITEM_TYPE_ROBOT: [robot],
            robolink.ITEM_TYPE_FRAME: [base, fixture, clamp, floor],
            robolink.ITEM_TYPE_TOOL: [
                Item("Spindle 2", tool, robot),
                Item("Tool of another arm", tool, Item("other")),
            ],
        }
    )


def matrix(mat: Any) -> np.ndarray:
    found = np.array(mat.rows, dtype=float)
    found[:3, 3] *= MM
    return found


def test_the_cell_holds_tool_and_frames_of_the_station(tmp_path: Path) -> None:
    made = station()
    path = script["write_cell"](made, tmp_path)
    cell = read_cell(path)
    assert cell.robot.name == "KUKA KR160 R1570"
    tool = made.items[robolink.ITEM_TYPE_TOOL][0].pose
    np.testing.assert_allclose(cell.robot.T_flange_tool, matrix(tool), atol=1e-10)
    base, fixture, clamp, floor = made.items[robolink.ITEM_TYPE_FRAME]
    into_base = robomath.invH(base.pose)
    bases = {str(key).casefold(): T for key, T in cell.controller.bases.items()}
    for key, item in (
        ("3", fixture),
        ("fixture 3", fixture),
        (clamp.name, clamp),
        ("floor", floor),
    ):
        expected = matrix(into_base * item.PoseAbs())
        np.testing.assert_allclose(bases[key.casefold()], expected, atol=1e-9)
    assert "robot base" not in bases
    tools = {str(key).casefold() for key in cell.controller.tools}
    assert {"2", "spindle 2"} <= tools
    assert "tool of another arm" not in tools


def test_an_existing_cell_is_kept_and_an_unknown_robot_refused(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text("mine")
    path = script["write_cell"](station("Robot of nobody"), tmp_path)
    assert path.name == "cell_2.toml"
    assert (tmp_path / "cell.toml").read_text() == "mine"
    with pytest.raises(ConfigurationError, match="Robot of nobody"):
        read_cell(path)


def test_a_program_goes_out_and_comes_back_compensated(tmp_path: Path) -> None:
    (tmp_path / "stub.py").write_text(STUB)
    made, program = station(), Item("cut", made={"cut.src": "DEF cut()", "cut.dat": "DEFDAT cut"})
    command = (sys.executable, str(tmp_path / "stub.py"))
    script["compensate_program"](made, program, tmp_path / "m.robotrue", tmp_path, command)
    assert [Path(each).name for each in made.added] == ["cut.dat", "cut.src"]
    assert Path(made.added[1]).read_text() == "DEF cut(); compensated"
    with pytest.raises(SystemExit, match="did not generate empty: no post processor"):
        script["compensate_program"](
            made, Item("empty"), tmp_path / "m.robotrue", tmp_path, command
        )
    with pytest.raises(SystemExit, match="cut was not compensated"):
        script["compensate_program"](made, program, tmp_path / "other", tmp_path, command)
