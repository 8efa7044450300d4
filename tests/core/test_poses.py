"""Laws of poses and of the rigid fit."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.poses import apply, fit_rigid, inverse, pose_from_xyz_abc
from robotrue.core.units import DEG


def some_pose() -> np.ndarray:
    return pose_from_xyz_abc(np.array([0.3, -1.0, 2.0]), np.array([30.0, -70.0, 110.0]) * DEG)


def test_inverse_undoes() -> None:
    np.testing.assert_allclose(some_pose() @ inverse(some_pose()), np.eye(4), atol=1e-15)


def test_apply_is_the_product() -> None:
    points = np.arange(12.0).reshape(4, 3)
    expected = (some_pose() @ np.c_[points, np.ones(4)].T).T[:, :3]
    np.testing.assert_allclose(apply(some_pose(), points), expected, atol=1e-14)


def test_fit_recovers_the_pose_and_weights_silence_an_outlier() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(8, 3))
    moved = apply(some_pose(), points)
    np.testing.assert_allclose(fit_rigid(points, moved), some_pose(), atol=1e-13)
    moved[0] += 5.0
    weights = np.ones(8)
    weights[0] = 0.0
    np.testing.assert_allclose(fit_rigid(points, moved, weights), some_pose(), atol=1e-13)


def test_fit_never_mirrors() -> None:
    points = np.random.default_rng(4).normal(size=(10, 3))
    fitted = fit_rigid(points, points * [1.0, 1.0, -1.0])
    assert np.linalg.det(fitted[:3, :3]) == pytest.approx(1.0)
