"""Point fit: exact, with the covariance it shows, and never a silent frame."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotrue.cell.registration.baselines import feature_frame, fit_feature_frame
from robotrue.cell.registration.fit import (
    Registration,
    displace_frame,
    fit_points,
    frame_gain,
    point_covariance,
)
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse, pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError

T = pose_from_xyz_abc(np.array([1.0, 0.2, 0.6]), np.array([0.4, 0.1, -0.8]))
CORNER = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.3, 0.0]])


def pattern(n: int, seed: int = 1) -> Array:
    return np.random.default_rng(seed).uniform(-0.2, 0.2, (n, 3))


def step(found: Array, true: Array) -> Array:
    """The displacement (6,) a covariance is about."""
    turn = found[:3, :3] @ true[:3, :3].T
    return np.concatenate([found[:3, 3] - true[:3, 3], rotation_vector_from_matrix(turn)])


def monte_carlo(fit: object, touched: Array, sigma: Array, runs: int) -> Array:
    rng = np.random.default_rng(2)
    steps = [
        step(fit(touched + sigma[:, None] * rng.normal(size=touched.shape)), T)  # type: ignore[operator]
        for _ in range(runs)
    ]
    return np.sqrt(np.mean(np.square(steps), axis=0))


def test_exact_points_give_the_exact_frame() -> None:
    points = pattern(7)
    fit = fit_points(points, apply(T, points), sigma=0.1 * MM)
    np.testing.assert_allclose(fit.T_base_part, T, atol=1e-12)
    assert fit.rms < 1e-12
    assert fit.degrees_of_freedom == 15
    assert fit.names == tuple("1234567")


def test_covariance_is_what_monte_carlo_finds() -> None:
    points = pattern(12)
    sigma = 0.1 * MM * np.linspace(0.5, 2.0, 12)
    fit = fit_points(points, apply(T, points), sigma=sigma)
    seen = monte_carlo(
        lambda q: fit_points(points, q, sigma=sigma).T_base_part, apply(T, points), sigma, 500
    )
    np.testing.assert_allclose(seen, np.sqrt(np.diag(fit.covariance)), rtol=0.1)


def test_rotation_covariance_is_scipy_s_sensitivity_times_the_variance() -> None:
    points = pattern(12)
    touched = apply(T, points)
    sigma = 0.1 * MM
    fit = fit_points(points, touched, sigma=sigma)
    _, _, sensitivity = Rotation.align_vectors(
        touched - touched.mean(axis=0), points - points.mean(axis=0), return_sensitivity=True
    )
    np.testing.assert_allclose(fit.covariance[3:, 3:], sigma**2 * sensitivity, rtol=1e-9)


def test_point_covariance_is_least_at_the_centroid() -> None:
    points = pattern(10)
    sigma = 0.1 * MM
    fit = fit_points(points, apply(T, points), sigma=sigma)
    middle = point_covariance(fit, points.mean(axis=0)[None])[0]
    np.testing.assert_allclose(middle, sigma**2 / 10 * np.eye(3), atol=1e-3 * sigma**2)
    far = point_covariance(fit, points.mean(axis=0)[None] + 0.5)[0]
    assert np.trace(far) > 5.0 * np.trace(middle)


def test_noise_common_to_all_touches_does_not_average_out() -> None:
    points = pattern(30)
    common = np.kron(np.ones((30, 30)), (0.3 * MM) ** 2 * np.eye(3))
    own = (0.1 * MM) ** 2 * np.eye(90)
    fit = fit_points(points, apply(T, points), noise=common + own)
    middle = point_covariance(fit, points.mean(axis=0)[None])[0]
    want = (0.3 * MM) ** 2 + (0.1 * MM) ** 2 / 30
    np.testing.assert_allclose(np.diag(middle), want, rtol=1e-6)


def test_noise_not_stated_is_read_from_the_residuals() -> None:
    points = pattern(40)
    rng = np.random.default_rng(3)
    fit = fit_points(points, apply(T, points) + 0.2 * MM * rng.normal(size=(40, 3)))
    assert fit.sigma == pytest.approx(0.2 * MM, rel=0.15)
    assert fit.sigma_source == "residuals"
    stated = fit_points(points, apply(T, points), sigma=fit.sigma)
    np.testing.assert_allclose(np.diag(fit.covariance), np.diag(stated.covariance), rtol=0.01)


def test_misfit_is_one_where_the_stated_noise_is_the_true_one() -> None:
    points = pattern(60)
    touched = apply(T, points) + 0.2 * MM * np.random.default_rng(9).normal(size=(60, 3))
    assert fit_points(points, touched, sigma=0.2 * MM).misfit == pytest.approx(1.0, abs=0.15)
    assert fit_points(points, touched, sigma=0.02 * MM).misfit == pytest.approx(10.0, abs=1.5)
    assert fit_points(points, touched).misfit == pytest.approx(1.0)


def test_a_less_certain_point_counts_less() -> None:
    points = pattern(8)
    touched = apply(T, points)
    touched[2] += 5.0 * MM
    sigma = np.full(8, 0.1 * MM)
    even = fit_points(points, touched, sigma=sigma)
    sigma[2] = 10.0 * MM
    fit = fit_points(points, touched, sigma=sigma)
    assert np.linalg.norm(step(fit.T_base_part, T)) < 0.01 * np.linalg.norm(
        step(even.T_base_part, T)
    )


def test_gain_is_the_derivative_of_the_fit() -> None:
    points = pattern(6)
    touched = apply(T, points)
    gain = frame_gain(T, points)
    change = np.random.default_rng(4).normal(size=(6, 3)) * 1e-6
    fit = fit_points(points, touched + change, sigma=MM)
    np.testing.assert_allclose(step(fit.T_base_part, T), gain @ change.ravel(), atol=1e-10)


def test_moved_is_the_step_the_covariance_is_about() -> None:
    small = np.array([1e-3, -2e-3, 3e-3, 0.01, -0.02, 0.03])
    np.testing.assert_allclose(step(displace_frame(T, small), T), small, atol=1e-12)


def complaint(in_part: Array, in_base: Array) -> str:
    with pytest.raises((ObservabilityError, ImplausibleDataError)) as caught:
        fit_points(in_part, in_base, sigma=0.1 * MM)
    return str(caught.value)


def test_points_on_one_line_are_named_with_the_line() -> None:
    points = np.linspace(0.0, 0.3, 5)[:, None] * np.array([1.0, 0.0, 0.0])
    text = complaint(points, apply(T, points))
    assert text == (
        "points 1, 2, 3, 4, 5 lie on one line along (+1.00, +0.00, +0.00): 0 mm off it, rms, over "
        "106 mm along it; the rotation about it is not observable. Try: touch a point to the side "
        "of that line."
    )


def test_coincident_and_too_few_points_are_named() -> None:
    same = np.tile([0.1, 0.2, 0.3], (4, 1))
    assert "coincide" in complaint(same, apply(T, same))
    assert "2 points (1, 2)" in complaint(CORNER[:2], apply(T, CORNER[:2]))


def test_millimetres_for_metres_are_named() -> None:
    points = pattern(6)
    assert "millimetres" in complaint(points * 1e3, apply(T, points))


def test_a_mirrored_part_is_named() -> None:
    points = pattern(8)
    mirrored = points * np.array([1.0, -1.0, 1.0])
    assert "mirror image of the part" in complaint(points, apply(T, mirrored))


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ShapeError):
        fit_points(pattern(4), pattern(5))
    with pytest.raises(ShapeError):
        fit_points(pattern(4), pattern(4), sigma=0.0)
    with pytest.raises(ShapeError):
        fit_points(pattern(4), pattern(4), names=("a", "a", "b", "c"))


def test_feature_frame_is_right_handed_and_at_the_corner() -> None:
    frame = feature_frame(apply(T, CORNER))
    np.testing.assert_allclose(frame, T, atol=1e-12)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)


def three(fit: Registration) -> Array:
    return np.sqrt(np.diag(fit.covariance))


def test_feature_frame_covariance_is_what_monte_carlo_finds() -> None:
    touched = apply(T, CORNER)
    sigma = np.full(3, 0.1 * MM)
    fit = fit_feature_frame(CORNER, touched, sigma=0.1 * MM)
    np.testing.assert_allclose(fit.T_base_part, T, atol=1e-12)
    seen = monte_carlo(
        lambda q: feature_frame(q) @ inverse(feature_frame(CORNER)), touched, sigma, 400
    )
    np.testing.assert_allclose(seen, three(fit), rtol=0.12)


def test_a_point_fit_of_the_same_three_points_knows_more() -> None:
    touched = apply(T, CORNER)
    paper = fit_feature_frame(CORNER, touched, sigma=0.1 * MM)
    kabsch = fit_points(CORNER, touched, sigma=0.1 * MM)
    block = pattern(50) + np.array([0.2, 0.1, 0.0])
    worse, better = (
        np.trace(point_covariance(fit, block), axis1=1, axis2=2).mean() for fit in (paper, kabsch)
    )
    assert better < 0.8 * worse


def test_a_corner_at_the_wrong_name_is_named() -> None:
    with pytest.raises(ImplausibleDataError, match="the right angle is at L"):
        fit_feature_frame(CORNER[[1, 0, 2]], apply(T, CORNER), sigma=0.1 * MM)
