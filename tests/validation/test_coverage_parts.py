"""Coverage by radius, direction of the error and distance from the training data."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.validation.metrics import wilson_interval
from robotrue.validation.report import coverage_parts

RANGE = np.array([[-1.0] * 6, [1.0] * 6])


def rows(n: int = 300):
    rng = np.random.default_rng(2)
    position = rng.uniform(-1.0, 1.0, (n, 3)) + np.array([0.0, 0.0, 0.5])
    joints = rng.uniform(-1.2, 1.2, (n, 6))
    covariance = np.tile(1e-8 * np.eye(3), (n, 1, 1))
    return 1e-4 * rng.standard_normal((n, 3)), covariance, position, joints


def test_every_row_is_in_one_part_of_each_question_and_an_honest_width_is_found_honest():
    residual, covariance, position, joints = rows()
    parts = coverage_parts(residual, covariance, position, joints, RANGE)
    for by in ("radius", "distance from the data"):
        assert sum(part.n for part in parts if part.by == by) == 300
    assert [part.part for part in parts if part.by == "direction"] == [
        "radial",
        "tangential",
        "vertical",
    ]
    assert sum(part.is_honest for part in parts) >= len(parts) - 1
    for part in parts:
        assert (part.low, part.high) == wilson_interval(round(part.share * part.n), part.n)


def test_a_part_with_too_narrow_regions_is_named():
    residual, covariance, position, joints = rows()
    far = np.linalg.norm(position, axis=1) > np.quantile(np.linalg.norm(position, axis=1), 2 / 3)
    residual[far] *= 2.0
    parts = coverage_parts(residual, covariance, position, joints, RANGE)
    radius = [part for part in parts if part.by == "radius"]
    assert [part.is_honest for part in radius] == [True, True, False]
    assert radius[2].share < 0.8


def test_directions_are_those_of_the_base_axis():
    n = 20
    position = np.tile([0.0, 1.0, 0.3], (n, 1))
    residual = np.tile([0.0, 3e-4, 0.0], (n, 1))  # along y: radial here
    covariance = np.tile(1e-8 * np.eye(3), (n, 1, 1))
    parts = coverage_parts(residual, covariance, position, np.zeros((n, 6)), None)
    share = {part.part: part.share for part in parts if part.by == "direction"}
    assert share == {"radial": 0.0, "tangential": 1.0, "vertical": 1.0}
    assert not any(part.by == "distance from the data" for part in parts)


@pytest.mark.parametrize(("beyond", "name"), [(0.5, "middle"), (0.9, "outer"), (1.1, "outside")])
def test_distance_counts_the_joint_nearest_its_end(beyond, name):
    joints = np.zeros((10, 6))
    joints[:, 3] = beyond
    residual, covariance, position, _ = (array[:10] for array in rows())
    parts = coverage_parts(residual, covariance, position, joints, RANGE)
    (part,) = [part for part in parts if part.by == "distance from the data"]
    assert name in part.part
