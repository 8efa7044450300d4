"""The uncertainty budget against what it was made of, and the decision rule."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import Query
from robotrue.core.poses import propagate_covariance
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION, point_covariance
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm
from robotrue.validation.budget import (
    force_sensitivity,
    stated_line,
    tracker_lines,
    uncertainty_budget,
)
from robotrue.validation.conformity import Conformity, conformity
from robotrue.validation.error_map import known_places

ROBOT = preset("KUKA KR160 R1570")
RNG = np.random.default_rng(5)
JOINTS = RNG.uniform(-0.6, 0.6, (30, 6)) + np.array([0.0, -1.2, 1.4, 0.0, 0.5, 0.0])


def model() -> CalibratedModel:
    errors = np.zeros(len(ROBOT.errors))
    errors[parameter_slice(6, "compliance")] = 5e-7
    sd = np.full(len(errors), 2e-5)
    sd[parameter_slice(6, "compliance")] = 1e-8
    return CalibratedModel(
        robot=ROBOT, errors=errors, covariance=np.diag(sd**2), repeatability=1.5e-5, white=8e-6,
        summary={"joint_range_rad": [JOINTS.min(axis=0).tolist(), JOINTS.max(axis=0).tolist()]},
    )  # fmt: skip


def budget(**options):
    return uncertainty_budget(
        model(), Query(joints=JOINTS), repeatability=5.4e-5, instrument=(), **options
    )


def test_the_lines_of_a_model_add_up_to_what_it_predicts():
    covariance = model().predict(Query(joints=JOINTS)).covariance
    total = np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean() / 3.0)
    found = budget()
    assert found.combined == pytest.approx(total, rel=1e-12)
    lines = {c.name: c for c in found.contributions}
    assert lines["repeatability"].standard_uncertainty == pytest.approx(1.5e-5)
    assert lines["repeatability"].value == 5.4e-5
    assert lines["white"].standard_uncertainty == pytest.approx(8e-6)
    assert found.worst > found.expanded == 2.0 * found.combined


def test_a_tracker_line_is_the_covariance_of_its_points():
    points = RNG.uniform(-1.0, 1.0, (40, 3)) + np.array([4.0, 0.0, 0.0])
    covariance = point_covariance(DEFAULT_SPECIFICATION, points, np.zeros(3))
    total = np.trace(covariance, axis1=1, axis2=2).mean() / 3.0
    lines = tracker_lines(DEFAULT_SPECIFICATION, np.linalg.norm(points, axis=1))
    assert sum(c.standard_uncertainty**2 for c in lines) == pytest.approx(total, rel=1e-12)
    assert all(c.divisor == 2.0 and not c.in_target for c in lines)
    (stated,) = stated_line(covariance)
    assert stated.standard_uncertainty == pytest.approx(np.sqrt(total), rel=1e-12)


def test_a_registration_carried_to_a_point_is_that_of_many_draws():
    root = RNG.standard_normal((6, 6)) * 1e-5
    covariance = root @ root.T
    lever = np.array([[0.5, -0.3, 0.8]])
    draw = root @ RNG.standard_normal((6, 200_000))
    moved = draw[:3].T + np.cross(draw[3:].T, lever[0])
    assert propagate_covariance(covariance, lever)[0] == pytest.approx(
        np.cov(moved.T), rel=0.03, abs=1e-12
    )


def test_registration_and_force_enter_as_squares():
    alone = budget()
    part = {"T_base_part": np.eye(4), "part_covariance": np.diag([1e-5] * 3 + [0.0] * 3) ** 2}
    both = budget(**part, force_sigma=50.0)
    lines = {c.name: c.standard_uncertainty for c in both.contributions}
    assert lines["registration"] == pytest.approx(1e-5)
    assert lines["force"] > 0.0
    assert both.combined**2 == pytest.approx(
        alone.combined**2 + lines["registration"] ** 2 + lines["force"] ** 2, rel=1e-12
    )
    with pytest.raises(ShapeError, match="one is missing"):
        budget(T_base_part=np.eye(4))


def test_the_sensitivity_to_force_is_that_of_the_statics():
    arm = model().actual
    moved = []
    for axis in range(3):
        wrench = np.zeros((1, 6))
        wrench[0, axis] = 1.0
        pushed = deflect_arm(arm, JOINTS, Load(wrench=wrench))[0].position
        moved.append(pushed - deflect_arm(arm, JOINTS)[0].position)
    expected = np.sqrt(np.mean(np.sum(np.square(moved), axis=2)) * 3.0 / 3.0)
    found = force_sensitivity(model(), Query(joints=JOINTS))
    # rms over poses of sqrt(trace(J J') / 3)
    assert found == pytest.approx(expected, rel=1e-6)


def test_known_places_lie_in_the_training_range():
    places = known_places(model(), samples=64)
    assert places is not None
    assert (places.joints >= JOINTS.min(axis=0)).all()
    assert (places.joints <= JOINTS.max(axis=0)).all()
    assert (places.radius > 0.0).all()


def test_a_target_conforms_only_with_its_bound():
    length = np.array([0.1, 0.1, 0.4, 0.0, np.nan])
    bound = np.array([0.1, 0.11, 0.1, 0.3, 0.1])
    assert conformity(length, bound, 0.2).tolist() == [
        Conformity.CONFORMS, Conformity.UNDECIDED, Conformity.FAILS, Conformity.UNDECIDED,
        Conformity.UNKNOWN,
    ]  # fmt: skip
    with pytest.raises(ConfigurationError, match="tolerance"):
        conformity(length, bound, np.nan)


def test_a_conforming_target_keeps_the_tolerance_with_95_percent():
    """At the edge of the rule, in the worst direction: never less than 95 %."""
    sd = np.array([5e-5, 2e-5, 1e-5])
    from robotrue.validation.error_map import radius_95

    bound = float(radius_95(np.diag(sd**2)[None])[0])
    error = np.array([3e-4, 0.0, 0.0])
    drawn = error + sd * RNG.standard_normal((100_000, 3))
    kept = (np.linalg.norm(drawn, axis=1) <= 3e-4 + bound).mean()
    assert kept >= 0.95
