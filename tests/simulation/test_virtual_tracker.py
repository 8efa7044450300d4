from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.poses import apply, pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.errors import ConfigurationError
from robotrue.measurement.tracker import TrackerSpecification, point_covariance
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import T_FLANGE_TARGET, deng2022
from robotrue.simulation.virtual_robot import actual_pose
from robotrue.simulation.virtual_tracker import VirtualTracker, measure, observe

PLACE = pose(matrix_from_abc(np.array([0.7, 0.1, -0.2])), np.array([3.0, -2.0, 1.0]))
UNEVEN = TrackerSpecification(
    name="range and angle apart",
    range_bound=10e-6,
    range_bound_per_m=1e-6,
    angle_bound=20e-6,
    angle_bound_per_m=10e-6,
)


@pytest.mark.parametrize("frame", ["base", "tracker"])
def test_the_stated_covariance_is_that_of_the_samples(frame):
    tracker = VirtualTracker(T_base_tracker=PLACE, specification=UNEVEN, frame=frame)
    point = np.array([1.0, 0.3, 0.9])
    read = observe(tracker, np.tile(point, (40000, 1)), np.random.default_rng(3))
    stated = point_covariance(UNEVEN, read.mean(axis=0)[None], tracker.position)[0]
    found = np.cov(read.T)
    root = np.linalg.inv(np.linalg.cholesky(stated))
    np.testing.assert_allclose(root @ found @ root.T, np.eye(3), atol=0.03)


def test_points_come_out_in_the_frame_asked_for():
    registered = VirtualTracker(T_base_tracker=PLACE)
    own = replace(registered, frame="tracker")
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (30, 3))
    in_base = observe(registered, points, np.random.default_rng(5))
    in_own = observe(own, points, np.random.default_rng(5))
    np.testing.assert_allclose(apply(PLACE, in_own), in_base, atol=1e-12)


def test_a_point_inside_the_tracker_is_refused():
    with pytest.raises(ConfigurationError, match="inside the tracker"):
        observe(VirtualTracker(T_base_tracker=PLACE), PLACE[None, :3, 3], np.random.default_rng(0))


@pytest.fixture(scope="module")
def cell():
    return deng2022(1)


def test_campaigns_repeat_by_seed_and_differ_by_campaign(cell):
    q = random_joints(cell.known.measured_robot, 15, seed=4)
    first, again = (
        measure(cell.robot, cell.tracker, q, seed=9, T_flange_tool=T_FLANGE_TARGET)
        for _ in range(2)
    )
    other = measure(cell.robot, cell.tracker, q, seed=9, campaign=1, T_flange_tool=T_FLANGE_TARGET)
    np.testing.assert_array_equal(first.position, again.position)
    assert np.abs(first.position - other.position).max() > 1e-6


def test_scatter_is_repeatability_and_instrument(cell):
    q = np.tile(random_joints(cell.known.measured_robot, 1, seed=4), (3000, 1))
    still = replace(cell.robot, effects=deng2022(1, exact=True, level=0.0).robot.effects)
    m = measure(still, cell.tracker, q, seed=2, T_flange_tool=T_FLANGE_TARGET)
    true = actual_pose(still, q[:1], T_flange_tool=T_FLANGE_TARGET)[0, :3, 3]
    expected = m.covariance[0] + cell.robot.repeatability**2 * np.eye(3)
    root = np.linalg.inv(np.linalg.cholesky(expected))
    scatter = np.cov((m.position - true).T)
    np.testing.assert_allclose(root @ scatter @ root.T, np.eye(3), atol=0.1)


def test_the_set_says_that_it_is_simulated_and_how_each_joint_arrived(cell):
    q = random_joints(cell.known.measured_robot, 5, seed=4)
    m = measure(cell.robot, cell.tracker, q, seed=12, name="campaign 0")
    assert "simulated seed=12" in m.sources[0]
    assert not m.approach[0].any()
    np.testing.assert_array_equal(m.approach[1:], np.sign(np.diff(q, axis=0)))
