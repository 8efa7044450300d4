"""Computed RAPID targets and frames, against poses worked out by hand with scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from rapid_samples import FRAMES, REST, T_FIXTURE, move, replacement
from scipy.spatial.transform import Rotation

from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason

Q10, Q20 = (0.0, 1.0, 0.0, 0.0), (0.1, 0.9, -0.3, 0.3)
Q20 = tuple(np.array(Q20) / np.linalg.norm(Q20))


def literal(x: float, y: float, z: float, q: tuple[float, ...]) -> str:
    return f"[[{x},{y},{z}],[{','.join(repr(float(each)) for each in q)}],[0,0,-1,0],{REST}]"


P10, P20 = literal(100, 20, 300, Q10), literal(-50, 400, 120, Q20)
POINTS = f"CONST robtarget p10:={P10};\nPERS robtarget p20:={P20};\nCONST num lift:=35.5;\n"


def hand(x: float, y: float, z: float, q: tuple[float, ...]) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    T[:3, :3] = Rotation.from_quat([*q[1:], q[0]]).as_matrix()
    return T


T10, T20 = hand(100, 20, 300, Q10), hand(-50, 400, 120, Q20)


def shift(x: float, y: float, z: float) -> np.ndarray:
    return hand(x, y, z, (1, 0, 0, 0))


def read(*modules: str, frames: FrameTable | None = None) -> tuple[Program, ...]:
    files = [(f"m{k}.mod", text.encode()) for k, text in enumerate(modules)]
    return find_language("rapid").read_job(files, frames=frames or FrameTable())


def main(motions: str, data: str = POINTS, more: str = "") -> str:
    return f"{FRAMES}{data}\nPROC main()\n{motions}\nENDPROC\n{more}ENDMODULE\n"


def world(program: Program, row: int) -> np.ndarray:
    """A target in the robot base, mm."""
    T = np.eye(4)
    T[:3, 3], T[:3, :3] = program.position[row], program.rotation[row]
    out = program.T_base_frame[program.frame[row]] @ T
    out[:3, 3] *= 1e3
    return out


FIXTURE = T_FIXTURE.copy()
FIXTURE[:3, 3] *= 1e3
TURN_XZ = hand(0, 0, 0, (1, 0, 0, 0))
TURN_XZ[:3, :3] = Rotation.from_euler("XYZ", [10, 0, 30], degrees=True).as_matrix()

EVALUATED = [
    (move("Offs(p10,0,5,lift)"), shift(0, 5, 35.5) @ T10),
    (move("RelTool(p20,1,2,-40\\Rx:=10\\Rz:=30)"), T20 @ shift(1, 2, -40) @ TURN_XZ),
    (move("RelTool(Offs(p10,0,0,10),0,0,-lift/2)"), shift(0, 0, 10) @ T10 @ shift(0, 0, -17.75)),
    ("t:=p20;\nt.trans.z:=t.trans.z+lift;\n" + move("t"), shift(0, 0, 35.5) @ T20),
    ("t:=p10;\nt.trans:=t.trans+[1,2,3];\n" + move("t"), shift(1, 2, 3) @ T10),
    ("t:=p20;\nIF go THEN\nt:=p10;\n" + move("Offs(t,0,0,1)") + "ENDIF", shift(0, 0, 1) @ T10),
    ("o:=PoseMult(PoseInv(o2),[[1,2,3],[1,0,0,0]]);\nt:=p10;\nt.trans:=o.trans;\n" + move("t"),
     hand(-4, -3, -2, Q10)),
]  # fmt: skip
LOCALS = "VAR robtarget t;\nVAR pose o;\nCONST pose o2:=[[5,5,5],[1,0,0,0]];\n"


@pytest.mark.parametrize(("motions", "expected"), EVALUATED)
def test_a_computed_target_is_written_out(motions: str, expected: np.ndarray) -> None:
    (program,) = read(main(motions, POINTS + LOCALS))
    (row,) = np.flatnonzero(program.reason == Reason.NONE).tolist()
    np.testing.assert_allclose(world(program, row), FIXTURE @ expected, atol=1e-5)
    language = find_language("rapid")
    nothing = replacement(program, changed=np.zeros(len(program), np.bool_))
    assert language.write(program, nothing) == program.data
    text = language.write(program, replacement(program, by_mm=(0.5, -0.25, 1.0))).decode()
    (again,) = read(text)
    (now,) = np.flatnonzero(again.reason == Reason.NONE).tolist()
    moved = FIXTURE @ shift(0.5, -0.25, 1.0) @ expected
    np.testing.assert_allclose(world(again, now), moved, atol=2e-4)


@pytest.mark.parametrize(
    "motions",
    [
        "p20.trans.z:=p20.trans.z+5;\n" + move("p20"),  # persistent data keep their values
        "t:=p10;\nIF go THEN\nt.trans.z:=0;\nENDIF\n" + move("t"),
        "t:=p10;\nFOR i FROM 1 TO 3 DO\nt.trans.z:=t.trans.z+5;\n" + move("t") + "ENDFOR",
        "FOR i FROM 1 TO 3 DO\n" + move("Offs(p10,0,0,10*i)") + "ENDFOR",
        "t:=p10;\nlook t;\n" + move("t"),
        "t:=CRobT();\n" + move("Offs(t,0,0,1)"),
        "n:=ReadNum(io);\n" + move("Offs(p10,0,0,n)"),
        "t:=p10;\nWHILE go DO\n" + move("t") + "t:=p20;\nENDWHILE",
    ],
)
def test_what_has_no_single_value_keeps_its_bytes(motions: str) -> None:
    (program,) = read(main(motions, POINTS + LOCALS + "VAR num n;\n"))
    assert not (program.reason == Reason.NONE).any()
    assert find_language("rapid").write(program, replacement(program, by_mm=(1, 1, 1))) == (
        program.data
    )
    assert any("m0.mod:" in note for note in program.notes)


def test_data_of_other_modules() -> None:
    tool = FRAMES.split("\n")[1]
    data = (
        f"MODULE data\n{tool}\n{POINTS}LOCAL CONST num low:=7;\nCONST num up:=low+1;\nENDMODULE\n"
    )
    text = f"MODULE m\n{FRAMES.splitlines()[2]}\nPROC main()\n{move('Offs(p10,0,0,up)')}{move('p20')}ENDPROC\nENDMODULE\n"  # noqa: E501
    program, points = read(text, data)
    assert program.reason.tolist() == [0, 0]
    np.testing.assert_allclose(world(program, 0), FIXTURE @ shift(0, 0, 8) @ T10, atol=1e-5)
    np.testing.assert_allclose(world(program, 1), FIXTURE @ T20, atol=1e-5)
    assert not len(points)
    setter = "MODULE other\nPROC teach()\np20.trans.x:=0;\nENDPROC\nENDMODULE\n"
    assert read(text, data, setter)[0].reason.tolist() == [0, Reason.EXPRESSION]
    second = f"MODULE twin\nPERS robtarget p20:={P10};\nENDMODULE\n"
    assert read(text, data, second)[0].reason.tolist() == [0, Reason.EXPRESSION]


def test_displacements_of_constants() -> None:
    data = POINTS + "CONST pose d:=[[10,20,30],[0,0,0,1]];\nVAR pose e;\n"
    (program,) = read(main(f"PDispSet d;\n{move('p10')}PDispOff;\n{move('p20')}", data))
    assert program.reason.tolist() == [0, 0]
    turned = hand(10, 20, 30, (0, 0, 0, 1))
    np.testing.assert_allclose(world(program, 0), FIXTURE @ turned @ T10, atol=1e-5)
    np.testing.assert_allclose(world(program, 1), FIXTURE @ T20, atol=1e-5)
    on = f"PDispOn \\ExeP:=p10,p20,spindle\\WObj:=fixture;\n{move(P10)}"
    (between,) = read(main(on))
    moved = FIXTURE @ shift(150, -380, 180) @ T10
    np.testing.assert_allclose(world(between, -1), moved, atol=1e-5)
    for unknown in ("PDispOn p10,spindle;", "PDispSet e;", "IF go PDispSet d;",
                    "PDispOn \\Rot\\ExeP:=p10,p20,spindle;"):  # fmt: skip
        (left,) = read(main(f"{unknown}\n{move(P10)}", data))
        assert left.reason[-1] == Reason.RELATIVE


def test_a_target_computed_from_one_that_is_moved_to_is_not_carried_along() -> None:
    (program,) = read(main(move("p10") + move("Offs(p10,0,0,50)\\ID:=3")))
    assert program.reason.tolist() == [0, Reason.UNUSED, 0]
    only = replacement(program, by_mm=(1, 0, 0), changed=np.array([True, False, False]))
    (again,) = read(find_language("rapid").write(program, only).decode())
    np.testing.assert_allclose(world(again, 2), FIXTURE @ shift(0, 0, 50) @ T10, atol=1e-4)


def test_a_target_that_another_module_moves_to_keeps_its_numbers() -> None:
    data = f"VAR robtarget p30:={P10};\n"
    other = "MODULE other\nPROC go()\n{}ENDPROC\nENDMODULE\n"
    one, two = read(main(move("p30"), data), other.format("MoveL p30,v1,z1,tool0;\n"))
    assert one.reason.tolist() == [Reason.UNUSED, 0]
    assert two.reason.tolist() == [0]
    text = find_language("rapid").write(one, replacement(one, by_mm=(1, 0, 0))).decode()
    assert data in text
    assert "MoveL [[101.0000,20.0000,300.0000]" in text
    one, two = read(main(move("p30"), data), other.format("p30.trans.x:=7;\n"))
    assert one.reason.tolist() == [Reason.EXPRESSION]


def test_what_another_module_sets_before_it_calls_is_not_known() -> None:
    path = f"{FRAMES}PROC path()\n{{}}{move(P10)}ENDPROC\nENDMODULE\n"
    other = (
        "MODULE other\nPROC main()\n{}\npath;\nMoveL " + P10 + ",v1,z1,tool0;\nENDPROC\nENDMODULE\n"
    )
    for setting, reason in (
        ("", Reason.NONE),
        ("PDispSet shift;", Reason.RELATIVE),
        ("fixture.oframe:=[[0,0,20],[1,0,0,0]];", Reason.UNKNOWN_FRAME),
    ):
        assert read(path.format(""), other.format(setting))[0].reason.tolist() == [reason]
    off = path.format("PDispOff;\n")
    assert read(off, other.format("PDispSet shift;"))[0].reason.tolist() == [Reason.NONE]


def test_what_the_end_of_a_run_leaves_holds_for_the_next_one() -> None:
    for last, first, reason in (
        ("PDispSet p;", "PDispOff;", Reason.RELATIVE),
        ("fixture.uframe:=[[1,0,0],[1,0,0,0]];", "fixture.uframe:=[[2,0,0],[1,0,0,0]];", 3),
    ):
        assert read(main(f"{move(P10)}{last}"))[0].reason.tolist()[-1] == reason
        assert read(main(f"{first}\n{move(P10)}{last}"))[0].reason.tolist()[-1] == Reason.NONE


def test_targets_that_one_without_a_single_value_is_computed_from_keep_their_numbers() -> None:
    data = f"{POINTS}VAR robtarget p30:={P10};\n"
    motions = f"{move('p10')}p30.trans:=p10.trans;\n{move('Offs(p10,0,0,5)')}"
    end = "IF x THEN\np30.rot:=p20.rot;\nENDIF\n" + move("p30")
    program = read(main(motions + end, data))[0]
    text = find_language("rapid").write(program, replacement(program, by_mm=(1, 0, 0))).decode()
    assert f"CONST robtarget p10:={P10};" in text


@pytest.mark.parametrize(
    ("statement", "changes"),
    [
        ("Incr lift;", True),
        ("IF x Add lift,3;", True),
        ('ReadCfgData "/MOC","x",lift;', True),
        ("SearchL di1,p30,p10,v1,tool0;", True),
        ("IF lift>1 THEN\nMoveL p30,v1,z1,tool0;\nENDIF", False),
        ("WHILE lift<2 DO\nWaitTime lift;\nENDWHILE", False),
    ],
)
def test_what_other_modules_change(statement: str, changes: bool) -> None:
    data = f"PERS robtarget p30:={P10};\nPERS num lift:=5;\n"
    other = f"MODULE other\nPROC go()\n{statement}\nENDPROC\nENDMODULE\n"
    program, _ = read(main(move("Offs(p30,0,0,lift)"), data), other)
    assert (program.reason[-1] == Reason.RELATIVE) == changes
