"""Robust fits: the outliers are named, good points are not, and too many wrong ones are refused."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.fit import Noise, Registration, fit_points
from robotrue.cell.registration.touches import fit_touches
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, pose_from_xyz_abc
from robotrue.core.robust import weigh_touches
from robotrue.core.surfaces import Plane
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ShapeError
from robotrue.measurement.probing_set import ProbingSet

HALF = np.array([0.2, 0.1, 0.2])
SIGMA = 0.12 * MM
GRID = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 3, indexing="ij"), -1).reshape(-1, 3) * HALF


def case(n: int, wrong: int, rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Points on the faces of a block, touched with noise, some 2 to 15 mm off."""
    points = rng.uniform(-1, 1, (n, 3)) * HALF
    axis = rng.integers(0, 3, n)
    points[np.arange(n), axis] = np.sign(points[np.arange(n), axis]) * HALF[axis]
    T = pose_from_xyz_abc(
        np.array([1.0, 0.0, 0.6]) + 6 * MM * rng.normal(size=3), 3 * DEG * rng.normal(size=3)
    )
    touched = apply(T, points) + SIGMA * rng.normal(size=(n, 3))
    bad = np.sort(rng.choice(n, wrong, replace=False))
    way = rng.normal(size=(wrong, 3))
    touched[bad] += way / np.linalg.norm(way, axis=1)[:, None] * rng.uniform(2, 15, (wrong, 1)) * MM
    return points, touched, T, bad


def fit_points_robust(
    points: Array, touched: Array, *, noise: Noise, names: tuple[str, ...] | None = None
) -> Registration:
    labels = names or tuple(str(i + 1) for i in range(len(points)))
    return fit_touches(
        ProbingSet(names=labels, point=points, position=touched), touched, noise=noise
    )


def block_rms_mm(found: Array, true: Array) -> float:
    off = apply(found, GRID) - apply(true, GRID)
    return float(np.sqrt((off**2).sum(axis=1).mean()) / MM)


@pytest.mark.parametrize(("n", "wrong"), [(8, 0), (8, 1), (8, 3), (20, 5), (20, 8)])
def test_the_frame_is_as_good_as_if_the_wrong_points_were_known(n: int, wrong: int) -> None:
    rng = np.random.default_rng(0)
    found, known, plain, missed = [], [], [], 0
    for _ in range(40):
        points, touched, T, bad = case(n, wrong, rng)
        fit = fit_points_robust(points, touched, noise=Noise(touch=SIGMA, robot=0.0))
        good = np.setdiff1d(np.arange(n), bad)
        found.append(block_rms_mm(fit.T_base_part, T))
        known.append(block_rms_mm(fit_rigid(points[good], touched[good]), T))
        plain.append(block_rms_mm(fit_rigid(points, touched), T))
        missed += len({str(b + 1) for b in bad} - set(fit.outliers))
    assert missed == 0
    assert np.median(found) < 1.05 * np.median(known)
    assert np.percentile(found, 95) < 1.1 * np.percentile(known, 95)
    assert np.percentile(found, 95) < 0.35
    if wrong:
        assert np.median(plain) > 1.0


def test_nothing_wrong_gives_the_plain_fit() -> None:
    points, touched, _, _ = case(12, 0, np.random.default_rng(1))
    fit = fit_points_robust(points, touched, noise=Noise(touch=SIGMA, robot=0.1 * MM))
    plain = fit_points(points, touched, sigma=np.hypot(SIGMA, 0.1 * MM))
    assert fit.outliers == ()
    np.testing.assert_allclose(fit.T_base_part, plain.T_base_part, rtol=0.0, atol=1e-15)
    sd = np.sqrt(np.diag(plain.covariance))
    # levers of touched points, not of predicted ones
    assert (np.abs(fit.covariance - plain.covariance) / np.outer(sd, sd)).max() < 0.01


def test_names_and_residuals_of_the_outliers_are_kept() -> None:
    points, touched, _, bad = case(10, 2, np.random.default_rng(2))
    names = tuple(f"P{i}" for i in range(10))
    fit = fit_points_robust(points, touched, noise=Noise(touch=SIGMA, robot=0.0), names=names)
    assert fit.outliers == tuple(f"P{i}" for i in bad)
    assert fit.names == names
    assert (fit.distances[bad] > 1.5 * MM).all()
    assert fit.rms < 0.4 * MM
    assert fit.degrees_of_freedom == 18


def test_a_bound_without_the_robot_rejects_good_points() -> None:
    rng = np.random.default_rng(3)
    points, touched, _, _ = case(20, 0, rng)
    touched = touched + 0.4 * MM * rng.normal(size=(20, 3))
    with pytest.raises(ImplausibleDataError, match="must include the robot's own error"):
        fit_points_robust(points, touched, noise=Noise(touch=0.05 * MM, robot=0.0))
    fit = fit_points_robust(points, touched, noise=Noise(touch=SIGMA, robot=0.4 * MM))
    assert fit.outliers == ()


def test_more_wrong_than_right_is_refused_with_names() -> None:
    points, touched, _, _ = case(8, 6, np.random.default_rng(4))
    with pytest.raises(ImplausibleDataError, match=r"of 8 touches disagree .* \(\d+\.\d\d mm\)"):
        fit_points_robust(points, touched, noise=Noise(touch=SIGMA, robot=0.0))


def test_wrong_touches_on_planes_are_named() -> None:
    planes = tuple(Plane(point=HALF * np.eye(3)[i], normal=np.eye(3)[i]) for i in range(3))
    rng = np.random.default_rng(5)
    index = np.arange(21) % 3
    points = rng.uniform(-1, 1, (21, 3)) * HALF
    points[np.arange(21), index] = HALF[index] + SIGMA * rng.normal(size=21)
    points[[2, 9, 13], index[[2, 9, 13]]] += np.array([3.0, -5.0, 4.0]) * MM
    T = pose_from_xyz_abc(np.array([1.0, 0.2, 0.6]), np.array([0.4, 0.1, -0.8]))
    start = T @ pose_from_xyz_abc(np.array([4.0, -4.0, 5.0]) * MM, np.array([2.0, -2.0, 2.0]) * DEG)
    touches = ProbingSet(
        names=tuple(str(i + 1) for i in range(21)),
        point=points,
        position=apply(T, points),
        surfaces=planes,
        touched=index,
    )
    fit = fit_touches(touches, touches.position, start=start, noise=Noise(touch=SIGMA, robot=0.0))
    assert fit.outliers == ("3", "10", "14")
    assert block_rms_mm(fit.T_base_part, T) < 0.25


def test_weights_of_one_dimension_end_at_zero_or_one() -> None:
    values = np.array([0.0, 0.1, -0.1, 0.05, 5.0, 7.0])

    def residual(weights: Array) -> Array:
        return np.abs(values - (weights @ values) / weights.sum())

    np.testing.assert_array_equal(weigh_touches(residual, 6, 0.5), [1, 1, 1, 1, 0, 0])


def test_noise_needs_both_shares() -> None:
    with pytest.raises(TypeError):
        Noise(touch=0.1 * MM)  # type: ignore[call-arg]
    with pytest.raises(ShapeError, match="not both 0"):
        Noise(touch=0.0, robot=0.0)
    assert Noise(touch=3.0, robot=4.0).sigma == 5.0
