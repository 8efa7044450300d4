"""Point lists of SpatialAnalyzer and PolyWorks, written and read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.core.provenance import MEASURED, Provenance, provenance_of_lines
from robotrue.core.units import MM
from robotrue.measurement.formats.point_list import PointList, comma_list, plain_list
from robotrue.measurement.formats.sheet_file import read_sheet

FEATURES = """name,px_mm,py_mm,pz_mm,ax,ay,az,part
front 1,10,0,10.25,0,-1,0,block
front 1,10,0,10.25,0,0,1,block
front 1,11,0,10,0,-1,0,block
top 1,10,10,400,0,0,1,"plate, 2"
"""


def run(*words: object) -> str:
    done = CliRunner().invoke(app, [str(word) for word in words])
    return f"{done.output}\n{done.exception or ''}"


def test_features_become_a_grouped_list_and_are_read_again(tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text(FEATURES)
    run("export", "points", tmp_path / "f.csv", "-o", tmp_path / "sa.csv")
    sheet = read_sheet(tmp_path / "sa.csv", header=False)
    assert sheet.column("1") == ("f", "f", "f")
    assert sheet.column("2") == ("block", "block", "plate_2")
    assert sheet.column("3") == ("front_1", "front_1_2", "top_1")
    np.testing.assert_array_equal(
        sheet.numbers(("4", "5", "6")), [[10, 0, 10.25], [11, 0, 10], [10, 10, 400]]
    )
    assert "// block: in the frame of part 'block'" in (tmp_path / "sa.csv").read_text()


def test_a_list_without_groups_holds_one_frame(tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text(FEATURES)
    told = run("export", "points", tmp_path / "f.csv", "-o", tmp_path / "pw.txt")
    assert "points in 2 frames" in told
    assert not (tmp_path / "pw.txt").exists()
    (tmp_path / "f.csv").write_text("".join(FEATURES.splitlines(keepends=True)[:4]))
    run("export", "points", tmp_path / "f.csv", "-o", tmp_path / "pw.txt")
    assert (tmp_path / "pw.txt").read_text() == "front_1 10 0 10.25\nfront_1_2 11 0 10\n"


def test_measured_points_keep_their_frame_and_mark(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("j1_deg,j2_deg,x_mm,y_mm,z_mm\n1,2,10.5,20,30\n2,2,11,21,31\n")
    told = run("export", "points", tmp_path / "m.csv", "-o", tmp_path / "m.txt")
    assert (tmp_path / "m.txt").read_text() == "P1 10.5 20 30\nP2 11 21 31\n"
    assert "the base frame" in told


def test_targets_of_a_program_are_listed_by_line_in_their_work_frame(tmp_path: Path) -> None:
    (tmp_path / "p.src").write_text(
        "DEF p()\n$BASE={X 800,Y 0,Z 400,A 0,B 0,C 0}\n$TOOL={X 0,Y 0,Z 200,A 0,B 0,C 0}\n"
        "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nLIN {X 1,Y 2.5,Z 3,A 0,B 90,C 0}\n"
        "LIN {X 4,Y 5,Z 6,A 0,B 90,C 0}\nEND\n"
    )
    told = run("export", "points", tmp_path / "p.src", "-o", tmp_path / "p.txt")
    assert (tmp_path / "p.txt").read_text() == "N5 1 2.5 3\nN6 4 5 6\n", told
    assert "work frame 1 of p.src (X, Y, Z, A, B, C 800, 0, 400, 0, 0, 0)" in " ".join(told.split())


def test_simulated_points_are_marked_in_a_comment_of_both() -> None:
    points = PointList(
        name=("a",), group=("g",), frame=("f",), position=np.full((1, 3), MM),
        provenance=Provenance(simulated=True, instrument="tracker"),
    )  # fmt: skip
    for text in (plain_list(points), comma_list(points, "c")):
        assert text.startswith("// robotrue ")
        assert provenance_of_lines(["#" + text.partition("\n")[0][2:]]) != MEASURED
