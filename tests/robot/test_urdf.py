from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.errors import ConfigurationError, FormatError
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset, preset_names
from robotrue.robot.statics import drive_torque
from robotrue.robot.urdf import from_urdf, to_urdf

from .arms import TOOL, heavy, random_joints

pin = pytest.importorskip("pinocchio")

IRB120 = """<?xml version="1.0"?>
<robot name="irb120">
  <link name="world"/>
  <link name="base_link"><inertial><mass value="6.215"/></inertial></link>
  <joint name="mount" type="fixed">
    <parent link="world"/><child link="base_link"/><origin xyz="0 0 0.1"/>
  </joint>
  <link name="link_1"><inertial><mass value="3.067"/><origin xyz="9.77E-05 -0.00012 0.23841"/></inertial></link>
  <link name="link_2"><inertial><mass value="3.909"/><origin xyz="0.00078 -0.00212 0.10124"/></inertial></link>
  <link name="link_3"><inertial><mass value="2.944"/><origin xyz="0.02281 0.00106 0.05791"/></inertial></link>
  <link name="link_4"><inertial><mass value="1.328"/><origin xyz="0.2247 0.00015 0.00041"/></inertial></link>
  <link name="link_5"><inertial><mass value="0.546"/><origin xyz="-0.00109 3.68E-05 6.22E-05"/></inertial></link>
  <link name="link_6"><inertial><mass value="0.137"/><origin xyz="-0.00706 -0.00017 -1.32E-06"/></inertial></link>
  <link name="tool0"/>
  <link name="cable"><inertial><mass value="CABLE"/><origin xyz="0.1 0.2 0.3"/></inertial></link>
  <joint name="joint_1" type="revolute"><origin xyz="0 0 0"/><parent link="base_link"/><child link="link_1"/><limit lower="-2.87979" upper="2.87979"/><axis xyz="0 0 1"/></joint>
  <joint name="joint_2" type="revolute"><origin xyz="0 0 0.29"/><parent link="link_1"/><child link="link_2"/><limit lower="-1.91986" upper="1.91986"/><axis xyz="0 1 0"/></joint>
  <joint name="joint_3" type="revolute"><origin xyz="0 0 0.27"/><parent link="link_2"/><child link="link_3"/><limit lower="-1.91986" upper="1.22173"/><axis xyz="0 1 0"/></joint>
  <joint name="joint_4" type="revolute"><origin xyz="0 0 0.07"/><parent link="link_3"/><child link="link_4"/><limit lower="-2.79253" upper="2.79253"/><axis xyz="1 0 0"/></joint>
  <joint name="joint_5" type="revolute"><origin xyz="0.302 0 0"/><parent link="link_4"/><child link="link_5"/><limit lower="-2.094395" upper="2.094395"/><axis xyz="0 1 0"/></joint>
  <joint name="joint_6" type="continuous"><origin xyz="0.072 0 0"/><parent link="link_5"/><child link="link_6"/><axis xyz="1 0 0"/></joint>
  <joint name="cable_clip" type="fixed"><parent link="link_3"/><child link="cable"/></joint>
  <joint name="flange" type="fixed"><origin rpy="0 1.5707963267948966 0"/><parent link="link_6"/><child link="tool0"/></joint>
</robot>
"""  # noqa: E501


def _read(tmp_path, text, **options):
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return from_urdf(path, **options)


def _judge_pose(text, joints, tip="tool0"):
    model = pin.buildModelFromXML(text)
    data, frame = model.createData(), model.getFrameId(tip)
    out = []
    for q in joints:
        pin.framesForwardKinematics(model, data, q)
        out.append(data.oMf[frame].homogeneous.copy())
    return np.array(out)


