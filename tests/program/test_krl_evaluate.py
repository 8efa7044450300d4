"""Computed KRL targets and frames, against poses worked out by hand with scipy's rotations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from krl_samples import replacement, write
from scipy.spatial.transform import Rotation

from robotrue.core.model_identity import ModelIdentity
from robotrue.program.formats import read_job
from robotrue.program.identity import ProgramIdentity, write_identity
from robotrue.program.program import FrameTable, Program, Reason

P1 = "X 100.0,Y 20.0,Z 300.0,A 10.0,B 20.0,C 170.0"
P2 = "X -50.0,Y 400.0,Z 120.0,A -30.0,B 5.0,C 175.0"
OFF = "X 0.0,Y 5.0,Z -40.0,A 0.0,B 0.0,C 15.0"
HEAD = f"""DEFDAT part
DECL E6POS XP1={{{P1},S 2,T 10,E1 0.0}}
DECL E6POS XP2={{{P2},S 2,T 10,E1 0.0}}
DECL FRAME LIFT={{{OFF}}}
INT N_TOOL=2
REAL CLEAR=35.5
"""
CONFIG = f"""DEFDAT $CONFIG
TOOL_DATA[2]={{X 0.0,Y 0.0,Z 200.0,A 0.0,B 0.0,C 0.0}}
TOOL_DATA[3]={{X 0.0,Y 0.0,Z 300.0,A 0.0,B 0.0,C 0.0}}
BASE_DATA[4]={{X 1000.0,Y 50.0,Z 0.0,A 90.0,B 0.0,C 0.0}}
DECL E6POS XPARK={{{P2},S 2,T 10}}
INT FIXTURE=4
ENDDAT
"""


def job(folder: Path, body: str, more: str = "", dat: str = "") -> Program:
    (folder / "part.src").write_text(f"DEF part()\n{body}\nEND\n{more}", newline="\n")
    (folder / "part.dat").write_text(HEAD + dat + "ENDDAT\n", newline="\n")
    (folder / "$config.dat").write_text(CONFIG, newline="\n")
    return read_job(folder / "part.src")[0]


def hand(text: str) -> np.ndarray:
    """A pose in mm from its printed components."""
    value = {word.split()[0]: float(word.split()[1]) for word in text.split(",")}
    T = np.eye(4)
    T[:3, 3] = [value[c] for c in "XYZ"]
    T[:3, :3] = Rotation.from_euler("ZYX", [value[c] for c in "ABC"], degrees=True).as_matrix()
    return T


def pose(program: Program, row: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3], T[:3, :3] = program.position[row] * 1e3, program.rotation[row]
    return T


def lifted(T: np.ndarray, z: float) -> np.ndarray:
    out = T.copy()
    out[2, 3] += z
    return out


EVALUATED = [
    ("LIN XP1:LIFT", hand(P1) @ hand(OFF)),
    (f"PTP {{{P2}}}:INV_POS(LIFT)", hand(P2) @ np.linalg.inv(hand(OFF))),
    ("LIN {X 100.0,Y 2*10,Z 320-CLEAR,A 10.0,B 20.0,C 170.0}", lifted(hand(P1), -15.5)),
    ("XT=XP1\nXT.Z=XT.Z+CLEAR\nLIN XT C_DIS", lifted(hand(P1), 35.5)),
    ("LIN XPARK", hand(P2)),
    ("XT=XP2\nIF $IN[1] THEN\nXT=XP1\nLIN XT:LIFT\nENDIF", hand(P1) @ hand(OFF)),
    ("above(XP1, 10)", lifted(hand(P1), 10)),
    ("above(XP1, 10)\nabove(XP1, 10)", lifted(hand(P1), 10)),
]
ABOVE = "DEF above(P:IN, H:IN)\nE6POS P, T\nREAL H\nT=P\nT.Z=T.Z+H\nLIN T\nEND\n"


@pytest.mark.parametrize(("body", "expected"), EVALUATED)
def test_a_computed_target_is_written_out(tmp_path: Path, body: str, expected: np.ndarray) -> None:
    program = job(tmp_path, body, ABOVE)
    (row,) = np.flatnonzero(program.reason == Reason.NONE).tolist()
    np.testing.assert_allclose(pose(program, row), expected, atol=1e-9)
    assert write(program, replacement(program, rows=[])).encode() == program.data
    (tmp_path / "part.src").write_text(
        write(program, replacement(program, by_mm=(0.5, -0.25, 1.0))), newline="\n"
    )
    again = read_job(tmp_path / "part.src")[0]
    (now,) = np.flatnonzero(again.reason == Reason.NONE).tolist()
    moved = expected.copy()
    moved[:3, 3] += [0.5, -0.25, 1.0]
    np.testing.assert_allclose(pose(again, now), moved, atol=1e-4)


@pytest.mark.parametrize(
    "body",
    [
        "XP1.Z=XP1.Z+20\nLIN XP1",  # data lists keep their values: it adds up
        "XT=XP1\nIF $IN[1] THEN\nXT.Z=XT.Z+20\nENDIF\nLIN XT",
        "XT=XP1\nFOR I=1 TO 3\nXT.Z=XT.Z+20\nLIN XT\nENDFOR",
        "FOR I=1 TO 3\nLIN XP1:{X 0,Y 0,Z I*10,A 0,B 0,C 0}\nENDFOR",
        "LIN XP1:{X 0,Y 0,Z $ANIN[1],A 0,B 0,C 0}",
        "LIN XP1:{Z 50}",
        "above(XP1, 10)\nabove(XP1, 20)",
        "XT=XP1\nlook(XT)\nLIN XT",
        "INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO isr()\nXT=XP1\nLIN XT",
        "XT=XP1\nGOTO on\nXT=XP2\non:\nIF $IN[1] THEN\nGOTO on2\nENDIF\nXT=XP2\non2:\nLIN XT",
    ],
)
def test_what_has_no_single_value_keeps_its_bytes(tmp_path: Path, body: str) -> None:
    program = job(tmp_path, body, ABOVE + "DEF look(P:OUT)\nE6POS P\nEND\nDEF isr()\nXT=XP2\nEND\n")
    assert not (program.reason == Reason.NONE).any()
    change = replacement(program, by_mm=(1, 1, 1))
    assert write(program, change).encode() == program.data
    assert any("not compensated" in note for note in program.notes)


FRAMES = [
    ("BAS(#TOOL,N_TOOL)\nBAS(#BASE,FIXTURE)", 200, 1000),
    ("$TOOL=TOOL_DATA[N_TOOL+1]\n$BASE=BASE_DATA[FIXTURE]", 300, 1000),
    ("M=3\nsettle(M, FIXTURE)", 300, 1000),
    ("settle(2, 4)", 200, 1000),
    ("settle(3, 4)\nsettle(2, 4)", 200, 1000),
    ("outer(2)", 200, 1000),
    ("settle(2, 4)\n$BASE=BASE_DATA[4]:{X 0,Y 10,Z 0,A 0,B 0,C 0}", 200, 990),
    ("LIFT2={X 7,Y 8,Z 9,A 0,B 0,C 0}\n$BASE=LIFT2\n$TOOL=TOOL_DATA[2]", 200, 7),
]
SETTLE = """DEF settle(T:IN, B:IN)
INT T, B
BAS(#TOOL,T)
$BASE=BASE_DATA[B]
END
DEF outer(T:IN)
INT T
settle(T, 4)
END
"""


@pytest.mark.parametrize(("body", "tool", "base"), FRAMES)
def test_computed_frames(tmp_path: Path, body: str, tool: float, base: float) -> None:
    program = job(tmp_path, f"{body}\nLIN {{{P1}}}", SETTLE)
    row = int(np.flatnonzero(program.position[:, 2] == 0.3)[-1])
    assert program.reason[row] == Reason.NONE, program.notes
    np.testing.assert_allclose(program.T_flange_tool[program.tool[row], 2, 3] * 1e3, tool)
    np.testing.assert_allclose(program.T_base_frame[program.frame[row], 0, 3] * 1e3, base)


@pytest.mark.parametrize(
    "body",
    [
        "IF $IN[1] THEN\nM=2\nELSE\nM=3\nENDIF\nBAS(#TOOL,M)",
        "M=2\nWHILE $IN[1]\nBAS(#TOOL,M)\nM=3\nENDWHILE\nBAS(#TOOL,M)",
        "BAS(#TOOL,$IN[3])",
        "settle(M, 4)",
        "N_TOOL=N_TOOL+1\nBAS(#TOOL,N_TOOL)",
        "BAS(#TOOL,2)\nIF $IN[1] THEN\nsettle(3, 4)\nENDIF",
    ],
)
def test_frames_without_a_single_value(tmp_path: Path, body: str) -> None:
    program = job(tmp_path, f"{body}\nLIN {{{P1}}}", SETTLE)
    assert program.reason[-1] == Reason.UNKNOWN_FRAME
    assert any("part.src:" in note for note in program.notes)


def test_a_routine_called_with_two_tools_is_not_entered_with_one(tmp_path: Path) -> None:
    more = f"DEF go(T:IN)\nINT T\nBAS(#TOOL,T)\nBAS(#BASE,4)\nLIN {{{P1}}}\nEND\n"
    program = job(tmp_path, f"go(2)\nLIN {{{P2}}}\ngo(3)\nLIN {{{P2}}}", more)
    assert program.reason.tolist() == [Reason.NONE, Reason.NONE, Reason.UNKNOWN_FRAME]
    tools = program.T_flange_tool[program.tool[:2], 2, 3] * 1e3
    np.testing.assert_allclose(tools, [200, 300])


def test_the_points_a_written_target_is_computed_from_keep_their_motion(tmp_path: Path) -> None:
    """XP1 is moved to and computed with: its correction must not carry the other target along."""
    program = job(tmp_path, "LIN XP1\nLIN XP1:LIFT")
    dat = read_job(tmp_path / "part.src")[1]
    assert not (dat.reason == Reason.NONE).any()
    assert program.reason.tolist() == [Reason.NONE, Reason.NONE]
    for row in (0, 1):  # the model may decline either
        text = write(program, replacement(program, by_mm=(1.0, 0.0, 0.0), rows=[row]))
        lines = text.splitlines()[1:3]
        assert [line.startswith("LIN {X ") for line in lines] == [row == 0, row == 1]


def test_a_target_left_alone_stays_where_it_is_when_its_points_are_corrected(
    tmp_path: Path,
) -> None:
    body = "BAS(#BASE,4)\nLIN XP1\nBAS(#BASE,9)\nLIN XP1:LIFT"
    program = job(tmp_path, body)
    assert program.reason.tolist() == [Reason.NONE, Reason.UNKNOWN_FRAME]
    text = write(program, replacement(program, by_mm=(1.0, 0.0, 0.0), rows=[0]))
    assert text.count("LIN {X ") == 1
    assert "LIN XP1:LIFT" in text
    assert not (read_job(tmp_path / "part.src")[1].reason == Reason.NONE).any()


def test_a_target_computed_in_steps_stays_where_it_is_when_its_point_is_corrected(
    tmp_path: Path,
) -> None:
    body = "WHILE $IN[3]\nXT=XP1:LIFT\nLIN XT\nBAS(#BASE,4)\nBAS(#TOOL,2)\nLIN XP1\nENDWHILE"
    program = job(tmp_path, body)
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME, Reason.NONE]
    assert not (read_job(tmp_path / "part.src")[1].reason == Reason.NONE).any()


def test_a_routine_that_a_trigger_starts_may_find_any_value(tmp_path: Path) -> None:
    body = "TRIGGER WHEN DISTANCE=0 DELAY=0 DO go() PRIO=-1\nLIN XP1\nXT=XP2\ngo()\nXT=XP1"
    program = job(tmp_path, body, "DEF go()\nBAS(#BASE,4)\nBAS(#TOOL,2)\nPTP XT\nEND\n")
    text = write(program, replacement(program, by_mm=(1.0, 0.0, 0.0)))
    assert "PTP XT" in text.splitlines()


PUT = f"DEF put(P:OUT)\nE6POS P\nP={{{P2}}}\nEND\n"


def test_parameters_of_two_routines_with_one_name_are_two_variables(tmp_path: Path) -> None:
    program = job(tmp_path, "put(XT)", PUT + "DEF go(P:IN)\nE6POS P\nLIN P\nEND\n")
    assert not (program.reason == Reason.NONE).any()


def test_a_point_that_a_routine_hands_to_its_caller_keeps_its_numbers(tmp_path: Path) -> None:
    more = PUT.replace("END", "LIN P\nEND")
    program = job(tmp_path, "BAS(#BASE,4)\nBAS(#TOOL,2)\nput(XT)\nBAS(#TOOL,3)\nLIN XT", more)
    text = write(program, replacement(program, by_mm=(1.0, 0.0, 0.0)))
    assert f"P={{{P2}}}" in text.splitlines()
    assert any(line.startswith("LIN {X") for line in text.splitlines())


def test_robroot_moves_the_frames_of_the_controller(tmp_path: Path) -> None:
    root = "DEFDAT $MACHINE\nDECL FRAME $ROBROOT={X 0.0,Y 0.0,Z 500.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n"
    (tmp_path / "$machine.dat").write_text(root)
    program = job(tmp_path, f"BAS(#TOOL,2)\nBAS(#BASE,4)\nLIN {{{P1}}}\n$BASE=$WORLD\nLIN {{{P2}}}")
    frames = program.T_base_frame[program.frame] * 1e3
    np.testing.assert_allclose(frames[:, :3, 3], [[1000, 50, -500], [0, 0, -500]])


def test_a_backup_is_searched_to_its_last_folder(tmp_path: Path) -> None:
    programs, system = tmp_path / "KRC/R1/Program/cell", tmp_path / "KRC/R1/System"
    programs.mkdir(parents=True)
    system.mkdir(parents=True)
    (system / "$config.dat").write_text(CONFIG)
    (system / "am.ini").write_text("[x]\n")
    (programs / "part.src").write_text("DEF part()\nsettle(2, FIXTURE)\nLIN XP1:LIFT\nEND\n")
    (programs / "part.dat").write_text(HEAD + "ENDDAT\n")
    (programs / "other.src").write_text(
        f"DEF other()\nlocal()\nEND\nDEF local()\nLIN {{{P1}}}\nEND\n"
    )
    (tmp_path / "KRC/R1/tools.src").write_text(f"{SETTLE}DEF local()\nBAS(#BASE,9)\nEND\n")
    (tmp_path / "KRC/R1/Program/notes.dat").write_text("no program\n")
    found = {program.name: program for program in read_job(tmp_path)}
    part = found["KRC/R1/Program/cell/part.src"]
    assert set(found) == {
        "KRC/R1/Program/cell/part.src", "KRC/R1/Program/cell/part.dat",
        "KRC/R1/Program/cell/other.src", "KRC/R1/tools.src",
    }  # fmt: skip
    assert part.reason.tolist() == [Reason.NONE]
    np.testing.assert_allclose(pose(part, 0), hand(P1) @ hand(OFF), atol=1e-9)
    assert found["KRC/R1/Program/cell/other.src"].reason.tolist() == [Reason.NONE]


def test_what_was_written_into_a_folder_of_the_job_is_no_part_of_it(tmp_path: Path) -> None:
    text = f"DEF part()\nLIN {{{P1}}}\nEND\n"
    for name, compensated in (("part.src", None), ("out/part.src", True), ("cam/made.src", False)):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        if compensated is not None:
            identity = ModelIdentity(kind="nominal", robot="an arm", sha256="0" * 64)
            write_identity(
                path, text.encode(), ProgramIdentity(model=identity, compensated=compensated)
            )
    assert {program.name for program in read_job(tmp_path)} == {"part.src", "cam/made.src"}


def test_the_cells_frames_go_before_those_of_a_computed_number(tmp_path: Path) -> None:
    job(tmp_path, f"BAS(#TOOL,N_TOOL)\nLIN {{{P1}}}")
    table = FrameTable(tools={"2": np.diag([1.0, 1.0, 1.0, 1.0])})
    program = read_job(tmp_path / "part.src", table)[0]
    np.testing.assert_allclose(program.T_flange_tool[program.tool[0]], np.eye(4))


def test_a_point_that_is_read_is_written_out_where_it_is_moved_to(tmp_path: Path) -> None:
    """What is computed from XP1 in the loop starts from its old numbers, as before."""
    body = "LIN XP1\nFOR I=1 TO 3\nXT=XP1\nXT.X=XT.X+I*5\nLIN XT\nENDFOR"
    program = job(tmp_path, body)
    assert program.reason.tolist() == [Reason.NONE]
    np.testing.assert_allclose(pose(program, 0), hand(P1), atol=1e-9)
    dat = read_job(tmp_path / "part.src")[1]
    assert not (dat.reason == Reason.NONE).any()
    lines = write(program, replacement(program, by_mm=(1.0, 0.0, 0.0))).splitlines()
    assert lines[1].startswith("LIN {X 101.0000,")
    assert lines[2:] == [*body.split("\n")[1:], "END"]
