"""The compiled conversions are those of the core, row by row."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG
from robotrue.program.euler import abc_from_matrices, matrices_from_abc, renew_abc


def triples_deg() -> np.ndarray:
    rng = np.random.default_rng(7)
    free = rng.uniform(-200.0, 200.0, (2000, 3))
    locked = free[:200].copy()
    locked[:, 1] = np.where(rng.random(200) < 0.5, 90.0, -90.0)
    corners = np.array(np.meshgrid(*[[-180.0, -90.0, 0.0, 90.0, 180.0]] * 3)).reshape(3, -1).T
    return np.concatenate([free, locked, corners])


def test_matrices() -> None:
    abc = triples_deg()
    expected = matrix_from_abc(abc * DEG)
    np.testing.assert_allclose(matrices_from_abc(abc, DEG), expected, rtol=0, atol=1e-15)


def test_nearest_triples() -> None:
    abc = triples_deg() * DEG
    turn = matrix_from_abc(np.random.default_rng(8).normal(0.0, 0.2 * DEG, abc.shape))
    rotation = np.concatenate([matrix_from_abc(abc) @ turn, matrix_from_abc(abc)])
    near = np.concatenate([abc, abc])
    ours = abc_from_matrices(rotation, near)
    # Angles to rounding, seen as rotations: near the lock A and C alone are ill-determined.
    np.testing.assert_allclose(matrix_from_abc(ours), rotation, rtol=0, atol=2e-12)
    expected = abc_from_matrix(rotation, near=near)
    usual = np.hypot(rotation[:, 0, 0], rotation[:, 1, 0]) > 1e-3
    np.testing.assert_allclose(ours[usual], expected[usual], rtol=0, atol=4e-15 * 200)
    distance = np.abs(ours - near).max(axis=1)
    assert (distance <= np.abs(expected - near).max(axis=1) + 1e-9).all()


@pytest.mark.parametrize("angle", [1e15, 1e38, 1e306])
def test_no_triple_near_an_angle_without_a_place_in_the_turn(angle: float) -> None:
    """Its turn is below the resolution of a double: 0 rad would be another rotation."""
    rotation = matrix_from_abc(np.array([[0.4, 0.2, 0.1]]))
    renewed = abc_from_matrices(rotation, np.array([[0.4, 0.2, angle]]))
    assert not abs(renewed[0, 2]) < 1e9


def test_rows_renewed_in_place() -> None:
    abc = triples_deg() * DEG
    rotation = matrix_from_abc(abc + 0.01)
    printed = np.hstack([np.full_like(abc, 7.0), abc / DEG])
    before, rows = printed.copy(), np.arange(0, len(abc), 3)
    renew_abc(rotation, rows, printed, DEG)
    np.testing.assert_array_equal(printed[rows, 3:], abc_from_matrices(rotation, abc)[rows] / DEG)
    printed[rows] = before[rows]
    np.testing.assert_array_equal(printed, before)