def _random_chain(seed, dof):
    """A URDF of random origins and axes; the first axis along z, as a DH table needs."""
    rng = np.random.default_rng(seed)
    lines = ['<robot name="random">', '<link name="l0"/>']
    axis = np.array([0, 0, 1.0])
    for i in range(dof):
        # Every third joint parallel to the one before, every fourth meeting it.
        turned = i > 0 and i % 3 != 0
        xyz = np.zeros(3) if i % 4 == 3 or i == 0 else rng.uniform(-0.5, 0.5, 3)
        rpy = rng.uniform(-2, 2, 3) if turned else np.zeros(3)
        if turned:
            axis = rng.normal(size=3)
        lines += [
            f'<link name="l{i + 1}"><inertial><mass value="{rng.uniform(1, 9)}"/>'
            f'<origin xyz="{" ".join(map(str, rng.normal(size=3) * 0.1))}"/>'
            '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>',
            f'<joint name="j{i + 1}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>'
            f'<axis xyz="{" ".join(map(str, axis))}"/>'
            '<limit lower="-3" upper="3" effort="0" velocity="0"/></joint>',
        ]
    tip = " ".join(map(str, rng.uniform(-1, 1, 3)))
    lines += [
        '<link name="tip"/><joint name="end" type="fixed">',
        f'<parent link="l{dof}"/><child link="tip"/><origin xyz="{tip}" rpy="{tip}"/></joint>',
    ]
    return "\n".join([*lines, "</robot>"])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("dof", [3, 6, 7])
def test_random_chains_agree_with_pinocchio(tmp_path, seed, dof):
    text = _random_chain(seed, dof)
    robot = _read(tmp_path, text)
    assert robot.dof == dof
    joints = random_joints(robot, 20, seed)
    ours, theirs = forward(robot, joints), _judge_pose(text, joints, "tip")
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    model = pin.buildModelFromXML(text)
    model.gravity.linear = robot.gravity
    data = model.createData()
    for q, torque in zip(joints, drive_torque(robot, joints), strict=True):
        np.testing.assert_allclose(
            torque, -pin.computeGeneralizedGravity(model, data, q), atol=1e-9
        )


def test_public_irb120_is_the_preset(tmp_path):
    """Geometry, limits and masses of the preset, from the numbers of the public file."""
    robot, known = _read(tmp_path, IRB120.replace("CABLE", "0")), preset("irb120")
    assert robot.convention == "mdh"
    assert robot.name == "irb120"
    joints = random_joints(robot, 50, 1)
    raised = forward(known, joints)
    raised[:, 2, 3] += 0.1
    np.testing.assert_allclose(forward(robot, joints), raised, atol=1e-12)
    np.testing.assert_allclose(drive_torque(robot, joints), drive_torque(known, joints), atol=1e-9)
    np.testing.assert_allclose(robot.limits[:5], known.limits[:5], atol=1e-5)
    np.testing.assert_allclose(robot.limits[5], [-2 * np.pi, 2 * np.pi])
    np.testing.assert_allclose(robot.T_flange_tool, np.eye(4), atol=1e-12)


def test_fixed_side_branches_carry_their_mass(tmp_path):
    robot = _read(tmp_path, IRB120.replace("CABLE", "2.0"), tip="tool0")
    assert robot.link_mass[2] == pytest.approx(2.944 + 2.0)


@pytest.mark.parametrize("name", preset_names())
def test_out_and_in_again(tmp_path, name):
    bare = preset(name)
    robot = heavy(replace(bare, joint_map=np.eye(bare.dof)), 2).with_tool(TOOL)
    again = _read(tmp_path, to_urdf(robot))
    joints = random_joints(robot, 30, 3)
    np.testing.assert_allclose(forward(again, joints), forward(robot, joints), atol=1e-12)
    np.testing.assert_allclose(drive_torque(again, joints), drive_torque(robot, joints), atol=1e-9)
    np.testing.assert_allclose(again.limits, robot.limits)


def test_calibrated_geometry_survives_the_export():
    rng = np.random.default_rng(4)
    robot = preset("kr160").with_tool(TOOL)
    errors = rng.normal(size=len(robot.errors)) * 1e-3
    for group in ("gear", "compliance", "moment_x", "moment_y"):
        errors[parameter_slice(6, group)] = 0.0
    robot = robot.with_errors(errors)
    joints = random_joints(robot, 20, 5)
    np.testing.assert_allclose(
        _judge_pose(to_urdf(robot), joints), forward(robot, joints), atol=1e-12
    )


def test_pitch_of_exactly_and_nearly_90_deg_is_exact():
    for excess in (0.0, 1e-13, 1e-9, -1e-7):
        tool = pose_from_xyz_abc(np.zeros(3), np.array([0.4, np.pi / 2 + excess, 0.3]))
        robot = preset("ur5").with_tool(tool)
        joints = np.full((1, 6), 0.2)
        np.testing.assert_allclose(
            _judge_pose(to_urdf(robot), joints), forward(robot, joints), atol=1e-14
        )


