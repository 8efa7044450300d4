"""Laws of the Yaskawa dialect on jobs nobody wrote by hand, whole and damaged."""

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

JBI = find_language("jbi")
RATIOS = np.array([1000.0, -1200.0, 1100.0, 800.0, -700.0, 500.0])
TABLE = FrameTable(tools={"1": np.eye(4)}, bases={"2": np.eye(4)}, pulses_per_degree=RATIOS)

number = st.builds(
    lambda sign, whole, digits: f"{sign}{whole}" + (f".{digits}" if digits else ""),
    st.sampled_from(["", "-", "+"]),
    st.integers(0, 3000),
    st.text("0123456789", max_size=6),
)
angle = st.builds(
    lambda value, digits: f"{value:.{digits}f}",
    st.one_of(st.floats(-180, 180), st.sampled_from([90.0, -90.0, 180.0, -180.0, 0.0])),
    st.integers(2, 6),
)
pulse = st.integers(-400_000, 400_000).map(str)
rconf = st.lists(st.integers(0, 1).map(str), min_size=6, max_size=24).map(",".join)
HEADERS = {
    "pose": [["///POSTYPE BASE", "///RECTAN"], ["///USER 2", "///POSTYPE USER", "///RECTAN "]],
    "pulse": [["///POSTYPE PULSE", "///PULSE"], ["///PULSE"]],
    "angle": [["///POSTYPE ANGLE", "///ANGLE"]],
}
NUMBERS = re.compile(rb"(?m)^([CP]\d+=).*$")
ADDED = re.compile(rb"(?m)^///RCONF.*\n")


@st.composite
def jobs(draw: st.DrawFn) -> bytes:
    points, moves, count = ["///TOOL 1"], [], 0
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["pose", "pose", "pulse", "angle"]))
        points += draw(st.sampled_from(HEADERS[kind]))
        if kind == "pose":
            points.append("///RCONF " + draw(rconf))
        parts = {"pose": [number] * 3 + [angle] * 3, "pulse": [pulse] * 6, "angle": [angle] * 6}
        for _ in range(draw(st.integers(0, 3))):
            comma = draw(st.sampled_from([",", ",", ", "]))
            name = draw(st.sampled_from(["C", "P"])) + f"{count:05d}"
            points.append(f"{name}={comma.join(draw(st.tuples(*parts[kind])))}")
            letter = draw(st.sampled_from("JLLCS"))
            move = f"MOV{letter} {name} V=200.0 PL=1"
            moves += draw(
                st.sampled_from([[move], [move], [], [move, "'MOVL C00000 {"], ["DOUT OT#(1) ON"]])
            )
            count += 1
    lines = ["/JOB", "//NAME A", "//POS", f"///NPOS {count},0,0,0,0,0", *points, "//INST"]
    lines += ["///DATE 2026/11/21 08:11", "///ATTR SC,RW", "///GROUP1 RB1", "NOP", *moves, "END"]
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return (end.join(lines) + draw(st.sampled_from(["", end]))).encode("latin-1")


def read(data: bytes) -> Program:
    return JBI.read(data, name="part.jbi", frames=TABLE)


def moved(program: Program, shift: np.ndarray, turn: np.ndarray, bend: float = 0.0) -> Replacement:
    return Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=program.position + shift,
        rotation=program.rotation @ turn,
        axes=program.axes + bend,
        words=np.full_like(program.words, NO_WORD),
    )


@given(jobs())
@settings(max_examples=30, deadline=None)
def test_zero_correction_is_the_identity(data: bytes) -> None:
    program = read(data)
    assert JBI.write(program, moved(program, np.zeros(3), np.eye(3))) == data


