"""Laws of the KRL dialect on programs nobody wrote by hand."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Replacement

KRL = find_language("krl")

number = st.builds(
    lambda sign, whole, point, digits: sign + str(whole) + (point + digits if point else ""),
    st.sampled_from(["", "-", "+"]),
    st.integers(0, 3000),
    st.sampled_from([".", "."]),
    st.text("0123456789", min_size=3, max_size=7),
)
angle = st.builds(
    lambda value, digits: f"{value:.{digits}f}",
    st.one_of(st.floats(-180, 180), st.sampled_from([90.0, -90.0, 180.0, -180.0, 0.0])),
    st.integers(3, 7),
)
blank = st.sampled_from([" ", " ", "  ", "\t"])


@st.composite
def aggregate(draw: st.DrawFn) -> str:
    values = [draw(number) for _ in range(3)] + [draw(angle) for _ in range(3)]
    names = [draw(st.sampled_from([n, n.lower()])) for n in "XYZABC"]
    parts = [n + draw(blank) + v for n, v in zip(names, values, strict=True)]
    tail = draw(st.sampled_from(["", ",S 2,T 35", ",S'B010',T'B110101'", ",E1 0.0,E2 -0.000"]))
    head = draw(st.sampled_from(["", "E6POS: ", "POS:", "FRAME :"]))
    return "{" + head + draw(st.sampled_from([",", ", "])).join(parts) + tail + "}"


@st.composite
def programs(draw: st.DrawFn) -> bytes:
    lines = ["&ACCESS RVP", "DEF part()"]
    for i in range(draw(st.integers(1, 8))):
        a, b = draw(aggregate()), draw(aggregate())
        lines += draw(
            st.sampled_from(
                [
                    [f"LIN {a} C_DIS"],
                    [f"  ptp {a}"],
                    [f"CIRC {a}, {b} ; to {b}"],
                    [f"SLIN {a} WITH $VEL.CP=0.2 C_DIS"],
                    [f"p{i}={a}", f"LIN p{i} C_VEL"],
                    [f"gs[{i}]={{fCnC {a}, grFeed 3000}}", f"LIN gs[{i}].fcnc"],
                    [f"$BASE={a}", f"BASE_DATA[1]={b}"],
                    [f"; comment {a}", "$OUT[1]=TRUE ; \xe4\xf6 {"],
                ]
            )
        )
    end = draw(st.sampled_from(["\n", "\r\n"]))
    text = end.join([*lines, "END"]) + draw(st.sampled_from(["", end]))
    return draw(st.sampled_from([b"", b"\xef\xbb\xbf"])) + text.encode("latin-1")


def read(data: bytes) -> Program:
    return KRL.read(data, name="part.src", frames=FrameTable())


def moved(program: Program, shift: np.ndarray, turn: np.ndarray) -> Replacement:
    return Replacement(
        changed=np.ones(len(program), dtype=bool),
        position=program.position + shift,
        rotation=program.rotation @ turn,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


@given(programs())
@settings(max_examples=40, deadline=None)
def test_zero_correction_is_the_identity(data: bytes) -> None:
    program = read(data)
    assert KRL.write(program, moved(program, np.zeros(3), np.eye(3))) == data


@given(programs(), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_what_is_written_is_read_again_and_nothing_else_changed(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    shift = rng.normal(0.0, 1.0, (len(program), 3)) * MM
    turn = matrix_from_abc(rng.normal(0.0, 0.1, (len(program), 3)) * DEG)
    change = moved(program, shift, turn)
    out = KRL.write(program, change)
    again = read(out)
    # Three decimals at least: half a micrometre, and half a thousandth of a degree per angle.
    assert np.abs(again.position - change.position).max(initial=0) <= 0.5001e-3 * MM
    assert np.abs(again.rotation - change.rotation).max(initial=0) <= 3 * 0.5001e-3 * DEG
    # Aligned columns may give up blanks.
    numbers = re.compile(rb"([XYZABC])[ \t]+[+-]?\d+\.\d+", re.IGNORECASE)
    assert numbers.sub(rb"\1#", out) == numbers.sub(rb"\1#", data)
    # Applied and taken back, the file is where it was to half a digit each way.
    back = read(KRL.write(again, moved(again, program.position - again.position, np.eye(3))))
    assert np.abs(back.position - program.position).max(initial=0) <= 0.5001e-3 * MM


@given(st.binary(max_size=300))
@settings(max_examples=50, deadline=None)
def test_any_bytes_are_read_or_refused_by_name(data: bytes) -> None:
    try:
        program = read(b"DEF p()\n" + data)
    except FormatError:
        return
    assert KRL.write(program, moved(program, np.zeros(3), np.eye(3))) == program.data


@given(st.text("LINPTCXYZABS{}=,:;.'[]()$ \n0159", max_size=120))
@settings(max_examples=60, deadline=None)
def test_any_krl_letters_are_read_or_refused_by_name(text: str) -> None:
    try:
        program = read(b"DEF p()\n" + text.encode())
    except FormatError:
        return
    assert KRL.write(program, moved(program, np.zeros(3), np.eye(3))) == program.data
