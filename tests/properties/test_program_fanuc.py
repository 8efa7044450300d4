"""Laws of the Fanuc dialect on programs nobody wrote by hand, whole and damaged."""

from __future__ import annotations

import re

import numpy as np
from damaged import Edits, edited, edits, read_or_refused
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason, Replacement

LS = find_language("fanuc_ls")
TABLE = FrameTable(tools={"1": np.eye(4)}, bases={"1": np.eye(4), "2": np.eye(4)})

number = st.builds(
    lambda sign, whole, digits: f"{sign}{whole}" + (f".{digits}" if digits else ""),
    st.sampled_from(["", "-", ""]),
    st.integers(0, 3000),
    st.text("0123456789", max_size=6),
)
angle = st.builds(
    lambda value, digits: f"{value:.{digits}f}",
    st.one_of(st.floats(-180, 180), st.sampled_from([90.0, -90.0, 180.0, -180.0, 0.0])),
    st.integers(2, 6),
)
lead = st.sampled_from(["", " ", "\t", "   ", "     "])
config = st.builds(
    lambda f, u, t, a, b, c: f"{f} {u} {t}, {a}, {b}, {c}",
    st.sampled_from("NF"),
    st.sampled_from("UD"),
    st.sampled_from("TB"),
    *[st.integers(-2, 2)] * 3,
)
NUMBERS = re.compile(rb"=[ \t]*[+-]?[\d.]+([ \t]*(?:mm|deg))")
CONFIG = re.compile(rb"CONFIG : '[^']*'")


@st.composite
def record(draw: st.DrawFn, index: int) -> str:
    axis = draw(st.sampled_from([False, False, True]))
    names = [f"J{i}" for i in range(1, 7)] if axis else list("XYZWPR")
    parts = []
    for i, name in enumerate(names):
        kind = number if i < 3 and not axis else angle
        unit = "deg" if axis or i >= 3 else "mm"
        blank = draw(st.sampled_from(["", " "]))
        parts.append(f"{name}{blank}={draw(lead)}{draw(kind)}{blank} {unit}")
    told = "" if axis else f"\t\tCONFIG : '{draw(config)}',"
    name = draw(st.sampled_from(["", ':"a"', ':"b; {c"']))
    tail = draw(st.sampled_from(["", "", ",\n\tE1=     0.000  mm", "\n   GP2:\n\tUF : 1, UT : 1,\n"
                                 "\tJ1=     0.000 deg"]))  # fmt: skip
    frame = draw(st.sampled_from(["1", "2", "0", "F"]))
    return (
        f"P[{index}{name}]{{\n   GP1:\n    UF : {frame}, UT : 1,{told}\n\t"
        + draw(st.sampled_from([",\t", ",\n\t", ", "])).join(parts)
        + f"{tail}\n}};"
    )


@st.composite
def programs(draw: st.DrawFn) -> bytes:
    records, statements = [], ["UFRAME_NUM=1 ;"]
    for i in range(1, draw(st.integers(0, 6)) + 1):
        records.append(draw(record(i)))
        records.extend([] if draw(st.booleans()) else [""])
        move = f"P[{i}] 200mm/sec CNT1 ;"
        statements += draw(
            st.sampled_from(
                [
                    [f"L {move}"],
                    [f"J {move}"],
                    [f"A {move}"],
                    [f"C P[{max(i - 1, 1)}]    ", f"  {move}"],
                    [f"! L {move}", f"//L {move}"],
                    [f"L P[{i}:a] 5mm/sec FINE Offset,PR[1] ;"],
                    ["  DO[5]=ON ;", f"S {move}"],
                ]
            )
        )
    body = [f"{i:4d}:{each}" for i, each in enumerate(statements, 1)]
    head = ["/PROG  PART", "/ATTR", 'COMMENT\t\t= "x";', "/MN"]
    end = draw(st.sampled_from(["\n", "\r\n"]))
    text = end.join([*head, *body, "/POS", *"\n".join(records).split("\n"), "/END"])
    return (text + draw(st.sampled_from(["", end]))).encode("latin-1")


def plain_record(number: int) -> str:
    return (
        f"P[{number}]{{\n   GP1:\n    UF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
        f"\tX = 1.000 mm, Y = {number}.000 mm, Z = 0.000 mm, "
        "W = 0.00 deg, P = 0.00 deg, R = 0.00 deg\n};"
    )


SHARED = "\n".join(
    [
        *("/PROG  PART", "/ATTR", 'COMMENT\t\t= "x";', "/MN", "   1:UFRAME_NUM=1 ;"),
        "   2:L P[1:a] 5mm/sec FINE Offset,PR[1] ;",
        *("   3:C P[1]    ", "    :  P[2] 200mm/sec CNT1 ;", "/POS"),
        *(plain_record(1), plain_record(2), "/END"),
    ]
).encode()
"""A position that one move shifts by an unknown register and another uses as it is: the second
gets a record of its own."""


def read(data: bytes) -> Program:
    return LS.read(data, name="part.ls", frames=TABLE)


def moved(program: Program, shift: np.ndarray, turn: np.ndarray, bend: float = 0.0) -> Replacement:
    return Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=program.position + shift,
        rotation=program.rotation @ turn,
        axes=program.axes + bend,
        words=np.full_like(program.words, NO_WORD),
    )


@given(programs())
@settings(max_examples=30, deadline=None)
def test_zero_correction_is_the_identity(data: bytes) -> None:
    program = read(data)
    assert LS.write(program, moved(program, np.zeros(3), np.eye(3))) == data


