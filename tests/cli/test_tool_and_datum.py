"""``tool-point``, ``tool-axis`` and ``datum-check``: answers, controllers' words, refusals."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import touched

from robotrue.cell.config import read_cell
from robotrue.core.units import MM
from robotrue.measurement.formats.part_points import write_points
from robotrue.measurement.probing_set import ProbingSet
from robotrue.program.controller_frames import controller_tool
from robotrue.program.frames_beside import read_controller_file

sys.path.insert(0, str(Path(__file__).parents[1] / "validation"))
import test_tool_calibration as tools

CELL = """schema = 1
[robot]
preset = "KUKA KR160 R1570"
[tool]
xyz_mm = [0, 0, 300]
[repeatability]
mm = 0.05
"""


@pytest.fixture
def shop_floor(tmp_path: Path) -> Path:
    (tmp_path / "cell.toml").write_text(CELL)
    write_points(tmp_path / "table.csv", tools.PROBED)
    for name, points in (("tool.csv", tools.TABLE), ("pivot.csv", tools.TABLE[[4] * 5])):
        write_points(tmp_path / name, tools.touched(tools.TIP, points, tools.LEANS))
    return tmp_path


def test_the_tool_point_from_the_table_in_the_words_of_controllers(cli, shop_floor: Path) -> None:
    words = [
        w for form in ("krl", "rapid", "fanuc", "yaskawa", "ur") for w in ("--tool-format", form)
    ]
    got = cli("tool-point", shop_floor / "cell.toml", shop_floor / "tool.csv", "--table",
              shop_floor / "table.csv", "-o", shop_floor / "milling.toml", *words,
              "--json")  # fmt: skip
    assert got.code == 0, got.err
    document = got.document
    np.testing.assert_allclose(document["xyz_mm"], tools.TIP / MM, atol=1e-4)
    assert (document["from"], document["doubts"]) == ("table", [])
    assert 0.0 < document["region_95_mm"] < 3.0
    text = "\n".join(each["text"] for each in document["tools"])
    for line in (
        "$TOOL={X 8.0000,Y -5.0000,Z 240.0000,A 0.000000,B 0.000000,C 0.000000}",
        "PERS tooldata t_tool:=[TRUE,[[8.0000,-5.0000,240.0000],[1.000000000,",
        "UTOOL[1] tool, mm",
        "//TOOL 1\n///NAME tool\n8.000,-5.000,240.000,0.0000,0.0000,0.0000",
        "set_tcp(p[0.0080000, -0.0050000, 0.2400000,",
    ):
        assert line in text
    written = read_cell(shop_floor / "milling.toml").robot.T_flange_tool
    np.testing.assert_allclose(written[:3, 3], tools.TIP, atol=1e-7)


def test_what_is_written_for_the_controller_is_read_back() -> None:
    T = touched.T_BASE_PART
    for form, name in (("krl", "$config.dat"), ("yaskawa", "TOOL.CND")):
        head = "DEFDAT $CONFIG\n" if form == "krl" else ""
        read = read_controller_file(name, (head + controller_tool(T, form, number=3).text).encode())
        assert read is not None
        (tool,) = [T for number, T in read.tools.items() if "3" in number]
        np.testing.assert_allclose(tool, T, atol=1e-5)


def test_the_tool_point_about_a_fixed_point(cli, shop_floor: Path) -> None:
    got = cli("tool-point", shop_floor / "cell.toml", shop_floor / "pivot.csv", "--tolerance-mm",
              0.5)  # fmt: skip
    assert got.code == 0, got.err
    assert "about a fixed point" in got.out
    assert "is not known to it" in got.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("tool.csv",), "places up to 400.000 mm apart, and no table"),
        (("pivot.csv", "--tool-format", "g54"), "tool format 'g54', expected krl, rapid"),
        (("pivot.csv", "--tool-format", "fanuc", "--tool-number", 31), "tool number 31 of fanuc"),
    ],
)
def test_bad_requests_are_refused(cli, shop_floor: Path, words, message: str) -> None:
    rest = [shop_floor / w if str(w).endswith(".csv") else w for w in words]
    got = cli("tool-point", shop_floor / "cell.toml", *rest, "--json")
    assert got.code == 1
    assert message in got.fault["message"]


def test_the_tool_axis_from_gauges_and_from_a_plane(cli, shop_floor: Path) -> None:
    up = np.array([0.0, 0.0, 1.0])
    place = tools.TABLE[[4] * 5]
    long = tools.touched(tools.TIP + 0.1 * up, place, 0.8 * tools.LEANS)
    write_points(shop_floor / "long.csv", long)
    got = cli("tool-axis", shop_floor / "cell.toml", shop_floor / "pivot.csv",
              shop_floor / "long.csv", "--tool-format", "krl", "--json")  # fmt: skip
    assert got.code == 0, got.err
    np.testing.assert_allclose(got.document["axis_in_flange"], up, atol=1e-6)
    assert "$TOOL={X 0.0000,Y 0.0000,Z 300.0000" in got.document["tools"][0]["text"]
    spins = np.outer([0.0, 0.4, -0.4], up)
    write_points(shop_floor / "square.csv", tools.touched(tools.TIP, place[:3], spins))
    write_points(shop_floor / "longer.csv",
                 tools.touched(tools.TIP + 0.15 * up, tools.TABLE, 0.0 * tools.LEANS))  # fmt: skip
    got = cli("tool-axis", shop_floor / "cell.toml", shop_floor / "tool.csv",
              shop_floor / "longer.csv", "--table", shop_floor / "table.csv", "--json")  # fmt: skip
    np.testing.assert_allclose(got.document["axis_in_flange"], up, atol=1e-6)
    got = cli("tool-axis", shop_floor / "cell.toml", shop_floor / "square.csv", "--normal", "0,0,1",
              "--table", shop_floor / "table.csv")  # fmt: skip
    assert "--normal with --table" in got.err
    got = cli("tool-axis", shop_floor / "cell.toml", shop_floor / "square.csv", "--normal", "0,0,1")
    assert got.code == 0, got.err
    assert "from the flange's z" in got.out
    got = cli("tool-axis", shop_floor / "cell.toml", shop_floor / "pivot.csv", "--json")
    assert "1 files of touches, expected 2." in got.fault["message"]
    got = cli("tool-axis", shop_floor / "cell.toml", shop_floor / "square.csv", "--normal", "0,0",
              "--json")  # fmt: skip
    assert "--normal '0,0', expected three numbers" in got.fault["message"]


@pytest.fixture
def registered(cli, shop_floor: Path) -> Path:
    got = cli("register", shop_floor / "cell.toml", shop_floor / "table.csv", "-o",
              shop_floor / "placed.toml", "--fit", "frame")  # fmt: skip
    assert got.code == 0, got.err
    return shop_floor


def datums(path: Path, shift: object = 0.0, names: tuple[str, ...] = ("pin", "hole")) -> Path:
    places = np.array([[100.0, 50.0, 0.0], [300.0, 200.0, 0.0]]) * MM
    found = tools.touched(tools.PROBE[:3, 3], places, np.zeros((2, 3)), np.asarray(shift))
    write_points(path, ProbingSet(names=names, point=found.point, joints=found.joints))
    return path


def test_datums_hold_or_are_off(cli, registered: Path) -> None:
    asked = ("datum-check", registered / "placed.toml")
    good = cli(*asked, datums(registered / "d.csv"), "--tolerance-mm", 2, "--json").document
    assert good["verdict"] == "holds"
    assert good["with_the_arm"]
    assert good["datums"][0]["off_mm"] < 1e-3
    far = datums(registered / "d.csv", [0.003, 0.0, 0.0])
    off = cli(*asked, far, "--tolerance-mm", 1.0)
    assert off.code == 0
    assert "is off: datum" in off.out
    unsure = cli(*asked, datums(registered / "d.csv"), "--tolerance-mm", 0.05, "--json").document
    assert unsure["verdict"] == "undecided"


def test_datums_that_cannot_be_checked(cli, registered: Path) -> None:
    path = datums(registered / "d.csv")
    got = cli("datum-check", registered / "cell.toml", path, "--tolerance-mm", 1, "--json")
    assert "the cell is not registered" in got.fault["message"]
    asked = ("datum-check", registered / "placed.toml")
    used = datums(registered / "u.csv", names=("t1", "hole"))
    got = cli(*asked, used, "--tolerance-mm", 1, "--json")
    assert "datum t1 was used for the frame" in got.fault["message"]
    got = cli(*asked, path, "--tolerance-mm", 1, "--touches", path, "--json")
    assert "not the touches the cell was registered with" in got.fault["message"]
    metres = ProbingSet(
        names=("pin", "hole"), point=np.array([[0.1, 0.05, 0.0], [0.3, 0.2, 0.0]]) * MM,
        joints=tools.touched(tools.PROBE[:3, 3], tools.TABLE[:2], np.zeros((2, 3))).joints,
    )  # fmt: skip
    write_points(registered / "m.csv", metres)
    got = cli(*asked, registered / "m.csv", "--tolerance-mm", 1, "--json")
    assert "another scale" in got.fault["message"]
    (registered / "table.csv").unlink()
    got = cli(*asked, path, "--tolerance-mm", 3)
    assert "is not beside the cell" in got.err
