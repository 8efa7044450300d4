"""``robotrue map``: picture, table and page of a model and of a bare cell."""

from __future__ import annotations

import csv

import pytest

CYLINDER = ("--angle-deg", "-40,40", "--radius-mm", "900,1700", "--height-mm", "700,1200",
            "--tool-abc-deg", "0,150,0", "--posture-deg", "0,-90,90,0,60,0")  # fmt: skip


def test_picture_and_numbers_of_a_model(cli, work):
    got = cli("map", work / "model.rtm", "-o", work / "m.png", *CYLINDER, "--grid", "4,5,3",
              "--json")  # fmt: skip
    assert got.code == 0, got.err
    assert (work / "m.png").read_bytes().startswith(b"\x89PNG")
    found = got.document
    assert (found["poses"], found["grid"], found["attitude"]) == (60, [4, 5, 3], "turning")
    assert 0 < found["in_reach"] < 60
    assert found["in_reach"] == sum(s["in_reach"] for s in found["sectors"])
    assert 0.0 < found["stays_95_mm"]["mean"] < found["error_mm"]["mean"] < 3.0
    assert len(found["similarity"]) == 6
    assert found["similarity"][0]["sectors"] == [1, 2]


def test_table_leaves_what_cannot_be_taken_empty(cli, work):
    got = cli("map", work / "model.rtm", "-o", work / "m.csv", *CYLINDER, "--grid", "4,5,3")
    assert got.code == 0, got.err
    rows = list(csv.DictReader((work / "m.csv").read_text().splitlines()))
    empty = [row for row in rows if not row["error_mm"]]
    assert len(rows) == 60
    assert 0 < len(empty) < 60
    assert all(row["stays_95_mm"] == "" and row["a1_deg"] == "" for row in empty)
    assert all(float(row["radius_mm"]) >= 1200.0 for row in empty)
    assert f"{len(empty)} grid poses are out of reach and left empty" in got.err
    row = next(row for row in rows if row["error_mm"])
    parts = [float(row[f"error_{k}_mm"]) for k in "xyz"]
    assert sum(v * v for v in parts) ** 0.5 == pytest.approx(float(row["error_mm"]), rel=1e-4)
    assert "attitude turns with the angle" in got.out


def test_page_of_a_bare_cell_says_that_nothing_was_measured(cli, work):
    got = cli("map", work / "cell.toml", "-o", work / "m.html", "--region", "cube", "--x-mm",
              "900,1300", "--y-mm", "-400,400", "--z-mm", "700,1100", "--grid", "3,4,3",
              "--attitude", "fixed", "--tool-abc-deg", "0,150,0", "--at", "tool")  # fmt: skip
    assert got.code == 0, got.err
    page = (work / "m.html").read_text()
    assert "nothing was measured: stated stiffness and prior scales only." in page
    assert "<svg" in page
    assert "warning: nothing was measured" in got.err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--region", "ball"), "region 'ball', expected cylinder or cube."),
        (("--x-mm", "0,1"), "--x-mm does not belong to a cylinder."),
        (("--grid", "4,5"), "--grid '4,5', expected three"),
        (("--grid", "5,4,4"), "5 grid values do not fall into 4 sectors."),
        (("--attitude", "loose"), "attitude 'loose', expected turning or fixed."),
        (("--at", "flange"), "--at 'flange', expected target or tool."),
        (("--radius-mm", "5000,6000"), "none of 64 points of the region can be taken"),
        (("--angle-deg", "40,-40"), "the lower limit comes first"),
    ],
)
def test_refusals(cli, work, more, said):
    if more == ("--grid", "4,5"):
        said = "--grid '4,5', expected 3 numbers with commas between."
    got = cli("map", work / "model.rtm", "-o", work / "m.png", *CYLINDER, "--grid", "4,4,4", *more)
    assert got.code == 1, got.err
    assert said in got.err
    assert not (work / "m.png").exists()


def test_an_output_it_cannot_write(cli, work):
    got = cli("map", work / "model.rtm", "-o", work / "m.gif", *CYLINDER)
    assert got.code == 1
    assert "the suffix of 'm.gif' does not state the format." in got.err
    got = cli("map", work / "model.rtm", "-o", work / "m.png", "--angle-deg", "-4,4")
    assert "a cylinder needs --radius-mm LOW,HIGH." in got.err
