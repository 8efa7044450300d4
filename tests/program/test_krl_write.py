"""What is rewritten, how, and what never is."""

from __future__ import annotations

import numpy as np
import pytest
from krl_samples import body, changed_lines, read, replacement, write

from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import inverse
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.errors import ShapeError
from robotrue.program.program import Replacement

FULL = "LIN {X 12.500,Y -0.375,Z -1.250,A 0.500,B 0.250,C 180.000} C_DIS"


def test_only_the_number_that_changed_is_rewritten() -> None:
    program = body(FULL + " ; X 12.500\n$OUT[1]=TRUE")
    assert changed_lines(program, replacement(program, by_mm=(0.0312, 0, 0))) == [
        "LIN {X 12.531,Y -0.375,Z -1.250,A 0.500,B 0.250,C 180.000} C_DIS ; X 12.500"
    ]


def test_a_change_below_half_a_digit_keeps_the_bytes() -> None:
    program = body("LIN {X 12.500,Y -0.000,Z 1.0,A 0,B 0,C 180}")
    assert write(program, replacement(program, by_mm=(4e-4, -4e-4, 4e-5))).encode() == program.data


@pytest.mark.parametrize(
    ("old", "shift", "new"),
    [
        ("5", 0.0312, "5.0312"),
        ("5.", -0.0312, "4.9688"),
        (".5000", 0.0312, ".5312"),
        ("-.500", 0.0312, "-.469"),
        ("+12.500", 0.03, "+12.530"),
        ("1.0E-05", 0.25, "0.250010"),
        ("1.5 E+02", 0.25, "150.250000"),
        ("-0.010", 0.0101, "0.000"),
        ("999.9999", 0.0001, "1000.0000"),
        ("9.99999999999999", 0.0312, "10.03119999999999"),
        ("0.02", 0.002, "0.0220"),
    ],
)
def test_the_form_of_the_number(old: str, shift: float, new: str) -> None:
    program = body(f"LIN {{X {old},Y 0,Z 0,A 0,B 0,C 0}}")
    assert changed_lines(program, replacement(program, by_mm=(shift, 0, 0))) == [
        f"LIN {{X {new},Y 0,Z 0,A 0,B 0,C 0}}"
    ]


def test_aligned_columns_stay_aligned() -> None:
    program = body("LIN {X    99.990,Y   100.010,Z 0.0,A 0,B 0,C 0}")
    assert changed_lines(program, replacement(program, by_mm=(0.02, -0.02, 0))) == [
        "LIN {X   100.010,Y    99.990,Z 0.0,A 0,B 0,C 0}"
    ]


@pytest.mark.parametrize(
    ("old", "shift", "new"), [("X-0.010", 0.02, "X 0.010"), ("X    99.990", 0.02, "X   100.010")]
)
def test_a_long_program_is_written_alike(old: str, shift: float, new: str) -> None:
    count = (2 << 12) + 1
    program = body("\n".join([f"LIN {{{old},Y 0.0,Z 0.0,A 0,B 0,C 0}}"] * count))
    lines = changed_lines(program, replacement(program, by_mm=(shift, 0, 0)))
    assert lines == [f"LIN {{{new},Y 0.0,Z 0.0,A 0,B 0,C 0}}"] * count


def test_frames_and_loads_are_never_rewritten() -> None:
    text = (
        "$BASE={FRAME: X 1,Y 2,Z 3,A 4,B 5,C 6}\n"
        "BASE_DATA[1]={FRAME: X 1,Y 2,Z 3,A 4,B 5,C 6}\n"
        "TOOL_DATA[ 1 ]={X 1,Y 2,Z 3,A 4,B 5,C 6}\n"
        "LOAD_DATA[1]={M 50.0,CM {X 1,Y 2,Z 3,A 4,B 5,C 6},J {X 1,Y 2,Z 3}}\n"
        "DECL LOAD l={M 50.0,CM {X 1,Y 2,Z 3,A 4,B 5,C 6},J {X 1,Y 2,Z 3}}\n" + FULL
    )
    program = body(text)
    assert len(program) == 1
    lines = changed_lines(program, replacement(program, by_mm=(1, 1, 1)))
    assert lines == [
        FULL.replace("12.5", "13.5").replace("-0.375", "0.625").replace("-1.25", "-0.25")
    ]


def test_the_triple_nearest_to_the_printed_one() -> None:
    program = body("LIN {X 0,Y 0,Z 0,A -180.000,B 10.000,C 170.000}")
    turn = matrix_from_abc(np.array([0.0, 0.0, 0.1 * DEG]))
    lines = changed_lines(program, replacement(program, rotation=turn))
    assert lines == ["LIN {X 0,Y 0,Z 0,A -180.000,B 10.000,C 170.100}"]


