"""Models that take new measurements without a refit: simulated arm, planted errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query, model_hash
from robotrue.calibration.settings import SolverSettings
from robotrue.calibration.terms.smooth import SmoothBasis, add_centres
from robotrue.calibration.update import update_model
from robotrue.core.archive import read_archive, write_archive
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.statics import deflect_arm

PLAIN = FitSettings(payload=PAYLOAD, solver=SolverSettings(loss="gaussian"))
ROBUST = FitSettings(payload=PAYLOAD)


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(11)
    robot = arm()
    return measure(planted(robot, rng), postures(robot, 120, rng), rng)


@pytest.fixture(scope="module")
def parent(rows):
    return fit(arm(), rows.subset(np.arange(60)), settings=PLAIN)


@pytest.fixture(scope="module")
def query():
    joints = postures(arm(), 40, np.random.default_rng(12))
    return Query(joints=joints, load=PAYLOAD)


def test_block_by_block_is_all_at_once(parent, rows, query):
    whole = update_model(parent, rows.subset(np.arange(60, 120)), settings=PLAIN).predict(query)
    model = parent
    for start in (90, 60, 105, 75):  # in another order, too
        model = update_model(model, rows.subset(np.arange(start, start + 15)), settings=PLAIN)
    parts = model.predict(query)
    # Weight times compliance: blocks are linearised at other products.
    np.testing.assert_allclose(parts.error, whole.error, rtol=0, atol=1e-7)
    np.testing.assert_allclose(parts.covariance, whole.covariance, rtol=1e-3, atol=1e-13)


def test_close_to_the_full_refit(parent, rows, query):
    refit = fit(arm(), rows, settings=PLAIN).predict(query)
    found = update_model(parent, rows.subset(np.arange(60, 120)), settings=PLAIN).predict(query)
    before = parent.predict(query)
    gap = np.linalg.norm(found.error - refit.error, axis=1).mean()
    assert gap < 0.3 * np.linalg.norm(before.error - refit.error, axis=1).mean()
    assert gap < 5e-6
    assert (
        np.trace(found.covariance, axis1=1, axis2=2) < np.trace(before.covariance, axis1=1, axis2=2)
    ).all()


def test_lineage_names_parents_and_data_and_survives_the_archive(parent, rows, tmp_path):
    once = update_model(parent, rows.subset(np.arange(60, 80)), settings=PLAIN)
    twice = update_model(once, rows.subset(np.arange(80, 90)), settings=PLAIN)
    write_archive(tmp_path / "m.rtm", twice.to_archive())
    lineage = open_model(read_archive(tmp_path / "m.rtm")).training_summary()["lineage"]
    assert [step["step"] for step in lineage] == ["fit", "update", "update"]
    assert [step["rows"] for step in lineage] == [60, 20, 10]
    assert lineage[1]["parents_sha256"] == [model_hash(parent)]
    assert lineage[2]["parents_sha256"] == [model_hash(once)]
    assert lineage[1]["data_sha256"] != lineage[2]["data_sha256"]
    assert twice.training_summary()["rows"] == 90


def test_the_training_region_grows_by_the_new_rows(parent, rows):
    before = parent.training_summary().joint_range
    beyond = ((rows.joints < before[0]) | (rows.joints > before[1])).any(axis=1)
    part = rows.subset(np.flatnonzero(beyond)[:3])
    new = update_model(parent, part, settings=PLAIN)
    low, high = new.training_summary().joint_range
    np.testing.assert_array_equal(low, np.minimum(before[0], part.joints.min(axis=0)))
    np.testing.assert_array_equal(high, np.maximum(before[1], part.joints.max(axis=0)))
    assert not np.array_equal((low, high), before)
    reach = np.array(new.training_summary()["position_range_m"])
    assert (reach[1] >= np.array(parent.training_summary()["position_range_m"])[1]).all()


def test_a_gross_error_gets_no_weight(parent, rows, query):
    part = rows.subset(np.arange(60, 90))
    position = part.position.copy()
    position[7] += [0.0, 5e-3, 0.0]
    found = update_model(parent, replace(part, position=position), settings=ROBUST)
    assert found.training_summary()["lineage"][-1]["screened_rows"] == [7]
    clean = update_model(parent, part, settings=ROBUST).predict(query)
    np.testing.assert_allclose(found.predict(query).error, clean.error, rtol=0, atol=1e-5)


def test_a_new_set_up_is_estimated_with_its_rows(parent, rows, query):
    T = pose(matrix_from_rotation_vector(np.array([0.3, -0.2, 1.1])), np.array([2.0, -1.0, 0.4]))
    part = rows.subset(np.arange(60, 75))
    moved = replace(
        part,
        position=part.position @ T[:3, :3].T + T[:3, 3],
        frame="tracker",
        station=np.full(15, 4),
    )
    found = update_model(parent, moved, settings=ROBUST)
    back = found.in_base(moved)
    assert np.linalg.norm(back.position - part.position, axis=1).max() < 1e-4
    gap = found.predict(query).error - parent.predict(query).error
    assert np.linalg.norm(gap, axis=1).max() < 3e-4


def test_no_rows_change_nothing(parent, rows, query):
    same = update_model(parent, rows.subset(np.zeros(0, dtype=int)), settings=ROBUST)
    np.testing.assert_allclose(same.predict(query).error, parent.predict(query).error, atol=1e-15)


def test_another_number_of_joints_is_refused(parent):
    with pytest.raises(ModelMismatchError, match="5 joints"):
        update_model(
            parent,
            MeasurementSet(
                joints=np.zeros((4, 5)),
                position=np.zeros((4, 3)),
                covariance=np.tile(np.eye(3), (4, 1, 1)),
            ),
        )


def test_further_centres_keep_those_there_were(rows):
    basis = SmoothBasis(centres=np.zeros((1, 12)), scale=np.full(12, 1.0))
    more = add_centres(basis, rows.joints, most=10, enough=0.05)
    np.testing.assert_array_equal(more.centres[:1], basis.centres)
    assert len(more.centres) == 11
    np.testing.assert_allclose(
        more.columns(rows.joints)[:, 0], basis.columns(rows.joints)[:, 0], atol=1e-12
    )


def test_orientations_count_where_their_noise_is_known():
    """Points alone leave the last joint's zero to the prior; poses show it."""
    rng = np.random.default_rng(13)
    robot = arm(tool=(0.0, 0.0, 0.3))
    actual = planted(robot, rng)
    poses = measure(actual, postures(robot, 80, rng), rng, pose_sd=5e-5)
    model = fit(robot, poses.subset(np.arange(40)), settings=ROBUST)
    assert model.training_summary()["white_sd_rad"] < 1e-4
    found = update_model(model, poses.subset(np.arange(40, 80)), settings=ROBUST)
    query = Query(joints=postures(robot, 30, rng), load=PAYLOAD)
    off = [
        np.linalg.norm(m.predict(query).rotation_error - _turn(actual, robot, query), axis=1).mean()
        for m in (model, found)
    ]
    assert off[1] < off[0] < 2e-4


def _turn(actual, robot, query):
    state, _ = deflect_arm(actual, query.joints, PAYLOAD)
    believed = forward(robot, query.joints)[:, :3, :3]
    return rotation_vector_from_matrix(state.rotation @ np.swapaxes(believed, 1, 2))
