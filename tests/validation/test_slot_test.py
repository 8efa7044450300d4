"""Slot tests and datum checks against cases worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.fit import Noise
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ShapeError
from robotrue.validation.slot_test import SlotTest, check_datums, evaluate_slots, tip_sensitivity

FIRST = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # axis along part y
HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # about part z
PRINTED = np.array([[0.68], [0.71], [0.73], [0.69]]) * MM


def slots(step, *, second=HALF_TURN @ FIRST, frames="shared", across=(1.0, 0.0, 0.0)):
    return SlotTest(
        step=np.asarray(step),
        names=tuple(str(i + 1) for i in range(len(step))),
        across=np.array(across),
        R_part_first=FIRST,
        R_part_second=second,
        frames=frames,
    )


def test_the_printed_slots_of_feng_2018() -> None:
    found = evaluate_slots(slots(PRINTED))
    assert found.mismatch / MM == pytest.approx(0.7025)
    assert found.spread / MM == pytest.approx(0.02217, abs=5e-6)
    # t(0.975, 3) = 3.18245: 3.18245 * 0.02217 / 2 = 0.03528
    np.testing.assert_allclose(found.interval / MM, [0.6672, 0.7378], atol=5e-5)
    assert found.tip / MM == pytest.approx(0.35125)
    assert np.isnan(found.uneven)


def test_a_shared_frame_is_not_seen_and_said_so() -> None:
    found = evaluate_slots(slots(PRINTED))
    assert found.per_frame == 0.0
    assert found.blind[0].startswith("The frame:")
    assert "2.00 times" in found.sees[0]
    own = evaluate_slots(slots(PRINTED, frames="one per side"))
    assert own.per_frame == 1.0
    assert not any(text.startswith("The frame:") for text in own.blind)
    assert any("two frames" in text for text in own.sees)


def test_a_tool_turned_about_the_measured_direction_hides_its_tip() -> None:
    over = np.diag([1.0, -1.0, -1.0]) @ FIRST  # half a turn about x, the direction of the step
    np.testing.assert_allclose(tip_sensitivity(FIRST, over, np.array([1.0, 0, 0])), 0.0, atol=1e-15)
    found = evaluate_slots(slots(PRINTED, second=over))
    assert np.isnan(found.tip)
    assert any(text.startswith("The tool tip:") for text in found.blind)


def test_tip_sensitivity_is_the_derivative_of_the_step() -> None:
    second = matrix_from_rotation_vector(np.array([0.3, -1.1, 0.7])) @ FIRST
    across = np.array([0.6, 0.0, 0.8])
    tip = np.array([0.2, -0.1, 0.3]) * MM
    step = across @ (FIRST @ tip) - across @ (second @ tip)
    assert tip_sensitivity(FIRST, second, 5.0 * across) @ tip == pytest.approx(step)


def test_steps_that_change_over_the_part_are_called_uneven() -> None:
    rng = np.random.default_rng(0)
    within = 0.02 * MM * rng.normal(size=(4, 9))
    tilted = 0.5 * MM + within + np.array([[-0.1], [-0.03], [0.03], [0.1]]) * MM
    assert evaluate_slots(slots(tilted)).uneven < 1e-6


def test_uneven_is_a_probability_under_the_null() -> None:
    rng = np.random.default_rng(1)
    p = [evaluate_slots(slots(0.02 * MM * rng.normal(size=(4, 9)))).uneven for _ in range(400)]
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09


def test_places_that_were_not_measured_are_left_out() -> None:
    step = np.array([[0.4, 0.6], [0.8, np.nan]]) * MM
    found = evaluate_slots(slots(step))
    np.testing.assert_allclose(found.slots / MM, [0.5, 0.8])
    assert found.mismatch / MM == pytest.approx(0.65)


def test_signed_steps_average_out_and_their_sizes_do_not() -> None:
    found = evaluate_slots(slots(np.array([[0.5], [-0.5]]) * MM))
    assert found.mean == 0.0
    assert found.mismatch / MM == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("change", "kind", "told"),
    [
        ({"step": np.array([[0.7]])}, ImplausibleDataError, "700 mm"),
        ({"step": np.array([[np.nan]])}, ShapeError, "without a reading: 1"),
        ({"step": PRINTED, "frames": "both"}, ConfigurationError, "frames is 'both'"),
        ({"step": PRINTED, "across": (0.0, 0.0, 0.0)}, ShapeError, "no direction"),
    ],
)
def test_what_cannot_be_a_slot_test(change, kind, told) -> None:
    with pytest.raises(kind, match=told):
        slots(**change)


PLACE = pose_from_xyz_abc(np.array([1.0, 0.2, 0.5]), np.array([20.0, -5.0, 3.0]) * DEG)
DATUMS = np.array([[0.1, 0.0, 0.05], [0.3, 0.0, 0.3]])
COVARIANCE = np.diag([0.05 * MM, 0.05 * MM, 0.05 * MM, 2e-4, 2e-4, 2e-4]) ** 2
QUIET = Noise(touch=0.05 * MM, robot=0.05 * MM)


def datums(off, *, noise=QUIET, tolerance=0.5 * MM, **more):
    touched = apply(PLACE, DATUMS) + np.asarray(off)
    return check_datums(
        PLACE, COVARIANCE, DATUMS, touched, noise=noise, tolerance=tolerance, **more
    )


def test_a_datum_in_place_holds() -> None:
    found = datums(np.zeros(3))
    assert found.verdict == "holds"
    np.testing.assert_allclose(found.distance, 0.0, atol=1e-12)
    assert found.resolution < 0.5 * MM


def test_a_part_that_moved_is_off_and_by_how_much() -> None:
    shift = PLACE[:3, :3] @ (np.array([0.0, 0.0, 0.8]) * MM)
    found = datums(shift)
    assert found.verdict == "is off"
    np.testing.assert_allclose(found.deviation / MM, [[0.0, 0.0, 0.8]] * 2, atol=1e-9)
    assert "0.800 mm" in found.reason


def test_a_blunt_touch_cannot_tell() -> None:
    found = datums(np.zeros(3), noise=Noise(touch=0.3 * MM, robot=0.0))
    assert found.verdict == "undecided"
    assert "resolves" in found.reason


def test_chance_beyond_the_tolerance_is_no_verdict() -> None:
    found = datums(np.array([0.15 * MM, 0.0, 0.0]), tolerance=0.1 * MM)
    assert found.verdict == "undecided"


def test_small_and_certain_is_within_tolerance_but_told() -> None:
    sharp = Noise(touch=0.01 * MM, robot=0.0)
    touched = apply(PLACE, DATUMS) + np.array([0.2 * MM, 0.0, 0.0])
    found = check_datums(PLACE, 1e-4 * COVARIANCE, DATUMS, touched, noise=sharp, tolerance=0.5 * MM)
    assert found.verdict == "holds"
    assert "more than the stated uncertainty" in found.reason


def test_the_stated_probability_is_honest() -> None:
    rng = np.random.default_rng(2)
    lower = np.linalg.cholesky(COVARIANCE)
    p = []
    for _ in range(400):
        step = lower @ rng.normal(size=6)
        moved = PLACE.copy()
        moved[:3, :3] = matrix_from_rotation_vector(step[3:]) @ PLACE[:3, :3]
        moved[:3, 3] += step[:3]
        touched = apply(moved, DATUMS) + QUIET.sigma * rng.normal(size=(2, 3))
        found = check_datums(PLACE, COVARIANCE, DATUMS, touched, noise=QUIET, tolerance=0.5 * MM)
        p.append(found.probability)
    assert 0.025 < np.mean(np.array(p) < 0.05) < 0.085


def test_a_datum_of_the_fit_proves_nothing() -> None:
    with pytest.raises(ConfigurationError, match="datum B was used"):
        datums(np.zeros(3), names=("A", "B"), used=("B", "C"))


@pytest.mark.parametrize(("tolerance", "told"), [(0.0, "tolerance 0 mm"), (-1.0, "-1000 mm")])
def test_a_tolerance_is_needed(tolerance, told) -> None:
    with pytest.raises(ConfigurationError, match=told):
        datums(np.zeros(3), tolerance=tolerance)
