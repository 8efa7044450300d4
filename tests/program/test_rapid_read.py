"""Targets, frames and reasons read from RAPID modules."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rapid_samples import FRAMES, REST, T_FIXTURE, module, move, read, replacement, target

from robotrue.core.arm_words import NO_WORD
from robotrue.core.units import DEG
from robotrue.errors import FormatError
from robotrue.program.formats import detect, read_job
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Reason

EXPRESSION = Reason.EXPRESSION
J = f"[[10,-70,100,5,60,-20],{REST}]"


def reasons(text: str, data: str = "", frames: FrameTable | None = None) -> list[int]:
    return [int(each) for each in module(text, data, frames).reason]


def test_detected_by_content() -> None:
    assert detect((FRAMES + "ENDMODULE").encode(), "noname").name == "rapid"
    assert detect(b"%%%\n VERSION:1\n%%%\nMODULE m\n\tMoveL p10,v1,z1,t;", "x").name == "rapid"
    assert detect(b"whatever", "x.MODX").name == "rapid"


def test_every_motion() -> None:
    program = module(
        move(target(1))
        + move(target(2), "movej")
        + move(f"{target(3)},{target(4)}", "MoveC")
        + f"MoveAbsJ {J}\\NoEOffs,v100,fine,spindle;\n"
        + f"MoveLDO {target(5)},v100,z1,spindle\\WObj:=fixture,do1,1;\n"
        + f"TriggL {target(6)},v100,trig1,z1,spindle\\WObj:=fixture;\n"
        + f"TriggC {target(7)},{target(8)},v100,trig1,z1,spindle\\WObj:=fixture;\n"
    )
    np.testing.assert_allclose(program.position[[0, 1, 2, 3, 5, 6, 7, 8], 0] * 1e3, range(1, 9))
    motions = [Motion.LIN, Motion.PTP, Motion.ARC_VIA, Motion.ARC_END, Motion.PTP, Motion.LIN]
    assert program.motion.tolist() == [*motions, Motion.LIN, Motion.ARC_VIA, Motion.ARC_END]
    assert program.reason.tolist() == [0, 0, 0, 0, Reason.JOINT_TARGET, 0, 0, 0, 0]
    np.testing.assert_allclose(program.axes[4] / DEG, [10, -70, 100, 5, 60, -20])
    assert program.words[0].tolist() == [0, 0, -1, 0]
    assert program.words[4].tolist() == [NO_WORD] * 4
    np.testing.assert_allclose(program.T_base_frame[program.frame[0]], T_FIXTURE, atol=1e-8)
    np.testing.assert_allclose(
        program.T_flange_tool[program.tool[0]][:3, 3], [0, 0, 0.2155], atol=1e-12
    )
    np.testing.assert_allclose(program.rotation[0], np.diag([1.0, -1.0, -1.0]))


@pytest.mark.parametrize(
    "tail",
    [
        ",v100,z1,spindle\\WObj:=fixture;",
        "\\ID:=0, v100\\V:=50, z1 \\Inpos:=inpos50, spindle, \\WObj:=fixture;",
        ",v100\\T:=5,z1\\Z:=2,spindle \\WObj := fixture\\TLoad:=load0;",
        ", [200,500,5000,1000], [FALSE,1,2,3,4,5,6] ! , ;\n , SPINDLE\n\\wobj:=Fixture ;",
    ],
)
def test_ways_to_name_tool_and_work_object(tail: str) -> None:
    program = module(f"MoveL\\Conc,{target()}{tail}\nMoveJ {target(2)}{tail}")
    assert program.reason.tolist() == [0, 0]
    np.testing.assert_allclose(program.T_base_frame[program.frame[0]], T_FIXTURE, atol=1e-8)
    assert program.T_flange_tool[program.tool[0], 2, 3] == pytest.approx(0.2155)
    assert (program.frame[0], program.tool[0]) == (program.frame[1], program.tool[1])


def test_statement_over_lines_with_comments_and_strings() -> None:
    text = f'TPWrite "a ""MoveL [[1;";\nMoveL ! {target(9)}\n [ [ 1.0 ,! x\n 2,\n3],[1,0,0,0]\n,[0,0,0,0],{REST}]\n,v1\n,fine,tool0;'  # noqa: E501
    program = module(text)
    assert program.line.tolist() == [8]
    np.testing.assert_allclose(program.position, [[1e-3, 2e-3, 3e-3]])
    np.testing.assert_array_equal(program.T_base_frame[program.frame[0]], np.eye(4))


def test_declared_targets() -> None:
    data = (
        f"CONST robtarget p10:={target(10)};\nLOCAL PERS robtarget P20 :={target(20)};\n"
        f"TASK VAR jointtarget home:={J};\nCONST robtarget p30:={target(30)};\n"
    )
    program = module(move("P10") + move("p20", "MoveJ") + "MoveAbsJ home,v1,fine,spindle;\n", data)
    assert program.reason.tolist() == [0, 0, Reason.JOINT_TARGET, Reason.UNUSED]
    assert program.motion.tolist() == [Motion.LIN, Motion.PTP, Motion.PTP, Motion.UNUSED]
    assert program.line.tolist() == [4, 5, 6, 7]


def test_arrays() -> None:
    row = ",\n".join(target(i) for i in range(1, 4))
    data = f"CONST robtarget p{{3}}:=[{row}];\n"
    data += f"CONST robtarget g{{2,1}}:=[[{target(7)}],[{target(8)}]];"
    program = module(
        f"FOR i FROM 1 TO Dim(p,1) DO\n{move('p{i}')}ENDFOR\n{move('g{ 2 , 1 }')}", data
    )
    assert program.reason.tolist() == [0, 0, 0, Reason.UNUSED, 0]
    assert module(move("p{2}"), data).reason.tolist() == [8, 0, 8, 8, 8]


def test_assigned_targets() -> None:
    data = "VAR robtarget p;\n"
    one = f"p:={target(1)};\n" + move("p")
    assert reasons(one, data) == [0]
    assert reasons(one + f"SetDO do1,1;\np:={target(2)};\n" + move("p"), data) == [0, 0]
    twice = f"p:={target(1)};\nIF x THEN\np:={target(2)};\nENDIF\n" + move("p")
    assert reasons(twice, data) == [Reason.UNUSED, Reason.EXPRESSION]
    for change in ("p.trans.z:=p.trans.z+5;", "p:=q;", "p:=Offs(p,0,0,1);", "Twist p;"):
        program = module(one + change + "\n", data)
        assert program.reason.tolist() == [Reason.UNUSED, 0]  # written out in its motion
        new = replacement(program, by_mm=(1, 0, 0))
        text = find_language("rapid").write(program, new).decode()
        assert f"p:={target(1)};" in text
        assert change in text


def test_offsets() -> None:
    data = f"CONST robtarget p10:={target(1)};\nCONST robtarget p20:={target(2)};\n"
    program = module(
        move("Offs(p10,0,0,50)") + move("p10") + move("RelTool(p20,0,0,5\\Rz:=3)"), data
    )
    assert program.reason.tolist() == [0, Reason.UNUSED, 0, 0]
    unknown = module(move("Offs(p10,0,0,z)") + move("p10") + move("RelTool(p20,0,0,z)"), data)
    assert unknown.reason.tolist() == [0] + [Reason.RELATIVE] * 3
    assert any("start of Offs or RelTool" in note for note in unknown.notes)
    assert any("used only by Offs or RelTool" in note for note in unknown.notes)


def test_offsets_of_computed_size() -> None:
    data = f"CONST robtarget p10:={target(1)};\nCONST robtarget p20:={target(2)};\n"
    size = move("Offs(p10,p20.trans.x,z,5)") + move("p10") + move("p20")
    unused = Reason.UNUSED  # p20 is read: it is written out where it is moved to
    assert reasons(size, data) == [0, unused, Reason.RELATIVE, 0]
    twice = move("Offs(RelTool(p10,0,0,5),0,0,z)") + move("p10") + move("p20")
    assert reasons(twice, data) == [unused, 0, Reason.RELATIVE, 0]


def test_arcs_through_arrays() -> None:
    data = f"CONST robtarget p{{2}}:=[{target(1)},{target(2)}];\nCONST robtarget q:={target(3)};\n"
    text = move("p{i},q", "MoveC")
    assert reasons(text, data) == [0, 0, 0]
    assert reasons(text + move("Calc(q)"), data) == [EXPRESSION] * 4


def test_computed_targets() -> None:
    data = f"CONST robtarget p10:={target(1)};\n"
    program = module(move("Calc(p10)") + move("p10") + move("ghost") + move("*"), data)
    assert program.reason.tolist() == [Reason.EXPRESSION] * 4
    assert any("part.mod:9: the target 'ghost' is in no file" in note for note in program.notes)
    inline = target().replace("1.000", "x+1")
    assert reasons(move(inline)) == [Reason.EXPRESSION]
    text = f"{FRAMES}PROC go(robtarget p, \\num n)\n{move('p')}ENDPROC\nENDMODULE"
    assert read(text).reason.tolist() == [Reason.EXPRESSION]
    searched = module(f"SearchL di1,sp,{target()},v1,spindle\\WObj:=fixture;\n")
    assert searched.reason.tolist() == [Reason.EXPRESSION]
    assert any("searchl is no motion that is followed" in note for note in searched.notes)


def test_displacements() -> None:
    text = "PDispSet d;\n" + move(target(1)) + "PDispOff;\n" + move(target(2))
    assert reasons(text) == [Reason.RELATIVE, 0]
    text = "IF x THEN\nEOffsSet e;\nENDIF\n" + move(target(1)) + "EOffsOff;\n" + move(target(2))
    assert reasons(text) == [Reason.RELATIVE, 0]


def test_frames_in_the_order_of_the_program() -> None:
    set_one = "fixture.uframe:=[[100,0,0],[1,0,0,0]];\n"
    set_two = "fixture.oframe:=[[0,200,0],[1,0,0,0]];\nspindle.tload.mass:=3;\n"
    begin = "fixture.uframe:=[[800,-100,450],[1,0,0,0]];\nfixture.oframe:=[[0,0,10],[1,0,0,0]];\n"
    moves = move(target(1)) + set_one + move(target(2)) + set_two + move(target(3))
    assert reasons(moves) == [Reason.UNKNOWN_FRAME, Reason.UNKNOWN_FRAME, 0]  # the second run
    program = module(begin + moves)
    assert program.reason.tolist() == [0, 0, 0]
    places = program.T_base_frame[program.frame][:, :3, 3]
    np.testing.assert_allclose(places, [[0.8, -0.1, 0.46], [0.1, 0, 0.01], [0.1, 0.2, 0]])
    branch = f"IF x THEN\n{set_one}ENDIF\n"
    assert reasons(branch + move(target(1)) + set_one + move(target(2))) == [
        Reason.UNKNOWN_FRAME,
        0,
    ]
    assert reasons(f"IF x {set_one}" + move(target(1))) == [Reason.UNKNOWN_FRAME]
    assert reasons(f"IF x THEN\n{set_one}ELSE\n{set_one}ENDIF\n" + move(target(1))) == [0]
    assert reasons(f"WHILE x DO\n{move(target(1))}{set_one}ENDWHILE\n") == [Reason.UNKNOWN_FRAME]
    set_three = set_one.replace(":=", " ! to\n := ! [\n").replace(".", " . ! a\n")
    assert reasons(set_three + move(target(1))) == [0]
    assert reasons(f"IF x {set_three}" + move(target(1))) == [Reason.UNKNOWN_FRAME]
    assert reasons("IF x Twist fixture;\n" + move(target(1))) == [Reason.UNKNOWN_FRAME]
    assert reasons("fixture.uframe.trans.x:=5;\n" + move(target(1))) == [Reason.UNKNOWN_FRAME]
    assert reasons("MToolTCPCalib spindle;\n" + move(target(1))) == [Reason.UNKNOWN_FRAME]
    assert reasons("ToLower(fixture);\n" + move(target(1))) == [Reason.UNKNOWN_FRAME]


def test_frames_set_in_a_routine_that_is_called() -> None:
    path = f"PROC path()\n{move(target(1))}ENDPROC\n"
    main = "PROC main()\nfixture.uframe:=[[100,0,0],[1,0,0,0]];\npath;\nENDPROC\n"
    for text in (path + main, main + path):
        program = read(f"{FRAMES}{text}ENDMODULE")
        assert program.reason.tolist() == [0]
        assert program.T_base_frame[program.frame[0], 0, 3] == pytest.approx(0.1)
    error = "ERROR\n" + move(target(2)) + "RETRY;\n"
    text = f"{FRAMES}PROC main()\nfixture.uframe:=[[100,0,0],[1,0,0,0]];\n{error}ENDPROC\nENDMODULE"
    assert read(text).reason.tolist() == [Reason.UNKNOWN_FRAME]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ("PERS tooldata t:=[FALSE,[[0,0,1],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];", 7),
        ("PERS tooldata t:=[TRUE,[[0,0,z],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];", 3),
        ("PERS tooldata t;", 3),
        ("", 3),
    ],
)
def test_tools_that_are_refused(data: str, reason: int) -> None:
    program = module(f"MoveL {target()},v1,z1,t\\WObj:=fixture;", data)
    assert program.reason.tolist() == [reason]
    assert program.notes
    known = FrameTable(tools={"T": np.eye(4)})
    assert reasons(f"MoveL {target()},v1,z1,t;", "", known) == [0]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ('PERS wobjdata w:=[TRUE,TRUE,"",[[0,0,1],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];', 7),
        ('PERS wobjdata w:=[FALSE,FALSE,"STN1",[[0,0,1],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];', 3),
        ("", 3),
    ],
)
def test_work_objects_that_are_refused(data: str, reason: int) -> None:
    program = module(f"MoveL {target()},v1,z1,spindle\\WObj:=w;", data)
    assert program.reason.tolist() == [reason]
    assert "'w'" in program.notes[0] or "workpiece" in program.notes[0]


def test_world_in_the_base() -> None:
    T = np.eye(4)
    T[2, 3] = 1.5
    program = module(move(target()), frames=FrameTable(bases={"wobj0": T}))
    np.testing.assert_allclose(program.T_base_frame[program.frame[0]], T @ T_FIXTURE, atol=1e-8)


def test_used_with_two_work_objects() -> None:
    data = f"CONST robtarget p10:={target(1)};\nCONST jointtarget h:={J};\n"
    text = move("p10") + "MoveL p10,v1,z1,spindle;\n"
    program = module(text, data)
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME, Reason.UNUSED]
    assert any("more than one tool or work object" in note for note in program.notes)
    text = "MoveAbsJ h,v1,z1,spindle;\nMoveAbsJ h,v1,z1,spindle\\WObj:=fixture;\n"
    assert reasons(text, data)[1] == Reason.JOINT_TARGET


def test_external_axes() -> None:
    rail = "[850.5,9E+09,9E+9,9E9,1E+10,9E9]"
    text = move(target(1, external=rail)) + move(target(2, external=rail))
    assert reasons(text) == [Reason.EXTERNAL_AXIS] * 2
    still = FrameTable(external_axes_at_rest=True)
    assert reasons(text, frames=still) == [0, 0]
    moving = text + move(target(3, external=rail.replace("850.5", "851")))
    assert reasons(moving, frames=still) == [Reason.EXTERNAL_AXIS] * 3
    assert reasons(move(target(1, external="[0,9E9,9E9,9E9,9E9,9E9]"))) == [0]


def test_arcs_share_their_fate() -> None:
    data = f"CONST robtarget p10:={target(1)};\n"
    text = move(f"p10,{target(2)}", "MoveC") + move("Calc(p10)")
    assert reasons(text, data) == [Reason.EXPRESSION] * 3


def test_quaternions_that_are_none() -> None:
    bad = target().replace("1.00000000", "0.10000000")
    program = module(move(bad))
    assert program.reason.tolist() == [Reason.INCOMPLETE]
    huge = target().replace("[1.000", "[1E999")
    assert reasons(move(huge)) == [Reason.INCOMPLETE]


def test_notes_name_foreign_routines_and_unchecked_configuration() -> None:
    program = module("ConfL \\Off;\nGripper 5;\n" + move(target()))
    assert any(n.startswith("part.mod:6: ConfL \\Off: the controller") for n in program.notes)
    assert any(n.startswith("part.mod:7: gripper is in no file given") for n in program.notes)
    assert not module("WaitTime 1;\nSetDO a,1;\n" + move(target())).notes


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Gripper 5;\n", Reason.UNKNOWN_FRAME),
        ("IF done Gripper 5;\n", Reason.UNKNOWN_FRAME),
        ("IF done THEN\nGripper 5;\nENDIF\n", Reason.UNKNOWN_FRAME),
        ("Gripper 5;\nPDispOff;\n", Reason.UNKNOWN_FRAME),
        ('IF NOT done AND a=5 SetDO do1,1;\nTPWrite "Gripper 5";\n', Reason.NONE),
        (
            "Gripper 5;\nPDispOff;\n"
            "spindle:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
            'fixture:=[FALSE,TRUE,"",[[800,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n',
            Reason.NONE,
        ),
    ],
)
def test_a_routine_in_no_file_may_move_frames(text: str, expected: Reason) -> None:
    assert reasons(text + move(target())) == [expected]


def test_a_stored_target_before_and_behind_a_routine_in_no_file_is_left_alone() -> None:
    data = f"CONST robtarget p10:={target(1)};\n"
    assert reasons(move("p10") + move("p10"), data) == [Reason.NONE]
    program = module(f"{move('p10')}Gripper 5;\n{move('p10')}", data)
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert any("gripper is in no file given" in note for note in program.notes)


def test_harmless_routines_and_data_no_other_module_can_change() -> None:
    known = FrameTable(harmless_routines=("gripper",))
    text = f"{FRAMES}PROC main()\nGripper 5;\n{move(target())}ENDPROC\nENDMODULE"
    assert read(text).reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert read(text, known).reason.tolist() == [Reason.NONE]
    shut = (
        text.replace("TASK PERS", "PERS")
        .replace("PERS", "LOCAL PERS")
        .replace("Gripper 5;", "Gripper 5;\nPDispOff;")
    )
    assert read(shut).reason.tolist() == [Reason.NONE]


def test_frames_of_the_module_beside() -> None:
    language = find_language("rapid")
    assert language.name_companions("x/Part.mod") == ("CalibData.mod", "CalibData.modx")
    assert language.name_companions("CalibData.mod") == ()
    text = f"MODULE part\nPROC main()\n{move(target())}ENDPROC\nENDMODULE"
    files = [("part.mod", text.encode()), ("CalibData.mod", (FRAMES + "ENDMODULE").encode())]
    main, beside = language.read_job(files, frames=FrameTable())
    assert main.reason.tolist() == [0]
    assert len(beside) == 0


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("", 1, "no MODULE and no motion"),
        ("MODULE m\nPROC main()\n", 3, "no ENDMODULE"),
        ("MODULE m\nVAR num x:=1\nENDMODULE\n", 2, "has no ';'"),
        (f"MODULE m\nPROC p()\nMoveL {target()},v1,z1,t\nENDPROC\nx:=1;\nENDMODULE", 3, "brackets"),
        (f"MODULE m\nPROC p()\nMoveL [{target()},v1,z1,t;\nENDPROC\nENDMODULE", 3, "brackets"),
        ('MODULE m\nTPWrite "abc;\nENDMODULE', 2, "a string in it is not closed"),
        ("MODULE m\n]x;\nENDMODULE", 2, "cannot begin a statement"),
        ("MODULE m\n\0ENDMODULE", 2, "NUL"),
    ],
)
def test_refused_by_line(text: str, line: int, what: str) -> None:
    with pytest.raises(FormatError, match=what) as caught:
        read(text)
    assert caught.value.line == line
    assert caught.value.source == "part.mod"


def test_settings_a_caller_passes_on() -> None:
    options = "PERS tooldata spindle \\ PERS wobjdata fixture"
    text = f"{FRAMES}PROC go({options})\n{move(target())}ENDPROC\nENDMODULE"
    assert read(text).reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert reasons(f"MoveL {target()},v1,z1,spindle\\WObj?fixture;") == [Reason.UNKNOWN_FRAME]


def test_calls_by_name_and_traps_are_told() -> None:
    program = module('%"proc"+x%;\n' + move(target()))
    assert any("a call by name is in no file" in note for note in program.notes)
    trap = "TRAP stop\nfixture.uframe:=[[1,0,0],[1,0,0,0]];\nENDTRAP\n"
    program = read(f"{FRAMES}PROC main()\n{move(target())}ENDPROC\n{trap}ENDMODULE")
    assert program.reason.tolist() == [0]
    assert any(": stop, which an interrupt or an error starts" in n for n in program.notes)


def test_modules_with_motions_are_each_read_with_the_frames_of_all(tmp_path: Path) -> None:
    ends = "ENDPROC\nENDMODULE\n"
    (tmp_path / "main.mod").write_text(f"{FRAMES}PROC main()\n{move(target(1))}{ends}")
    (tmp_path / "sub.mod").write_text(f"MODULE sub\nPROC s()\n{move(target(2))}{ends}")
    job = read_job([tmp_path / "main.mod", tmp_path / "sub.mod"])
    assert [program.reason.tolist() for program in job] == [[0], [0]]
    for program in job:
        np.testing.assert_allclose(program.T_base_frame[program.frame[0]], T_FIXTURE, atol=1e-8)


NAMES = (
    "MODULE M\nPERS tooldata tÖl:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
    "CONST robtarget pSensör:=[[10,20,30],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
    "CONST robtarget Öse{1}:=[[[11,20,30],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];\n"
    "VAR num nÖ:=1;\nPROC Prüfen()\n  ! 中 ü\n  nÖ:=2;\n"
    "  MoveL pSensör,v100,fine,tÖl\\WObj:=wTürÄ;\n"
    "  IF nÖ=2 MoveL Öse{1},v100,fine,tÖl;\n  Öffnen;\nENDPROC\nENDMODULE\n"
)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_names_with_letters_beyond_ascii(encoding: str) -> None:
    data = NAMES.replace("中", "").encode(encoding)
    door = np.eye(4)
    door[2, 3] = 0.75
    frames = FrameTable(bases={"wTürÄ": door})
    program = find_language("rapid").read(data, name="part.mod", frames=frames)
    assert program.reason.tolist() == [Reason.NONE] * 2
    assert program.T_base_frame[program.frame[0]][2, 3] == 0.75
    assert program.T_flange_tool[program.tool[0]][2, 3] == 0.1
    assert find_language("rapid").write(program, replacement(program)) == data


def test_names_are_told_as_they_are_written() -> None:
    program = find_language("rapid").read(NAMES.encode(), name="part.mod", frames=FrameTable())
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME, Reason.NONE]
    assert any("wtürä" in note.lower() for note in program.notes)


def test_arc_welding_moves() -> None:
    target = "[[{},20,30],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    a, b, c = (target.format(k) for k in (1, 2, 3))
    text = (
        "MODULE M\nPERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        f"PROC main()\nArcLStart {a},v30,seam,weld\\Weave:=w,fine,t\\WObj:=wobj0;\n"
        f"ArcC {b},{c},v30,seam,weld,z1,t\\WObj:=wobj0\\Track:=tr;\n"
        f"ArcLEnd {a},v30,seam,weld,fine,t\\WObj:=wobj0;\nSpotL {a},v30,gun,spot,t;\n"
        "ENDPROC\nENDMODULE\n"
    )
    program = find_language("rapid").read(text.encode(), name="part.mod", frames=FrameTable())
    assert program.motion.tolist() == [
        *(Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.LIN, Motion.UNUSED),
    ]
    assert program.reason.tolist() == [Reason.NONE] * 4 + [Reason.EXPRESSION]
    assert set(program.T_flange_tool[program.tool[:4]][:, 2, 3]) == {0.1}


def test_a_target_of_another_module_is_told() -> None:
    data = f"MODULE points\nCONST robtarget p10:={target()};\nENDMODULE\n"
    text = f"{FRAMES}PROC main()\n{move('p10')}{move('p20')}ENDPROC\nENDMODULE\n"
    files = [("part.mod", text.encode()), ("points.mod", data.encode())]
    first, second = find_language("rapid").read_job(files, frames=FrameTable())
    assert first.reason.tolist() == [0, EXPRESSION]  # p10 is written out in its motion
    assert any("'p20' is in no file of this program" in note for note in first.notes)
    assert find_language("rapid").write(second, replacement(second)) == data.encode()


def test_a_loop_without_a_counter_and_a_point_hidden_by_one_without_value() -> None:
    point = "[[5,9,0],[0,7,0,5],[0,1,1,1],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    lines = (f"CONST robtarget p2:={point};", "PROC n()", "FOR;", "ENDFOR", "MoveL p2,v1,z1,tool0;",
             "CONST robtarget p2;", "ENDPROC")  # fmt: skip
    data = "\n".join(["MODULE m", *lines, "ENDMODULE", ""]).encode()
    program = find_language("rapid").read(data, name="m.mod", frames=FrameTable())
    assert Reason.NONE not in program.reason.tolist()
