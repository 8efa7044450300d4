"""What is read from Fanuc LS programs, what is refused, and what is said of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fanuc_samples import JOINTS, POSE, TABLE, body, read, record, text

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Reason

MOVE = "L P[1] 200mm/sec FINE ;"


def test_a_pose() -> None:
    program = body(record(1).replace("-0.000 deg", "10.500 deg"), MOVE)
    np.testing.assert_allclose(program.position, np.array([[800, -100, 448.75]]) * MM)
    # Rz(R) Ry(P) Rx(W): KUKA's A, B, C in the other order.
    expected = matrix_from_abc(np.array([15.0, 10.5, 180.0]) * DEG)
    np.testing.assert_allclose(program.rotation[0], expected, atol=1e-15)
    assert program.words.tolist() == [[0, 1, 1, 0, 0, 0]]
    assert program.words_of == "fanuc"
    assert program.reason.tolist() == [Reason.NONE]
    assert program.motion.tolist() == [Motion.LIN]
    assert program.line.tolist() == [9]
    assert not program.notes


@pytest.mark.parametrize(
    ("config", "words"),
    [
        ("F D B, 1, -1, 2", [1, 0, 0, 1, -1, 2]),
        ("NUT,0,0,0", [0, 1, 1, 0, 0, 0]),
        ("f u t,0,0,0", [1, 1, 1, 0, 0, 0]),
        ("", [NO_WORD] * 6),
        ("N L U T, 0, 0", [NO_WORD] * 6),
    ],
)
def test_configurations(config: str, words: list[int]) -> None:
    program = body(record(1, config=config), MOVE)
    assert program.words.tolist() == [words]
    assert bool(program.notes) == (config == "N L U T, 0, 0")


def test_axis_targets() -> None:
    program = body(record(1, JOINTS), "J P[1] 4% FINE ;")
    assert program.reason.tolist() == [Reason.JOINT_TARGET]
    np.testing.assert_allclose(program.axes[0] / DEG, [10, -70, 100, 5, 60, -20])
    assert np.isnan(program.position).all()
    assert "J3 from the horizontal" in program.notes[0]
    # The work frame does not matter to an axis target; the tool does.
    assert body(record(1, JOINTS, uf="9"), MOVE).reason.tolist() == [Reason.JOINT_TARGET]
    assert body(record(1, JOINTS, ut="9"), MOVE).reason.tolist() == [Reason.UNKNOWN_FRAME]


def test_frames_by_number() -> None:
    base = np.eye(4)
    base[:3, 3] = 0.5, 0.25, 1.0
    table = FrameTable(bases={"03": base}, tools=TABLE.tools)
    records = record(1, uf="3") + record(2, uf="0", ut="0") + record(3, uf="4") + record(4, ut="5")
    program = body(records, "\n".join(f"L P[{i}] 9mm/sec FINE ;" for i in range(1, 5)), table)
    np.testing.assert_array_equal(program.T_base_frame[program.frame[0]], base)
    np.testing.assert_array_equal(program.T_base_frame[program.frame[1]], np.eye(4))
    np.testing.assert_array_equal(program.T_flange_tool[program.tool[1]], np.eye(4))
    unknown = Reason.UNKNOWN_FRAME
    assert program.reason.tolist() == [0, 0, unknown, unknown]
    said = "\n".join(program.notes)
    assert "work frame 4 is in the controller (UFRAME), not in the program" in said
    assert "test.ls:30: tool 5 is in the controller (UTOOL)" in said
    assert "add tool 5 to the cell" in said


@pytest.mark.parametrize(
    ("statements", "reason"),
    [
        ("UFRAME_NUM=1 ;\n" + MOVE, Reason.NONE),
        ("UFRAME_NUM=1 ;\nUFRAME_NUM=1 ;\n" + MOVE, Reason.NONE),
        (MOVE, Reason.UNKNOWN_FRAME),
        ("UFRAME_NUM=1 ;\n" + MOVE + "\nUFRAME_NUM=2 ;", Reason.UNKNOWN_FRAME),
        (MOVE + "\nUFRAME_NUM=1 ;", Reason.UNKNOWN_FRAME),
        ("IF (DI[1]) THEN ;\nUFRAME_NUM=1 ;\nENDIF ;\n" + MOVE, Reason.UNKNOWN_FRAME),
        ("UFRAME_NUM=R[5] ;\n" + MOVE, Reason.UNKNOWN_FRAME),
        ("IF (DI[1]),UFRAME_NUM=2 ;\nUFRAME_NUM=1 ;\n" + MOVE, Reason.UNKNOWN_FRAME),
        ("UFRAME_NUM=1 ;\nUFRAME[1:fix]=PR[3] ;\n" + MOVE, Reason.UNKNOWN_FRAME),
        ("UFRAME_NUM=1 ;\nUFRAME[R[2]]=PR[3] ;\n" + MOVE, Reason.UNKNOWN_FRAME),
    ],
)
def test_the_frame_in_force(statements: str, reason: Reason) -> None:
    program = body(record(1, uf="F"), statements)
    assert program.reason.tolist() == [reason]
    assert bool(program.notes) == (reason != Reason.NONE)


def test_moves_and_arcs() -> None:
    statements = (
        "! L P[9] 5mm/sec ;\nJ P[1:start] 4% FINE ;\n//L P[9] 5mm/sec FINE ;\n"
        "L P[2] 200mm/sec CNT100 ACC80 ;\nC P[3]    \n    :  P[4:end] 200mm/sec CNT1 ;\n"
        "A P[5] 20mm/sec FINE ;\nDO[5]=ON ;\nA P[6] 20mm/sec FINE ;\nA P[7] 20mm/sec FINE ;\n"
        "S P[8] 20mm/sec CNT100 ;\nL P[2] 5mm/sec FINE ;\n ;\n--eg:J P[9] 5% FINE ;"
    )
    names = {1: ':"start"', 4: ':"end: last"'}
    records = "".join(record(i, name=names.get(i, "")) for i in range(1, 10))
    program = body(records, statements)
    expected = [
        *(Motion.PTP, Motion.LIN, Motion.ARC_VIA, Motion.ARC_END),
        *(Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.SPLINE, Motion.UNUSED),
    ]
    assert program.motion.tolist() == expected
    assert program.reason.tolist() == [0] * 8 + [Reason.UNUSED]


def test_statements_of_a_move_have_numbers_of_their_own() -> None:
    statements = "J P[1] 100% CNT0 TB    .10sec,P-SPS    ;\n   1:  DO[79]=ON ;\n       ------ ;"
    lone = text(record(1) + record(2), statements).replace("   2:  ", "   ")
    lone = lone.replace("/POS", ":L P[2] R[34]mm/sec CNT10 ;\n/POS")
    program = read(lone)
    assert program.motion.tolist() == [Motion.PTP, Motion.LIN]


@pytest.mark.parametrize(
    ("statements", "reason"),
    [
        ("L P[1] 9mm/sec FINE INC ;", Reason.RELATIVE),
        ("L P[1] R[5:offset TA]mm/sec FINE ;", Reason.NONE),
        ("L P[1] R[5:TA]mm/sec FINE INC ;", Reason.RELATIVE),
        ("L P[1] 9mm/sec FINE TB .10sec,CALL GRIP(PR[3]) ;", Reason.NONE),
        ("L P[1] 9mm/sec FINE Skip,LBL[1],PR[5]=LPOS ;", Reason.NONE),
        ("L P[1] 9mm/sec FINE Shifted,PR[5:a] ;", Reason.EXPRESSION),
        ("Touch Offset PR[3] ;\nL P[1] 9mm/sec FINE ;\nTouch Offset End ;", Reason.EXPRESSION),
        ("Touch Offset PR[3] ;\nTouch Offset End ;\nL P[1] 9mm/sec FINE ;", Reason.NONE),
        ("L P[1] 9mm/sec FINE ;\nMP OFFSET PR[3] ;", Reason.NONE),
        ("L P[1] 9mm/sec FINE ;\nMP OFFSET PR[3] ;\nJMP LBL[1] ;", Reason.EXPRESSION),
        ("L P[1] 9mm/sec FINE Offset,PR[2] ;", Reason.EXPRESSION),
        ("L P[1] 9mm/sec FINE Offset ;", Reason.EXPRESSION),
        ("L P[1] 9mm/sec FINE Tool_Offset,PR[15] \t;", Reason.EXPRESSION),
        ("L P[1] 9mm/sec FINE VOFFSET,VR[1] ;", Reason.EXPRESSION),
        ("L P[1] 9mm/sec FINE RTCP ;", Reason.TOOL_ON_FLOOR),
        ("L P[1] 9mm/sec FINE COORD PTH ;", Reason.EXTERNAL_AXIS),
        ("PR[1]=P[1] ;\nL P[1] 9mm/sec FINE ;", Reason.EXPRESSION),
        ("L P[R[1]] 9mm/sec FINE ;\nL P[1] 9mm/sec FINE ;", Reason.EXPRESSION),
        ("C PR[1] \n P[1] 9mm/sec FINE ;", Reason.EXPRESSION),
        ("C P[1] \n P[2] 9mm/sec FINE Offset,PR[2] ;", Reason.EXPRESSION),
        ("L PR[1] 9mm/sec FINE ;\nL P[1] 9mm/sec FINE ;", Reason.NONE),
        ("L P[7] 9mm/sec FINE ;\nL P[1] 9mm/sec FINE ;", Reason.NONE),
    ],
)
def test_targets_that_are_not_where_they_stand(statements: str, reason: Reason) -> None:
    program = body(record(1) + record(2), statements)
    assert program.reason[0] == reason
    assert program.notes or reason == Reason.NONE
    assert all(note.startswith("test.ls:") for note in program.notes)


def test_external_axes_and_other_groups() -> None:
    second = "\n   GP2:\n    UF : 1, UT : 1,\n\tJ1={},\tJ2=     0.000 deg"
    more, still = second.format("     0.000 deg"), second.format("    90.000 deg")
    records = record(1, more=more) + record(2, more=still) + record(3)
    moves = "".join(f"L P[{i}] 9mm/sec FINE ;\n" for i in (1, 2, 3))
    program = body(records, moves)
    assert program.reason.tolist() == [0, Reason.EXTERNAL_AXIS, 0]
    assert "test.ls:" in program.notes[0]
    rest = FrameTable(bases=TABLE.bases, tools=TABLE.tools, external_axes_at_rest=True)
    assert body(records, moves, rest).reason.tolist() == [0, Reason.EXTERNAL_AXIS, 0]
    alike = record(1, more=still) + record(2, more=still)
    assert body(alike, moves, rest).reason.tolist() == [0, 0]
    rail = ",\n\tE1=   500.000  mm"
    assert body(record(1, more=rail), moves).reason.tolist() == [Reason.EXTERNAL_AXIS]
    alone = "P[2]{\n   GP2:\n    UF : 1, UT : 1,\n\tJ1=    90.000 deg\n};\n"
    program = body(record(1) + alone + record(3), moves)
    assert program.reason.tolist() == [0, 0]
    assert not program.notes


def test_records_of_any_form_say_the_same() -> None:
    plain = record(1) + record(2, JOINTS)
    told = "L P[1] 9mm/sec FINE ;\nL P[2] 9mm/sec FINE ;"
    expected = body(plain, told)
    forms = [
        plain.replace("   GP1", "\f   GP1"),
        record(1, more=",\n\tE1=  0.0 deg") + record(2, JOINTS, more=", E1=0 mm, E2= 0.0 deg"),
        plain.replace("   GP1:\n    UF : ", "gp1:uf:").replace("GP1", "gp1"),
        plain.replace("}", "   GP2:\n UF : 1, UT : 1, J1= 0 deg\n}"),
        plain.replace(" ", "").replace("\t", "").replace("NUT", "N U T"),
        plain.replace("P[1]", 'P [ 1 : "a, { b" ] '),
    ]
    for form in forms:
        found = body(form, told)
        np.testing.assert_array_equal(found.position, expected.position)
        np.testing.assert_array_equal(found.rotation, expected.rotation)
        np.testing.assert_array_equal(found.axes, expected.axes)
        np.testing.assert_array_equal(found.words, expected.words)
        np.testing.assert_array_equal(found.reason, expected.reason)
        spans, data = found.spans.tokens, found.data
        for first, size, value in zip(
            spans.start.flat, spans.length.flat, spans.value.flat, strict=True
        ):
            assert float(data[first : first + size]) == value


def test_positions_never_taught() -> None:
    untaught = POSE.replace("  800.000", "********").replace("180.000", "********")
    program = body(record(1, untaught, uf="F", ut="F", config=""), MOVE)
    assert program.reason.tolist() == [Reason.INCOMPLETE]
    assert np.isnan(program.position[0, 0])
    assert "never taught" in "\n".join(program.notes)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("/PROG  TEST\n", "", "test.ls:1: there is no /PROG"),
        ("/MN\n", "", "there is no /MN"),
        ("/POS\n", "", "there is no /POS"),
        ("/END\n", "", "test.ls:14: there is no /END"),
        ("/END\n", "/END\n/PROG X\n", "test.ls:16: a second /PROG"),
        ("FINE ;\n", "FINE\n", "test.ls:7: the statement '1:L P[1] 200mm/sec FINE' has no ';'"),
        ("800.000  mm", "8oo.000  mm", "in P[1] are not six numbers in mm or deg"),
        ("800.000  mm", "800.000  in", "in P[1] are not six numbers in mm or deg"),
        ("800.000  mm", "800.000  deg", "is neither X Y Z W P R nor J1 to J6"),
        ("800.000", "9" * 400, "is too large"),
        ("   GP1:\n", "", 'test.ls:10: "UF : 1, UT'),
        ("};\n", "}\n", "in P[1] cannot be read"),
        ("};\n", "};\nX\n", "test.ls:15: 'X' is no position record"),
        ("/END\n", record(1) + "/END\n", "test.ls:15: P[1] is in line 9, too"),
    ],
)
def test_refusals(old: str, new: str, message: str) -> None:
    program = text(record(1), MOVE)
    assert old in program
    with pytest.raises(FormatError) as caught:
        read(program.replace(old, new, 1))
    assert message in str(caught.value)
    assert caught.value.hint


@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
def test_every_line_end(end: str) -> None:
    program = text(record(1) + record(2, JOINTS), MOVE).replace("\n", end)
    assert read("\xef\xbb\xbf" + program).line.tolist() == [9, 15]


def test_positions_on_a_moving_conveyor() -> None:
    program = text(record(1), MOVE)
    for schedule, reason in ((0, Reason.NONE), (2, Reason.UNKNOWN_FRAME)):
        track = f"/APPL\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : {schedule};\n/MN"
        found = read(program.replace("/MN", track))
        assert found.reason.tolist() == [reason]
        assert any("moves with the conveyor" in note for note in found.notes) == bool(reason)


GERMAN = (
    "/PROG  UP1\n/ATTR\nEIGN.\t\t= WERK;\nPROG_GRÖßE\t= 26;\nZEILEN\t\t= 8;\n"
    "SPEICHERGR.\t= 40;\nDEFAULT_GRUP\t= 1,*,*,*,*;\n/MN\n   1:  WKZ_NUM=1 ;\n"
    "   2:  BENUTZER_NUM=1 ;\n   3:J P[1] 100% CNT0 ACC100 ZEIT VOR    .10sek,P-SPS    ;\n"
    "      1:  FB-PSPS (AN) ;\n       ------ ;\n   4:L P[2] R[1:v]mm/sek FINE{odd}    ;\n/POS\n"
)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
@pytest.mark.parametrize(
    ("odd", "reason"),
    [("", Reason.NONE), (" INC", Reason.RELATIVE), (" INKR", Reason.EXPRESSION)],
)
def test_a_listing_in_german(odd: str, reason: Reason, encoding: str) -> None:
    records = record(1) + record(2, uf="F", ut="F")
    program = GERMAN.format(odd=odd) + records.replace("CONFIG", "KONFIG") + "/END\n"
    found = read(program.encode(encoding))
    assert found.reason.tolist() == [Reason.NONE, reason]
    assert found.words.tolist() == [[0, 1, 1, 0, 0, 0]] * 2
    assert any("another language" in note for note in found.notes) == (odd == " INKR")


def test_other_words_of_an_english_listing_are_let_pass() -> None:
    assert body(record(1), "L P[1] WELD_SPEED CNT100 PTH Wjnt ;").reason.tolist() == [Reason.NONE]


@pytest.mark.parametrize(("call", "left"), [("CALL PROBE", True), ("CALL GRIP", False)])
def test_a_called_program_may_set_the_numbers_in_force(call: str, left: bool) -> None:
    table = replace(TABLE, harmless_routines=("grip",))
    records = record(1, uf="F", ut="F") + record(2)
    moves = f"UFRAME_NUM=1 ;\nUTOOL_NUM=1 ;\n{MOVE}\n{call} ;\n{MOVE}\nL P[2] 9mm/sec FINE ;"
    program = body(records, moves, table)
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME if left else Reason.NONE, Reason.NONE]
    assert any('harmless_routines = ["PROBE"]' in note for note in program.notes) == left


def test_a_called_program_that_is_given_and_sets_no_number_is_no_matter() -> None:
    main = text(record(1, uf="F"), f"UFRAME_NUM=1 ;\nCALL TEST ;\n{MOVE}")
    for inside, why in (("DO[1]=ON ;", Reason.NONE), ("UFRAME_NUM=2 ;", Reason.UNKNOWN_FRAME)):
        job = [("main.ls", main.replace("/PROG  TEST", "/PROG  MAIN").encode())]
        job.append(("test.ls", text(record(1), f"{inside}\n{MOVE}").encode()))
        assert find_language("fanuc_ls").read_job(job, frames=TABLE)[0].reason.tolist() == [why]


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("UFRAME[1:fixture]=PR[3] ;", Reason.UNKNOWN_FRAME),
        ("UTOOL[01]=PR[3] ;", Reason.UNKNOWN_FRAME),
        ("UFRAME[R[4]]=PR[3] ;", Reason.UNKNOWN_FRAME),
        ("IF (DI[1]=ON),UFRAME[1]=(PR[3]) ;", Reason.UNKNOWN_FRAME),
        ("UFRAME[7]=PR[3] ;", Reason.NONE),
        ("! UFRAME[1]=PR[3] ;", Reason.NONE),
        ("PR[3]=UFRAME[1] ;", Reason.NONE),
    ],
)
def test_a_frame_that_another_program_of_the_job_changes(
    statement: str, reason: Reason, order: int
) -> None:
    files = [
        ("move.ls", text(record(1), MOVE).encode()),
        ("frames.ls", text(record(1), statement).encode()),
    ][::order]
    moving = find_language("fanuc_ls").read_job(tuple(files), frames=TABLE)[::order][0]
    assert moving.reason.tolist() == [reason]
    assert ("is changed by frames.ls in line 7" in "\n".join(moving.notes)) == bool(reason)


@pytest.mark.parametrize("step", ["P[2]", "PR[3]", "PR[R[1]]"])
def test_a_step_is_told_of_wherever_it_is_kept(step: str) -> None:
    program = body(record(1) + record(2), f"{MOVE}\nL {step} 200mm/sec FINE INC ;")
    assert program.reason[0] == Reason.NONE
    assert "INC moves by a step from the target before it" in "\n".join(program.notes)
