"""Conversational programs: what blocks say, what is not compensated, what is written."""

from __future__ import annotations

import numpy as np
import pytest
from path_samples import HEIDENHAIN, RULE, TABLE, moved, read

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.lang import find_language
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Motion, Program, Reason

HEAD = "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S100\n2 M128\n"
FIRST = "L X+1.0 Y+2.0 Z+3.0 A+0.0 B+0.0 C+0.0"


def of(text: str, table: FrameTable = TABLE, head: str = HEAD) -> Program:
    lines = "".join(f"{k} {line}\n" for k, line in enumerate(text.split("\n"), 3))
    return read("heidenhain", f"{head}{lines}99 END PGM A MM\n".encode(), table)


def reasons(program: Program) -> list[Reason]:
    return [Reason(each) for each in program.reason.tolist()]


def written(
    program: Program, shift: list[list[float]], turn: np.ndarray | None = None
) -> list[str]:
    change = moved(program, np.array(shift) * 1e-6, np.eye(3) if turn is None else turn)
    return find_language("heidenhain").write(program, change).decode().split("\n")[3:-2]


def test_lines_and_what_they_leave_out() -> None:
    program = read("heidenhain", HEIDENHAIN)
    line = dict(zip(program.line.tolist(), reasons(program), strict=True))
    assert [line[k] for k in (7, 8, 9, 10, 11, 13, 14, 17)] == [Reason.NONE] * 8
    assert line[18] == Reason.INCOMPLETE  # the point behind M129 keeps words of it
    assert line[15] == Reason.RELATIVE
    assert line[16] == Reason.EXPRESSION
    assert line[20] == Reason.EXPRESSION  # A+0 behind M129
    np.testing.assert_allclose(program.position[2] / MM, [20.5, -5.5, -1.25])


def test_tool_axes_and_angles() -> None:
    program = of(f"{FIRST}\nLN X+1 Y+2 Z+3 NX+0 NY+0 NZ+1 TX+0.0 TY+0.6 TZ+0.8\nL X+2.0")
    assert reasons(program) == [Reason.NONE] * 3
    np.testing.assert_allclose(RULE.axes_of(program.rotation)[1:], [[0, 0.6, 0.8]] * 2, atol=1e-12)
    silent = FrameTable(tools=TABLE.tools, orientation=OrientationRule())
    assert reasons(of(FIRST, silent)) == [Reason.INCOMPLETE]
    tcpm = of(FIRST, head="0 BEGIN PGM A MM\n1 TOOL CALL 1 Z\n2 FUNCTION TCPM F TCP AXIS POS\n")
    assert reasons(tcpm) == [Reason.NONE]
    off = of(f"{FIRST}\nFUNCTION RESET TCPM\nL X+1.0 Y+1.0 Z+1.0")
    assert reasons(off) == [Reason.INCOMPLETE, Reason.EXPRESSION]  # A, B, C are kept from it


def test_inches_of_the_head() -> None:
    program = of(FIRST, head="0 BEGIN PGM A INCH\n1 TOOL CALL 1 Z\n2 M128\n")
    np.testing.assert_allclose(program.position[0], [0.0254, 0.0508, 0.0762])


def test_an_arc_stands_in_two_blocks() -> None:
    program = of(f"{FIRST}\nCC X+6.0 Y+2.0\nC X+11.0 Y+2.0 DR+\nCR X+21.0 Y+2.0 R+5.0 DR-")
    arc = [Motion.ARC_VIA, Motion.ARC_END]
    assert program.motion.tolist() == [Motion.LIN, *arc, *arc]
    np.testing.assert_allclose(program.position[[1, 3]] / MM, [[6, -3, 3], [16, 7, 3]], atol=1e-9)
    assert written(program, [[100, 50, 0]] * 5) == [
        "3 L X+1.100 Y+2.050 Z+3.0 A+0.0 B+0.0 C+0.0",
        "4 CC X+6.100 Y+2.050",
        "5 C X+11.100 Y+2.050 DR+",
        "6 CR X+21.100 Y+2.050 R+5.0 DR-",
    ]


def test_a_pole_of_two_arcs_is_left_alone() -> None:
    program = of(f"{FIRST}\nCC X+6.0 Y+2.0\nC X+11.0 Y+2.0 DR+\nC X+1.0 Y+2.0 DR+\nL X+9.0 Y+9.0")
    assert all(each != Reason.NONE for each in reasons(program)[:5])
    assert reasons(program)[5] == Reason.NONE


