"""Rows against the calibration they stand for, and what is expected against what is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planning_cases import PAYLOAD, postures, shop

from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.settings import SolverSettings
from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.planning.criteria import covariance_after
from robotrue.planning.expectation import mean_length
from robotrue.planning.information import (
    Postures,
    UnmodelledErrors,
    after_fit,
    before_measuring,
    settings_of,
)
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm

NOTHING = UnmodelledErrors(ripple=np.full(1, 1e-12), fast=1e-12, backlash=1e-12, white=1e-12)
PRIOR = SolverSettings(learn_noise=False, learn_scales=False, loss="gaussian")


def exact(joints: np.ndarray) -> MeasurementSet:
    """Measurements of the nominal, elastic arm without any noise."""
    cell = shop()
    prior = before_measuring(cell)
    position = deflect_arm(prior.robot, joints, PAYLOAD)[0].position
    covariance = np.tile(1e-10 * np.eye(3), (len(joints), 1, 1))
    return MeasurementSet(joints=joints, position=position, covariance=covariance)


def test_what_is_left_is_what_the_fit_states() -> None:
    """The covariance expected of a plan is the one the calibration of it comes back with."""
    cell = shop()
    joints, work = postures(40, 1), postures(25, 2)
    model = before_measuring(cell, unmodelled=NOTHING)
    rows = model.rows(Postures(joints=joints, load=PAYLOAD))
    columns = model.work_errors(Postures(joints=work, load=PAYLOAD)).columns
    left = np.einsum("nik,kl,njl->nij", columns, covariance_after(rows), columns)
    measured = exact(joints)
    instrument = replace(measured, covariance=_instrument(measured))
    settings = replace(settings_of(cell), solver=PRIOR)
    fitted = fit(cell.measured_robot, instrument, method="elastic", settings=settings)
    fitted = replace(fitted, inflation=1.0)  # rows without noise would make it narrower
    stated = fitted.predict(Query(joints=work, load=PAYLOAD)).covariance
    repeat = settings.repeatability_sd**2 * np.eye(3)
    np.testing.assert_allclose(left, stated - repeat, rtol=2e-3, atol=1e-13)


def _instrument(measured: MeasurementSet) -> np.ndarray:
    return tracker_covariance(shop(), forward(shop().measured_robot, measured.joints)[:, :3, 3])


def test_planning_goes_on_from_a_fit() -> None:
    """Prior and 15 poses, or the model of these 15: the same is left to learn."""
    cell = shop()
    joints, more = postures(30, 5), postures(10, 6)
    settings = replace(settings_of(cell), solver=PRIOR)
    measured = exact(joints)
    instrument = replace(measured, covariance=_instrument(measured))
    fitted = fit(cell.measured_robot, instrument, method="elastic", settings=settings)
    fitted = replace(fitted, inflation=1.0)  # rows without noise would make it narrower
    before = before_measuring(cell, settings=settings, unmodelled=NOTHING)
    after = after_fit(fitted, cell, settings=settings, unmodelled=NOTHING)
    start = before.rows(Postures(joints=joints, load=PAYLOAD))
    gains = []
    for model, known in ((before, start), (after, after.rows(Postures(joints=joints[:0])))):
        work = model.work_errors(Postures(joints=postures(20, 7), load=PAYLOAD))
        rows = model.rows(Postures(joints=more, load=PAYLOAD))
        now = covariance_after(rows, covariance_after(known))
        gains.append(np.trace(now @ work.weight))
    assert gains[1] == pytest.approx(gains[0], rel=0.02)


def test_a_learned_model_keeps_its_drives() -> None:
    cell = shop()
    settings = replace(settings_of(cell), lean_on_prior=True)
    joints = postures(40, 8)
    clean = exact(joints)
    position = clean.position + 4e-5 * np.sin(3.0 * joints[:, :3])
    measured = replace(clean, position=position, covariance=_instrument(clean))
    fitted = fit(cell.measured_robot, measured, method="ripple", settings=settings)
    after = after_fit(fitted, cell, settings=settings)
    before = before_measuring(cell, settings=settings)
    where = Postures(joints=postures(30, 9), load=PAYLOAD)
    left, first = (m.work_errors(where).weight.trace() for m in (after, before))
    assert 0.0 < left < 1e-4 * first


def test_unknown_tracker_frame_frees_the_base() -> None:
    known = before_measuring(shop())
    free = before_measuring(shop(frame="tracker", tracker_position=None))
    where = Postures(joints=postures(5, 1))
    assert free.work_errors(where).weight.trace() > known.work_errors(where).weight.trace()


def test_a_second_load_shows_compliance() -> None:
    cell = shop(compliance_prior=np.full(6, np.nan))
    model = before_measuring(cell)
    joints = postures(30, 3)
    heavy = Load(mass=np.array([150.0]), com=np.array([[0.2, 0.0, 0.2]]))
    light = model.rows(Postures(joints=joints, load=PAYLOAD))
    work = model.work_errors(Postures(joints=postures(20, 4), load=heavy))
    both = np.concatenate([light[:15], model.rows(Postures(joints=joints[15:], load=heavy))])
    one, two = (np.trace(covariance_after(r) @ work.weight) for r in (light, both))
    assert two < 0.7 * one


def test_what_is_not_modelled_is_expected_to_stay() -> None:
    rough = UnmodelledErrors(fast=2e-4, white=1e-4)
    where = Postures(joints=postures(5, 1))
    smooth = before_measuring(shop()).work_errors(where)
    coarse = before_measuring(shop(), unmodelled=rough).work_errors(where)
    assert (np.trace(coarse.rest - smooth.rest, axis1=1, axis2=2) > 3e-8 * 0.9).all()


def test_mean_length_of_a_gaussian() -> None:
    rng = np.random.default_rng(0)
    draws = rng.standard_normal((200_000, 3))
    for scale in ((1.0, 1.0, 1.0), (3.0, 1.0, 0.5), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
        true = np.linalg.norm(draws * scale, axis=1).mean()
        assert mean_length(np.diag(np.square(scale))) == pytest.approx(true, rel=0.03)
    assert mean_length(np.zeros((2, 3, 3))).tolist() == [0.0, 0.0]


def test_a_model_of_another_arm_is_refused() -> None:
    cell = shop()
    settings = replace(settings_of(cell), lean_on_prior=True)
    fitted = fit(cell.measured_robot, exact(postures(20, 1)), method="nominal", settings=settings)
    other = preset("UR5")
    five = replace(
        other,
        **{
            name: getattr(other, name)[:5]
            for name in ("theta", "d", "a", "alpha", "beta", "limits")
        },
        joint_map=np.eye(5),
        link_mass=np.zeros(5),
        link_com=np.zeros((5, 3)),
        errors=np.empty(0),
        controller=None,
    )
    with pytest.raises(ModelMismatchError, match="the model is of KUKA KR160 R1570 with 6 joints"):
        after_fit(fitted, Cell(robot=five))
