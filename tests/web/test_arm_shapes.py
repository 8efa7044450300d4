"""Bodies that are drawn of an arm: fixed to its links, joined at its joints, in every posture."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from robotrue.app.workbench.arm_shapes import ArmShape, arm_shapes, link_poses
from robotrue.core.arrays import Array
from robotrue.core.poses import apply
from robotrue.robot.forward import walk
from robotrue.robot.presets import preset, preset_names

RADIUS = 0.06


def middle_lines(shapes: list[ArmShape], link: int, T_base_link: Array) -> Array:
    """Points (n, 3) m along the middle of each body of a link."""
    ends = [np.linspace(each.start, each.end, 21) for each in shapes if each.link == link]
    return apply(T_base_link, np.concatenate(ends))


@pytest.mark.parametrize("name", preset_names())
def test_bodies_meet_at_the_joints_and_end_at_the_tool(name: str) -> None:
    tool = np.eye(4)
    tool[:3, 3] = (0.02, -0.03, 0.25)
    robot = preset(name).with_tool(tool)
    shapes = arm_shapes(robot, np.full(robot.dof, RADIUS))
    assert {shape.link for shape in shapes} == set(range(robot.dof + 1))
    joints = np.random.default_rng(4).uniform(*robot.limits.T, (1, robot.dof))
    state = walk(robot, joints)
    frames = link_poses(state)[0]
    lines = [middle_lines(shapes, k, frame) for k, frame in enumerate(frames)]
    for before, after in pairwise(lines):
        gaps = np.linalg.norm(before[:, None] - after[None], axis=2)
        assert gaps.min() < 0.5 * RADIUS
    ends = [apply(frames[-1], np.array([each.end]))[0] for each in shapes if each.paint == "tool"]
    np.testing.assert_allclose(ends[-1], state.position[0], atol=1e-12)
    # Seen from the base, nothing of the base plate is under the mounting plane.
    assert all(min(each.start[2], each.end[2]) > -1e-9 for each in shapes if each.link == 0)
