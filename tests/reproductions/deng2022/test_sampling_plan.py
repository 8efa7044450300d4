from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.errors import ReachError
from robotrue.robot.forward import forward
from robotrue.simulation.presets import deng2022
from robotrue_reproductions.deng2022.sampling_plan import paper_domains, paper_plan


@pytest.fixture(scope="module")
def robot():
    return deng2022(1, exact=True).known.measured_robot


def test_the_papers_plan_has_its_counts_and_ranges(robot):
    plan = paper_plan(robot, 1)
    counts = [len(plan.source), len(plan.target), len(plan.validation), len(plan.check)]
    assert counts == [126, 80, 378, 50]  # Table 7
    assert np.bincount(plan.sub_space).tolist() == [16] * 5
    for joints, low, high in ((plan.source, -40, -30), (plan.validation, -20, 20)):
        x, y, z = forward(robot, joints)[:, :3, 3].T
        angle = np.arctan2(y, x) / DEG
        assert angle.min() == pytest.approx(low)
        assert angle.max() == pytest.approx(high)
        assert np.hypot(x, y).max() == pytest.approx(1400 * MM)
        assert (z.min(), z.max()) == pytest.approx((700 * MM, 1200 * MM))


def test_target_poses_lie_in_their_sub_space(robot):
    plan = paper_plan(robot, 2)
    x, y, _ = forward(robot, plan.target)[:, :3, 3].T
    low, high = np.array([(-30, -20), (-15, -5), (0, 10), (15, 25), (30, 40)])[plan.sub_space].T
    angle = np.arctan2(y, x) / DEG
    assert ((angle > low - 1e-9) & (angle < high + 1e-9)).all()


def test_target_poses_are_source_poses_turned_about_joint_1(robot):
    plan, domains = paper_plan(robot, 3), paper_domains()
    turned = plan.source[plan.image]
    turned[:, 0] += domains.angles[plan.sub_space]
    np.testing.assert_allclose(forward(robot, plan.target), forward(robot, turned), atol=1e-12)


def test_a_fixed_attitude_stays_and_the_workspace_is_lower(robot):
    plan = paper_plan(robot, 3, "fixed")
    there, source = forward(robot, plan.target), forward(robot, plan.source)[plan.image]
    np.testing.assert_allclose(there[:, :3, :3], source[:, :3, :3], atol=1e-12)
    assert source[:, 2, 3].min() >= 600 * MM - 1e-12


def test_a_plan_out_of_reach_is_refused(robot):
    with pytest.raises(ReachError, match="out of reach"):
        paper_plan(replace(robot, a=0.5 * robot.a), 1)


def test_attitudes_that_cannot_be_taken_are_drawn_anew(robot):
    for seed in range(1, 9):  # without it a corner of one of these is out of reach
        plan = paper_plan(robot, seed, "fixed")
        assert np.isfinite(plan.source).all()
        x, y, z = forward(robot, plan.source)[:, :3, 3].T
        places = np.column_stack([np.arctan2(y, x), np.hypot(x, y), z]).round(6)
        assert len(np.unique(places, axis=0)) == 126
