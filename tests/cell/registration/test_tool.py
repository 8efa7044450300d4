"""Tool point and axis: exact, with the covariance they show; what stays open is named."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.tool import (
    fit_tool_axis_between,
    fit_tool_axis_on_plane,
    fit_tool_point,
    tool_frame,
)
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError

TIP = np.array([12.0, -7.0, 310.0]) * MM
PLACE = np.array([1.1, -0.2, 0.4])


def flanges(vectors: Array, tip: Array = TIP, place: Array = PLACE) -> Array:
    """Flange poses (n, 4, 4) with the tip at the place, turned by rotation vectors (n, 3)."""
    R = matrix_from_rotation_vector(vectors) @ matrix_from_abc(np.array([0.3, 1.2, -0.4]))
    return pose(R, place - R @ tip)


def spread(n: int, seed: int = 1, angle: float = 0.5) -> Array:
    return np.random.default_rng(seed).uniform(-angle, angle, (n, 3))


def test_exact_poses_give_the_exact_tool_point() -> None:
    found = fit_tool_point(flanges(spread(5)), sigma=0.1 * MM)
    np.testing.assert_allclose(found.p_flange_tool, TIP, atol=1e-12)
    np.testing.assert_allclose(found.p_base_point, PLACE, atol=1e-12)
    assert found.rms < 1e-12


def test_covariance_is_what_monte_carlo_finds() -> None:
    poses = flanges(spread(8))
    stated = fit_tool_point(poses, sigma=0.2 * MM)
    rng = np.random.default_rng(2)
    found = []
    for _ in range(500):
        noisy = poses.copy()
        noisy[:, :3, 3] += 0.2 * MM * rng.normal(size=(8, 3))
        one = fit_tool_point(noisy)
        found.append(np.concatenate([one.p_flange_tool - TIP, one.p_base_point - PLACE]))
    seen = np.sqrt(np.mean(np.square(found), axis=0))
    np.testing.assert_allclose(seen, np.sqrt(np.diag(stated.covariance)), rtol=0.1)


def test_a_joint_noise_changes_the_covariance_and_not_the_result() -> None:
    poses = flanges(spread(6))
    plain = fit_tool_point(poses, sigma=0.2 * MM)
    same = fit_tool_point(poses, noise=(0.2 * MM) ** 2 * np.eye(18))
    np.testing.assert_allclose(same.covariance, plain.covariance)
    common = np.kron(np.ones((6, 6)), MM**2 * np.eye(3)) + 1e-12 * np.eye(18)
    shared = fit_tool_point(poses, noise=common)
    # An error common to all poses moves the fixed point and leaves the tool alone.
    assert np.sqrt(np.trace(shared.covariance[:3, :3])) < 0.05 * MM
    np.testing.assert_allclose(np.diag(shared.covariance[3:, 3:]), MM**2, rtol=1e-3)


def test_turning_about_one_axis_leaves_that_axis_open() -> None:
    z_flange = np.array([0.0, 0.0, 1.0])
    R0 = matrix_from_abc(np.array([0.3, 1.2, -0.4]))
    about_tool = (R0 @ z_flange) * np.linspace(0.0, 3.0, 6)[:, None]
    with pytest.raises(ObservabilityError) as caught:
        fit_tool_point(flanges(about_tool), sigma=MM)
    assert str(caught.value) == (
        "6 orientations, at most 171.9 deg from the first, leave the tool point unknown along, in "
        "flange axes: (+0.00, +0.00, +1.00) (free). Allowed is 20 times one touch. Try: tilt the "
        "tool about a second axis; turning it about itself never shows its length."
    )


def test_equal_or_nearly_equal_orientations_are_refused() -> None:
    with pytest.raises(ObservabilityError, match="free"):
        fit_tool_point(flanges(np.zeros((5, 3))), sigma=MM)
    with pytest.raises(ObservabilityError, match=r"\d+ times one touch\); "):
        fit_tool_point(flanges(spread(5, angle=0.01)), sigma=MM)
    with pytest.raises(ObservabilityError, match="2 flange poses"):
        fit_tool_point(flanges(spread(2)), sigma=MM)


def test_the_worst_direction_is_named_where_tilts_are_small() -> None:
    R0 = matrix_from_abc(np.array([0.3, 1.2, -0.4]))
    z = R0[:, 2]
    turns = z * np.linspace(0, 3, 8)[:, None] + 0.05 * spread(8) / 0.5
    found = fit_tool_point(flanges(turns), sigma=0.1 * MM, weakest=100.0)
    assert abs(found.weakest[2]) > 0.99
    assert found.weakest_sigma == pytest.approx(
        float(np.sqrt(found.weakest @ found.covariance[:3, :3] @ found.weakest)), rel=1e-6
    )


def test_axis_on_a_plane() -> None:
    normal = np.array([0.1, -0.2, 1.0])
    axis = np.array([0.05, 0.02, 1.0])
    axis /= np.linalg.norm(axis)
    n = normal / np.linalg.norm(normal)
    rng = np.random.default_rng(3)
    each = []
    for turn in np.linspace(0, 5, 7):
        x = np.cross(axis, [0.0, 1.0, 0.0])
        A = np.stack([x / np.linalg.norm(x), np.cross(axis, x / np.linalg.norm(x)), axis], 1)
        y = np.cross(n, [1.0, 0.0, 0.0])
        y /= np.linalg.norm(y)
        B = np.stack([y, np.cross(-n, y), -n], 1)
        square = B @ matrix_from_rotation_vector(np.array([0.0, 0.0, turn])) @ A.T
        each.append(matrix_from_rotation_vector(0.02 * DEG * rng.normal(size=3)) @ square)
    found = fit_tool_axis_on_plane(np.array(each), normal)
    off = np.arccos(found.axis_in_flange @ axis)
    assert off < 0.03 * DEG
    assert 0.005 * DEG < np.sqrt(found.covariance.trace() / 2) < 0.02 * DEG
    each[3] = matrix_from_rotation_vector(np.array([0.2, 0.0, 0.0])) @ each[3]
    with pytest.raises(ImplausibleDataError, match="squaring 4"):
        fit_tool_axis_on_plane(np.array(each), normal)
    with pytest.raises(ShapeError):
        fit_tool_axis_on_plane(np.array(each[:1]), normal)


def test_axis_between_a_short_and_a_long_gauge() -> None:
    axis = np.array([0.05, 0.02, 1.0]) / np.linalg.norm([0.05, 0.02, 1.0])
    rng = np.random.default_rng(4)

    def gauge(length: float) -> Array:
        poses = flanges(spread(8, seed=int(length * 1e3)), tip=TIP + length * axis)
        poses[:, :3, 3] += 0.05 * MM * rng.normal(size=(8, 3))
        return poses

    short, long = (fit_tool_point(gauge(length), sigma=0.05 * MM) for length in (0.0, 0.2))
    found = fit_tool_axis_between(short, long)
    off = np.linalg.norm(np.cross(found.axis_in_flange, axis))
    assert off < 3 * np.sqrt(found.covariance.trace())
    with pytest.raises(ObservabilityError, match="give no direction"):
        fit_tool_axis_between(short, short)


def test_tool_frame_has_its_axis_and_the_stated_turn() -> None:
    frame = tool_frame(TIP, np.array([0.1, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(frame[:3, 1] @ np.cross(frame[:3, 2], frame[:3, 0]), 1.0)
    np.testing.assert_allclose(frame[:3, 0], [0.0, 1.0, 0.0], atol=1e-12)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    with pytest.raises(ShapeError, match="along the tool axis"):
        tool_frame(TIP, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 2.0]))