@given(jobs(), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_what_is_written_is_read_again_and_nothing_else_changed(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    shift = rng.normal(0.0, 1.0, (len(program), 3)) * MM
    turn = matrix_from_abc(rng.normal(0.0, 0.1, (len(program), 3)) * DEG)
    change = moved(program, shift, turn, 0.01)
    out = JBI.write(program, change)
    again = read(out)
    pose = program.reason == Reason.NONE
    axis = program.reason == Reason.JOINT_TARGET
    # Three decimals at least: half a micrometre, and half a thousandth of a degree per angle.
    assert np.abs(again.position - change.position)[pose].max(initial=0) <= 0.5001e-3 * MM
    assert np.abs(again.rotation - change.rotation)[pose].max(initial=0) <= 3 * 0.5001e-3 * DEG
    step = np.maximum(0.5001e-3, 0.5001 / np.abs(RATIOS)) * DEG
    assert (np.abs(again.axes - change.axes)[axis] <= step).all()
    assert NUMBERS.sub(rb"\1", out) == NUMBERS.sub(rb"\1", data)
    np.testing.assert_array_equal(again.reason, program.reason)
    # Applied and taken back, the job is where it was to half a digit each way.
    undo = moved(again, program.position - again.position, np.eye(3))
    back = read(JBI.write(again, undo))
    assert np.abs(back.position - program.position)[pose].max(initial=0) <= 0.5001e-3 * MM


@given(jobs(), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_words_are_those_asked_for_and_the_counts_stay(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    words = rng.choice([0, 1, NO_WORD], program.words.shape, p=[0.1, 0.1, 0.8])
    change = moved(program, np.zeros(3), np.eye(3))
    change = Replacement(
        changed=change.changed,
        position=program.position,
        rotation=program.rotation,
        axes=program.axes,
        words=words,
    )
    out = JBI.write(program, change)
    kept = (words == NO_WORD) | (program.words == NO_WORD) | ~change.changed[:, None]
    again = read(out)
    np.testing.assert_array_equal(again.words, np.where(kept, program.words, words))
    assert ADDED.sub(b"", out) == ADDED.sub(b"", data)


SAMPLE = b"""/JOB
//NAME MILL
//POS
///NPOS 4,1,1,1,0,0
///USER 2
///TOOL 1
///POSTYPE USER
///RECTAN
///RCONF 0,0,0,0,0,0,0,0
C00000=800.000,-100.000,448.750,180.0000,-0.0000,15.0000
C00001=+1.5,-.5,4,180,0,5
///RCONF 1,0,0,0,0,0,0,0
C00002=800.000,-100.000,448.750,180.0000,90.0000,15.0000
P00105=800.000,-100.000,448.750,180.0000,-0.0000,15.0000
///POSTYPE PULSE
///PULSE
C00003=0,-90,90,0,90,0
BC00000=0
EC00000=0,12
//INST
///DATE 2026/11/21 08:11
///ATTR SC,RW,RJ
////FRAME USER 2
///GROUP1 RB1,BS1
///GROUP2 ST1
NOP
'comment
MOVJ C00000 BC00000 VJ=50.00 PL=1
MOVC C00001 V=200.0
MOVC C00002 V=200.0 FPT
SFTON P00105 UF#(1)
MOVL P00105 V=1.0 +MOVJ EC00000
SFTOF
MFRAME UF#(1) C00001 C00002 C00003
IMOV P[I000] V=1.0 BF
MOVJ C00003 VJ=50.00
END
"""
PIECES = [
    *(b",", b"=", b"/", b"///", b"'", b"+", b"[", b"#(", b"\n", b"\r", b".", b"-", b" ", b"\t"),
    *(b"C00000", b"P", b"//INST\n", b"END\n", b"\xff", b"\x00", b"9" * 20, b"1E9", b"9" * 310),
    *(b"///RECTAN\n", b"///PULSE\n", b"///TOOL 1,0\n", b"///USER \n", b"///RCONF 1\n", b"/JOB\n"),
    *(b"MOVC C00000\n", b"JUMP *A\n", b"P[I000]", b"FPT", b"SFTON\n", b"EC00000", b"//POS\n"),
]


def check(data: bytes) -> bool:
    """Returns whether the job was read; then its zero correction is the job itself."""
    return read_or_refused(read, JBI, moved, "part.jbi", data)


def test_cut_off_at_every_byte() -> None:
    whole = [size for size in range(len(SAMPLE) + 1) if check(SAMPLE[:size])]
    assert whole == [len(SAMPLE) - 1, len(SAMPLE)]


@given(edits(PIECES))
@settings(max_examples=150, deadline=None)
def test_edited_anywhere(changes: Edits) -> None:
    check(edited(SAMPLE, changes))


@given(st.binary(max_size=300), st.sampled_from([b"", b"/JOB\n//POS\n", b"/JOB\n//INST\n"]))
@settings(max_examples=60, deadline=None)
def test_any_bytes(data: bytes, head: bytes) -> None:
    check(head + data)
