"""Frames from files that controllers save."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.controller_files import ControllerFile
from robotrue.program.formats import read_job
from robotrue.program.frames_beside import read_controller_file
from robotrue.program.program import FrameTable, Reason

CONFIG = """&ACCESS RV1
&REL 3
DEFDAT  $CONFIG
BOOL B_IN=FALSE
DECL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}
BASE_DATA[1]={X 1000.0,Y -20.5,Z 300.0,A 10.0,B 20.0,C -30.0}
BASE_DATA[17]={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
BASE_NAME[1,]="fixture"
DECL FRAME TOOL_DATA[02]={X 0.0,Y 0.0,Z 215.5,A 0.0,B 9.0E01,C 0.0}
;TOOL_DATA[3]={X 9.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
MACHINE_FRAME_DAT[1]={MACH_DEF_INDEX 0,PARENT[] " ",GEOMETRY[] " "}
MACHINE_FRAME_DAT[17]={MACH_DEF_INDEX 2,PARENT[] "DKP_400_01",GEOMETRY[] " "}
ENDDAT
"""
TOOLS = (
    "//TOOL 0\n///NAME\n0.000,0.000,0.000,0.00,0.00,0.00\n0.000,0.000,0.001\n0.001\n"
    "0.000,0.000,0.000\n0.000,0,1\n//TOOL 12\n///NAME spindle\n"
    "1.000,2.000,3.000,10.00,20.00,30.00\n0.000,0.000,0.001\n"
)
USER = (
    "//UFRAME 1\n///NAME\n///TOOL 0\n///GROUP 1,0,0\n///PULSE\n////RORG C000=0,0,0,0,0,0\n"
    "////RXX C001=0,0,0,0,0,0\n////RXY C002=0,0,0,0,0,0\n"
    "////BUSER 900.000,-200.000,300.000,8.0000,-4.0000,15.0000\n"
    "//UFRAME 2\n///NAME on another\n///TOOL 0\n///BASICFRM 0,19,1\n"
    "////BUSER 1.000,0.000,0.000,0.0000,0.0000,0.0000\n"
)
FRAMES = """[*SYSTEM*]$MNUFRAME  Storage: SHADOW  Access: RW  : ARRAY[2,9] OF POSITION
    [1,1] =
  Group: 1   Config: N D B, 0, 0, 0
  X:   900.000   Y:  -200.000   Z:   300.000
  W:     8.000   P:    -4.000   R:    15.000
    [2,1] =
  Group: 2   Config: N D B, 0, 0, 0
  X:     5.000   Y:     0.000   Z:     0.000
  W:     0.000   P:     0.000   R:     0.000
[*SYSTEM*]$MNUFRAMENUM  Storage: SHADOW  Access: RW  : ARRAY[2] OF BYTE
    [1] = 1
[*SYSTEM*]$MNUTOOL  Storage: SHADOW  Access: RW  : ARRAY[1,10] OF POSITION
    [1,10] = ''
  Group: 1   Config: N D B, 0, 0, 0
  X:     0.000   Y:     0.000   Z:   150.500
  W:     0.000   P:    90.000   R:     0.000
"""
FIXTURE = pose_from_xyz_abc(np.array([900, -200, 300]) * MM, np.array([15, -4, 8]) * DEG)


def found(name: str, text: str) -> ControllerFile:
    for ends in ("\n", "\r\n"):
        out = read_controller_file(name, text.replace("\n", ends).encode())
        assert out is not None
    return out


def test_kuka_config() -> None:
    got = found("$config.dat", CONFIG)
    assert set(got.bases) == {"1"}
    assert set(got.tools) == {"2"}
    expected = pose_from_xyz_abc(np.array([1000, -20.5, 300]) * MM, np.array([10, 20, -30]) * DEG)
    np.testing.assert_allclose(got.bases["1"], expected, atol=1e-15)
    assert got.tools["2"][2, 3] == pytest.approx(0.2155)
    assert len(got.notes) == 1
    assert "base 17 is on machine 2" in got.notes[0]


def test_yaskawa_tools_and_user_frames() -> None:
    got = found("TOOL.CND", TOOLS)
    assert set(got.tools) == {"0", "12"}
    assert not got.bases
    expected = pose_from_xyz_abc(np.array([1, 2, 3]) * MM, np.array([30, 20, 10]) * DEG)
    np.testing.assert_allclose(got.tools["12"], expected, atol=1e-15)
    got = found("UFRAME.CND", USER)
    assert set(got.bases) == {"1"}
    assert not got.tools
    np.testing.assert_allclose(got.bases["1"], FIXTURE, atol=1e-15)
    assert len(got.notes) == 1
    assert "user frame 2 is given in another frame" in got.notes[0]


def test_fanuc_frames_of_group_one() -> None:
    got = found("SYSFRAME.VA", FRAMES)
    assert set(got.bases) == {"1"}
    assert set(got.tools) == {"10"}
    np.testing.assert_allclose(got.bases["1"], FIXTURE, atol=1e-15)
    assert got.tools["10"][2, 3] == pytest.approx(0.1505)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "$config.dat",
            CONFIG.replace("A 10.0,", ""),
            r"config.dat:6: BASE_DATA\[1\] has not six finite",
        ),
        ("TOOL.CND", TOOLS.replace("2.000,3", "x,3"), r"TOOL.CND:10: //TOOL 12 has not six finite"),
        ("F.VA", FRAMES.replace("Group: 1", "Group: 3"), r"F.VA:1: no position of group 1"),
        ("F.VA", FRAMES.replace("150.500", "1E999"), r"F.VA:1[0-9]: \$MNUTOOL\[1,10\] has not six"),
        ("$config.dat", CONFIG.replace("10.0,B", "1E999,B"), r"config.dat:6: BASE_DATA\[1\] has"),
        ("TOOL.CND", TOOLS.replace("2.000,3", "1e999,3"), r"TOOL.CND:10: //TOOL 12 has not six"),
    ],
)
def test_what_cannot_be_read_is_named(name: str, text: str, said: str) -> None:
    with pytest.raises(FormatError, match=said):
        read_controller_file(name, text.encode())


def test_other_files_are_not_of_a_controller() -> None:
    assert read_controller_file("part.src", b"DEF part()\nBASE_DATA[1]={X 1}\nEND\n") is None


JOB = (
    "/JOB\n//NAME A\n//POS\n///NPOS 1,0,0,0,0,0\n///USER 1\n///TOOL 12\n///POSTYPE USER\n"
    "///RECTAN\n"
    "C00000=0.000,0.000,0.000,180.0000,0.0000,0.0000\n//INST\nNOP\nMOVL C00000 V=20.0\nEND\n"
)
LS = (
    "/PROG A\n/MN\n1:L P[1] 9mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n UF : 1, UT : 10, "
    "CONFIG : 'N U T, 0, 0, 0',\nX = 1.0 mm,Y = 0.0 mm,Z = 0.0 mm,\n"
    "W = 180.0 deg,P = 0.0 deg,R = 0.0 deg\n};\n/END\n"
)


@pytest.mark.parametrize(
    ("program", "text", "beside", "tool"),
    [
        ("A.JBI", JOB, {"tool.cnd": TOOLS, "UFRAME.CND": USER}, 0.003),
        ("a.ls", LS, {"SYSFRAME.VA": FRAMES}, 0.1505),
    ],
)
def test_files_beside_a_program_are_found(
    tmp_path: Path, program: str, text: str, beside: dict[str, str], tool: float
) -> None:
    (tmp_path / program).write_text(text)
    (unknown,) = read_job(tmp_path / program)
    assert unknown.reason.tolist() == [Reason.UNKNOWN_FRAME]
    for name, content in beside.items():
        (tmp_path / name).write_text(content)
    (known,) = read_job(tmp_path / program)
    assert known.reason.tolist() == [0]
    np.testing.assert_allclose(known.T_base_frame[known.frame[0]], FIXTURE, atol=1e-15)
    assert known.T_flange_tool[known.tool[0]][2, 3] == pytest.approx(tool)


def test_what_the_cell_says_goes_before_and_the_difference_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.ls").write_text(LS)
    (tmp_path / "SYSFRAME.VA").write_text(FRAMES)
    mine = FIXTURE.copy()
    mine[0, 3] += 2e-3
    (program,) = read_job(tmp_path / "a.ls", FrameTable(bases={"1": mine}))
    np.testing.assert_array_equal(program.T_base_frame[program.frame[0]], mine)
    said = "base 1 of the cell is used; that of SYSFRAME.VA lies 2.000 mm from it."
    assert program.notes == (said,)
