"""Every dialect on programs written and damaged by a seed; ``make fuzz`` runs many more."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

from executed import EXECUTED, find_strays
from languages import LANGUAGES, frames_of
from laws import read, require_identity, require_undone, survives
from mutated import damaged
from written import Pen

WHOLE, DAMAGED, RUN = 25, 100, 25
FEW = {"fanuc_gcode": 3, "sinumerik": 5, "heidenhain": 12, "apt": 12}
"""Programs of many motions: fewer are executed."""


@pytest.mark.parametrize("name", sorted(LANGUAGES))
def test_zero_is_the_identity_and_a_correction_can_be_undone(name: str) -> None:
    targets = 0
    for k in range(WHOLE):
        job = LANGUAGES[name].writer(Pen.of([11, k]))
        programs = read(name, job.files, job.frames)
        require_identity(name, job.files, programs)
        targets += require_undone(name, job, programs, np.random.default_rng([11, k]))
    assert targets > 2 * WHOLE


@pytest.mark.parametrize("name", sorted(LANGUAGES))
def test_damaged_programs_are_read_or_refused(name: str) -> None:
    language, rng = LANGUAGES[name], np.random.default_rng(12)
    others = [each.sample for each in LANGUAGES.values()]
    number_read = 0
    for k in range(DAMAGED):
        files = list(language.writer(Pen.of([12, k])).files)
        which = int(rng.integers(len(files)))
        file, data = files[which]
        other = others[int(rng.integers(len(others)))]
        files[which] = file, damaged(rng, data, language.pieces, other)
        number_read += survives(name, tuple(files), frames_of(name), k, 20.0)
    assert 0 < number_read < DAMAGED


@pytest.mark.parametrize("name", sorted(EXECUTED))
def test_an_executed_target_is_left_alone_or_corrected_for_its_own_frames(name: str) -> None:
    count: Counter[str] = Counter()
    writer = EXECUTED[name].job
    run = FEW.get(name, RUN)
    strays = {k: find_strays(name, writer(Pen.of([13, k])), count) for k in range(run)}
    assert not any(strays.values()), strays
    assert count["corrected"] > 20 * run


FOUND = {
    "a quaternion beyond the range of doubles": (
        "rapid",
        "part.mod",
        b"MODULE m\nPROC p()\nMoveL [[0,3,3],[1E308,0,0,0],[1,2,0,2],[9E9,9E9,9E9,9E9,9E9,9E9]],"
        b"v1,z1,tool0;\nENDPROC\nENDMODULE\n",
    ),
    "a work object beyond the range of doubles": (
        "rapid",
        "part.mod",
        b'MODULE m\nPERS wobjdata w:=[FALSE,TRUE,"",[[8,0,0],[1E308,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
        b"ENDMODULE\n",
    ),
    "a rotation vector beyond the range of doubles": (
        "urscript",
        "part.script",
        b"def p():\nset_tcp(p[0,0,0,1E308,4,9])\nmovel(p[3,6,0,1E308,4,9])\nend\n",
    ),
    "a control character behind a number": (
        "jbi",
        "part.jbi",
        b"/JOB\n//POS\n///RCONF 0\x1c,0,0,0,0,0\n//INST\nNOP\nEND\n",
    ),
    "a number of a frame with thousands of digits": (
        "fanuc_ls",
        "part.ls",
        b"/PROG P\n/MN\n 1:UFRAME_NUM=" + b"1" * 5000 + b" ;\n/POS\n/END\n",
    ),
    "a raised digit as the number of a base": (
        "krl",
        "part.src",
        b"DEF p()\n$BASE=BASE_DATA[\xb2]\nBASE_DATA[\xb3]={X 1,Y 2,Z 3,A 4,B 5,C 6}\n"
        b"BAS(#TOOL,\xb9)\nFDAT_ACT={TOOL_NO \xb2,BASE_NO \xb3}\nLIN {X 1,Y 2,Z 3,A 4,B 5,C 6}\n"
        b"$BASE=BASE_DATA[" + b"1" * 5000 + b"]\nEND\n",
    ),
    "a position with thousands of digits": (
        "fanuc_ls",
        "part.ls",
        b"/PROG P\n/MN\n 1:  R[1]=P["
        + b"1" * 5000
        + b"] ;\n 2:L P["
        + b"1" * 5000
        + b"] 5mm/sec FINE ;\n/POS\n/END\n",
    ),
    "an axis beyond the range of doubles": (
        "toolpath_csv",
        "part.csv",
        b"x_mm;y_mm;z_mm;i;j;k;rapid\n0;5;0;1E308;1;7;\n",
    ),
    "a cell quoted in part": (
        "toolpath_csv",
        "part.csv",
        b'x_mm;y_mm;z_mm;i;j;k\n0;"6";9;.32;".2"7;.9\n',
    ),
    "a coordinate in another base, and no blank before it": (
        "krl",
        "part.src",
        b"lin{E6POS:X 0,Y 4,A 1,B 0,c 2,Z'B0',T'B1'}\n",
    ),
    "numbers with no blank before them": (
        "krl",
        "part.src",
        b"lin{X-9,y-0,Z.0,A\t9,B-4,c 2}\n",
    ),
    "a work object that is declared again after it was changed": (
        "rapid",
        "part.mod",
        b"PERS wobjdata w1;w1.uframe:=[[1,2,5],[1,0,0,0]];MoveL[[]]\\WObj:=w1;PERS wobjdata w1;",
    ),
    "a point beyond the range of doubles in a path of columns": (
        "toolpath_csv",
        "part.csv",
        b'x_mm,y_mm,z_mm,I,j,k\n1E308,6,4,.441,".41",.79',
    ),
    "a computed target with a quaternion beyond the range of doubles": (
        "rapid",
        "part.mod",
        b"CONST robtarget p7:=[[7,7,8],[8,0,1E308,7],[2],[9]];MoveL RelTool(p7,1,2,3);",
    ),
    "a routine that calls itself before its first motion, and no routine outside": (
        "urscript",
        "part.script",
        b"def\ndef go()\nmovej(q1)\nif\nset_tcp([])\nend\nend\nq1=[1,5,1,0,1,5]\nmovej(q1,)\n"
        b"while movel(pose_s([]))go()\nend\nend",
    ),
    "a stored point beyond any number, and one computed from it": (
        "rapid",
        "part.mod",
        b"MODULE m\nCONST robtarget p:=[[1,-2,1E308],[1,0,0,0],[1,0,2,0],[0,0,0,0,0,0]];\n"
        b"CONST robtarget q:=[[1,-2,3],[1,0,0,0],[1,0,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        b"PROC main()\nMoveL p,v1,z1,tool0;\nMoveL Offs(p,0,0,5),v1,z1,tool0;\n"
        b"MoveL q,v1,z1,tool0;\nMoveL Offs(q,0,0,1E308),v1,z1,tool0;\nENDPROC\nENDMODULE\n",
    ),
    "a coordinate of 100 km, which corrected has a digit more": (
        "heidenhain",
        "part.h",
        b"0 BEGIN PGM P MM\n1 M128\n2 L X+10 Y-5.5 Z+2 A+0 B+0 C+90 R0 FMAX M3\n"
        b"3 L X+99999999.999 Y+99999999.999 Z-1\n4 L X-99999999.999 Y-99999999.999 Z-1\n5 M129\n"
        b"6 END PGM P MM\n",
    ),
    "a position beyond any number, whose move gets one of its own": (
        "fanuc_ls",
        "part.ls",
        b"/PROG P\n/MN\nR[1]=P[1] ;L P[1] ;PR[9]=LPOS-LPOS ;L P[4] Tool_Offset,PR[9] ;R[2]=P[4] ;\n"
        + b"/POS\nP[1]{\nGP1:\n UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',\n X= 9 mm, Y= 9 mm,"
        b" Z= 1E308 mm, W= 7 deg, P= 3 deg, R= 5 deg\n};\nP[4]{\nGP1:\n UF : 0, UT : 1, CONFIG : "
        b"'N U T, 0, 0, 0',\n X= 0 mm, Y= 9 mm, Z= 858 mm, W= -2 deg, P= -4 deg, R= 18 deg\n};\n"
        b"/END\n",
    ),
    "clauses that never end": (
        "krl",
        "part.src",
        b"DEF p()\nLIN {X 1,Y 2,Z 3,A 4,B 5,C 6" + b" WITH $BASE=" * 12000 + b"\nEND\n",
    ),
}
"""Damaged programs that once were neither read nor refused."""


@pytest.mark.parametrize("what", FOUND)
def test_once_found(what: str) -> None:
    name, file, data = FOUND[what]
    survives(name, ((file, data),), frames_of(name), 0, 20.0)
