from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.robot.forward import forward
from robotrue_reproductions.deng2022 import scenarios


@pytest.fixture(scope="module")
def cases():
    return {name: scenarios.scenario(name, 3) for name in ("S1A", "S1B", "S2A", "S0A")}


def angle_and_height(case, rows):
    x, y, z = forward(case.cell.known.measured_robot, rows.joints)[:, :3, 3].T
    return np.arctan2(y, x) / DEG, z / MM


def test_raw_errors_are_those_of_the_paper(cases):
    for name, case in cases.items():
        size = np.linalg.norm(scenarios.raw_errors(case, scenarios.check(case)), axis=1) / MM
        assert 1.3 < size.mean() < 1.7, name
        assert 1.8 < size.max() < 3.3, name


def test_floors_are_ordered_and_near_those_of_the_scatter(cases):
    floor = {name: scenarios.floor(case) / MM for name, case in cases.items()}
    # mean length of an isotropic Gaussian is 1.596 sd; drift comes on top, f = 2 and 3
    assert 0.033 * 0.85 < floor["S0A"] < 0.033 * 1.15
    assert floor["S0A"] < floor["S1A"] < 0.055
    assert 0.095 < floor["S2A"] < 0.130


def test_plans_have_their_counts_and_regions(cases):
    for name, case in cases.items():
        low, high = (600.0, 1100.0) if name[2] == "B" else (700.0, 1200.0)
        for rows, first, last in (
            (scenarios.whole(case, 30), -40, 40),
            (scenarios.transfer(case, 5), -40, 40),
            (scenarios.target(case, 5), -30, 40),
            (scenarios.check(case), -20, 20),
        ):
            angle, height = angle_and_height(case, rows)
            assert angle.min() > first - 1e-6, name
            assert angle.max() < last + 1e-6, name
            assert height.min() > low - 1e-6, name
            assert height.max() < high + 1e-6, name
        assert len(scenarios.paper(case)) == 206
        assert len(scenarios.validation(case)) == 378
        assert np.bincount(scenarios.transfer(case, 5).group).tolist() == [126, 5]
        assert len(scenarios.transfer(case, 0)) == 126


def test_attitude_turns_with_the_angle_or_stays(cases):
    for name, expected in (("S1A", 1.0), ("S1B", 0.0)):
        rows = scenarios.whole(cases[name], 200)
        pose = forward(cases[name].cell.known.measured_robot, rows.joints)
        heading = np.arctan2(pose[:, 1, 2], pose[:, 0, 2])  # of the flange axis
        angle = np.arctan2(pose[:, 1, 3], pose[:, 0, 3])
        slope = np.polyfit(angle, heading, 1)[0]
        assert abs(slope - expected) < 0.25, name


def test_equal_seeds_repeat_and_campaigns_differ_in_noise_alone(cases):
    case = cases["S1A"]
    again = scenarios.scenario("S1A", 3)
    first, second = scenarios.whole(case, 20), scenarios.whole(again, 20)
    np.testing.assert_array_equal(first.position, second.position)
    np.testing.assert_array_equal(scenarios.whole(case, 10).joints, first.joints[:10])
    other = scenarios.measure_joints(case, first.joints, campaign=5)
    gap = np.linalg.norm(other.position - first.position, axis=1)
    assert 1e-6 < gap.mean() < 0.2 * MM


def test_drift_is_continuous_within_a_campaign():
    case = scenarios.scenario("S4A", 1)
    rows = scenarios.measure_joints(case, np.repeat(case.plan.check[:1], 200, axis=0))
    step = np.diff(rows.position, axis=0)
    travel = rows.position - rows.position[0]
    # neighbours differ by noise alone (sd about 22 um per axis and visit), the ends by drift too
    assert np.abs(step[1:]).mean() < 30e-6
    assert np.linalg.norm(travel, axis=1).max() < 0.3 * MM


def test_the_user_knows_the_printed_stiffness_and_not_the_true_one(cases):
    case = cases["S1A"]
    settings = case.settings
    assert settings.stiffness is not None
    np.testing.assert_allclose(settings.stiffness.stiffness[:2], [1.75e6, 1.72e6])
    true = 1.0 / case.cell.robot.actual.error("compliance")
    assert np.abs(true / settings.stiffness.stiffness - 1.0).max() > 0.05
    assert settings.repeatability_sd == pytest.approx(0.014 * MM, rel=1e-9)


def test_unknown_scenario_is_refused():
    with pytest.raises(ConfigurationError, match="no scenario 'S3A'; scenarios are"):
        scenarios.scenario("S3A", 1)
