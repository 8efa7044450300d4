"""``robotrue inspect`` on each kind of file, as JSON and as a table."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import shop

from robotrue.robot.model import parameter_slice


def test_a_model(cli, work: Path) -> None:
    document = cli("inspect", work / "model.rtm", "--json").document
    assert document["holds"] == "error model"
    assert document["kind"] == "error-model/rigid-flexible"
    assert document["schema"] == 1
    assert document["robot"] == "KUKA KR160 R1570"
    assert document["cell"]["source"] == "cell.toml"
    assert len(document["cell"]["sha256"]) == 64
    assert document["sources"][0].startswith("cal.csv sha256:")
    found = document["identified"]
    alpha = np.rad2deg(shop.actual().errors[parameter_slice(6, "alpha")])
    assert found["alpha2"]["unit"] == "deg"
    assert found["alpha2"]["known"] == "seen"
    assert abs(found["alpha2"]["value"] - alpha[1]) < 4.0 * found["alpha2"]["sd"]
    assert found["a2"]["unit"] == "mm"
    assert {row["known"] for row in found.values()} <= {"seen", "weakly seen", "prior only"}


def test_stiffness_is_told_in_newton_metres(cli, work: Path) -> None:
    springs = cli("inspect", work / "model.rtm", "--json").document["stiffness"]
    assert list(springs) == [f"joint {i}" for i in range(1, 7)]
    second = springs["joint 2"]
    assert second["known"] == "seen"
    assert abs(second["Nm_per_rad"] - shop.STIFFNESS[1]) < 4.0 * second["sd_Nm_per_rad"]
    assert second["Nm_per_rad"] == pytest.approx(1.0 / second["compliance_rad_per_Nm"])
    assert springs["joint 1"]["known"] == "prior only"  # gravity does not load a vertical axis


def test_the_model_table_says_how_well_each_error_is_known(cli, work: Path) -> None:
    got = cli("inspect", work / "model.rtm")
    assert got.code == 0
    rows = {line.split()[0]: line.split() for line in got.out.splitlines() if line.strip()}
    assert rows["alpha2"][3:] == ["deg", "seen"]
    assert re.search(r"joint 1 .*prior only", got.out)
    assert re.search(r"joint 2 .*seen", got.out)
    assert "error-model/rigid-flexible, schema 1" in got.out
    assert "not seen by the data: compliance1" in got.err
    assert max(map(len, got.err.splitlines())) > 80  # remarks are not broken into lines


def test_a_learned_model_shows_ripple_and_backlash(cli) -> None:
    """The archived arm has ripple of 2 and 3 cycles on joints 2 and 3 and no backlash."""
    path = Path(__file__).parents[1] / "archives" / "0.1.0" / "learned.rtm"
    drives = cli("inspect", path, "--json").document["drives"]
    assert drives["joint 2"]["strongest"] == 2
    assert drives["joint 3"]["strongest"] == 3
    # Joint 2 turns 75 deg only: part of its two cycles looks like geometry. Joint 3 turns 120 deg.
    amplitude = np.rad2deg(1e-4) / np.sqrt(2.0) * 1e3
    assert drives["joint 3"]["ripple_mdeg"] == pytest.approx(amplitude, rel=0.1)
    assert "ripple and backlash of the drives" in cli("inspect", path).out


def test_a_cell(cli, work: Path) -> None:
    document = cli("inspect", work / "cell.toml", "--json").document
    assert document["holds"] == "cell"
    assert document["robot"] == "KUKA KR160 R1570"
    assert document["payload_kg"] == 50.0
    assert document["target_mm"] == [60.0, 40.0, 250.0]
    assert document["tracker_frame"] == "base"
    assert document["limits_deg"][0] == [-185.0, 185.0]
    table = cli("inspect", work / "cell.toml").out
    assert "-185 to 185" in table


def test_measurements(cli, work: Path) -> None:
    document = cli("inspect", work / "cal.csv", "--json").document
    assert document["holds"] == "measurements"
    assert document["poses"] == 60
    assert document["joints"] == 6
    assert len(document["joint_range_deg"]) == 6
    assert document["loaded_poses"] == document["full_poses"] == 0
    assert "60" in cli("inspect", work / "cal.csv").out


def test_a_program(cli, work: Path) -> None:
    document = cli("inspect", work / "part.src", "--json").document
    assert document["holds"] == "program"
    assert document["dialect"] == "krl"
    assert document["targets"] == 5
    assert document["motions"] == {"ptp": 1, "lin": 4}
    assert "1 ptp, 4 lin" in cli("inspect", work / "part.src").out


def test_something_else(cli, work: Path) -> None:
    (work / "letter.md").write_text("Dear customer,\nthe robot is on its way.\n")
    got = cli("inspect", work / "letter.md", "--json")
    assert got.code == 1
    assert "not a model, cell, program or measurement file" in got.fault["message"]


def test_a_tool_path(cli, work: Path) -> None:
    text = "UNITS/MM\nLOADTL/4\nRAPID\nGOTO/0,0,50\nFEDRAT/600,MMPM\nGOTO/0,0,0\nGOTO/30,40,0\n"
    (work / "side.apt").write_text(text)
    document = cli("inspect", work / "side.apt", "--json").document
    assert document["holds"] == "tool path"
    assert document["points"] == 3
    assert document["rapid_points"] == 1
    assert document["cut_mm"] == pytest.approx(100.0)
    assert document["feed_mm_per_min"] == [[600.0, 600.0]]
    assert document["extent_mm"] == pytest.approx([30.0, 40.0, 50.0])
    assert document["tools"] == ["4"]
    (work / "side.csv").write_text("x_mm,y_mm,z_mm,rapid\n0,0,5,1\n0,0,0,0\n")
    assert cli("inspect", work / "side.csv", "--json").document["holds"] == "tool path"
    assert "tool axes" in cli("inspect", work / "side.csv").out
    assert cli("inspect", work / "cal.csv", "--json").document["holds"] == "measurements"


def test_a_cell_tells_what_it_knows_of_the_controller(cli, work: Path) -> None:
    told = (
        "[controller]\nexternal_axes_at_rest = true\n[[controller.base]]\nnumber = 3\n"
        '[[controller.external]]\naxis = 1\nalong = [0, 1, 0]\ncarries = ["robot"]\n'
    )
    (work / "told.toml").write_text((work / "cell.toml").read_text() + told)
    assert "controller" not in cli("inspect", work / "cell.toml", "--json").document
    found = cli("inspect", work / "told.toml", "--json").document["controller"]
    assert found["bases"] == ["3"]
    assert found["external"] == [
        {"axis": 1, "kind": "along", "direction": [0.0, 1.0, 0.0], "carries": ["robot"]}
    ]
    assert found["external_axes_at_rest"]
    assert cli("inspect", work / "told.toml").code == 0
