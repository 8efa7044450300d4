import numpy as np
import pytest

from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError
from robotrue.robot.forward import forward, walk
from robotrue.robot.opw import opw_geometry
from robotrue.robot.presets import FOLDER, preset, preset_names, rated_payload
from robotrue.robot.statics import drive_torque

from .arms import SEVEN


@pytest.mark.parametrize(
    ("written", "full"),
    [
        ("kr160", "KUKA KR160 R1570"),
        ("KUKA KR160 R1570", "KUKA KR160 R1570"),
        ("kuka-kr160-r1570", "KUKA KR160 R1570"),
        ("KUKA KR 160 R1570", "KUKA KR160 R1570"),
        ("kr_300", "KUKA KR300 R2500"),
        ("ur10", "UR10"),
        ("Universal Robots UR5", "UR5"),
        ("irb 6660", "ABB IRB 6660-205/1.9"),
        ("abb_irb6660-205/1.9", "ABB IRB 6660-205/1.9"),
        ("IRB120", "ABB IRB 120-3/0.6"),
        ("St\u00e4ubli TX2-90L", "Staubli TX2-90L"),
        ("tx2 90l", "Staubli TX2-90L"),
        ("Motoman GP225", "Yaskawa GP225"),
        ("Fanuc R-2000iC/165F", "Fanuc R-2000iC/165F"),
        ("fanuc r2000", "Fanuc R-2000iC/165F"),
        ("panda", "Franka Panda"),
        ("Franka Emika Panda", "Franka Panda"),
        ("iiwa14", "KUKA LBR iiwa 14 R820"),
        ("KUKA LBR iiwa 14 R820", "KUKA LBR iiwa 14 R820"),
        ("lbr-iiwa-14-r820", "KUKA LBR iiwa 14 R820"),
        ("kuka_iiwa_14", "KUKA LBR iiwa 14 R820"),
    ],
)
def test_names_are_forgiving(written, full):
    assert preset(written).name == full


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_builds_under_its_own_name(name):
    robot = preset(name)
    assert robot.name == name
    assert robot.dof == (7 if name in SEVEN else 6)
    assert not robot.errors.any()
    assert np.array_equal(robot.T_flange_tool, np.eye(4))


@pytest.mark.parametrize("written", ["ur10e", "kr161", "kr", "", "fanuc m20"])
def test_unknown_name_lists_what_exists(written):
    with pytest.raises(ConfigurationError) as caught:
        preset(written)
    assert all(name in str(caught.value) for name in preset_names())


def test_nearest_name_is_offered():
    with pytest.raises(ConfigurationError, match=r"Try: 'KUKA KR160 R1570'"):
        preset("kr161")
    with pytest.raises(ConfigurationError, match=r"Try: 'UR10'"):
        preset("ur10e")


def test_a_preset_is_one_file_in_the_folder():
    assert len(list(FOLDER.glob("*.toml"))) == len(preset_names())
    assert preset_names()[0] == "KUKA KR160 R1570"


def test_a_rated_payload_is_that_of_the_name():
    assert rated_payload("KUKA KR160 R1570") == 160.0
    assert rated_payload("Staubli TX2-90L") is None


