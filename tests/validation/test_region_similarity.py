"""Similarity of stated regions, point by point: pairs, readings, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.regions import CubeRegion, CylinderRegion, grid_points
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.validation.region_similarity import (
    NamedRegion,
    compare_regions,
    count_cylinder_wins,
    divide_points,
)

AROUND = {"radius": (0.8, 1.2), "height": (0.6, 1.0)}


def sector(name, low, high, **around):
    region = CylinderRegion(angle=(low * DEG, high * DEG), **{**AROUND, **around})
    return NamedRegion(name=name, region=region)


def box(name, low, high):
    return NamedRegion(name=name, region=CubeRegion(x=(0.8, 1.2), y=(low, high), z=(0.6, 1.0)))


@pytest.fixture
def sectors():
    return [sector("A", -20, -10), sector("B", 0, 10), sector("C", 10, 20)]


@pytest.fixture
def points(sectors):
    rng = np.random.default_rng(2)
    grids = [grid_points(each.region, (3, 4, 3)) for each in sectors]
    return np.concatenate(grids)[rng.permutation(108)]


def turned(points):
    """Errors that depend on radius and height alone: the same in every sector."""
    radius = np.hypot(points[:, 0], points[:, 1])
    return MM * np.column_stack([radius, -radius * points[:, 2], points[:, 2] ** 2])


def test_corresponding_points_are_those_at_the_same_place_of_their_region(sectors, points):
    found = compare_regions(points, turned(points), sectors, apart=20 * MM)
    assert [(each.reference, each.name, len(each.rows)) for each in found] == [
        ("A", "B", 36),
        ("A", "C", 36),
    ]
    for each in found:
        assert each.apart.max() < 1e-9
        for reading in ("per-point", "raw", "shared", "per-axis"):
            assert each.values[reading] == pytest.approx(1.0, abs=1e-9)
    radius, height = np.hypot(points[:, 0], points[:, 1])[:, None], points[:, 2:]
    whole = radius**2 + height**2
    for each, turn in zip(found, (20.0, 30.0), strict=True):
        cosine = (radius**2 * np.cos(turn * DEG) + height**2) / whole
        assert each.values["coordinates"] == pytest.approx(cosine[each.rows].mean(), abs=1e-9)


def test_errors_of_another_shape_are_less_alike(sectors, points):
    errors = turned(points)
    angle = np.arctan2(points[:, 1], points[:, 0])
    errors[:, 0] += 2.0 * MM * np.sin(9.0 * angle)
    b, c = compare_regions(points, errors, sectors, apart=20 * MM)
    assert b.values["raw"] < 0.97
    assert c.values["per-point"] < 0.999


def test_points_too_far_apart_do_not_correspond(sectors, points):
    moved = sector("B", 0, 10, radius=(0.86, 1.26))
    with pytest.raises(
        ObservabilityError, match=r"0 of 36 points of A have a counterpart within 5 mm among"
    ):
        compare_regions(points, turned(points), [sectors[0], moved], apart=5 * MM)  # fmt: skip


def test_a_region_without_points_and_one_that_overlaps(sectors, points):
    with pytest.raises(
        ObservabilityError, match=r"region Z \(angle 100 to 120 deg.*holds none of 108"
    ):
        compare_regions(points, turned(points), [sectors[0], sector("Z", 100, 120)], apart=0.05)
    with pytest.raises(ConfigurationError, match="regions A and O overlap by 5 deg"):
        compare_regions(points, turned(points), [sectors[0], sector("O", -15, 0)], apart=0.05)
    with pytest.raises(ConfigurationError, match="one cylinder region, A; a reference"):
        compare_regions(points, turned(points), sectors[:1], apart=0.05)


def test_cylinder_against_cube_counts_regions_in_their_order():
    grid = np.concatenate([grid_points(box("b", -0.4, 0.4).region, (5, 9, 4))])
    angle = np.arctan2(grid[:, 1], grid[:, 0])
    local = turned(grid)
    c, s = np.cos(angle), np.sin(angle)
    errors = np.column_stack(
        [c * local[:, 0] - s * local[:, 1], s * local[:, 0] + c * local[:, 1], local[:, 2]]
    )
    regions = divide_points(grid, 2)
    assert [each.name for each in regions] == ["sector 0", "sector 1", "box 0", "box 1"]
    found = compare_regions(grid, errors, regions, apart=0.2)
    wins = count_cylinder_wins(found, "raw")
    cylinder, cube = (each.values["raw"] for each in found)
    assert wins == (int(cylinder > cube), 1)
    assert count_cylinder_wins(found[:1], "raw") is None
