"""Programs of points as words, one per dialect, with a bit of everything."""

from __future__ import annotations

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.units import DEG
from robotrue.program.lang import find_language
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Program, Reason, Replacement

RULE = OrientationRule(angles="rpy", spin=20.0 * DEG)
TABLE = FrameTable(
    bases={"G54": np.eye(4), "G55": np.eye(4)}, tools={"T1": np.eye(4)}, orientation=RULE
)

SINUMERIK = b"""; 5-axis part
N10 G17 G710 G40 G90
N20 T1 D1
N30 G54 G64
N40 TRAORI
N50 G0 X10.000 Y-.7694 Z5.000 A=179.7 B=-30.25 C=0.000 M3 S5000
N60 G1 Z-1.250 F1000.0 ; down
N70 Y1.2911
N80 X20.5 A=178.5
N90 CIP X30.500 Y1.500 Z-1.000 I1=25.000 J1=4.000 K1=-1.100
N100 G3 X40.500 Y1.500 I=5.000 J=0.000
N110 G2 X45.500 Y6.500 CR=5.000
N120 X50.0 Y6.5 I2.25
N130 G1 A3=0.1 B3=0 C3=0.994987 X50.000
N140 X51.000 Y7.000
N150 X=R1+5 Y8.000
N160 G91 X1.000
N170 G90 X52.000 Y8.000 Z0.000
N180 TRANS X10
N190 X1.000 Y1.000 Z1.000
N200 TRANS
N210 X52.000 Y9.000 Z0.000
N220 M30
"""
FANUC = b"""%
O1000 (PART)
N10 G21 G17 G40 G49 G80 G90
N20 T1 M6
N30 G54
N40 G43.4 H1
N50 G0 X10. Y-.7694 Z5. A0. B0. C90. M3 S5000
N60 G1 Z-1.25 F1000.
N70 Y1.2911
N80 X20.5(MIDDLE)
N90 G2 X30.5 Y1.2911 I5. J0.
N100 G3 X40.5 R5.
N110 G3 I5. X40.5
N120 G1 X#100
N130 X10. Y1. Z2.
/N140 X11.
N150 X12.5
N160 G43.5
N170 G1 X1. Y2. Z3. I.1 J0. K.994987
N180 X2.
N190 G68 X0. Y0. R45.
N200 X3. Y0. Z0.
N210 G69
N220 X3. Y0. Z0.
N230 M98 P100
N240 X5.
N250 M30
%
"""
HEIDENHAIN = b"""0 BEGIN PGM PART MM
1 BLK FORM 0.1 Z X-50 Y-50 Z-20
2 TOOL CALL 1 Z S5000
3 CYCL DEF 7.0 DATUM SHIFT
4 CYCL DEF 7.1 X+0
5 M128
6 L X+10 Y-5.5 Z+2 A+0 B+0 C+90 R0 FMAX M3
7 L Z-1.25 F1000
8 L X+20.5
9 LN X+21 Y-5 Z-1 NX+0 NY+0 NZ+1 TX+0.1 TY+0 TZ+0.994987 F1000
10 L X+30 Y+0
11 CC X+40 Y+0
12 C X+50 Y+0 DR+
13 CR X+60 Y+0 R+5 DR-
14 L IX+3
15 L X+Q1
16 L X+10 Y+1 Z-1
17 LN X+21 Y-5 Z-1 TX+0 TY+0 TZ+1
18 M129
19 L Z+100 A+0 R0 FMAX
20 END PGM PART MM
"""
APT = b"""$$ CATIA APT VERSION 1.0
PARTNO X
UNITS/MM
LOADTL/1
MULTAX
RAPID
GOTO  /   10.00000,  20.00000,  30.00000, 0.000000, 0.000000, 1.000000
FEDRAT/ 300.0000,MMPM
GOTO/11.5,20,$
 -.5
GOTO/12.5,20,0,0.1,0,.994987 $$ tilt
GODLTA/1,0,0
GOTO/13,20,0
CYCLE/DRILL,5
GOTO/14,20,0
CYCLE/OFF
GOTO/15,20,0
CIRCLE/20,20,0,0,0,1,5
GOTO/25,20,0
GOTO/26,20,0
TRANS/1,0,0
GOTO/16,20,0
FINI
"""
CSV = b"""# side A
x_mm;y_mm;z_mm;i;j;k;rapid
1.0;"2.50" ;3;0;0;1;1
1.500;2.50;.3;0;0.1;.994987;0
2.500; 3.5 ;-0.30;0;0.1;.994987;
"""
SAMPLES = {
    "sinumerik": SINUMERIK,
    "fanuc_gcode": FANUC,
    "heidenhain": HEIDENHAIN,
    "apt": APT,
    "toolpath_csv": CSV,
}


def read(name: str, data: bytes, table: FrameTable = TABLE) -> Program:
    return find_language(name).read(data, name="part.nc", frames=table)


def moved(program: Program, shift: np.ndarray, turn: np.ndarray, bend: float = 0.0) -> Replacement:
    return Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=program.position + shift,
        rotation=program.rotation @ turn,
        axes=program.axes + bend,
        words=np.full_like(program.words, NO_WORD),
    )
