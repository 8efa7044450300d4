"""Covariance from a data sheet."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import UM
from robotrue.errors import ConfigurationError
from robotrue.measurement.tracker import (
    TRACKERS,
    TrackerSpecification,
    default_instrument,
    one_sigma,
    point_covariance,
)

SPLIT = TrackerSpecification(
    name="split",
    range_bound=10 * UM,
    range_bound_per_m=0.5 * UM,
    angle_bound=15 * UM,
    angle_bound_per_m=6 * UM,
)


def test_line_of_sight_and_across() -> None:
    tracker = np.array([1.0, 0.0, 0.5])
    (covariance,) = point_covariance(SPLIT, np.array([[1.0, 4.0, 0.5]]), tracker)
    expected = np.diag([(15 + 24) / 2, (10 + 2) / 2, (15 + 24) / 2]) * UM
    np.testing.assert_allclose(covariance, expected**2, atol=1e-20)


def test_turns_with_the_line_of_sight() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(50, 3)) * 2.0
    tracker = np.array([3.0, -1.0, 0.2])
    covariance = point_covariance(SPLIT, points, tracker)
    distance = np.linalg.norm(points - tracker, axis=1)
    sight = (points - tracker) / distance[:, None]
    along = np.einsum("ni,nij,nj->n", sight, covariance, sight)
    np.testing.assert_allclose(np.sqrt(along), SPLIT.sigma_range(distance))
    values = np.sqrt(np.linalg.eigvalsh(covariance))
    np.testing.assert_allclose(values[:, 1:].T, [SPLIT.sigma_angle(distance)] * 2)


def test_isotropic_without_a_place_takes_the_larger_sigma() -> None:
    covariance = point_covariance(SPLIT, np.zeros((2, 3)), None)
    np.testing.assert_allclose(
        covariance, np.tile(np.eye(3) * ((15 + 18) / 2 * UM) ** 2, (2, 1, 1))
    )
    np.testing.assert_allclose(default_instrument(np.zeros((1, 3)))[0], np.eye(3) * (15 * UM) ** 2)


def test_point_on_the_tracker_is_finite() -> None:
    covariance = point_covariance(SPLIT, np.zeros((1, 3)), np.zeros(3))
    assert np.linalg.eigvalsh(covariance[0]).min() > 0.0


def test_one_sigma_is_taken_as_given() -> None:
    covariance = point_covariance(one_sigma(20 * UM), np.array([[2.0, 1.0, 0.0]]), np.zeros(3))
    np.testing.assert_allclose(covariance[0], np.eye(3) * (20 * UM) ** 2, atol=1e-22)


@pytest.mark.parametrize(
    ("name", "fixed", "slope"), [("AT960", 15, 6), ("API T3", 15, 5), ("GTS3800", 15, 6)]
)
def test_printed_bounds(name: str, fixed: float, slope: float) -> None:
    tracker = TRACKERS[name]
    assert tracker.divisor == 2.0
    assert tracker.range_bound == pytest.approx(fixed * UM)
    assert tracker.angle_bound_per_m == pytest.approx(slope * UM)


@pytest.mark.parametrize("bounds", [(-1e-6, 0.0), (0.0, 0.0), (np.nan, 0.0), (np.inf, 0.0)])
def test_bounds_that_cannot_be(bounds: tuple[float, float]) -> None:
    with pytest.raises(ConfigurationError, match="expected two numbers"):
        one_sigma(*bounds)


def test_divisor_that_cannot_be() -> None:
    with pytest.raises(ConfigurationError, match="divisor 0, expected above 0"):
        TrackerSpecification(
            name="x",
            range_bound=1e-5,
            range_bound_per_m=0.0,
            angle_bound=1e-5,
            angle_bound_per_m=0.0,
            divisor=0.0,
        )
