"""[controller] of cell.toml: what programs name, with every fault named by its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.cell import config
from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import read_cell
from robotrue.cell.toml_edit import rename_files
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

HEAD = 'schema = 1\n[robot]\npreset = "UR5"\n'
EVERY = """
[controller]
pulses_per_degree = [1365.3, 1365.3, -1365.3, 900, 900, 500]
external_axes_at_rest = true
fixed_tool = "tool_in_part"
harmless_routines = ["Spindle_On", "GRIP"]
units_without_point = "mm"
angles = "rpy"
cutter = "-x"
spin_deg = 30
[[controller.base]]
number = 3
name = "w_fix"
xyz_mm = [100, 200, 300]
wpr_deg = [10, 20, 30]
[[controller.base]]
name = "BASE"
quaternion = [0.5, 0.5, 0.5, 0.5]
[[controller.tool]]
number = 0
xyz_mm = [0, 0, 250]
abc_deg = [90, 0, 0]
[[controller.external]]
axis = 1
along = [0, 2, 0]
at_mm = 500
carries = ["robot"]
[[controller.external]]
axis = 2
name = "STN1"
about = [0, 0, 1]
through_mm = [1500, 0, 400]
at_deg = 90
carries = ["3", "base"]
pulses_per_degree = 200
"""


def cell_of(folder: Path, text: str) -> Cell:
    path = folder / "cell.toml"
    path.write_text(HEAD + text)
    return read_cell(path)


def test_every_key_reaches_the_table(tmp_path: Path) -> None:
    told = cell_of(tmp_path, EVERY).controller
    assert told.pulses_per_degree is not None
    assert told.pulses_per_degree.tolist() == [1365.3, 1365.3, -1365.3, 900, 900, 500]
    assert told.external_axes_at_rest
    assert told.fixed_tool == "tool_in_part"
    assert told.units_without_point == "mm"
    assert told.harmless_routines == ("spindle_on", "grip")
    expected = pose_from_xyz_abc(np.array([100, 200, 300]) * MM, np.array([30, 20, 10]) * DEG)
    np.testing.assert_allclose(told.bases["3"], expected, atol=1e-15)
    np.testing.assert_array_equal(told.bases["w_fix"], told.bases["3"])
    turned = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    np.testing.assert_allclose(told.bases["BASE"][:3, :3], turned, atol=1e-15)
    np.testing.assert_allclose(told.tools["0"][:3, 0], [0, 1, 0], atol=1e-15)
    rail, table = told.external
    assert rail.carries_robot
    assert rail.point is None
    assert rail.at == pytest.approx(0.5)
    assert rail.direction.tolist() == [0, 1, 0]
    assert table.frames == ("3", "base")
    assert table.name == "STN1"
    assert table.point is not None
    assert table.point.tolist() == [1.5, 0.0, 0.4]
    assert table.at == pytest.approx(np.pi / 2)
    assert table.per_pulse == pytest.approx(1 / 200)


def test_a_cell_without_it_says_nothing(tmp_path: Path) -> None:
    assert not cell_of(tmp_path, "").says_of_controller
    assert cell_of(tmp_path, EVERY).says_of_controller


TWO = "[[controller.tool]]\nnumber = 1\n[[controller.tool]]\n"
AXIS = "[[controller.external]]\naxis = 1\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TWO + "number = 1\n", "cell.toml:6: controller.tool[2]: tool 1 is given twice."),
        (TWO + "xyz_mm = [0, 0, 1]\n", "cell.toml:6: controller.tool[2] has neither number nor"),
        (
            TWO + "name = 'a'\nabc_deg = [0, 0, 0]\nwpr_deg = [0, 0, 0]\n",
            "cell.toml:6: controller.tool[2] gives abc_deg and wpr_deg, expected one orientation",
        ),
        (
            "[[controller.base]]\nnumber = 1\nquaternion = [1, 1, 0, 0]\n",
            "cell.toml:4: controller.base[1].quaternion has length 1.41421, expected 1.",
        ),
        (TWO + "nmber = 2\n", "cell.toml:7: unknown key controller.tool[2].nmber; allowed are"),
        (AXIS, "cell.toml:4: controller.external[1] needs either along or about."),
        (AXIS + "about = [0, 0, 1]\n", "cell.toml:4: controller.external[1]: through_mm, a point"),
        (
            AXIS + "along = [1, 0, 0]\nat_deg = 3\n",
            "cell.toml:4: controller.external[1].at_deg is given, but the axis is linear.",
        ),
        (
            AXIS + 'about = [0, 0, 1]\nthrough_mm = [0, 0, 0]\ncarries = ["robot"]\n',
            "cell.toml:4: controller.external[1] carries the robot: it must be linear",
        ),
        (
            "[[controller.external]]\naxis = 7\n",
            "cell.toml:5: controller.external[1].axis is 7, expected 6 or less.",
        ),
        (
            "[controller]\npulses_per_degree = [1, 1, 0, 1, 1, 1]\n",
            "cell.toml:5: controller.pulses_per_degree is",
        ),
        (
            '[controller]\nfixed_tool = "maybe"\n',
            "cell.toml:5: controller.fixed_tool is 'maybe', expected",
        ),
    ],
)
def test_faults_are_named_with_their_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        cell_of(tmp_path, text)
    assert str(caught.value).replace(str(tmp_path) + "/", "").startswith(said)


def test_files_of_the_controller_are_read_and_the_cell_goes_before(tmp_path: Path) -> None:
    (tmp_path / "TOOL.CND").write_text(
        "//TOOL 0\n///NAME A\n0.000,0.000,200.000,0.00,0.00,0.00\n"
        "//TOOL 1\n///NAME B\n0.000,0.000,300.000,0.00,0.00,0.00\n"
    )
    said = (
        '[controller]\nfiles = ["TOOL.CND"]\n[[controller.tool]]\nnumber = 1\nxyz_mm = [7, 0, 0]\n'
    )
    tools = cell_of(tmp_path, said).controller.tools
    assert tools["0"][:3, 3].tolist() == [0.0, 0.0, 0.2]
    assert tools["1"][:3, 3] == pytest.approx([0.007, 0.0, 0.0])


def test_a_file_that_holds_no_frames_is_refused(tmp_path: Path) -> None:
    (tmp_path / "part.src").write_text("DEF part()\nEND\n")
    with pytest.raises(ConfigurationError, match=r"part.src is no file of frames"):
        cell_of(tmp_path, '[controller]\nfiles = ["part.src"]\n')


def test_written_and_read_back(tmp_path: Path) -> None:
    cell = cell_of(tmp_path, EVERY)
    text = cell_text(cell)
    (tmp_path / "again.toml").write_text(text)
    again = read_cell(tmp_path / "again.toml")
    assert cell_text(again) == text
    assert set(again.controller.bases) == {"3", "w_fix", "BASE"}
    for key, matrix in cell.controller.bases.items():
        np.testing.assert_allclose(again.controller.bases[key], matrix, atol=1e-14)
    for one, other in zip(cell.controller.external, again.controller.external, strict=True):
        np.testing.assert_allclose(other.direction, one.direction, atol=1e-12)
        assert (other.number, other.name, other.frames) == (one.number, one.name, one.frames)
        assert other.at == pytest.approx(one.at)
        assert other.per_pulse == pytest.approx(one.per_pulse, nan_ok=True)


def test_the_example_tells_every_key(tmp_path: Path) -> None:
    text = Path(config.__file__).with_name("example.toml").read_text(encoding="utf-8")
    shown = text[text.index("# [controller]") :].replace("\n# ", "\n")[2:]
    shown = shown.replace('files = ["$config.dat"]', "files = []")
    (tmp_path / "cell.toml").write_text(text[: text.index("# [controller]")] + shown)
    told = read_cell(tmp_path / "cell.toml").controller
    assert set(told.bases) == {"3"}
    assert set(told.tools) == {"2"}
    assert told.external[0].carries_robot
    assert told.fixed_tool == "tool_in_part"


def test_files_are_named_from_where_the_cell_is_written() -> None:
    text = "[controller]\nfiles = [\n  '$config.dat', # frames\n  \"b/TOOL.CND\"]\n"
    assert rename_files(text, lambda name: "../" + name) == (
        '[controller]\nfiles = [\n  "../$config.dat", # frames\n  "../b/TOOL.CND"]\n'
    )
