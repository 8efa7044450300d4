"""Feng, Liang, Xi 2018, J. Xiamen Univ. Nat. Sci. 57(5), 722-728: the worked example, p. 724-725.

Printed: turns of 3, 2.3, 3.5 deg about z, y, x, then .75, .36, .48 deg; shift of -5, 2.5, -3 mm;
stop at .02 deg and .2 mm. A triangle of 400 by 300 mm; noise-free. The numbers of the wrong
readings follow from the printed equations and have no other source than the arithmetic.
"""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.rounds import Adjustment
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose, pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue_reproductions.feng2018.equation_readings import (
    CORRECTED,
    EquationReadings,
    attitude,
    correction_of,
    turn,
    turn_angles,
)
from robotrue_reproductions.feng2018.three_point_recursion import adjust_recursively

TRIANGLE = np.array([[0.0, 0.0, 0.0], [400.0, 0.0, 0.0], [0.0, 300.0, 0.0]]) * MM
FIRST = np.array([3.0, 2.3, 3.5]) * DEG
SECOND = np.array([0.75, 0.36, 0.48]) * DEG
SHIFT = np.array([-5.0, 2.5, -3.0]) * MM
PART = apply(pose(turn(FIRST) @ turn(SECOND), SHIFT), TRIANGLE)


def replay(
    readings: EquationReadings = CORRECTED, *, passes: int = 3, stop: bool = False
) -> Adjustment:
    return adjust_recursively(
        TRIANGLE,
        np.eye(4),
        lambda run: PART,
        sigma=0.0,
        correct=correction_of(readings),
        angle_tolerance=0.02 * DEG if stop else 0.0,
        position_tolerance=0.2 * MM if stop else 0.0,
        most=passes,
    )


def worst_mm(found: Adjustment) -> Array:
    return np.array([p.worst for p in found.passes]) / MM


def test_the_two_turns_add_up_to_one_and_not_to_the_sum_of_their_angles() -> None:
    total = turn(FIRST) @ turn(SECOND)
    np.testing.assert_allclose(
        abc_from_matrix(total) / DEG, [3.771368, 2.613335, 4.010708], atol=5e-7
    )
    summed = turn(FIRST + SECOND)
    apart = np.linalg.norm(rotation_vector_from_matrix(total.T @ summed)) / DEG
    assert apart == pytest.approx(0.0593, abs=5e-5)


def test_the_first_turn_is_read_back_exactly() -> None:
    touched = apply(pose_from_xyz_abc(SHIFT, FIRST), TRIANGLE)
    np.testing.assert_allclose(turn_angles(TRIANGLE, touched) / DEG, [3.0, 2.3, 3.5], atol=1e-10)


def test_corrected_one_pass_is_enough() -> None:
    found = replay(stop=True)
    assert found.verdict == "within tolerance"
    np.testing.assert_allclose(worst_mm(found), [36.3, 0.0], atol=0.05)
    assert worst_mm(found)[1] < 1e-9
    np.testing.assert_allclose(found.passes[0].shift / MM, [-5.0, 2.5, -3.0], atol=1e-12)
    np.testing.assert_allclose(found.T_base_part[:3, :3], turn(FIRST) @ turn(SECOND), atol=1e-12)


def test_equation_11_as_printed_is_left_handed_and_diverges() -> None:
    readings = EquationReadings(second_axis="n x a")
    assert np.linalg.det(attitude(TRIANGLE, readings)) == pytest.approx(-1.0)
    assert np.linalg.det(attitude(TRIANGLE)) == pytest.approx(1.0)
    found = replay(readings)
    assert found.verdict == "diverges"
    np.testing.assert_allclose(worst_mm(found), [36, 56, 112, 220], atol=0.5)


def test_equation_12_transposed_diverges() -> None:
    found = replay(EquationReadings(attitude="base in feature"))
    assert found.verdict == "diverges"
    np.testing.assert_allclose(worst_mm(found), [36, 64, 127, 249], atol=0.5)


@pytest.mark.parametrize(
    "readings",
    [
        EquationReadings(angle_values="equation 15"),
        EquationReadings(angle_labels="text under equation 3"),
    ],
    ids=["equation 15", "text under equation 3"],
)
def test_exchanged_angles_double_the_error_in_every_pass(readings: EquationReadings) -> None:
    assert not readings.sound
    found = replay(readings, passes=6)
    assert found.verdict == "diverges"
    np.testing.assert_allclose(worst_mm(found), [36.3, 1.81, 3.62, 7.24, 14.5], atol=0.05)


def test_both_exchanges_together_are_none() -> None:
    readings = EquationReadings(angle_values="equation 15", angle_labels="text under equation 3")
    assert readings.sound
    assert replay(readings, stop=True).verdict == "within tolerance"


def test_the_angles_of_equation_15_are_another_frame_than_those_of_the_text() -> None:
    between = turn(FIRST).T @ turn(FIRST[::-1])
    angle = np.linalg.norm(rotation_vector_from_matrix(between))
    assert angle / DEG == pytest.approx(0.7212, abs=5e-5)
    assert 500.0 * angle == pytest.approx(6.29, abs=0.005)


def test_equation_14_in_the_axes_of_the_text_costs_one_pass_more() -> None:
    readings = EquationReadings(shift_axes="feature")
    off = np.abs(worst_mm(replay(readings)) - [36.3, 0.52, 0.055, 0.006])
    assert (off < [0.05, 0.005, 5e-4, 5e-4]).all()
    found = replay(readings, stop=True)
    assert found.verdict == "within tolerance"
    assert len(found.passes) == 3


def test_the_angle_tolerance_is_below_the_paper_s_own_floor() -> None:
    assert 0.4 * 0.02 * DEG / MM == pytest.approx(0.14, abs=0.001)


def test_a_reading_that_does_not_exist_is_named() -> None:
    with pytest.raises(ConfigurationError, match="second_axis is 'left'"):
        EquationReadings(second_axis="left")  # type: ignore[arg-type]
