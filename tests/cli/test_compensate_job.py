"""``robotrue compensate`` of a folder: one table of its programs, whatever their languages."""

from __future__ import annotations

from pathlib import Path

import pytest
import shop

MODULE = """MODULE place
TASK PERS tooldata tGrip:=[TRUE,[[60,40,250],[1,0,0,0]],[2,[0,0,15],[1,0,0,0],0,0,0]];
TASK PERS wobjdata wTable:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PROC main()
MoveL [[1200,200,900],[0.5,0,0.8660254,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,z1,tGrip\\WObj:=wTable;
MoveL [[1200,-100,900],[0.5,0,0.8660254,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,z1,tGrip\\WObj:=wTable;
ENDPROC
ENDMODULE
"""  # noqa: E501
SRC = """DEF pick()
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
LIN P1
LIN P2
Spindle_On(9)
LIN {X 1200,Y 100,Z 900,A 0,B 120,C 0}
END
"""
DAT = """DEFDAT pick
DECL E6POS P1={X 1200.0,Y 200.0,Z 900.0,A 0,B 120,C 0}
DECL E6POS P2={X 1200.0,Y -200.0,Z 900.0,A 0,B 120,C 0}
ENDDAT
"""


@pytest.fixture
def backup(work: Path) -> Path:
    folder = work / "backup"
    texts = {
        "KRC/part.src": shop.PROGRAM,
        "KRC/cell/pick.src": SRC,
        "KRC/cell/pick.dat": DAT,
        "ABB/place.mod": MODULE,
        "KRC/notes.txt": "no program\n",
    }
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def compensate(cli, work: Path, folder: Path, *options: str):
    return cli("compensate", work / "model.rtm", folder, "-o", work / "out", "--allow-steps",
               "--start", "0,-80,80,0,40,0", *options)  # fmt: skip


def test_every_program_has_one_row(cli, work: Path, backup: Path) -> None:
    document = compensate(cli, work, backup, "--json").document
    rows = {row["file"]: row for row in document["programs"]}
    assert {name: (row["language"], row["targets"]) for name, row in rows.items()} == {
        "KRC/part.src": ("krl", 5), "KRC/cell/pick.src": ("krl", 3), "ABB/place.mod": ("rapid", 2),
    }  # fmt: skip
    place, part = rows["ABB/place.mod"], rows["KRC/part.src"]
    assert (place["compensated"], place["left_alone"], place["first_reason"]) == (2, 0, "")
    assert place["path_mm"] == pytest.approx(300.0)
    assert place["compensated_path_mm"] == pytest.approx(300.0)
    assert 0.05 < place["correction_mean_mm"] <= place["correction_max_mm"] < 5.0
    assert (part["compensated"], part["first_reason"]) == (3, "line 5: axis target")
    assert rows["KRC/cell/pick.src"]["first_reason"] == "line 7: unknown frame"
    assert sum(row["targets"] for row in rows.values()) == document["targets"]
    assert sum(row["path_mm"] for row in rows.values()) == pytest.approx(
        document["steps"]["path_mm"]
    )
    assert (work / "out/ABB/place.mod").read_text() != MODULE


def test_reasons_are_counted_with_the_remedy(cli, work: Path, backup: Path) -> None:
    document = compensate(cli, work, backup, "--json").document
    reasons = document["reasons"]
    assert sum(each["targets"] for each in reasons) == sum(
        row["left_alone"] for row in document["programs"]
    )
    assert [each["targets"] for each in reasons] == sorted(
        (each["targets"] for each in reasons), reverse=True
    )
    axis = next(each for each in reasons if each["kind"] == "axis target")
    assert axis["first"] == "KRC/part.src:5"
    assert axis["remedy"] == "compensate with --axis-targets"
    worst = document["worst_targets"]
    assert [each["bound_mm"] for each in worst] == sorted(
        (each["bound_mm"] for each in worst), reverse=True
    )
    assert all(each["bound_mm"] > each["error_after_mm"] for each in worst)


def test_programs_are_reported_one_by_one_on_request(cli, work: Path, backup: Path) -> None:
    short = compensate(cli, work, backup)
    assert "3 programs: " in short.out
    assert "targets left alone, by reason" in short.out
    assert "largest predicted errors" in short.out
    assert "largest group of targets left alone" in short.err
    assert "targets compensated, written to" not in short.err
    assert short.err.count("Spindle_On is in no file given") == 1
    full = compensate(cli, work, backup, "-v")
    assert full.err.count("targets compensated, written to") == 4
    assert full.out == short.out


def test_one_program_has_no_table(cli, work: Path, backup: Path) -> None:
    got = cli("compensate", work / "model.rtm", backup / "KRC/cell/pick.src", "-o",
              work / "pick.src", "--allow-steps", "--start", "0,-80,80,0,40,0")  # fmt: skip
    assert "programs: " not in got.out
    assert "pick.dat: " in got.err
