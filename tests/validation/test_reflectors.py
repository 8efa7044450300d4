"""Several reflectors on the flange: every row is compared with its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.archive import open_model
from robotrue.calibration.averaging import average_models
from robotrue.calibration.methods import METHODS, fit
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.sources import TransferSource
from robotrue.calibration.transfer import fit_transfer
from robotrue.calibration.update import update_model
from robotrue.core.poses import pose
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset
from robotrue.validation.drift_check import drift_check
from robotrue.validation.evaluation import evaluate
from robotrue.validation.selection import fit_auto
from robotrue.validation.validate import validate

PLACES = ((0.0, 0.0, 0.1), (0.08, -0.03, 0.06), (-0.05, 0.07, 0.12))
"""m on the flange."""
NOISE = 1e-5


def measured(n: int, seed: int, *, frame: str = "tracker") -> MeasurementSet:
    """Poses all over, the reflectors in turn."""
    rng = np.random.default_rng(seed)
    robot = nominal()
    errors = np.zeros(len(robot.errors))
    planted = np.random.default_rng(1)
    for name, sd in (("theta", 4e-4), ("d", 2e-4), ("a", 2e-4), ("alpha", 4e-4)):
        errors[parameter_slice(6, name)] = sd * planted.normal(size=6)
    actual = robot.with_errors(errors)
    low, high = np.clip(robot.limits, -2.0, 2.0).T
    joints = low + (high - low) * rng.random((n, 6))
    target = np.arange(n) % 3
    point = np.empty((n, 3))
    for k, place in enumerate(PLACES):
        mine = target == k
        point[mine] = forward(actual.with_tool(pose(np.eye(3), np.array(place))), joints[mine])[
            :, :3, 3
        ]
    if frame == "tracker":
        point = point @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) + 1.0
    return MeasurementSet(
        joints=joints,
        position=point + NOISE * rng.normal(size=point.shape),
        covariance=np.broadcast_to(NOISE**2 * np.eye(3), (n, 3, 3)),
        frame=frame,
        target=target,
    )


def nominal():
    return preset("ur10").with_tool(pose(np.eye(3), np.array(PLACES[0])))


SETTINGS = FitSettings(repeatability=1e-5)
MM = 1e-3


@pytest.fixture(scope="module")
def training() -> MeasurementSet:
    return measured(60, 2)


@pytest.mark.parametrize("method", ["geometric", "ripple"])
def test_each_row_is_predicted_at_its_own_reflector(training, method):
    model = fit(nominal(), training, method=method, settings=SETTINGS)
    result = validate(model, measured(90, 3))
    assert result.after.mean < 0.04 * MM  # 70 mm where reflector 0 stands for all
    assert result.before.mean < 5.0 * MM
    assert result.before_aligned is not None
    assert result.before_aligned.mean < 5.0 * MM
    assert result.coverage.share > 0.9
    assert not any("eflector" in doubt for doubt in result.doubts)


@pytest.mark.parametrize("method", ["geometric", "ripple"])
def test_the_region_of_a_further_reflector_is_as_wide_as_that_of_the_tool(training, method):
    model = fit(nominal(), training, method=method, settings=SETTINGS)
    rows = measured(90, 4)
    seen = evaluate(model, rows)
    width = np.sqrt(np.trace(seen.covariance, axis1=1, axis2=2))
    mean = [width[rows.target == k].mean() for k in range(3)]
    assert max(mean) < 1.5 * min(mean)


@pytest.mark.parametrize("method", ["geometric", "ripple"])
def test_a_stored_model_knows_its_reflectors(training, method):
    model = fit(nominal(), training, method=method, settings=SETTINGS)
    again = open_model(model.to_archive())
    rows = measured(30, 5)
    np.testing.assert_array_equal(evaluate(again, rows).after, evaluate(model, rows).after)
    np.testing.assert_array_equal(
        evaluate(again, rows).covariance, evaluate(model, rows).covariance
    )


def test_a_reflector_the_model_never_saw_is_refused(training):
    model = fit(nominal(), training, method="geometric", settings=SETTINGS)
    rows = replace(measured(30, 3), target=np.full(30, 7))
    with pytest.raises(ModelMismatchError, match=r"reflector 7 .* which has \[0, 1, 2\]"):
        validate(model, rows)


def test_auto_compares_methods_at_each_reflector(training):
    three = {name: METHODS[name] for name in ("nominal", "geometric")}
    model = fit_auto(nominal(), training, SETTINGS, methods=three)
    table = {row["name"]: row for row in model.training_summary()["selection"]["table"]}
    assert model.training_summary()["selection"]["winner"] == "geometric"
    assert table["geometric"]["mean"] < 0.06 * MM
    assert table["nominal"]["mean"] < 2.0 * MM


def test_held_out_rows_of_a_reflector_with_no_others_are_not_scored(training):
    alone = replace(training, target=np.where(np.arange(60) == 7, 1, 0) * 1)
    alone = alone.subset(np.flatnonzero((training.target == 0) | (np.arange(60) == 7)))
    two = {name: METHODS[name] for name in ("nominal", "geometric")}
    model = fit_auto(nominal(), alone, SETTINGS, methods=two)
    assert model.training_summary()["selection"]["table"][0]["n"] == len(alone) - 1


def test_updates_and_transfers_know_the_reflectors_of_their_rows(training):
    model = fit(nominal(), training, method="geometric", settings=SETTINGS)
    more, test = measured(60, 6), measured(60, 7)
    moved = update_model(model, more, settings=SETTINGS)
    assert np.linalg.norm(evaluate(moved, test).after, axis=1).mean() < 0.04 * MM
    source = TransferSource(model=model, relation="campaign")
    carried = fit_transfer(nominal(), more, [source], SETTINGS)
    seen = evaluate(carried, test)
    assert np.linalg.norm(seen.after, axis=1).mean() < 0.06 * MM
    width = np.sqrt(np.trace(seen.covariance, axis1=1, axis2=2))
    assert width.max() < 1.0 * MM


def test_a_drift_check_takes_the_tool_alone(training):
    model = fit(nominal(), training, method="geometric", settings=SETTINGS)
    with pytest.raises(ConfigurationError, match="20 of 30 rows are of other reflectors"):
        drift_check(model, measured(30, 3))


def test_an_average_predicts_each_reflector_as_the_mixture_does(training):
    models = [
        fit(nominal(), training, method=m, settings=SETTINGS) for m in ("geometric", "elastic")
    ]
    rows, share = measured(30, 5), np.array([0.6, 0.4])
    seen = [evaluate(model, rows) for model in models]
    mean = np.tensordot(share, np.array([s.after for s in seen]), axes=1)
    apart = np.array([s.after for s in seen]) - mean
    mixed = np.einsum("k,knij->nij", share, np.array([s.covariance for s in seen]))
    mixed += np.einsum("k,kni,knj->nij", share, apart, apart)
    average = average_models(models, share)
    found = evaluate(open_model(average.to_archive()), rows)
    np.testing.assert_allclose(found.after, mean, atol=1e-7)  # moments times compliance
    np.testing.assert_allclose(found.covariance, mixed, rtol=0.01, atol=1e-12)
