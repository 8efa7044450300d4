"""One frame from touches of every kind: against the point fit, many trials, wrong touches."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robotrue.cell.registration.fit import Noise, displace_frame, fit_points
from robotrue.cell.registration.touches import fit_touches, touch_gain
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.surfaces import Cylinder
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet

T = pose_from_xyz_abc(np.array([0.8, -0.1, 0.4]), np.array([0.1, -0.2, 0.3]))
NOISE = Noise(touch=1e-4, robot=0.0)
Rows = NDArray[np.float64]


def named(point: Rows, **columns: Rows | float) -> ProbingSet:
    n = len(point)
    return ProbingSet(
        names=tuple(f"P{i}" for i in range(n)),
        point=point,
        position=np.zeros((n, 3)),
        **columns,  # type: ignore[arg-type]
    )


def block(n: int, full: int, seed: int = 0) -> ProbingSet:
    """Touches of three faces of a block, the last ``full`` of them feature points."""
    rng = np.random.default_rng(seed)
    face = rng.permutation(np.arange(n) % 3)
    point = rng.uniform(0.0, 0.4, (n, 3))
    point[np.arange(n), face] = 0.0
    normal = np.zeros((n, 3))
    normal[np.arange(n), face] = -1.0
    normal[n - full :] = np.nan
    return named(point, normal=normal)


def step(found: Rows, true: Rows) -> Rows:
    turn = rotation_vector_from_matrix(found[:3, :3] @ true[:3, :3].T)
    return np.concatenate([found[:3, 3] - true[:3, 3], turn])


@pytest.mark.parametrize("n", [3, 8, 40])
def test_feature_points_alone_are_the_point_fit(n: int) -> None:
    rng = np.random.default_rng(n)
    point = rng.uniform(0.0, 0.4, (n, 3))
    base = apply(T, point) + 1e-4 * rng.standard_normal((n, 3))
    if n > 3:
        base[2] += 0.003
    found = fit_touches(named(point), base, noise=NOISE)
    assert found.outliers == {3: (), 8: ("P2",), 40: ("P2", "P36")}[n]  # 36 is off by 4.9 sigma
    good = found.believed
    other = fit_points(point[good], base[good], sigma=NOISE.sigma)
    np.testing.assert_allclose(found.T_base_part, other.T_base_part, atol=1e-12)
    np.testing.assert_allclose(found.residuals[good], other.residuals, atol=1e-12)
    sd = np.sqrt(np.diag(other.covariance))
    gap = np.abs(found.covariance - other.covariance) / np.outer(sd, sd)
    assert gap.max() < 0.01  # levers of touched points, not of predicted ones
    assert found.degrees_of_freedom == other.degrees_of_freedom


@pytest.mark.parametrize("full", [0, 2, 5])
def test_exact_touches_give_the_frame_and_sliding_along_faces_does_not_matter(full: int) -> None:
    touches = block(18, full)
    slide = np.random.default_rng(1).uniform(-0.01, 0.01, (18, 3))
    at = touches.point + np.where(touches.normal == 0.0, slide, 0.0)
    found = fit_touches(touches, apply(T, at), noise=NOISE)
    np.testing.assert_allclose(found.T_base_part, T, atol=1e-9)
    assert found.degrees_of_freedom == 3 * full + (18 - full) - 6


def test_the_radius_of_the_probe_is_taken_off_faces_and_not_off_points() -> None:
    plain = block(18, 4)
    touches = named(plain.point, normal=plain.normal, radius=0.003)
    at = plain.point + 0.003 * np.nan_to_num(plain.normal)
    found = fit_touches(touches, apply(T, at), noise=NOISE)
    np.testing.assert_allclose(found.T_base_part, T, atol=1e-9)


def test_the_covariance_is_that_of_many_trials() -> None:
    rng = np.random.default_rng(5)
    touches = block(15, 2)
    exact = apply(T, touches.point)
    found = [
        fit_touches(touches, exact + 1e-4 * rng.standard_normal((15, 3)), noise=Noise(
            touch=1e-4, robot=1.0
        ))  # a bound so wide that nothing is rejected
        for _ in range(80)
    ]  # fmt: skip
    seen = np.cov(np.array([step(f.T_base_part, T) for f in found]).T)
    gain = touch_gain(touches, exact, T, np.ones(15, dtype=bool))
    predicted = 1e-8 * gain @ gain.T
    ratio = np.linalg.eigvals(np.linalg.solve(predicted, seen)).real
    # 80 trials of six numbers: eigenvalues within (1 +- sqrt(6 / 80))^2 and some.
    assert 0.45 < ratio.min() < ratio.max() < 1.8
    np.testing.assert_allclose(
        fit_touches(touches, exact, noise=NOISE).covariance, predicted, rtol=1e-6, atol=1e-16
    )


def test_the_gain_is_the_derivative_of_the_frame() -> None:
    touches = block(12, 2)
    exact = apply(T, touches.point)
    gain = touch_gain(touches, exact, T, np.ones(12, dtype=bool))
    rng = np.random.default_rng(2)
    for _ in range(5):
        shift = 1e-6 * rng.standard_normal((12, 3))
        found = fit_touches(touches, exact + shift, noise=NOISE)
        expected = displace_frame(T, gain @ shift.ravel())
        np.testing.assert_allclose(found.T_base_part, expected, atol=2e-9)


def test_wrong_touches_of_either_kind_are_named() -> None:
    touches = block(24, 6)
    rng = np.random.default_rng(7)
    base = apply(T, touches.point) + 5e-5 * rng.standard_normal((24, 3))
    base[3] -= 0.004 * T[:3, :3] @ touches.normal[3]
    base[20] += 0.003
    found = fit_touches(touches, base, noise=Noise(touch=5e-5, robot=5e-5))
    assert found.outliers == ("P3", "P20")
    assert np.abs(step(found.T_base_part, T)[:3]).max() < 1e-4


def test_a_round_surface_among_points() -> None:
    rng = np.random.default_rng(9)
    angle, height = rng.uniform(0, 2 * np.pi, 12), rng.uniform(0.0, 0.2, 12)
    on = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), height], axis=1)
    point = np.vstack([on, [[0.1, 0.1, 0.0], [0.3, 0.0, 0.2]]])
    touches = ProbingSet(
        names=tuple(f"P{i}" for i in range(14)),
        point=point,
        position=np.zeros((14, 3)),
        surfaces=(Cylinder(point=np.zeros(3), axis=np.array([0.0, 0.0, 1.0]), radius=0.1),),
        touched=np.array([0] * 12 + [-1] * 2),
    )
    found = fit_touches(touches, apply(T, point), noise=NOISE)
    np.testing.assert_allclose(found.T_base_part, T, atol=1e-8)


def test_what_is_left_open_or_contradicts() -> None:
    flat = block(9, 0)
    one_face = named(
        np.column_stack([flat.point[:, :2], np.zeros(9)]), normal=np.tile([0.0, 0.0, 1.0], (9, 1))
    )
    with pytest.raises(ObservabilityError, match="do not locate the part"):
        fit_touches(one_face, apply(T, one_face.point), noise=NOISE)
    three = named(np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.2, 0.0]]))
    base = apply(T, three.point) + np.array([[0.0] * 3, [0.01, 0.0, 0.0], [0.0] * 3])
    with pytest.raises(ImplausibleDataError, match="3 touches contradict each other"):
        fit_touches(three, base, noise=NOISE)
    eight = named(np.random.default_rng(3).uniform(0.0, 0.4, (8, 3)))
    base = apply(T, eight.point)
    base[::2] += 0.02 * np.random.default_rng(4).standard_normal((4, 3))
    with pytest.raises(ImplausibleDataError, match="4 of 8 touches disagree"):
        fit_touches(eight, base, noise=NOISE)
