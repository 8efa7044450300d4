from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.regions import (
    CubeRegion,
    CylinderRegion,
    contains,
    coordinates_of,
    corners,
    divide_region,
    grid_coordinates,
    grid_points,
    points_at,
    random_coordinates,
    turn_region,
)
from robotrue.core.units import DEG
from robotrue.errors import ShapeError

SLAB = CylinderRegion(angle=(170 * DEG, 200 * DEG), radius=(0.8, 1.4), height=(0.7, 1.2))
BOX = CubeRegion(x=(0.7, 0.9), y=(-0.2, 0.4), z=(0.5, 1.0))


@pytest.mark.parametrize("region", [SLAB, BOX])
def test_coordinates_and_points_are_inverse_across_half_a_turn(region):
    want = grid_coordinates(region, (4, 3, 2))
    assert want.shape == (24, 3)
    np.testing.assert_allclose(coordinates_of(region, points_at(region, want)), want, atol=1e-14)


@pytest.mark.parametrize("region", [SLAB, BOX])
def test_grid_corners_and_draws_are_inside_and_neighbours_are_not(region):
    rng = np.random.default_rng(1)
    for points in (
        grid_points(region, (3, 7, 6)),
        corners(region),
        points_at(region, random_coordinates(region, 100, rng)),
    ):
        assert contains(region, points).all()
    low, high = region.limits.T
    for axis in range(3):
        outside = np.tile(0.5 * (low + high), (2, 1))
        outside[:, axis] = low[axis] - 1e-3, high[axis] + 1e-3
        assert not contains(region, points_at(region, outside)).any()


def test_a_grid_of_one_value_stands_in_the_middle():
    np.testing.assert_allclose(grid_coordinates(BOX, (1, 1, 1)), [[0.8, 0.1, 0.75]])


def test_parts_cover_the_region_with_the_gap_or_overlap_asked_for():
    region = CylinderRegion(angle=(-30 * DEG, 40 * DEG), radius=(0.8, 1.4), height=(0.7, 1.2))
    parts = divide_region(region, 5, gap=5 * DEG)
    np.testing.assert_allclose(
        np.array([p.angle for p in parts]) / DEG,
        [(-30, -20), (-15, -5), (0, 10), (15, 25), (30, 40)],
    )
    lapped = divide_region(BOX, 3, axis=1, gap=-0.06)
    assert lapped[0].y[0] == pytest.approx(-0.2)
    assert lapped[-1].y[1] == pytest.approx(0.4)
    assert lapped[0].y[1] - lapped[1].y[0] == pytest.approx(0.06)


def test_a_turned_slab_holds_the_turned_points():
    points = grid_points(SLAB, (2, 2, 2))
    c, s = np.cos(0.7), np.sin(0.7)
    there = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assert contains(turn_region(SLAB, 0.7), there).all()
    assert not contains(SLAB, there).any()


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: CubeRegion(x=(1.0, 0.0), y=(0.0, 1.0), z=(0.0, 1.0)), "x from 1 to 0"),
        (
            lambda: CylinderRegion(angle=(0.0, 7.0), radius=(0.0, 1.0), height=(0.0, 1.0)),
            "more than one turn",
        ),
        (
            lambda: CylinderRegion(angle=(0.0, 1.0), radius=(-1.0, 1.0), height=(0.0, 1.0)),
            "0 or more",
        ),
        (lambda: divide_region(BOX, 3, gap=0.2), "do not fit x"),
        (lambda: divide_region(BOX, 0), "0 parts"),
        (lambda: grid_coordinates(BOX, (0, 1, 1)), "1 or more each way"),
    ],
)
def test_what_cannot_be_is_refused(make, match):
    with pytest.raises(ShapeError, match=match):
        make()