@pytest.mark.parametrize(
    ("name", "position", "lengths"),
    [
        ("kr300", [1.59, 0, 1.784], [0.35, 0.041, 0, 0.675, 1.15, 1.0, 0.24]),
        ("irb6660", [1.393, 0, 1.7945], [0.3, -0.28, 0, 0.8145, 0.7, 0.893, 0.2]),
        ("irb120", [0.374, 0, 0.63], [0, -0.07, 0, 0.29, 0.27, 0.302, 0.072]),
        ("tx2-90l", [0.05, 0.05, 1.15], [0.05, 0, 0.05, 0, 0.5, 0.55, 0.1]),
        ("gp225", [1.8, 0, 1.45], [0.325, -0.3, 0, 0, 1.15, 1.225, 0.25]),
    ],
)
def test_flange_at_zero_and_lengths_from_the_sources(name, position, lengths):
    robot = preset(name)
    np.testing.assert_allclose(forward(robot, np.zeros((1, 6)))[0, :3, 3], position, atol=1e-12)
    geometry = opw_geometry(robot)
    read = [getattr(geometry, n) for n in ("a1", "a2", "b", "c1", "c2", "c3", "c4")]
    np.testing.assert_allclose(read, lengths, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "joints", "position", "axes"),
    [
        # Upper arm and forearm upright, hand down: 88 mm forward, 333 + 316 + 384 - 107 mm up.
        ("panda", np.zeros(7), [0.088, 0.0, 0.926], ["z", "y", "z", "-y", "z", "-y", "-z"]),
        # Forearm level: wrist 82.5 + 384 mm ahead, flange 107 mm below it after 88 mm ahead.
        (
            "panda",
            np.array([0.0, 0.0, 0.0, -np.pi / 2, 0.0, np.pi / 2, 0.0]),
            [0.0825 + 0.384 + 0.088, 0.0, 0.333 + 0.316 + 0.0825 - 0.107],
            None,
        ),
        ("iiwa14", np.zeros(7), [0.0, 0.0, 1.306], ["z", "y", "z", "-y", "z", "y", "z"]),
        ("iiwa14", np.array([0.0, np.pi / 2, 0, 0, 0, 0, 0]), [0.946, 0.0, 0.36], None),
    ],
)
def test_arms_of_seven_joints_stand_where_their_data_sheets_put_them(name, joints, position, axes):
    robot = preset(name)
    state = walk(robot, joints[None])
    np.testing.assert_allclose(state.flange_position[0], position, atol=1e-12)
    if axes is None:
        return
    unit = {"y": [0, 1, 0], "z": [0, 0, 1]}
    wanted = [(-1 if a[0] == "-" else 1) * np.array(unit[a[-1]]) for a in axes]
    np.testing.assert_allclose(state.joint_axis[0], wanted, atol=1e-12)


@pytest.mark.parametrize("name", SEVEN)
def test_gravity_does_no_work_about_a_vertical_axis_and_masses_lie_in_their_links(name):
    robot = preset(name)
    joints = np.random.default_rng(1).uniform(*robot.limits.T, (50, 7))
    np.testing.assert_allclose(drive_torque(robot, joints)[:, 0], 0.0, atol=1e-12)
    # Arm stretched out sideways: the second drive holds all of it, less than 30 kg at half a metre.
    level = np.zeros((1, 7))
    level[0, 1] = np.pi / 2
    held = drive_torque(robot, level)[0, 1]
    assert 20.0 < held < 100.0
    assert np.abs(robot.link_com).max() < 0.15


def test_the_fanuc_is_the_chain_of_its_urdf():
    """Joint by joint as ``r2000ic165f_macro.xacro`` has them, from the controller's base."""

    def turned(axis, angle):
        return matrix_from_rotation_vector(np.array(axis, dtype=float) * angle)

    origins = [(0, 0, 0), (0.312, 0, 0), (0, 0, 1.075), (0, 0, 0.225), (1.28, 0, 0), (0.215, 0, 0)]
    axes = [(0, 0, 1), (0, 1, 0), (0, -1, 0), (-1, 0, 0), (0, -1, 0), (-1, 0, 0)]
    zero_tool = turned((0, 1, 0), -np.pi / 2) @ turned((1, 0, 0), np.pi)
    robot = preset("r2000")
    for joints in np.random.default_rng(1).uniform(-2.0, 2.0, (10, 6)):
        T = np.eye(4)
        for origin, axis, q in zip(origins, axes, joints, strict=True):
            T = T @ pose(turned(axis, q), np.array(origin, dtype=float))
        T[:3, :3] = T[:3, :3] @ zero_tool
        np.testing.assert_allclose(forward(robot, joints[None])[0], T, atol=1e-12)
    shown = robot.controller.to_controller(np.radians([0, 20, 30, 0, 0, 0]))
    np.testing.assert_allclose(np.degrees(shown), [0, 20, 10, 0, 0, 0], atol=1e-12)
