"""``robotrue compensate`` in blocks: the files and counts of the program held whole."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from robotrue.program import program_file
from robotrue.program.program_file import outline_job

VAL3 = "http://www.staubli.com/robotics/VAL3/"


def program(count: int) -> str:
    head = "&ACCESS RVP\nDEF part()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n"
    head += "$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}\nPTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}\nLIN P9\n"
    lines = []
    for k in range(count):
        x = 9800 if k % 100 == 77 else 1200 - k % 40
        lines.append(f"LIN {{X {x:.3f},Y {200 - 1.5 * k:.3f},Z {900 + k % 7:.3f},A 0,B 120,C 0}}")
    return head + "\n".join(lines) + "\nEND\n"


@pytest.fixture
def short_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_file, "LONG", 1)
    monkeypatch.setattr(program_file, "outline_job", partial(outline_job, targets=60))


@pytest.fixture
def both(cli, work: Path, monkeypatch: pytest.MonkeyPatch):
    """Compensates a program whole and in blocks with the same options; the two answers."""

    def run(name: str, *options: str):
        call = ("compensate", work / "model.rtm", work / name, "--start", "0,-80,80,0,40,0", "-o")
        options = (*options, "--allow-steps")
        whole = cli(*call, work / "whole.src", *options, "--json")
        assert whole.code == 0, whole.err
        monkeypatch.setattr(program_file, "LONG", 1)
        monkeypatch.setattr(program_file, "outline_job", partial(outline_job, targets=60))
        blocks = cli(*call, work / "blocks.src", *options, "--json")
        assert blocks.code == 0, blocks.err
        return whole, blocks

    return run


def test_blocks_are_the_whole(both, work: Path) -> None:
    (work / "long.src").write_text(program(250))
    (work / "long.dat").write_text(
        "DEFDAT long\nDECL FRAME P9={X 1200.0,Y 150.0,Z 950.0,A 0,B 120,C 0}\nENDDAT\n"
    )
    whole, blocks = both("long.src", "--wrench", "0,0,-300")
    assert (work / "blocks.src").read_bytes() == (work / "whole.src").read_bytes()
    assert (work / "blocks.dat").read_bytes() == (work / "whole.dat").read_bytes()
    assert (work / "blocks.dat").read_bytes() != (work / "long.dat").read_bytes()
    one, other = whole.document["files"][0], blocks.document["files"][0]
    assert one["route"] == "whole"
    assert (other["route"], other["blocks"], other["workers"]) == ("blocks", 5, 1)
    for key in ("targets", "compensated", "unchanged", "status", "notes", "model"):
        assert other[key] == one[key], key
    for key in ("predicted_error_before_um", "correction_um", "predicted_sigma_um"):
        assert other[key]["max"] == pytest.approx(one[key]["max"], rel=1e-12)
        assert other[key]["mean"] == pytest.approx(one[key]["mean"], rel=1e-12)
    assert one["status"]["unchanged_unreachable"] == 2
    assert "lines 84, 184: unchanged, out of the robot's reach." in blocks.err


def test_steps_are_those_of_the_whole_also_between_blocks(both, work: Path) -> None:
    rows = program(250).replace("LIN P9\n", "").split("\n")
    for line in (64, 65, 130, 185):  # ends and begins of blocks of 60 targets; the first is axes
        rows[line] = rows[line].replace("{X 1", "{X 91")
    (work / "long.src").write_text("\n".join(rows))
    whole, blocks = both("long.src")
    assert blocks.document["blocks"] == 5
    one, other = whole.document["steps"], blocks.document["steps"]
    assert one["count"] == 10
    assert other.pop("path_mm") == pytest.approx(one.pop("path_mm"), rel=1e-12)
    corrected = one.pop("compensated_path_mm")
    assert other.pop("compensated_path_mm") == pytest.approx(corrected, rel=1e-12)
    assert other == one


def test_a_ledge_in_a_long_program_leaves_no_file(cli, work: Path, short_blocks: None) -> None:
    (work / "long.src").write_text(program(250).replace("LIN P9\n", ""))
    got = cli("compensate", work / "model.rtm", work / "long.src", "-o", work / "o.src", "--json")
    assert got.code == 2
    assert got.fault["steps"]["count"] == 4
    assert "lines 83, 183: unchanged, out of the robot's reach." in got.err
    assert not list(work.glob("o.src*"))


def test_arrays_in_the_dat(both, work: Path) -> None:
    (work / "job.src").write_text(
        "DEF job()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}\n"
        "FOR i=1 TO 150\nLIN p[i] C_DIS\nENDFOR\nLIN {X 1200,Y 0,Z 900,A 0,B 120,C 0}\nEND\n"
    )
    points = [
        f"p[{k + 1}]={{X 1200.0,Y {200 - 2.0 * k:.1f},Z {900 + k % 7}.0,A 0,B 120,C 0}}\n"
        for k in range(150)
    ]
    dat = "DEFDAT job PUBLIC\nDECL FRAME p[150]\n" + "".join(points) + "ENDDAT\n"
    (work / "job.dat").write_text(dat)
    whole, blocks = both("job.src")
    for suffix in (".src", ".dat"):
        new = (work / "blocks.src").with_suffix(suffix).read_bytes()
        assert new == (work / "whole.src").with_suffix(suffix).read_bytes()
        assert new != (work / "job.src").with_suffix(suffix).read_bytes()
    one, other = whole.document["files"], blocks.document["files"]
    assert [Path(f["output"]).suffix for f in other] == [".src", ".dat"]
    assert [f["route"] for f in other] == ["whole", "blocks"]
    assert [f["status"] for f in other] == [f["status"] for f in one]
    assert other[1]["blocks"] == 3


def test_the_identity_is_written_and_asked_for(cli, work: Path, short_blocks: None) -> None:
    (work / "long.src").write_text(program(150).replace("LIN P9\n", ""))
    call = ("compensate", work / "model.rtm")
    first = cli(*call, work / "long.src", "-o", work / "once.src", "--allow-steps")
    assert first.code == 0
    again = cli(*call, work / "once.src", "-o", work / "twice.src")
    assert again.code == 1
    assert "compensated already" in again.err
    assert not (work / "twice.src").exists()


def test_what_is_held_whole_says_so(
    cli, work: Path, short_blocks: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = program(150).replace(
        "LIN P9\n", "LIN {X 1200,Y 0,Z 900,A 0,B 120,C 0} WITH $TOOL=$NULLFRAME\n"
    )
    (work / "long.src").write_text(text)
    call = ("compensate", work / "model.rtm", work / "long.src", "-o", work / "out.src", "--json",
            "--allow-steps")  # fmt: skip
    got = cli(*call)
    assert got.code == 0
    assert got.document["route"] == "whole"
    assert "held whole (line 6: a target that is stored or has its own clauses)" in got.err
    (work / "out.src").unlink()
    monkeypatch.setattr(program_file, "_memory", lambda: 1000)
    refused = cli(*call)
    assert refused.code == 1
    assert "this machine has" in refused.err
    assert not (work / "out.src").exists()


def test_notes_of_a_tool_path_are_those_of_the_whole(
    cli, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [f"{1200 - k % 40:.3f},{200 - k:.3f},{900 + k % 7:.3f},0.0,0.0,1.0" for k in range(250)]
    (work / "long.csv").write_text("\n".join(["x_mm,y_mm,z_mm,i,j,k", *rows, ""]))
    call = ("compensate", work / "model.rtm", work / "long.csv", "--allow-steps", "--json", "-o")
    whole = cli(*call, work / "whole.csv")
    monkeypatch.setattr(program_file, "LONG", 1)
    monkeypatch.setattr(program_file, "outline_job", partial(outline_job, targets=60))
    blocks = cli(*call, work / "blocks.csv")
    assert (whole.code, blocks.code) == (0, 0), blocks.err
    assert (blocks.document["route"], blocks.document["blocks"]) == ("blocks", 4)
    assert blocks.document["notes"] == whole.document["notes"]
    assert "long.csv:2, 3, 4, 5, 6 and 245 more lines: only the tool axis" in blocks.err


def test_two_files_of_a_val3_application_are_those_of_the_whole(
    cli, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool = '<Value key="0" x="60" y="40" z="250" rx="0" ry="0" rz="0" fatherId="flange[0]" />'
    data = [f"<Database xmlns='{VAL3}Data/2'><Datas>", '<Data name="t" type="tool">', tool]
    data += ["</Data>", '<Data name="p" type="pointRx">']
    for k in range(250):
        place = f'x="{1200 - k % 40}.000" y="{200 - k}.000" z="{900 + k % 7}.000"'
        data += [f'<Value key="{k}" {place} rx="0" ry="120" rz="0" fatherId="world[0]" />']
    code = [f"<Programs xmlns='{VAL3}Program/2'><Program name='a'><Code>"]
    code += [f"movel(p[{k}],t,mNom)" for k in range(250)]
    (work / "long.dtx").write_text("\n".join([*data, "</Data></Datas></Database>", ""]))
    (work / "long.pgx").write_text("\n".join([*code, "</Code></Program></Programs>", ""]))
    call = ("compensate", work / "model.rtm", work / "long.pgx", "--start", "0,-80,80,0,40,0")
    call = (*call, "--allow-steps", "--json", "-o")
    whole = cli(*call, work / "whole.pgx")
    monkeypatch.setattr(program_file, "LONG", 1)
    monkeypatch.setattr(program_file, "outline_job", partial(outline_job, targets=60))
    blocks = cli(*call, work / "blocks.pgx")
    assert (whole.code, blocks.code) == (0, 0), blocks.err
    for answer, route in ((whole, "whole"), (blocks, "blocks")):
        files = {each["source"]: each for each in answer.document["files"]}
        assert {each["route"] for each in files.values()} == {route}
        assert files["long.dtx"]["compensated"] == 250
    for name in ("pgx", "dtx"):
        found = (work / f"blocks.{name}").read_bytes()
        assert found == (work / f"whole.{name}").read_bytes()
        assert (found == (work / f"long.{name}").read_bytes()) == (name == "pgx")
    assert blocks.document["steps"]["count"] == whole.document["steps"]["count"]
    length = whole.document["steps"]["path_mm"]
    assert blocks.document["steps"]["path_mm"] == pytest.approx(length, rel=1e-12)


def test_requests_that_cannot_be(cli, work: Path) -> None:
    (work / "long.src").write_text(program(20).replace("LIN P9\n", ""))
    call = ("compensate", work / "model.rtm", work / "long.src", "-o", work / "out.src")
    none = cli(*call, "--workers", "0")
    assert none.code == 1
    assert "--workers is 0, expected 1 or more" in none.err
    assert not (work / "out.src").exists()
