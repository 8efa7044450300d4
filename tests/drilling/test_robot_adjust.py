"""Squaring the spindle of a robot whose tool is not where its controller believes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from known_arms import HOME, TURNED, known_arm

from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.drilling.head import Head, gcode, normal_from_tilt, squaring_move, tilt_between
from robotrue.drilling.robot_adjust import actual_pose, robot_fragment, squaring_joints
from robotrue.errors import ConfigurationError, ReachError, ShapeError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable
from robotrue.robot.forward import forward


@pytest.mark.parametrize("seat", [None, TURNED])
def test_the_actual_axis_lies_on_the_normal_and_the_actual_tip_stays(
    seat: np.ndarray | None,
) -> None:
    model = known_arm()
    foot = np.eye(3) if seat is None else seat
    normal = normal_from_tilt("AB", np.array([2.0, -1.5]) * DEG)
    before, _ = actual_pose(model, HOME)
    move = squaring_joints(model, HOME, normal, R_tool_foot=seat)
    after, _ = actual_pose(model, move.joints)
    np.testing.assert_allclose(after[:3, 3], before[:3, 3], rtol=0.0, atol=2e-10)
    wanted = before[:3, :3] @ foot @ normal
    assert tilt_between((after[:3, :3] @ foot)[:, 2], wanted) < 1e-9
    assert move.turn == pytest.approx(2.4998 * DEG, rel=1e-3)
    assert move.rotation_known
    told = forward(model.robot, move.joints[None])[0]
    np.testing.assert_allclose(move.T_base_tool, told, rtol=0.0, atol=1e-15)


def test_the_uncalibrated_move_is_off_by_what_the_model_knows() -> None:
    model = known_arm()
    normal = normal_from_tilt("AB", np.array([3.0, 3.0]) * DEG)
    ours = squaring_joints(model, HOME, normal).joints
    blind = squaring_joints(known_arm(turn_known=False), HOME, normal)
    assert not blind.rotation_known
    off = tilt_between(
        actual_pose(model, ours)[0][:3, 2], actual_pose(model, blind.joints)[0][:3, 2]
    )
    assert off > 1e-7


def test_the_spin_about_the_drill_stays() -> None:
    model = known_arm()
    before, _ = actual_pose(model, HOME)
    normal = normal_from_tilt("AB", np.array([2.0, 1.0]) * DEG)
    after, _ = actual_pose(model, squaring_joints(model, HOME, normal).joints)
    turn = rotation_vector_from_matrix(before[:3, :3].T @ after[:3, :3])
    assert abs(turn[2]) < 1e-9


def test_limits_singularities_and_normals_behind_are_refused() -> None:
    model = known_arm()
    arm = model.arm  # type: ignore[attr-defined]
    limits = np.array(arm.limits)
    limits[4] = HOME[4] + np.array([-0.1, 0.1]) * DEG
    tight = replace(model, arm=replace(arm, limits=limits))  # type: ignore[type-var]
    normal = normal_from_tilt("AB", np.array([4.0, 4.0]) * DEG)
    with pytest.raises(ReachError, match=r"joint 5 would be at"):
        squaring_joints(tight, HOME, normal)
    straight = np.array(HOME)
    straight[4] = 0.0
    with pytest.raises(ReachError, match="singular"):
        squaring_joints(model, straight, normal)
    with pytest.raises(ShapeError, match="behind the foot"):
        squaring_joints(model, HOME, -normal)


@pytest.mark.parametrize("language", ["krl", "rapid", "urscript"])
def test_fragments_say_the_pose(language: str) -> None:
    move = squaring_joints(known_arm(), HOME, normal_from_tilt("AB", np.array([1.0, 2.0]) * DEG))
    text = robot_fragment(language, move.T_base_tool)
    whole = {
        "krl": "DEF x()\n" + text + "END\n",
        "rapid": "MODULE m\nPERS tooldata drill:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],"
        '[1,0,0,0],0,0,0]];\nPERS wobjdata base:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],'
        "[[0,0,0],[1,0,0,0]]];\nPROC main()\n" + text + "ENDPROC\nENDMODULE\n",
        "urscript": "def x():\n" + text + "end\n",
    }[language]
    program = find_language(language).read(whole.encode(), name="x", frames=FrameTable())
    np.testing.assert_allclose(program.position[0], move.T_base_tool[:3, 3], atol=1e-7)
    off = program.rotation[0] @ move.T_base_tool[:3, :3].T
    assert np.linalg.norm(rotation_vector_from_matrix(off)) < 1e-6


def test_gcode_moves_the_tip_by_nothing() -> None:
    head = Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
    normal = normal_from_tilt("AB", np.array([2.0, -1.5]) * DEG)
    text = gcode(squaring_move(head, np.zeros(2), normal), feed_mm_per_min=500.0)
    assert text == ("G91\nG1 X-9.1619 Y-12.2106 Z-0.3331 A+2.00000 B-1.50000 F500\nG90\n")
    unknown = squaring_move(Head(p_pivot_tip=np.full(3, np.nan)), np.zeros(2), normal)
    with pytest.raises(ConfigurationError, match="the tip would leave the hole"):
        gcode(unknown, feed_mm_per_min=500.0)


def test_no_fragment_in_an_unknown_language() -> None:
    with pytest.raises(ConfigurationError, match="no fragments in 'basic'"):
        robot_fragment("basic", np.eye(4))


def test_the_shortest_turn_is_a_rotation_vector_across_the_axis() -> None:
    model = known_arm()
    normal = matrix_from_rotation_vector(np.array([0.02, 0.03, 0.0])) @ [0.0, 0.0, 1.0]
    move = squaring_joints(model, HOME, normal)
    assert move.turn == pytest.approx(np.hypot(0.02, 0.03), rel=1e-9)
