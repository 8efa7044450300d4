"""Names of touches: swapped ones are found, patterns that fit several ways are named."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.ambiguity import check_names, matches
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ShapeError

T = pose_from_xyz_abc(np.array([1.0, 0.2, 0.6]), np.array([0.4, 0.1, -0.8]))
RECTANGLE = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.06, 0], [0, 0.06, 0]], dtype=float)


def test_swapped_names_are_named() -> None:
    points = np.random.default_rng(1).uniform(0, 0.2, (12, 3))
    touched = apply(T, points)[[0, 1, 7, 3, 4, 5, 6, 2, 8, 9, 10, 11]]
    with pytest.raises(ImplausibleDataError, match=r"\(3 is 8, 8 is 3\)"):
        check_names(points, touched, tolerance=0.5 * MM)
    assert check_names(points, apply(T, points), tolerance=0.5 * MM) == ()


def test_any_order_of_the_touches_is_recovered() -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(0, 0.2, (20, 3))
    order = rng.permutation(20)
    others = np.empty((20, 3))
    others[order] = apply(T, points) + 0.1 * MM * rng.normal(size=(20, 3))
    (found,) = matches(points, others, tolerance=1.0 * MM)
    np.testing.assert_array_equal(found, order)


def test_a_rectangle_fits_four_ways_and_one_point_more_settles_it() -> None:
    assert len(matches(RECTANGLE, RECTANGLE, tolerance=0.1 * MM)) == 4
    (doubt,) = check_names(RECTANGLE, apply(T, RECTANGLE), tolerance=0.5 * MM)
    assert doubt.startswith("The pattern fits 4 ways within 0.50 mm")
    held = np.vstack([RECTANGLE, [0.02, 0.01, 0.0]])
    # Flat patterns may still lie upside down, but no point of this one has a twin.
    assert len(matches(held, held, tolerance=0.1 * MM)) == 1
    assert check_names(held, apply(T, held), tolerance=0.5 * MM) == ()


def test_a_mirror_image_is_no_match() -> None:
    points = np.random.default_rng(3).uniform(0, 0.2, (6, 3))
    assert matches(points, points * [1, 1, -1], tolerance=0.5 * MM) == ()


def test_too_many_points_are_refused() -> None:
    with pytest.raises(ShapeError, match="up to 60"):
        matches(np.zeros((61, 3)), np.zeros((61, 3)), tolerance=MM)
