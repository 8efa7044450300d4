"""Validation of models that know exactly so much."""

from __future__ import annotations

import numpy as np
import pytest
from validation_fakes import SIGMA, FakeModel, arm, measured

from robotrue.core.files import sha256
from robotrue.core.rotations import matrix_from_abc, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ModelMismatchError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import Load
from robotrue.validation.evaluation import row_loads
from robotrue.validation.validate import validate


def wave(joints):
    return 1e-3 * np.stack([np.sin(3 * joints[:, 0]), np.cos(2 * joints[:, 1]), joints[:, 2]], 1)


def test_a_perfect_model_leaves_the_noise_and_covers():
    report = validate(FakeModel(mean=wave), measured(800, error=wave))
    # The mean length of a 3-D normal is sigma sqrt(8 / pi).
    assert report.after.mean == pytest.approx(SIGMA * np.sqrt(8 / np.pi), rel=0.03)
    assert report.before.mean > 0.5e-3
    assert report.coverage.is_honest
    assert report.errors_before - report.errors_after == pytest.approx(
        wave(measured(800).joints), abs=1e-12
    )


def test_instrument_noise_is_added_to_the_prediction():
    instrument = 0.2e-3
    report = validate(FakeModel(), measured(800, instrument=instrument))
    assert report.coverage.is_honest
    assert report.covariance[0, 0, 0] == pytest.approx(SIGMA**2 + instrument**2)
    assert report.floor == pytest.approx(np.hypot(np.sqrt(3) * instrument, 0.03e-3))


def test_a_frame_error_is_told_apart_from_the_rest():
    errors = arm().errors.copy()
    errors[parameter_slice(6, "base")] = [2e-3, -1e-3, 0.5e-3, 1e-3, -2e-3, 3e-3]
    errors[parameter_slice(6, "tool")][:3] = [0.4e-3, 0.2e-3, -0.3e-3]
    report = validate(FakeModel(), measured(300, robot=arm().with_errors(errors)))
    assert report.before.mean > 2e-3
    assert report.before_aligned is not None
    assert report.before_aligned.mean == pytest.approx(SIGMA * np.sqrt(8 / np.pi), rel=0.1)
    assert any("no better than a frame correction" in doubt for doubt in report.doubts)


def test_worst_points_name_their_row():
    poses = measured(60)
    position = poses.position.copy()
    position[17] += [0.0, 3e-3, 0.0]
    spoiled = MeasurementSet(
        joints=poses.joints,
        position=position,
        covariance=poses.covariance,
        source_row=np.arange(60) + 2,
        group_names=("grid",),
    )
    worst = validate(FakeModel(), spoiled).worst[0]
    assert (worst.group, worst.source_row) == ("grid", 19)
    assert worst.after[1] == pytest.approx(3e-3, abs=5 * SIGMA)
    assert worst.probability > 0.999


def test_doubts_are_found():
    summary = {
        "joint_range_rad": [[-0.5] * 6, [0.5] * 6],
        "sources": ["a.csv sha256:1"],
        "doubts": ["joint 1 is free."],
    }
    model = FakeModel(summary=summary, sigma=5 * SIGMA)
    report = validate(model, measured(15, sources=("a.csv sha256:1",)))
    text = "\n".join(report.doubts)
    outside = np.abs(measured(15).joints).max(axis=1) > 0.5 + 2 * DEG
    assert len(report.outside) == outside.sum() > 0
    assert f"{outside.sum()} of 15 poses have a joint outside the training range" in text
    assert "The fit used rows of the same file (a.csv sha256:1)" in text
    assert "Only 15 poses" in text
    assert "joint 1 is free." in text


def test_the_very_rows_of_the_fit_are_recognised():
    poses = measured(40)
    mark = sha256(poses.joints.tobytes() + poses.position.tobytes())
    doubts = validate(FakeModel(summary={"data_sha256": mark}), poses).doubts
    assert any("The model was fitted to exactly these poses" in doubt for doubt in doubts)
    others = validate(FakeModel(summary={"data_sha256": mark}), measured(40, seed=1)).doubts
    assert not any("The model was fitted" in doubt for doubt in others)


def test_claims_that_are_wrong_are_said_in_both_directions():
    small = validate(FakeModel(sigma=0.4 * SIGMA), measured(200))
    large = validate(FakeModel(sigma=4 * SIGMA), measured(200))
    assert any("uncertainty is too small here" in doubt for doubt in small.doubts)
    assert any("uncertainty is too large here" in doubt for doubt in large.doubts)


def test_a_mean_below_the_floor_is_doubted():
    poses = measured(100)
    exact = MeasurementSet(
        joints=poses.joints,
        position=forward(arm(), poses.joints)[:, :3, 3],
        covariance=poses.covariance,
    )
    report = validate(FakeModel(), exact)
    assert any("allow for one visit per pose" in doubt for doubt in report.doubts)


def test_tool_axis_angles_leave_out_how_the_target_sits():
    poses = measured(50)
    turn = np.array([0.0, 0.1, 0.0]) * DEG
    nominal = forward(arm(), poses.joints)[:, :3, :3]
    target = matrix_from_abc(np.array([30.0, 50.0, -70.0]) * DEG)
    six_d = MeasurementSet(
        joints=poses.joints,
        position=poses.position,
        covariance=poses.covariance,
        rotation=matrix_from_rotation_vector(turn) @ nominal @ target,
    )
    knows = validate(FakeModel(turn=turn), six_d)
    assert knows.axis_after is not None
    assert knows.axis_after.max < 1e-9
    assert knows.axis_before is not None
    assert 0.02 * DEG < knows.axis_before.mean < 0.1 * DEG
    assert validate(FakeModel(), six_d).axis_after is None
    assert validate(FakeModel(), poses).axis_before is None


def test_rows_without_a_payload_take_the_given_one():
    poses = measured(
        3,
        payload_mass=np.array([5.0, np.nan, 0.0]),
        payload_com=np.array([[0.1, 0, 0], [np.nan] * 3, [0.0, 0, 0]]),
        wrench=np.tile([0, 0, -100.0, 0, 0, 0], (3, 1)),
    )
    load = row_loads(poses, Load(mass=np.array([60.0]), com=np.array([[0.05, 0.0, 0.15]])))
    assert load.mass.tolist() == [5.0, 60.0, 0.0]
    assert load.com.tolist() == [[0.1, 0, 0], [0.05, 0, 0.15], [0, 0, 0]]
    assert load.wrench[:, 2].tolist() == [-100.0] * 3
    assert row_loads(poses).mass[1] == 0.0


def test_what_cannot_be_validated_is_refused():
    with pytest.raises(ShapeError, match="no measured poses"):
        validate(FakeModel(), measured(4).subset(np.zeros(0, dtype=int)))
    seven = MeasurementSet(
        joints=np.zeros((4, 7)), position=np.zeros((4, 3)), covariance=np.tile(np.eye(3), (4, 1, 1))
    )
    with pytest.raises(ModelMismatchError, match="7 joints measured"):
        validate(FakeModel(), seven)


def test_units_of_the_report_are_metres():
    report = validate(FakeModel(), measured(30, error=lambda q: np.tile([MM, 0, 0], (len(q), 1))))
    assert report.before.axis_mean[0] == pytest.approx(MM, rel=0.05)
