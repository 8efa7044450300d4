"""A ball in sockets of a simulated arm of seven joints: what its spread says and what it hides."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.measurement.measurement_set import touched_rows
from robotrue.measurement.probing_set import KnownDistance, ProbingSet
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.validation.socket_places import (
    choose_by_places,
    hold_out_places,
    hold_out_touches,
    socket_spread,
    tip_positions,
)

BALL = pose(np.eye(3), np.array([0.002, -0.001, 0.137]))
NOISE = 0.04 * MM
FIXTURES = np.array([[0.45, 0.25, 0.05], [0.5, -0.3, 0.1], [0.35, 0.0, 0.45]])
PLACES = {"left": (0, 1), "right": (2, 3), "high": (4, 5)}
ATTITUDES = 24


def nominal() -> RobotModel:
    return preset("panda").with_tool(BALL)


@cache
def actual() -> RobotModel:
    """Errors of a millimetre and more at the tip, compliance included."""
    rng = np.random.default_rng(7)
    robot = nominal()
    errors = np.zeros_like(robot.errors)
    for group, sd in (("theta", 1e-3), ("d", 3e-4), ("a", 3e-4), ("alpha", 5e-4)):
        errors[parameter_slice(7, group)] = sd * rng.normal(size=7)
    errors[parameter_slice(7, "compliance")] = 2e-5
    return robot.with_errors(errors)


def attitudes(socket: Array, rng: np.random.Generator) -> Array:
    """Joints (ATTITUDES, 7) with the ball of the true arm in the socket, within the limits."""
    low, high = nominal().limits.T
    down = np.diag([1.0, -1.0, -1.0])
    found: list[Array] = []
    while len(found) < ATTITUDES:
        lean = 0.5 * rng.normal(size=(60, 3))
        aim = socket + NOISE * rng.normal(size=(60, 3))
        targets = pose(matrix_from_rotation_vector(lean) @ down, aim)
        seeds = rng.uniform(0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high, (60, 7))
        at = solve(actual(), targets, seeds)
        good = at.converged & (at.joints > low).all(axis=1) & (at.joints < high).all(axis=1)
        found += list(at.joints[good])
    return np.array(found[:ATTITUDES])


@cache
def touches() -> ProbingSet:
    rng = np.random.default_rng(1)
    beside = np.array([0.0, 50 * MM, 0.0])
    sockets = [p + k * beside for p in FIXTURES for k in (0, 1)]
    return ProbingSet(
        names=tuple(f"socket {k}" for k in range(6) for _ in range(ATTITUDES)),
        point=np.zeros((6 * ATTITUDES, 3)),
        joints=np.concatenate([attitudes(s, rng) for s in sockets]),
        part=np.repeat(np.arange(6), ATTITUDES),
        sockets=tuple(range(6)),
        distances=tuple(
            KnownDistance(first=k, second=k + 1, length=50 * MM, sigma=0.1 * MM) for k in (0, 2, 4)
        ),
    )


def exact(robot: RobotModel) -> CalibratedModel:
    size = len(robot.errors)
    return CalibratedModel(
        robot=robot,
        errors=robot.errors,
        covariance=np.zeros((size, size)),
        repeatability=0.0,
        white=0.0,
    )


def elastic(of: ProbingSet) -> ErrorModel:
    return fit(nominal(), touched_rows(of, sigma=NOISE), method="elastic")


def test_the_true_arm_holds_the_ball_and_the_nominal_one_lets_it_wander() -> None:
    true, controller = (socket_spread(exact(r), touches()) for r in (actual(), nominal()))
    # Mean length of a 3-D error of sd NOISE: 1.596 of it, a little less about the own mean.
    assert true.mean == pytest.approx(1.596 * NOISE * np.sqrt(1 - 1 / ATTITUDES), rel=0.06)
    assert true.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.06)
    assert np.abs(true.length_error).max() < 0.03 * MM
    assert controller.mean > 0.5 * MM
    assert controller.largest > 1.0 * MM
    assert np.isnan(true.coverage)


def test_one_shift_of_everything_does_not_show() -> None:
    errors = actual().errors.copy()
    errors[parameter_slice(7, "base")] = [0.01, -0.02, 0.03, 0.01, 0.02, -0.03]
    moved = socket_spread(exact(actual().with_errors(errors)), touches())
    np.testing.assert_allclose(
        moved.distance, socket_spread(exact(actual()), touches()).distance, atol=1e-12
    )


def test_places_never_touched_are_predicted_with_their_uncertainty() -> None:
    seen: list[set[int]] = []

    def watched(of: ProbingSet) -> ErrorModel:
        seen.append(set(of.parts))
        return elastic(of)

    held = hold_out_places(watched, touches(), PLACES, touch_sigma=NOISE)
    assert seen == [{2, 3, 4, 5}, {0, 1, 4, 5}, {0, 1, 2, 3}]
    assert list(held) == ["left", "right", "high"]
    distance = np.concatenate([s.distance for s in held.values()])
    inside = np.concatenate([s.inside for s in held.values()])
    assert distance.mean() < 2.0 * 1.596 * NOISE
    assert 0.88 <= inside.mean() <= 1.0


def test_touches_held_out_at_random_are_at_the_noise() -> None:
    found = hold_out_touches(elastic, touches(), folds=4, seed=0)
    assert len(found.distance) == len(touches())
    assert found.mean == pytest.approx(1.596 * NOISE, rel=0.3)


def test_the_choice_is_made_where_places_are_held_out_and_a_tie_goes_to_the_simplest() -> None:
    fits = {
        "controller": lambda of: exact(nominal()),
        "true": lambda of: exact(actual()),
        "also true": lambda of: exact(actual()),
    }
    winner, means = choose_by_places(fits, touches(), PLACES)
    assert winner == "true"
    assert means["true"] == means["also true"] < means["controller"]


def test_what_cannot_be_compared_is_refused() -> None:
    model = exact(nominal())
    loose = ProbingSet(
        names=("A", "B"), point=np.eye(3)[:2], joints=np.zeros((2, 7)), part=np.array([3, 3])
    )
    with pytest.raises(ObservabilityError, match="part 3 is no socket"):
        socket_spread(model, loose)
    with pytest.raises(ObservabilityError, match="part 0 is no socket, or touched 1 times"):
        socket_spread(model, touches().subset([0]))
    with pytest.raises(ModelMismatchError, match="touches with 7 joints, KUKA KR160 R1570 has 6"):
        tip_positions(exact(preset("kr160")), touches())
    with pytest.raises(ConfigurationError, match=r"1 places with sockets \[0, 1\]"):
        hold_out_places(elastic, touches(), {"left": (0, 1)})
    with pytest.raises(ConfigurationError, match="no fit to choose from"):
        choose_by_places({}, touches(), PLACES)
    with pytest.raises(ConfigurationError, match="1 folds"):
        hold_out_touches(elastic, touches(), folds=1, seed=0)
