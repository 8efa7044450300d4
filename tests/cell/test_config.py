"""cell.toml: every key reaches the cell, and every wrong one is named with its line."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from robotrue.cell import config
from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.cell.config import read_cell
from robotrue.cell.obstacles import Box, HalfSpace
from robotrue.cell.robot_table import robot_table
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.schema_faults import line_of_key
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, FormatError, ShapeError
from robotrue.robot.presets import preset

UR5 = 'schema = 1\n[robot]\npreset = "UR5"\n'
DH = """schema = 1
[robot]
convention = "mdh"
dh = [
  {theta_deg = 0, alpha_deg = 0, d_mm = 400, a_mm = 0},
  {theta_deg = -90, alpha_deg = 90.0, d_mm = 0, a_mm = 25},
]
"""


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "cell.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def complaint(folder: Path, text: str | bytes) -> str:
    path = written(folder, text)
    with pytest.raises(ConfigurationError) as caught:
        read_cell(path)
    return str(caught.value).replace(str(path), path.name)


def test_everything_but_the_robot_has_a_default(tmp_path: Path) -> None:
    cell = read_cell(written(tmp_path, UR5))
    assert cell.robot.name == preset("UR5").name
    np.testing.assert_array_equal(cell.robot.T_flange_tool, np.eye(4))
    np.testing.assert_array_equal(cell.T_flange_target, np.eye(4))
    np.testing.assert_array_equal(cell.T_base_frame, np.eye(4))
    assert cell.frame == "base"
    assert cell.tracker_position is None
    assert cell.repeatability == pytest.approx(0.06 * MM)
    assert cell.payload.mass.tolist() == [0.0]
    assert np.isnan(cell.compliance_prior).all()
    assert cell.source.endswith("cell.toml")
    assert len(cell.digest) == 64
    np.testing.assert_allclose(
        tracker_covariance(cell, np.ones((1, 3)))[0], np.eye(3) * (15 * UM) ** 2
    )


def test_every_key(tmp_path: Path) -> None:
    text = (
        DH
        + """limits_deg = [[-170, 170], [-90, 100]]
