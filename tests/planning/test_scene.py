"""Collisions and sight on cases whose answer is known by hand."""

from __future__ import annotations

import numpy as np
import pytest
from planning_cases import postures, shop

from robotrue.cell.obstacles import Box, HalfSpace, Sphere
from robotrue.errors import ConfigurationError, ReachError
from robotrue.planning import candidates
from robotrue.planning.arm_scene import (
    between_segments,
    collisions,
    hidden,
    scene_of,
    to_obstacle,
    to_point,
)
from robotrue.planning.candidates import draw_candidates, draw_postures, usable

UP = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
HOME = np.deg2rad([[0.0, 0.0, 0.0, 0.0, -60.0, 0.0]])


def test_distances_by_hand() -> None:
    across = np.array([[-1.0, 0.3, 0.5], [1.0, 0.3, 0.5]])
    assert between_segments(UP, across) == pytest.approx(0.3)
    beyond = np.array([[0.0, 0.0, 1.5], [0.0, 0.0, 3.0]])
    assert between_segments(UP, beyond) == pytest.approx(0.5)
    beside = np.array([[0.2, 0.0, -1.0], [0.2, 0.0, 2.0]])
    assert between_segments(UP, beside) == pytest.approx(0.2)
    corner = np.array([[0.3, 0.0, 1.4], [3.0, 0.0, 1.4]])
    assert between_segments(UP, corner) == pytest.approx(0.5)
    dot = np.array([[0.3, 0.4, 0.5], [0.3, 0.4, 0.5]])
    assert between_segments(UP, dot) == pytest.approx(0.5)
    assert to_point(UP, np.array([0.0, 0.6, 1.8])) == pytest.approx(1.0)


def test_distances_are_the_smallest_over_many_points() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, 200, 2, 3))
    t = np.linspace(0.0, 1.0, 401)[:, None]
    for k in range(0, 200, 10):
        p = a[k, 0] + t * (a[k, 1] - a[k, 0])
        q = b[k, 0] + t * (b[k, 1] - b[k, 0])
        coarse = np.linalg.norm(p[:, None] - q[None], axis=2).min()
        assert between_segments(a[k], b[k]) == pytest.approx(coarse, abs=0.012)
        assert between_segments(a[k], b[k]) <= coarse + 1e-12


def test_distance_to_bodies_by_hand() -> None:
    box = Box(name="box", low=np.array([0.5, -1.0, 0.2]), high=np.array([1.0, 1.0, 0.4]))
    assert to_obstacle(UP, box) == pytest.approx(0.5, abs=1e-9)
    through = np.array([[0.0, 0.0, 0.3], [2.0, 0.0, 0.3]])
    assert to_obstacle(through, box) == pytest.approx(0.0, abs=1e-9)
    ball = Sphere(name="ball", centre=np.array([0.0, 0.7, 0.5]), radius=0.2)
    assert to_obstacle(UP, ball) == pytest.approx(0.5)
    floor = HalfSpace(name="floor", point=np.zeros(3), normal=np.array([0.0, 0.0, 2.0]))
    assert to_obstacle(UP + 0.25, floor) == pytest.approx(0.25)
    assert to_obstacle(UP - [0.0, 0.0, 0.3], floor) == pytest.approx(-0.3)


def test_the_home_posture_is_free_and_a_folded_one_is_not() -> None:
    scene = scene_of(shop(), clearance=0.02)
    assert not any(bad.any() for bad in collisions(scene, HOME).values())
    turned = np.repeat(HOME, 181, axis=0)
    turned[:, 2] = np.deg2rad(np.linspace(-180.0, 180.0, 181))
    axes = scene.tubes(turned)[0]
    to_foot = to_point(axes[:, 0], axes[:, 3, 1])  # of the wrist
    folded = int(np.argmin(to_foot))
    assert to_foot[folded] < 0.18  # the radius of the foot
    assert collisions(scene, turned[[folded]])["self collision"][0]


def test_an_obstacle_is_hit_where_the_arm_is_and_named() -> None:
    reflector = scene_of(shop(), clearance=0.02).tubes(HOME)[1][0]
    ball = Sphere(name="clamp", centre=reflector + np.array([0.0, 0.0, 0.05]), radius=0.03)
    far = Sphere(name="lamp", centre=np.array([-3.0, 0.0, 3.0]), radius=0.2)
    scene = scene_of(shop(obstacles=(ball, far)), clearance=0.02)
    found = collisions(scene, HOME)
    assert found["collision with clamp"][0]
    assert not found["collision with lamp"][0]


