"""``robotrue compensate``: where the arm begins, and what the cell beside the model says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

ROWS = "GOTO/{0},{1},{2}\nGOTO/{0},{3},{2}\n"
APT = "UNITS/MM\n{rows}FINI\n"
START = "0,-80,80,0,40,0"
OTHER = "0,-80,80,180,-40,-180"
SPIN = "[controller]\nspin_deg = 0.0\n"


def path(x: float = 1200.0, y: float = 200.0, z: float = 900.0) -> str:
    rows = ROWS.format(x, y, z, y - 400.0)
    return APT.format(rows=rows)


def numbers(text: str) -> np.ndarray:
    return np.array([float(v) for row in re.findall(r"GOTO/(.*)", text) for v in row.split(",")])


@pytest.fixture
def told(work: Path) -> Path:
    (work / "told.toml").write_text((work / "cell.toml").read_text() + SPIN)
    (work / "a.apt").write_text(path())
    return work


def made(cli, work: Path, *more: object, cell: str = "told.toml", name: str = "a.apt"):
    out = work / "out.apt"
    got = cli(
        "compensate", work / "model.rtm", work / name, "--cell", work / cell, "-o", out, "--json",
        *more,
    )  # fmt: skip
    return got, out.read_text() if got.code == 0 else ""


def test_a_program_that_does_not_say_how_it_begins(cli, told: Path) -> None:
    got, text = made(cli, told)
    assert got.document["status"] == {"unchanged_configuration": 2}
    assert text == path()
    assert got.document["configuration"]["chosen_by"] == "middle of the limits"
    assert "line 2: the arm is at" in got.err
    assert "since none is stated" in got.err
    assert "--start A1,..,A6" in got.err
    assert "start_deg" in got.document["notes"][0]

    chosen, text = made(cli, told, "--start", START)
    assert chosen.document["status"] == {"compensated": 2}
    stands = chosen.document["configuration"]
    assert (stands["line"], stands["chosen_by"]) == (2, "start posture")
    assert stands["axes_deg"][4] > 0.0
    assert "the nearest to the start posture" in chosen.err
    turned, other = made(cli, told, "--start", OTHER)
    assert turned.document["configuration"]["axes_deg"][4] < 0.0
    assert np.abs(numbers(other) - numbers(text)).max() > 0.05

    (told / "told.toml").write_text((told / "told.toml").read_text() + f"start_deg = [{START}]\n")
    stated, same = made(cli, told)
    assert same == text
    assert stated.document["configuration"] == stands
    overruled, _ = made(cli, told, "--start", OTHER)
    assert overruled.document["configuration"] == turned.document["configuration"]


def test_the_difference_is_judged_from_the_same_start(cli, told: Path) -> None:
    _, text = made(cli, told, "--start", START)
    assert text
    command = (
        "diff", told / "a.apt", told / "out.apt", "--model", told / "model.rtm", "--cell",
        told / "told.toml", "--json",
    )  # fmt: skip
    silent = cli(*command).document["files"][0]
    assert silent["predicted_error_after_um"] is None
    known = cli(*command, "--start", START).document["files"][0]
    assert known["predicted_error_after_um"]["max"] < 20.0
    report = (
        "report", "program", told / "a.apt", told / "out.apt", "--model", told / "model.rtm",
        "--cell", told / "told.toml", "--tolerance-mm", "1", "-o", told / "r.json", "--json",
    )  # fmt: skip
    assert cli(*report, "--start", START).document["verdict"] == "GO"
    unsure = cli(*report)
    assert unsure.code != 0 or unsure.document["verdict"] == "NO-GO"


@pytest.mark.parametrize(
    ("start", "said"),
    [("1,2,3", "expected 6 numbers in deg"), ("0,-90,90,0,150,0", "its limits are -125 to 125")],
)
def test_a_start_that_cannot_be(cli, told: Path, start: str, said: str) -> None:
    got, _ = made(cli, told, "--start", start)
    assert got.code != 0
    assert said in got.fault["message"]


def test_blocks_say_and_leave_the_same(cli, told: Path) -> None:
    lines = [f"LIN {{X {1200 - k},Y 200,Z 900,A 0,B 120,C 0}}" for k in range(40)]
    head = "DEF a()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}\n"
    (told / "a.src").write_text(head + "\n".join([*lines, "END", ""]))
    for more in ((), ("--start", START)):
        out = told / "out.src"
        command = ("compensate", told / "model.rtm", told / "a.src", "-o", out, "--json", *more)
        whole = cli(*command).document
        first = out.read_bytes()
        blocks = cli(*command, "--workers", "2").document
        assert out.read_bytes() == first
        for key in ("status", "configuration", "notes"):
            assert blocks[key] == whole[key]
        assert blocks["route"] == "blocks"
    assert whole["status"] == {"compensated": 40}


def test_base_and_tool_of_the_cell_hold(cli, told: Path) -> None:
    plain = (told / "told.toml").read_text()
    _, foot = made(cli, told, "--start", START)
    (told / "b.apt").write_text(path(300.0, 300.0, 600.0))
    (told / "base.toml").write_text(plain + "[base]\nxyz_mm = [900, -100, 300]\n")
    got, moved = made(cli, told, "--start", START, cell="base.toml", name="b.apt")
    assert got.document["status"] == {"compensated": 2}
    shift = numbers(foot).reshape(2, 3) - numbers(moved).reshape(2, 3)
    np.testing.assert_allclose(shift, [[900, -100, 300]] * 2, atol=2e-3)
    tool = plain.replace("xyz_mm = [60, 40, 250]", "xyz_mm = [60, 20, 240]")
    (told / "tool.toml").write_text(tool)
    got, other = made(cli, told, "--start", START, cell="tool.toml")
    assert got.document["status"] == {"compensated": 2}
    assert np.abs(numbers(other) - numbers(foot)).max() > 0.01


def test_a_base_alone_is_enough(cli, told: Path) -> None:
    robot = '[robot]\npreset = "KUKA KR160 R1570"\n'
    line = "LIN {X %g,Y 200,Z %g,A 0,B 120,C 0}"
    tool = "$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}"
    for name, x, z in (("a.src", 1200, 900), ("b.src", 300, 600)):
        (told / name).write_text(f"DEF a()\n{tool}\n{line % (x, z)}\nEND\n")
    (told / "base.toml").write_text(f"schema = 1\n{robot}[base]\nxyz_mm = [900, 0, 300]\n")
    out, shifts = told / "o.src", []
    for name, more in (("a.src", ()), ("b.src", ("--cell", told / "base.toml"))):
        got = cli(
            "compensate", told / "model.rtm", told / name, "-o", out, "--start", START, "--json",
            *more,
        )  # fmt: skip
        assert got.document["status"] == {"compensated": 1}
        after = re.search(r"LIN \{X ([\d.]+),Y ([\d.]+),Z ([\d.]+)", out.read_text())
        assert after
        shifts.append([float(v) for v in after.groups()])
    np.testing.assert_allclose(np.subtract(*shifts), [900, 0, 300], atol=2e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[robot]\npreset = "KUKA KR160 R1570"\n', "states nothing that is used with a model"),
        ('[robot]\npreset = "UR10"\n[base]\nxyz_mm = [1, 0, 0]\n', "is not that of the model's"),
        (
            '[robot]\npreset = "KUKA KR160 R1570"\nlimits_deg = [[-90, 90], [-90, 90], [-90, 90], '
            "[-90, 90], [-90, 90], [-90, 90]]\n[base]\nxyz_mm = [1, 0, 0]\n",
            "limits_deg of the cell are not those of the model",
        ),
    ],
)
def test_a_cell_that_cannot_hold_is_refused(cli, told: Path, text: str, said: str) -> None:
    (told / "other.toml").write_text("schema = 1\n" + text)
    got, _ = made(cli, told, cell="other.toml")
    assert got.code != 0
    assert said in got.fault["message"]
