"""The recursion: where it ends, why, and what it cannot see."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue_reproductions.feng2018.three_point_recursion import Probe, adjust_recursively

TRIANGLE = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.3, 0.0]])
DRAWN = pose_from_xyz_abc(np.array([1.0, 0.0, 0.6]), np.zeros(3))
TRUE = pose_from_xyz_abc(np.array([1.006, -0.004, 0.607]), np.array([3.0, 2.3, 3.5]) * DEG)
STRETCH = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.0], [0.0, -0.5, 0.2]]) * MM
"""What a robot of 0.5 mm does to the triangle."""


def probe(sigma: float, distortion: Array, seed: int = 1) -> Probe:
    rng = np.random.default_rng(seed)
    return lambda run: apply(TRUE, TRIANGLE) + distortion + sigma * rng.normal(size=run.shape)


def test_a_perfect_robot_is_within_tolerance_after_one_correction() -> None:
    found = adjust_recursively(TRIANGLE, DRAWN, probe(0.0, 0.0 * STRETCH), sigma=0.0)
    assert found.verdict == "within tolerance"
    assert len(found.passes) == 2
    np.testing.assert_allclose(found.T_base_part, TRUE, atol=1e-12)


def test_floor_and_oscillation_are_told_apart() -> None:
    sigma = 0.1 * MM
    still = adjust_recursively(TRIANGLE, DRAWN, probe(0.0, STRETCH), sigma=0.0)
    assert still.verdict == "nothing more to gain"
    assert still.oscillation < 1e-12
    assert still.floor == pytest.approx(0.487 * MM, abs=0.001 * MM)
    noisy = adjust_recursively(
        TRIANGLE, DRAWN, probe(sigma, STRETCH), sigma=sigma, settled=20, most=40
    )
    assert noisy.floor == pytest.approx(still.floor, abs=0.1 * MM)
    assert 0.03 * MM < noisy.oscillation < 0.3 * MM
    assert noisy.swing > 2.0 * noisy.oscillation
    np.testing.assert_allclose(noisy.distortion, still.distortion, atol=0.1 * MM)


def test_it_stops_when_the_correction_is_below_its_own_uncertainty() -> None:
    sigma = 0.1 * MM
    found = adjust_recursively(TRIANGLE, DRAWN, probe(sigma, STRETCH), sigma=sigma)
    assert found.verdict == "nothing more to gain"
    assert len(found.passes) <= 6
    assert found.passes[0].significance > 1e4
    assert all(p.significance < 12.6 for p in found.passes[-3:])


def test_corrections_that_are_only_noise_are_called_so_in_19_of_20_passes() -> None:
    sigma = 0.1 * MM
    found = adjust_recursively(
        TRIANGLE,
        TRUE,
        probe(sigma, STRETCH, seed=3),
        sigma=sigma,
        settled=300,
        most=150,
        position_tolerance=0.0,
    )
    share = np.mean([p.significance < 12.6 for p in found.passes[1:]])
    assert 0.9 < share < 1.0


def test_stop_values_do_not_measure_accuracy() -> None:
    # The same posture repeats the same error: the robot agrees with itself, 3 mm off.
    lie = np.full((3, 3), 3.0 * MM)
    found = adjust_recursively(TRIANGLE, DRAWN, probe(0.0, lie), sigma=0.0)
    assert found.verdict == "within tolerance"
    off = apply(found.T_base_part, TRIANGLE) - apply(TRUE, TRIANGLE)
    np.testing.assert_allclose(off, 3.0 * MM, atol=1e-9)


def test_the_probe_sees_the_commanded_points() -> None:
    seen: list[Array] = []

    def recorded(run: Array) -> Array:
        seen.append(run.copy())
        return apply(TRUE, TRIANGLE)

    adjust_recursively(TRIANGLE, DRAWN, recorded, sigma=0.0)
    np.testing.assert_allclose(seen[0], apply(DRAWN, TRIANGLE))
    np.testing.assert_allclose(seen[1], apply(TRUE, TRIANGLE), atol=1e-12)


def test_it_gives_up_after_the_passes_allowed() -> None:
    wandering = iter(range(100))

    def drifting(run: Array) -> Array:
        return apply(TRUE, TRIANGLE) + next(wandering) * MM

    found = adjust_recursively(TRIANGLE, DRAWN, drifting, sigma=1e-6, most=5)
    assert found.verdict == "not settled"
    assert len(found.passes) == 6


def test_bad_input_is_named() -> None:
    with pytest.raises(ConfigurationError, match="settled 0"):
        adjust_recursively(TRIANGLE, DRAWN, probe(0.0, STRETCH), sigma=0.0, settled=0)
    with pytest.raises(ConfigurationError, match="none may be negative"):
        adjust_recursively(TRIANGLE, DRAWN, probe(0.0, STRETCH), sigma=-1.0)
    line = TRIANGLE * [1.0, 0.0, 0.0] + np.array([[0, 0, 0], [0, 0, 0], [0.2, 0, 0]])
    with pytest.raises(ObservabilityError, match="lie on one line"):
        adjust_recursively(line, DRAWN, probe(0.0, STRETCH), sigma=0.0)
    with pytest.raises(ImplausibleDataError, match="the right angle is at L"):
        adjust_recursively(TRIANGLE[[1, 0, 2]], DRAWN, probe(0.0, STRETCH), sigma=0.0)
