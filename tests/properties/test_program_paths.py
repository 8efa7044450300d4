"""Laws of G-code, APT and CSV paths on programs nobody wrote by hand, whole and damaged."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from damaged import Edits, edited, edits, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import Motion, Program, Reason

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "program"))
from path_samples import SAMPLES, moved, read

number = st.builds(
    lambda sign, whole, digits: f"{sign}{whole}.{digits}",
    st.sampled_from(["", "-"]),
    st.sampled_from(["", "0", "12", "345"]),
    st.text("0123456789", min_size=1, max_size=5),
)
angle = st.builds(lambda v, d: f"{v:.{d}f}", st.floats(-179, 179), st.integers(1, 5))
tilt = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))


def axis_of(xy: tuple[float, float]) -> list[str]:
    v = np.array([*xy, 1.0])
    return [f"{c:.6f}" for c in v / np.linalg.norm(v)]


@st.composite
def blocks(draw: st.DrawFn, kind: str) -> list[str]:
    """Blocks with words left out, axes and angles, arcs, comments."""
    equal = "=" if kind == "sinumerik" else ""
    plus = "+" if kind == "heidenhain" else ""

    def signed(text: str) -> str:
        return text if text.startswith("-") else plus + text

    gap = " " if kind == "heidenhain" else draw(st.sampled_from(["", " "]))
    first = gap.join(f"{c}{signed(draw(number))}" for c in "XYZ")
    turn = gap.join(f"{c}{equal}{signed(draw(angle))}" for c in "ABC")
    out = [f"{first}{gap}{turn}"]
    for _ in range(draw(st.integers(0, 8))):
        letters = draw(st.lists(st.sampled_from("XYZ"), min_size=1, max_size=3, unique=True))
        words = [f"{c}{signed(draw(number))}" for c in letters]
        choice = draw(st.integers(0, 5))
        if choice == 0:
            words += [
                f"{c}{equal}{signed(draw(angle))}" for c in draw(st.sampled_from(["A", "BC"]))
            ]
        if choice == 1 and kind == "sinumerik":
            words += [
                f"{n}={v}" for n, v in zip(("A3", "B3", "C3"), axis_of(draw(tilt)), strict=True)
            ]
        out.append(gap.join(words))
    return out


@st.composite
def sinumerik(draw: st.DrawFn) -> bytes:
    lines = ["N10 G90 G17 G71 G40", "T1 D1", "G54", "TRAORI"]
    for k, text in enumerate(draw(blocks("sinumerik"))):
        head = draw(st.sampled_from(["", f"N{10 * k} ", "G1 ", f"N{k}G0"]))
        lines.append(head + text + draw(st.sampled_from(["", " ; X1", " F100.5"])))
        if draw(st.integers(0, 6)) == 0:
            lines.append(draw(st.sampled_from([
                "G2 X10.5 Y10.25 I=2.5 J=1.0", "G3 I5.0", "CIP X1.0 Y2.0 Z3.0 I1=4.0 J1=5.0 K1=6.0",
                "G2 X100.0 CR=60.0", "; note", "MSG(\"X1\")", "R1=5", "G4 F1", "TRAORI",
            ])))  # fmt: skip
            lines.append("G1")
    return joined(draw, [*lines, "M30"])


@st.composite
def fanuc(draw: st.DrawFn) -> bytes:
    lines = ["%", "O1 (A)", "G90 G17 G21 G40", "T1", "G54", "G43.4 H1"]
    for k, text in enumerate(draw(blocks("fanuc"))):
        head = draw(st.sampled_from(["", f"N{10 * k} ", "G01 ", f"N{k}G0"]))
        lines.append(head + text + draw(st.sampled_from(["", "(X1)", " F100. ;"])))
        if draw(st.integers(0, 6)) == 0:
            lines.append(draw(st.sampled_from([
                "G2 X10.5 Y10.25 I2.5 J1.", "G3 I5.", "G2 X100. R60.", "(note)", "#1=5", "G4 P100",
            ])))  # fmt: skip
            lines.append("G1")
    return joined(draw, [*lines, "M30", "%"])


@st.composite
def heidenhain(draw: st.DrawFn) -> bytes:
    lines = ["BEGIN PGM A MM", "TOOL CALL 1 Z S100", "M128"]
    for text in draw(blocks("heidenhain")):
        lines.append("L " + text + draw(st.sampled_from(["", " R0 FMAX", " F100 M8"])))
        if draw(st.integers(0, 5)) == 0:
            i, j, k = axis_of(draw(tilt))
            lines.append(f"LN X+1.5 Y+2.5 Z+3.5 TX{float(i):+.6f} TY{float(j):+.6f} TZ+{k}")
            lines.append("L X+1 Y+2 Z+3 A+1.5 B+0 C+10.25")
        if draw(st.integers(0, 6)) == 0:
            lines += ["CC X+10.5 Y+3.25", "C X+20.5 Y+3.25 DR-"]
    text = [f"{k} {line}" for k, line in enumerate([*lines, "END PGM A MM"])]
    return joined(draw, text)


@st.composite
def apt(draw: st.DrawFn) -> bytes:
    lines = ["UNITS/MM", "MULTAX/ON"]
    for _ in range(draw(st.integers(1, 8))):
        words = [draw(number) for _ in range(3)]
        if draw(st.booleans()):
            words += axis_of(draw(tilt))
        mark = draw(st.sampled_from([",", ", ", " ,  "]))
        lines.append(draw(st.sampled_from(["GOTO/", "GOTO  /  ", "goto/ "])) + mark.join(words))
        lines.append(draw(st.sampled_from(["FEDRAT/300,MMPM", "$$ GOTO/1,2,3", "RAPID"])))
    return joined(draw, [*lines, "FINI"])


@st.composite
def table(draw: st.DrawFn) -> bytes:
    mark = draw(st.sampled_from([",", ";"]))
    with_axis = draw(st.booleans())
    names = ["x_mm", "y_mm", "z_mm", *(["i", "j", "k"] if with_axis else []), "rapid"]
    order = draw(st.permutations(range(len(names))))
    rows = [names]
    for _ in range(draw(st.integers(1, 6))):
        words = [draw(number) for _ in range(3)]
        words += axis_of(draw(tilt)) if with_axis else []
        quote = draw(st.sampled_from(["", '"']))
        rows.append([f"{quote}{w}{quote}" for w in words] + [draw(st.sampled_from(["", "0", "1"]))])
    return joined(draw, [mark.join(row[k] for k in order) for row in rows])


def joined(draw: st.DrawFn, lines: list[str]) -> bytes:
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return (end.join(lines) + draw(st.sampled_from(["", end]))).encode()


GENERATED = {
    "sinumerik": sinumerik(),
    "fanuc_gcode": fanuc(),
    "heidenhain": heidenhain(),
    "apt": apt(),
    "toolpath_csv": table(),
}
NAMES = sorted(GENERATED)
STILL = np.zeros(3), np.eye(3)


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
@settings(max_examples=20, deadline=None)
def test_zero_correction_is_the_identity(name: str, data: st.DataObject) -> None:
    source = data.draw(GENERATED[name])
    program = read(name, source)
    assert len(program)
    assert find_language(name).write(program, moved(program, *STILL)) == source


def half_digits(program: Program) -> np.ndarray:
    """What three decimals hold, for points; middles of plane arcs follow their neighbours."""
    written = np.asarray(program.spans.numbers.start[:, :3] >= 0)
    virtual = (program.motion == Motion.ARC_VIA) & ~written.any(axis=1)
    return np.where(virtual, np.inf, 0.51e-3 * MM)


def tool_axis(program: Program) -> np.ndarray:
    return program.spans.rule.axes_of(program.rotation)


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_what_is_written_is_read_again(name: str, data: st.DataObject, seed: int) -> None:
    source = data.draw(GENERATED[name])
    program = read(name, source)
    rng = np.random.default_rng(seed)
    n = len(program)
    # One place has one correction: the ends of a whole circle stay together.
    _, place = np.unique(program.position, axis=0, return_inverse=True)
    shift = rng.normal(0.0, 1.0, (n, 3))[place.ravel()] * MM
    change = moved(program, shift, matrix_from_abc(rng.normal(0.0, 0.1, (n, 3)) * DEG), 0.01)
    out = find_language(name).write(program, change)
    again = read(name, out)
    np.testing.assert_array_equal(again.motion, program.motion)
    use = program.reason == Reason.NONE
    np.testing.assert_array_equal(again.reason[use], program.reason[use])
    miss = np.abs(again.position - change.position).max(axis=1)
    conversational = name == "heidenhain"
    arcs = np.isin(program.motion, (Motion.ARC_VIA, Motion.ARC_END)) & conversational
    assert (miss <= half_digits(program))[use & ~arcs].all()
    turned = np.abs(
        tool_axis(again) - np.einsum("nij,j->ni", -change.rotation, program.spans.rule.cutter)
    )
    angles = program.spans.turn == 1
    told = ~program.spans.barred[:, 3:].any(axis=1) & (program.spans.turn != 0)
    told |= (program.spans.numbers.start[:, 3:] >= 0).any(axis=1)
    told &= program.motion != Motion.ARC_VIA  # half way between their neighbours
    assert turned[use & angles & told & ~arcs].max(initial=0.0) <= 3.1e-5
    assert turned[use & ~angles & told & ~arcs].max(initial=0.0) <= 1.1e-6
    # What is not changed keeps its place, whatever its neighbours do.
    kept = ~use & np.isfinite(program.position).all(axis=1) & ~arcs
    assert (np.abs(again.position - program.position).max(axis=1) <= half_digits(program))[
        kept
    ].all()
    back = read(
        name,
        find_language(name).write(
            again, moved(again, program.position - again.position, np.eye(3))
        ),
    )
    home = np.abs(back.position - program.position).max(axis=1)
    assert (home <= half_digits(program))[use & ~arcs].all()


PIECES = [
    *(b"X", b"Y-", b".", b"=", b"(", b")", b";", b"[", b"]", b"#1", b"\n", b"\r", b"$", b"/", b","),
    *(b"G2 ", b"G91 ", b"G1", b"TRANS X1", b"TRAORI", b"A3=1", b"CIP ", b"R1", b"M98 P1", b"\xff"),
    *(b"\x00", b"9" * 20, b"9" * 310, b"1E9", b"CC X+1", b"C X+1 DR+", b"LBL 1", b"Q1 = 5", b"~"),
    *(b"IX+1", b"GOTO/", b"CIRCLE/", b"UNITS/INCHES", b'"', b"TOOL CALL 2 Z", b"G70", b"%", b"+"),
]


def damaged_or_refused(name: str, data: bytes) -> bool:
    return read_or_refused(lambda d: read(name, d), find_language(name), moved, "part.nc", data)


@pytest.mark.parametrize("name", NAMES)
def test_cut_off_anywhere(name: str) -> None:
    for size in range(0, len(SAMPLES[name]) + 1, 3):
        damaged_or_refused(name, SAMPLES[name][:size])


@pytest.mark.parametrize("name", NAMES)
@given(changes=edits(PIECES))
@settings(max_examples=60, deadline=None)
def test_edited_anywhere(name: str, changes: Edits) -> None:
    damaged_or_refused(name, edited(SAMPLES[name], changes))


HEADS = {
    "heidenhain": b"BEGIN PGM A MM\n",
    "apt": b"UNITS/MM\nGOTO/1,2,3\n",
    "toolpath_csv": b"x_mm,y_mm,z_mm\n",
}


@pytest.mark.parametrize("name", NAMES)
@given(data=st.binary(max_size=200))
@settings(max_examples=25, deadline=None)
def test_any_bytes(name: str, data: bytes) -> None:
    damaged_or_refused(name, HEADS.get(name, b"G1 X1. Y1. Z1.\n") + data)


def test_only_numbers_and_words_change() -> None:
    for name, source in SAMPLES.items():
        program = read(name, source)
        out = find_language(name).write(program, moved(program, np.full(3, 1e-3), np.eye(3)))
        strip = re.compile(rb"[ ]?\b(?:[XYZ]|T[XYZ]|[IJ]|R|CR)=?[+-]?[\d.]+|[+-]?\d*\.?\d+|[ ]")
        assert strip.sub(b"", out) == strip.sub(b"", source)
