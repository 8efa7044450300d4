"""``robotrue compensate`` and ``diff`` on G-code, APT and CSV paths, found by their content."""

from __future__ import annotations

from pathlib import Path

import pytest

TOLD = """[controller]
angles = "rpy"
spin_deg = 0.0
start_deg = [0, -80, 80, 0, 40, 0]
[[controller.base]]
name = "G54"
xyz_mm = [1200, 0, 900]
[[controller.tool]]
name = "T1"
xyz_mm = [60, 40, 250]
"""
TURN = "A=0.0 B=120.0 C=0.0"
SINUMERIK = f"""N10 G90 G71 G17
N20 T1 D1
N30 G54
N40 TRAORI
N50 G1 X0.000 Y200.000 Z0.000 {TURN} F1000 ; start
N60 Y-200.000
N70 G91 X1.000
N80 G90 X-50.0 Y-200.000 Z-50.000
N90 M30
"""
APT = """UNITS/MM
GOTO/1200.0,200.0,900.0
GOTO/1200.0,-200.0,900.0
GODLTA/1,0,0
GOTO/1150.0,-200.0,850.0
FINI
"""
CSV = "x_mm,y_mm,z_mm\n1200.0,200.0,900.0\n1200.0,-200.0,900.0\n1150.0,-200.0,850.0\n"
PROGRAMS = {"part.mpf": SINUMERIK, "part.apt": APT, "path.csv": CSV}


@pytest.mark.parametrize("name", sorted(PROGRAMS))
def test_from_file_to_file(cli, work: Path, name: str) -> None:
    (work / name).write_text(PROGRAMS[name])
    (work / "told.toml").write_text((work / "cell.toml").read_text() + TOLD)
    out = work / f"out_{name}"
    command = ("compensate", work / "model.rtm", work / name, "-o", out, "--json")
    silent = cli(*command)
    assert silent.document["compensated"] == 0
    assert out.read_text() == PROGRAMS[name]
    wanted = "add base G54 to the cell" if name == "part.mpf" else "[controller] spin_deg"
    assert wanted in silent.err
    got = cli(*command, "--cell", work / "told.toml")
    assert got.document["compensated"] == 3
    left = {"unchanged_source": 1} if name != "path.csv" else {}
    assert got.document["status"] == {"compensated": 3, **left}
    before, after = PROGRAMS[name].split("\n"), out.read_text().split("\n")
    moved = [k for k, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
    assert len(moved) == 3
    again = cli(
        "diff", work / name, out, "--model", work / "model.rtm", "--cell", work / "told.toml",
        "--json",
    )  # fmt: skip
    document = again.document["files"][0]
    assert document["moved"] == 3
    assert document["predicted_error_before_um"]["mean"] > 100.0
    assert document["predicted_error_after_um"]["max"] < 20.0


def test_what_a_cell_says_of_angles_is_checked(cli, work: Path) -> None:
    (work / "part.mpf").write_text(SINUMERIK)
    (work / "told.toml").write_text(
        (work / "cell.toml").read_text() + '[controller]\nangles = "abc"\n'
    )
    got = cli("compensate", work / "told.toml", work / "part.mpf", "-o", work / "o.mpf", "--json")
    assert got.code != 0
    assert "controller.angles" in got.fault["message"]