def test_lossy_export_is_refused_unless_asked_for():
    robot = preset("kr160")
    errors = np.zeros(len(robot.errors))
    errors[parameter_slice(6, "compliance")] = 1e-6
    robot = robot.with_errors(errors)
    with pytest.raises(ConfigurationError, match="compliance errors, which URDF cannot represent"):
        to_urdf(robot)
    assert "<robot" in to_urdf(robot, geometry_only=True)
    with pytest.raises(ConfigurationError, match="parallelogram"):
        to_urdf(preset("irb6660"), geometry_only=True)


def _edit(old, new):
    assert old in IRB120
    return IRB120.replace("CABLE", "0").replace(old, new)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (
            _edit('name="joint_4" type="revolute"', 'name="joint_4" type="prismatic"'),
            19,
            "is prismatic",
        ),
        (_edit('<axis xyz="1 0 0"/></joint>\n  <joint name="joint_5"', '<axis xyz="1 0 0"/><mimic joint="joint_3"/></joint>\n  <joint name="joint_5"'), 19, "follows another joint"),  # noqa: E501
        (_edit('<limit lower="-2.79253" upper="2.79253"/>', ""), 19, "without limit"),
        (_edit('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'), 16, "zero axis"),
        (_edit('xyz="0 0 0.27"', 'xyz="0 0 abc"'), 18, "expected 3 finite"),
        (_edit('<child link="link_2"/>', '<child link="nothing"/>'), 17, "which does not exist"),
        (_edit('<robot name="irb120">', '<!DOCTYPE robot [<!ENTITY a "aaaa">]><robot name="b">'), 2, "document type"),  # noqa: E501
        (_edit('xyz="0 0 0.29"', 'xyz="0 0 ${h}"'), 17, "xacro"),
        (_edit("</robot>", ""), 25, "not well-formed"),
        ("<sdf/>", 1, "expected <robot>"),
    ],
)  # fmt: skip
def test_faults_name_file_and_line(tmp_path, text, line, words):
    with pytest.raises(FormatError, match=words) as caught:
        _read(tmp_path, text)
    assert caught.value.source == str(tmp_path / "arm.urdf")
    assert caught.value.line == line
    assert f"arm.urdf:{line}: " in str(caught.value)


def test_missing_file():
    with pytest.raises(FormatError, match="cannot read"):
        from_urdf("/nowhere/arm.urdf")


def test_first_axis_a_table_cannot_reach(tmp_path):
    text = _edit('<axis xyz="0 0 1"/>', '<axis xyz="1 0 0"/>')
    with pytest.raises(ConfigurationError, match=r"axis 1 \('joint_1'\)") as caught:
        _read(tmp_path, text)
    assert caught.value.line == 16


def test_rounded_right_angles_are_named_and_can_be_taken_as_exact(tmp_path):
    text = _edit('xyz="0 0 0.27"', 'xyz="0 0 0.27" rpy="1.5708 0 0"').replace(
        '<limit lower="-1.91986" upper="1.22173"/><axis xyz="0 1 0"/>',
        '<limit lower="-1.91986" upper="1.22173"/><axis xyz="0 0 -1"/>',
    )
    with pytest.raises(ConfigurationError, match=r"parallel but for 0\.00021 deg"):
        _read(tmp_path, text)
    robot = _read(tmp_path, text, right_angle=1e-5)
    assert robot.alpha[2] == 0.0


def test_tip_must_be_clear(tmp_path):
    text = _edit('<link name="tool0"/>', '<link name="one"/><link name="two"/>').replace(
        '<child link="tool0"/></joint>',
        '<child link="one"/></joint><joint name="t" type="fixed"><parent link="link_6"/>'
        '<child link="two"/></joint>',
    )
    with pytest.raises(ConfigurationError, match="several links could be the tip: one, two"):
        _read(tmp_path, text)
    assert _read(tmp_path, text, tip="two").dof == 6
    with pytest.raises(ConfigurationError, match="no link 'three'"):
        _read(tmp_path, text, tip="three")


def test_moving_masses_beside_the_chain_are_refused(tmp_path):
    text = IRB120.replace("CABLE", "2.0").replace(
        'name="cable_clip" type="fixed">',
        'name="cable_clip" type="revolute"><limit lower="-1" upper="1"/>',
    )
    with pytest.raises(ConfigurationError, match=r"moves 2\.000 kg beside the chain"):
        _read(tmp_path, text, tip="tool0")