@given(programs(), st.integers(0, 2**32 - 1))
@example(data=SHARED, seed=0)
@settings(max_examples=30, deadline=None)
def test_what_is_written_is_read_again_and_nothing_else_changed(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    shift = rng.normal(0.0, 1.0, (len(program), 3)) * MM
    turn = matrix_from_abc(rng.normal(0.0, 0.1, (len(program), 3)) * DEG)
    change = moved(program, shift, turn, 0.01)
    out = LS.write(program, change)
    again = read(out)
    pose = program.reason == Reason.NONE
    axis = program.reason == Reason.JOINT_TARGET
    # Three decimals at least: half a micrometre, and half a thousandth of a degree per angle.
    assert np.abs(again.position - change.position)[pose].max(initial=0) <= 0.5001e-3 * MM
    assert np.abs(again.rotation - change.rotation)[pose].max(initial=0) <= 3 * 0.5001e-3 * DEG
    assert np.abs(again.axes - change.axes)[axis].max(initial=0) <= 0.5001e-3 * DEG
    if not program.spans.written:  # those get records of their own
        # Aligned columns may give up blanks.
        assert NUMBERS.sub(rb"=#\1", out) == NUMBERS.sub(rb"=#\1", data)
    np.testing.assert_array_equal(again.reason, program.reason)
    # Applied and taken back, the program is where it was to half a digit each way.
    undo = moved(again, program.position - again.position, np.eye(3))
    back = read(LS.write(again, undo))
    assert np.abs(back.position - program.position)[pose].max(initial=0) <= 0.5001e-3 * MM


@given(programs(), st.integers(0, 2**32 - 1))
@example(data=SHARED, seed=0)
@settings(max_examples=30, deadline=None)
def test_words_are_those_asked_for(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    words = rng.choice([0, 1, NO_WORD], program.words.shape, p=[0.2, 0.2, 0.6])
    change = Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position,
        rotation=program.rotation,
        axes=program.axes,
        words=words,
    )
    out = LS.write(program, change)
    kept = (words == NO_WORD) | (program.words == NO_WORD) | ~change.changed[:, None]
    np.testing.assert_array_equal(read(out).words, np.where(kept, program.words, words))
    if not program.spans.written:  # those get records of their own
        assert CONFIG.sub(b"", out) == CONFIG.sub(b"", data)


SAMPLE = b"""/PROG  PART
/ATTR
COMMENT\t\t= "x";
/MN
   1:  UFRAME_NUM=1 ;
   2:  ! L P[1] ;
   3:J P[1] 4% CNT1 ;
   4:C P[2]
    :  P[3:end] 200mm/sec CNT1 Offset,PR[1] ;
   5:A P[1] 5mm/sec FINE ;
   6:  UTOOL[2]=PR[1] ;
   7:L P[R[1]] 5mm/sec FINE INC ;
/POS
P[1]{
   GP1:
\tUF : F, UT : 1,
\tJ1=    10.000 deg,\tJ2=   -70.000 deg,\tJ3=   100.000 deg,
\tJ4=     5.000 deg,\tJ5=    60.000 deg,\tJ6=   -20.000 deg
};
P[2:"a"]{
   GP1:
\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',
\tX =    12.500  mm,\tY =     0.375  mm,\tZ =    -1.250  mm,
\tW =   180.000 deg,\tP =     0.250 deg,\tR =     0.500 deg,
\tE1=     0.000  mm
   GP2:
\tUF : 1, UT : 1,
\tJ1=     0.000 deg
};
P[3]{
   GP1:
\tUF : 1, UT : 1,\t\tCONFIG : '',
\tX = ********  mm,\tY = ********  mm,\tZ = ********  mm,
\tW = ******** deg,\tP = ******** deg,\tR = ******** deg
};
/END
"""
PIECES = [
    *(b"{", b"}", b";", b"};", b"[", b"]", b":", b",", b"'", b'"', b"=", b"\n", b"\r", b".", b"*"),
    *(b"P[1]", b"P[", b"L P[2] ;", b"A P[2] ;", b"INC", b"\xff", b"\x00", b"9" * 20, b"9" * 310),
    *(b"/POS\n", b"/END\n", b"/MN\n", b"GP1:", b"GP2:", b"UF : 1, UT : 1,", b"deg", b"mm", b"1E9"),
    *(b"UFRAME_NUM=2 ;", b"UFRAME[1]=PR[2] ;", b"!", b"//", b"J1= 5 deg", b"-", b" ", b"\t"),
]


def check(data: bytes) -> bool:
    """Returns whether the program was read; then its zero correction is the program itself."""
    return read_or_refused(read, LS, moved, "part.ls", data)


def test_cut_off_at_every_byte() -> None:
    whole = [size for size in range(len(SAMPLE) + 1) if check(SAMPLE[:size])]
    assert whole == [len(SAMPLE) - 1, len(SAMPLE)]


@given(edits(PIECES))
@settings(max_examples=150, deadline=None)
def test_edited_anywhere(changes: Edits) -> None:
    check(edited(SAMPLE, changes))


@given(st.binary(max_size=300), st.sampled_from([b"", b"/PROG X\n/MN\n", b"/PROG X\n/MN\n/POS\n"]))
@settings(max_examples=60, deadline=None)
def test_any_bytes(data: bytes, head: bytes) -> None:
    check(head + data + b"\n/END")
