"""No input takes more than linear time: four times as much of anything, about four times as long.

What is measured is processor time, the least of several runs, and only where the long input takes
long enough to tell: a quadratic scanner takes sixteen times as long for four times as much, and on
these sizes seconds to hours.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from contextlib import suppress

import pytest
from path_samples import SAMPLES, TABLE

from robotrue.errors import RobotrueError
from robotrue.program.formats import detect, write_program
from robotrue.program.formats.rapid_values import read_module
from robotrue.program.formats.stated_feeds import stated_feeds
from robotrue.program.frames_beside import read_controller_file
from robotrue.program.insertion import Inserter
from robotrue.program.lang import find_language, language_names
from robotrue.program.program import FrameTable, Reason, Replacement

STEEP = 8.0
"""Times as long for four times as much; linear is 4, quadratic 16."""
QUICK = 0.1
"""s; less is never too long."""
ENOUGH = 0.002
"""s; what takes longer, and about four times as long as a quarter of it, is linear."""
MOST = 1 << 16
INSIDE = (
    *(b"\n", b" ", b"a", b"1", b"(", b"[", b"{", b'"', b","),
    *(b"\n ", b";\n", b"a\n", b"a(", b"a[", b"P["),
)
WORST = (
    *INSIDE,
    *(
        b"\r\n",
        b"\t",
        b"_",
        b")",
        b";",
        b"=",
        b"'",
        b"-",
        b".",
        b"/",
        b"a ",
        b"( ",
        b"1 ",
        b'" ',
        b"1.",
    ),
    *(b"N1 ", b"{a "),
)

KRL = b"""DEF job()
$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}
LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 90.0,C 0.0} C_DIS
@between@
; note @comment@
MsgNotify("text @string@")
BAS(#VEL_CP,@argument@0.5)
LIN {X 2.0,Y 2.0,Z 3.0,A 0.0,B 90.0,C 0.0} C_DIS@behind@
P1=@value@{X 2.0,Y 2.0,Z 3.0,A 0.0,B 90.0,C 0.0}
LIN P1
END
"""
RAPID = b"""MODULE job
CONST robtarget p1:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;
@between@
! note @comment@
TPWrite "text @string@";
Work @argument@ 1;
IF reg1=@value@1 MoveL p1,v50,z1,tool0;
MoveL p1,v50,z1,tool0@behind@;
ENDPROC
ENDMODULE
"""
URSCRIPT = b"""def job():
  movel(p[.1,.2,.3,0,0,0],a=1.2,v=0.25)
@between@
# note @comment@
  textmsg("text @string@")
  work(@argument@1)
  q = @value@p[.1,.2,.3,0,0,0]
  movel(p[.1,.2,.3,0,0,0],a=1.2@behind@)
end
"""
JBI = b"""/JOB
//NAME JOB
//POS
///NPOS 2,0,0,0,0,0
///TOOL 0
///POSTYPE BASE
///RECTAN
///RCONF 0,0,0,0,0,0,0,0
C00000=1.0,2.0,3.0,0.0,0.0,0.0
C00001=2.0,2.0,3.0,0.0,0.0,0.0
//INST
///DATE 2024/01/01 10:00
NOP
MOVL C00000 V=10.0
@between@
' note @comment@
MSG "text @string@"
DOUT OT#(1) @argument@ON
MOVL C00001 V=10.0@behind@
SET B000 @value@1
END
"""
FANUC_LS = b"""/PROG JOB
/ATTR
OWNER = MNEDITOR;
COMMENT = "@string@";
/MN
   1:L P[1] 100mm/sec FINE ;
@between@
   2: !note @comment@;
   3: CALL WORK(@argument@1) ;
   4: R[1]=@value@1 ;
   5:L P[2] 100mm/sec FINE@behind@ ;
/POS
P[1]{ GP1: UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',
 X = 1.0 mm, Y = 2.0 mm, Z = 3.0 mm, W = 0.0 deg, P = 0.0 deg, R = 0.0 deg };
P[2]{ GP1: UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',
 X = 2.0 mm, Y = 2.0 mm, Z = 3.0 mm, W = 0.0 deg, P = 0.0 deg, R = 0.0 deg };
/END
"""
SINUMERIK = b"""N10 G54 G17 G710
TRAORI
N20 G1 X1 Y2 Z3 A=1 B=2 C=3 F1000
@between@
; note @comment@
MSG("text @string@")
WORK(@argument@1)
R1=@value@1
N30 G1 X2@behind@
M30
"""
FANUC_GCODE = b"""%
O1000
G21 G54 G43.4 H1
G1 X1. Y2. Z3. A0. B0. C0. F1000
@between@
(note @comment@)
G65 P1 @argument@A1.
#1=@value@1
G1 X2.@behind@
M30
%
"""
HEIDENHAIN = b"""0 BEGIN PGM JOB MM
1 TOOL CALL 1 Z S5000
2 M128
3 L X+1 Y+2 Z+3 A+0 B+0 C+0 F1000
@between@
; note @comment@
4 TOOL CALL "@string@" Z
5 CYCL DEF 7.1 X@argument@
6 Q1 = @value@1
7 L X+2@behind@
8 END PGM JOB MM
"""
APT = b"""PARTNO @string@
UNITS/MM
GOTO/1,2,3,0,0,1
@between@
$$ note @comment@
PPRINT @argument@
FEDRAT/@value@1
GOTO/2,2,3@behind@
FINI
"""
CSV = b"""# note @comment@
x_mm,y_mm,z_mm,operation
1,2,3,"text @string@"
@between@
2,2,3@behind@,a@value@
"""
VAL3 = b"""<?xml version="1.0"?>
<Programs xmlns="http://www.staubli.com/robotics/VAL3/Program/2">
<!-- note @comment@ -->
<Data name="p" type="pointRx" @argument@>
<Value key="0" x="1.0" y="2.0" z="3.0" rx="0.0" ry="0.0" rz="0.0" @value@ fatherId="world[0]"/>
<Value key="1" x="1.0" y="2.0" z="3.0" rx="0.0" ry="0.0" rz="0.0" fatherId="f[0]"/>
</Data>
<Program name="job"><Code><![CDATA[
movel(p[0],flange,m)
@between@
putln("text @string@")
movel(p[1],flange,m)@behind@
]]></Code></Program></Programs>
"""
PROGRAMS = {
    "krl": ("job.src", KRL),
    "rapid": ("job.mod", RAPID),
    "urscript": ("job.script", URSCRIPT),
    "jbi": ("job.jbi", JBI),
    "fanuc_ls": ("job.ls", FANUC_LS),
    "sinumerik": ("job.mpf", SINUMERIK),
    "fanuc_gcode": ("job.nc", FANUC_GCODE),
    "heidenhain": ("job.h", HEIDENHAIN),
    "apt": ("job.apt", APT),
    "toolpath_csv": ("job.csv", CSV),
    "val3": ("job.pgx", VAL3),
}
PLACES = (b"between", b"comment", b"string", b"argument", b"value", b"behind")
BESIDE = {
    "$config.dat": b"DEFDAT $CONFIG\nBASE_DATA[1]={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0@place@}\n",
    "UFRAME.CND": b"//UFRAME 1\n///NAME a@place@\n/BUSER 1,2,3,0,0,0@place@\n",
    "SYSFRAME.VA": b"[*SYSTEM*]$MNUFRAME  Storage: SHADOW  Access: RW\n  [1,1] = @place@\n"
    b"  Group: 1   Config: N D B, 0, 0, 0\n  X: 1.0 Y: 0.0 Z: 0.0 @place@\n"
    b"  W: 0.0 P: 0.0 R: 0.0\n",
}


def filled(program: bytes, place: bytes, worst: bytes, size: int) -> bytes:
    """The program with so many bytes of the worst at a place."""
    for each in PLACES:
        if each != place:
            program = program.replace(b"@" + each + b"@", b"")
    return program.replace(b"@" + place + b"@", of(worst, size))


def of(worst: bytes, size: int) -> bytes:
    return (worst * size)[:size]


def spent(work: Callable[[bytes], object], data: bytes, runs: int = 1) -> float:
    """Processor time, the least of so many runs; the collector comes when it likes, not here."""
    out = []
    gc.disable()
    try:
        for _ in range(runs):
            begun = time.process_time()
            with suppress(RobotrueError):
                work(data)
            out.append(time.process_time() - begun)
    finally:
        gc.enable()
    return min(out)


def steep(
    work: Callable[[bytes], object],
    make: Callable[[int], bytes],
    size: int = 1 << 12,
    most: int = MOST,
) -> str:
    """What takes more than its share of time, nothing if nothing does.

    The input grows to four times as much until it takes long enough to tell.
    """
    before = spent(work, make(size))
    while size < most:
        size *= 4
        took = spent(work, make(size))
        if took > max(QUICK, STEEP * before):
            before = spent(work, make(size // 4), runs=3)
            took = min(took, spent(work, make(size)))
            if took > STEEP * before:
                return f"{size} bytes {took:.2f} s, a quarter of them {before:.3f} s"
        if took > ENOUGH and took <= STEEP * before:
            return ""
        before = took
    return ""


def used(name: str, file: str) -> Callable[[bytes], None]:
    """All that is done with a program of a dialect: read, its feeds, written, its moves."""
    make = find_language(name).inserter
    inserts: Inserter | None = None if make is None else make()

    def work(data: bytes) -> None:
        job = find_language(name).read_job(
            [(file, data)], frames=TABLE if name in SAMPLES else NONE
        )
        for program in job:
            stated_feeds(program)
            keep = Replacement(
                changed=program.reason == 0, position=program.position, rotation=program.rotation,
                axes=program.axes, words=program.words,
            )  # fmt: skip
            assert write_program(program, keep) == data
        if inserts is not None:
            inserts.moves(job)

    return work


NONE = FrameTable()


@pytest.mark.parametrize("name", language_names())
def test_programs_here_are_read(name: str) -> None:
    file, program = PROGRAMS[name]
    plain = filled(program, b"between", b"", 0)
    (read,) = find_language(name).read_job([(file, plain)], frames=TABLE)
    assert len(read) >= 2
    assert detect(plain, "noname").name == name


@pytest.mark.parametrize("worst", [b"\n", b" ", b"a", b"1", b"(", b'"', b"a\n"], ids=repr)
def test_a_megabyte_of_anything_is_told_from_a_program_at_once(worst: bytes) -> None:
    def told(data: bytes) -> None:
        detect(data, "job.src")

    assert not steep(told, lambda size: of(worst, size), size=1 << 18, most=1 << 20)


@pytest.mark.parametrize("name", language_names())
def test_what_is_no_program_is_refused_in_linear_time(name: str) -> None:
    work, found = used(name, PROGRAMS[name][0]), {}
    for worst in WORST:
        found[worst] = steep(
            find_language(name).detect, lambda size, w=worst: b"x 1\n" + of(w, size)
        )
        found[worst] += steep(work, lambda size, w=worst: of(w, size))
    assert not {key: why for key, why in found.items() if why}


@pytest.mark.parametrize("name", language_names())
@pytest.mark.parametrize("place", PLACES, ids=bytes.decode)
def test_worst_characters_in_a_program_take_linear_time(name: str, place: bytes) -> None:
    file, program = PROGRAMS[name]
    if b"@" + place + b"@" not in program:
        pytest.skip("no such place")
    work, found = used(name, file), {}
    for worst in INSIDE:
        found[worst] = steep(work, lambda size, w=worst: filled(program, place, w, size))
    assert not {key: why for key, why in found.items() if why}


def test_calls_inside_each_other_take_linear_time() -> None:
    def nested(size: int) -> bytes:
        count = size // len(b"get_inverse_kin()")
        call = b"get_inverse_kin(" * count + b"p[.1,.2,.3,0,0,0]" + b")" * count
        return filled(URSCRIPT, b"between", b"", 0).replace(
            b"q = p[", b"movej(" + call + b")\nq = p["
        )

    work = used("urscript", "job.script")
    work(nested(1 << 15))  # too deep to be followed, which is told, not run into
    assert not steep(work, nested)


@pytest.mark.parametrize(
    ("begins", "worst", "size"),
    [
        (b"", b"C P[1] P[2] 9mm/sec FINE ;\n", 1 << 17),
        (b"L P[1] 9mm/sec Offset,PR[1", b"IF x\n", 1 << 12),
        (b"L P[1] 9mm/sec Offset,", b"R[", 1 << 14),
        (b"L P[1] 9mm/sec Offset,", b"PR[1;", 1 << 14),
    ],
)
def test_fanuc_statements_take_linear_time(begins: bytes, worst: bytes, size: int) -> None:
    def program(size: int) -> bytes:
        return filled(FANUC_LS, b"between", b"", 0).replace(
            b"   2: !", begins + of(worst, size) + b" ;\n   2: !"
        )

    assert not steep(used("fanuc_ls", "job.ls"), program, size=size, most=4 * size)


@pytest.mark.parametrize("worst", [b"IF a ", b"CASE 1 ", b"FOR i FROM ", b"PROC a\n", b"ELSE "])
def test_data_of_a_rapid_module_are_read_in_linear_time(worst: bytes) -> None:
    def read(data: bytes) -> None:
        read_module("job.mod", data)

    assert not steep(read, lambda size: of(worst, size))


def test_moves_to_computed_elements_take_linear_time() -> None:
    point = b"P[%d]={X 1,Y 2,Z 3,A 0,B 0,C 0}\n"

    def program(size: int) -> bytes:
        count = size // (len(point) + len(b"LIN P[i]\n"))
        return b"".join([b"DEF a()\n", *(point % k for k in range(count)), b"LIN P[i]\n" * count])

    work = used("krl", "job.src")
    assert not steep(work, program, size=1 << 15, most=1 << 17)  # beyond the bound
    (read,) = find_language("krl").read_job([("job.src", program(1 << 16))], frames=NONE)
    assert (read.reason == Reason.EXPRESSION).all()
    assert "is computed" in " ".join(read.notes)


@pytest.mark.parametrize("name", BESIDE)
def test_files_of_the_controller_take_linear_time(name: str) -> None:
    found = {}
    for worst in (*WORST, b"Group: 1 ", b"X: 1.0 ", b"BASE_DATA[1]={", b"/"):
        found[worst] = steep(
            lambda data: read_controller_file(name, data),
            lambda size, w=worst: BESIDE[name].replace(b"@place@", of(w, size)),
        )
    assert not {key: why for key, why in found.items() if why}
