"""The average of several fits is one error model: the moments of their mixture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.averaging import average_models
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.calibration.transfer import TransferSource, fit_transfer
from robotrue.calibration.update import update_model
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError
from robotrue.robot.forward import forward

SETTINGS = FitSettings(payload=PAYLOAD, campaign_shift=0.0)
WEIGHTS = np.array([0.5, 0.3, 0.2])
STATION = pose(matrix_from_rotation_vector(np.array([0.1, -0.2, 2.5])), np.array([4.0, -3.0, 1.0]))


def rows_of(frame: str):
    rng = np.random.default_rng(5)
    robot, station = arm(), STATION if frame == "tracker" else None
    actual = planted(robot, rng, base=0.0 if frame == "tracker" else 1e-3)
    return measure(actual, postures(robot, 30, rng), rng, T_tracker_base=station)


@pytest.fixture(scope="module", params=["base", "tracker"])
def fits(request):
    rows = rows_of(request.param)
    methods = ("ripple", "geometric", "elastic")
    return rows, [fit(arm(), rows, method=method, settings=SETTINGS) for method in methods]


def seen_points(model, joints):
    """Predicted points and covariances in the frame of the measurements."""
    found = model.predict(Query(joints=joints, load=PAYLOAD))
    point = forward(model.robot, joints)[:, :3, 3] + found.error
    if not model.T_tracker_base:
        return point, found.covariance
    T = model.T_tracker_base[0]
    turn = T[:3, :3]
    return point @ turn.T + T[:3, 3], turn @ found.covariance @ turn.T


@pytest.mark.parametrize("together", [False, True])
def test_mean_and_covariance_are_those_of_the_mixture(fits, together):
    _, models = fits
    joints = postures(arm(), 25, np.random.default_rng(6))
    points, covariances = zip(*(seen_points(model, joints) for model in models), strict=True)
    points = np.array(points)
    mean = np.tensordot(WEIGHTS, points, axes=1)
    apart = points - mean
    factors = np.array([model.inflation if together else 1.0 for model in models])
    mixed = np.einsum("k,knij->nij", WEIGHTS / factors, np.array(covariances))
    mixed += np.einsum("k,kni,knj->nij", WEIGHTS, apart, apart)
    if not together:  # without held-out rows each keeps its own factor
        models = [replace(model, held_out=None) for model in models]
    average = average_models(models, 7.0 * WEIGHTS)
    assert (average.inflation == 1.0) != together
    mixed *= average.inflation
    point, covariance = seen_points(average, joints)
    np.testing.assert_allclose(point, mean, atol=2e-6)  # the arm is not quite linear
    scale = np.trace(mixed, axis1=1, axis2=2)[:, None, None]
    np.testing.assert_allclose(covariance / scale, mixed / scale, atol=0.03)


def test_the_mixture_of_a_stiff_arm_and_soft_ones_whose_links_have_no_stated_mass():
    rng = np.random.default_rng(9)
    unknown = replace(arm(), link_mass=np.zeros(6), total_mass=250.0)
    rows = measure(planted(arm(), rng), postures(arm(), 40, rng), rng)
    methods = ("geometric", "elastic", "ripple")
    models = [fit(unknown, rows, method=method, settings=SETTINGS) for method in methods]
    joints = postures(arm(), 25, rng)
    points = np.array([seen_points(model, joints)[0] for model in models])
    mean = np.tensordot(WEIGHTS, points, axes=1)
    assert np.linalg.norm(points[0] - points[1], axis=1).max() > 1e-3
    point, _ = seen_points(average_models(models, WEIGHTS), joints)
    np.testing.assert_allclose(point, mean, atol=5e-6)


def test_an_average_is_saved_updated_and_inverted_like_any_model(fits):
    rows, models = fits
    average = average_models(models, WEIGHTS)
    query = Query(joints=postures(arm(), 5, np.random.default_rng(7)), load=PAYLOAD)
    stated = average.predict(query)
    again = open_model(average.to_archive()).predict(query)
    np.testing.assert_array_equal(again.error, stated.error)
    np.testing.assert_allclose(again.covariance, stated.covariance, rtol=1e-12)
    assert average.mean_tables() is not None
    after = update_model(average, rows, settings=SETTINGS).predict(query)
    assert np.linalg.det(after.covariance).max() < np.linalg.det(stated.covariance).max()


def test_a_residual_over_more_centres_is_averaged_with_one_over_fewer():
    rows = rows_of("base")
    source = TransferSource(model=fit(arm(), rows, settings=SETTINGS), relation="region")
    moved = fit_transfer(arm(), rows.subset(np.arange(12)), [source], SETTINGS)
    further = TransferSource(model=moved, relation="region")
    fewer = fit_transfer(arm(), None, [further], SETTINGS)
    more = fit_transfer(arm(), rows.subset(np.arange(12, 24)), [further], SETTINGS)
    average = average_models([more, fewer], np.array([0.5, 0.5]))
    query = Query(joints=postures(arm(), 25, np.random.default_rng(8)), load=PAYLOAD)
    parts = [model.predict(query) for model in (more, fewer)]
    mean = 0.5 * (parts[0].error + parts[1].error)
    np.testing.assert_allclose(average.predict(query).error, mean, atol=2e-6)
    spread = 0.5 * sum(np.trace(p.covariance, axis1=1, axis2=2) for p in parts)
    spread += 0.25 * ((parts[0].error - parts[1].error) ** 2).sum(axis=1)
    stated = np.trace(average.predict(query).covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(stated, spread, rtol=0.03)


def test_an_average_of_one_is_that_model(fits):
    _, models = fits
    assert average_models(models[:1], np.ones(1)) is models[0]


def test_arms_with_other_tools_have_no_average(fits):
    _, (first, second, _) = fits
    other = replace(second, robot=second.robot.with_tool(np.eye(4)))
    with pytest.raises(ConfigurationError, match="tool points"):
        average_models([first, other], np.ones(2))
