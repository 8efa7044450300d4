from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.deng2022.readings import SIMILARITY_READINGS
from robotrue.calibration.deng2022.similarity import similarities, similarity
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError


@pytest.fixture
def errors():
    return 1e-3 * np.random.default_rng(2).normal(size=(3, 60, 3))


@pytest.mark.parametrize("reading", SIMILARITY_READINGS)
def test_a_region_is_like_itself(errors, reading):
    assert similarity(errors[0], errors[0], reading=reading) == pytest.approx(1.0, abs=1e-12)


def test_eq_9_and_10_by_hand():
    a = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 4.0], [0.5, 2.0, 0.0]])
    b = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 3.0], [0.0, 1.0, 1.0]])
    # a: (0,0,0), (1,1,1), (.5,1,0); b: (1,0,0), (0,1,1), (0,1,0); the first point has no angle
    want = np.mean([2.0 / np.sqrt(6.0), 1.0 / np.sqrt(1.25)])
    assert similarity(a, b) == pytest.approx(want, rel=1e-14)


def test_the_swapped_reading_mirrors_the_normalised_errors(errors):
    a, b = errors[:2]
    assert similarity(a, b, reading="swapped") == pytest.approx(similarity(-a, -b), rel=1e-12)


def test_normalised_readings_ignore_offset_and_scale_of_each_axis_and_raw_does_not(errors):
    a, b = errors[:2]
    other = b * np.array([3.0, 0.2, 1.0]) + np.array([0.01, 0.0, -0.02])
    for reading in ("per-point", "swapped", "per-axis"):
        assert similarity(a, other, reading=reading) == pytest.approx(
            similarity(a, b, reading=reading), rel=1e-9
        )
    for reading in ("raw", "shared"):
        assert abs(similarity(a, other, reading=reading) - similarity(a, b, reading=reading)) > 0.01


def test_shared_limits_are_those_of_all_regions(errors):
    a, b, c = errors
    both = similarities(a, [b, 10.0 * c], reading="shared")
    assert abs(both[0] - similarity(a, b, reading="shared")) > 1e-3


def test_what_cannot_be_compared_is_refused(errors):
    flat = errors[1].copy()
    flat[:, 1] = 2e-3
    with pytest.raises(ObservabilityError, match="the y errors of a region are all 2 mm"):
        similarity(errors[0], flat)
    with pytest.raises(ShapeError, match="region 1 has shape"):
        similarity(errors[0], errors[1, :10])
    with pytest.raises(ShapeError, match="no points"):
        similarity(np.empty((0, 3)), np.empty((0, 3)))
    with pytest.raises(ConfigurationError, match="no reading 'printed'"):
        similarity(errors[0], errors[1], reading="printed")
    with pytest.raises(ObservabilityError, match="every vector is zero"):
        similarity(np.zeros((3, 3)), np.zeros((3, 3)), reading="raw")
