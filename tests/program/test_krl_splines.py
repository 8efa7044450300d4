"""KRL of KSS 8: spline blocks, WITH clauses, inline forms, based integers."""

from __future__ import annotations

import numpy as np
import pytest
from krl_samples import body, changed_lines, job, read, replacement, write

from robotrue.core.arm_words import NO_WORD
from robotrue.core.units import MM
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.program import FrameTable, Motion, Reason, Replacement

P = "X 800.0,Y 100.0,Z 600.0,A 10.0,B 20.0,C 170.0"
Q = "X 810.0,Y 110.0,Z 610.0,A 11.0,B 21.0,C 171.0"
WITH = (
    "WITH $VEL=SVEL_CP(0.008,,LCPDAT1), $TOOL=STOOL2(FP{n}), "
    "$BASE={base}, $IPO_MODE=SIPO_MODE(FP{n}.IPO_FRAME), $LOAD=SLOAD(FP{n}.TOOL_NO), "
    "$ACC=SACC_CP(LCPDAT1), $APO=SAPO(LCPDAT1), $ORI_TYPE=SORI_TYP(LCPDAT1), "
    "$JERK=SJERK(LCPDAT1) C_SPL"
)
FIXED = "SBASE(FP{n}.BASE_NO)"
CARRIED = "EK(K_ROOT(FP{n}.BASE_NO),K_TYPE(FP{n}.BASE_NO),K_OFFS(FP{n}.BASE_NO))"
DAT = (
    "DEFDAT part\nDECL E6POS XP1={" + P + ",S'B010',T'B110101',E1 90.0}\n"
    "DECL E6POS XP2={" + Q + ",S 'H2',T 'h1F',E1 90.0}\n"
    'DECL FDAT FP1={TOOL_NO 3,BASE_NO 7,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}\n'
    'DECL FDAT FP2={TOOL_NO 3,BASE_NO 7,IPO_FRAME #TCP,POINT2[] " ",TQ_STATE FALSE}\n'
    "DECL LDAT LCPDAT1={VEL 2.0,ACC 100.0}\nENDDAT\n"
)


def shift(x: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3], T[2, 3] = x * MM, z * MM
    return T


TABLE = FrameTable(bases={"7": shift(7, 0)}, tools={"3": shift(0, 3)}, external_axes_at_rest=True)


def test_inline_forms_of_spline_motions(tmp_path) -> None:
    forms = [WITH.format(n=n, base=FIXED.format(n=n)) for n in (1, 2)]
    src = f"DEF part()\nSLIN XP1 {forms[0]}\nSPTP XP1 {forms[0]}\nSLIN XP2 {forms[1]}\nEND\n"
    (points,) = [p for p in job(tmp_path, src, DAT, TABLE) if len(p)]
    assert points.reason.tolist() == [Reason.NONE, Reason.TOOL_ON_FLOOR]
    assert points.T_base_frame[points.frame[0]][0, 3] == pytest.approx(7 * MM)
    assert points.T_flange_tool[points.tool[0]][2, 3] == pytest.approx(3 * MM)
    assert not any("not in these files" in note for note in points.notes)


def test_a_base_on_an_external_system(tmp_path) -> None:
    src = f"DEF part()\nSLIN XP1 {WITH.format(n=1, base=CARRIED.format(n=1))}\nEND\n"
    (lost,) = [p for p in job(tmp_path, src, DAT, TABLE) if len(p)]
    assert lost.reason[0] == Reason.UNKNOWN_FRAME
    assert any("number 7 follows an external axis" in note for note in lost.notes)
    axis = ExternalAxis(
        number=1, direction=np.array([0.0, 0.0, 1.0]), point=np.zeros(3), frames=("7",)
    )
    told = FrameTable(bases=TABLE.bases, tools=TABLE.tools, external=(axis,))
    (known,) = [p for p in job(tmp_path, src, DAT, told) if len(p)]
    assert known.reason[0] == Reason.NONE
    np.testing.assert_allclose(
        known.T_base_frame[known.frame[0]][:3, 3], [0.0, 7 * MM, 0.0], atol=1e-12
    )