def test_conversational_blocks_take_no_words_they_do_not_know() -> None:
    text = f"{FIRST}\nLN X+1.0 Y+2.0 Z+3.0 TX+0.00000 TY+0.60000 TZ+0.80000\nL X+2.0"
    program = of(f"{text}\nCC X+7.0 Y+2.0\nC X+12.0 Y+2.0 DR+\nL X+13.0")
    turn = matrix_from_abc(np.array([0.0, 0.2, 0.1]) * DEG)
    lines = written(program, [[0, 0, 0]] * 4 + [[0, 0, 20]] * 2, turn)
    assert "TX" in lines[1]
    assert lines[2] == "5 L X+2.0"  # no tool axis in L
    assert lines[4] == "7 C X+12.0 Y+2.0 DR+"  # no third axis in C
    assert lines[5] == "8 L X+13.0 Z+3.020"


@pytest.mark.parametrize(
    ("block", "reason"),
    [
        ("L IX+1.0", Reason.RELATIVE),
        ("L X+Q1 Y+2.0 Z+3.0", Reason.EXPRESSION),
        ("L X+1.0 RL", Reason.EXPRESSION),
        ("LP PR+10 PA+20", Reason.EXPRESSION),
        ("CT X+1.0 Y+1.0", Reason.EXPRESSION),
        ("CP IPA+360 IZ+2.0 DR+", Reason.EXPRESSION),
        ("L X+1.0 M91", Reason.UNKNOWN_FRAME),
        ("L X+1.0 U+5.0", Reason.EXTERNAL_AXIS),
        ("CYCL DEF 7.0\nCYCL DEF 7.1 X+5\nL X+1.0 Y+1.0 Z+1.0", Reason.UNKNOWN_FRAME),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+30\nL X+1.0 Y+1.0 Z+1.0", Reason.UNKNOWN_FRAME),
        ("PLANE SPATIAL SPA+10 SPB+0 SPC+0 STAY\nL X+1.0 Y+1.0 Z+1.0", Reason.UNKNOWN_FRAME),
        ("TRANS DATUM AXIS X+10\nL X+1.0 Y+1.0 Z+1.0", Reason.UNKNOWN_FRAME),
        ("TOOL CALL 2 Z\nL X+1.0 Y+1.0 Z+1.0 A+0 B+0 C+0", Reason.UNKNOWN_FRAME),
        ("LBL 1\nL X+1.0 Y+1.0 Z+1.0 A+0 B+0 C+0", Reason.INCOMPLETE),
        ("CALL PGM B\nL X+1.0 Y+1.0 Z+1.0 A+0 B+0 C+0", Reason.INCOMPLETE),
        ("FN 9: IF +Q1 EQU +1 GOTO LBL 5\nL X+1.0 Y+1.0 Z+1.0 A+0", Reason.INCOMPLETE),
        ("APPR LT X+1 Y+1 LEN10\nL X+1.0", Reason.INCOMPLETE),
        ("TOOL CALL 1.1 Z\nL X+1.0 Y+1.0 Z+1.0 A+0 B+0 C+0", Reason.UNKNOWN_FRAME),
        ("PLANE RESET TURN FMAX\nL X+1.0 Y+1.0 Z+1.0", Reason.INCOMPLETE),
        ("TRANS DATUM TABLE TABLINE5\nL X+1.0 Y+1.0 Z+1.0", Reason.UNKNOWN_FRAME),
        ("L X+5.0 M89\nL X+1.0 Y+1.0 Z+1.0 A+0 B+0 C+0", Reason.UNKNOWN_FRAME),
    ],
)
def test_what_is_not_compensated(block: str, reason: Reason) -> None:
    program = of(f"{FIRST}\n{block}")
    kept = any("not compensated either: the next point" in note for note in program.notes)
    assert reasons(program)[0] == (Reason.INCOMPLETE if kept else Reason.NONE)
    assert reasons(program)[-1] == reason
    assert any("part.nc:" in note for note in program.notes)


def test_shifts_that_are_taken_back() -> None:
    shift = "CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+5\nCYCL DEF 7.2 Y+0"
    back = "CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+0\nCYCL DEF 7.2 Y+0"
    assert reasons(of(f"{shift}\n{FIRST}\n{back}\n{FIRST}")) == [Reason.UNKNOWN_FRAME, Reason.NONE]
    assert reasons(of(f"PLANE RESET STAY\n{FIRST}")) == [Reason.NONE]


