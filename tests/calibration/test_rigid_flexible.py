"""The model: archive, tools, loads, derivative against its own prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.arm import prepare_arm
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.core.archive import Archive, write_archive
from robotrue.core.poses import pose
from robotrue.errors import ArchiveError, ShapeError
from robotrue.robot.statics import Load


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(21)
    robot = arm()
    data = measure(
        planted(robot, rng, base=0.0),
        postures(robot, 50, rng),
        rng,
        T_tracker_base=pose(np.eye(3), np.array([3.0, 0.0, 0.0])),
    )
    return fit(robot, data, settings=FitSettings(payload=PAYLOAD, repeatability=6e-5))


@pytest.fixture(scope="module")
def joints():
    return postures(arm(), 50, np.random.default_rng(22))


def test_archive_round_trip_is_bit_exact(model, joints, tmp_path):
    write_archive(tmp_path / "arm.robotrue", model.to_archive())
    again = open_model(tmp_path / "arm.robotrue")
    push = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=np.array([[9.0, 8, 7, 6, 5, 4]]))
    a, b = (m.predict(Query(joints=joints, load=push)) for m in (model, again))
    np.testing.assert_array_equal(a.error, b.error)
    np.testing.assert_array_equal(a.rotation_error, b.rotation_error)
    np.testing.assert_array_equal(a.covariance, b.covariance)
    np.testing.assert_array_equal(again.T_tracker_base[0], model.T_tracker_base[0])
    assert again.training_summary() == model.training_summary()


def test_archives_of_other_kinds_and_schemas_are_refused(model):
    archive = model.to_archive()
    with pytest.raises(ArchiveError, match="schema 99; this robotrue reads"):
        open_model(replace(archive, schema=99))
    with pytest.raises(ArchiveError, match="kind 'error-model/unheard'"):
        open_model(replace(archive, kind="error-model/unheard"))
    arrays = {k: v for k, v in archive.arrays.items() if k != "covariance"}
    with pytest.raises(ArchiveError, match="no array 'covariance'"):
        open_model(Archive(kind=archive.kind, schema=1, document=archive.document, arrays=arrays))


def test_another_tool_drops_the_measured_tools_errors(model, joints):
    same = model.robot.T_flange_tool
    own = prepare_arm(model.actual).linearise(joints, PAYLOAD)
    other = prepare_arm(model.actual, same).linearise(joints, PAYLOAD)
    shift = np.linalg.norm(model.actual.error("tool")[:3])
    assert np.abs(np.linalg.norm(own.error - other.error, axis=1) - shift).max() < 1e-6
    assert not other.columns[:, :, -6:].any()
    assert own.columns[:, :, -6:].any()


def test_prediction_moves_along_its_jacobian(model, joints):
    jacobian = prepare_arm(model.actual).linearise(joints, PAYLOAD).columns
    step = 1e-7 * np.random.default_rng(1).standard_normal(len(model.errors))
    step[36:42] *= 1e-4
    up = replace(model, errors=model.errors + step).predict(Query(joints=joints, load=PAYLOAD))
    down = replace(model, errors=model.errors - step).predict(Query(joints=joints, load=PAYLOAD))
    np.testing.assert_allclose((up.error - down.error) / 2.0, jacobian[:, :3] @ step, atol=1e-12)


def test_many_rows_equal_few_rows(model, joints):
    many = np.tile(joints, (100, 1))
    load = Load(
        mass=np.tile(PAYLOAD.mass, len(many)),
        com=PAYLOAD.com,
        wrench=np.tile(np.arange(6.0), (len(many), 1)),
    )
    out = model.predict(Query(joints=many, load=load))
    few = model.predict(
        Query(
            joints=joints,
            load=Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=np.arange(6.0)[None]),
        )
    )
    np.testing.assert_allclose(out.error[-50:], few.error, atol=1e-15)


def test_covariance_holds_the_repeatability(model, joints):
    floor = model.repeatability**2 + model.white**2
    smallest = np.linalg.eigvalsh(model.predict(Query(joints=joints, load=PAYLOAD)).covariance)
    assert (smallest[:, 0] >= floor).all()
    assert model.repeatability == pytest.approx(6e-5 / 3.6158)
    assert model.mean_tables() is not None


def test_repeatability_constant_is_that_of_iso_9283():
    from robotrue.calibration.settings import RP_PER_SIGMA

    distance = np.linalg.norm(np.random.default_rng(0).standard_normal((400_000, 3)), axis=1)
    assert distance.mean() + 3.0 * distance.std() == pytest.approx(RP_PER_SIGMA, rel=2e-3)


def test_joints_of_another_robot(model):
    with pytest.raises(ShapeError, match="expected"):
        model.predict(Query(joints=np.zeros((3, 7))))