@pytest.mark.parametrize(
    ("text", "known"),
    [
        ("$BASE=EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,BASE_DATA[7])", True),
        (
            "$BASE=EK(MACHINE_DEF[2].ROOT,#EASYS,BASE_DATA[7]:{X 0.0,Y 14.9,Z 0.0,A 0,B 0,C 0})",
            False,
        ),
        ("BAS(#EX_BASE,7)", True),
        ("BAS(#EX_BASE,8)", False),
        ("FDAT_ACT={TOOL_NO 3,BASE_NO 7,IPO_FRAME #BASE}\nBAS(#CP_PARAMS,1)", True),
        ("BAS(#BASE,7)", False),
        ("$BASE=BASE_DATA[7]", False),
    ],
)
def test_ways_to_name_an_external_system(text: str, known: bool) -> None:
    axis = ExternalAxis(number=1, direction=np.array([1.0, 0.0, 0.0]), frames=("7",))
    told = FrameTable(bases=TABLE.bases, tools=TABLE.tools, external=(axis,))
    program = read(f"DEF part()\n{text}\nLIN {{{P},E1 5.0}}\nEND\n", told)
    assert program.reason[0] == (Reason.NONE if known else Reason.UNKNOWN_FRAME)
    if known:
        assert program.T_base_frame[program.frame[0]][0, 3] == pytest.approx(12 * MM)


def test_a_spline_block_with_its_own_frames() -> None:
    text = (
        f"SPLINE WITH $BASE={{X 5,Y 0,Z 0,A 0,B 0,C 0}}, $TOOL={{X 0,Y 0,Z 9,A 0,B 0,C 0}}\n"
        f"SPL {{{P}}}\nTIME_BLOCK START\nSLIN {{{Q}}} WITH $VEL.CP=0.3\n"
        f"SCIRC {{{P}}},{{{Q}}} WITH $BASE={{X 6,Y 0,Z 0,A 0,B 0,C 0}}\nSPL {{{Q}}}\n"
        f"TIME_BLOCK PART = 100\nENDSPLINE C_SPL\nSLIN {{{P}}} C_DIS"
    )
    program = body(text)
    assert program.motion.tolist() == [
        Motion.SPLINE, Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.SPLINE, Motion.LIN
    ]  # fmt: skip
    x = program.T_base_frame[program.frame][:, 0, 3] / MM
    assert x.tolist() == pytest.approx([5, 5, 6, 6, 5, 800])
    z = program.T_flange_tool[program.tool][:, 2, 3] / MM
    assert z.tolist() == pytest.approx([9, 9, 9, 9, 9, 215.5])
    lines = changed_lines(program, replacement(program, by_mm=(0.1, 0, 0)))
    assert lines[0] == "SPL {X 800.1000,Y 100.0,Z 600.0,A 10.0,B 20.0,C 170.0}"
    assert lines[1].endswith("C 171.0} WITH $VEL.CP=0.3")
    assert write(program, replacement(program, rows=[])) == program.data.decode()


def test_based_integers_keep_their_base(tmp_path) -> None:
    src = "DEF part()\nBAS(#TOOL,3)\nBAS(#BASE,7)\nPTP XP1\nPTP XP2\nEND\n"
    (points,) = [p for p in job(tmp_path, src, DAT, TABLE) if len(p)]
    assert points.words.tolist() == [[2, 53], [2, 31]]
    change = Replacement(
        changed=np.ones(2, np.bool_),
        position=points.position,
        rotation=points.rotation,
        axes=points.axes,
        words=np.array([[6, 35], [NO_WORD, 32]]),
    )
    lines = changed_lines(points, change)
    assert "S'B110',T'B100011',E1" in lines[0]
    assert "S 'H2',T 'h20',E1" in lines[1]


RAIL = ExternalAxis(number=1, direction=np.array([1.0, 0.0, 0.0]), carries_robot=True)


def test_an_external_axis_left_out_stays_where_it_is() -> None:
    text = f"PTP {{A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 200.0}}\nLIN {{{P}}}\nLIN {{{Q},E1 300.0}}"
    more = f"CIRC {{{P}}},{{{Q}}}\nLIN {{{P}}}\nother()\nLIN {{{Q}}}"
    program = body(f"{text}\n{more}", FrameTable(external=(RAIL,)))
    assert program.reason.tolist() == [Reason.JOINT_TARGET, *[0] * 5, Reason.EXTERNAL_AXIS]
    x = program.T_base_frame[program.frame][1:6, 0, 3] / MM
    assert x.tolist() == pytest.approx([600, 500, 500, 500, 500])
    unsaid = body(f"{text}\n{more}")
    assert unsaid.reason.tolist() == [Reason.EXTERNAL_AXIS] * 7
    twice = body(f"p={{{P}}}\nLIN {{{Q},E1 5.0}}\nLIN p\nLIN p", FrameTable(external=(RAIL,)))
    assert twice.reason.tolist() == [Reason.EXTERNAL_AXIS, 0]
