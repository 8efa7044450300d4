"""The estimator against planted truth: recovery, coverage, invariance, outliers, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.estimate import estimate
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.calibration.settings import free_groups
from robotrue.calibration.terms.error_vector import StiffnessPrior
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import (
    ConfigurationError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)
from robotrue.robot.forward import forward
from robotrue.robot.statics import Load, deflect_arm

SETTINGS = FitSettings(payload=PAYLOAD, repeatability=0.0)
STIFFNESS = 1e6 * np.array([2.5, 2.2, 1.8, 0.4, 0.35, 0.25])
STATION = pose(matrix_from_rotation_vector(np.array([0.1, -0.2, 2.5])), np.array([4.0, -3.0, 1.0]))


def truth_error(actual, joints, wrench=None):
    load = Load(
        mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=np.zeros((1, 6)) if wrench is None else wrench
    )
    return (
        deflect_arm(actual, joints, load)[0].position - forward(actual.nominal(), joints)[:, :3, 3]
    )


def case(seed, n=60, **options):
    rng = np.random.default_rng(seed)
    robot = arm()
    actual = planted(robot, rng, base=0.0 if "T_tracker_base" in options else 1e-3)
    joints = postures(robot, n, rng)
    return robot, actual, measure(actual, joints, rng, **options), postures(robot, 100, rng)


def test_a_planted_arm_is_recovered():
    robot, actual, data, test = case(1, sd=1e-6)
    model = fit(robot, data, method="elastic", settings=SETTINGS)
    error = model.predict(Query(joints=test, load=PAYLOAD)).error
    assert np.linalg.norm(error - truth_error(actual, test), axis=1).max() < 5e-6
    np.testing.assert_allclose(
        model.actual.error("compliance")[1:5], 1.0 / STIFFNESS[1:5], rtol=0.01
    )


def test_methods_are_nested():
    robot, actual, data, test = case(2)
    truth = truth_error(actual, test)
    left = [
        np.linalg.norm(
            fit(robot, data, method=m, settings=SETTINGS)
            .predict(Query(joints=test, load=PAYLOAD))
            .error
            - truth,
            axis=1,
        ).mean()
        for m in ("nominal", "geometric", "elastic")
    ]
    assert left[0] > 2 * left[1] > 8 * left[2]


def test_stated_covariance_covers():
    inside, squares = 0, []
    for seed in range(12):
        robot, actual, data, test = case(100 + seed, n=40)
        model = fit(robot, data, method="elastic", settings=SETTINGS)
        out = model.predict(Query(joints=test, load=PAYLOAD))
        rng = np.random.default_rng(seed)
        # The stated covariance is of one visit: a visit scatters by the repeatability and noise.
        visit = np.sqrt(max(model.inflation, 1.0)) * model.white * rng.standard_normal((100, 3))
        rest = truth_error(actual, test) + visit - out.error
        square = np.einsum("ni,nij,nj->n", rest, np.linalg.inv(out.covariance), rest)
        squares.append(square)
        inside += int((square < 7.815).sum())
    assert 0.90 < inside / 1200 < 0.99
    assert 2.2 < np.mean(squares) < 3.8


def test_parameter_covariance_matches_scatter():
    robot = arm()
    actual = planted(robot, np.random.default_rng(5))
    joints = postures(robot, 50, np.random.default_rng(6))
    solver = replace(SETTINGS.solver, learn_noise=False, learn_scales=False, loss="gaussian")
    settings = replace(SETTINGS, solver=solver)
    results = [
        estimate(
            robot,
            measure(actual, joints, np.random.default_rng(s)),
            settings,
            free_groups("elastic"),
        )
        for s in range(40)
    ]
    layout = results[0].posterior.layout
    for name in ("compliance2", "compliance3", "d4", "a3", "tool_x"):
        i = layout.names.index(name)
        scatter = np.std([r.posterior.state.robot.errors[i] for r in results], ddof=1)
        stated = np.sqrt(results[0].posterior.covariance[i, i])
        assert scatter < 1.4 * stated, name
        if name == "compliance2":
            assert scatter > 0.6 * stated


def test_moving_the_tracker_changes_no_prediction():
    robot, _, data, test = case(3, T_tracker_base=STATION)
    other = pose(
        matrix_from_rotation_vector(np.array([-1.0, 0.4, 0.3])), np.array([-5.0, 2.0, 7.0])
    )
    turn = other[:3, :3]
    moved = replace(
        data,
        position=data.position @ turn.T + other[:3, 3],
        covariance=turn @ data.covariance @ turn.T,
    )
    first, second = (fit(robot, m, method="elastic", settings=SETTINGS) for m in (data, moved))
    a, b = (m.predict(Query(joints=test, load=PAYLOAD)) for m in (first, second))
    np.testing.assert_allclose(a.error, b.error, atol=1e-8)
    np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-14)
    np.testing.assert_allclose(other @ first.T_tracker_base[0], second.T_tracker_base[0], atol=1e-6)
    np.testing.assert_allclose(first.T_tracker_base[0], STATION, atol=2e-3)
    np.testing.assert_allclose(
        first.in_base(data).position, second.in_base(moved).position, atol=1e-8
    )


def test_a_station_never_seen_is_refused():
    robot, _, data, _ = case(3, T_tracker_base=STATION)
    model = fit(robot, data, method="geometric", settings=SETTINGS)
    with pytest.raises(ModelMismatchError, match="station 4"):
        model.in_base(replace(data, station=np.full(len(data), 4)))


def test_gross_outliers_carry_no_weight_and_are_named():
    robot, _, data, test = case(4)
    position = data.position.copy()
    position[[7, 31]] += 2e-3
    dirty = replace(data, position=position)
    result = estimate(robot, dirty, SETTINGS, free_groups("elastic"))
    assert result.screened.tolist() == [7, 31]
    assert any("2 of 60 rows carry no weight (row 8 first)" in d for d in result.verdict.doubts)
    clean, robust = (
        fit(robot, m, method="elastic", settings=SETTINGS).predict(Query(joints=test, load=PAYLOAD))
        for m in (data, dirty)
    )
    assert np.linalg.norm(clean.error - robust.error, axis=1).max() < 2e-5


def test_full_poses_with_turned_target_axes():
    robot, actual, data, test = case(5, n=40, pose_sd=1e-4)
    turned = data.rotation @ matrix_from_rotation_vector(np.array([0.0, 0.0, 1.2]))
    model = fit(robot, replace(data, rotation=turned), method="elastic", settings=SETTINGS)
    out = model.predict(Query(joints=test, load=PAYLOAD))
    rest = out.error - truth_error(actual, test)
    assert np.linalg.norm(rest, axis=1).mean() < 3e-5
    assert np.abs(out.rotation_error).max() < 5e-3


def test_side_load_or_stiffness_makes_the_loaded_case():
    robot, actual, data, test = case(6)
    push = np.array([[0.0, 300.0, -150.0, 0.0, 0.0, 0.0]])
    truth = truth_error(actual, test, push)
    query = Query(joints=test, load=Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=push))
    known = StiffnessPrior(stiffness=STIFFNESS, relative_sd=np.array(0.1))
    side = np.zeros((60, 6))
    side[:6, 1] = 800.0
    loaded = measure(actual, data.joints, np.random.default_rng(6), wrench=side)

    def mean(measurements, settings):
        error = fit(robot, measurements, method="elastic", settings=settings).predict(query).error
        return np.linalg.norm(error - truth, axis=1).mean()

    blind = mean(data, SETTINGS)
    assert blind > 1e-4
    assert mean(data, replace(SETTINGS, stiffness=known)) < 3.5e-5
    assert mean(loaded, SETTINGS) < 3.5e-5


def test_blind_joint_one_is_in_the_covariance_under_a_side_load():
    robot, _, data, test = case(6)
    model = fit(robot, data, method="elastic", settings=SETTINGS)
    push = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=np.array([[0, 300.0, 0, 0, 0, 0]]))
    quiet = np.trace(model.predict(Query(joints=test, load=PAYLOAD)).covariance, axis1=1, axis2=2)
    loaded = np.trace(model.predict(Query(joints=test, load=push)).covariance, axis1=1, axis2=2)
    assert np.sqrt(loaded).mean() > 4 * np.sqrt(quiet).mean()


def test_too_few_poses_are_refused_unless_the_prior_is_asked_for():
    robot, _, data, _ = case(7, n=8)
    with pytest.raises(ObservabilityError, match=r"8 poses give 24 usable numbers; \d+ parameters"):
        fit(robot, data, method="elastic", settings=SETTINGS)
    model = fit(robot, data, method="elastic", settings=replace(SETTINGS, lean_on_prior=True))
    assert model.training_summary()["verdict"] == "conditional"


def test_data_that_cannot_be_this_robots_are_refused():
    robot, _, data, _ = case(8)
    for wrong in (
        replace(data, position=data.position * 1e-3),
        replace(data, position=data.position * [1.0, 1.0, -1.0]),
        replace(data, joints=-data.joints),
    ):
        with pytest.raises(ImplausibleDataError, match="mm is plausible"):
            fit(robot, wrong, settings=SETTINGS)
    cut = {"approach": np.zeros((60, 5)), "joint_temperature": data.joint_temperature[:, :5]}
    short = replace(data, joints=data.joints[:, :5], **cut)
    with pytest.raises(ModelMismatchError, match="5 joints"):
        fit(robot, short)
    with pytest.raises(ConfigurationError, match="no calibration method"):
        fit(robot, data, method="magic")


def test_several_reflectors_show_the_last_axis():
    rng = np.random.default_rng(9)
    robot = arm(tool=(0.0, 0.0, 0.3))
    actual = planted(robot, rng)
    joints = postures(robot, 40, rng)
    data = measure(actual, joints, rng)
    offset = np.array([0.2, 0.1, 0.1])
    load = Load(mass=PAYLOAD.mass, com=PAYLOAD.com)
    state, _ = deflect_arm(actual, joints, load)
    second = state.flange_position + state.flange_rotation @ offset
    both = replace(
        data.subset(np.tile(np.arange(40), 2)),
        position=np.concatenate([data.position, second]),
        target=np.repeat([0, 1], 40),
    )
    result = estimate(robot, both, SETTINGS, free_groups("elastic"))
    T = result.posterior.state.T_flange_target[1]
    np.testing.assert_allclose(T[:3, 3], offset, atol=2e-3)
    assert "target/1_x" in result.posterior.layout.names
    assert inverse(T).shape == (4, 4)


def test_an_unknown_tracker_frame_does_not_blur_the_measured_point():
    rng = np.random.default_rng(12)
    robot = arm()
    actual, joints = planted(robot, rng, base=0.0), postures(robot, 60, rng)
    spreads = []
    for station in (None, STATION):
        seen = measure(actual, joints, np.random.default_rng(5), T_tracker_base=station)
        model = fit(robot, seen, method="elastic", settings=SETTINGS)
        stated = model.predict(Query(joints=joints, load=PAYLOAD)).covariance
        spreads.append(np.sqrt(np.trace(stated, axis1=1, axis2=2)).mean())
    assert spreads[1] < 1.2 * spreads[0]
