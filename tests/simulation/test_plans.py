from __future__ import annotations

import numpy as np
import pytest

from robotrue.errors import ReachError
from robotrue.simulation.plans import Region, random_joints
from robotrue.simulation.presets import deng2022


@pytest.fixture(scope="module")
def robot():
    return deng2022(1, exact=True).known.measured_robot


def test_random_postures_repeat_by_seed_and_keep_the_limits(robot):
    q = random_joints(robot, 200, seed=5)
    np.testing.assert_array_equal(q, random_joints(robot, 200, seed=5))
    assert np.abs(q - random_joints(robot, 200, seed=6)).max() > 0.1
    assert ((q >= robot.limits[:, 0]) & (q <= robot.limits[:, 1])).all()


def test_a_region_out_of_reach_is_refused(robot):
    far = Region(radius=(3.0, 4.0))
    with pytest.raises(ReachError, match="only 0 of"):
        random_joints(robot, 10, seed=1, region=far)
