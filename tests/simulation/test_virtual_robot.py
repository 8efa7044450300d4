from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.robot.statics import Load, deflect_arm
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import T_FLANGE_TARGET, deng2022, raw_error
from robotrue.simulation.virtual_robot import (
    actual_pose,
    draw_unmodelled,
    nominal_pose,
    thermal_drift,
)
from robotrue_reproductions.deng2022.sampling_plan import paper_plan


@pytest.fixture(scope="module")
def printed():
    """The arm of Tables 1 to 3 exactly, nothing un-modelled."""
    return deng2022(1, exact=True, level=0.0)


@pytest.fixture(scope="module")
def postures(printed):
    return random_joints(printed.known.measured_robot, 2000, seed=1)


def test_raw_error_of_the_printed_tables_is_that_of_the_reference_simulation(printed, postures):
    size = np.linalg.norm(raw_error(printed.robot, postures), axis=1) / MM
    # An independent simulation of Tables 1-3 with these masses: mean 1.40, max 2.46 mm.
    assert size.mean() == pytest.approx(1.40, rel=0.03)
    assert size.max() == pytest.approx(2.46, rel=0.05)


def test_gravity_sag_of_the_printed_stiffness(printed, postures):
    robot = printed.robot.nominal.with_tool(T_FLANGE_TARGET)
    errors = np.zeros_like(robot.errors)
    errors[36:42] = printed.robot.actual.error("compliance")
    bent, _ = deflect_arm(robot.with_errors(errors), postures, printed.robot.payload)
    flat = nominal_pose(printed.robot, postures, T_FLANGE_TARGET)[:, :3, 3]
    size = np.linalg.norm(bent.position - flat, axis=1) / MM
    assert size.mean() == pytest.approx(0.81, rel=0.03)
    assert size.max() == pytest.approx(1.76, rel=0.05)


def test_level_zero_is_exactly_the_rigid_flexible_model(printed, postures):
    virtual = printed.robot
    model, _ = deflect_arm(virtual.actual.with_tool(T_FLANGE_TARGET), postures, virtual.payload)
    true = actual_pose(virtual, postures, T_flange_tool=T_FLANGE_TARGET)
    np.testing.assert_allclose(true, model.transforms, atol=1e-13)


def test_no_model_contains_level_two_exactly(postures):
    virtual = deng2022(1, exact=True, level=2.0).robot
    model, _ = deflect_arm(virtual.actual.with_tool(T_FLANGE_TARGET), postures, virtual.payload)
    rest = actual_pose(virtual, postures, T_flange_tool=T_FLANGE_TARGET)[:, :3, 3] - model.position
    centred = np.linalg.norm(rest - rest.mean(axis=0), axis=1).mean() / MM
    assert 0.06 < centred < 0.20  # reference simulation: 0.122 in the median arm


def test_equal_seeds_give_equal_arms_and_others_do_not():
    first, again, other = deng2022(3), deng2022(3), deng2022(4)
    q = random_joints(first.known.measured_robot, 20, seed=3)
    np.testing.assert_array_equal(raw_error(first.robot, q), raw_error(again.robot, q))
    assert np.abs(raw_error(first.robot, q) - raw_error(other.robot, q)).max() > 0.05 * MM


@pytest.mark.parametrize("seed", range(4))
def test_drawn_arms_have_the_papers_raw_error(seed):
    cell = deng2022(seed)
    q = paper_plan(cell.known.measured_robot, seed).validation
    size = np.linalg.norm(raw_error(cell.robot, q), axis=1) / MM
    assert size.mean() == pytest.approx(1.5, abs=0.12)  # Table 8: 1.499
    assert 2.1 < size.max() < 3.4  # 2.626


def test_the_user_does_not_know_the_truth():
    cell = deng2022(2)
    assert not cell.known.robot.errors.any()
    assert np.abs(cell.robot.actual.link_mass / cell.known.robot.link_mass - 1.0).max() > 0.01


def test_backlash_follows_the_last_motion_of_joint_1(printed):
    virtual = deng2022(5, exact=True, level=1.0).robot
    q = random_joints(printed.known.measured_robot, 5, seed=2)
    sign = np.zeros((5, 6))
    sign[:, 0] = 1.0
    forth, back = (actual_pose(virtual, q, approach=s * sign)[:, :3, 3] for s in (1.0, -1.0))
    moved = np.linalg.norm(forth - back, axis=1)
    radius = np.linalg.norm(nominal_pose(virtual, q)[:, :2, 3], axis=1)
    np.testing.assert_allclose(moved / radius, 2.0 * virtual.effects.approach[0], rtol=0.01)


def test_a_pull_bends_the_arm_along_the_pull(printed):
    virtual = printed.robot
    q = random_joints(printed.known.measured_robot, 10, seed=2)
    rest = actual_pose(virtual, q)[:, :3, 3]
    for axis in range(3):
        force = np.zeros(6)
        force[axis] = 300.0
        pulled = actual_pose(virtual, q, virtual.payload_with(force))[:, :3, 3]
        assert (pulled[:, axis] > rest[:, axis]).all()


def test_drift_is_continuous_within_a_campaign_and_has_the_stated_correlation():
    effects = draw_unmodelled(7, level=1.0)
    shift, _ = thermal_drift(effects, np.array([0.0, 1.0]), 0)
    assert np.abs(np.diff(shift, axis=0)).max() < 1e-6
    times = np.array([0.0, 3600.0])
    draws = np.array([thermal_drift(effects, times, k)[0] for k in range(1500)])
    sigma = draws[:, 0].std(axis=0)
    np.testing.assert_allclose(sigma, 5e-6, rtol=0.08)
    together = (draws[:, 0] * draws[:, 1]).mean(axis=0) / sigma**2
    np.testing.assert_allclose(together, np.exp(-1.0), atol=0.1)


def test_refusals(printed):
    with pytest.raises(ConfigurationError, match="level -1"):
        draw_unmodelled(1, level=-1.0)
    with pytest.raises(ShapeError, match=r"joints has shape \(3, 5\)"):
        actual_pose(printed.robot, np.zeros((3, 5)))
    with pytest.raises(ShapeError, match="approach"):
        actual_pose(printed.robot, np.zeros((3, 6)), approach=np.zeros((2, 6)))


def test_a_heavier_payload_sags_more(printed):
    q = random_joints(printed.known.measured_robot, 10, seed=2)
    heavy = Load(mass=2.0 * printed.robot.payload.mass, com=printed.robot.payload.com)
    rest, low = (actual_pose(printed.robot, q, load)[:, 2, 3] for load in (None, heavy))
    assert (low < rest).all()