@pytest.mark.parametrize(
    ("shift", "part"),
    [
        ("CYCL DEF 7.0\nCYCL DEF 7.1 X+5\nCYCL DEF 7.2 Y+5", "CYCL DEF 7.0\nCYCL DEF 7.1 X+0"),
        ("CYCL DEF 7.0\nCYCL DEF 7.1 X+5", "CYCL DEF 7.0\nCYCL DEF 7.1 IX+0"),
        ("TRANS DATUM AXIS X+5", "TRANS DATUM AXIS Y+0"),
        ("TRANS MIRROR AXIS X", "TRANS ROTATION RESET"),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+30", "CYCL DEF 10.0\nCYCL DEF 10.1 IROT+0"),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+30\nLBL 1", "TRANS DATUM RESET"),
    ],
)
def test_shifts_that_are_taken_back_in_part(shift: str, part: str) -> None:
    again = "TOOL CALL 1 Z\nM128\nCYCL DEF 247 DATUM SETTING Q339=+2"
    table = FrameTable(bases={"preset 2": np.eye(4)}, tools=TABLE.tools, orientation=RULE)
    program = of(f"{FIRST}\n{shift}\n{part}\n{again}\n{FIRST} R0", table)
    assert reasons(program)[0] == Reason.NONE
    assert reasons(program)[1] in (Reason.UNKNOWN_FRAME, Reason.INCOMPLETE)


def test_datum_shifts_of_two_words_are_one() -> None:
    assert reasons(of(f"TRANS DATUM AXIS X+5\nCYCL DEF 7.0\nCYCL DEF 7.1 X+0\n{FIRST}")) == [
        Reason.NONE
    ]


def test_a_pole_of_an_arc_and_a_polar_point_stays() -> None:
    program = of(f"{FIRST}\nCC X+6.0 Y+2.0\nC X+11.0 Y+2.0 DR+\n{FIRST}\nLP PR+10 PA+20")
    assert all(each != Reason.NONE for each in reasons(program)[1:3])


def test_words_are_put_where_their_block_takes_them() -> None:
    text = f"{FIRST}\nL Y+5.0\nL X+Q1 R0 FMAX\nLN X+3.0 NX+0 NY+0 NZ+1 F100"
    turn = matrix_from_abc(np.array([0.1, 0.0, 0.0]) * DEG)
    lines = written(of(text), [[100, 0, 0], [200, 10, 0], [0, 0, 0], [100, 0, 30]], turn)
    assert lines[1] == "4 L Y+5.010 X+1.200"
    assert lines[2] == "5 L X+Q1 Y+5.0 C+0.0 R0 FMAX"
    assert lines[3] == "6 LN X+3.100 Z+3.030 NX+0 NY+0 NZ+1 F100"  # no rotary word
    head = "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z\n2 M129\n"
    axis = of("L X+1.0 Y+2.0 Z+3.0\nLN Z+4.0 TX+0.0 TY+0.6 TZ+0.8", head=head)
    assert written(axis, [[100, 0, 0]] * 2)[1] == "4 LN Z+4.0 X+1.0 TX+0.0 TY+0.6 TZ+0.8"


def test_what_blocks_cannot_hold_is_told() -> None:
    program = of(f"{FIRST}\nCC X+6.0 Y+2.0\nC X+11.0 Y+2.0 DR+\nLN X+3.0 NX+0 NY+0 NZ+1")
    turn = matrix_from_abc(np.array([0.1, 0.0, 0.0]) * DEG)
    change = moved(program, np.array([[0, 0, 0], [0, 0, 20], [0, 0, 40], [0, 0, 0]]) * 1e-6, turn)
    told = find_language("heidenhain").losses(program, change)
    (level,) = (each for each in told if "height" in each.text)
    assert (level.count, level.line) == (1, 6)
    assert level.worst == pytest.approx(40.0)
    assert [each.count for each in told if "turn" in each.text] == [2]  # of C and of LN


def test_what_is_taken_over_across_a_jump_stays() -> None:
    text = f"{FIRST}\nL X+2.0\nCALL LBL 1\n{FIRST}\nM30\nLBL 1\nL Y+5.0\nLBL 0"
    assert reasons(of(text))[:2] == [Reason.NONE, Reason.INCOMPLETE]
    full = f"{FIRST}\nL X+2.0\nCALL LBL 1\nM30\nLBL 1\n{FIRST}\nLBL 0"
    assert reasons(of(full))[1] == Reason.NONE


def test_r0_ends_the_radius_of_the_tool_in_plain_lines() -> None:
    program = of(f"{FIRST}\nL X+2.0 RL\n{FIRST} R0 FMAX\n{FIRST}")
    assert reasons(program)[2:] == [Reason.NONE] * 2


def test_angles_that_a_block_left_alone_takes_over_and_cannot_write_stay() -> None:
    program = of(f"{FIRST}\nLN X+1.0 Y+2.0 Z+Q1 NX+0 NY+0 NZ+1\n{FIRST}")
    assert reasons(program) == [Reason.INCOMPLETE, Reason.EXPRESSION, Reason.NONE]


def test_refused() -> None:
    for data, line, what in (
        (b"0 L X+1\n", 1, "BEGIN PGM"),
        (b"0 BEGIN PGM A MM\n1 L X+1\n", 2, "cut off"),
    ):
        with pytest.raises(FormatError, match=what) as refused:
            read("heidenhain", data)
        assert refused.value.line == line


