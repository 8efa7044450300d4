"""``robotrue compensate``: bytes, numbers, loads, guards and jobs of two files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import shop

NUMBER = re.compile(rb"[-+]?\d+\.?\d*")
START = "0,-80,80,0,40,0"


def test_a_bare_cell_changes_nothing(cli, work: Path) -> None:
    got = cli("compensate", work / "cell.toml", work / "part.src", "-o", work / "o.src", "--json")
    assert got.code == 0
    assert (work / "o.src").read_bytes() == (work / "part.src").read_bytes()
    assert got.document["targets"] == got.document["unchanged"] == 5
    assert got.document["compensated"] == 0


def test_only_numbers_change(cli, work: Path) -> None:
    before = (work / "part.src").read_bytes()
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json",
              "--allow-steps")  # fmt: skip
    after = (work / "o.src").read_bytes()
    assert got.code == 0
    assert (work / "part.src").read_bytes() == before
    assert after != before
    assert NUMBER.sub(b"#", after) == NUMBER.sub(b"#", before)
    changed = [k for k, pair in enumerate(zip(before.split(b"\n"), after.split(b"\n"), strict=True))
               if pair[0] != pair[1]]  # fmt: skip
    assert changed == [5, 6, 8]  # not the axis target, not the one out of reach


def test_document_and_statuses(cli, work: Path) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json",
              "--allow-steps")  # fmt: skip
    document = got.document
    assert document["output"] == str(work / "o.src")
    assert document["targets"] == 5
    assert document["compensated"] == 3
    assert document["unchanged"] == 2
    assert document["status"] == {
        "compensated": 3,
        "unchanged_axis_target": 1,
        "unchanged_unreachable": 1,
    }
    assert document["notes"] == ["line 8: unchanged, out of the robot's reach."]
    assert document["predicted_error_after_um"]["max"] < 1.0
    assert document["predicted_error_before_um"]["mean"] > 100.0
    assert document["predicted_sigma_um"]["mean"] > 0.0
    assert "line 8: unchanged, out of the robot's reach." in got.err


def test_axis_targets_on_request(cli, work: Path) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src",
              "--axis-targets", "--allow-steps", "--json")  # fmt: skip
    assert got.document["compensated"] == 4
    assert b"PTP {A1 0,A2 -80" not in (work / "o.src").read_bytes()


def test_a_wrench_moves_the_command_against_it(cli, work: Path) -> None:
    for name, options in (
        ("free", ("--allow-steps",)),
        ("held", ("--allow-steps", "--wrench", "0,0,-500")),
    ):
        cli(
            "compensate",
            work / "model.rtm",
            work / "part.src",
            "-o",
            work / f"{name}.src",
            *options,
        )
    free, held = (_first_linear(work / f"{n}.src") for n in ("free", "held"))
    assert held[2] - free[2] > 0.2  # pushed down by 500 N, so it is sent higher, mm


def _first_linear(path: Path) -> np.ndarray:
    line = next(row for row in path.read_bytes().split(b"\n") if row.startswith(b"LIN"))
    return np.array([float(v) for v in NUMBER.findall(line)[:3]])


def test_a_correction_beyond_the_limit_is_left_alone(cli, work: Path) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src",
              "--max-shift-mm", "0.01", "--json")  # fmt: skip
    assert got.code == 0
    assert got.document["status"]["unchanged_step"] == 3
    assert (work / "o.src").read_bytes() == (work / "part.src").read_bytes()


@pytest.mark.parametrize(("options", "message"), [
    (("--wrench", "1,2"), "wrench '1,2', expected 3 or 6 numbers in N and N m"),
    (("--wrench", "a,b,c"), "wrench 'a,b,c', expected 3 or 6 numbers"),
    (("--wrench", "1,2,nan"), "wrench '1,2,nan', expected 3 or 6 numbers"),
    (("--max-shift-mm", "0"), "--max-shift-mm is 0 mm, expected above 0"),
])  # fmt: skip
def test_options_that_cannot_be(cli, work: Path, options: tuple[str, str], message: str) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", *options)
    assert got.code == 1
    assert message in got.err
    assert not (work / "o.src").exists()


SRC = """DEF job()
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
LIN {X 1200.0,Y 200.0,Z 900.0,A 0,B 120,C 0}
LIN XP1
END
"""
DAT = """DEFDAT job
DECL E6POS XP1={X 1150.0,Y -100.0,Z 850.0,A 0.0,B 120.0,C 0.0,S 2,T 3,E1 0.0,E2 0.0}
ENDDAT
"""


def test_a_job_of_two_files(cli, work: Path) -> None:
    (work / "job.src").write_text(SRC)
    (work / "job.dat").write_text(DAT)
    got = cli(
        "compensate", work / "model.rtm", work / "job.src", "-o", work / "new.src", "--json",
        "--start", START,
    )  # fmt: skip
    assert got.code == 0, got.err
    assert got.document["targets"] == 2
    assert got.document["compensated"] == sum(f["compensated"] for f in got.document["files"])
    outputs = [Path(f["output"]).name for f in got.document["files"]]
    assert outputs == ["new.src", "new.dat"]
    assert (work / "job.src").read_text() == SRC
    assert (work / "job.dat").read_text() == DAT
    new = (work / "new.dat").read_text()
    assert new != DAT
    assert NUMBER.sub(b"#", new.encode()) == NUMBER.sub(b"#", DAT.encode())
    seen = cli("inspect", work / "job.src", "--json").document
    assert seen["files"] == ["job.src", "job.dat"]
    assert seen["targets"] == 2


def test_the_companion_is_not_overwritten_either(cli, work: Path) -> None:
    (work / "job.src").write_text(SRC)
    (work / "job.dat").write_text(DAT)
    got = cli("compensate", work / "model.rtm", work / "job.src", "-o", work / "job.dat")
    assert got.code == 1
    assert (work / "job.dat").read_text() == DAT


def test_companions_of_one_suffix_keep_their_names(cli, work: Path, tmp_path: Path) -> None:
    point = "{X 700,Y 0,Z 700,A 0,B 90,C 0}"
    for name in ("one", "two"):
        (work / f"{name}.dat").write_text(
            f"DEFDAT {name} PUBLIC\nDECL GLOBAL POS P_{name}={point}\nENDDAT\n"
        )
    (work / "main.src").write_text("DEF main()\nPTP P_one\nLIN P_two\nEND\n")
    out = tmp_path / "out"
    out.mkdir()
    files = [work / "main.src", work / "one.dat", work / "two.dat"]
    begun = ("--start", START)
    got = cli("compensate", work / "model.rtm", *files, "-o", out / "job.src", "--json", *begun)
    assert got.code == 0
    names = [Path(each["output"]).name for each in got.document["files"]]
    assert names == ["job.src", "one.dat", "two.dat"]
    assert got.document["compensated"] == 2
    assert (out / "one.dat").read_bytes() != (work / "one.dat").read_bytes()
    assert (out / "job.src").read_bytes() == (work / "main.src").read_bytes()
    beside = cli("compensate", work / "model.rtm", *files, "-o", work / "job.src")
    assert beside.code == 1
    assert "the output is one.dat, which is an input" in beside.err
    assert "another folder after -o" in beside.err
    assert not (work / "job.src").exists()


def test_a_folder_is_a_job_and_a_folder_takes_it(cli, work: Path, tmp_path: Path) -> None:
    source, out = tmp_path / "in", tmp_path / "out"
    source.mkdir()
    out.mkdir()
    (source / "part.src").write_bytes((work / "part.src").read_bytes())
    (source / "readme.txt").write_text("not a program\n")
    got = cli("compensate", work / "model.rtm", source, "-o", out, "--allow-steps", "--json")
    assert got.code == 0
    assert got.document["output"] == str(out / "part.src")
    alone = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json",
                "--allow-steps")  # fmt: skip
    assert (out / "part.src").read_bytes() == (work / "o.src").read_bytes()
    assert got.document["compensated"] == alone.document["compensated"] == 3
    (source / "two.src").write_bytes((work / "part.src").read_bytes().replace(b"part()", b"two()"))
    new = tmp_path / "new"
    assert cli("compensate", work / "model.rtm", source, "-o", new, "--allow-steps").code == 0
    assert sorted(path.name for path in new.glob("*.src")) == ["part.src", "two.src"]


def test_frames_the_cell_names_reach_the_program(cli, work: Path) -> None:
    text = "DEF part()\nBAS(#BASE,4)\nBAS(#TOOL,2)\nPTP {X 0,Y 0,Z 0,A 0,B 90,C 0}\nEND\n"
    (work / "named.src").write_text(text)
    command = ("compensate", work / "model.rtm", work / "named.src", "-o", work / "o.src", "--json")
    silent = cli(*command)
    assert silent.document["status"] == {"unchanged_source": 1}
    assert "base number 4 is stored in the controller" in silent.err
    told = (
        "[[controller.base]]\nnumber = 4\nxyz_mm = [700, 0, 700]\n[[controller.tool]]\nnumber = 2\n"
    )
    begun = f"[controller]\nstart_deg = [{START}]\n"
    (work / "frames.toml").write_text((work / "cell.toml").read_text() + begun + told)
    known = cli(*command, "--cell", work / "frames.toml")
    assert known.document["status"] == {"compensated": 1}
    moved = cli(
        "diff", work / "named.src", work / "o.src", "--model", work / "model.rtm",
        "--cell", work / "frames.toml", "--json",
    )  # fmt: skip
    assert moved.document["files"][0]["moved"] == 1
    (work / "$config.dat").write_text(
        "DEFDAT $CONFIG\nBASE_DATA[4]={X 700.0,Y 0.0,Z 700.0,A 0.0,B 0.0,C 0.0}\n"
        "TOOL_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n"
    )
    first = (work / "o.src").read_bytes()
    assert cli(*command, "--start", START).document["status"] == {"compensated": 1}
    assert (work / "o.src").read_bytes() == first


def test_a_file_that_the_program_names_keeps_its_name(cli, work: Path, tmp_path: Path) -> None:
    call = 'CR_PROCESS_FILE("path.csv",1,-1,"OK")'
    (work / "path.src").write_text(
        f"DEF path()\nPTP {{A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}}\n{call}\nEND\n"
    )
    (work / "path.csv").write_text("1;1100.0;200.0;900.0;0.0;120.0;0.0;1;200.0\n")
    out = tmp_path / "out"
    out.mkdir()
    got = cli("compensate", work / "model.rtm", work / "path.src", "-o", out / "new.src", "--json")
    assert [Path(each["output"]).name for each in got.document["files"]] == ["new.src", "path.csv"]
    assert got.document["files"][1]["compensated"] == 1
    assert (out / "path.csv").read_text().startswith("1;1")
    assert (out / "path.csv").read_text() != (work / "path.csv").read_text()


def test_a_note_names_its_file_once_and_a_program_of_calls_is_told(cli, work: Path) -> None:
    (work / "calls.src").write_bytes(b"DEF calls()\npart()\nINTERRUPT ON 3\nEND\n")
    (work / "odd.src").write_bytes(b"DEF odd()\nLIN_REL {X 1.0,Y 2.0}\nLIN p[k]\nEND\n")
    for name, said in (("calls", "it holds no target"), ("odd", "")):
        got = cli("compensate", work / "cell.toml", work / f"{name}.src", "-o", work / "o.src")
        assert got.code == 0
        notes = [line for line in got.err.splitlines() if line.startswith("note:")]
        assert notes
        assert all(line.count(f"{name}.src") == 1 for line in notes)
        assert said in got.err
        (work / "o.src").unlink()


LEDGE = "LIN {X 9800.0,Y -200.0,Z 900.0,A 0,B 120,C 0}\n"


def test_a_ledge_in_the_path_is_measured_and_not_written(cli, work: Path) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json")
    assert got.code == 2
    assert not (work / "o.src").exists()
    assert not list(work.glob("*.identity.json"))
    fault = got.fault
    assert fault["kind"] == "StepError"
    steps = fault["steps"]
    assert (steps["count"], steps["limit_mm"], steps["allowed"]) == (2, 0.1, False)
    assert [(each["from"], each["to"], each["left_alone"]) for each in steps["first"]] == [
        ("part.src:7", "part.src:8", "part.src:8"),
        ("part.src:8", "part.src:9", "part.src:8"),
    ]
    # Twice from the bytes: how far the neighbours are moved.
    arguments = (work / "model.rtm", work / "part.src", "-o", work / "o.src", "--allow-steps")
    allowed = cli("compensate", *arguments, "--json")
    assert allowed.code == 0
    before, after = (_places(work / name) for name in ("part.src", "o.src"))
    moved = np.linalg.norm(after - before, axis=1)
    assert [each["mm"] for each in steps["first"]] == pytest.approx(moved[[1, 3]], abs=1e-3)
    assert steps["max_mm"] == pytest.approx(moved[[1, 3]].max(), abs=1e-3)
    assert allowed.document["steps"] == {**steps, "allowed": True}
    assert f"the largest {steps['max_mm']:.3f} mm from" not in got.err
    assert f"the largest {steps['max_mm']:.3f} mm" in got.err
    assert "line 8: unchanged, out of the robot's reach." in got.err
    assert "Nothing was written. Try: --allow-steps; the notes list the reasons" in got.err


def _places(path: Path) -> np.ndarray:
    lines = [row for row in path.read_bytes().split(b"\n") if row.startswith(b"LIN")]
    return np.array([[float(v) for v in NUMBER.findall(row)[:3]] for row in lines])


def test_the_limit_of_a_step_can_be_said(cli, work: Path) -> None:
    call = ("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json")
    assert cli(*call, "--max-step", "10").code == 0
    assert cli(*call, "--max-step", "-1").code == 1


def test_joint_moves_and_home_positions_make_no_step(cli, work: Path) -> None:
    text = shop.PROGRAM.replace(LEDGE, LEDGE.replace("LIN", "PTP"))
    last = "LIN {X 1150.0"
    (work / "joint.src").write_text(text.replace(last, last.replace("LIN", "PTP")))
    call = ("compensate", work / "model.rtm", work / "joint.src", "-o", work / "o.src", "--json")
    got = cli(*call)
    assert got.code == 0, got.err
    assert got.document["status"]["unchanged_unreachable"] == 1
    assert got.document["steps"]["count"] == 0
    assert got.document["steps"]["max_mm"] == 0.0


def test_steps_between_stored_points_in_the_order_of_the_moves(cli, work: Path) -> None:
    pose = "Y -200.0,Z 900.0,A 0,B 120,C 0}"
    points = [f"DECL E6POS XP{k}={{X {x},{pose}" for k, x in enumerate((1150, 1100, 9800, 1200))]
    (work / "s.dat").write_text("\n".join(["DEFDAT s", *points, "ENDDAT", ""]))
    head = shop.PROGRAM.split("LIN")[0].replace("part()", "s()")
    # XP2 is out of reach; only XP3 is next to it, though it stands elsewhere in the file.
    order = "LIN XP0\nLIN XP1\nLIN XP0\nPTP XP2\nLIN XP3\nEND\n"
    (work / "s.src").write_text(head + order)
    got = cli("compensate", work / "model.rtm", work / "s.src", "-o", work / "out.src", "--json",
              "--start", "0,-80,80,0,40,0")  # fmt: skip
    assert got.code == 2, got.err
    assert not (work / "out.src").exists()
    assert not (work / "out.dat").exists()
    steps = got.fault["steps"]["first"]
    assert [(each["from"], each["to"]) for each in steps] == [("s.dat:4", "s.dat:5")]


def test_notes_carry_the_reason_with_file_line_and_remedy(cli, work: Path) -> None:
    text = shop.PROGRAM.replace(LEDGE, "").replace("LIN {X 1150", "Spindle_On(9)\nLIN {X 1150")
    (work / "named.src").write_text(text)
    got = cli("compensate", work / "model.rtm", work / "named.src", "-o", work / "o.src",
              "--allow-steps", "--json")  # fmt: skip
    first, second = got.document["notes"]
    assert first.startswith("named.src:8: Spindle_On is in no file given and may change base")
    assert 'harmless_routines = ["Spindle_On"]' in first
    assert second == "line 9: unchanged, its base or tool is not known."
    folder = work / "in"
    folder.mkdir()
    (folder / "named.src").write_text(text)
    (folder / "other.src").write_text(shop.PROGRAM.replace("part()", "other()"))
    (work / "out").mkdir()
    both = cli("compensate", work / "model.rtm", folder, "-o", work / "out", "--allow-steps",
               "--json")  # fmt: skip
    assert [note for note in both.document["notes"] if "unchanged" in note] == [
        f"named.src: {second}",
        "other.src: line 8: unchanged, out of the robot's reach.",
    ]


def test_a_copy_without_its_identity_is_known_by_its_bytes(cli, work: Path) -> None:
    first = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src",
                "--allow-steps")  # fmt: skip
    assert first.code == 0
    assert "part.src: no identity file; assumed to be uncompensated" in first.err
    away = work / "elsewhere"
    away.mkdir()
    for copy in (work / "copy.src", away / "o.src"):
        copy.write_bytes((work / "o.src").read_bytes())
        got = cli("compensate", work / "model.rtm", copy, "-o", work / "twice.src")
        assert got.code == 1
        assert "the program is a copy of o.src, which is compensated already" in got.err
        assert "Try: compensate part.src." in got.err
        assert not (work / "twice.src").exists()


def test_the_arm_goes_home_also_behind_a_routine_in_no_file(cli, work: Path) -> None:
    # The other wrist: only the axis target says so.
    home = "PTP {A1 0,A2 -80,A3 80,A4 180,A5 -40,A6 180}\n"
    frames = "".join(line + "\n" for line in shop.PROGRAM.split("\n")[2:4])
    lines = "".join(line + "\n" for line in shop.PROGRAM.split("\n")[5:7])
    texts = {"known": "WAIT SEC 1\n", "unknown": "Spindle_On()\n"}
    written = {}
    for name, call in texts.items():
        (work / f"{name}.src").write_text(f"DEF part()\n{call}{home}{frames}{lines}END\n")
        got = cli("compensate", work / "model.rtm", work / f"{name}.src", "-o", work / "o.src",
                  "--json")  # fmt: skip
        assert got.code == 0, got.err
        assert got.document["compensated"] == 2
        assert got.document["steps"]["count"] == 0
        written[name] = (work / "o.src").read_text().split("\n")[5:]
    assert written["unknown"] == written["known"]


COMPUTED_TARGET = """DEF job()
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
LIN {X 1200.0,Y 200.0,Z 900.0,A 0,B 120,C 0}
LIN {X 1200.0,Y 100.0,Z 900.0,A 0,B 120,C 0}
LIN {X 1150.0,Y 100.0,Z 950.0,A 0,B 118,C 0}
LIN {X DEEP,Y 100.0,Z 900.0,A 0,B 120,C 0}
LIN {X 1150.0,Y 200.0,Z 900.0,A 0,B 120,C 0}
END
"""


def test_a_computed_target_gets_a_corrected_frame_to_state(cli, work: Path) -> None:
    (work / "deep.src").write_text(COMPUTED_TARGET)
    got = cli("compensate", work / "model.rtm", work / "deep.src", "-o", work / "o.src", "--json",
              "--allow-steps")  # fmt: skip
    assert got.code == 0, got.err
    [found] = got.document["frame_corrections"]
    assert (found["computed_targets"], found["fitted_targets"]) == (1, 4)
    assert found["xyz_before_mm"] == [0.0, 0.0, 0.0]
    assert found["predicted_error_after_um"]["max"] < found["predicted_error_before_um"]["mean"]
    assert "1 computed target is unchanged. To move it too, run the original program" in got.err


def test_the_frame_is_told_where_steps_stop_the_work(cli, work: Path) -> None:
    (work / "deep.src").write_text(COMPUTED_TARGET)
    got = cli("compensate", work / "model.rtm", work / "deep.src", "-o", work / "o.src")
    assert got.code == 2
    assert "in place of X 0.0000 Y 0.0000" in got.err
    assert not (work / "o.src").exists()
