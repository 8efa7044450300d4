"""Rotations against SciPy, an independent implementation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robotrue.core import rotations as ro
from robotrue.program.euler import abc_from_matrices

angle = st.floats(-7.0, 7.0)


@given(st.tuples(angle, angle, angle))
def test_abc_is_scipys_intrinsic_zyx(abc: tuple[float, float, float]) -> None:
    ours = ro.matrix_from_abc(np.array(abc))
    np.testing.assert_allclose(ours, Rotation.from_euler("ZYX", abc).as_matrix(), atol=1e-14)


@given(st.tuples(angle, angle, angle), st.tuples(angle, angle, angle))
def test_abc_round_trip_with_and_without_a_neighbour(
    abc: tuple[float, float, float], near: tuple[float, float, float]
) -> None:
    matrix = ro.matrix_from_abc(np.array(abc))
    for options in ({}, {"near": np.array(near)}):
        back = ro.abc_from_matrix(matrix, **options)
        np.testing.assert_allclose(ro.matrix_from_abc(back), matrix, atol=1e-7)


@given(st.tuples(angle, st.floats(-1.5, 1.5), angle))
def test_abc_nearest_to_itself_is_itself(abc: tuple[float, float, float]) -> None:
    back = ro.abc_from_matrix(ro.matrix_from_abc(np.array(abc)), near=np.array(abc))
    np.testing.assert_allclose(back, abc, atol=1e-7)


@pytest.mark.parametrize("b", [90.0, -90.0])
def test_gimbal_lock_keeps_the_written_angles(b: float) -> None:
    abc = np.radians([177.227, b, -33.5])
    back = ro.abc_from_matrix(ro.matrix_from_abc(abc), near=abc)
    np.testing.assert_allclose(np.degrees(back), np.degrees(abc), atol=1e-6)


@pytest.mark.parametrize("b", [90.0, -90.0])
def test_gimbal_lock_without_a_neighbour_still_gives_the_matrix(b: float) -> None:
    matrix = ro.matrix_from_abc(np.radians([40.0, b, 15.0]))
    back = ro.abc_from_matrix(matrix)
    assert back[2] == 0.0
    np.testing.assert_allclose(ro.matrix_from_abc(back), matrix, atol=1e-12)


@pytest.mark.parametrize("off", 10.0 ** np.arange(-12.0, -2.0))
def test_near_the_lock_the_matrix_comes_back_to_rounding(off: float) -> None:
    """A and C alone are known to rounding over cos B there; what they make together is not."""
    rng = np.random.default_rng(4)
    abc = rng.uniform(-3.0, 3.0, (500, 3))
    abc[:, 1] = np.where(rng.random(500) < 0.5, 1.0, -1.0) * (np.pi / 2.0 - off)
    matrix = ro.matrix_from_abc(abc) @ ro.matrix_from_abc(rng.normal(0.0, 1e-16, (500, 3)))
    compiled = abc_from_matrices(matrix, abc + 0.01)
    for back in (ro.abc_from_matrix(matrix), ro.abc_from_matrix(matrix, near=abc + 0.01), compiled):
        np.testing.assert_allclose(ro.matrix_from_abc(back), matrix, rtol=0.0, atol=3e-12)


@given(st.tuples(angle, angle, angle))
def test_rotation_vector_round_trip(vector: tuple[float, float, float]) -> None:
    matrix = ro.matrix_from_rotation_vector(np.array(vector))
    np.testing.assert_allclose(matrix, Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)
    again = ro.matrix_from_rotation_vector(ro.rotation_vector_from_matrix(matrix))
    np.testing.assert_allclose(again, matrix, atol=1e-7)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -1, 0.5)])
@pytest.mark.parametrize("short_of_half_turn", [0.0, 1e-9, 1e-7])
def test_half_turn(axis: tuple[float, float, float], short_of_half_turn: float) -> None:
    direction = np.array(axis) / np.linalg.norm(axis)
    matrix = ro.matrix_from_rotation_vector(direction * (np.pi - short_of_half_turn))
    again = ro.matrix_from_rotation_vector(ro.rotation_vector_from_matrix(matrix))
    np.testing.assert_allclose(again, matrix, atol=1e-7)


def test_quaternion_order_is_w_first_and_length_is_forgiven() -> None:
    matrix = ro.matrix_from_quat_wxyz(np.array([0.7071, 0.0, 0.0, 0.7071]))
    np.testing.assert_allclose(matrix @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_skew_is_the_cross_product() -> None:
    a, b = np.array([1.0, 2.0, 3.0]), np.array([-4.0, 0.5, 2.0])
    np.testing.assert_allclose(ro.skew(a) @ b, np.cross(a, b))
