"""The learned model: its tables, archive and tools, far from the data, and on a measured arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.calibrated_model import LEARNED
from robotrue.calibration.estimate import estimate
from robotrue.calibration.held_out_blocks import match_quantile, predict_held_out
from robotrue.calibration.learned import (
    LearnedMethod,
    LearnedParts,
    climb_ladder,
    first_design,
)
from robotrue.calibration.methods import FitSettings
from robotrue.calibration.model import Query
from robotrue.calibration.relinearisation import renew_linearisation
from robotrue.calibration.scale_learning import learn
from robotrue.calibration.settings import free_groups
from robotrue.calibration.terms.smooth import SmoothBasis
from robotrue.core.archive import write_archive
from robotrue.errors import ArchiveError, ShapeError
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.robot.statics import deflect_arm, drive_torque

SETTINGS = FitSettings(payload=PAYLOAD, repeatability=6e-5)


def bump(joints):
    """A smooth error no part of the physics knows, m."""
    return 2e-4 * np.stack(
        [np.cos(3 * joints[:, 1]) * joints[:, 0], np.sin(2 * joints[:, 0]), joints[:, 2] ** 2], 1
    )


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(41)
    robot = arm()
    joints = postures(robot, 200, rng)
    joints[:, 0] *= 0.4
    shift = np.zeros_like(joints)
    shift[:, 1] = 6e-5 * np.sin(11.0 * joints[:, 1])
    approach = rng.choice([-1.0, 1.0], joints.shape)
    state, _ = deflect_arm(planted(robot, rng), joints, PAYLOAD, shift + 1e-5 * approach)
    data = MeasurementSet(
        joints=joints,
        position=state.position + bump(joints) + 2e-5 * rng.standard_normal((200, 3)),
        covariance=np.tile(4e-10 * np.eye(3), (200, 1, 1)),
        approach=approach,
    )
    return LearnedMethod(name="gp", parts=LearnedParts(highest=16))(robot, data, SETTINGS)


@pytest.fixture(scope="module")
def query():
    rng = np.random.default_rng(42)
    joints = postures(arm(), 30, rng)
    return Query(joints=joints, load=PAYLOAD, approach=rng.choice([-1.0, 0.0, 1.0], joints.shape))


def test_smooth_part_was_kept(model):
    assert model.training_summary()["smooth"] == "kept"


def test_tables_reproduce_the_mean_below_a_nanometre(model, query):
    tables = model.mean_tables()
    q = query.joints
    phase = q[:, :, None] * tables.harmonics
    ripple = (tables.ripple_sin * np.sin(phase) + tables.ripple_cos * np.cos(phase)).sum(axis=2)
    wind = tables.robot.error("compliance") * drive_torque(tables.robot, q, PAYLOAD)
    shift = ripple + tables.backlash * query.approach + wind
    s = tables.scale * np.concatenate([np.sin(q), np.cos(q)], axis=1)
    square = ((s[:, None] - tables.centres) ** 2).sum(axis=2)
    smooth = np.exp(-square / 2.0) @ tables.weights
    position = forward(tables.robot, q, shift)[:, :3, 3] + smooth
    expected = position - forward(model.robot, q)[:, :3, 3]
    assert np.abs(expected - model.predict(query).error).max() < 1e-9


def test_archive_round_trip_is_exact(model, query, tmp_path):
    write_archive(tmp_path / "arm.robotrue", model.to_archive())
    again = open_model(tmp_path / "arm.robotrue")
    before, after = model.predict(query), again.predict(query)
    np.testing.assert_array_equal(after.error, before.error)
    np.testing.assert_array_equal(after.covariance, before.covariance)
    assert again.training_summary() == model.training_summary()


def test_archive_of_another_kind_and_schema_is_refused(model):
    archive = model.to_archive()
    assert archive.kind == LEARNED
    with pytest.raises(ArchiveError, match="schema 2"):
        open_model(replace(archive, schema=2))
    with pytest.raises(ArchiveError, match="incomplete"):
        open_model(replace(archive, document={}))


def test_far_from_the_data_the_residual_fades(model, query):
    """The same model with every centre moved out of reach: physics and ripple are left."""
    smooth = model.belief().smooth
    away = SmoothBasis(centres=smooth.basis.centres + 40.0, scale=smooth.basis.scale)
    moved = (*model.terms[:-1], replace(smooth, basis=away))
    lost = replace(model, terms=moved).predict(query)
    zero = model.values.copy()
    zero[-smooth.size :] = 0.0
    silent = replace(model, values=zero).predict(query)
    np.testing.assert_allclose(lost.error, silent.error, atol=1e-12)
    floor = model.inflation * smooth.amplitude**2
    assert np.linalg.eigvalsh(lost.covariance).min() > floor
    stated = model.predict(query)
    assert (np.trace(lost.covariance - stated.covariance, axis1=1, axis2=2) > 0.0).mean() > 0.9


def test_variance_grows_away_from_the_data(model):
    near = np.mean(arm().limits, axis=1)[None]
    far = near + np.array([[np.pi, 0.0, 0.0, 0.0, 0.0, 0.0]])
    variance = [
        np.trace(model.predict(Query(joints=q, load=PAYLOAD)).covariance[0]) for q in (near, far)
    ]
    assert variance[1] > 2.0 * variance[0]


def test_another_tool_moves_with_the_chain(model, query):
    tool = model.robot.T_flange_tool.copy()
    tool[:3, 3] += [0.0, 0.0, 0.2]
    other = model.predict(replace(query, T_flange_tool=tool))
    same = model.predict(query)
    assert np.linalg.norm(other.error - same.error, axis=1).max() < 2e-3
    added = np.trace(other.covariance - same.covariance, axis1=1, axis2=2)
    assert (added > 0.0).all()


def test_wrong_shapes_are_refused(model):
    with pytest.raises(ShapeError, match="joints"):
        model.predict(Query(joints=np.zeros((2, 5))))
    with pytest.raises(ShapeError, match="approach"):
        model.predict(Query(joints=np.zeros((2, 6)), approach=np.zeros((1, 6))))


@pytest.mark.data
def test_measured_ur5_random_poses(data_dir):
    folder = data_dir / "ur5-jacobi"
    train = read_measurements(folder / "3D_UR5_uncalibrated_grid_cleaned.csv")
    test = read_measurements(folder / "3D_UR5_uncalibrated_random_cleaned.csv")
    model = LearnedMethod(name="ripple", parts=LearnedParts(smooth=False, highest=64))(
        preset("UR5"), train, FitSettings()
    )
    stated = model.predict(Query(joints=test.joints))
    off = test.position - forward(model.robot, test.joints)[:, :3, 3] - stated.error
    assert np.linalg.norm(off, axis=1).mean() <= 0.062e-3


def test_held_out_rows_equal_a_fit_without_them():
    rng = np.random.default_rng(43)
    robot = arm()
    joints = postures(robot, 80, rng)
    state, _ = deflect_arm(planted(robot, rng), joints, PAYLOAD)
    scatter = np.hypot(2e-5, SETTINGS.repeatability_sd)
    data = MeasurementSet(
        joints=joints,
        position=state.position + scatter * rng.standard_normal((80, 3)),
        covariance=np.tile(4e-10 * np.eye(3), (80, 1, 1)),
    )
    physical = estimate(robot, data, SETTINGS, free_groups("elastic"))
    parts = LearnedParts(highest=16)
    at = renew_linearisation(
        climb_ladder(first_design(physical, data, SETTINGS, parts), parts), steps=3
    )
    found = predict_held_out(
        at.design, at.sums, at.weights, np.zeros(80), SETTINGS.repeatability_sd
    )
    chosen = np.arange(80) < 16  # the first of five blocks
    others = learn(at.design.sums(~chosen), at.weights.groups, at.weights.noise, steps=6)
    for item in at.design.rows(chosen):
        off = item.lower @ (item.values - item.columns @ others.mean)[:, :, None]
        np.testing.assert_allclose(found.error[item.rows], off[:, :, 0], atol=1e-9)
    factor = match_quantile(found)
    assert replace(found, inflation=factor).coverage >= 0.95
    assert replace(found, inflation=0.98 * factor).coverage <= 0.95
