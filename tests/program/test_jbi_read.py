"""What is read from Yaskawa jobs, what is refused, and what is said of it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from jbi_samples import HEAD, TABLE, P, body, read, text

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, ShapeError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Reason

PULSES = "///TOOL 1\n///POSTYPE PULSE\n///PULSE\nC00000=1000,-2000,3000,0,500,-7\n"


def test_a_pose() -> None:
    program = body(HEAD + "C00000=800.5,-100,448.750,180.0,10.5,-15.25", "MOVL C00000 V=20.0")
    np.testing.assert_allclose(program.position, np.array([[800.5, -100, 448.75]]) * MM)
    # Rz(Rz) Ry(Ry) Rx(Rx): KUKA's A, B, C in the other order.
    expected = matrix_from_abc(np.array([-15.25, 10.5, 180.0]) * DEG)
    np.testing.assert_allclose(program.rotation[0], expected, atol=1e-15)
    assert program.words.tolist() == [[1, 0, 0, 0, 0, 0]]
    assert program.words_of == "yaskawa"
    assert program.reason.tolist() == [Reason.NONE]
    assert program.motion.tolist() == [Motion.LIN]
    assert program.line.tolist() == [9]
    assert not program.notes


def test_blanks_around_names_and_numbers() -> None:
    plain = body(f"{HEAD}C00000={P}", "MOVL C00000")
    found = body(f"{HEAD} \tC00000 =  {P.replace(',', ' , ')} ", "  MOVL  C00000")
    np.testing.assert_array_equal(found.position, plain.position)
    np.testing.assert_array_equal(found.rotation, plain.rotation)
    assert found.reason.tolist() == [Reason.NONE]


def test_headers_hold_until_they_are_said_again() -> None:
    points = (
        f"///USER 2\n///TOOL 1\n///POSTYPE USER\n///RECTAN \n///RCONF 0,1,0,0,0,0\nC00000={P}\n"
        f"C00001={P}\n///RCONF 0,0,1,0,1,0,0,0\nC00002={P}\n///POSTYPE PULSE\n///PULSE\n"
        f"C00003=1,2,3,4,5,6\n///POSTYPE BASE\n///RECTAN\nC00004={P}\n"
    )
    moves = "".join(f"MOVL C{i:05d} V=1.0\n" for i in range(5))
    base = np.eye(4)
    base[:3, 3] = 0.5, 0.25, 1.0
    table = FrameTable(tools=TABLE.tools, bases={"02": base}, pulses_per_degree=np.full(6, -100.0))
    program = body(points, moves, table)
    assert program.words[:, :3].tolist() == [
        [0, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
        [NO_WORD] * 3,
        [0, 0, 1],
    ]
    assert program.reason.tolist() == [0, 0, 0, Reason.JOINT_TARGET, 0]
    frames = program.T_base_frame[program.frame]
    np.testing.assert_array_equal(frames[:3], np.broadcast_to(base, (3, 4, 4)))
    np.testing.assert_array_equal(frames[4], np.eye(4))
    np.testing.assert_allclose(program.axes[3] / DEG, -np.arange(1, 7) / 100.0)
    assert np.isnan(program.position[3]).all()


def test_pulses_without_their_ratio_are_left_alone_and_the_cure_is_named() -> None:
    program = body(PULSES, "MOVJ C00000 VJ=1.0")
    assert program.reason.tolist() == [Reason.INCOMPLETE]
    assert "test.jbi:8: 1 points in pulses" in program.notes[0]
    assert "pulses_per_degree" in program.notes[0]
    untyped = "///TOOL 1\nC00000=1,2,3,4,5,6\n"  # without a type the numbers are pulses
    assert body(untyped, "MOVJ C00000 VJ=1.0").reason.tolist() == [Reason.INCOMPLETE]
    with pytest.raises(ShapeError, match=r"pulses_per_degree is \[1.0, 0.0\], expected six"):
        body(PULSES, "MOVJ C00000", FrameTable(pulses_per_degree=np.array([1.0, 0.0])))


def test_axes_in_degrees() -> None:
    points = PULSES.replace("PULSE", "ANGLE").replace("1000", "10.5")
    program = body(points, "MOVJ C00000 VJ=1.0")
    np.testing.assert_allclose(program.axes[0] / DEG, [10.5, -2000, 3000, 0, 500, -7])
    assert program.reason.tolist() == [Reason.JOINT_TARGET]


def test_frames_that_are_not_known() -> None:
    points = (
        f"///USER 7\n///TOOL 1\n///POSTYPE USER\n///RECTAN\nC00000={P}\n///TOOL 0\n"
        f"///POSTYPE BASE\nC00001={P}\n///TOOL 1\n///POSTYPE TOOL\nC00002={P}\n"
        f"///POSTYPE MTOOL\nC00003={P}\n///POSTYPE ROBOT\nC00004={P}\n"
    )
    program = body(points, "".join(f"MOVL C{i:05d}\n" for i in range(5)))
    unknown = int(Reason.UNKNOWN_FRAME)
    assert program.reason.tolist() == [unknown, unknown, Reason.RELATIVE, unknown, Reason.NONE]
    said = "\n".join(program.notes)
    assert "test.jbi:9: work frame 7 is in the controller (UFRAME.CND)" in said
    assert "add base 7 to the cell" in said
    assert "test.jbi:12: tool 0 is in the controller (TOOL.CND)" in said
    assert "test.jbi:15: 1 points in tool coordinates" in said
    assert "MTOOL is not supported by robotrue" in said


def test_a_relative_job_takes_the_user_frame_of_its_attributes() -> None:
    points = f"///TOOL 1\n///POSTYPE USER\n///RECTAN\nC00000={P}\n"
    program = body(points, "MOVL C00000", attributes="////FRAME USER 2\n")
    assert program.reason.tolist() == [Reason.NONE]
    assert "a relative job; its 1 points count from user frame 2" in program.notes[0]
    assert body(points, "MOVL C00000").reason.tolist() == [Reason.UNKNOWN_FRAME]


def test_frames_and_tools_that_the_job_makes_itself() -> None:
    points = f"///USER 2\n///TOOL 1\n///POSTYPE USER\n///RECTAN\nC00000={P}\n"
    program = body(points, "MFRAME UF#(2) P001 P002 P003\nMOVL C00000 V=1.0")
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert "work frame 2 is changed by the job in line 15" in program.notes[0]
    program = body(points, "SETTOOL TL#(1) P010\nMOVL C00000 V=1.0")
    assert "tool 1 is changed by the job in line 15" in program.notes[0]


@pytest.mark.parametrize(
    ("instruction", "left"),
    [
        ("MFRAME UF#(2) P001 P002 P003", True),
        ("SETTOOL TL#(1) P010", True),
        ("MFRAME UF#(B000) P001 P002 P003", True),
        ("MFRAME UF#(3) P001 P002 P003", False),
        ("' MFRAME UF#(2) P001 P002 P003", False),
    ],
)
def test_frames_and_tools_that_another_job_makes(instruction: str, left: bool) -> None:
    points = f"///USER 2\n///TOOL 1\n///POSTYPE USER\n///RECTAN\nC00000={P}\n"
    files = (
        ("move.jbi", text(points, "MOVL C00000 V=1.0").encode()),
        ("frames.jbi", text(points, f"{instruction}\nMOVL C00000 V=1.0").encode()),
    )
    moving = find_language("jbi").read_job(files, frames=TABLE)[0]
    assert moving.reason.tolist() == [Reason.UNKNOWN_FRAME if left else Reason.NONE]
    assert ("is changed by frames.jbi in line 15" in "\n".join(moving.notes)) == left


def test_moves_and_arcs() -> None:
    points = HEAD + "".join(f"C{i:05d}={P}\n" for i in range(10))
    moves = (
        "MOVJ C00000 VJ=5.0\nMOVL C00001 V=20.0 'to C00009\nMOVC C00002 V=20.0\n"
        "'MOVL C00009\nMOVC C00003 V=20.0\nDOUT OT#(5) ON\nMOVC C00004 V=20.0\n"
        "MOVS C00005 V=1.0\nMOVL C00006 V=1.0\nMOVJ C00006 VJ=1.0\nMOVL C00006\n"
        "REFP 1 C00007\nMOVC C00008 V=1.0"
    )
    program = body(points, moves)
    expected = [
        *(Motion.PTP, Motion.LIN, Motion.LIN, Motion.ARC_VIA, Motion.ARC_END),
        *(Motion.SPLINE, Motion.PTP, Motion.UNUSED, Motion.LIN, Motion.UNUSED),
    ]
    assert program.motion.tolist() == expected
    assert np.flatnonzero(program.reason == Reason.UNUSED).tolist() == [7, 9]


def test_an_arc_that_begins_where_another_ends() -> None:
    points = HEAD + "".join(f"C{i:05d}={P}\n" for i in range(5))
    moves = "MOVC C00000\nMOVC C00001\nMOVC C00002 FPT\nMOVC C00003\nMOVC C00004"
    via, end = Motion.ARC_VIA, Motion.ARC_END
    assert body(points, moves).motion.tolist() == [Motion.LIN, via, end, via, end]


def test_points_of_an_arc_share_their_fate() -> None:
    points = HEAD + f"C00000={P}\nC00001={P}\n///TOOL 5\nC00002={P}\nC00003={P}\n"
    moves = "MOVC C00000\nMOVC C00001\nMOVC C00002\nMOVL C00003"
    assert body(points, moves).reason.tolist() == [Reason.UNKNOWN_FRAME] * 4
    chained = "MOVC C00000\nMOVC C00001\nMOVC C00003 FPT\nMOVC C00004\nMOVC C00002"
    more = points.replace("///TOOL 5", f"C00004={P}\n///TOOL 5")
    more = more.replace("C00003", "///TOOL 1\nC00003")
    assert body(more, chained).reason.tolist() == [Reason.UNKNOWN_FRAME] * 5
    moves = "MOVC C00000\nMOVC C00001\nMOVL C00002\nMOVL C00003"
    assert body(points, moves).reason.tolist()[:2] == [Reason.NONE] * 2


def test_an_arc_of_poses_and_axis_values_is_left_alone() -> None:
    points = f"{HEAD}C00000={P}\nC00001={P}\n///POSTYPE ANGLE\n///ANGLE\nC00002=1,2,3,4,5,6\n"
    points += "C00003=1,2,3,4,5,6\nC00004=1,2,3,4,5,6\n"
    moves = "MOVC C00000\nMOVC C00001\nMOVC C00002\nMOVL C00003"
    reasons = [Reason.INCOMPLETE] * 3 + [Reason.JOINT_TARGET, Reason.UNUSED]
    assert body(points, moves).reason.tolist() == reasons
    moves = "MOVC C00002\nMOVC C00003\nMOVC C00004"
    assert body(points, moves).reason.tolist()[2:] == [Reason.JOINT_TARGET] * 3


@pytest.mark.parametrize(
    ("moves", "reason"),
    [
        ("IMOV P001 V=1.0 BF", Reason.RELATIVE),
        ("SFTON P009 UF#(1)\nMOVL P001 V=1.0", Reason.RELATIVE),
        ("SFTON P009\nMOVL P001\nSFTOF\nJUMP *A", Reason.RELATIVE),
        ("SFTON P009\nSFTOF\nMOVL P001", Reason.NONE),
        ("SFTON P009\nSFTOF\nMOVL P001\nJUMP *A", Reason.NONE),
        ("*A\nMOVL P001\nSFTON P009\nJUMP *A IF B000=1\nSFTOF", Reason.RELATIVE),
        ("MOVL P001\nSFTON P009", Reason.RELATIVE),
        ("MOVL P001\nSFTON P009\nMOVL P002 V=1.0 TRAP *A\nSFTOF\n*A", Reason.RELATIVE),
        ("MOVL P001\nSFTON P009\nCALL JOB:PART\nSFTOF", Reason.EXPRESSION),
        ("MOVL P001 V=1.0 +SFTON3D P009", Reason.RELATIVE),
        ("MOVL P001 V=1.0\n+SFTON3D P009", Reason.RELATIVE),
        ("MOVL P001 V=1.0 TL#(2)", Reason.UNKNOWN_FRAME),
        ("MOVL P001 V=1.0 +MOVJ BC00000", Reason.NONE),
        ("REFP 1 P001\nMOVL P001", Reason.NONE),
        ("MOVL P001\nGETPOS PX002 STEP#(1)", Reason.EXPRESSION),
        ("MACRO1 MJ#(1) ARGF10\nMOVL P001", Reason.EXPRESSION),
        ("MOVL P001\nJUMP JOB:PART IF B000=1", Reason.EXPRESSION),
        ("MOVL P001\nCALL B000", Reason.EXPRESSION),
        ("SFTON P009\nIFTHENEXP B000=1\nSFTOF\nENDIF\nMOVL P001", Reason.RELATIVE),
        ("FOR I000=0 TO 3\nMOVL P001\nSFTON P009\nNEXT I000", Reason.RELATIVE),
        ("ADD P001 P002\nMOVL P001", Reason.EXPRESSION),
        ("SETE P001 (3) 100\nMOVL P001", Reason.EXPRESSION),
        ("GETS PX001 $PX000\nMOVL P001", Reason.EXPRESSION),
        ("MOVL P[I000]\nMOVL P001", Reason.EXPRESSION),
        ("MOVL C00001 V=1.0 +MOVL P001 V=1.0", Reason.EXTERNAL_AXIS),
        ("SMOVL P001 V=1.0", Reason.EXTERNAL_AXIS),
        ("CVMOVL P001 V=1.0\nMOVL P001", Reason.EXPRESSION),
        ("MOVL P001 EC00000 V=1.0", Reason.EXTERNAL_AXIS),
        ("MOVL P001 BC00000 V=1.0", Reason.NONE),
        ("MOVL P001 V=1.0\n+MOVJ EC00000", Reason.EXTERNAL_AXIS),
        ("MOVL P002 V=1.0\nMOVL P001", Reason.NONE),
    ],
)
def test_targets_that_are_not_where_they_stand(moves: str, reason: Reason) -> None:
    points = f"{HEAD}C00001={P}\nP00001={P}\n///POSTYPE PULSE\n///PULSE\nBC00000=0\nEC00000=0,77"
    program = body(points, moves, groups="RB1,ST1")
    assert program.reason[1] == reason
    assert program.notes or reason == Reason.NONE


def test_an_external_axis_at_rest() -> None:
    points = f"{HEAD}C00001={P}\nC00002={P}\n///POSTYPE PULSE\n///PULSE\nEC00001=5\nEC00002=5.0\n"
    moves = "MOVL C00001 EC00001\nMOVL C00002 EC00002"
    rest = FrameTable(tools=TABLE.tools, external_axes_at_rest=True)
    assert body(points, moves).reason.tolist() == [Reason.EXTERNAL_AXIS] * 2
    assert body(points, moves, rest).reason.tolist() == [Reason.NONE] * 2
    moving = points.replace("=5.0", "=6")
    assert body(moving, moves, rest).reason.tolist() == [Reason.EXTERNAL_AXIS] * 2


def test_base_coordinates_on_a_rail() -> None:
    program = body(f"{HEAD}C00001={P}\n", "MOVL C00001", groups="RB1,BS1")
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME]
    table = FrameTable(tools=TABLE.tools, bases={"BASE": np.eye(4)})
    assert body(f"{HEAD}C00001={P}\n", "MOVL C00001", table, groups="RB1,BS1").reason[0] == 0


def test_seven_values_are_not_those_of_a_six_axis_arm() -> None:
    program = body(f"{HEAD}C00000={P},0.0000", "MOVL C00000")
    assert program.reason.tolist() == [Reason.INCOMPLETE]
    assert "1 points that have not six values" in program.notes[0]


def test_counts_that_do_not_fit_are_named() -> None:
    job = text(f"{HEAD}C00000={P}", "MOVL C00000").replace("NPOS 1,", "NPOS 2,")
    assert "NPOS states 2,0,0,0,0,0, but 1,0,0,0,0,0 points" in read(job).notes[0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("/JOB\n", "", "-0.0000,15.0000' is in place of /JOB"),
        ("//INST\n", "", "'NOP' is no point and no header"),
        ("\nEND\n", "\n", "test.jbi:15: the job has no END"),
        ("C00000=800.000", "C00000=8oo.000", "test.jbi:9: '8oo.000,-100.000"),
        ("C00000=800.000", "C00000=800.0.0", "test.jbi:9: '800.0.0"),
        ("C00000=800.000", "C00000=" + "9" * 400, "has a number that cannot be read"),
        ("C00000=800.000", "C00000 800.000", "is no point and no header"),
        ("///RCONF 1,0,0,0,0,0,0,0", "///RCONF 1,0", "test.jbi:8: ///RCONF has 2 fields"),
        ("///TOOL 1", "///TOOL one", "test.jbi:5: ///TOOL 'one' is no list of whole numbers"),
        ("MOVL C00000", "MOVL C00009", "test.jbi:15: a move to C00009, which //POS does not hold"),
        ("MOVL C00000", "MOVL C00009 +MOVL C00000", "a move to C00009"),
        ("//INST", f"C00000={P}\n//INST", "test.jbi:10: this point is in line 9, too"),
        ("//NAME", "//\0NAME", "test.jbi:2: NUL byte at offset 7"),
    ],
)
def test_refusals(old: str, new: str, message: str) -> None:
    job = text(f"{HEAD}C00000={P}", "MOVL C00000")
    assert old in job
    with pytest.raises(FormatError) as caught:
        read(job.replace(old, new, 1))
    assert message in str(caught.value)
    assert caught.value.hint
    assert caught.value.line
    assert caught.value.line >= 1


@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
def test_every_line_end(end: str) -> None:
    job = text(f"{HEAD}C00000={P}", "MOVL C00000").replace("\n", end)
    assert read("\xef\xbb\xbf" + job).line.tolist() == [9]


@pytest.mark.parametrize("target", ["LP000", "LP[LI001]"])
def test_moves_to_local_variables_are_told(target: str) -> None:
    program = body(f"{HEAD}C00000={P}", f"MOVL C00000\nMOVL {target} V=9.0")
    assert program.reason.tolist() == [Reason.NONE]
    assert any(f"{target[:3]}" in note and "not compensated" in note for note in program.notes)


def test_a_job_called_while_the_moves_are_shifted_is_told() -> None:
    points = f"{HEAD}C00000={P}\nP00009={P}"
    program = body(points, "MOVL C00000\nSFTON P009\nCALL JOB:PART\nSFTOF\nCALL JOB:NEXT")
    assert program.reason.tolist() == [Reason.NONE, Reason.EXPRESSION]
    assert sum("called while SFTON shifts" in note for note in program.notes) == 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("CVMOVL C00000 V=9.0", Reason.EXPRESSION),
        ("MFRAME UF#(7) C00000 C00001 C00001", Reason.EXPRESSION),
        ("REFP 1 C00000", Reason.NONE),
        ("JUMP *C00000 IF IN#(1)=ON", Reason.NONE),
        ("CALL JOB:C00000", Reason.NONE),
    ],
)
def test_points_of_other_instructions(text: str, reason: Reason) -> None:
    program = body(f"{HEAD}C00000={P}\nC00001={P}", f"MOVL C00000\n{text}\nMOVL C00001")
    assert program.reason[0] == reason
    assert any("C00000 is used" in note for note in program.notes) == bool(reason)


@pytest.mark.parametrize(
    ("moves", "left"),
    [
        ("MOVL C00000\nCALL JOB:PROBE\nMOVL P001", True),
        ("MOVL P001\nCALL JOB:PROBE", True),
        ("MOVL P001\nCALL JOB:PROBE\nMOVL P001", True),
        ("*A\nMOVL P001\nCALL JOB:PROBE IF B000=1\nJUMP *A", True),
        ("CALL JOB:GRIP\nMOVL P001", False),
    ],
)
def test_a_job_that_is_called_may_change_p_points(moves: str, left: bool) -> None:
    table = replace(TABLE, harmless_routines=("grip",))
    program = body(f"{HEAD}C00000={P}\nP00001={P}", moves, table)
    assert (program.reason[1] == Reason.EXPRESSION) == left
    assert any(note.count('harmless_routines = ["PROBE"]') for note in program.notes) == left
    assert program.reason[0] in (Reason.NONE, Reason.UNUSED)


def test_a_called_job_that_is_given_and_sets_no_point_is_no_matter() -> None:
    main = text(f"{HEAD}P00001={P}", "CALL JOB:SUB\nMOVL P001")
    for inside, why in (("DOUT OT#(1) ON", Reason.NONE), ("SET P001 P002", Reason.EXPRESSION)):
        sub = text(f"{HEAD}C00000={P}", f"{inside}\nMOVL C00000").replace("//NAME ", "//NAME SUB#")
        sub = re.sub(r"//NAME .*", "//NAME SUB", sub)
        job = [("main.jbi", main.encode()), ("sub.jbi", sub.encode())]
        assert find_language("jbi").read_job(job, frames=TABLE)[0].reason.tolist() == [why]


def test_points_in_pulses_on_a_path_hint_at_axis_targets() -> None:
    table = replace(TABLE, pulses_per_degree=np.full(6, 1000.0))
    said = "are compensated with --axis-targets"
    assert said in "".join(body(PULSES, "MOVL C00000 V=9.0", table).notes)
    assert said not in "".join(body(PULSES, "MOVJ C00000 VJ=9.0", table).notes)


@pytest.mark.parametrize("rows", [120, 230])
def test_gear_ratios_of_the_parameters_are_proposed_and_not_used(rows: int) -> None:
    lines = [["7"] * 10 for _ in range(rows)]
    first, late = (97, 2) if rows < 200 else (109, 0)
    lines[first][late : late + 6] = ["1", "2", "3", "4", "5", "-6"]
    lines[first + 1][:6] = ["360"] * 6
    text = "///RC1G\r\n" + "".join(",".join(each) + "\r\n" for each in lines) + "///SV1G\r\n1,2\r\n"
    table = replace(TABLE, declarations=(("ALL.PRM", text.encode()),))
    program = body(PULSES, "MOVL C00000 V=9.0", table)
    assert program.reason.tolist() == [Reason.INCOMPLETE]
    ratios = "[4096.0, 2048.0, 1365.3333, 1024.0, 819.2, 682.6667]"
    assert f"in ALL.PRM at 4096 pulses a turn give {ratios}" in "".join(program.notes)


@pytest.mark.parametrize("before", ["//POS", "//INST"])
def test_a_job_with_arguments(before: str) -> None:
    arguments = "//ARGINFO\n///ARGTYPE B,I,,,,,,\n///COMMENT\nnumber of the part\n\n"
    job = text(f"{HEAD}C00000={P}", "MOVL C00000").replace(
        f"\n{before}\n", f"\n{arguments}{before}\n"
    )
    program = read(job)
    assert program.reason.tolist() == [Reason.NONE]
    assert program.line.tolist() == [14 if before == "//POS" else 9]
