import numpy as np
import pytest

from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import inverse
from robotrue.core.units import DEG
from robotrue.robot.configuration import (
    abb_confdata,
    branch_fits,
    branch_words,
    configuration_words,
    controller_axes,
    fanuc_words,
    kuka_status_turn,
    on_turn,
    renew_words,
    yaskawa_rconf,
)
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branches_of, inverse_branches
from robotrue.robot.presets import preset

from .arms import TOOL, random_joints


def arms_with(robot, T, status, turn=NO_WORD):
    """The joints of a pose that KUKA's words ask for, as compensation chooses them."""
    seed = robot.controller.to_model(np.zeros(6))
    options = inverse_branches(robot, T[None] @ inverse(robot.T_flange_tool), reference=seed)[0]
    options = options[~np.isnan(options).any(axis=1)]
    wanted = np.array([[status, turn]])
    have = branch_words("kuka", configuration_words(robot, "kuka", options))
    fits = branch_fits("kuka", branch_words("kuka", wanted), have[None])[0]
    words = np.repeat(wanted, fits.sum(), axis=0)
    turned, allowed = on_turn(robot, "kuka", options[fits], words, near=seed)
    return turned[allowed]


@pytest.mark.parametrize("name", ["kr160", "kr300"])
def test_pose_with_status_and_turn_gives_the_joints_back(name):
    robot = preset(name).with_tool(TOOL)
    joints = random_joints(robot, 300, 1)
    poses = forward(robot, joints)
    status, turn = kuka_status_turn(robot, joints)
    assert set(status) == set(range(8))
    for q, T, s, t in zip(joints, poses, status, turn, strict=True):
        np.testing.assert_allclose(arms_with(robot, T, s, t), q[None], atol=1e-7)


def test_status_is_the_branch_with_the_elbow_inverted():
    robot = preset("kr160")
    joints = random_joints(robot, 500, 2)
    status, _ = kuka_status_turn(robot, joints)
    branch = branches_of(robot, joints)
    assert ((status & 1) == (branch >> 1 & 1)).all()
    assert ((status >> 1 & 1) == 1 - (branch & 1)).all()
    assert ((status >> 2 & 1) == (branch >> 2 & 1)).all()


def test_elbow_bit_changes_where_the_arm_is_in_line():
    """With 70 mm between axes 3 and 4 that is at A3 = -atan(70 / 710), not at zero."""
    robot = preset("kr160")
    edge = -np.degrees(np.arctan2(70.0, 710.0))
    axes = np.array([[0, -40, edge + d, 0, 30, 0] for d in (-0.01, 0.01)]) * DEG
    status, _ = kuka_status_turn(robot, robot.controller.to_model(axes))
    assert (status >> 1 & 1).tolist() == [0, 1]


def test_overhead_and_a5_bits():
    robot = preset("kr160")
    axes = np.array([[0, -90, 90, 0, -30, 0], [0, -140, -20, 0, 30, 0]]) * DEG
    status, turn = kuka_status_turn(robot, robot.controller.to_model(axes))
    assert status.tolist() == [0b110, 0b001]
    assert turn.tolist() == [0b010010, 0b000110]


def test_turn_chooses_between_whole_turns():
    robot = preset("kr160")
    axes = np.array([10, -80, 100, 20, 30, 200]) * DEG
    pose = forward(robot, robot.controller.to_model(axes)[None])[0]
    status, turn = (int(v) for v in kuka_status_turn(robot, robot.controller.to_model(axes)))
    same = arms_with(robot, pose, status, turn)[0]
    np.testing.assert_allclose(controller_axes(robot, same) / DEG, axes / DEG, atol=1e-7)
    other = arms_with(robot, pose, status, turn | 0b100000)[0]
    np.testing.assert_allclose(controller_axes(robot, other)[5] / DEG, -160, atol=1e-7)
    free = arms_with(robot, pose, status)[0]
    np.testing.assert_allclose(controller_axes(robot, free)[5] / DEG, -160, atol=1e-7)


def test_impossible_words_leave_no_arm():
    robot = preset("kr160")
    pose = forward(robot, np.zeros((1, 6)))[0]
    assert not len(arms_with(robot, pose, 1, 63))


@pytest.mark.parametrize(
    ("axes_deg", "confdata"),
    [
        ([45, 0, 0, 100, 30, -30], [0, 1, -1, 0]),
        ([-100, 0, 0, -100, -30, 200], [-2, -2, 2, 1]),
        ([10, 60, -85, 10, 30, 0], [0, 0, 0, 2]),
    ],
)
def test_abb_quarters_and_cfx(axes_deg, confdata):
    assert abb_confdata(preset("irb120"), np.array(axes_deg) * DEG).tolist() == confdata


def test_abb_cfx_is_the_branch():
    robot = preset("irb120")
    joints = random_joints(robot, 200, 3)
    branch, cfx = branches_of(robot, joints), abb_confdata(robot, joints)[:, 3]
    expected = 4 * (branch >> 1 & 1) + 2 * (branch & 1) + (branch >> 2 & 1)
    assert (cfx == expected).all()


def test_fanuc_words():
    robot = preset("r2000")
    down = forward(robot, np.array([[0, 0, 0, 0, -90, 0]]) * DEG)[0]
    assert np.allclose(down[:3, 2], [0.0, 0.0, -1.0])  # a tool that looks down is N U T
    axes = np.array([[0, 0, 0, 0, -90, 0], [0, 0, 0, 0, 30, 0], [0, 0, 0, 190, -30, -190]]) * DEG
    words = fanuc_words(robot, axes).tolist()
    assert words == [[0, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0], [0, 1, 1, 1, 0, -1]]


def test_yaskawa_words():
    robot = preset("gp225")
    axes = np.array([[0, 0, 0, 0, 30, 0], [0, 0, 0, 200, 30, -200], [0, 40, 90, 100, 30, 0]])
    assert yaskawa_rconf(robot, axes * DEG).tolist() == [
        [0, 0, 0, 0, 0, 0],
        [1, 0, 0, 1, 1, 0],
        [1, 1, 0, 0, 0, 0],
    ]


def test_a_renewed_status_keeps_the_bits_that_name_no_branch():
    """Bit 3 of S says how a KUKA taught the point; a correction changes the branch, not that."""
    written = np.array([[0b1010, 3], [0b0010, 3], [0b1010, 3], [NO_WORD, NO_WORD]])
    before = np.array([[0b010, 3], [0b010, 3], [0b010, 3], [0b010, 3]])
    after = np.array([[0b110, 3], [0b110, 3], [0b010, 2], [0b110, 2]])
    assert renew_words("kuka", written, before, after).tolist() == [
        [0b1110, NO_WORD],
        [0b0110, NO_WORD],
        [NO_WORD, 2],
        [NO_WORD, NO_WORD],
    ]
    assert renew_words("abb", *(np.array([[k, 0, 0, 1]]) for k in (9, 0, 1))).tolist() == [
        [1, NO_WORD, NO_WORD, NO_WORD]
    ]
