"""Ripple columns, and planted ripple found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures, ripple_shift

from robotrue.calibration.learned import LearnedMethod, LearnedParts
from robotrue.calibration.methods import FitSettings
from robotrue.calibration.model import Query
from robotrue.calibration.terms.ripple import Ripple, harmonics
from robotrue.calibration.terms.term import ArmPostures
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity, forward
from robotrue.robot.statics import deflect_arm

SETTINGS = FitSettings(payload=PAYLOAD, repeatability=6e-5)


def rippling(actual, joints, rng, *, size, backlash=0.0, approach=None):
    """Simulated points of an arm whose joints 1 and 2 ripple at 13 and 9 cycles."""
    shift = np.zeros_like(joints)
    shift[:, 0] = size * np.sin(13.0 * joints[:, 0])
    shift[:, 1] = size * np.cos(9.0 * joints[:, 1])
    sign = np.zeros_like(joints) if approach is None else approach
    state, _ = deflect_arm(actual, joints, PAYLOAD, shift + backlash * sign)
    noise = 2e-5 * rng.standard_normal((len(joints), 3))
    return MeasurementSet(
        joints=joints,
        position=state.position + noise,
        covariance=np.tile(4e-10 * np.eye(3), (len(joints), 1, 1)),
        approach=sign,
    ), state.position


def test_columns_times_coefficients_equal_the_shift():
    rng = np.random.default_rng(1)
    joints, drive = rng.uniform(-2, 2, (7, 6)), rng.standard_normal((7, 3, 6))
    sine, cosine = rng.standard_normal((2, 6, 5))
    ripple, robot = Ripple(dof=6, cycles=harmonics(5)), arm()
    weights = np.stack([sine, cosine], axis=-1).ravel()
    at = ArmPostures(joints=joints, torque=np.zeros_like(joints))
    by = Sensitivity(errors=drive, drive=drive, shift=drive[:, :, :3])
    shift = ripple.effect(robot, at, weights).drive_shift
    np.testing.assert_allclose(shift, ripple_shift(joints, harmonics(5), sine, cosine), atol=1e-12)
    columns = ripple.columns(robot, at, by, weights)
    expected = np.einsum("nmd,nd->nm", drive, shift)
    np.testing.assert_allclose(columns @ weights, expected, atol=1e-12)


def test_groups_cover_every_coefficient_once():
    groups = Ripple(dof=6, cycles=harmonics(264)).groups(few=False)
    columns = np.concatenate([g.columns for g in groups])
    np.testing.assert_array_equal(np.sort(columns), np.arange(6 * 264 * 2))


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(31)
    robot = arm()
    actual = planted(robot, rng)
    joints = postures(robot, 320, rng)
    approach = rng.choice([-1.0, 1.0], joints.shape)
    data, _ = rippling(actual, joints, rng, size=8e-5, backlash=2e-5, approach=approach)
    model = LearnedMethod(name="ripple", parts=LearnedParts(smooth=False, highest=16))(
        robot, data, SETTINGS
    )
    return robot, actual, model


def test_planted_ripple_is_found(found):
    robot, _, model = found
    q = np.linspace(0.9 * robot.limits[:, 0], 0.9 * robot.limits[:, 1], 200)
    tables = model.mean_tables()
    shift = ripple_shift(q, tables.harmonics, tables.ripple_sin, tables.ripple_cos)
    for joint, planted_shift in ((0, np.sin(13.0 * q[:, 0])), (1, np.cos(9.0 * q[:, 1]))):
        # The slow part of the curve is shared with offset, gear error and wind-up.
        angle = q[:, joint]
        slow = np.stack([np.ones(200), angle, np.sin(angle), np.cos(angle)], axis=1)
        off = shift[:, joint] - 8e-5 * planted_shift
        off -= slow @ np.linalg.lstsq(slow, off, rcond=None)[0]
        assert np.sqrt((off**2).mean()) < 1e-5


def test_planted_backlash_is_found(found):
    _, _, model = found
    np.testing.assert_allclose(model.mean_tables().backlash[:3], 2e-5, atol=5e-6)


def test_prediction_of_new_postures_and_its_coverage(found):
    robot, actual, model = found
    rng = np.random.default_rng(32)
    joints = postures(robot, 400, rng)
    approach = rng.choice([-1.0, 1.0], joints.shape)
    _, true = rippling(actual, joints, rng, size=8e-5, backlash=2e-5, approach=approach)
    stated = model.predict(Query(joints=joints, load=PAYLOAD, approach=approach))
    off = true - forward(robot, joints)[:, :3, 3] - stated.error
    assert np.linalg.norm(off, axis=1).mean() < 4e-5
    squared = (off * np.linalg.solve(stated.covariance, off[:, :, None])[:, :, 0]).sum(axis=1)
    # One visit also pays the repeatability the statement holds, so the mean path lies well inside.
    assert (squared <= 7.815).mean() > 0.93


def test_without_ripple_the_evidence_leaves_it_out():
    rng = np.random.default_rng(33)
    robot = arm()
    actual = planted(robot, rng)
    data, _ = rippling(actual, postures(robot, 60, rng), rng, size=0.0)
    model = LearnedMethod(name="gp", parts=LearnedParts())(robot, data, SETTINGS)
    assert np.abs(model.mean_tables().ripple_sin).max(initial=0.0) < 5e-6
    joints = postures(robot, 200, rng)
    _, true = rippling(actual, joints, rng, size=0.0)
    off = true - forward(robot, joints)[:, :3, 3]
    plain = LearnedMethod(name="elastic", parts=LearnedParts(ripple=False, smooth=False))(
        robot, data, SETTINGS
    )
    query = Query(joints=joints, load=PAYLOAD)
    learned, physical = (
        float(np.linalg.norm(off - m.predict(query).error, axis=1).mean()) for m in (model, plain)
    )
    assert learned < 1.2 * physical + 2e-6


def test_rows_in_any_order_of_columns_need_no_approach():
    rng = np.random.default_rng(34)
    robot = arm()
    data, _ = rippling(planted(robot, rng), postures(robot, 60, rng), rng, size=0.0)
    silent = replace(data, approach=np.zeros_like(data.joints))
    model = LearnedMethod(name="ripple", parts=LearnedParts(smooth=False, highest=16))(
        robot, silent, SETTINGS
    )
    np.testing.assert_array_equal(model.mean_tables().backlash, 0.0)
    assert any("approach" in doubt for doubt in model.training_summary()["doubts"])
