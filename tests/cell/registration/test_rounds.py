"""Rounds at the machine: when a correction is made, when they end, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.rounds import adjust_in_rounds
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue_reproductions.feng2018.rounds_experiment import run_rounds

POINTS = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.3, 0.0]])
NAMES = ("K", "L", "M")
DRAWN = pose_from_xyz_abc(np.array([1.0, 0.0, 0.6]), np.zeros(3))
TRUE = pose_from_xyz_abc(np.array([1.006, -0.004, 0.607]), np.array([3.0, 2.3, 3.5]) * DEG)
SIGMA = 0.1 * MM


def touches(rounds: int, seed: int = 1, sigma: float = SIGMA) -> Array:
    rng = np.random.default_rng(seed)
    return apply(TRUE, POINTS) + sigma * rng.normal(size=(rounds, 3, 3))


def adjusted(touched: Array, start: Array = DRAWN, **options: object):
    return adjust_in_rounds(POINTS, start, touched, sigma=SIGMA, names=NAMES, **options)


@pytest.mark.parametrize("method", ["touches", "feng2018"])
def test_one_correction_then_nothing_is_left(method: str) -> None:
    first = adjusted(touches(1), method=method)
    assert first.adjustment.verdict == "run again"
    assert np.isnan(first.adjustment.floor)
    second = adjusted(touches(2), method=method)
    np.testing.assert_allclose(second.frames[1], first.adjustment.T_base_part)
    assert second.adjustment.verdict == "settled"
    assert second.adjustment.floor < 0.3 * MM
    assert second.counted == 2
    exact = adjusted(touches(2, sigma=0.0), method=method)
    np.testing.assert_allclose(exact.adjustment.T_base_part, TRUE, atol=1e-12)


def test_a_frame_that_is_good_enough_stays_to_the_last_bit() -> None:
    found = adjusted(touches(1), start=TRUE)
    assert found.adjustment.verdict == "as it was"
    np.testing.assert_array_equal(found.adjustment.T_base_part, TRUE)


def test_a_part_that_moved_is_noticed_and_the_rounds_before_are_left_out() -> None:
    touched = touches(3)
    touched[2] += np.array([2.0, 0.0, 0.0]) * MM
    found = adjusted(touched)
    (moved,) = found.moved
    assert (moved.round, found.counted) == (3, 1)
    assert moved.shift == pytest.approx(2.0 * MM, abs=0.2 * MM)
    assert moved.times > 8.0
    assert found.adjustment.verdict == "run again"
    middle = apply(found.adjustment.T_base_part, POINTS) - apply(TRUE, POINTS)
    np.testing.assert_allclose(middle.mean(axis=0), [2.0 * MM, 0.0, 0.0], atol=0.2 * MM)


def test_touching_alone_is_not_called_a_motion() -> None:
    assert not any(adjusted(touches(3, seed)).moved for seed in range(200))


def test_a_point_touched_wrong_is_named() -> None:
    touched = touches(2)
    touched[1, 1, 0] += 3.0 * MM
    with pytest.raises(ImplausibleDataError, match=r"points of round 2 moved .* L 1\.\d\d mm"):
        adjusted(touched)


def test_exchanged_points_are_refused() -> None:
    with pytest.raises(ImplausibleDataError, match=r"turns the part by 1[78]\d deg about K"):
        adjusted(touches(1)[:, [0, 2, 1]])


def test_bad_input_is_named() -> None:
    with pytest.raises(ConfigurationError, match="0 rounds"):
        adjusted(np.empty((0, 3, 3)))
    line = POINTS * [1.0, 0.0, 0.0] + np.array([[0, 0, 0], [0, 0, 0], [0.2, 0, 0]])
    with pytest.raises(ObservabilityError, match="lie on one line"):
        adjust_in_rounds(line, DRAWN, touches(1), sigma=SIGMA, names=NAMES)
    with pytest.raises(ImplausibleDataError, match="the right angle is at L"):
        adjust_in_rounds(
            POINTS[[1, 0, 2]], DRAWN, touches(1), sigma=SIGMA, names=NAMES, method="feng2018"
        )


def test_in_simulated_cells_three_rounds_do_and_none_ends_worse() -> None:
    ends = [end for seed in range(1, 9) for end in run_rounds(seed, "touches")]
    assert max(end.rounds for end in ends) <= 3
    assert all(end.verdict in ("settled", "as it was") for end in ends)
    assert all(end.error[-1] <= end.error[0] for end in ends)
    drawn = [end for end in ends if end.start == "as drawn"]
    assert np.median([end.error[-1] for end in drawn]) < 0.4 * MM