def test_presets_come_from_the_cell() -> None:
    table = FrameTable(bases={"preset 2": np.eye(4)}, tools=TABLE.tools, orientation=RULE)
    for call in ("CYCL DEF 247 DATUM SETTING Q339=+2", "CYCL DEF 247 DATUM SETTING ~\nQ339=+2 ;NR"):
        head = f"0 BEGIN PGM A MM\n1 TOOL CALL 1 Z\n2 M128\n3 {call}\n"
        assert reasons(of(FIRST, table, head)) == [Reason.NONE]
        assert of(FIRST, table, head).frame[0] == 1
        assert reasons(of(FIRST, TABLE, head)) == [Reason.UNKNOWN_FRAME]


def test_words_that_are_no_text_are_told_and_not_guessed() -> None:
    program = read(
        "heidenhain", (HEAD + "3 PLANE").encode() + b"\xe4\xac\xbe0 X2\n4 L X+1\n5 END PGM A MM\n"
    )
    assert reasons(program) == [Reason.UNKNOWN_FRAME]
    assert any("moves the coordinates" in note for note in program.notes)


def test_a_tool_without_a_name_is_a_tool() -> None:
    assert len(of(f'TOOL CALL "" Z S1\n{FIRST}')) == 1


def test_corrected_ends_that_no_circle_joins_are_not_written() -> None:
    program = of(f"{FIRST}\nCC X+900.0 Y+2.0\nC X+1.0 Y+3.0 DR+")
    assert reasons(program) == [Reason.NONE] * 3
    with pytest.raises(ConfigurationError, match=r"part\.nc:6: the corrected ends .* mm off one"):
        written(program, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [900.0, 0.0, 0.0]])
    assert written(program, [[500.0, 0.0, 0.0]] * 3)[1:] == [
        "4 CC X+900.500 Y+2.0",
        "5 C X+1.500 Y+3.0 DR+",
    ]


def test_a_whole_circle_is_not_written_as_the_short_arc_between_its_ends() -> None:
    program = of(f"{FIRST}\nCC X+50.0 Y+2.0\nC X+1.0 Y+2.0 DR+")
    assert reasons(program) == [Reason.NONE] * 3
    with pytest.raises(ConfigurationError, match=r"part\.nc:6: .* whole circle lie apart"):
        written(program, [[0.0, 0.5, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert written(program, [[0.0, 500.0, 0.0]] * 3)[1:] == [
        "4 CC X+50.0 Y+2.500",
        "5 C X+1.0 Y+2.500 DR+",
    ]


def test_a_head_for_people_and_blocks_with_an_n() -> None:
    head = "( Einrichtblatt\n(   TOOL CALL 9 Z\n0 ;\nBEGIN PGM 01 MM\nN1 TOOL CALL 1 Z\nN2 M128\n"
    program = read(
        "heidenhain", f"{head}N3 {FIRST}\nN4 L X+2.0\nN5 END PGM 01 MM\n".encode(), TABLE
    )
    assert reasons(program) == [Reason.NONE] * 2
    assert program.line.tolist() == [7, 8]
    assert not program.notes


def test_a_retreat_to_the_limit_is_told_as_what_it_is() -> None:
    program = of(f"{FIRST}\nL M140 MB MAX\nL X+2.0\nL Y+2.0 Z+3.0 A+0.0 B+0.0 C+0.0")
    assert reasons(program) == [Reason.INCOMPLETE, Reason.INCOMPLETE, Reason.NONE]
    assert not any("not understood" in note for note in program.notes)
    assert any("Y, Z, A, B, C: left out here and not stated before" in n for n in program.notes)


def test_corners_between_lines_change_nothing() -> None:
    program = of(f"{FIRST}\nRND R4\nL Y+5.0\nCHF 2\nL X+5.0")
    assert reasons(program) == [Reason.NONE] * 3
    assert not program.notes


def test_an_approach_may_begin_the_radius_of_the_tool() -> None:
    full = "X+{} Y+2.0 Z+3.0 A+0.0 B+0.0 C+0.0"
    lines = [full.format(k) for k in "123"]
    text = "APPR LCT X+0 Y+0 R20 {}\nL {}\nL {}\nDEP LCT X+9 Y+0 R20\nL {}"
    assert reasons(of(text.format("RL F100", *lines))) == [Reason.EXPRESSION] * 2 + [Reason.NONE]
    assert reasons(of(text.format("R0 F100", *lines))) == [Reason.NONE] * 3


def test_decimal_commas_are_told() -> None:
    program = of(f"{FIRST}\nL X+1,5 Y+2,25\n{FIRST}")
    assert reasons(program) == [Reason.NONE, Reason.EXPRESSION, Reason.NONE]
    assert any("decimal commas: write points" in note for note in program.notes)
