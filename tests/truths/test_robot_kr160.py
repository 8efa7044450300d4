"""KUKA KR160 R1570: Deng et al. 2022, Table 1, and postures computed from it by hand (9 digits)."""

import numpy as np
import pytest

from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.robot.configuration import controller_axes, kuka_status_turn
from robotrue.robot.forward import forward
from robotrue.robot.opw import opw_geometry
from robotrue.robot.presets import preset


@pytest.mark.parametrize(
    ("joints_deg", "xyz_mm", "abc_deg"),
    [
        ([0, 0, 0, 0, 0, 0], [1175, 0, 1040], None),
        (
            [10, -20, 30, 40, -50, 60],
            [1289.45061, 334.864933, 1027.313809],
            [126.35998, -13.841726, 118.700811],
        ),
        (
            [-35, 15, -25, -100, 70, 170],
            [806.717409, -321.978727, 849.669069],
            [127.410297, 3.744966, 102.741870],
        ),
    ],
)
def test_flange_poses(joints_deg, xyz_mm, abc_deg):
    T = forward(preset("kr160"), np.array([joints_deg]) * DEG)[0]
    np.testing.assert_allclose(T[:3, 3] / MM, xyz_mm, atol=1e-5)
    if abc_deg is None:
        np.testing.assert_allclose(T[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)
    else:
        np.testing.assert_allclose(abc_from_matrix(T[:3, :3]) / DEG, abc_deg, atol=1e-5)


def test_home_of_the_controller_is_zero_of_the_table():
    robot = preset("kr160")
    axes = controller_axes(robot, np.zeros(6)) / DEG
    np.testing.assert_allclose(axes, [0, -90, 90, 0, 0, 0], atol=1e-12)
    status, turn = kuka_status_turn(robot, np.zeros(6))
    # Home: not overhead, A3 = 90 deg positive, A5 = 0; only A2 negative.
    assert (int(status), int(turn)) == (0b010, 0b000010)


def test_axes_turn_the_way_kukas_do():
    robot = preset("kr160")
    home = np.array([0, -90, 90, 0, 0, 0]) * DEG
    axes = home + 10 * DEG * np.eye(6)
    x, y, z = (forward(robot, robot.controller.to_model(axes))[:, k, 3] for k in range(3))
    assert y[0] < 0  # +A1 is clockwise seen from above
    assert z[1] < 1.04  # +A2 leans forward and down
    assert x[1] > 1.175
    assert z[2] < 1.04  # +A3 lowers the forearm
    assert z[4] < 1.04  # +A5 lowers the hand
    turned = forward(robot, robot.controller.to_model(axes[[3, 5]]))
    # +A4 and +A6 are clockwise seen from the tool: flange y dips where x points down at home.
    assert (turned[:, 2, 1] < 0).all()


def test_ortho_parallel_parameters():
    geometry = opw_geometry(preset("kr160"))
    lengths = [getattr(geometry, n) / MM for n in ("a1", "a2", "b", "c1", "c2", "c3", "c4")]
    np.testing.assert_allclose(lengths, [250, 70, 0, 500, 610, 710, 215], atol=1e-9)
    np.testing.assert_array_equal(geometry.sign, [1, -1, -1, 1, -1, 1])
    np.testing.assert_allclose(geometry.offset / DEG, [0, 0, 90, 0, 0, 0], atol=1e-9)