def test_a_ball_in_the_line_of_sight_hides_the_reflector() -> None:
    cell = shop()
    scene = scene_of(cell, clearance=0.02)
    assert not any(bad.any() for bad in hidden(scene, HOME).values())
    assert cell.tracker_place is not None
    middle = 0.5 * (scene.tubes(HOME)[1][0] + cell.tracker_place)
    between = Sphere(name="post", centre=middle, radius=0.05)
    beside = Sphere(name="lamp", centre=middle + np.array([0.0, 0.0, 0.3]), radius=0.05)
    found = hidden(scene_of(shop(obstacles=(between, beside)), clearance=0.02), HOME)
    assert found["line of sight: post"][0]
    assert not found["line of sight: lamp"][0]


def test_the_arm_hides_a_reflector_behind_it() -> None:
    behind = shop(tracker_position=np.array([-4.0, 0.0, 1.6]))
    assert hidden(scene_of(behind, clearance=0.02), HOME)["line of sight: the arm"][0]


def test_the_reflector_is_seen_within_its_acceptance_angle() -> None:
    scene = scene_of(shop(), clearance=0.02)
    _, point, turn = scene.tubes(HOME)
    assert scene.cell.tracker_place is not None
    ray = scene.cell.tracker_place - point[0]
    at_tracker = turn[0].T @ ray / np.linalg.norm(ray)
    aside = np.cross(at_tracker, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    reason = "acceptance angle of the reflector"
    for degrees, lost in ((0.0, False), (29.0, False), (31.0, True), (180.0, True)):
        angle = np.deg2rad(degrees)
        axis = np.cos(angle) * at_tracker + np.sin(angle) * aside
        cell = shop(target_axis=axis, acceptance=np.deg2rad(30.0))
        assert hidden(scene_of(cell, clearance=0.02), HOME)[reason][0] == lost


def test_nothing_is_hidden_from_a_tracker_without_a_place() -> None:
    cell = shop(frame="tracker", tracker_position=None)
    assert hidden(scene_of(cell, clearance=0.02), HOME) == {}


def test_a_tracker_inside_the_robot_or_an_obstacle_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="is inside the robot's foot"):
        scene_of(shop(tracker_position=np.array([0.05, 0.0, 0.3])), clearance=0.02)
    around = Box(name="booth", low=np.array([3.0, -3.0, 0.0]), high=np.array([4.0, -1.0, 2.0]))
    with pytest.raises(ConfigurationError, match="is inside obstacle 'booth'"):
        scene_of(shop(obstacles=(around,)), clearance=0.02)


def test_candidates_respect_limits_and_what_they_were_asked() -> None:
    cell = shop()
    scene = scene_of(cell, clearance=0.02)
    back = np.deg2rad(-3.0) * np.ones(6)
    found = draw_candidates(scene, 300, seed=4, margin=np.deg2rad(5.0), region=None, step_back=back)
    low, high = cell.robot.limits.T
    for joints in (found.joints, found.joints + back):
        assert ((joints >= low) & (joints <= high)).all()
        assert not any(bad.any() for bad in collisions(scene, joints).values())
    assert not any(bad.any() for bad in hidden(scene, found.joints).values())
    lost = sum(number for _, number in found.rejected)
    assert len(found.joints) == 300
    assert lost + 300 == found.drawn
    again = draw_candidates(scene, 300, seed=4, margin=np.deg2rad(5.0), region=None, step_back=back)
    np.testing.assert_array_equal(found.joints, again.joints)


def test_each_rejected_posture_counts_once() -> None:
    scene = scene_of(shop(), clearance=0.02)
    joints = draw_postures(scene.robot, 512, seed=2, margin=0.1)
    checked = usable(scene, joints)
    good, counts = checked.good, dict(checked.rejected)
    assert good.sum() + sum(counts.values()) == 512


def test_nothing_left_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidates, "MOST", 4096)
    walled = HalfSpace(name="flood", point=np.array([0, 0, 9.0]), normal=np.array([0, 0, 1.0]))
    outside = shop(obstacles=(walled,), tracker_position=np.array([3.0, 0.0, 10.0]))
    with pytest.raises(ReachError, match="collision with flood"):
        draw_candidates(
            scene_of(outside, clearance=0.0), 10, seed=1, margin=0.1, region=None, step_back=None
        )


def test_a_margin_that_leaves_nothing_is_refused() -> None:
    with pytest.raises(ReachError, match=r"joint 2 moves 250\.0 deg; a margin of 130\.0 deg"):
        draw_postures(shop().robot, 8, seed=1, margin=np.deg2rad(130.0))


def test_postures_used_elsewhere_are_free() -> None:
    scene = scene_of(shop(), clearance=0.02)
    checked = usable(scene, postures(50, 3) * 0.3 + HOME * 0.7)
    good, counts = checked.good, dict(checked.rejected)
    assert good.all(), counts
