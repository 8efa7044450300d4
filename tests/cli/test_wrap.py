"""``robotrue wrap``: the module, its numbers, where it is called, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotrue.simulation import rail_practice

PICK = """DEF pick()
DECL E6POS XP
INT I
$BASE={X 900,Y -200,Z 300,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
LIN {X 150.0,Y 100.0,Z 400.0,A 0,B 160,C 0}
LIN {X 300.0,Y 300.0,Z 450.0,A 0,B 160,C 0}
FOR I=1 TO 4
  CAMERA(XP)
  LIN XP C_DIS
  PTP XP
ENDFOR
END
"""
START = ("--start", "0,-80,80,0,40,0")
BOX = ("--box-mm", "1050,1200,0,100,750,850", "--attitude-deg", "0,160,0", "--turn-deg", "2,2,2")


@pytest.fixture
def shop(work: Path) -> Path:
    (work / "pick.src").write_bytes(PICK.encode())
    return work


def test_the_region_and_the_frames_come_from_the_program(cli, shop: Path) -> None:
    wrap = ("wrap", shop / "model.rtm", "-o", shop / "rt_fix.src", "--program", shop / "pick.src")
    document = cli(*wrap, *START, "--json").document
    assert document["box_mm"] == [100, 350, 50, 350, 350, 500]
    assert document["left_max_mm"] <= 0.02
    assert document["left_95_mm"] <= document["left_max_mm"] < document["correction_max_mm"]
    assert document["files"] == ["rt_fix.src", "rt_fix.dat"]
    data = (shop / "rt_fix.dat").read_text()
    assert data.count("RT_FIX_T[") == document["numbers"] + 1
    line, joint = document["calls"]
    assert line == {
        "file": "pick.src", "line": 11, "before": "LIN XP", "after": "LIN RT_FIX(XP)",
        "why_not": None,
    }  # fmt: skip
    assert joint["after"] == "PTP RT_FIX(XP)"
    assert "S and T" in joint["why_not"]
    shown = cli(*wrap, *START).out
    assert "left by the table, max" in shown
    assert "LIN RT_FIX(XP)" in shown


def test_inserted_calls_stay_as_they_are_when_the_program_is_compensated(cli, shop: Path) -> None:
    folder = shop / "calls"
    folder.mkdir()
    got = cli("wrap", shop / "model.rtm", "-o", folder / "rt_fix.src", "--program",
              shop / "pick.src", "--wrap-computed", folder, *START)  # fmt: skip
    assert "program with 1 of 2 calls written to" in got.err
    text = (folder / "pick.src").read_text()
    assert text == PICK.replace("LIN XP C_DIS", "LIN RT_FIX(XP) C_DIS")
    out = folder / "out"
    out.mkdir()
    done = cli("compensate", shop / "model.rtm", folder / "pick.src", folder / "rt_fix.src", "-o",
               out, "--allow-steps", "--json")  # fmt: skip
    assert done.code == 0
    assert "  LIN RT_FIX(XP) C_DIS\n" in (out / "pick.src").read_text()
    assert (out / "rt_fix.dat").read_bytes() == (folder / "rt_fix.dat").read_bytes()
    assert (out / "rt_fix.src").read_bytes() == (folder / "rt_fix.src").read_bytes()


def test_rapid_with_a_stated_region(cli, shop: Path) -> None:
    document = cli("wrap", shop / "model.rtm", "-o", shop / "RtFix.mod", *BOX, *START,
                   "--json").document  # fmt: skip
    assert (document["language"], document["files"]) == ("rapid", ["RtFix.mod"])
    assert document["calls"] == []
    assert (shop / "RtFix.mod").read_bytes().startswith(b"MODULE RtFixMod\r\n")


REFUSED = [
    (("-o", "rt_fix.src", *BOX), "nothing says in which configuration"),
    (("-o", "rt_fix.src", *START), "the region is not stated"),
    (("-o", "rt_fix.src", *BOX, *START, "--base", "7"), "--base '7', the cell has none"),
    (("-o", "rt_fix.src", "--box-mm", "1,2,3", "--attitude-deg", "0,0,0"), "expected 6 numbers"),
    (("-o", "rt_fix.src", *BOX, *START, "--max-numbers", "5"), "no table of up to 5 numbers"),
    (("-o", "rt_fix.src", *BOX, *START, "--tolerance-mm", "0"), "expected above 0"),
    (("-o", "much_too_long_a_name.src", *BOX, *START), "is the name of the function"),
    (("-o", "rt_fix.txt", *BOX, *START), "a controller module is written"),
    (("-o", "rt_fix.src", *BOX, *START, "--temperature", "25"), "no part of the model depends"),
    (("-o", "RtFix.mod", "--program", "pick.src", *START), "pick.src is a program in krl"),
    (("-o", "rt_fix.src", *BOX, *START, "--wrap-computed", "."), "--wrap-computed without"),
    (
        ("-o", "rt_fix.src", "--program", "pick.src", "--wrap-computed", ".", *START),
        "which is an input",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("words", "said"), REFUSED)
def test_what_cannot_be_is_refused_and_nothing_written(
    cli, shop: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(shop)
    before = sorted(path.name for path in shop.iterdir())
    got = cli("wrap", "model.rtm", *words)
    assert got.code != 0
    assert said in got.err
    assert sorted(path.name for path in shop.iterdir()) == before
    assert (shop / "pick.src").read_text() == PICK


def test_an_arm_on_a_rail_needs_its_position(cli, tmp_path: Path) -> None:
    rail_practice.main([str(tmp_path)])
    model, output = tmp_path / "model.robotrue", tmp_path / "rt_fix.src"
    cli("calibrate", tmp_path / "cell.toml", tmp_path / "measured.csv", "--method", "ripple",
        "-o", model)  # fmt: skip
    wrap = ("wrap", model, "-o", output, "--box-mm", "1000,1200,400,500,700,800",
            "--attitude-deg", "0,90,0", "--turn-deg", "1,1,1", "--start", "0,-90,90,0,30,0",
            "--tolerance-mm", "0.08")  # fmt: skip
    got = cli(*wrap)
    assert got.code != 0
    assert "where the arm is on it" in got.err
    assert not output.exists()
    assert "E1 at 500 mm" in cli(*wrap, "--e1-mm", "500").err
    assert "; Made for E1 at 500 mm" in output.read_text()
