"""Warmth as an error term: planted, and found from temperatures or from the time."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from planted_arm import arm, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.arm import prepare_arm
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.terms.thermal import REFERENCE, Thermal, link_lengths
from robotrue.calibration.update import update_model
from robotrue.core.archive import archive_bytes
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions, no_conditions
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import parameter_jacobian, walk
from robotrue.robot.statics import NO_LOAD
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage

Stated = Literal["temperature", "joints", "time", "nothing"]
GROWTH = 14e-6
ZERO = np.array([6e-6, -8e-6, 5e-6, 0.0, 4e-6, 0.0])
NOISE = 1e-5
HOUR = 3600.0
NOMINAL = arm()
ARM = planted(NOMINAL, np.random.default_rng(5))


def true_points(joints: Array, kelvin: Array) -> Array:
    """Where the tool point is with joints and links that are warmer (n, dof) than 20 degC."""
    state = walk(ARM, joints, kelvin * ZERO)
    strain = GROWTH * np.column_stack([kelvin, kelvin[:, -1]])
    grown = parameter_jacobian(ARM, state, joints)[:, :3] @ (strain @ link_lengths(ARM))[:, :, None]
    return np.asarray(state.position + grown[:, :, 0])


def rows(n: int, seed: int, stated: Stated, hours: tuple[float, float] = (0, 6)) -> MeasurementSet:
    """Simulated poses of a shift in which the arm warms from 18 to nearly 28 degC."""
    rng = np.random.default_rng(seed)
    joints = postures(NOMINAL, n, rng)
    time = np.sort(rng.uniform(*hours, n)) * HOUR
    kelvin = np.tile(-2.0 - 10.0 * np.expm1(-time / (1.5 * HOUR))[:, None], 6)
    if stated == "joints":
        kelvin = kelvin + rng.uniform(-3.0, 3.0, 6)
    points = true_points(joints, kelvin)
    unknown = np.full(n, np.nan)
    return MeasurementSet(
        joints=joints,
        position=points + NOISE * rng.standard_normal((n, 3)),
        covariance=np.tile(NOISE**2 * np.eye(3), (n, 1, 1)),
        temperature=REFERENCE + kelvin[:, 0] if stated == "temperature" else unknown,
        joint_temperature=REFERENCE + kelvin if stated == "joints" else np.full((n, 6), np.nan),
        time=time if stated == "time" else unknown,
    )


def fitted(stated: Stated) -> CalibratedModel:
    model = fit(NOMINAL, rows(80, 1, stated, (0, 3)), method="ripple")
    assert isinstance(model, CalibratedModel)
    return model


@pytest.fixture(scope="module")
def by_temperature() -> CalibratedModel:
    return fitted("temperature")


@pytest.fixture(scope="module")
def by_time() -> CalibratedModel:
    return fitted("time")


def thermal(model: CalibratedModel) -> tuple[Thermal, Array, Array]:
    """The term, its parameters and their standard deviations."""
    belief = model.belief()
    place = belief.place("thermal")
    term = next(t for t in model.terms if isinstance(t, Thermal))
    return term, belief.mean[place], np.sqrt(belief.inflation * belief.variance[place])


def late_error(model: CalibratedModel, stated: Stated) -> tuple[float, float]:
    """Mean error in m of rows of hours 4 to 6, and the share in their 95 % region."""
    seen = evaluate(model, rows(300, 7, stated, (4, 6)))
    return (
        float(np.linalg.norm(seen.after, axis=1).mean()),
        coverage(seen.after, seen.covariance).share,
    )


def test_planted_warmth_is_found_within_its_uncertainty(by_temperature: CalibratedModel) -> None:
    _, values, sd = thermal(by_temperature)
    assert abs(values[0] - GROWTH) < 3.0 * sd[0] < 6e-6
    assert (np.abs(values[7:13] - ZERO) < 3.5 * sd[7:13]).all()
    assert sd[8] < 1e-6


@pytest.mark.parametrize("stated", ["temperature", "joints", "time"])
def test_late_rows_are_predicted_better_and_honestly(
    stated: Stated, by_temperature: CalibratedModel, by_time: CalibratedModel
) -> None:
    known = {"temperature": by_temperature, "time": by_time}
    model = known[stated] if stated in known else fitted(stated)
    error, share = late_error(model, stated)
    blind, _ = late_error(fitted("nothing"), "nothing")
    assert error < 0.6 * blind
    assert share > 0.9


def test_the_lag_is_learned_where_only_the_time_is_known(by_time: CalibratedModel) -> None:
    _, values, sd = thermal(by_time)
    assert abs(values[-1] - np.log(1.5)) < 2.0 * sd[-1]
    assert sd[-1] < 0.4  # .7 before
    assert "two thirds of the way after 1." in by_time.training_summary().terms[0]


def test_what_is_not_stated_is_the_mean_of_the_calibration_and_uncertain(
    by_temperature: CalibratedModel,
) -> None:
    joints = rows(20, 3, "nothing").joints
    term, _, _ = thermal(by_temperature)
    usual = ArmConditions(temperature=np.array([[term.usual[0] + REFERENCE]]))
    blind = by_temperature.predict(Query(joints=joints))
    told = by_temperature.predict(Query(joints=joints, conditions=usual))
    np.testing.assert_allclose(blind.error, told.error, atol=1e-9)
    assert (np.linalg.eigvalsh(blind.covariance - told.covariance) > -1e-18).all()
    spread = np.sqrt(np.trace(blind.covariance - told.covariance, axis1=1, axis2=2)).mean()
    assert 1e-5 < spread < 1e-4


def test_a_model_at_a_stated_temperature_says_it_in_predictions_and_tables(
    by_temperature: CalibratedModel,
) -> None:
    joints = rows(20, 3, "nothing").joints
    warm = ArmConditions(temperature=np.array([[REFERENCE + 9.0]]))
    at = by_temperature.under(warm)
    told = by_temperature.predict(Query(joints=joints, conditions=warm))
    again = at.predict(Query(joints=joints))
    np.testing.assert_allclose(again.error, told.error, atol=1e-12)
    np.testing.assert_allclose(again.covariance, told.covariance, rtol=1e-9)
    cold = at.mean_tables().robot.errors - by_temperature.mean_tables().robot.errors
    assert 1e-5 < np.abs(cold[6:12]).max() < 1e-4  # d grows by some ten um in the 3 K between
    states = [
        prepare_arm(robot).linearise(joints, NO_LOAD)
        for robot in (by_temperature.actual, at.mean_tables().robot)
    ]
    assert np.linalg.norm(states[1].tip - states[0].tip, axis=1).mean() > 5e-5


def test_a_temperature_beyond_the_calibration_is_remarked_on(
    by_temperature: CalibratedModel, by_time: CalibratedModel
) -> None:
    hot = ArmConditions(temperature=np.array([[REFERENCE + 20.0]]))
    assert by_temperature.remarks_on(hot)[0].startswith("40.0 degC is beyond the 18.")
    usual = ArmConditions(temperature=np.array([[REFERENCE + 3.0]]))
    assert by_temperature.remarks_on(usual) == []
    assert by_temperature.remarks_on(no_conditions())[0].startswith(
        "for the mean of the calibration, 2"
    )
    assert by_time.remarks_on(usual)[0].endswith("--time states another")
    late = ArmConditions(temperature=np.array([[np.nan]]), time=np.array([9.0 * HOUR]))
    assert "h is beyond the 0.0 to" in by_time.remarks_on(late)[0]


def test_a_model_without_warmth_refuses_a_temperature() -> None:
    with pytest.raises(ConfigurationError, match="no part of the model depends on it"):
        fitted("nothing").under(ArmConditions(temperature=np.array([[300.0]])))


def test_new_rows_move_it_and_the_archive_keeps_it(by_temperature: CalibratedModel) -> None:
    more = update_model(by_temperature, rows(40, 21, "temperature"))
    assert thermal(more)[2][0] < thermal(by_temperature)[2][0]
    assert late_error(more, "temperature")[1] > 0.9
    archive = more.to_archive()
    again = open_model(archive)
    assert archive_bytes(again.to_archive()) == archive_bytes(archive)
    check = rows(10, 9, "temperature")
    query = Query(joints=check.joints, conditions=check.conditions)
    np.testing.assert_array_equal(again.predict(query).error, more.predict(query).error)


def test_rows_that_show_no_warmth_are_not_asked_for_it() -> None:
    steady = rows(40, 1, "temperature")
    assert Thermal.begin(NOMINAL, steady, False) is not None
    assert Thermal.begin(NOMINAL, steady.subset(np.arange(8)), False) is None
    flat = replace(steady, temperature=np.full(40, 295.0))
    assert Thermal.begin(NOMINAL, flat, False) is None
    holes = replace(steady, temperature=np.where(np.arange(40) == 3, np.nan, steady.temperature))
    assert Thermal.begin(NOMINAL, holes, False) is None
    both = replace(flat, time=rows(40, 1, "time").time)
    assert Thermal.begin(NOMINAL, both, False).driver == "time"
