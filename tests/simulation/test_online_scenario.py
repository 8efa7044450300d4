"""The cycle of the online simulators: motion and force that belong together."""

import numpy as np
import pytest

from robotrue.core.units import STANDARD_GRAVITY, UM
from robotrue.robot.forward import forward
from robotrue.simulation.online_scenario import (
    CENTRE,
    CYCLE,
    KNOCKS,
    MASS,
    PASS,
    ScenarioMotion,
    online_scenario,
)

TIMES = np.arange(0.0, CYCLE, 0.0123)


@pytest.fixture(scope="module", params=[None, "KR160", "UR10"])
def scenario(request):
    return online_scenario(3, request.param)


def test_joints_take_the_tool_where_it_is_said_to_be(scenario):
    T = forward(scenario.robot, scenario.joints(TIMES))
    np.testing.assert_allclose(T, scenario.poses(TIMES), atol=0.5 * UM)
    shown = scenario.displayed_joints(TIMES)
    model = scenario.robot.controller.to_model(shown)
    np.testing.assert_allclose(model, scenario.joints(TIMES), atol=1e-12)


def test_it_repeats_without_a_seam(scenario):
    later = 1000 * CYCLE
    np.testing.assert_allclose(scenario.joints(TIMES + later), scenario.joints(TIMES), atol=1e-9)
    np.testing.assert_allclose(
        scenario.sensor_wrench(TIMES + later), scenario.sensor_wrench(TIMES), atol=1e-3
    )
    ends = scenario.joints(np.array([0.0, CYCLE - 1e-9]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_the_sensor_feels_the_second_difference_of_the_way(scenario):
    """In the knocks nothing is cut: force is mass times what the poses say, and the weight."""
    step = 1e-4
    times = np.arange(KNOCKS[0] - 0.1, KNOCKS[-1] + 0.3, 7e-3)
    place = [scenario.poses(times + k * step)[:, :3, 3] for k in (-1, 0, 1)]
    acceleration = (place[0] - 2.0 * place[1] + place[2]) / step**2
    R_base_sensor = scenario.T_base_start[:3, :3]
    held = MASS * (np.array([0.0, 0.0, -STANDARD_GRAVITY]) - acceleration) @ R_base_sensor
    felt = scenario.sensor_wrench(times)
    np.testing.assert_allclose(felt[:, :3], held, atol=0.1)
    np.testing.assert_allclose(felt[:, 3:], np.cross(CENTRE, held), atol=0.02)
    assert np.abs(acceleration).max() > 2.0


def test_it_cuts_in_the_pass_and_nowhere_else(scenario):
    cut = np.abs(scenario.cut(TIMES)).max(axis=1)
    inside = (TIMES > PASS[0] + 0.3) & (TIMES < PASS[1])
    assert not cut[(TIMES < PASS[0]) | (TIMES > PASS[1] + 0.3)].any()
    assert cut[inside].mean() > 10.0
    # 60 turns a second: after three of them the samples of the table meet again
    fine = np.arange(10.0, 10.05, 1e-5)
    np.testing.assert_allclose(scenario.cut(fine), scenario.cut(fine + 0.05), atol=1e-6)


def test_as_the_motion_of_a_controller(scenario):
    motion = ScenarioMotion(scenario=scenario, begun=100.0)
    (joints,), (T,) = motion.along(np.array([5.0]))
    np.testing.assert_array_equal(joints, scenario.displayed_joints(np.array([105.0]))[0])
    np.testing.assert_array_equal(T, scenario.poses(np.array([105.0]))[0])
    assert motion.duration == np.inf


def test_the_same_for_a_seed():
    one, same, other = (online_scenario(seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.table, same.table)
    assert np.abs(one.table - other.table).max() > 0.1