@pytest.mark.parametrize("b", ["90.000", "-90.000", "89.9999999", "-89.99999999999"])
def test_gimbal_lock_keeps_the_split(b: str) -> None:
    program = body(f"LIN {{X 0,Y 0,Z 0,A 33.000,B {b},C -12.000}}")
    assert write(program, replacement(program)).encode() == program.data
    spin = matrix_from_abc(np.array([0.0, 0.0, 0.2 * DEG]))
    again = read(write(program, replacement(program, rotation=spin)))
    error = inverse(_pose(again)) @ _pose(program)
    assert np.abs(error[:3, :3].T - spin).max() < 1e-3 * DEG
    line = changed_lines(program, replacement(program, rotation=spin))[0]
    a = float(line.split("A ")[1].split(",")[0])
    assert abs(a - 33.0) < 0.21


def _pose(program: object) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3] = program.rotation[0]  # type: ignore[attr-defined]
    return out


def test_modal_components_are_inserted_only_where_owed() -> None:
    program = body(f"{FULL}\nLIN {{X 20.0}}\nLIN {{X 30.0}} C_DIS\nLIN {{Y 5.0}}")
    np.testing.assert_allclose(program.position[3] * 1e3, [30, 5, -1.25])
    np.testing.assert_array_equal(program.rotation[1], program.rotation[0])
    assert write(program, replacement(program)).encode() == program.data
    all_alike = changed_lines(program, replacement(program, by_mm=(0.0, 0.1, 0.0)))
    assert all_alike == [FULL.replace("-0.375", "-0.275"), "LIN {Y 5.1000}"]
    # Only the second moves: it says so, and the third takes its own value back.
    assert changed_lines(program, replacement(program, by_mm=(0.0, 0.1, 0.0), rows=[1])) == [
        "LIN {X 20.0,Y -0.2750}",
        "LIN {X 30.0,Y -0.3750} C_DIS",
    ]
    # Only the first moves: the next, unchanged, no longer inherits what it did.
    first = changed_lines(program, replacement(program, by_mm=(0.0, 0.1, 0.2), rows=[0]))
    assert first[1] == "LIN {X 20.0,Y -0.3750,Z -1.2500}"
    assert len(first) == 2


def test_small_modal_drifts_do_not_add_up() -> None:
    program = body(FULL + "".join(f"\nLIN {{X {i}.0}}" for i in range(20)))
    shift = np.zeros((len(program), 3))
    shift[:, 1] = np.arange(len(program)) * 0.4e-7
    change = replacement(program)
    change = Replacement(
        changed=change.changed,
        position=program.position + shift,
        rotation=change.rotation,
        axes=change.axes,
        words=change.words,
    )
    again = read(write(program, change))
    assert np.abs(again.position - program.position - shift)[1:, 1].max() <= 1.01e-7


def test_modal_orientation_is_inserted() -> None:
    program = body(FULL + "\nLIN {X 20.000}")
    turn = matrix_from_abc(np.array([0.05 * DEG, 0.0, 0.0]))
    text = write(program, replacement(program, rotation=turn, rows=[1]))
    assert "LIN {X 20.000,A " in text
    again = read(text)
    assert np.abs(again.rotation[1] - program.rotation[1] @ turn).max() < 1e-4 * DEG


def test_modal_axes_are_inserted() -> None:
    program = body("PTP {A1 1.000,A2 -90.000,A3 90.000,A4 0.000,A5 0.000,A6 0.000}\nPTP {A1 5.000}")
    change = replacement(program, rows=[1])
    moved = program.axes.copy()
    moved[1, 4] += 0.25 * DEG
    change = Replacement(
        changed=change.changed,
        position=change.position,
        rotation=change.rotation,
        axes=moved,
        words=change.words,
    )
    assert changed_lines(program, change) == ["PTP {A1 5.000,A5 0.2500}"]


def test_the_auxiliary_point_gets_no_orientation() -> None:
    program = body(f"{FULL}\nCIRC {{X 1.000,Y 2.000,Z 3.000}},{FULL[4:]}")
    turn = matrix_from_abc(np.array([0.05, 0.02, 0.01]))
    lines = changed_lines(program, replacement(program, by_mm=(0.1, 0, 0), rotation=turn))
    assert lines[1].startswith("CIRC {X 1.100,Y 2.000,Z 3.000},{X 12.600,Y -0.375,Z -1.250,A ")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("S 2,T 35", "S 6,T 10"),
        ("S'B010',T'B110101'", "S'B110',T'B001010'"),
        ("S 'H2',T'h23'", "S 'H6',T'h0A'"),
        ("S 'B 010',T'b 110101'", "S 'B0110',T'b0001010'"),
    ],
)
def test_status_and_turn(old: str, new: str) -> None:
    text = "PTP {X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0,%s}\nPTP {X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0}"
    program = body(text % old)
    assert program.words[0].tolist() == [2, 53 if "B" in old else 35]
    assert program.words[1].tolist() == [NO_WORD, NO_WORD]
    keep = replacement(program)
    change = Replacement(
        changed=keep.changed,
        position=keep.position,
        rotation=keep.rotation,
        axes=keep.axes,
        words=np.array([[6, 10], [6, 10]]),
    )
    assert changed_lines(program, change) == [(text % new).splitlines()[0]]


def test_a_new_value_that_is_not_a_number_is_refused() -> None:
    program = body(FULL)
    with pytest.raises(ShapeError, match=r"part\.src:4: the new target is .*expected finite"):
        write(program, replacement(program, by_mm=(np.nan, 0, 0)))
