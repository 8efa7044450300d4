"""The factory calibration of an arm of Universal Robots as its nominal geometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.calibration.archive import open_model
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.settings import FitSettings
from robotrue.cell.cell_text import cell_text, portable_text
from robotrue.cell.config import parse_cell
from robotrue.errors import ConfigurationError, FormatError
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice, same_geometry
from robotrue.robot.presets import preset
from robotrue.robot.ur_calibration import FIELDS, JOINTS, kinematics_yaml, read_ur_calibration
from robotrue.robot.urdf_writer import joint_origins, xyz_rpy

# An arm's DH errors in the test of the driver (ur_calibration/test/calibration_test.cpp), and the
# frames that its algorithm gives for them, in the driver's order of the angles.
DELTA = {
    "d": [-0.000144894975118076141, 303.469135666158195, -309.88394307789747, 6.41459904397394975,
          -4.48232900190081995e-05, -0.00087071402790364627],
    "a": [0.000108651068627930392, 0.240324175250532346, 0.00180628180213493472,
          2.63076149165684402e-05, 3.96638632500012715e-06, 0.0],
    "theta": [1.59613525316931737e-07, -0.917209621528830232, 7.12936131346499469,
              0.0710299029424392298, -1.64258976526054923e-06, 9.17286101034808787e-08],
    "alpha": [-0.000444781952841921679, -0.00160215112531214153, 0.00631917793331091861,
              -0.00165055247340828437, 0.000763682515545038854, 0.0],
}  # fmt: skip


def written(rows: list[list[float]]) -> str:
    """The rows x, y, z, roll, pitch, yaw of six joints in the form of the driver."""
    lines = ["kinematics:"]
    for joint, row in zip(JOINTS, rows, strict=True):
        lines.append(f"  {joint}:")
        lines += [f"    {key}: {float(value)!r}" for key, value in zip(FIELDS, row, strict=True)]
    return "\n".join([*lines, "  hash: calib_17227329492635474227", ""])


ROWS = [
    [0, 0, 0.12715510502488192, -0.0, 0, 1.5961352550775132e-07],
    [0.00010865106862793039, 0, 0, 1.5703515448420546, 0, 0.0009050561953758418],
    [-0.6119943513926852, 0, 0, 3.140619636173695, 3.140319811947011, 3.140586817399557],
    [-0.5720053637103267, -0.0010336947411282724, 0.1639907716017143, 0.006303287928559598,
     -0.00044785455103868443, 9.909842534305824e-05],
    [2.630761491656844e-05, -0.11565501916896073, 0.00019089485130455698, 1.5691457743214883, 0,
     -1.6425897650940158e-06],
    [3.966386325000127e-06, 0.09132925933997625, 6.974657207461341e-05, 1.5715600093104416,
     -3.141592653589793, -3.1415925618611826],
]  # fmt: skip
FACTORY = written(ROWS)
# Numbers of default_kinematics.yaml of ur_description.
NOMINAL = written(
    [
        [0, 0, 0.1273, 0, 0, 0],
        [0, 0, 0, 1.570796327, 0, 0],
        [-0.612, 0, 0, 0, 0, 0],
        [-0.5723, 0, 0.163941, 0, 0, 0],
        [0, -0.1157, -2.373046667922381e-11, 1.570796327, 0, 0],
        [0, 0.0922, -1.891053610911353e-11, 1.570796326589793, np.pi, np.pi],
    ]
)
CELL = 'schema = 1\n[robot]\npreset = "UR10"\nur_calibration = "arms/calibration.yaml"\n'
UR10 = preset("UR10")


def joints() -> np.ndarray:
    return np.random.default_rng(5).uniform(-np.pi, np.pi, (500, 6))


def read(text: str, robot: RobotModel = UR10) -> RobotModel:
    return read_ur_calibration(robot, text.encode(), Path("calibration.yaml"))


def distance(one: RobotModel, other: RobotModel) -> float:
    """Largest difference of a matrix entry, m and 1."""
    return float(np.abs(forward(one, joints()) - forward(other, joints())).max())


def test_the_file_of_the_driver_is_the_arm_of_its_dh_table() -> None:
    """The controller's table places axes 2 to 4 hundreds of metres away; the file does not."""
    shifted = {name: getattr(UR10, name) + np.array(rows) for name, rows in DELTA.items()}
    controller = replace(UR10, **shifted)
    arm = read(FACTORY)
    assert distance(arm, controller) < 1e-9
    assert np.abs(arm.d).max() < 0.2
    wrong_order = read(FACTORY + "rotation: Rz(yaw) Ry(pitch) Rx(roll)\n")
    apart = forward(wrong_order, joints())[:, :3, 3] - forward(controller, joints())[:, :3, 3]
    assert np.linalg.norm(apart, axis=1).max() > 1e-3


def test_the_maker_s_nominal_file_is_the_preset() -> None:
    assert distance(read(NOMINAL), UR10) < 1e-9
    assert same_geometry(read(NOMINAL.replace("1.570796327", "1.570796326794896")), UR10)


