"""Exports read back: the same robot, or a refusal that names what would be lost."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from robotrue.calibration.belief import standard_terms
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.terms.term_registry import export_parts
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.report.export_controller import export_controller
from robotrue.report.export_description import export_dh, export_urdf
from robotrue.report.export_losses import mean_position, prepare_export, without
from robotrue.report.export_ur import export_ur
from robotrue.robot.chain import turn_about
from robotrue.robot.forward import forward
from robotrue.robot.makers import count_axes
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load
from robotrue.robot.ur_calibration import kinematics_yaml
from robotrue.robot.urdf_writer import joint_origins

PAYLOAD = Load(mass=np.array([40.0]), com=np.array([[0.0, 0.02, 0.1]]))
RANGE = np.array([[-1.0, -2.0, 0.7, -1.5, -1.2, -2.0], [1.0, -0.7, 2.0, 1.5, 1.2, 2.0]])
ALL = ",".join(tuple(export_parts())).split(",")


def model(name: str = "KUKA KR160 R1570", *, only: tuple[str, ...] = ()) -> CalibratedModel:
    """A calibrated arm with errors of a few tenths of a millimetre in the groups asked for."""
    tool = pose_from_xyz_abc(np.array([0.06, 0.04, 0.25]), np.array([0.3, -0.2, 0.1]))
    robot = preset(name).with_tool(tool)
    rng = np.random.default_rng(8)
    errors = np.zeros(len(robot.errors))
    groups = {"theta": 3e-4, "d": 3e-4, "a": 3e-4, "alpha": 3e-4, "beta": 2e-4, "gear": 1e-4}
    for group, sd in (groups | {"base": 2e-4, "tool": 2e-4}).items():
        if not only or group in only:
            part = parameter_slice(6, group)
            errors[part] = sd * rng.standard_normal(part.stop - part.start)
    if not only or "compliance" in only:
        errors[parameter_slice(6, "compliance")] = [6e-7, 6e-7, 5e-7, 3e-6, 5e-6, 6e-6]
    return CalibratedModel(
        robot=robot, errors=errors, covariance=1e-10 * np.eye(len(errors)), repeatability=1e-5,
        white=0.0, summary={"joint_range_rad": RANGE.tolist()},
    )  # fmt: skip


def learned():
    """The same with ripple, backlash and a smooth residual."""
    plain = model_of(model().belief(), {"joint_range_rad": RANGE.tolist()})
    rng = np.random.default_rng(9)
    waves = 2e-5 * rng.standard_normal(2 * 6 * 2)
    return replace(
        plain,
        terms=standard_terms(6, np.array([1.0, 2.0])),
        values=np.concatenate([waves, np.full(6, 1e-5)]),
    )


def draw(n: int) -> np.ndarray:
    return RANGE[0] + np.random.default_rng(10).random((n, 6)) * (RANGE[1] - RANGE[0])


def chain(text: str, tmp_path: Path) -> SimpleNamespace:
    pin = pytest.importorskip("pinocchio", reason="pip install pin")
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    arm = pin.buildModelFromUrdf(str(path))
    data, frame = arm.createData(), arm.getFrameId("tool0")

    def place(q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(arm, data, q)
        return np.asarray(data.oMf[frame].homogeneous)

    return SimpleNamespace(place=place)


@pytest.mark.parametrize("name", ["KUKA KR160 R1570", "UR10", "Yaskawa GP225"])
def test_the_urdf_in_another_program_is_the_calibrated_rigid_arm(name, tmp_path):
    """1000 random poses, 1e-9 mm, pinocchio against ours."""
    found = prepare_export(model(name), PAYLOAD)
    made = export_urdf(found, lossy=("gear", "compliance"))
    errors = model(name).errors.copy()
    for group in ("gear", "compliance"):
        errors[parameter_slice(6, group)] = 0.0
    ours = forward(model(name).robot.with_errors(errors), draw(1000))
    arm = chain(made.urdf, tmp_path)
    theirs = np.stack([arm.place(q) for q in draw(1000)])
    assert np.abs(theirs[:, :3, 3] - ours[:, :3, 3]).max() < 1e-9 * MM
    assert np.abs(theirs[:, :3, :3] - ours[:, :3, :3]).max() < 1e-12


def test_urdf_and_side_file_together_are_the_whole_mean(tmp_path):
    """Whoever reads both has what the model says, to a nanometre."""
    one = model()
    found = prepare_export(one, PAYLOAD)
    made = export_urdf(found, lossy=("gear", "compliance"))
    side = json.loads(made.side)
    arm = chain(made.urdf, tmp_path)
    robot = one.robot.nominal()
    for q, told in zip(found.joints[:50], found.position[:50], strict=True):
        from robotrue.robot.statics import drive_torque

        torque = drive_torque(robot, q[None], PAYLOAD)[0]
        drive = (1.0 + np.array(side["gear_relative"])) * q
        drive = drive + np.array(side["compliance_rad_per_Nm"]) * torque
        assert arm.place(drive)[:3, 3] == pytest.approx(told, abs=1e-9)


def test_a_lossy_export_is_refused_until_every_part_is_named():
    found = prepare_export(learned(), PAYLOAD)
    assert found.held == ("geometry", "gear", "compliance", "ripple", "backlash")
    with pytest.raises(ConfigurationError, match=r"cannot hold gear \(0\.\d+ mm at most\)"):
        export_urdf(found)
    with pytest.raises(ConfigurationError, match="backlash") as stopped:
        export_urdf(found, lossy=("gear", "compliance", "ripple"))
    assert "compliance (" not in stopped.value.message
    assert stopped.value.hint.startswith("--lossy gear,compliance,ripple,backlash")
    with pytest.raises(ConfigurationError, match="no part 'ripples'"):
        export_urdf(found, lossy=("ripples",))
    assert "<robot" in export_urdf(found, lossy=ALL).urdf
    with pytest.raises(ConfigurationError, match="geometry"):
        export_controller(found, lossy=("gear", "compliance", "ripple", "backlash"))


def test_what_is_lost_is_as_large_as_the_file_says():
    found = prepare_export(model(), PAYLOAD)
    made = export_urdf(found, lossy=("gear", "compliance"))
    off = found.position - forward(made.robot, found.joints)[:, :3, 3]
    largest = np.linalg.norm(off, axis=1).max() / MM
    assert f"{largest:.4f} mm at most, over poses" in made.urdf
    side = json.loads(made.side)
    assert side["together_largest_mm"] == pytest.approx(largest)
    assert [x["part"] for x in side["left_out"]] == ["gear", "compliance"]


def test_nothing_lost_nothing_asked():
    found = prepare_export(
        model(only=("theta", "d", "a", "alpha", "beta", "base", "tool")), PAYLOAD
    )
    made = export_urdf(found)
    assert "The export contains the whole model." in made.urdf
    assert made.total.largest < 1e-12


def test_the_means_tables_are_the_model():
    for one in (model(), learned()):
        found = prepare_export(one, PAYLOAD)
        told = mean_position(without(found.tables, ("backlash",)), found.joints, PAYLOAD)
        assert told == pytest.approx(found.position, abs=1e-12)


def test_the_dh_table_read_back_is_the_arm():
    found = prepare_export(model(), PAYLOAD)
    made = export_dh(found)
    lines = [line for line in made.text.splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
    joints = rows[:6]

    def column(name: str, unit: float) -> np.ndarray:
        return np.array([float(row[name]) * unit for row in joints])

    def frame(row: dict[str, str]) -> np.ndarray:
        xyz = np.array([float(row[f"{a}_mm"]) for a in "xyz"]) * MM
        abc = np.array([float(row[f"{a}_deg"]) for a in "abc"]) * DEG
        return pose_from_xyz_abc(xyz, abc)

    nominal = preset("KUKA KR160 R1570")
    errors = np.zeros(len(nominal.errors))
    errors[parameter_slice(6, "beta")] = column("beta_deg", DEG)
    errors[parameter_slice(6, "gear")] = column("gear", 1.0)
    read = RobotModel(
        name="read", convention="dh", theta=column("theta_deg", DEG), d=column("d_mm", MM),
        a=column("a_mm", MM), alpha=column("alpha_deg", DEG), T_flange_tool=frame(rows[7]),
        errors=errors,
    )  # fmt: skip
    ours = model()
    flexible = ours.errors.copy()
    flexible[parameter_slice(6, "compliance")] = 0.0
    expected = forward(ours.robot.with_errors(flexible), draw(200))
    got = frame(rows[6]) @ forward(read, draw(200))
    assert np.abs(got - expected).max() < 1e-12
    assert made.total.largest < 1e-12
    assert made.as_rigid.largest > 1e-4


def test_the_controller_sheet_takes_what_zeros_tool_and_base_can():
    """An arm with nothing else wrong is taken whole; another is taken better than not at all."""
    simple = prepare_export(model(only=("theta", "base", "tool")), PAYLOAD)
    made = export_controller(simple)
    assert made.total.largest < 1e-9
    assert made.before.largest > 1e-4
    whole = export_controller(prepare_export(model(), PAYLOAD), lossy=ALL)
    assert whole.total.rms < 0.7 * whole.before.rms
    assert [x.name for x in whole.lost] == ["geometry", "gear", "compliance"]
    assert f"{whole.total.rms / MM:.4f} mm rms" in whole.text()
    assert json.loads(whole.json())["cannot_take"] == ["geometry", "gear", "compliance"]


def test_the_zeros_are_in_the_controllers_sense():
    """KR160: A = -q + offset; joint 2 truly 1 mrad further than commanded is A2 1 mrad less."""
    one = model(only=("none",))
    errors = one.errors.copy()
    errors[parameter_slice(6, "theta").start + 1] = 1e-3
    made = export_controller(prepare_export(replace(one, errors=errors), PAYLOAD))
    zeros = made.document["joint_zero_offset_deg"]
    assert zeros["A2"] == pytest.approx(-1e-3 / DEG, abs=1e-6)
    assert zeros["A3"] == pytest.approx(0.0, abs=1e-6)


def test_a_model_without_a_range_is_refused():
    with pytest.raises(ModelMismatchError, match="no parameters"):
        prepare_export(replace(model(), summary={}))


def kinematics(text: str) -> np.ndarray:
    """Base to each joint (6, 4, 4) of a file for ROS and its tool, read by another YAML reader."""
    yaml = pytest.importorskip("yaml", reason="pip install pyyaml")
    read = yaml.safe_load(text)["kinematics"]
    assert re.fullmatch(r"calib_[0-9]{1,20}", read.pop("hash"))
    assert list(read) == ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"]
    values = [
        [row[key] for key in ("x", "y", "z", "roll", "pitch", "yaw")] for row in read.values()
    ]
    tool = re.search(r"^# tool in wrist_3.*: x (.*)$", text, re.M)
    assert tool is not None
    values.append([float(part.split()[-1]) for part in tool[1].split(",")])
    assert all(isinstance(value, float) for row in values for value in row)
    return np.stack([origin_of(np.array(row)) for row in values])


def origin_of(row: np.ndarray) -> np.ndarray:
    T = turn_about(2, row[5]) @ turn_about(1, row[4]) @ turn_about(0, row[3])
    T[:3, 3] = row[:3]
    return T


def along(origins: np.ndarray, joints: np.ndarray) -> np.ndarray:
    T = np.eye(4)
    for i in range(6):
        T = T @ origins[i] @ turn_about(2, joints[:, i])
    return T @ origins[6]


@pytest.mark.parametrize("name", ["UR5", "UR10"])
def test_the_kinematics_for_ros_in_another_reader_are_the_calibrated_rigid_arm(name):
    found = prepare_export(model(name), PAYLOAD)
    made = export_ur(found, lossy=("gear", "compliance"))
    errors = model(name).errors.copy()
    for group in ("gear", "compliance"):
        errors[parameter_slice(6, group)] = 0.0
    ours = forward(model(name).robot.with_errors(errors), draw(200))
    assert np.abs(along(kinematics(made.text), draw(200)) - ours).max() < 1e-12
    off = forward(made.robot, found.joints)[:, :3, 3] - found.position
    assert made.total.largest == pytest.approx(np.linalg.norm(off, axis=1).max())
    assert made.nominal_tool.rms > made.total.rms
    assert "# Left out: compliance" in made.text
    other = export_ur(prepare_export(replace(model(name), errors=1.01 * errors)))
    assert other.text.split("calib_")[1] != made.text.split("calib_")[1]


@pytest.mark.parametrize(
    ("name", "z", "x", "wrist"),
    [
        ("UR5", 0.089159, (-0.425, -0.39225), (0.10915, -0.09465, 0.0823)),
        ("UR10", 0.1273, (-0.612, -0.5723), (0.163941, -0.1157, 0.0922)),
    ],
)
def test_the_nominal_kinematics_for_ros_are_those_of_the_maker(name, z, x, wrist):
    """Lengths of ur_description; each frame is where its meshes are placed."""
    robot = preset(name)
    origins, links = joint_origins(robot)
    half = np.pi / 2.0
    expected = [
        [0.0, 0.0, z, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, half, 0.0, 0.0],
        [x[0], 0.0, 0.0, 0.0, 0.0, 0.0],
        [x[1], 0.0, wrist[0], 0.0, 0.0, 0.0],
        [0.0, wrist[1], 0.0, half, 0.0, 0.0],
        [0.0, wrist[2], 0.0, half, np.pi, np.pi],
    ]
    theirs = np.stack([origin_of(np.array(row)) for row in expected])
    assert np.abs(origins - theirs).max() < 1e-12
    assert np.abs(links[-1] - np.eye(4)).max() < 1e-12
    assert np.abs(forward(robot, draw(50)) - along([*theirs, np.eye(4)], draw(50))).max() < 1e-6


def test_kinematics_for_ros_are_of_an_arm_of_universal_robots_alone():
    with pytest.raises(ConfigurationError, match=r"maker 'kuka', .* arms of maker 'ur'"):
        export_ur(prepare_export(model()), lossy=ALL)
    turned = replace(model("UR10"), robot=replace(
        model("UR10").robot, controller=count_axes("ur", 6, offset=np.full(6, 0.1))
    ))  # fmt: skip
    with pytest.raises(ConfigurationError, match="angles other than those its controller displays"):
        export_ur(prepare_export(turned), lossy=ALL)
    with pytest.raises(ConfigurationError, match=r"cannot hold gear .* compliance"):
        export_ur(prepare_export(model("UR10"), PAYLOAD))
    text = kinematics_yaml(np.full((6, 6), 1e-17))
    assert "x: 1.0e-17" in text  # YAML 1.1 takes 1e-17 for a word