mass_kg = [20, 10.5]
centre_of_mass_mm = [[0, 0, -100], [50, 0, 0]]
stiffness_Nm_per_rad = [1e6, 5e5]
gravity_m_per_s2 = [0, 9.83, 0]
[tool]
xyz_mm = [10, 20, 30]
abc_deg = [90, -30, 45]
[payload]
mass_kg = 12
centre_of_mass_mm = [0, 0, 80]
[target]
xyz_mm = [1, 2, 3]
[tracker]
frame = "unknown"
xyz_mm = [100, 0, 0]
sigma_um = 10
sigma_um_per_m = 2
[repeatability]
mm = 0.05
[base]
xyz_mm = [1000, 0, 500]
abc_deg = [180, 0, 0]
"""
    )
    cell = read_cell(written(tmp_path, text))
    robot = cell.robot
    assert (robot.convention, robot.dof, robot.name) == ("mdh", 2, "cell")
    np.testing.assert_allclose(robot.theta / DEG, [0, -90])
    np.testing.assert_allclose(robot.alpha / DEG, [0, 90])
    np.testing.assert_allclose(robot.d, [0.4, 0])
    np.testing.assert_allclose(robot.a, [0, 0.025])
    np.testing.assert_allclose(robot.limits / DEG, [[-170, 170], [-90, 100]])
    np.testing.assert_allclose(robot.link_mass, [20, 10.5])
    np.testing.assert_allclose(robot.link_com, [[0, 0, -0.1], [0.05, 0, 0]])
    np.testing.assert_allclose(robot.gravity, [0, 9.83, 0])
    np.testing.assert_allclose(cell.compliance_prior, [1e-6, 2e-6])
    expected = pose_from_xyz_abc(np.array([0.01, 0.02, 0.03]), np.array([90, -30, 45]) * DEG)
    np.testing.assert_allclose(robot.T_flange_tool, expected)
    np.testing.assert_allclose(cell.measured_robot.T_flange_tool[:3, 3], [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(cell.payload.com, [[0, 0, 0.08]])
    assert cell.payload.mass.tolist() == [12.0]
    assert cell.frame == "tracker"
    assert cell.repeatability == pytest.approx(5e-5)
    np.testing.assert_allclose(cell.T_base_frame[:3, 3], [1, 0, 0.5])
    # One sigma, isotropic, at 2 m: 10 um + 2 um/m.
    covariance = tracker_covariance(cell, np.array([[2.1, 0.0, 0.0]]))
    np.testing.assert_allclose(covariance[0], np.eye(3) * (14 * UM) ** 2, atol=1e-20)


def test_target_defaults_to_the_tool_point(tmp_path: Path) -> None:
    cell = read_cell(written(tmp_path, UR5 + "[tool]\nxyz_mm = [0, 0, 31]\n"))
    np.testing.assert_allclose(cell.T_flange_target[:3, 3], [0, 0, 0.031])


def test_unknown_tracker_frame_starts_at_its_origin(tmp_path: Path) -> None:
    cell = read_cell(written(tmp_path, UR5 + '[tracker]\nframe = "unknown"\n'))
    assert cell.tracker_position is not None
    assert cell.tracker_position.tolist() == [0, 0, 0]


def test_one_stated_sigma_is_not_added_to(tmp_path: Path) -> None:
    cell = read_cell(written(tmp_path, UR5 + "[tracker]\nsigma_um = 20\n"))
    covariance = tracker_covariance(cell, np.array([[9.0, 0.0, 0.0]]))
    np.testing.assert_allclose(covariance[0], np.eye(3) * (20 * UM) ** 2)


def test_the_plate_says_what_the_arm_weighs(tmp_path: Path) -> None:
    cell = read_cell(written(tmp_path, UR5 + "total_mass_kg = 18.4\n"))
    assert cell.robot.total_mass == 18.4
    table = robot_table(cell.robot, cell.compliance_prior, cell.link_radius)
    assert table["total_mass_kg"] == 18.4


def test_urdf_beside_the_cell_file(tmp_path: Path) -> None:
    links = "".join(f'<link name="l{i}"/>' for i in range(4))
    joint = (
        '<joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/>'
        '<origin xyz="0.1 0 0.3" rpy="{2} 0 0"/><axis xyz="0 0 1"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
    )
    joints = "".join(joint.format(i, i - 1, 1.5707963267948966 * (i == 2)) for i in (1, 2, 3))
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    cell = read_cell(written(tmp_path, 'schema = 1\n[robot]\nurdf = "arm.urdf"\n'))
    assert cell.robot.dof == 3


BAD = {
    'schema = 1\n[robot]\nprest = "UR5"\n': (
        "cell.toml:3: unknown key robot.prest; allowed are preset, ur_calibration, urdf, "
        "convention, dh, maker, axes_sign, axes_offset_deg, limits_deg, total_mass_kg, mass_kg, "
        "centre_of_mass_mm, joint_map, stiffness_Nm_per_rad, gravity_m_per_s2, "
        "link_radius_mm. Try: robot.preset."
    ),
    UR5 + "[payload]\nmass = 3\n": (
        "cell.toml:5: unknown key payload.mass; allowed are mass_kg, centre_of_mass_mm. "
        "Try: payload.mass_kg."
    ),
    UR5 + "[spindle]\nx = 1\n": (
        "cell.toml:4: unknown key spindle; allowed are schema, robot, tool, payload, target, "
        "tracker, repeatability, base, obstacle, controller, registration, part. Try: remove the "
        "key."
    ),
    UR5.replace("1", "2"): (
        "cell.toml:1: schema is 2, expected 1. "
        "Try: update robotrue, or write the file for schema 1."
    ),
    '[robot]\npreset = "UR5"\n': (
        "cell.toml: schema is missing. Try: begin the file with: schema = 1."
    ),
    "schema = 1\n": "cell.toml: robot is missing.",
    "schema = 1\n[robot]\n": (
        "cell.toml:2: [robot] gives no geometry, expected exactly one of: preset; urdf; convention "
        'with dh. Try: preset = "KUKA KR160 R1570".'
    ),
    UR5 + 'urdf = "a.urdf"\n': (
        "cell.toml:3: [robot] gives preset and urdf, expected exactly one of: preset; urdf; "
        'convention with dh. Try: preset = "KUKA KR160 R1570".'
    ),
    DH.replace('convention = "mdh"\n', ""): (
        "cell.toml:2: [robot] gives dh, expected exactly one of: preset; urdf; convention with dh. "
        'Try: preset = "KUKA KR160 R1570".'
    ),
    UR5 + "mass_kg = [1, 2]\n": "cell.toml:4: robot.mass_kg has 2 entries, the robot 6 joints.",
    UR5 + "mass_kg = [1, 2, 3, 4, 5, -6]\n": (
        "cell.toml:4: robot.mass_kg[6] is -6, expected 0 or more."
    ),
    UR5 + "stiffness_Nm_per_rad = [1, 1, 1, 1, 1, 0]\n": (
        "cell.toml:4: robot.stiffness_Nm_per_rad[6] is 0, expected above 0."
    ),
    UR5 + "gravity_m_per_s2 = [0, 0, -9810]\n": (
        "cell.toml:4: robot.gravity_m_per_s2 has length 9810 m/s^2, expected 9.7 to 9.9 (or 0). "
        "Try: [0, 0, -9.80665] for a robot on the floor."
    ),
    DH.replace("400", "0.4").replace("25}", "0.025}"): (
        "cell.toml:4: the DH lengths add up to 0.425 mm, expected 50 to 20000 mm. "
        "Try: check whether d_mm and a_mm were written in metres."
    ),
    DH.replace("a_mm = 25", "a_mm = nan"): (
        "cell.toml:4: robot.dh[2].a_mm is nan, expected a finite number."
    ),
    DH.replace("mdh", "craig"): (
        "cell.toml:3: robot.convention is 'craig', expected 'dh' or 'mdh'."
    ),
    UR5 + "[tool]\nxyz_mm = [1, 2]\n": "cell.toml:5: tool.xyz_mm is [1, 2], expected 3 values.",
    UR5 + '[tool]\nxyz_mm = [1, 2, "3"]\n': (
        "cell.toml:5: tool.xyz_mm[3] is '3', expected a number."
    ),
    UR5 + "[tool]\nxyz_mm = [1, 2, true]\n": (
        "cell.toml:5: tool.xyz_mm[3] is True, expected a number."
    ),
    UR5 + "[target]\n": "cell.toml:4: target.xyz_mm is missing.",
    UR5 + '[tracker]\nframe = "world"\n': (
        "cell.toml:5: tracker.frame is 'world', expected 'base' or 'unknown'."
    ),
    UR5 + "[tracker]\nsigma_um = 0\n": (
        "cell.toml:5: tracker.sigma_um and tracker.sigma_um_per_m are both 0: no instrument is "
        "exact. Try: a laser tracker has about 7.5 um + 2.5 um/m."
    ),
    UR5 + '[[obstacle]]\nname = "jig"\n': (
        "cell.toml:4: obstacle 'jig' gives no shape, expected exactly one of box_mm, sphere_mm, "
        "below_mm. Try: below_mm = [[0, 0, -10], [0, 0, 1]] is the floor."
    ),
    UR5 + "[[obstacle]]\nsphere_mm = [0, 0, 1, 2]\n[[obstacle]]\nsphere_mm = [0, 0, 1]\n": (
        "cell.toml:7: obstacle[2].sphere_mm is [0, 0, 1], expected 4 values."
    ),
    UR5 + "[[obstacle]]\nbox_mm = [[0, 0, 0], [1, 1, 0]]\n": (
        "cell.toml:4: obstacle 'obstacle 1': the box has no volume. Try: two opposite corners that "
        "differ in x, y and z."
    ),
    UR5 + "[target]\nxyz_mm = [0, 0, 50]\nacceptance_deg = 30\n": (
        "cell.toml:4: target.acceptance_deg needs target.axis, the direction of the reflector, "
        "which cannot be zero. Try: axis = [0, 0, 1] for a reflector that looks away from the "
        "flange."
    ),
    UR5 + "[repeatability]\nmm = -1\n": "cell.toml:5: repeatability.mm is -1, expected 0 or more.",
    'schema = 1\nrobot = "UR5"\n': "cell.toml:2: robot is 'UR5', expected a table.",
}


def test_what_planning_asks(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        UR5
        + "[target]\nxyz_mm = [0, 0, 50]\naxis = [0, 0, 2]\nacceptance_deg = 30\n"
        + '[tracker]\nframe = "unknown"\nplace_mm = [3000, 0, 500]\n'
        + "[[obstacle]]\nbox_mm = [[1400, 300, 400], [800, -300, 0]]\n"
        + "[[obstacle]]\nbelow_mm = [[0, 0, -10], [0, 0, 3]]\n"
    )
    cell = read_cell(path)
    assert cell.tracker_position is not None
    np.testing.assert_array_equal(cell.tracker_position, 0.0)
    np.testing.assert_allclose(cell.tracker_place, [3.0, 0.0, 0.5])
    np.testing.assert_array_equal(cell.target_axis, [0.0, 0.0, 1.0])
    assert cell.acceptance == pytest.approx(np.pi / 6)
    box, floor = cell.obstacles
    assert isinstance(box, Box)
    np.testing.assert_allclose(box.low, [0.8, -0.3, 0.0])
    assert isinstance(floor, HalfSpace)
    np.testing.assert_array_equal(floor.normal, [0.0, 0.0, 1.0])


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_message_to_the_letter(tmp_path: Path, text: str) -> None:
    assert complaint(tmp_path, text) == BAD[text]


def test_preset_that_is_not_there(tmp_path: Path) -> None:
    found = complaint(tmp_path, UR5.replace("UR5", "UR7"))
    assert found.startswith("cell.toml:3: ")
    assert "'UR7'" in found
    assert "KUKA KR160 R1570" in found


def test_limits_the_wrong_way_round(tmp_path: Path) -> None:
    found = complaint(tmp_path, DH + "limits_deg = [[1, 2], [2, 1]]\n")
    assert found.startswith("cell.toml:8: limits: every lower joint limit")


@pytest.mark.parametrize(
    ("text", "line"), [("schema = 1\n[robot\n", 2), ("schema = 1\n[robot]\npreset = UR5\n", 3)]
)
def test_not_toml(tmp_path: Path, text: str, line: int) -> None:
    assert complaint(tmp_path, text).startswith(f"cell.toml:{line}: not TOML: ")


def test_cut_off_in_the_middle_of_a_string(tmp_path: Path) -> None:
    assert complaint(tmp_path, UR5[:-3]).startswith("cell.toml:3: not TOML: ")


def test_not_utf8(tmp_path: Path) -> None:
    data = UR5.encode() + "# Träger\n".encode("cp1252")
    assert complaint(tmp_path, data) == (
        "cell.toml:4: byte 0xe4 is not UTF-8. Try: save the file as UTF-8."
    )


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot read"):
        read_cell(tmp_path / "none.toml")


def test_example_is_valid_and_states_the_defaults(tmp_path: Path) -> None:
    text = Path(config.__file__).with_name("example.toml").read_text(encoding="utf-8")
    shown = read_cell(written(tmp_path, text))
    bare = read_cell(written(tmp_path, 'schema = 1\n[robot]\npreset = "KUKA KR160 R1570"\n'))
    for name in ("T_flange_target", "T_base_frame"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(bare, name))
    assert (shown.frame, shown.repeatability) == (bare.frame, bare.repeatability)
    assert (shown.tracker, shown.tracker_position) == (bare.tracker, bare.tracker_position)
    opened = text.replace("# sigma_um", "sigma_um")
    stated = read_cell(written(tmp_path, opened))
    point = np.ones((1, 3))
    np.testing.assert_allclose(tracker_covariance(stated, point), tracker_covariance(bare, point))


def test_cell_made_in_code() -> None:
    cell = Cell(robot=preset("UR5"), frame="tracker")
    assert cell.tracker_position is not None
    with pytest.raises(ShapeError, match="repeatability"):
        Cell(robot=preset("UR5"), repeatability=-1.0)
    with pytest.raises(ShapeError, match="compliance_prior"):
        Cell(robot=preset("UR5"), compliance_prior=np.zeros(5))


def test_the_line_of_a_key_is_found_in_linear_time() -> None:
    def seconds(blanks: int) -> float:
        begun = time.process_time()
        assert line_of_key(f"[robot]\n[{' ' * blanks}\nname = 1\n", ("robot", "name")) == 3
        return time.process_time() - begun

    assert seconds(4_000) < 0.1 + 8.0 * min(seconds(1_000) for _ in range(3))
