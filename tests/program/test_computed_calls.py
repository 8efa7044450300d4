"""Moves to computed targets become calls: which of them, the text, and every other byte kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotrue.program.computed_calls import ComputedCall, list_calls, put_calls
from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable, Program, Reason

KRL = r"""&ACCESS RVP
DEF pick()
DECL FRAME XOFF
DECL E6POS XQ,XARRAY[4]
DECL POS XPOS
INT I
$BASE={X 900,Y -200,Z 300,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
LIN {X 300.0,Y 200.0,Z 600.0,A 0,B 120,C 0}
LIN XP1 C_DIS
CAMERA(XQ,XOFF,XPOS)
LIN XQ C_DIS C_ORI
LIN XP1:XOFF ; a comment, kept
LIN  XOFF:XQ
SLIN XQ WITH $VEL.CP=0.2 C_DIS
LIN XARRAY[I]
LIN XOFF
LIN XPOS
PTP XQ
PTP XOFF C_PTP
LIN UNTOLD
LIN_REL {Z 10.0}
CIRC XQ,XP1
END
"""
DATA = r"""DEFDAT pick PUBLIC
DECL E6POS XP1={X 300.0,Y 100.0,Z 600.0,A 0.0,B 120.0,C 0.0,S 2,T 35,E1 0.0}
DECL E6POS XP2={X 310.0,Y 110.0,Z 600.0,A 0.0,B 120.0,C 0.0,S 2,T 35,E1 0.0}
ENDDAT
"""
RAPID = r"""MODULE place
  PERS tooldata tool1:=[TRUE,[[60,40,250],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata w1:=[FALSE,TRUE,"",[[900,-200,300],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p10:=[[300,100,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p20:=[[310,100,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR robtarget seen;
  VAR num dx;
  PROC main()
    MoveL p10,v100,fine,tool1\WObj:=w1;
    MoveL seen,v100,z1,tool1\WObj:=w1;
    MoveL Offs(p20,dx,0,0),v100\V:=50,
      z1,tool1 \WObj:=w1; ! kept
    MoveJ seen,v100,z1,tool1\WObj:=w1;
    MoveL \Conc, seen, v100, z1, tool1;
    ! MoveL seen,v100,z1,tool1;
  ENDPROC
ENDMODULE
"""


def job(folder: Path, **files: str) -> tuple[Program, ...]:
    paths = []
    for name, text in files.items():
        path = folder / name.replace("_", ".")
        path.write_bytes(text.replace("\n", "\r\n").encode("latin-1"))
        paths.append(path)
    return read_job(paths, FrameTable())


def after(calls: tuple[ComputedCall, ...]) -> dict[int, str]:
    return {call.line: call.after for call in calls if not call.why}


def test_krl_calls_take_the_function_of_the_type(tmp_path: Path) -> None:
    programs = job(tmp_path, pick_src=KRL, pick_dat=DATA)
    calls = list_calls(programs, "rt_fix")
    assert after(calls) == {
        12: "LIN RT_FIX(XQ)",
        13: "LIN RT_FIX_F(XP1:XOFF)",
        14: "LIN RT_FIX(XOFF:XQ)",
        15: "SLIN RT_FIX(XQ)",
        16: "LIN RT_FIX(XARRAY[I])",
        17: "LIN RT_FIX_F(XOFF)",
        18: "LIN RT_FIX_P(XPOS)",
        20: "PTP RT_FIX_F(XOFF)",
    }
    looked = {call.line: (call.after, call.why) for call in calls if call.why}
    assert looked[19][0] == "PTP RT_FIX(XQ)"
    assert "S and T of the target are kept" in looked[19][1]
    assert looked[21][0] == ""
    assert "the type of UNTOLD is not declared" in looked[21][1]
    assert set(looked) == {19, 21}


def test_rapid_calls_hand_over_work_object_and_tool(tmp_path: Path) -> None:
    calls = list_calls(job(tmp_path, place_mod=RAPID), "RtFix")
    assert after(calls) == {
        10: r"MoveL RtFix(seen\WObj:=w1\Tool:=tool1),v100,z1,tool1\WObj:=w1;",
        11: r"MoveL RtFix(Offs(p20,dx,0,0)\WObj:=w1\Tool:=tool1),v100\V:=50, z1,tool1 \WObj:=w1;",
        14: r"MoveL \Conc, RtFix(seen\WObj:=wobj0\Tool:=tool1), v100, z1, tool1;",
    }
    (joint,) = [call for call in calls if call.why]
    assert (joint.line, "confdata" in joint.why) == (13, True)


@pytest.mark.parametrize(
    ("files", "name"),
    [({"pick_src": KRL, "pick_dat": DATA}, "rt_fix"), ({"place_mod": RAPID}, "RtFix")],
)
def test_all_other_bytes_stay_and_taking_the_calls_out_gives_the_file_back(
    tmp_path: Path, files: dict[str, str], name: str
) -> None:
    programs = job(tmp_path, **files)
    calls = list_calls(programs, name)
    for program in programs:
        data = put_calls(program, calls)
        mine = [call for call in calls if call.file == program.name and not call.why]
        assert (data == program.data) == (not mine)
        for call in reversed(mine):
            start, end = call.place
            target = program.data[start:end]
            assert target.decode() in call.call
            at = data.rindex(call.call.encode())
            data = data[:at] + target + data[at + len(call.call) :]
        assert data == program.data
        assert put_calls(program, ()) == program.data


def test_a_second_time_finds_nothing_more_to_put_in(tmp_path: Path) -> None:
    for files, name in (
        ({"pick_src": KRL, "pick_dat": DATA}, "rt_fix"),
        ({"place_mod": RAPID}, "RtFix"),
    ):
        programs = job(tmp_path, **files)
        calls = list_calls(programs, name)
        for program in programs:
            (tmp_path / program.name).write_bytes(put_calls(program, calls))
        again = read_job([tmp_path / program.name for program in programs], FrameTable())
        assert after(list_calls(again, name)) == {}


def test_a_stored_point_that_a_call_takes_is_not_compensated_as_well(tmp_path: Path) -> None:
    """Else it would be corrected twice: once in its numbers, once by the function."""
    source = KRL.replace("LIN XARRAY[I]", "LIN RT_FIX(XP2)\nLIN XP2")
    function = "DEFFCT E6POS RT_FIX(PIN:IN)\nDECL E6POS PIN\nRETURN PIN\nENDFCT\n"
    for more in ({}, {"rt.fix_src": function}):
        programs = job(tmp_path, pick_src=source, pick_dat=DATA, **more)
        points = next(program for program in programs if program.name == "pick.dat")
        assert (points.reason == Reason.EXPRESSION).all()
    module = RAPID.replace("MoveJ seen", r"MoveL RtFix(p10\WObj:=w1)")
    (program,) = job(tmp_path, place_mod=module)
    assert program.reason[program.line == 4].tolist() == [Reason.EXPRESSION]
