"""How much of programs as shops write them is compensated: moves to constant poses, by language.

The programs are written here in the manner of handling, welding and milling cells: stored points,
approach points by geometric operators, frame numbers in constants, routines that set frames, data
in modules and controller files. Of each it is stated how many of its moves go to a pose that is the
same in every run; the share of these that can be compensated is printed.

    python benchmarks/program_corpus.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from robotrue.program.formats import read_job
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Motion, Program, Reason


class Case(NamedTuple):
    """A job: what it is, its files, and how many of its moves go to constant poses."""

    what: str
    files: dict[str, str]
    constant: int


def _krl(x: float, y: float, z: float, beside: str = "") -> str:
    return f"{{X {x:.3f},Y {y:.3f},Z {z:.3f},A 10.000,B 5.000,C 178.000{beside}}}"


def print_points(count: int) -> str:
    rows = (f"DECL E6POS XP{k}={_krl(900 + 7 * k, -50 + 3 * k, 400, ',S 2,T 35,E1 0.0')}\n"
            for k in range(1, count + 1))  # fmt: skip
    return "".join(rows)


CONFIG: Final = f"""DEFDAT $CONFIG PUBLIC
BASE_DATA[1]={{X 1000.0,Y 0.0,Z 500.0,A 0.0,B 0.0,C 0.0}}
BASE_DATA[2]={{X 1000.0,Y 400.0,Z 500.0,A 90.0,B 0.0,C 0.0}}
TOOL_DATA[1]={{X 0.0,Y 0.0,Z 200.0,A 0.0,B 0.0,C 0.0}}
TOOL_DATA[2]={{X 0.0,Y 50.0,Z 240.0,A 0.0,B 30.0,C 0.0}}
DECL E6POS XSERVICE={_krl(700, 0, 900, ",S 2,T 35")}
INT TOOL_GRIPPER=1
INT BASE_TABLE=2
ENDDAT
"""
_INIT: Final = "BAS(#INITMOV,0)\nBAS(#VEL_PTP,50)\n"
SETTINGS: Final = """GLOBAL DEF MoveSettings(T:IN,B:IN,V:IN,A:IN)
INT T,B,V,A
BAS(#TOOL,T)
BAS(#BASE,B)
BAS(#VEL_PTP,V)
END
"""
KRL: Final = (
    Case("handling: approach by ':' and a gripper number", {
        "pick.src": f"DEF pick()\n{_INIT}BAS(#TOOL,TOOL_GRIPPER)\nBAS(#BASE,BASE_TABLE)\n"
        "PTP XP1:ABOVE\nLIN XP1\nLIN XP1:ABOVE C_DIS\nPTP XP2:ABOVE\nLIN XP2\nLIN XP2:ABOVE\n"
        "PTP XSERVICE\nEND\n",
        "pick.dat": f"DEFDAT pick\n{print_points(2)}"
        "DECL FRAME ABOVE={X 0.0,Y 0.0,Z -120.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n",
        "$config.dat": CONFIG}, 7),
    Case("welding: frames by a routine of its own module, GLOBAL points of another", {
        "weld.src": "DEF weld()\nMoveSettings(1,1,100,50)\nPTP XP1\nLIN XP2\nCIRC XP3,XP4\n"
        "MoveSettings(2,2,100,50)\nLIN XG1\nLIN XG2\nMoveSettings(1,2,60,50)\nLIN XP5\nEND\n",
        "weld.dat": f"DEFDAT weld\n{print_points(5)}ENDDAT\n",
        "lib.src": f"DEF lib()\nEND\n{SETTINGS}",
        "shared.dat": "DEFDAT shared PUBLIC\n"
        + "".join(f"DECL GLOBAL E6POS XG{k}={_krl(800, 40 * k, 350, ',S 2,T 35')}\n"
                  for k in (1, 2))
        + "ENDDAT\n",
        "$config.dat": CONFIG}, 7),
    Case("palletising: copies of a point with components set", {
        "pallet.src": f"DEF pallet()\n{_INIT}$TOOL=TOOL_DATA[TOOL_GRIPPER]\n$BASE=BASE_DATA[1]\n"
        "PUT=XP1\nPUT.Z=PUT.Z+CLEAR\nLIN PUT\nLIN XP1\nPUT.Z=XP1.Z+2*CLEAR\nLIN PUT C_DIS\n"
        "FOR I=1 TO 4\nPUT=XP2\nPUT.X=PUT.X+I*PITCH\nLIN PUT\nENDFOR\nLIN XP3\nEND\n",
        "pallet.dat": f"DEFDAT pallet\n{print_points(3)}DECL E6POS PUT\nREAL CLEAR=80.0\n"
        "REAL PITCH=55.0\nENDDAT\n",
        "$config.dat": CONFIG}, 4),
    Case("milling: lines of a post in a base joined by ':'", {
        "mill.src": "DEF mill()\n$TOOL=TOOL_DATA[2]\n$BASE=BASE_DATA[1]:FIXTURE\n"
        + "".join(f"LIN {_krl(10 * k, 5, 2)} C_DIS\n" for k in range(12))
        + "LIN {X SAFE,Y 0.0,Z SAFE+50,A 0.0,B 0.0,C 180.0}\nEND\n",
        "mill.dat": "DEFDAT mill\nDECL FRAME FIXTURE={X 10.0,Y 20.0,Z 30.0,A 45.0,B 0.0,C 0.0}\n"
        "REAL SAFE=150.0\nENDDAT\n",
        "$config.dat": CONFIG}, 13),
    Case("probing: what a sensor finds", {
        "probe.src": f"DEF probe()\n{_INIT}BAS(#TOOL,1)\nBAS(#BASE,1)\nLIN XP1\n"
        "FOUND.X=FOUND.X+$ANIN[1]\nLIN XP2:FOUND\nLIN XP3\nEND\n",
        "probe.dat": f"DEFDAT probe\n{print_points(3)}"
        "DECL FRAME FOUND={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n",
        "$config.dat": CONFIG}, 2),
)  # fmt: skip

_ROB: Final = "[0.00000000,1.00000000,0.00000000,0.00000000],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


def spot(x: float, y: float, z: float) -> str:
    return f"[[{x:.3f},{y:.3f},{z:.3f}],{_ROB}"


DATA: Final = """TASK PERS tooldata tGrip:=[TRUE,[[0,0,215.5],[1,0,0,0]],
  [2,[0,0,15],[1,0,0,0],0,0,0]];
TASK PERS wobjdata wTable:=[FALSE,TRUE,"",[[800,-100,450],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
"""


def go(*targets: str, how: str = "MoveL") -> str:
    return "".join(f"{how} {each},v200,z1,tGrip\\WObj:=wTable;\n" for each in targets)


RAPID: Final = (
    Case("handling: targets and frames of a data module, approach by Offs", {
        "main.mod": "MODULE main\nPROC main()\n"
        + go("Offs(pPick,0,0,nLift)", "pPick", "Offs(pPick,0,0,nLift)", "Offs(pPlace,0,0,nLift)",
              "pPlace", "RelTool(pPlace,0,0,-nLift)")
        + "ENDPROC\nENDMODULE\n",
        "data.mod": f"MODULE data\n{DATA}CONST robtarget pPick:={spot(100, 0, 20)};\n"
        f"CONST robtarget pPlace:={spot(100, 300, 20)};\nCONST num nLift:=75;\nENDMODULE\n"}, 6),
    Case("stacking: copies with components set, one place counted", {
        "stack.mod": f"MODULE stack\n{DATA}CONST robtarget pBase:={spot(50, 50, 0)};\n"
        "VAR robtarget pT;\nVAR num nCount;\nPROC main()\npT:=pBase;\npT.trans.z:=pT.trans.z+40;\n"
        + go("pT", "pBase") + "pT:=Offs(pBase,10,0,0);\n"
        + go("pT", "RelTool(pT,0,0,-30\\Rz:=15)")
        + "nCount:=nCount+1;\n" + go("Offs(pBase,0,0,nCount*40)") + "ENDPROC\nENDMODULE\n"}, 4),
    Case("two stations: a displacement of constants", {
        "twin.mod": f"MODULE twin\n{DATA}CONST pose dTwo:=[[0,600,0],[1,0,0,0]];\n"
        + "".join(f"CONST robtarget p{k}:={spot(10 * k, 0, 5)};\n" for k in range(1, 7))
        + "PROC main()\nPDispOff;\n" + go("p1", "p2", "p3") + "PDispSet dTwo;\n"
        + go("p4", "p5", "p6") + "PDispOff;\nENDPROC\nENDMODULE\n"}, 6),
    Case("milling: literals of a post", {
        "mill.mod": f"MODULE mill\n{DATA}PROC main()\n"
        + go(*(spot(5 * k, 0, 1) for k in range(10))) + "ENDPROC\nENDMODULE\n"}, 10),
    Case("search: what a signal finds", {
        "find.mod": f"MODULE find\n{DATA}VAR robtarget pF;\n"
        f"CONST robtarget p1:={spot(1, 2, 3)};\n"
        "PROC main()\n" + go("p1") + "pF:=CRobT(\\Tool:=tGrip\\WObj:=wTable);\n"
        + go("Offs(pF,0,0,20)", "p1") + "ENDPROC\nENDMODULE\n"}, 2),
)  # fmt: skip


def ls(lines: str, points: dict[int, tuple[int, int]]) -> str:
    held = "".join(
        f"P[{n}]{{\n   GP1:\n\tUF : {uf}, UT : {ut},\t\tCONFIG : 'N U T, 0, 0, 0',\n"
        f"\tX =   {700 + n}.000  mm,\tY =   {10 * n}.000  mm,\tZ =   400.000  mm,\n"
        f"\tW =   180.000 deg,\tP =     0.000 deg,\tR =     0.000 deg\n}};\n"
        for n, (uf, ut) in points.items()
    )
    return f"/PROG  JOB\n/ATTR\n/MN\n{lines}/POS\n{held}/END\n"


FRAME_VA: Final = """[*SYSTEM*]$MNUFRAME  Storage: CMOS  Access: RW  : ARRAY[1,9] OF POSITION
 Field: $MNUFRAME Access: RW
   [1,1] =
      Group: 1   Config: N D B, 0, 0, 0
      X:   800.000   Y:   100.000   Z:    50.000
      W:     0.000   P:     0.000   R:    90.000
[*SYSTEM*]$MNUTOOL  Storage: CMOS  Access: RW  : ARRAY[1,9] OF POSITION
 Field: $MNUTOOL Access: RW
   [1,1] =
      Group: 1   Config: N D B, 0, 0, 0
      X:     0.000   Y:     0.000   Z:   200.000
      W:     0.000   P:     0.000   R:     0.000
"""
_POSREG_VA: Final = """[*POSREG*]$POSREG  Storage: CMOS  Access: RW  : ARRAY[1,99] OF Position Reg
    [1,1] =   '' Uninitialized
    [1,2] =   'home'
  Group: 1   Config: N U T, 0, 0, 0
  X:   650.000   Y:     0.000   Z:   700.000
  W:   180.000   P:     0.000   R:     0.000
"""
FANUC: Final = (
    Case("handling: frames of SYSFRAME.VA", {
        "PICK.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n   3:J P[1] 50% CNT50    ;\n"
                       "   4:L P[2] 200mm/sec FINE    ;\n   5:L P[3] 200mm/sec FINE    ;\n",
                       {1: (1, 1), 2: (1, 1), 3: (1, 1)}),
        "SYSFRAME.VA": FRAME_VA}, 3),
    Case("approach by an offset of constants", {
        "OFFS.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n   3:  PR[1]=LPOS-LPOS    ;\n"
                       "   4:  PR[1,3]=50    ;\n"
                       "   5:L P[1] 200mm/sec FINE Offset,PR[1]    ;\n"
                       "   6:L P[1] 200mm/sec FINE    ;\n",
                       {1: (1, 1)}),
        "SYSFRAME.VA": FRAME_VA}, 2),
    Case("approach by an offset of which the job sets three of six numbers", {
        "PART.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n"
                       "   3:  PR[1,1]=0    ;\n   4:  PR[1,2]=0    ;\n   5:  PR[1,3]=50    ;\n"
                       "   6:L P[1] 200mm/sec FINE Offset,PR[1]    ;\n"
                       "   7:L P[1] 200mm/sec FINE    ;\n",
                       {1: (1, 1)}),
        "SYSFRAME.VA": FRAME_VA}, 2),
    Case("registers set from a position, by sums and numbers in R", {
        "SUMS.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n   3:  R[1]=120    ;\n"
                       "   4:  PR[5]=P[1]    ;\n   5:  PR[5,3]=PR[5,3]+R[1]    ;\n"
                       "   6:J PR[5] 50% CNT50    ;\n   7:L P[1] 200mm/sec FINE    ;\n"
                       "   8:  PR[6]=LPOS-LPOS    ;\n   9:  PR[6,2]=(-30)    ;\n"
                       "  10:  PR[7]=PR[5]+PR[6]    ;\n  11:L PR[7] 200mm/sec CNT10    ;\n"
                       "  12:L P[2] 200mm/sec FINE Tool_Offset,PR[6]    ;\n"
                       "  13:  OFFSET CONDITION PR[6]    ;\n"
                       "  14:L P[2] 200mm/sec FINE Offset    ;\n",
                       {1: (1, 1), 2: (1, 1)}),
        "SYSFRAME.VA": FRAME_VA}, 5),
    Case("a loop, a branch and a called program between them", {
        "LOOP.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n   3:  PR[1]=LPOS-LPOS    ;\n"
                       "   4:  PR[1,3]=60    ;\n   5:  FOR R[2]=1 TO 4    ;\n"
                       "   6:L P[1] 200mm/sec FINE Offset,PR[1]    ;\n   7:  CALL GRIP    ;\n"
                       "   8:L P[2] 200mm/sec FINE Offset,PR[1]    ;\n   9:  ENDFOR    ;\n"
                       "  10:  IF DI[3]=ON,JMP LBL[9]    ;\n  11:L P[3] 200mm/sec FINE    ;\n"
                       "  12:  LBL[9]    ;\n  13:L P[4] 200mm/sec FINE Offset,PR[1]    ;\n",
                       {1: (1, 1), 2: (1, 1), 3: (1, 1), 4: (1, 1)}),
        "GRIP.LS": ls("   1:  DO[4]=ON    ;\n   2:  WAIT    .50(sec)    ;\n", {1: (1, 1)})
        .replace("/PROG  JOB", "/PROG  GRIP"),
        "SYSFRAME.VA": FRAME_VA}, 4),
    Case("home and rest in registers of POSREG.VA", {
        "REST.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n"
                       "   3:J PR[2:home] 50% FINE    ;\n   4:L P[1] 200mm/sec FINE    ;\n"
                       "   5:C P[2]    \n       P[3] 200mm/sec FINE    ;\n"
                       "   6:J PR[2:home] 50% FINE    ;\n",
                       {1: (1, 1), 2: (1, 1), 3: (1, 1)}),
        "POSREG.VA": _POSREG_VA, "SYSFRAME.VA": FRAME_VA}, 5),
    Case("a shelf counted by a register, a point of vision", {
        "SHELF.LS": ls("   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n   3:L P[1] 99mm/sec FINE ;\n"
                        "   4:  PR[3,3]=R[7]*40    ;\n   5:L P[2] 200mm/sec FINE Offset,PR[3]  ;\n"
                        "   6:L P[3] 200mm/sec FINE VOFFSET,VR[1]    ;\n",
                        {1: (1, 1), 2: (1, 1), 3: (1, 1)}),
        "SYSFRAME.VA": FRAME_VA}, 1),
)  # fmt: skip


def print_job(points: str, moves: str) -> str:
    counted = sum(line[:1] == "C" for line in points.split("\n"))
    variables = sum(line[:1] == "P" for line in points.split("\n"))
    return (
        f"/JOB\n//NAME JOB\n//POS\n///NPOS {counted},0,0,{variables},0,0\n{points}//INST\n"
        f"///DATE 2020/01/01 00:00\n///ATTR SC,RW\n///GROUP1 RB1\nNOP\n{moves}END\n"
    )


def _c_points(count: int) -> str:
    return "".join(
        f"C{k:05d}={900 + 10 * (k % 3)}.0,{20 * k}.0,400.0,180.0,0.0,0.0\n" for k in range(count)
    )


JBI: Final = (
    Case("handling: user frame of UFRAME.CND", {
        "PICK.JBI": "/JOB\r\n//NAME PICK\r\n//POS\r\n///NPOS 3,0,0,0,0,0\r\n///TOOL 0\r\n"
        "///POSTYPE BASE\r\n///RECTAN\r\n///RCONF 0,0,0,0,0,0,0,0\r\n"
        + "".join(f"C0000{k}=900.000,{k}0.000,400.000,180.0000,0.0000,0.0000\r\n" for k in range(3))
        + "//INST\r\n///DATE 2020/01/01 00:00\r\n///ATTR SC,RW\r\n///GROUP1 RB1\r\nNOP\r\n"
        "MOVJ C00000 VJ=10.00\r\nMOVL C00001 V=100.0\r\nMOVL C00002 V=100.0\r\nEND\r\n"}, 3),
    Case("welding: points in pulses", {
        "WELD.JBI": "/JOB\r\n//NAME WELD\r\n//POS\r\n///NPOS 2,0,0,0,0,0\r\n///TOOL 0\r\n"
        "///POSTYPE PULSE\r\n///PULSE\r\nC00000=1000,2000,-3000,400,500,600\r\n"
        "C00001=1100,2100,-3100,410,510,610\r\n//INST\r\n///DATE 2020/01/01 00:00\r\n"
        "///ATTR SC,RW\r\n///GROUP1 RB1\r\nNOP\r\nMOVL C00000 V=100.0\r\nMOVL C00001 V=100.0\r\n"
        "END\r\n"}, 2),
    Case("a job with arguments, arcs, a label and an output", {
        "ARCS.JBI": print_job("///TOOL 0\n///POSTYPE BASE\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\n"
                         + _c_points(6) + "//ARGINFO\n///ARGTYPE B,,,,,,,\n///COMMENT\npart\n",
                         "MOVJ C00000 VJ=10.00\nMOVL C00001 V=50.0\nMOVC C00001 V=50.0\n"
                         "MOVC C00002 V=50.0\nMOVC C00003 V=50.0\nDOUT OT#(3) ON\n*NEXT\n"
                         "MOVL C00004 V=99.0\nMOVL C00005 V=99.0 PL=1\n")}, 7),
    Case("user frame and tool of the condition files, points in degrees", {
        "USER.JBI": print_job("///USER 1\n///TOOL 3\n///POSTYPE USER\n///RECTAN\n"
                         "///RCONF 0,0,0,0,0,0,0,0\n" + _c_points(3)
                         + "///POSTYPE ANGLE\n///ANGLE\nC00003=0.0,10.0,-20.0,0.0,-60.0,0.0\n",
                         "MOVJ C00003 VJ=10.00\nMOVL C00000 V=50.0\nMOVL C00001 V=50.0\n"
                         "MOVS C00002 V=50.0\n"),
        "UFRAME.CND": "//UFRAME 1\n///NAME\n///TOOL 0\n////BUSER 900,0,300,0,0,15\n",
        "TOOL.CND": "//TOOL 3\n///NAME torch\n0.0,5.0,380.0,0.0,35.0,0.0\n"}, 4),
    Case("a shift by a known variable, and a step", {
        "SHIFT.JBI": print_job("///TOOL 0\n///POSTYPE BASE\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\n"
                          + _c_points(2) + "P00009=0.000,0.000,50.000,0.0000,0.0000,0.0000\n",
                          "SFTON P009\nMOVL C00000 V=50.0\nSFTOF\nMOVL C00001 V=50.0\n"
                          "IMOV P009 V=20.0 BF\n")}, 2),
    Case("a called job, points of variables that nothing sets", {
        "CALLS.JBI": print_job("///TOOL 0\n///POSTYPE BASE\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\n"
                          + _c_points(2) + "P00001=900.0,0.0,500.0,180.0,0.0,0.0\n",
                          "MOVJ P001 VJ=10.00\nCALL JOB:GRIP\nMOVL C00000 V=50.0\n"
                          "MOVL C00001 V=50.0\nMOVL P001 V=50.0\n"),
        "GRIP.JBI": print_job("///TOOL 0\n///POSTYPE BASE\n///RECTAN\n" + _c_points(1),
                         "DOUT OT#(1) ON\nTIMER T=0.30\n").replace("NAME JOB", "NAME GRIP")}, 4),
)  # fmt: skip
_GCODE_HEAD: Final = "%\nO100 (PART)\nG90 G17 G21\nG54 G43.4 H1 T1 M6\n"
GCODE: Final = (
    Case("milling with five axes, what stays is left out", {
        "MILL.NC": _GCODE_HEAD + "G0 X0. Y0. Z50. A0. B0. C0.\nG1 Z2. F500.\n"
        + "".join(f"X{3 * k}.5 B{k}.\n" for k in range(1, 11)) + "G0 Z50.\nM30\n%\n"}, 13),
    Case("arcs, a helix and a whole circle", {
        "ARCS.NC": _GCODE_HEAD + "G0 X0. Y0. Z5. A0. B0. C0.\nG1 Z0. F300.\nG2 X10. I5. J0.\n"
        "G3 X20. Z-1. I5. J0.\nG3 I5. J0.\nG1 X30.\nM30\n%\n"}, 9),
    Case("whole numbers without a point", {
        "WHOLE.NC": _GCODE_HEAD + "G0 X0 Y0 Z50 A0 B0 C0\nG1 Z2 F500\nX10\nG2 X20 I5 J0\nG1 Y30.5\n"
        "G0 Z50\nM30\n%\n"}, 7),
    Case("a local zero and its end", {
        "LOCAL.NC": _GCODE_HEAD + "G0 X0. Y0. Z5. A0. B0. C0.\nG52 X100. Y0. Z0.\n"
        "G1 X0. Y0. Z0. F300.\nX10.\nG52 X0. Y0. Z0.\nG1 X0. Y0. Z5. A0. B0. C0.\n"
        "X10.\nM30\n%\n"}, 5),
)  # fmt: skip
_CL_HEAD: Final = "PARTNO/PART\nUNITS/MM\nMULTAX/ON\nLOADTL/1\n"
APT: Final = (
    Case("points with a tool axis", {
        "MILL.APT": _CL_HEAD + "RAPID\nGOTO/0,0,50,0,0,1\nFEDRAT/500,MMPM\n"
        + "".join(f"GOTO/{k}.0,2.0,1.0,0.0,{0.02 * k:.4f},{(1 - (0.02 * k) ** 2) ** 0.5:.7f}\n"
                  for k in range(12)) + "FINI\n"}, 13),
    Case("continued lines, a fixed axis, comments", {
        "LONG.APT": _CL_HEAD + "$$ OPERATION NAME : FLOOR\nTLAXIS/0,0,1\nGOTO/ 1.0, $\n 2.0, 3.0\n"
        "SPINDL/9000,RPM,CLW\nGOTO/4,5,6\nCOOLNT/ON\nGOTO/7,8,9\nFINI\n"}, 3),
)  # fmt: skip
CELL: Final = FrameTable(
    tools={"0": np.eye(4), "T1": np.eye(4)},
    bases={"G54": np.eye(4)},
    pulses_per_degree=np.full(6, 1000.0),
    orientation=OrientationRule(angles="rpy", spin=0.0),
    units_without_point="mm",
)
"""What the cell says beside the files: tools, pulses of the drives, angles, whole numbers."""
CORPUS: Final = {
    "KRL": KRL, "RAPID": RAPID, "Fanuc": FANUC, "JBI": JBI, "G-code": GCODE, "APT": APT,
}  # fmt: skip


def read_case(case: Case, folder: Path) -> tuple[Program, ...]:
    """Returns the programs of a job, written to a folder and read again."""
    for name, text in case.files.items():
        (folder / name).write_bytes(text.encode("latin-1"))
    return tuple(read_job(folder, CELL))


def count_moves(programs: tuple[Program, ...]) -> int:
    """Returns how many moves go to poses that can be compensated; axis values on request."""
    count = 0
    for program in programs:
        used = program.motion != Motion.UNUSED
        rows = program.path[:, 1] if len(program.path) else np.flatnonzero(used)
        rows = rows[rows >= 0]
        count += int(np.isin(program.reason[rows], (Reason.NONE, Reason.JOINT_TARGET)).sum())
    return count


def main() -> None:
    """Prints the shares."""
    print(f"{'language':9} {'compensated':>11} {'constant':>9} {'share':>6}")
    for language, cases in CORPUS.items():
        done, every, lines = 0, 0, []
        for case in cases:
            with tempfile.TemporaryDirectory() as place:
                count = count_moves(read_case(case, Path(place)))
            lines.append(f"    {count:3} of {case.constant:3}  {case.what}")
            done, every = done + count, every + case.constant
        print(f"{language:9} {done:11} {every:9} {done / every:6.0%}", *lines, sep="\n", flush=True)


if __name__ == "__main__":
    main()
