"""Words of G-code rewritten and inserted, byte by byte."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from path_samples import RULE, SAMPLES, TABLE, moved, read

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.program.formats.path_write import path_losses
from robotrue.program.lang import find_language
from robotrue.program.program import Motion, Program, Reason, Replacement

STILL = np.eye(3)


def sinumerik(text: str) -> Program:
    return read("sinumerik", f"G90 G17 G71\nG54\nTRAORI\n{text}\n".encode())


def fanuc(text: str) -> Program:
    return read("fanuc_gcode", f"%\nG90 G17 G21\nG54 G43.4 H1\n{text}\n%\n".encode())


def written(program: Program, shift: list[list[float]], turn: np.ndarray = STILL) -> list[str]:
    """Lines behind the head after shifts in um."""
    change = moved(program, np.array(shift) * 1e-6, turn)
    out = find_language(program.dialect).write(program, change).decode().split("\n")
    return out[3:-1]


def test_numbers_keep_their_style() -> None:
    program = fanuc("G1 X-.7694 Y10. Z+5.25 A0. B0. C0.")
    assert written(program, [[200, 23, -150]]) == ["G1 X-.5694 Y10.023 Z+5.100 A0. B0. C0.", "%"]
    program = sinumerik("G1 X10 Y=.5 Z-0.0004 A=0 B=0 C=0")
    assert written(program, [[400, 20, 1]]) == ["G1 X10.400 Y=.520 Z0.0006 A=0 B=0 C=0"]


def test_a_number_that_says_it_already_stays() -> None:
    program = sinumerik("G1 X-0.000 Y2.000 Z3.000 A=0.000 B=-0.000 C=0.000")
    assert written(program, [[0.4, -0.4, 0.4]]) == [
        "G1 X-0.000 Y2.000 Z3.000 A=0.000 B=-0.000 C=0.000"
    ]


def test_words_are_inserted_where_one_was_left_out() -> None:
    program = fanuc("N1 X1.000 Y2.000 Z3.000 A0. B0. C0.\nN2 Y4.000 (NOTE)\nN3Y5.000F100.\nX2.000")
    shifts = [[0, 0, 0], [0, 0, 20], [0, 0, 20], [0, 10, 20]]
    assert written(program, shifts) == [
        "N1 X1.000 Y2.000 Z3.000 A0. B0. C0.",
        "N2 Y4.000 Z3.020 (NOTE)",
        "N3Y5.000F100.",
        "X2.000 Y5.010",
        "%",
    ]


def test_a_block_that_is_left_alone_says_what_it_kept() -> None:
    program = fanuc("X1.0 Y2.0 Z3.0 A0. B0. C0.\nX#1\nX5.0 Y2.0")
    assert program.reason.tolist() == [Reason.NONE, Reason.EXPRESSION, Reason.NONE]
    assert written(program, [[100, 100, 100]] * 3) == [
        "X1.100 Y2.100 Z3.100 A0. B0. C0.",
        "X#1 Y2.0 Z3.0",
        "X5.100 Y2.100 Z3.100",
        "%",
    ]


def test_nothing_is_inserted_where_it_would_say_another_thing() -> None:
    text = "X1.0 Y2.0 Z3.0 A0. B0. C0.\n{}\nG90 G1 X5.0 Y2.0 Z3.0"
    for block in ("G91 X1.0", "G53 X1.0", "G81 X1.0 R2.0", "G68 X0. Y0. R3.\nX1.0\nG69"):
        lines = written(fanuc(text.format(block)), [[100, 100, 100]] * 3)
        assert block.split("\n") == lines[1 : 1 + len(block.split("\n"))]


def test_turned_angles_and_axes() -> None:
    turn = matrix_from_abc(np.array([0.0, 0.0, 0.1]) * DEG)
    program = sinumerik("G1 X1.0 Y2.0 Z3.0 A=180.000 B=0.000 C=0.000\nX2.0")
    assert written(program, [[0, 0, 0]] * 2, turn) == [
        "G1 X1.0 Y2.0 Z3.0 A=180.100 B=0.000 C=0.000",
        "X2.0",
    ]
    program = sinumerik("G1 X1.0 Y2.0 Z3.0 A3=0.0 B3=0.0 C3=1.0\nX2.0")
    spun = matrix_from_abc(np.array([0.3, 0.0, 0.0]) * DEG)  # about the cutter: no word says it
    assert written(program, [[0, 0, 0]] * 2, spun)[0] == "G1 X1.0 Y2.0 Z3.0 A3=0.0 B3=0.0 C3=1.0"
    (first, second) = written(program, [[0, 0, 0]] * 2, turn)
    assert first.startswith("G1 X1.0 Y2.0 Z3.0 A3=-0.0005969 B3=-0.0016401 C3=0.99999")
    assert second == "X2.0"


def test_a_tool_axis_is_inserted_whole() -> None:
    program = sinumerik("G1 X1.0 Y2.0 Z3.0 A3=0.00000 B3=0.00000 C3=1.00000\nX2.0")
    change = moved(program, np.zeros((2, 3)), STILL)
    rotation = np.array(program.rotation)
    rotation[1] = rotation[1] @ matrix_from_abc(np.array([0.0, 0.0, 0.1]) * DEG)
    change = Replacement(
        changed=change.changed, position=change.position, rotation=rotation, axes=change.axes,
        words=change.words,
    )  # fmt: skip
    out = find_language("sinumerik").write(program, change)
    assert out.split(b"\n")[4] == b"X2.0 A3=-0.00060 B3=-0.00164 C3=1.00000"
    again = read("sinumerik", out)
    miss = RULE.axes_of(again.rotation) - RULE.axes_of(rotation)
    assert np.abs(miss).max() < 0.51e-5


def test_three_axes_print_no_turn() -> None:
    program = read("fanuc_gcode", b"%\nG90 G21\nG54\nG1 X1.0 Y2.0 Z3.0\n%\n")
    assert program.reason.tolist() == [Reason.NONE]
    turn = matrix_from_abc(np.array([0.0, 0.1, 0.1]) * DEG)
    assert written(program, [[10, 0, 0]], turn)[0] == "G1 X1.010 Y2.0 Z3.0"


def test_a_shifted_arc_keeps_its_shape() -> None:
    program = fanuc("G0 X0. Y0. Z1. A0. B0. C0.\nG2 X10. Y0. I5. J0.\nG3 X20. R5.\nG3 I5.")
    lines = written(program, [[100, 50, 20]] * 7)
    assert lines[:4] == [
        "G0 X0.100 Y0.050 Z1.020 A0. B0. C0.",
        "G2 X10.100 Y0.050 I5. J0.",
        "G3 X20.100 R5.",
        "G3 I5.",
    ]


def test_a_bent_arc_goes_through_its_middle() -> None:
    program = fanuc("G0 X0. Y0. Z1. A0. B0. C0.\nG2 X10.0000 Y0.0000 I5.0000")
    shift = [[0, 0, 0], [0, 100, 0], [0, 0, 0]]
    assert written(program, shift)[1] == "G2 X10.0000 Y0.0000 I5.0000 J0.0990"
    again = read(
        "fanuc_gcode",
        find_language("fanuc_gcode").write(program, moved(program, np.array(shift) * 1e-6, STILL)),
    )
    np.testing.assert_allclose(again.position[1] / MM, [5.0, 5.1, 1.0], atol=1e-4)


@pytest.mark.parametrize(("outwards", "radius"), [(100, "-5.00098"), (-100, "5.00102")])
def test_half_a_circle_by_its_radius_takes_the_side_of_its_centre(
    outwards: int, radius: str
) -> None:
    for given in ("R5.00000", "R-5.00000"):
        program = fanuc(f"G0 X10. Y0. Z1. A0. B0. C0.\nG3 X20. Y0. {given}")
        shift = [[0, 0, 0], [0, -outwards, 0], [0, 0, 0]]
        assert written(program, shift)[1] == f"G3 X20. Y0. R{radius}"
    assert not path_losses(program, moved(program, np.array(shift) * 1e-6, STILL))


def test_digits_of_the_radius_of_half_a_circle_are_a_loss() -> None:
    program = fanuc("G0 X10. Y0. Z1. A0. B0. C0.\nG3 X20. Y0. R5.")
    shift = np.array([[0, 0, 0], [0, -40, 0], [0, 0, 0]]) * 1e-6
    (loss,) = path_losses(program, moved(program, shift, STILL))
    assert loss.worst == pytest.approx(40.0)  # R5.000 is half a circle


def test_an_arc_whose_end_rises_is_a_helix() -> None:
    program = fanuc("G0 X0. Y0. Z1.000 A0. B0. C0.\nG2 X10.000 Y0.000 I5.000 J0.\nG1 X11.000")
    shift = [[0, 0, 0], [0, 0, 0], [0, 0, 30], [0, 0, 30]]
    assert written(program, shift)[1:3] == ["G2 X10.000 Y0.000 I5.000 J0. Z1.030", "G1 X11.000"]


def test_a_relative_arc_moves_with_its_start() -> None:
    program = fanuc("G0 X0.000 Y0.000 Z1. A0. B0. C0.\nG91 G2 X10.0 Y0.0 I5.0 J0.0")
    assert program.reason.tolist() == [Reason.NONE, Reason.RELATIVE, Reason.RELATIVE]
    assert written(program, [[10, 0, 0]] * 3)[1] == "G91 G2 X10.0 Y0.0 I5.0 J0.0"


def test_status_and_axis_values() -> None:
    text = "PTP G1 X1.0 Y1.0 Z1.0 A=1.0 B=2.0 C=3.0 STAT=2 TU=17\n"
    program = sinumerik(
        text + "TRAFOOF\nG1 JT1=10.0 JT2=-70.0 JT3=100.0 JT4=5.0 JT5=60.0 JT6=-20.0"
    )
    change = moved(program, np.zeros(3), STILL, 0.1 * DEG)
    words = np.array(change.words)
    words[0] = (6, 19)
    change = Replacement(
        changed=change.changed, position=change.position, rotation=change.rotation,
        axes=change.axes, words=words,
    )  # fmt: skip
    lines = find_language("sinumerik").write(program, change).decode().split("\n")
    assert lines[3] == "PTP G1 X1.0 Y1.0 Z1.0 A=1.0 B=2.0 C=3.0 STAT=6 TU=19"
    assert lines[5] == "G1 JT1=10.100 JT2=-69.900 JT3=100.100 JT4=5.100 JT5=60.100 JT6=-19.900"


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_what_cannot_be_printed_is_refused(name: str) -> None:
    program = read(name, SAMPLES[name])
    with pytest.raises(ShapeError, match="expected finite numbers"):
        find_language(name).write(program, moved(program, np.full(3, np.nan), STILL))
    other = read(
        "apt" if name != "apt" else "sinumerik", SAMPLES["apt" if name != "apt" else "sinumerik"]
    )
    with pytest.raises(ShapeError):
        find_language(name).write(program, moved(other, np.zeros(3), STILL))


def test_content_names_the_dialect() -> None:
    from robotrue.program.formats import detect
    from robotrue.program.lang import language_names

    for name, data in SAMPLES.items():
        scores = {each: find_language(each).detect(data) for each in language_names()}
        assert max(scores, key=lambda each: scores[each]) == name
        assert detect(data, "noname").name == name
    bare = b"N10 G1 X1.0 Y2.0 Z3.0\nN20 X2.0\nN30 Y2.0\n"
    assert detect(bare, "noname").name in ("sinumerik", "fanuc_gcode")
    assert detect(b"hello\n", "a.mpf").name == "sinumerik"
    assert TABLE.orientation.stated
    assert Motion.LIN == 1


def test_status_in_binary_and_hexadecimal() -> None:
    text = "PTP G1 X1.0 Y1.0 Z1.0 A=1.0 B=2.0 C=3.0 STAT='B010' TU='H11'\n"
    program = sinumerik("TRAORI\n" + text)
    assert program.words.tolist() == [[2, 17]]
    assert not program.notes
    change = moved(program, np.zeros(3), STILL)
    change = replace(change, words=np.array([[6, 171]]))
    out = find_language("sinumerik").write(program, change)
    assert out == program.data.replace(b"'B010'", b"'B110'").replace(b"'H11'", b"'HAB'")
    assert (
        find_language("sinumerik").write(program, moved(program, np.zeros(3), STILL))
        == program.data
    )


def modal(lines: list[str]) -> list[dict[str, float]]:
    """Where every line leaves the words X Y Z A B C, as a control keeps them; G28 goes home."""
    state: dict[str, float] = {}
    out = []
    for line in lines:
        words = re.findall(r"([XYZABC])=?(IC\(([-.\d]+)\)|[-.\d]+)", line)
        for axis, text, step in words if not line.startswith(("G52", "TRANS")) else ():
            state[axis] = state.get(axis, 0.0) + float(step) if step else float(text)
        if line.startswith("G28"):
            state |= {axis: 999.0 for axis, _, _ in words}
        out.append(dict(state))
    return out


FIRST = "G1 X1.000 Y2.000 Z3.000 A0. B1. C2.\nX2.000 Y3.000 Z4.000 A1. B2. C3.\nX4.000"


@pytest.mark.parametrize(
    "behind",
    [
        "G52 X10. Y0. Z0.\nX5.000\nY4.000",
        "G49\nX5.000",
        "G28 Z5.\nX5.000 Y5.000\nZ2.000",
        "M98 P1000\nG1 X5.000\nZ2.000",
        "G53 X5.000",
        "G81 Z1.000 R2.",
        "G68.2 X0. Y0. Z0. I0. J0. K0.\nX7.000 Z1.000",
    ],
)
def test_a_point_left_alone_inherits_no_correction(behind: str) -> None:
    program = fanuc(f"{FIRST}\n{behind}")
    left = program.reason != Reason.NONE
    assert left.tolist()[:2] == [False, False]
    assert left[2:].all()  # the last point before is left alone, too
    assert any(":6: not compensated either: the next point" in note for note in program.notes)
    turn = matrix_from_abc(np.array([0.3, 0.2, 0.1]) * DEG)
    change = moved(program, np.array([0.4, 0.5, 0.6]) * MM, turn)
    change = replace(change, changed=~left)
    after = find_language("fanuc_gcode").write(program, change).decode()
    before = program.data.decode()
    assert after != before
    one, other = (modal(text.split("\n")) for text in (before, after))
    for line in program.line[left].tolist():
        assert other[line - 1] == one[line - 1], line


def test_angles_that_go_on_behind_a_local_zero_are_written_where_they_differ() -> None:
    program = fanuc("G1 X1. Y2. Z3. A0. B1. C2.\nG52 X10. Y0. Z0.\nX1. Y2. Z3.\nX4.")
    assert not program.reason.any()
    turn = matrix_from_abc(np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.1], [0.0, 0.0, 0.0]]) * DEG)
    change = moved(program, np.zeros((3, 3)), turn)
    after = find_language("fanuc_gcode").write(program, change).decode()
    read = fanuc(after[after.index("G1 X1.") :])
    np.testing.assert_allclose(read.rotation, change.rotation, atol=1e-5)
    np.testing.assert_allclose(read.position, change.position, atol=1e-6)


@pytest.mark.parametrize(
    ("point", "alone"),
    [("X=IC(10)", False), ("X=IC(10) Y5", True), ("X=AC(10)", False), ("X=10*R1", False)],
)
def test_a_step_from_the_point_before(point: str, alone: bool) -> None:
    head = "G1 X1 Y2 Z3 A=0 B=0 C=0\nX2 Y3 Z4 A=1 B=1 C=1"
    program = sinumerik(f"{head}\nG1 {point}\nX5 Y6 Z7 A=0 B=0 C=0")
    left = Reason.INCOMPLETE if alone else Reason.NONE
    assert program.reason.tolist()[:2] == [Reason.NONE, left]
    assert program.reason[2] == (Reason.RELATIVE if "IC" in point else Reason.EXPRESSION)
    lines = written(program, [[100, 100, 100]] * 4, matrix_from_abc(np.array([0.1, 0.1, 0.1])))
    if "IC" in point:  # it goes on from where the point before it is: nothing may be put in
        assert lines[2] == f"G1 {point}"
        assert (lines[1] == "X2 Y3 Z4 A=1 B=1 C=1") == alone
    else:  # it says all words that changed as they were
        assert lines[2] == f"G1 {point} Y3 Z4 A=1 B=1 C=1"


def test_a_step_by_conversational_words_takes_nothing_in() -> None:
    text = "BEGIN PGM A MM\nM128\nL X+1 Y+2 Z+3 A+0 B+0 C+0\nL IX+10\nL X+4 Y+5 Z+6\nEND PGM A MM\n"
    program = read("heidenhain", text.encode())
    change = replace(
        moved(program, np.full((3, 3), 1e-4), STILL), changed=program.reason == Reason.NONE
    )
    lines = find_language("heidenhain").write(program, change).decode().split("\n")
    assert program.reason.tolist() == [Reason.NONE, Reason.RELATIVE, Reason.NONE]
    assert lines[3] == "L IX+10"
