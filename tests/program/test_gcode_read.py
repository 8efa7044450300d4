"""G-code of Sinumerik and Fanuc controls: what blocks say, and what is not compensated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from path_samples import FANUC, RULE, SINUMERIK, TABLE, read

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Motion, Program, Reason


def sinumerik(text: str, table: FrameTable = TABLE) -> Program:
    return read("sinumerik", f"G90 G17 G71\nG54\nTRAORI\n{text}\n".encode(), table)


def fanuc(text: str, table: FrameTable = TABLE) -> Program:
    return read("fanuc_gcode", f"%\nG90 G17 G21\nG54 G43.4 H1\n{text}\n%\n".encode(), table)


def reasons(program: Program) -> list[Reason]:
    return [Reason(each) for each in program.reason.tolist()]


FIRST = "G1 X1.0 Y2.0 Z3.0 A=10.0 B=20.0 C=30.0"


def test_words_left_out_are_those_before() -> None:
    program = read("sinumerik", SINUMERIK)
    assert program.line[:4].tolist() == [6, 7, 8, 9]
    expected = [[10, -0.7694, 5], [10, -0.7694, -1.25], [10, 1.2911, -1.25], [20.5, 1.2911, -1.25]]
    np.testing.assert_allclose(program.position[:4] / MM, expected)
    assert (program.reason[:4] == Reason.NONE).all()
    np.testing.assert_allclose(program.spans.value[3, 3:], [178.5, -30.25, 0.0])


def test_angles_are_what_the_cell_says() -> None:
    rotation = sinumerik(FIRST).rotation[0]
    np.testing.assert_allclose(rotation, matrix_from_abc(np.array([30.0, 20.0, 10.0]) * DEG))
    kuka = FrameTable(bases=TABLE.bases, orientation=OrientationRule(angles="kuka"))
    rotation = sinumerik(FIRST, kuka).rotation[0]
    np.testing.assert_allclose(rotation, matrix_from_abc(np.array([10.0, 20.0, 30.0]) * DEG))
    silent = sinumerik(FIRST, FrameTable(bases=TABLE.bases))
    assert reasons(silent) == [Reason.INCOMPLETE]
    assert any("[controller] angles" in note for note in silent.notes)
    for word, angles in (("ORIEULER", "rpy"), ("ORIRPY", "kuka"), ("ORIMKS", "rpy")):
        table = FrameTable(bases=TABLE.bases, orientation=OrientationRule(angles=angles))
        assert reasons(sinumerik(f"{word}\n{FIRST}", table)) == [Reason.EXPRESSION]
    assert reasons(sinumerik(f"ORIRPY\n{FIRST}")) == [Reason.NONE]


def test_a_tool_axis_takes_the_spin_the_cell_says() -> None:
    program = sinumerik("G1 X1.0 Y2.0 Z3.0 A3=0 B3=0.6 C3=0.8\nX2.0\nX3.0 A3=0.6 B3=0 C3=0.8")
    assert reasons(program) == [Reason.NONE] * 3
    axis = RULE.axes_of(program.rotation)
    np.testing.assert_allclose(axis, [[0, 0.6, 0.8], [0, 0.6, 0.8], [0.6, 0, 0.8]], atol=1e-15)
    silent = FrameTable(bases=TABLE.bases, orientation=OrientationRule(angles="rpy"))
    told = sinumerik("G1 X1.0 Y2.0 Z3.0 A3=0 B3=0.6 C3=0.8", silent)
    assert reasons(told) == [Reason.INCOMPLETE]
    assert any("spin_deg" in note for note in told.notes)
    assert reasons(sinumerik("G1 X1.0 Y2.0 Z3.0 A3=0 B3=0.6 C3=0.9")) == [Reason.INCOMPLETE]


def test_spin_is_counted_from_the_work_frame() -> None:
    upright = OrientationRule(spin=0.0).rotations(np.array([[0.0, 0.0, 1.0]]))[0]
    np.testing.assert_allclose(upright, np.diag([1.0, -1.0, -1.0]), atol=1e-15)
    turned = OrientationRule(spin=90.0 * DEG).rotations(np.array([[0.0, 0.0, 1.0]]))[0]
    np.testing.assert_allclose(turned[:, 0], [0.0, -1.0, 0.0], atol=1e-15)
    along_x = OrientationRule(spin=0.0, cutter=np.array([1.0, 0, 0])).rotations(np.eye(3)[2:])[0]
    np.testing.assert_allclose(along_x[:, 0], [0.0, 0.0, -1.0], atol=1e-15)


def test_three_axes_keep_one_orientation() -> None:
    plain = b"G90 G17 G71\nG54\nG1 X1.0 Y2.0 Z3.0\nX2.0\n"
    program = read("sinumerik", plain)
    assert reasons(program) == [Reason.NONE] * 2
    np.testing.assert_allclose(RULE.axes_of(program.rotation), [[0, 0, 1.0]] * 2, atol=1e-15)
    rotary = read("sinumerik", plain + b"G1 X1.0 C=30.0\nX3.0\n")
    assert reasons(rotary)[2:] == [Reason.EXPRESSION] * 2
    off = sinumerik(f"{FIRST}\nTRAFOOF\nG1 X1.0 Y1.0 Z1.0")
    assert reasons(off) == [Reason.INCOMPLETE, Reason.EXPRESSION]  # A, B, C are kept from it


def test_fanuc_tool_point_by_angles_and_by_axis() -> None:
    program = read("fanuc_gcode", FANUC)
    line = dict(zip(program.line.tolist(), reasons(program), strict=True))
    assert [line[k] for k in (7, 8, 9, 10, 17, 19)] == [Reason.NONE] * 6
    assert line[20] == Reason.INCOMPLETE  # what stands behind G68 keeps words of it
    assert line[14] == Reason.EXPRESSION  # X#100
    assert line[16] == Reason.INCOMPLETE  # a block with /
    assert line[15] == Reason.INCOMPLETE  # its words go on through that block
    assert line[22] == Reason.UNKNOWN_FRAME  # G68
    assert line[26] == Reason.INCOMPLETE  # behind a call
    axes = RULE.axes_of(program.rotation[np.isin(program.line, (19, 20))])
    np.testing.assert_allclose(axes, [[0.1, 0, 0.994987]] * 2, atol=1e-6)


def test_inches() -> None:
    text = "G1 X1.0 Y2.0 Z3.0 A=10.0 B=20.0 C=30.0"
    for code in ("G70", "G700"):
        np.testing.assert_allclose(
            sinumerik(f"{code}\n{text}").position[0], [0.0254, 0.0508, 0.0762]
        )
    program = fanuc("G20\nX1. Y2. Z3. A1. B2. C3.\nG21\nX4.")
    np.testing.assert_allclose(program.position[0], [0.0254, 0.0508, 0.0762])
    assert reasons(program)[1] == Reason.INCOMPLETE  # nothing is kept over a change of unit


def test_arcs_have_their_middle() -> None:
    program = fanuc(
        "G0 X0. Y0. Z1. A0. B0. C0.\nG2 X10. Y0. I5. J0.\nG3 X20. R5.\nG3 I5.\nG2 X30. R-5.5"
    )
    assert program.motion[1::2].tolist() == [Motion.ARC_VIA] * 4
    assert program.motion[2::2].tolist() == [Motion.ARC_END] * 4
    middles = program.position[1::2] / MM
    lift = -(np.sqrt(5.5**2 - 25.0) + 5.5)
    expected = [[5, 5, 1], [15, -5, 1], [30, 0, 1], [25, -lift, 1]]
    np.testing.assert_allclose(middles, expected, atol=1e-9)
    side = fanuc("G18 G0 X0. Y7. Z0. A0. B0. C0.\nG2 X10. Z0. I5. K0.")
    assert abs(side.position[1, 1] / MM - 7.0) < 1e-9
    np.testing.assert_allclose(side.position[1] / MM, [5, 7, -5], atol=1e-9)  # from +Y
    helix = fanuc("G0 X0. Y0. Z0. A0. B0. C0.\nG3 X10. Y0. Z4. I5. J0.")
    np.testing.assert_allclose(helix.position[1] / MM, [5, -5, 2], atol=1e-9)


def test_arcs_through_a_point() -> None:
    program = sinumerik(f"{FIRST}\nCIP X10.0 Y2.0 Z3.0 I1=5.0 J1=7.0 K1=3.5")
    assert program.motion.tolist() == [Motion.LIN, Motion.ARC_VIA, Motion.ARC_END]
    np.testing.assert_allclose(program.position[1] / MM, [5, 7, 3.5])


@pytest.mark.parametrize(
    "arc",
    [
        "G2 X10.0 Y2.0 I=4.0 J=0.5", "G2 X10.0 Y2.0", "G2 X10.0 Y2.0 I=1 CR=5", "CIP X1 Y1 I1=3",
        "G2 X10.0 Y2.0 K=2.0 I=1.0", "G2 X10.0 Y2.0 CR=1.0", "G2 X11.0 Y2.0 CR=R1",
    ],
)  # fmt: skip
def test_an_arc_that_cannot_be_told_holds_its_start_back(arc: str) -> None:
    program = sinumerik(f"{FIRST}\n{arc}\nG1 X20.0 Y1.0 Z1.0")
    assert program.motion[2] == Motion.ARC_END
    assert all(each != Reason.NONE for each in reasons(program)[:3])
    assert reasons(program)[3] == Reason.NONE


def test_a_whole_circle_and_its_start_share_their_fate() -> None:
    held = [Reason.INCOMPLETE] * 3
    assert reasons(fanuc(f"{POINT}\nG3 I5.\n/G1 X4.\nG1 Y9. Z3."))[:3] == held
    assert reasons(fanuc(f"{POINT}\nG3 X9. I4.\n/G1 X4.\nG1 Y9. Z3."))[:3] == [
        Reason.NONE,
        *held[1:],
    ]


def test_zero_offsets_come_from_the_cell() -> None:
    table = FrameTable(
        bases={"G54": np.diag([1.0, 1, 1, 1]), "G505": np.eye(4)},
        orientation=RULE,
        tools=TABLE.tools,
    )
    text = f"{FIRST}\nG505\n{FIRST}\nG55\n{FIRST}\nG500\n{FIRST}"
    program = sinumerik(text, table)
    assert reasons(program) == [Reason.NONE, Reason.NONE, Reason.UNKNOWN_FRAME, Reason.NONE]
    assert program.frame[3] == 0
    assert any("G55" in note.upper() for note in program.notes)
    more = FrameTable(bases={"G54.1 P3": np.eye(4)}, orientation=RULE)
    assert reasons(fanuc("G54.1 P3\nG1 X1. Y1. Z1. A0. B0. C0.", more)) == [Reason.NONE]


def test_zero_offsets_the_program_sets() -> None:
    text = "$P_UIFR[1]=CTRANS(X,100.0,Y,0.0,Z,50.0):CROT(X,0.0,Y,0.0,Z,90.0)\nG54\n" + FIRST
    far = sinumerik(f"$P_UIFR[1]=CTRANS(X,8E999):CROT(Z,9.0)\nG54\n{FIRST}")
    assert reasons(far) == [Reason.UNKNOWN_FRAME]
    program = sinumerik(f"{text}\n$P_UIFR[1]=CTRANS(X,R1)\n{FIRST}\nG54\n{FIRST}")
    assert reasons(program) == [Reason.NONE, Reason.NONE, Reason.UNKNOWN_FRAME]
    frame = program.T_base_frame[program.frame[0]]
    np.testing.assert_allclose(frame[:3, 3], [0.1, 0.0, 0.05])
    np.testing.assert_allclose(frame[:3, 0], [0, 1, 0], atol=1e-15)
    assert program.frame[1] == program.frame[0]  # what is set counts from the next call on


def test_tools_come_from_the_cell() -> None:
    table = FrameTable(bases=TABLE.bases, orientation=RULE, tools={"1": np.eye(4), "T7": np.eye(4)})
    program = sinumerik(f"{FIRST}\nT1 D1\n{FIRST}\nT7\n{FIRST}\nT2\n{FIRST}\nD0\n{FIRST}", table)
    assert reasons(program) == [Reason.NONE] * 3 + [Reason.UNKNOWN_FRAME] * 2
    chosen = fanuc("G1 X1. Y1. Z1. A0. B0. C0.\nT2\nX2.\nT1\nM6\nG1 X1. Y1. Z1. A0. B0. C0.", table)
    assert reasons(chosen) == [Reason.NONE] * 3  # T chooses, M6 changes
    assert chosen.tool[0] == chosen.tool[1] == 0
    assert chosen.tool[2] != 0


@pytest.mark.parametrize(
    ("before", "behind", "reason"),
    [
        ("G91", "", Reason.RELATIVE),
        ("TRANS X10", "TRANS", Reason.UNKNOWN_FRAME),
        ("ROT Z30", "ROT", Reason.UNKNOWN_FRAME),
        ("AMIRROR X0", "MIRROR", Reason.UNKNOWN_FRAME),
        ("CYCLE800(1,2)", "CYCLE800()", Reason.UNKNOWN_FRAME),
        ("G41", "G40", Reason.EXPRESSION),
        ("BSPLINE", "G1", Reason.EXPRESSION),
        ("L100", "G90 G17 G71 G40 G54 T1\nTRAORI CP ORIRPY\nTRANS\nG1", Reason.INCOMPLETE),
        ("DIAMON", "DIAMOF", Reason.UNKNOWN_FRAME),
        ("IF R1>5 GOTOF A1", "", Reason.NONE),
        ("HOME(1)", "", Reason.INCOMPLETE),
        ("AGAIN:", "", Reason.NONE),
    ],
)
def test_what_moves_the_coordinates_or_the_path(before: str, behind: str, reason: Reason) -> None:
    program = sinumerik(f"{FIRST}\n{before}\n{FIRST[3:]}")
    kept = any("not compensated either: the next point" in note for note in program.notes)
    assert reasons(program) == [Reason.INCOMPLETE if kept else Reason.NONE, reason]
    assert any(":5" in note or ":6" in note for note in program.notes)
    if behind:
        assert reasons(sinumerik(f"{FIRST}\n{before}\n{behind}\n{FIRST}"))[1] == Reason.NONE


@pytest.mark.parametrize(
    ("block", "reason"),
    [
        ("G53 X1. Y1. Z1.", Reason.UNKNOWN_FRAME),
        ("G68 X0. Y0. R30.\nX1. Y1. Z1. A0. B0. C0.", Reason.UNKNOWN_FRAME),
        ("G92 X0. Y0. Z0.\nX1. Y1. Z1. A0. B0. C0.", Reason.UNKNOWN_FRAME),
        ("G52 X5.\nX1. Y1. Z1. A0. B0. C0.", Reason.UNKNOWN_FRAME),
        ("X#1 Y2. Z3.", Reason.EXPRESSION),
        ("X[#1+2.] Y2. Z3.", Reason.EXPRESSION),
        ("G81 X1. Y1. Z-5. R2.", Reason.EXPRESSION),
        ("G33 X1. Y1. Z1.", Reason.EXPRESSION),
        ("X10 Y1. Z1.", Reason.EXPRESSION),
        ("X10. U5.", Reason.EXTERNAL_AXIS),
        ("G65 P9000\nX1. Y1. Z1.", Reason.INCOMPLETE),
        ("M98 P9000\nX1. Y1. Z1.", Reason.INCOMPLETE),
        ("IF[#1EQ2]GOTO10\nX1. Y1. Z1.", Reason.INCOMPLETE),
        ("/X10.", Reason.INCOMPLETE),
    ],
)
def test_fanuc_words_that_are_not_followed(block: str, reason: Reason) -> None:
    program = fanuc(f"G1 X1. Y2. Z3. A0. B0. C0.\n{block}")
    kept = any("not compensated either: the next point" in note for note in program.notes)
    assert reasons(program) == [Reason.INCOMPLETE if kept else Reason.NONE, reason]
    assert any(":5" in note or ":6" in note for note in program.notes)


def test_nothing_is_kept_over_what_moves_the_tool() -> None:
    for block in ("G28 Z0.", "M6", "G53 Z100.", "G81 X1. Y1. Z-5. R2.\nG80 G1"):
        program = fanuc(f"G1 X1. Y2. Z3. A0. B0. C0.\n{block}\nX5.")
        assert reasons(program)[-1] == Reason.INCOMPLETE
    dwell = fanuc("G1 X1. Y2. Z3. A0. B0. C0.\nG4 X2.0\nX5.")
    assert reasons(dwell) == [Reason.NONE] * 2


def test_an_external_axis_stays_where_it_went() -> None:
    text = f"{FIRST}\nX2.0 E1=100.0\n{FIRST}"
    assert reasons(sinumerik(text)) == [Reason.NONE, Reason.EXTERNAL_AXIS, Reason.EXTERNAL_AXIS]
    at_rest = FrameTable(bases=TABLE.bases, orientation=RULE, external_axes_at_rest=True)
    assert reasons(sinumerik(text, at_rest)) == [Reason.NONE] * 3


def test_axis_targets_and_status() -> None:
    text = "TRAFOOF\nG1 JT1=10.0 JT2=-70.0 JT3=100.0 JT4=5.0 JT5=60.0 JT6=-20.0\n"
    text += "G1 JT1=10.0 JT2=-70.0 JT3=100.0 A=5.0 B=60.0 C=-20.0\nTRAORI\n"
    program = sinumerik(f"{text}PTP G1 X1.0 Y1.0 Z1.0 A=1.0 B=2.0 C=3.0 STAT=2 TU=17\nCP\n{FIRST}")
    assert reasons(program) == [Reason.JOINT_TARGET] * 2 + [Reason.NONE] * 2
    assert program.motion.tolist() == [Motion.PTP, Motion.PTP, Motion.PTP, Motion.LIN]
    np.testing.assert_allclose(program.axes[0] / DEG, [10, -70, 100, 5, 60, -20])
    np.testing.assert_allclose(program.axes[1], program.axes[0])
    assert program.words_of == "kuka"
    assert program.words[2].tolist() == [2, 17]


def test_comments_and_block_numbers() -> None:
    program = sinumerik(f'N9990 {FIRST} ; X9\nN10 X2.0;Y9\n; X7 Y7\nMSG("X1 (Y2)")\nN20 X3.0')
    np.testing.assert_allclose(program.position[:, 0] / MM, [1, 2, 3])
    program = fanuc("N9990 X1. Y2. Z3. A0. B0. C0. (X9.)\n(X5. (Y5.) Z5.)\nN10 X2.;\nX3.(A)Y4.")
    np.testing.assert_allclose(program.position[:, :2] / MM, [[1, 2], [2, 2], [3, 4]])


def test_refused() -> None:
    for data, line in ((b"\xff\xfeG\x001\x00", 1), (b"G1 X1\n\0", 2), (b"M30\n", 1)):
        with pytest.raises(FormatError) as refused:
            read("sinumerik", data)
        assert refused.value.line == line


def test_what_was_taken_for_granted_is_told() -> None:
    untold = read("sinumerik", f"TRAORI\n{FIRST}\n".encode())
    assert untold.notes == ("part.nc:1: the program states no unit: millimetres are assumed.",)
    tool = sinumerik(f"$TC_DP3[1,1]=215.5\n{FIRST}")
    assert tool.notes == ("part.nc:4: the program sets data of a tool; that of the cell is used.",)
    assert reasons(tool) == [Reason.NONE]


def test_one_way_of_moving_coordinates_does_not_end_another() -> None:
    for text in ("TRANS X5\nCYCLE800()", "CYCLE800(1)\nTRANS", "TRANS X5\nDIAMOF"):
        assert reasons(sinumerik(f"{text}\n{FIRST}")) == [Reason.UNKNOWN_FRAME]
    first = "G1 X1. Y2. Z3. A0. B0. C0."
    for text in ("G52 X5.\nG69", "G92 X0.\nG50", "G68 X0. Y0. R5.\nG15"):
        assert reasons(fanuc(f"{text}\n{first}")) == [Reason.UNKNOWN_FRAME]
    for text in ("G68 X0. Y0. R5.\nG69", "G51 X0. Y0. P2\nG50", "G16\nG15", "G51.1 X0.\nG50.1"):
        assert reasons(fanuc(f"{text}\n{first}")) == [Reason.NONE]


@pytest.mark.parametrize("shift", ["G52 X5.", "G52 X5. Y0. Z0.", "G92 X0.", "G51 X0. Y0. P2"])
def test_a_shift_may_be_in_force_where_a_jump_from_below_leads(shift: str) -> None:
    first = "G69\nG90 G17 G21 G40 G54 G43.4 H1 T1\nG1 X1. Y2. Z3. A0. B0. C0."
    text = "{0}\nN9 {0}\n{1}\nG90 G54\nG1 X2. Y2. Z3. A0. B0. C0.\nIF [#1 EQ 1] GOTO 9"
    assert reasons(fanuc(text.format(first, shift)))[:2] == [Reason.NONE, Reason.INCOMPLETE]
    assert reasons(fanuc(text.format(first, "G69")))[:2] == [Reason.NONE, Reason.NONE]


def test_a_program_that_says_all_again_behind_a_call_is_certain() -> None:
    again = "G90 G17 G21 G40 G54\nG69\nT1\nG43.4 H1"
    program = fanuc(f"M98 P100\n{again}\nG1 X1. Y2. Z3. A0. B0. C0.")
    assert reasons(program) == [Reason.NONE]
    assert reasons(fanuc("M98 P100\nG43.4 H1\nG1 X1. Y2. Z3. A0. B0. C0.")) == [Reason.INCOMPLETE]


def test_tool_point_control_of_haas() -> None:
    block = "X1. Y2. Z3. A0. B0. C0."
    program = fanuc(f"G234 H1 {block}\nG1 X2.\nG254\n{block}\nG255\n{block}\nG49\n{block}\n")
    assert reasons(program) == [
        *(Reason.NONE, Reason.NONE, Reason.UNKNOWN_FRAME, Reason.NONE, Reason.EXPRESSION),
    ]


def test_the_words_that_are_missing_are_named() -> None:
    program = sinumerik("TRAORI\nG1 X1.0 Y2.0 A=1.0 C=2.0\nZ1.0 A=1.0\nB=1.0\n")
    assert reasons(program) == [Reason.INCOMPLETE] * 2 + [Reason.NONE]
    assert any("Z, B: left out here" in note for note in program.notes)
    assert any(" B: left out here" in note for note in program.notes)


def test_a_tool_is_asked_for_by_the_name_it_has() -> None:
    program = sinumerik('T="BALL_6" D1\nG505\nG1 X1.0 Y2.0 Z1.0\n')
    assert any("add tool BALL_6 to the cell" in note for note in program.notes)
    assert any("add base G505 to the cell" in note for note in program.notes)
    named = FrameTable(bases=TABLE.bases, tools={"ball_6": np.eye(4)}, orientation=RULE)
    block = "G1 X1.0 Y2.0 Z1.0 A=0.0 B=0.0 C=0.0"
    assert reasons(sinumerik(f'T="BALL_6" D1\n{block}', named)) == [Reason.NONE]


@pytest.mark.parametrize(
    "head", [":0100", "O<PART-1>", "<PART>(made by hand)", "N3#100=5.", "N3/M1"]
)
def test_names_of_programs_variables_and_skipped_switches_change_nothing(head: str) -> None:
    program = fanuc(f"{head}\nG1 X1. Y2. Z3. A0. B0. C0.\nX2.")
    assert reasons(program) == [Reason.NONE] * 2
    assert not any("not understood" in note for note in program.notes)


@pytest.mark.parametrize(("stated", "known"), [("", False), ("increment", False), ("mm", True)])
def test_numbers_without_a_point_are_what_the_cell_says(stated: str, known: bool) -> None:
    text = "G1 X1. Y2. Z3. A1. B2. C3.\nX10\nX0"
    program = fanuc(text, replace(TABLE, units_without_point=stated))
    why = Reason.NONE if known else Reason.EXPRESSION
    assert reasons(program) == [Reason.NONE, why, Reason.NONE]
    assert any("units_without_point" in note for note in program.notes) != known
    np.testing.assert_allclose(program.position[1, 0], 0.01)


LOCAL = "G52 X100. Y0. Z-5.\nG1 X1. Y2. Z3. A1. B2. C3.\nX4.\n"
POINT = "G1 X1. Y2. Z3. A1. B2. C3."


def places(program: Program) -> list[float]:
    """x in base, mm; NaN where a point is not known."""
    x = program.T_base_frame[program.frame, 0, 3] + program.position[:, 0]
    return np.where(program.reason == Reason.NONE, x / MM, np.nan).round(6).tolist()


def test_a_local_zero_of_constants_moves_the_work_offset() -> None:
    table = replace(TABLE, bases={"G54": np.eye(4), "G55": np.eye(4)})
    assert places(fanuc(f"{LOCAL}G52 X0 Y0 Z0\n{POINT}", table)) == [101.0, 104.0, 1.0]
    assert places(fanuc(f"{LOCAL}G52 X7. Y0. Z0.\n{POINT}", table)) == [101.0, 104.0, 8.0]
    for odd in ("G55", "G54", "G52 X7.", "G52 X7 Y0 Z0", "M98 P7\nG90 G54 G43.4 G1 G17 G21"):
        found = places(fanuc(f"{LOCAL}{odd}\n{POINT}", table))
        assert found[:2] == [101.0, 104.0]
        assert np.isnan(found[2]), odd
    kept = fanuc(f"{LOCAL}G52 X7. Y0. Z0.\nX1. Y2. Z3.", table)
    assert places(kept) == [101.0, 104.0, 8.0]  # angles go on, places are stated anew
    np.testing.assert_array_equal(kept.rotation[2], kept.rotation[0])
    some = places(fanuc(f"{LOCAL}G52 X7. Y0. Z0.\nX1. Y2.", table))
    assert np.isnan(some[2])
    inches = fanuc(f"G20\n{LOCAL}", table)
    assert np.isnan(places(inches)).all()
    assert any("is not certainly in millimetres" in note for note in inches.notes)
