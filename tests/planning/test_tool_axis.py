"""Rotation about the tool axis: reached points, the rule, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError, ShapeError
from robotrue.planning.tool_axis import dense_path, resolve_spin
from robotrue.program.toolpath import Toolpath
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, branches_of, inverse_branches, require_opw
from robotrue.robot.presets import preset
from robotrue.robot.spin import Grid, SpinSettings, best_way, can_be_taken

Z = SpinSettings(cutter=np.array([0.0, 0.0, 1.0]))
TILTED = pose(matrix_from_abc(np.array([0.0, 60.0, 0.0]) * DEG), np.array([0.2, 0.0, 0.2]))
ARM = preset("KUKA KR160 R1570").with_tool(TILTED)
PART = pose(matrix_from_abc(np.array([2.0, -1.0, 0.5]) * DEG), np.array([0.9, -0.1, 0.5]))


def path(position: Array, axis: Array, *, name: str = "side.apt") -> Toolpath:
    n = len(position)
    axis = np.broadcast_to(np.asarray(axis, dtype=float), (n, 3))
    return Toolpath(
        name="side",
        source=name,
        position=position,
        axis=axis / np.linalg.norm(axis, axis=1)[:, None],
        feed=np.full(n, 0.02),
        rapid=np.zeros(n, dtype=bool),
        line=np.arange(1, n + 1) * 10,
        operation=np.zeros(n, dtype=int),
        operations=("one",),
    )


def raster(lines: int = 6, points: int = 12) -> Array:
    x = np.linspace(0.02, 0.38, points)
    rows = [np.stack([x[:: 1 - 2 * (k % 2)], np.full(points, 0.03 * k), 0.1 + 0 * x], axis=1)
            for k in range(lines)]  # fmt: skip
    return np.concatenate(rows)


def five_axis() -> Toolpath:
    p = raster()
    axis = np.stack(
        [0.5 * np.sin(9 * p[:, 0]), 0.4 * np.cos(11 * p[:, 1]), 1 + 0 * p[:, 0]], axis=1
    )
    return path(p, axis)


@pytest.mark.parametrize(
    "side", [path(raster(), [0, 0, 1]), path(raster()[:, [0, 2, 1]], [0, -1, 0]), five_axis()]
)
def test_the_tool_stands_on_every_point_along_its_axis(side):
    found = resolve_spin(ARM, PART, side, Z)
    T = forward(ARM, found.joints)
    np.testing.assert_allclose(T[:, :3, 3], apply(PART, side.position), atol=1e-9)
    np.testing.assert_allclose(T[:, :3, 2], -side.axis @ PART[:3, :3].T, atol=1e-9)
    np.testing.assert_allclose(T[:, :3, :3], PART[:3, :3] @ found.rotation, atol=1e-9)
    assert (branches_of(ARM, found.joints) == found.branch).all()
    assert np.abs(np.diff(found.joints, axis=0)).max() < 10 * DEG
    assert found.limit_margin > 3 * DEG
    assert found.wrist_angle > 10 * DEG
    inside = (found.joints > ARM.limits[:, 0]) & (found.joints < ARM.limits[:, 1])
    assert inside.all()


def test_the_cutter_may_lie_along_any_axis_of_the_tool_frame():
    side = path(raster(2), [0, 0, 1])
    arm = ARM.with_tool(TILTED @ pose(matrix_from_abc(np.array([0, -90.0, 0]) * DEG), np.zeros(3)))
    found = resolve_spin(arm, PART, side, SpinSettings(cutter=np.array([2.0, 0.0, 0.0])))
    T = forward(arm, found.joints)
    np.testing.assert_allclose(T[:, :3, 0], np.tile(-PART[:3, 2], (24, 1)), atol=1e-9)
    # The same spindle by another name: the arm stands alike.
    np.testing.assert_allclose(found.joints, resolve_spin(ARM, PART, side, Z).joints, atol=0.05)


def test_equal_input_gives_equal_output():
    one, two = (resolve_spin(ARM, PART, five_axis(), Z) for _ in range(2))
    np.testing.assert_array_equal(one.joints, two.joints)
    np.testing.assert_array_equal(one.rotation, two.rotation)


def test_the_rule_makes_room_where_no_fixed_spin_goes_all_the_way():
    """Once around a post with the tool nearly lying: 72 fixed spins in 8 branches, all stopped."""
    t = np.linspace(-np.pi, np.pi, 60)
    flat = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    side = path(0.05 * flat, np.sin(80 * DEG) * flat + [0, 0, np.cos(80 * DEG)])
    T, arm = pose(np.eye(3), np.array([1.0, 0.0, 0.9])), require_opw(ARM)
    found = resolve_spin(ARM, T, side, Z)
    assert found.limit_margin > Z.limit_margin

    fixed = np.arange(0.0, 360.0, 5.0) * DEG
    turn = [matrix_from_abc(np.array([spin, 0.0, 0.0])) for spin in fixed]
    frames = dense_path(side)
    stopped = []
    for each in turn:
        T_base_tool = T @ pose(frames.frame @ each, frames.position)
        flange = T_base_tool @ np.linalg.inv(TILTED)
        joints = inverse_branches(ARM, flange, reference=ARM.limits.mean(axis=1))
        stands = np.isfinite(can_be_taken(ARM, arm, joints, Z))
        stopped.append(~stands.all(axis=0))
    assert np.all(stopped)


def test_shoulder_and_elbow_of_home_are_kept():
    side = path(raster(2), [0, 0, 1])
    for home in (np.zeros(6), resolve_spin(ARM, PART, side, Z).joints[0]):
        found = resolve_spin(ARM, PART, side, Z, near=home)
        assert found.branch % 4 == branch_of(ARM, home) % 4


def test_a_long_straight_move_is_looked_at_on_the_way():
    """Both ends are reached; the straight line between them leads through the arm's foot."""
    ends = path(np.array([[0.0, 1.0, 0.5], [0.0, -1.0, 0.5]]), [0, 0, 1], name="through.apt")
    T = pose(np.eye(3), np.array([0.05, 0.0, 0.0]))
    with pytest.raises(ReachError, match=r"^through\.apt:20: ") as refused:
        resolve_spin(ARM, T, ends, Z)
    assert refused.value.line == 20


