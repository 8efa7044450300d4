"""What every error model promises, whatever learned it.

A kind of model joins by one line in ``MODELS``. All are fitted to simulated measurements of the
arm of Deng et al. 2022.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robotrue.calibration.archive import KINDS, open_model
from robotrue.calibration.deng2022.domains import divide_target
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.deng2022.transfer_gpr import fit_boosted_poses, fit_deng2022
from robotrue.calibration.methods import METHODS, fit
from robotrue.calibration.model import Query
from robotrue.calibration.sources import TransferSource
from robotrue.calibration.transfer import fit_transfer
from robotrue.calibration.update import update_model
from robotrue.core.archive import archive_bytes
from robotrue.core.poses import apply, pose
from robotrue.core.regions import CylinderRegion
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.errors import ModelMismatchError, ShapeError
from robotrue.robot.forward import forward
from robotrue.robot.statics import Load, deflect_arm
from robotrue.store.model_file import read_model, write_model
from robotrue_reproductions.deng2022 import scenarios

MODELS = (*METHODS, "updated", "transfer", "transfer-0", "boosted", "deng2022")
POSES = ("boosted", "deng2022")
PHYSICAL = tuple(name for name in MODELS if name not in POSES)
STATION = pose(matrix_from_abc(np.array([0.7, 0.1, -0.2])), np.array([2.0, -1.0, 0.4]))


@cache
def case():
    return scenarios.scenario("S1A", 3)


def arm():
    return case().cell.known.measured_robot


@cache
def rows():
    """40 poses over the whole region, base frame."""
    return scenarios.whole(case(), 40)


@cache
def elsewhere():
    """60 poses of another day."""
    return scenarios.source(case()).subset(np.arange(0, 120, 2))


def moved(measured, T):
    """The rows as a tracker at ``T`` would give them, its place not known."""
    turn = T[:3, :3]
    return replace(
        measured,
        frame="tracker",
        position=apply(T, measured.position),
        covariance=turn @ measured.covariance @ turn.T,
    )


def fitted(name, measured):
    settings = case().settings
    if name in METHODS:
        return fit(arm(), measured, method=name, settings=settings)
    if name == "updated":
        first = fit(arm(), measured.subset(np.arange(30)), method="ripple", settings=settings)
        return update_model(first, measured.subset(np.arange(30, 40)), settings=settings)
    if name == "transfer":
        known = fit(arm(), elsewhere(), method="ripple", settings=settings)
        return fit_transfer(
            arm(), measured.subset(np.arange(10)), [TransferSource(model=known)], settings
        )
    if name == "transfer-0":
        known = fit(arm(), elsewhere(), method="ripple", settings=settings)
        return fit_transfer(arm(), None, [TransferSource(model=known)], settings)
    if name == "boosted":
        return fit_boosted_poses(arm(), measured, [elsewhere()], settings)
    around = {"radius": (0.7, 1.5), "height": (0.6, 1.3)}
    domains = divide_target(
        CylinderRegion(angle=(-40 * DEG, -30 * DEG), **around),
        CylinderRegion(angle=(-30 * DEG, 40 * DEG), **around),
        5,
    )
    target = scenarios.measure_joints(case(), case().plan.target)
    quick = DengReadings(rounds=2, outside="nearest")
    return fit_deng2022(arm(), elsewhere(), target, domains, settings, quick)


@cache
def model(name):
    return fitted(name, rows())


@cache
def query(n=30):
    joints = scenarios.sobol_joints(case(), n)
    rng = np.random.default_rng(5)
    push = np.zeros((n, 6))
    push[:, :3] = rng.normal(0.0, 200.0, (n, 3))
    payload = case().settings.payload
    return Query(
        joints=joints,
        load=Load(mass=np.full(n, payload.mass[0]), com=np.tile(payload.com, (n, 1)), wrench=push),
        approach=np.sign(rng.standard_normal(joints.shape)),
    )


def part(whole, index):
    load = whole.load
    return Query(
        joints=whole.joints[index],
        load=Load(mass=load.mass[index], com=load.com[index], wrench=load.wrench[index]),
        approach=whole.approach[index],
    )


@pytest.mark.parametrize("name", MODELS)
def test_shapes_and_finite_numbers(name):
    found = model(name).predict(query())
    assert found.error.shape == (30, 3)
    assert found.rotation_error.shape == (30, 3)
    assert found.covariance.shape == (30, 3, 3)
    assert np.isfinite(found.error).all()
    assert np.isfinite(found.covariance).all()
    assert 1e-5 < np.linalg.norm(found.error, axis=1).mean() < 1e-2
    nothing = model(name).predict(Query(joints=np.zeros((0, 6))))
    assert nothing.error.shape == (0, 3)
    assert nothing.covariance.shape == (0, 3, 3)


@pytest.mark.parametrize("name", MODELS)
def test_covariance_is_symmetric_and_positive_definite(name):
    covariance = model(name).predict(query()).covariance
    np.testing.assert_allclose(covariance, np.swapaxes(covariance, 1, 2), rtol=0, atol=1e-20)
    repeatability = case().settings.repeatability_sd
    assert np.linalg.eigvalsh(covariance).min() > 0.99 * repeatability**2


@pytest.mark.parametrize("name", MODELS)
def test_rows_do_not_know_of_each_other(name):
    whole = model(name).predict(query())
    order = np.random.default_rng(1).permutation(30)
    turned = model(name).predict(part(query(), order))
    np.testing.assert_allclose(turned.error, whole.error[order], rtol=0, atol=1e-13)
    np.testing.assert_allclose(turned.covariance, whole.covariance[order], rtol=1e-9, atol=1e-18)
    for piece in (np.arange(7), np.arange(7, 8), np.arange(8, 30)):
        alone = model(name).predict(part(query(), piece))
        np.testing.assert_allclose(alone.error, whole.error[piece], rtol=0, atol=1e-13)
        np.testing.assert_allclose(alone.covariance, whole.covariance[piece], rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("name", MODELS)
def test_many_rows_are_the_same_rows(name):
    index = np.arange(5000) % 30
    many = model(name).predict(part(query(), index))
    few = model(name).predict(query())
    np.testing.assert_allclose(many.error, few.error[index], rtol=0, atol=1e-13)
    np.testing.assert_allclose(many.covariance, few.covariance[index], rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("name", [n for n in PHYSICAL if n != "transfer-0"])
def test_where_the_tracker_stood_changes_no_prediction(name):
    first = fitted(name, moved(rows(), STATION))
    again = fitted(name, moved(rows(), STATION @ STATION))
    a, b = first.predict(query()), again.predict(query())
    np.testing.assert_allclose(a.error, b.error, rtol=0, atol=2e-8)
    scale = np.abs(a.covariance).max()
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=0, atol=1e-3 * scale)


@pytest.mark.parametrize("name", MODELS)
def test_rows_in_base_come_back_as_they_are(name):
    assert model(name).in_base(rows()) is rows()


@pytest.mark.parametrize("name", MODELS)
def test_a_set_up_it_has_never_seen_is_refused(name):
    unknown = replace(moved(rows(), STATION), station=np.full(len(rows()), 7))
    with pytest.raises(ModelMismatchError):
        model(name).in_base(unknown)


@pytest.mark.parametrize("name", MODELS)
def test_archive_gives_the_same_model_to_the_last_bit(name, tmp_path):
    first = model(name)
    archive = first.to_archive()
    assert archive.kind in KINDS
    again = open_model(archive)
    assert archive_bytes(again.to_archive()) == archive_bytes(archive)
    write_model(tmp_path / "model.rtm", first, case().cell.known)
    stored = read_model(tmp_path / "model.rtm").model
    for other in (again, stored):
        a, b = first.predict(query()), other.predict(query())
        assert np.array_equal(a.error, b.error)
        assert np.array_equal(a.rotation_error, b.rotation_error, equal_nan=True)
        assert np.array_equal(a.covariance, b.covariance)
        assert dict(other.training_summary()) == dict(first.training_summary())


@pytest.mark.parametrize("name", MODELS)
def test_tables_say_what_predict_says(name):
    tables = model(name).mean_tables()
    if tables is None:
        assert name in POSES
        return
    joints, approach = query().joints, query().approach
    angle = joints[:, :, None] * tables.harmonics
    shift = (np.sin(angle) * tables.ripple_sin + np.cos(angle) * tables.ripple_cos).sum(axis=2)
    state, _ = deflect_arm(tables.robot, joints, query().load, shift + tables.backlash * approach)
    error = state.position - forward(model(name).robot, joints)[:, :3, 3]
    if len(tables.centres):
        features = tables.scale * np.hstack([np.sin(joints), np.cos(joints)])
        apart = ((features[:, None] - tables.centres) ** 2).sum(axis=2)
        error = error + np.exp(-apart / 2.0) @ tables.weights
    np.testing.assert_allclose(error, model(name).predict(query()).error, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_another_number_of_joints_is_refused(name):
    with pytest.raises(ShapeError, match="joints has shape"):
        model(name).predict(Query(joints=np.zeros((3, 5))))
    with pytest.raises(ShapeError):
        model(name).predict(Query(joints=np.zeros(6)))


@pytest.mark.parametrize("name", MODELS)
def test_summary_is_json_and_says_the_least_a_reader_needs(name):
    summary = json.loads(json.dumps(dict(model(name).training_summary()), allow_nan=False))
    assert isinstance(summary["method"], str)
    assert summary["rows"] > 0
    assert len(summary["data_sha256"]) == 64
    assert np.shape(summary["joint_range_rad"]) == (2, 6)
    assert all(isinstance(doubt, str) for doubt in summary["doubts"])
    assert all("simulated" in source for source in summary["sources"])


@pytest.mark.parametrize("name", MODELS)
def test_the_robot_is_the_nominal_one(name):
    robot = model(name).robot
    assert not robot.errors.any()
    np.testing.assert_allclose(robot.T_flange_tool, arm().T_flange_tool, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_it_predicts_better_than_nothing_and_says_how_well(name):
    check = scenarios.check(case())
    nominal = forward(arm(), check.joints)[:, :3, 3]
    payload = case().settings.payload
    found = model(name).predict(Query(joints=check.joints, load=payload, approach=check.approach))
    left = check.position - nominal - found.error
    before = np.linalg.norm(check.position - nominal, axis=1).mean()
    limit = 0.6 if name == "nominal" else 0.25
    assert np.linalg.norm(left, axis=1).mean() < limit * before
    square = np.einsum(
        "ni,nij,nj->n", left, np.linalg.inv(found.covariance + check.covariance), left
    )
    assert (square < 7.815).mean() > 0.7
