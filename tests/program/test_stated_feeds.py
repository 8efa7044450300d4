"""Feeds as ten languages state them, and what is not stated plainly."""

from __future__ import annotations

import numpy as np
import pytest
from path_samples import TABLE

from robotrue.program.formats.stated_feeds import stated_feeds
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable

NAN, FAST = np.nan, np.inf
POSE = "X 1,Y 2,Z 3,A 0,B 0,C 0"
TARGET = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
CASES = {
    "krl": (
        f"DEF p()\nLIN {{{POSE}}}\n$VEL.CP = 0.2 ; m/s\nLIN {{{POSE}}}\nPTP {{{POSE}}}\n"
        f"LIN {{{POSE}}} WITH $VEL.CP=.05 C_DIS\nLIN {{{POSE}}}\n;$VEL.CP=9\n"
        f"BAS(#CP_PARAMS,0.5)\nCIRC {{{POSE}}},{{{POSE}}}\n$VEL.CP=fast\nLIN {{{POSE}}}\n"
        f"q={{{POSE}}}\nLIN q\nEND\n",
        [NAN, 0.2, FAST, 0.05, 0.2, 0.5, 0.5, NAN, NAN],
    ),
    "rapid": (
        f"MODULE m\nCONST robtarget p:={TARGET};\nPROC a()\nMoveL {TARGET},v100,z1,tool0;\n"
        f"MoveL {TARGET},\nv20 \\V:=15,z1,tool0;\nMoveJ {TARGET},v5,z1,tool0;\n"
        f"MoveL {TARGET},v9\\T:=2,z1,tool0;\nMoveL {TARGET},slow,z1,tool0;\nMoveL p,v7,z1,tool0;\n"
        "ENDPROC\nENDMODULE\n",
        [NAN, 0.1, 0.015, FAST, NAN, NAN],
    ),
    "urscript": (
        "def p():\nmovel(p[1,0,0,0,0,0],1.2,0.25,0,0)\nmovel(p[1,0,0,0,0,0], a=1, v=0.1)\n"
        "movel(p[1,0,0,0,0,0],a=1.0,.3)\nmovel(p[1,0,0,0,0,0],1,speed)\n"
        "movej(p[1,0,0,0,0,0],1,2)\nend\n",
        [0.25, 0.1, 0.3, NAN, FAST],
    ),
    "jbi": (
        "/JOB\n//NAME A\n//POS\n///NPOS 4,0,0,0,0,0\n///TOOL 0\n///POSTYPE BASE\n///RECTAN\n"
        "///RCONF 0,0,0,0,0,0\nC00000=1,2,3,0,0,0\nC00001=1,2,3,0,0,0\nC00002=1,2,3,0,0,0\n"
        "C00003=1,2,3,0,0,0\n//INST\n///DATE 2026/11/21 08:11\n///ATTR SC,RW\n///GROUP1 RB1\nNOP\n"
        "MOVL C00000 V=20.0 PL=1\nMOVJ C00001 VJ=50.00\nMOVL C00002 V=5\nMOVL C00002 V=6\n"
        "MOVL C00003\nEND\n",
        [0.02, FAST, NAN, NAN],
    ),
    "fanuc_ls": (
        "/PROG P\n/MN\n   1:L P[1] 200mm/sec CNT1 ;\n   2:L P[2] 60cm/min FINE ;\n"
        "   3:C P[3]\n      P[4] 50mm/sec FINE ;\n   4:J P[5] 4% FINE ;\n/POS\n"
        + "".join(
            f"P[{k}]{{\n  GP1:\n UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',\n X = 1 mm, Y = 2 mm, "
            "Z = 3 mm,\n W = 0 deg, P = 0 deg, R = 0 deg\n};\n"
            for k in range(1, 6)
        )
        + "/END\n",
        [0.2, 0.01, 0.05, 0.05, FAST],
    ),
    "sinumerik": (
        "TRAORI\nG0 X1 Y2 Z3 A=0 B=0 C=0 F500\nG1 X2 ; F9\nX3 F600.0\nG4 F7\nX4\nG0 X5\n"
        "G1 X6 F=R1\n",
        [FAST, 0.5 / 60, 0.01, 0.01, FAST, NAN],
    ),
    "fanuc_gcode": (
        "%\nO1 (F9)\nG43.4 H1\nG00 X1. Y2. Z3. A0. B0. C0.\nN1G01X2.F600.\nX3.(F5)\nF#1 X4.\n%\n",
        [FAST, 0.01, 0.01, NAN],
    ),
    "heidenhain": (
        "0 BEGIN PGM P MM\n1 M128\n2 L X+1 Y+2 Z+3 A+0 B+0 C+0 FMAX\n3 L X+2 F600 ; FMAX\n4 L X+3\n"
        "5 L X+4 FMAX\n6 L X+5\n7 L X+6 FQ1\n8 END PGM P MM\n",
        [FAST, 0.01, 0.01, FAST, 0.01, NAN],
    ),
    "apt": (
        "UNITS/MM\nMULTAX\nRAPID\nGOTO/1,2,3,0,0,1\nFEDRAT/ 600.0,MMPM\nGOTO/2,2,3\n"
        "GOTO/3,2,3\nFINI\n",
        [FAST, 0.01, 0.01],
    ),
    "toolpath_csv": (
        "x_mm,y_mm,z_mm,feed_mm_per_min,rapid\n1,2,3,,1\n2,2,3,600,0\n3,2,3,,0\n4,2,3,,1\n",
        [FAST, 0.01, 0.01, FAST],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_stated_feeds(name: str) -> None:
    text, want = CASES[name]
    table = TABLE if name in ("sinumerik", "fanuc_gcode", "heidenhain", "apt") else FrameTable()
    for end in ("\n", "\r\n"):
        data = text.replace("\n", end).encode()
        program = find_language(name).read(data, name="part.x", frames=table)
        np.testing.assert_allclose(stated_feeds(program), want, rtol=1e-12, err_msg=repr(end))