@pytest.mark.parametrize(
    ("shift", "says"),
    [
        ([0.9, 0.0, 0.0], "the stretched arm is"),
        ([0.0, 0.0, 1.0], "out of reach at every rotation"),
    ],
)
def test_a_point_out_of_reach_is_named_by_its_line(shift, says):
    with pytest.raises(ReachError, match=r"^side\.apt:10: ") as refused:
        resolve_spin(ARM, pose(np.eye(3), PART[:3, 3] + shift), path(raster(), [0, 0, 1]), Z)
    assert says in str(refused.value)


def test_the_first_point_no_spin_reaches_is_the_one_named():
    p = raster(1, 10)
    p[6:, 0] += 1.2
    with pytest.raises(ReachError) as refused:
        resolve_spin(ARM, PART, path(p, [0, 0, 1]), Z)
    assert refused.value.line == 70


def test_an_arm_with_parallel_axes_follows_a_path():
    ur10 = preset("UR10").with_tool(TILTED)
    part = pose(np.eye(3), np.array([0.55, -0.2, 0.2]))
    here = path(raster(), [0, 0, 1])
    posed = resolve_spin(ur10, part, here, Z)
    reached = forward(ur10, posed.joints)
    np.testing.assert_allclose(reached[:, :3, 3], apply(part, here.position), atol=1e-9)
    np.testing.assert_allclose(-reached[:, :3, 2], np.tile(part[:3, 2], (len(here), 1)), atol=1e-9)
    assert np.abs(np.diff(posed.joints, axis=0)).max() < 45.0 * DEG
    assert (branches_of(ur10, posed.joints) == posed.branch).all()


def test_an_arm_of_another_kind_is_refused():
    bent = preset("UR5")
    bent = replace(bent, alpha=bent.alpha + np.array([0.0, 1e-3, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(ConfigurationError, match="UR5 has neither a spherical wrist nor"):
        resolve_spin(bent, PART, path(raster(), [0, 0, 1]), Z)
    with pytest.raises(ShapeError, match="cutter has length 0"):
        SpinSettings(cutter=np.zeros(3))


def test_the_cheapest_way_is_that_of_trying_all():
    """Four stations, one branch, four spins: every one of 4 x 3 x 3 x 3 ways by hand."""
    rng = np.random.default_rng(5)
    geometry = require_opw(ARM)
    base = resolve_spin(ARM, PART, path(raster(1, 4), [0, 0, 1]), Z).joints
    joints = base[:, None, None] + rng.normal(scale=0.15, size=(4, 1, 4, 6))
    spin = np.tile(np.arange(4) * 90.0 * DEG, (4, 1))
    length = np.array([0.0, 0.02, 0.05, 0.03])
    way = best_way(ARM, geometry, Grid(joints=joints, spin=spin, length=length, circular=True), Z)

    def stand(q: Array) -> float:
        middle, half = ARM.limits.mean(axis=1), 0.5 * np.diff(ARM.limits, axis=1)[:, 0]
        u = ((q - middle) / half) ** 2
        angles = geometry.angles(q)
        ahead = geometry.wrist_point(angles)[0]
        reach = geometry.a1 + geometry.c2 + np.hypot(geometry.a2, geometry.c3)
        fold = np.sin(angles[2] + np.arctan2(geometry.a2, geometry.c3))
        comfort = (
            (np.sin(20 * DEG) / np.sin(angles[4])) ** 2
            + (np.sin(15 * DEG) / fold) ** 2
            + (0.15 * reach / ahead) ** 2
        )
        return float((u / (1.0 - u)).sum() + comfort)

    best = (np.inf, ())
    for ways in np.ndindex(4, 4, 4, 4):
        if any((b - a) % 4 == 2 for a, b in pairwise(ways)):
            continue  # one spin further at most
        q = np.array([joints[k, 0, s] for k, s in enumerate(ways)])
        cost = length[1] * stand(q[0])
        for k in (1, 2, 3):
            cost += length[k] * stand(q[k]) + ((q[k] - q[k - 1]) ** 2).sum() / length[k]
        best = min(best, (cost, ways))
    assert way.cost == pytest.approx(best[0], rel=1e-9)
    np.testing.assert_allclose(
        np.mod(way.spin, 2 * np.pi), np.array(best[1]) * 90 * DEG, atol=1e-12
    )


def test_points_between_lie_on_the_moves():
    side = five_axis()
    dense = dense_path(side)
    np.testing.assert_allclose(dense.position[dense.at], side.position, atol=1e-15)
    np.testing.assert_allclose(-dense.frame[dense.at][:, :, 2], side.axis, atol=1e-12)
    step = np.linalg.norm(np.diff(dense.position, axis=0), axis=1)
    assert step.max() <= 20 * MM + 1e-12
    product = dense.frame.swapaxes(1, 2) @ dense.frame
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(dense.frame), 1.0)
    # Carried without turning: the rotation from one to the next has no part along the axis.
    turn = dense.frame[1:] @ dense.frame[:-1].swapaxes(1, 2)
    about = np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0],
                      turn[:, 1, 0] - turn[:, 0, 1]], axis=1)  # fmt: skip
    assert np.abs((about * dense.frame[1:, :, 2]).sum(axis=1)).max() < 1e-12
