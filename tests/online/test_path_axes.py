"""Axes of the path from where the tool has been."""

import numpy as np
import pytest

from robotrue.core.rotations import matrix_from_abc
from robotrue.online.corrections import Corrections, PathAxes
from robotrue.online.estimates import EstimateBlock
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import CorrectionMode

TILTED = matrix_from_abc(np.array([0.2, 0.3, -0.4]))


def pose(joints: np.ndarray) -> np.ndarray:
    """Stands in for an arm: the first three joints are where the tool is."""
    out = np.eye(4)
    out[:3, :3] = TILTED
    out[:3, 3] = joints[:3]
    return out


def moved(axes: PathAxes, points: np.ndarray) -> np.ndarray:
    last = np.zeros((3, 3))
    for point in points:
        last = axes(np.append(point, np.zeros(3)))
    return last


def test_axes_are_right_handed_about_the_direction_of_the_tool() -> None:
    along = np.array([0.6, 0.0, 0.8])
    axes = PathAxes(pose)
    assert not moved(axes, along * np.linspace(0.0, 0.9e-3, 10)[:, None]).any()
    found = moved(axes, along * np.linspace(0.9e-3, 3e-3, 40)[:, None])
    np.testing.assert_array_equal(found[:, 0], 0.0)
    np.testing.assert_allclose(np.cross(along, found[:, 1]), found[:, 2], atol=1e-12)
    assert found[:, 2] @ TILTED[:, 2] > 0.0
    assert abs(found[:, 1] @ TILTED[:, 2]) < 1e-12
    held = moved(axes, np.tile(along * 3e-3, (50, 1)))
    np.testing.assert_array_equal(held, found)


def test_encoder_noise_and_a_curve_turn_them_little() -> None:
    rng = np.random.default_rng(2)
    angle = np.linspace(0.0, 0.5, 2000)
    arc = 0.05 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    found = moved(PathAxes(pose), arc + rng.normal(size=arc.shape) * 2e-6)
    tangent = np.array([-np.sin(0.5), np.cos(0.5), 0.0])
    assert abs(found[:, 1] @ tangent) < 0.03
    assert abs(found[:, 2] @ tangent) < 0.03


@pytest.mark.parametrize("what", ["leap", "plunge"])
def test_without_a_direction_nothing_is_corrected(what: str) -> None:
    axes = PathAxes(pose)
    assert moved(axes, np.linspace(0.0, 3e-3, 40)[:, None] * [1.0, 0.0, 0.0]).any()
    if what == "leap":
        assert not axes(np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])).any()
    else:
        down = np.array([3e-3, 0.0, 0.0]) + np.linspace(0.0, 3e-3, 40)[:, None] * TILTED[:, 2]
        assert not moved(axes, down).any()


def test_the_correction_is_across_the_path_alone() -> None:
    guard = CorrectionGuard(
        CorrectionLimits(shift=1e-4, shift_rate=1e-2, cycle=4e-3), CorrectionMode.ABSOLUTE
    )
    taken, none = Corrections(guard, PathAxes(pose), cutoff=100.0), np.zeros((1, 3))
    for k in range(500):
        time = k * 10e-3
        taken.take(
            EstimateBlock(
                host_time=np.array([time]),
                error=np.array([[10e-6, 20e-6, 30e-6]]),
                sd=none + 1e-6,
                static=none,
                wrench=np.zeros((1, 6)),
                joints=np.array([[50e-6 * k, 0.0, 0.0, 0.0, 0.0, 0.0]]),
                sequence=np.array([k]),
                doubt=np.zeros(1, dtype=np.int64),
            )
        )
        if k == 5:
            assert not guard.next(time).shift.any()
    for _ in range(500):
        last = guard.next(time).shift
    assert last[0] == 0.0
    np.testing.assert_allclose(np.linalg.norm(last), np.hypot(20e-6, 30e-6), rtol=1e-3)