@pytest.mark.parametrize("name", ["UR5", "UR10"])
def test_what_export_ur_writes_reads_back(name: str) -> None:
    robot, rng = preset(name), np.random.default_rng(3)
    errors = np.zeros(len(robot.errors))
    for group, sd in {"theta": 1e-2, "d": 1e-3, "a": 1e-3, "alpha": 5e-3, "beta": 5e-3}.items():
        errors[parameter_slice(6, group)] = sd * rng.standard_normal(6)
    for group in ("a", "alpha", "beta"):  # behind joint 6: of the tool, not in the file
        errors[parameter_slice(6, group).stop - 1] = 0.0
    bent = robot.with_errors(errors)
    rows = np.array([xyz_rpy(origin) for origin in joint_origins(bent)[0]])
    arm = read(kinematics_yaml(rows), robot)
    assert distance(arm, bent) < 1e-9
    assert not arm.errors.any()
    assert np.abs(arm.theta - errors[:6]).max() < 0.02  # in the parameters of the preset
    again = read(kinematics_yaml(np.array([xyz_rpy(T) for T in joint_origins(arm)[0]])), robot)
    assert distance(again, arm) < 1e-12


def test_the_cell_keeps_the_calibration(tmp_path: Path) -> None:
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "calibration.yaml").write_text(FACTORY)
    files = {"arms/calibration.yaml": FACTORY.encode()}
    cell = parse_cell(CELL.encode(), tmp_path / "cell.toml", files=files)
    assert distance(cell.robot, read(FACTORY)) == 0.0
    assert not same_geometry(cell.robot, UR10)
    text, named = portable_text(cell)
    assert named == {"calibration.yaml": FACTORY.encode()}
    assert 'ur_calibration = "calibration.yaml"' in text
    written = parse_cell(cell_text(cell).encode(), "cell.toml")  # as a table with beta_deg
    assert distance(written.robot, cell.robot) < 1e-12
    assert same_geometry(written.robot, cell.robot)
    assert written.robot.maker == "ur"
    kept = open_model(NominalModel(robot=cell.robot, settings=FitSettings()).to_archive())
    assert isinstance(kept, NominalModel)
    assert same_geometry(kept.robot, cell.robot)


def edited(joint: str, key: str, value: str) -> str:
    """The nominal file with another value."""
    before, _, after = NOMINAL.partition(f"  {joint}:\n")
    lines = after.splitlines()
    lines[FIELDS.index(key)] = f"    {key}: {value}"
    return "\n".join([f"{before}  {joint}:", *lines, ""])


BAD_TEXT = {
    r"^calibration.yaml: wrist_3 has no x, ": NOMINAL[: NOMINAL.index("  wrist_3")],
    r"^calibration.yaml: shoulder has no yaw, ": NOMINAL.replace("    yaw: 0.0\n", "", 1),
    r"^calibration.yaml:24: wrist_1.x is 'long', expected a number in m. Try: ": edited(
        "wrist_1", "x", "long"
    ),
    r"wrist_1.yaw is '.nan', expected a number in rad": edited("wrist_1", "yaw", ".nan"),
    r"^calibration.yaml:45: 'rotation: .*' is not expected": NOMINAL + "rotation: Rx Rz Ry\n",
    r":44: 'roll: 1.0' is not expected": NOMINAL.replace("  hash", "    roll: 1.0\n  hash"),
    r":1: '\[robot\]' is not expected here, allowed are kinematics, shoulder": "[robot]\n",
}
BAD_VALUES = {
    r"^calibration.yaml:13: upper_arm.roll is 90 rad, allowed -6.2832 to 6.2832. .* degrees": (
        edited("upper_arm", "roll", "90")
    ),
    r"shoulder.z is 127.3 m, allowed -3 to 3. .* millimetres": edited("shoulder", "z", "127.3"),
    r"^calibration.yaml: shoulder is 53.4 mm and 0.00 deg from that of UR10, allowed are 10 mm": (
        edited("shoulder", "z", "0.1807")
    ),
    r"forearm is 0.0 mm and 180.00 deg from .* 2\.4\.6": edited("forearm", "yaw", "3.1416"),
    r"shoulder is 1.0000 mm and 0.0000 deg off the z axis": edited("shoulder", "x", "0.001"),
}


@pytest.mark.parametrize("message", BAD_TEXT)
def test_a_file_of_another_form_is_refused(message: str) -> None:
    with pytest.raises(FormatError, match=message):
        read(BAD_TEXT[message])


@pytest.mark.parametrize("message", BAD_VALUES)
def test_values_of_another_unit_or_arm_are_refused(message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        read(BAD_VALUES[message])


def test_another_arm_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="for KUKA KR160 R1570 of maker 'kuka', allowed"):
        read(NOMINAL, preset("KUKA KR160 R1570"))
    with pytest.raises(ConfigurationError, match="from that of UR5, allowed"):
        read(NOMINAL, preset("UR5"))
    other = CELL.replace("UR10", "KUKA KR160 R1570").encode()
    with pytest.raises(ConfigurationError, match=r"^cell.toml:4: robot.ur_calibration for KUKA"):
        parse_cell(other, "cell.toml", files={"arms/calibration.yaml": b""})


def test_every_number_of_the_file_moves_the_arm() -> None:
    for row in range(1, 6):
        for column in range(6):
            moved = np.array(ROWS)
            moved[row, column] += 1e-3
            assert distance(read(written(moved.tolist())), read(FACTORY)) > 1e-5
