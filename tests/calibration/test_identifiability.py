"""The traps are named, with what would show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.estimate import estimate
from robotrue.calibration.methods import FitSettings
from robotrue.calibration.settings import free_groups
from robotrue.calibration.terms.error_vector import StiffnessPrior
from robotrue.errors import ObservabilityError

SETTINGS = FitSettings(payload=PAYLOAD, repeatability=0.0)


def run(
    tool=(0.08, 0.05, 0.30),
    wrench=False,
    joints=None,
    tracker=None,
    pose_sd=None,
    settings=SETTINGS,
    rows=60,
):
    rng = np.random.default_rng(11)
    robot = arm(tool)
    actual = planted(robot, rng, base=1e-3 if tracker is None else 0.0)
    q = postures(robot, 60, rng) if joints is None else joints(rng)
    push = np.zeros((rows, 6))
    push[:8, 1] = 800.0 if wrench else 0.0
    data = measure(actual, q, rng, wrench=push, T_tracker_base=tracker, pose_sd=pose_sd)
    return estimate(robot, data, settings, free_groups("elastic"))


def names(result, reveal=None):
    return [d.name for d in result.identifiability.unseen if reveal in (None, d.reveal)]


def test_joint_one_compliance_under_gravity():
    blind = run()
    assert names(blind, "side load") == ["compliance1"]
    (direction,) = blind.identifiability.harmful
    assert "gravity does not load a vertical axis" in direction.cure
    assert direction.cure.endswith("known horizontal force, or state the stiffness")
    assert blind.verdict.status == "conditional"
    assert blind.identifiability.classes["compliance1"] == "prior only"
    assert blind.identifiability.classes["compliance2"] == "seen"
    pushed = run(wrench=True)
    assert "compliance1" not in names(pushed)
    assert pushed.verdict.status == "determined"


def test_a_stated_stiffness_is_not_asked_for_again():
    stated = StiffnessPrior(stiffness=np.full(6, 1e6), relative_sd=np.array(0.3))
    told = run(settings=replace(SETTINGS, stiffness=stated))
    (direction,) = [d for d in told.identifiability.harmful if d.name == "compliance1"]
    assert direction.cure.endswith("until then the stated stiffness is used")
    assert not any("or state the stiffness" in doubt for doubt in told.verdict.doubts)


def test_too_few_poses_are_answered_with_what_a_user_can_do():
    with pytest.raises(ObservabilityError) as refused:
        run(joints=lambda rng: postures(arm(), 5, rng), rows=5)
    assert "choose a smaller method, or transfer an earlier calibration" in str(refused.value)
    assert "lean_on_prior" not in str(refused.value)


def test_base_against_joint_one():
    found = names(run())
    assert "theta1 + base_rz" in found
    assert "d1 + base_z" in found


def test_tool_point_on_axis_six():
    on_axis = run(tool=(0.0, 0.0, 0.3), wrench=True)
    assert "d6 + tool_z" in names(on_axis)
    assert "theta6" in names(on_axis)
    cures = [d.cure for d in on_axis.identifiability.unseen if d.name == "theta6"]
    assert "several reflectors, or a 6-D probe" in cures[0]
    assert "theta6" not in names(run(tool=(0.0, 0.0, 0.3), wrench=True, pose_sd=1e-4))


def test_nearly_one_orientation_asks_for_poses():
    def narrow(rng):
        middle = np.deg2rad([0.0, -60.0, 60.0, 10.0, 30.0, 0.0])
        return middle + np.deg2rad(2.0) * rng.standard_normal((60, 6))

    result = run(joints=narrow, wrench=True)
    assert names(result, "poses")
    assert result.verdict.status == "conditional"
    assert any("add poses" in d for d in result.verdict.doubts)


def test_unknown_tracker_frame_takes_the_place_of_the_base():
    result = run(tracker=np.eye(4), wrench=True)
    free = result.identifiability.names
    assert "base_x" not in free
    assert any(name.startswith("theta1") for name in names(result, "root"))
    assert not result.posterior.state.robot.error("base").any()


def test_every_parameter_is_classed_and_none_is_dropped():
    result = run()
    assert set(result.identifiability.classes) == set(result.identifiability.names)
    assert len(result.identifiability.names) == 7 * 6 + 10 + 9  # moments behind a vertical axis
    gears = [v for k, v in result.identifiability.classes.items() if k.startswith("gear")]
    assert "prior only" not in gears
