"""What is a target, how it is reached, in which frames, and why some are left alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from krl_samples import HEAD, body, changed_lines, job, read, replacement, write

from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.program.program import FrameTable, Motion, Program, Reason

P = "X 12.500,Y -0.375,Z -1.250,A 0.500,B 0.250,C 180.000"
Q = "X 45.000,Y 10.000,Z -1.250,A 2.000,B 0.750,C 179.000"


def reasons(program: Program) -> list[Reason]:
    return [Reason(value) for value in program.reason]


def motions(program: Program) -> list[Motion]:
    return [Motion(value) for value in program.motion]


def pose_of(x: float, y: float, z: float, a: float, b: float, c: float) -> np.ndarray:
    return pose_from_xyz_abc(np.array([x, y, z]) * MM, np.array([a, b, c]) * DEG)


def test_values_units_and_line() -> None:
    program = body(f"LIN {{{P}}}")
    np.testing.assert_allclose(program.position, [[0.0125, -0.000375, -0.00125]])
    np.testing.assert_allclose(program.rotation[0], pose_of(0, 0, 0, 0.5, 0.25, 180)[:3, :3])
    assert (program.line[0], program.reason[0]) == (4, Reason.NONE)
    np.testing.assert_allclose(
        program.T_base_frame[program.frame[0]], pose_of(800, -100, 450, 15, 0, 0)
    )
    np.testing.assert_allclose(
        program.T_flange_tool[program.tool[0]], pose_of(0, 0, 215.5, 0, 30, 0)
    )


def test_every_motion() -> None:
    program = body(
        f"ptp {{{P}}} C_PTP C_DIS\nLin {{E6POS: {P}}} C_VEL\n"
        f"CIRC {{{P}}},{{FRAME: {Q}}},CA 90 C_DIS\n"
        f"SPTP {{POS: {P}}}\nSPLINE WITH $VEL.CP=0.2\nSPL {{{P}}} C_SPL\n"
        f"SLIN {{{P}}} WITH $VEL.CP=0.1 C_DIS\n"
        f"SCIRC {{{P}}}, {{{Q}}}\nENDSPLINE\nPTP {{AXIS: A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}}\n"
        f"PTP $AXIS_ACT"
    )
    m = Motion
    assert motions(program) == [
        *(m.PTP, m.LIN, m.ARC_VIA, m.ARC_END, m.PTP, m.SPLINE, m.LIN, m.ARC_VIA, m.ARC_END, m.PTP)
    ]
    assert reasons(program) == [Reason.NONE] * 9 + [Reason.JOINT_TARGET]
    np.testing.assert_allclose(program.axes[-1] / DEG, [1, 2, 3, 4, 5, 6])
    assert np.isnan(program.position[-1]).all()


def test_comments_folds_and_strings_are_not_code() -> None:
    program = body(
        f";FOLD LIN P1 {{{Q}}}\n  ; LIN {{{Q}}}\n"
        f'Msg("LIN {{{Q}}} ; not {{")\n'
        f"LIN {{{P}}} ;{{ LIN {{{Q}}}\n;ENDFOLD"
    )
    assert len(program) == 1
    assert program.position[0, 0] == pytest.approx(0.0125)


def test_points_of_the_dat_take_frames_and_motion_of_the_src(tmp_path: Path) -> None:
    src = (
        "DEF part()\nFDAT_ACT=FP1\nBAS(#CP_PARAMS,0.2)\nLIN XP1 C_DIS\nPTP xp2\n"
        f"CIRC XP3,{{{Q}}}\nPTP XHOME\nEND\n"
    )
    dat = (
        f"&ACCESS RVP\nDEFDAT part PUBLIC\nDECL E6POS XP1={{{P},S 2,T 35,E1 0.0}}\n"
        'DECL FDAT FP1={TOOL_NO 3,BASE_NO 7,IPO_FRAME #BASE,POINT2[] " "}\n'
        f"DECL GLOBAL E6POS XP2={{{Q}}}\nDECL POS XP3={{{P}}}\nDECL FRAME XP4={{{P}}}\n"
        "DECL E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nENDDAT\n"
    )
    base, tool = pose_of(1, 2, 3, 0, 0, 0), pose_of(0, 0, 9, 0, 0, 0)
    source, points = job(tmp_path, src, dat, FrameTable(bases={"7": base}, tools={"3": tool}))
    m = Motion
    assert motions(points) == [m.LIN, m.PTP, m.ARC_VIA, m.UNUSED, m.PTP]
    assert reasons(points)[:3] == [Reason.NONE] * 3
    assert reasons(points)[3:] == [Reason.UNUSED, Reason.JOINT_TARGET]
    assert points.words[0].tolist() == [2, 35]
    np.testing.assert_allclose(points.T_base_frame[points.frame[0]], base)
    np.testing.assert_allclose(points.T_flange_tool[points.tool[2]], tool)
    assert motions(source) == [m.ARC_END]
    assert len(changed_lines(points, replacement(points, by_mm=(0.1, 0, 0)))) == 3


def test_a_dat_alone_is_read_with_its_inline_frames() -> None:
    dat = (
        f"DEFDAT part\nDECL E6POS XP1={{{P}}}\n"
        f"DECL FDAT FP1={{TOOL_NO 0,BASE_NO 4,IPO_FRAME #BASE}}\n"
        f"DECL E6POS other={{{P}}}\nENDDAT\n"
    )
    program = read(dat, name="part.dat")
    assert motions(program) == [Motion.LIN, Motion.LIN]
    assert reasons(program) == [Reason.UNKNOWN_FRAME, Reason.NONE]
    assert any("without the .src" in note for note in program.notes)
    known = read(dat, FrameTable(bases={"4": np.eye(4)}), name="part.dat")
    assert reasons(known)[0] is Reason.NONE


def test_arrays_and_structures() -> None:
    program = body(
        f"gf[1  ]={{{P}}}\ngf[ 2]={{FRAME: {Q}}}\ngs[1] = {{fCnC {{{P}}}, grFeedrate 3000}}\n"
        f"gs[2]={{fCNC {{{Q}}},grFeedrate 100,fOther {{{Q}}}}}\nFOR i=1 TO 2\nLIN gf[i] C_VEL\n"
        "$VEL.CP=gs[i].grFeedrate/60000\nLIN gs[i].fCnc C_DIS\nENDFOR"
    )
    assert reasons(program) == [*[Reason.NONE] * 4, Reason.UNUSED]
    lines = changed_lines(program, replacement(program, by_mm=(0.1, 0, 0)))
    assert lines[0] == f"gf[1  ]={{{P.replace('12.5', '12.6')}}}"
    assert lines[2].endswith("C 180.000}, grFeedrate 3000}")
    assert len(lines) == 4
    assert lines[3].endswith(f"fOther {{{Q}}}}}")


def test_one_element_of_an_array() -> None:
    program = body(
        f"gf[1]={{{P}}}\ngf[2]={{{Q}}}\nPTP gf[2]\ncpos = {{POS: {P}}}\nPTP cpos\n"
        f"cpos={{{Q}}}\nLIN cpos"
    )
    m = Motion
    assert motions(program) == [m.UNUSED, m.PTP, m.PTP, m.LIN]


@pytest.mark.parametrize(
    "line",
    [
        "move(p)",
        "LIN q:p",
        "IF p.X > 5 THEN",
        "r = p\nLIN r:q",
        "r = p\nmove(r)",
        "LIN p:{X 1,Y 2,Z 3,A 0,B 0,C x1}",
        "PTP {X p.x,Y 0,Z 0,A 0,B 0,C q.c}",
        "p={X 1,Y 2,Z q.z,A 0,B 0,C 0}\nr = p\nLIN r",
    ],
)
def test_a_point_in_an_expression_is_never_compensated(line: str) -> None:
    program = body(f"p={{{P}}}\nq2={{{Q}}}\nLIN p\nLIN q2\n{line}")
    assert program.reason[0] == Reason.EXPRESSION
    kept = program.data.split(b"\n")[3]
    assert kept in write(program, replacement(program, by_mm=(1, 1, 1))).encode().split(b"\n")


def test_targets_with_computed_components_are_flagged_and_kept() -> None:
    program = body(
        f"LIN {{X 5+3,Y 2,Z 3,A 0,B 0,C 0}}\nLIN {{X x1,Y 2,Z 3,A 0,B 0,C 0}}\nLIN {{{P}}}:{{{Q}}}"
    )
    assert reasons(program) == [Reason.NONE, Reason.EXPRESSION, Reason.NONE]
    np.testing.assert_allclose(program.position[0] / MM, [8, 2, 3])
    lines = changed_lines(program, replacement(program, by_mm=(1, 1, 1)))
    assert lines[0] == "LIN {X 9.0000,Y 3.0000,Z 4.0000,A 0.000000,B 0.000000,C 0.000000}"
    assert len(lines) == 2  # the line with x1 keeps every byte
    assert write(program, replacement(program, rows=[])).encode() == program.data


def test_relative_motions() -> None:
    program = body(
        f"LIN {{{P}}}\nLIN_REL {{X 5}} C_DIS\nPTP_REL {{A1 5}}\nSLIN_REL {{Z 5}}\nLIN {{X 5}}"
    )
    assert reasons(program) == [Reason.NONE, *[Reason.RELATIVE] * 3, Reason.INCOMPLETE]


@pytest.mark.parametrize(
    "between",
    [
        "LABEL:",
        "FOR i=1 TO 3",
        "IF $IN[1] THEN",
        "sub(1)",
        "PTP {A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}",
        "LIN nowhere",
        "$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}",
        "PTP $POS_ACT",
    ],
)
def test_components_are_not_inherited_across_what_may_move_the_robot(between: str) -> None:
    program = body(f"LIN {{{P}}}\n{between}\nLIN {{X 20.0}}")
    assert program.reason[-1] == Reason.INCOMPLETE
    assert any("leave components out" in note for note in program.notes)
    assert np.isnan(program.position[-1]).all()


def test_both_points_of_an_arc_share_their_fate() -> None:
    program = body(
        f"LIN {{{P}}}\nCIRC {{X x1,Y 1,Z 1}},{{{Q}}}\np={{{P}}}\nq={{{Q}}}\nq.X=x1\nCIRC p,q"
    )
    assert reasons(program) == [Reason.NONE, *[Reason.EXPRESSION] * 4]


def test_external_axes() -> None:
    text = f"LIN {{{P},E1 0.000,E2 0.0}}\nLIN {{{Q},E1 850.000,E2 0.0}}"
    program = body(text)
    assert reasons(program) == [Reason.NONE, Reason.EXTERNAL_AXIS]
    assert "external axis E1 is 0 to 850" in program.notes[0]
    moving = body(text, FrameTable(external_axes_at_rest=True))
    assert reasons(moving)[1] is Reason.EXTERNAL_AXIS
    still = body(text.replace("E1 0.000", "E1 850.0"), FrameTable(external_axes_at_rest=True))
    assert reasons(still) == [Reason.NONE] * 2
    lines = changed_lines(still, replacement(still, by_mm=(0.1, 0, 0)))
    assert lines[1].endswith("C 179.000,E1 850.000,E2 0.0}")


BASE7, TOOL3 = pose_of(7, 0, 0, 0, 0, 0), pose_of(0, 0, 3, 0, 0, 0)
TABLE = FrameTable(
    bases={"7": BASE7, "Fixture": BASE7},
    tools={"3": TOOL3},
    T_base_frame=pose_of(99, 0, 0, 0, 0, 0),
    T_flange_tool=pose_of(0, 98, 0, 0, 0, 0),
)


@pytest.mark.parametrize(
    ("line", "x_mm"),
    [
        ("", 99.0),
        ("$BASE=BASE_DATA[7]", 7.0),
        ("$base = base_data[ 7 ]", 7.0),
        ("$BASE=BASE_DATA[7]:{X 5,Y 0,Z 0,A 0,B 0,C 0}", 12.0),
        ("BAS (#BASE, 7 )", 7.0),
        ("BAS(#BASE,0)", 0.0),
        ("$BASE=$NULLFRAME", 0.0),
        ("$BASE=fixture", 7.0),
        ("here={FRAME: X 5,Y 0,Z 0,A 0,B 0,C 0}\n$BASE=here", 5.0),
        ("BASE_DATA[7]={FRAME: X 6,Y 0,Z 0,A 0,B 0,C 0}\nBAS(#BASE,7)", 6.0),
        ("FDAT_ACT={TOOL_NO 3,BASE_NO 7,IPO_FRAME #BASE}\nBAS(#FRAMES)", 7.0),
        ("FDAT_ACT={TOOL_NO 3,BASE_NO 7,IPO_FRAME #BASE}\nBAS(#PTP_DAT)", 99.0),
        ("BAS(#INITMOV,0)", 99.0),
        ("IF $IN[1] THEN\n$BASE=fixture\nELSE\nBAS(#BASE,7)\nENDIF", 7.0),
        ("SPLINE WITH $BASE=fixture\nENDSPLINE", 99.0),
    ],
)
def test_the_base_in_force(line: str, x_mm: float) -> None:
    program = read(f"DEF part()\n{line}\nLIN {{{P}}}\nEND\n", TABLE)
    assert program.reason[-1] == Reason.NONE
    assert program.T_base_frame[program.frame[-1]][0, 3] / MM == pytest.approx(x_mm)


def test_with_clause_holds_for_its_motion_only() -> None:
    program = read(
        f"DEF part()\nSLIN {{{P}}} WITH $BASE=BASE_DATA[7], $VEL.CP=1\nSLIN {{{P}}}\nEND", TABLE
    )
    assert [program.T_base_frame[i][0, 3] / MM for i in program.frame] == pytest.approx([7, 99])


@pytest.mark.parametrize(
    ("line", "cure"),
    [
        (
            "BAS(#BASE,5)",
            "part.src:2: the base number 5 is stored in the controller .* add base 5 to",
        ),
        ("$TOOL=TOOL_DATA[9]", "part.src:2: the tool number 9 .* add tool 9 to the cell"),
        ("BAS(#TOOL,n)", "the tool number n is computed"),
        ("$BASE.X=5", "the base is changed by a single component"),
        ("$BASE={X 5}", "the base leaves components out"),
        ("$BASE=BASE_DATA[8]:{X 5,Y 0,Z 0,A 0,B 0,C 0}", "the base is 'BASE_DATA"),
        ("$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}:here", "the base is"),
        ("FDAT_ACT=FP9\nBAS(#FRAMES)", "number . is computed"),
        ("BAS(#EX_BASE,1)", "follows an external axis"),
        ("IF $IN[1] THEN\n$BASE=fixture\nENDIF", "depends on which branch ran"),
        ("SWITCH n\nCASE 1\nBAS(#BASE,7)\nCASE 2\nBAS(#BASE,0)\nENDSWITCH", "depends on which"),
    ],
)
def test_a_frame_that_is_not_known(line: str, cure: str) -> None:
    program = read(f"DEF part()\n{line}\nLIN {{{P}}}\nEND\n", TABLE)
    assert program.reason[-1] == Reason.UNKNOWN_FRAME
    assert any(re.search(cure, note) for note in program.notes), program.notes


def test_a_loop_that_changes_its_own_frame() -> None:
    program = read(
        f"DEF part()\nBAS(#BASE,0)\nLOOP\nLIN {{{P}}}\nBAS(#BASE,7)\nLIN {{{P}}}\nENDLOOP\nEND\n",
        TABLE,
    )
    assert reasons(program) == [Reason.UNKNOWN_FRAME, Reason.NONE]


def test_a_subprogram_starts_in_the_frames_of_its_calls() -> None:
    sub = f"DEF sub()\nLIN {{{P}}}\nEND\n"
    one = read(f"DEF part()\nBAS(#BASE,7)\nsub()\nsub ( )\nEND\n{sub}", TABLE)
    assert one.T_base_frame[one.frame[0]][0, 3] / MM == pytest.approx(7)
    two = read(f"DEF part()\nsub()\nBAS(#BASE,7)\nsub()\nEND\n{sub}", TABLE)
    assert reasons(two) == [Reason.UNKNOWN_FRAME]


def test_a_point_used_in_two_frames() -> None:
    program = read(f"DEF part()\np={{{P}}}\nLIN p\nBAS(#BASE,7)\nLIN p\nEND\n", TABLE)
    assert reasons(program) == [Reason.UNKNOWN_FRAME]
    assert "more than one base or tool" in program.notes[0]


@pytest.mark.parametrize(
    "line", ["$IPO_MODE=#TCP", "FDAT_ACT={TOOL_NO 3,BASE_NO 7,IPO_FRAME #TCP}\nBAS(#CP_PARAMS,1)"]
)
def test_workpiece_on_the_robot(line: str) -> None:
    program = read(f"DEF part()\n{line}\nLIN {{{P}}}\n$IPO_MODE=#BASE\nLIN {{{P}}}\nEND\n", TABLE)
    assert reasons(program) == [Reason.TOOL_ON_FLOOR, Reason.NONE]


def test_a_point_no_file_holds_is_named() -> None:
    program = read(HEAD + "LIN XP7\nLIN XP7\nEND\n")
    assert program.notes == (
        "part.src:4: XP7 is computed, or no file of this program gives it a value; it is not "
        "compensated (if it is in a .dat file, give that, too).",
    )


def test_an_arc_with_one_point_is_not_compensated() -> None:
    via = "CIRC {X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0}"
    program = read(HEAD + f"{via} {via[5:]} C_DIS\n{via}\n{via},{via[5:]}\nEND\n")
    assert reasons(program) == [Reason.INCOMPLETE] * 2 + [Reason.NONE] * 2
    assert any("part.src:4: CIRC with one point" in note for note in program.notes)


def test_a_turn_beyond_any_number_of_bits_is_no_word() -> None:
    program = body("PTP {X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 1E38}\n")
    assert program.words.tolist() == [[2, NO_WORD]]
