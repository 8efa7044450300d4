"""Laws of the RAPID dialect on modules nobody wrote by hand, and on damaged ones."""

from __future__ import annotations

import re

import numpy as np
from damaged import Edits, edited, edits, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason, Replacement

RAPID = find_language("rapid")
HEAD = """MODULE part
PERS tooldata t1:=[TRUE,[[0,0,215.5],[1,0,0,0]],[2,[0,0,15],[1,0,0,0],0,0,0]];
PERS wobjdata w1:=[FALSE,TRUE,"",[[800,-100,450],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
"""

GAPS = ["", "", " ", "  ", "\n\t", " ! [1,2\n"]


@st.composite
def targets(draw: st.DrawFn) -> str:
    """A literal; its numbers come of one drawn seed, which keeps the drawing cheap."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    q = rng.normal(size=4) if rng.random() < 0.8 else np.array([1.0, 0.0, 0.0, -0.0])
    places = [
        f"{rng.choice(['', '+'])}{value:.{rng.integers(3, 8)}f}".replace("+-", "-")
        for value in rng.uniform(-3000, 3000, 3)
    ]
    turns = [f"{value:.{rng.integers(6, 10)}f}" for value in q / np.linalg.norm(q)]
    words = [str(value) for value in rng.integers(-3, 4, 4)]
    rows = [places, turns, words, [str(rng.choice(["9E9", "9E+09", "9E+9", "0"]))] * 6]
    comma = draw(st.sampled_from(GAPS)) + "," + draw(st.sampled_from(GAPS))
    return "[" + comma.join("[" + comma.join(row) + "]" for row in rows) + "]"


@st.composite
def modules(draw: st.DrawFn) -> bytes:
    data, code = [], []
    for i in range(draw(st.integers(1, 7))):
        a, b = draw(targets()), draw(targets())
        tail = draw(st.sampled_from([",v1,z1,t1\\WObj:=w1;", "\\ID:=0,v1,fine,T1,\\wobj:=W1;"]))
        stored, lines = draw(
            st.sampled_from(
                [
                    ("", f"MoveL {a}{tail}"),
                    ("", f"  movej {a}{tail} ! to {first_line(b)}"),
                    ("", f"MoveC {a},{b}{tail}"),
                    (f"CONST robtarget p{i}:={a};", f"MoveL p{i}{tail}"),
                    (f"LOCAL CONST robtarget p{i}{{2}}:=[{a},{b}];", f"MoveL p{i}{{n}}{tail}"),
                    (f"VAR robtarget p{i};", f"p{i}:={a};\nMoveL p{i}{tail}"),
                    ("", f'TPWrite "MoveL {first_line(a)}"; ! \xe4\xf6 ["'),
                    ("", f"w1.uframe:=[[1,2,{i}],[1,0,0,0]];\nIF a>1 THEN\nSetDO d,1;\nENDIF"),
                ]
            )
        )
        data.append(stored)
        code.append(lines)
    end = draw(st.sampled_from(["\n", "\r\n"]))
    text = HEAD + "\n".join([*data, "PROC main()", *code, "ENDPROC", "ENDMODULE"])
    text += draw(st.sampled_from(["", "\n"]))
    head = draw(st.sampled_from([b"", b"\xef\xbb\xbf", b"%%%\n  VERSION:1\n%%%\n"]))
    return head + text.replace("\n", end).encode("latin-1")


def first_line(text: str) -> str:
    return text.partition("\n")[0]


def read(data: bytes) -> Program:
    return RAPID.read(data, name="part.mod", frames=FrameTable())


def moved(program: Program, shift: np.ndarray, turn: np.ndarray) -> Replacement:
    return Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=program.position + shift,
        rotation=program.rotation @ turn,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


STILL = (np.zeros(3), np.eye(3))


@given(modules())
@settings(max_examples=40, deadline=None)
def test_zero_correction_is_the_identity(data: bytes) -> None:
    program = read(data)
    assert RAPID.write(program, moved(program, *STILL)) == data


@given(modules(), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_what_is_written_is_read_again_and_nothing_else_changed(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    shift = rng.normal(0.0, 1.0, (len(program), 3)) * MM
    turn = matrix_from_abc(rng.normal(0.0, 0.1, (len(program), 3)) * DEG)
    change = moved(program, shift, turn)
    out = RAPID.write(program, change)
    again = read(out)
    use = change.changed
    np.testing.assert_array_equal(again.reason, program.reason)
    np.testing.assert_array_equal(again.words, program.words)
    # Three decimals of a millimetre, six of a quaternion at least; an element is 2 q q.
    assert np.abs(again.position - change.position)[use].max(initial=0) <= 0.5001e-3 * MM
    assert np.abs(again.rotation - change.rotation)[use].max(initial=0) <= 8 * 0.5001e-6
    numbers = re.compile(rb"[+-]?\d+\.\d+")
    assert numbers.sub(b"#", out) == numbers.sub(b"#", data)
    back = read(RAPID.write(again, moved(again, program.position - again.position, np.eye(3))))
    assert np.abs(back.position - program.position)[use].max(initial=0) <= 0.5001e-3 * MM


SAMPLE = (
    HEAD
    + """LOCAL CONST robtarget p{2}:=[[[1.0,2,3],[1,0,0,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],
 [[1.0,2,3],[1,0,0,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]]; ! points
VAR robtarget q1; RECORD pair num a; num b; ENDRECORD
LOCAL PROC main(\\num n)
PDispOff; ConfL \\Off; q1:=[[1.0,2,3],[1,0,0,0],[0,0,-1,0],[5,9E9,9E9,9E9,9E9,9E9]];
w1.uframe:=[[800.0,-100.0,450.0],[1,0,0,0]]; t1.tload.mass:=5;
MoveAbsJ [[10,-70.5,100,5,60,-20],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v1,z1,t1;
MoveL Offs(q1,0,0,5),v1,z1,t1\\WObj:=w1;
TEST n
CASE 1,2: MoveC p{1},p{n},v1\\T:=5,z1,t1,\\WObj:=w1;
DEFAULT: again: TPWrite "a""b;";
ENDTEST
FOR i FROM 1 TO Dim(p,1) DO MoveL p{i},v1,z1,t1\\WObj:=w1; ENDFOR
IF n>1 THEN PDispOn \\Rot,q1,t1; ELSEIF n<1 THEN PDispOff; ELSE GOTO again; ENDIF
IF n=1 MoveJ q1,v1,z1,t1; WHILE TRUE DO path; ENDWHILE
ERROR RETRY;
ENDPROC
TRAP stop EOffsOff; ENDTRAP
FUNC num path(robtarget a) RETURN 1; ENDFUNC
ENDMODULE
"""
).encode()
PIECES = [
    *(b"[", b"]", b"{", b"}", b"(", b")", b",", b";", b"!", b'"', b":", b":=", b"\n", b"\r", b"."),
    *(b"\\", b"%", b"<X>", b"MoveL ", b"MoveC ", b"IF ", b"ENDIF ", b"PROC x()", b"ENDPROC "),
    *(b"9E999", b"1E-99", b"\xff", b"\x00", b"LOCAL ", b"p{", b"q1:=", b"w1.oframe:=", b"t1"),
    *(b"TEST ", b"CASE ", b"ERROR ", b"GOTO again;", b"VAR robtarget ", b"ENDMODULE"),
]


def check(data: bytes) -> bool:
    """Returns whether the file was read; then its zero correction is the file itself."""
    return read_or_refused(read, RAPID, moved, "part.mod", data)


def test_the_sample_is_read() -> None:
    program = read(SAMPLE)
    assert (len(program), int((program.reason == 0).sum())) == (6, 2)


def test_cut_off_at_every_byte() -> None:
    assert sum(check(SAMPLE[:size]) for size in range(0, len(SAMPLE) + 1, 3)) < 10
    assert check(SAMPLE)


@given(edits(PIECES))
@settings(max_examples=150, deadline=None)
def test_edited_anywhere(changes: Edits) -> None:
    check(edited(SAMPLE, changes))


@given(st.one_of(st.binary(max_size=300), st.text('MoveLPRC[]{}(),;:=\\!" \n019.').map(str.encode)))
@settings(max_examples=100, deadline=None)
def test_any_bytes(data: bytes) -> None:
    check(data)
    check(b"MODULE m\n" + data + b"\nENDMODULE\n")
