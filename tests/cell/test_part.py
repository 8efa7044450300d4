"""Part frames in cell.toml, and cells written from model files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import parse_cell, read_cell
from robotrue.cell.part import PartFrame, PartTable, part_tables
from robotrue.cell.toml_edit import (
    PART_HEADING,
    rename_files,
    with_part,
    without_part,
    write_toml,
)
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.measurement.tracker import one_sigma
from robotrue.robot.model import RobotModel, nominal_identity
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load

CELL = """\
# our cell
schema = 1
[robot]
preset = "UR5"   # the small one

[repeatability]
mm = 0.03
"""


def table(*names: str) -> PartTable:
    rng = np.random.default_rng(1)
    half = 1e-4 * rng.standard_normal((6, 6))
    return PartTable(
        frames=tuple(
            PartFrame(
                name=name,
                T_base_part=pose_from_xyz_abc(rng.normal(size=3), rng.uniform(-1.5, 1.5, 3)),
                covariance=half @ half.T,
                touches=9,
                outliers=('K "4"',),
                rms=1.2345e-4,
                verdict="GO",
            )
            for name in names
        ),
        identity=ModelIdentity(kind="calibrated", robot="UR5", sha256="f" * 64),
        method="joint",
        model_file="models/ur5.robotrue",
        points_file="points.csv",
        points_sha256="e" * 64,
    )


def registered(text: str, *names: str) -> str:
    return with_part(text, part_tables(table(*names)))


def text_of(part: PartTable) -> str:
    return PART_HEADING + write_toml(part_tables(part))


def test_written_and_read_back_to_the_last_digit(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(registered(CELL, "front", "back"))
    cell = read_cell(path)
    assert cell.part is not None
    for found, made in zip(cell.part.frames, table("front", "back").frames, strict=True):
        np.testing.assert_allclose(found.T_base_part, made.T_base_part, rtol=0.0, atol=1e-15)
        np.testing.assert_array_equal(found.covariance, made.covariance)
        assert (found.outliers, found.rms) == (made.outliers, pytest.approx(made.rms, rel=1e-15))
    assert cell.part.identity == table("front").identity
    assert cell.part.model_file == "models/ur5.robotrue"
    np.testing.assert_array_equal(cell.T_base_frame, np.eye(4))  # two sides: none is the default


def test_the_only_part_is_the_work_frame(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(registered(CELL + "[base]\nxyz_mm = [1, 2, 3]\n", "block"))
    cell = read_cell(path)
    np.testing.assert_allclose(cell.T_base_frame, table("block").frames[0].T_base_part, atol=1e-15)


def test_registering_again_leaves_one_registration_and_every_other_byte() -> None:
    once = registered(CELL, "front", "back")
    assert once.startswith(CELL)
    assert registered(once, "front", "back") == once
    assert without_part(once) == CELL
    after = once + "\n[base]\nxyz_mm = [0, 0, 1]\n"  # a table somebody added behind
    assert without_part(after) == CELL.rstrip() + "\n\n[base]\nxyz_mm = [0, 0, 1]\n"


@pytest.mark.parametrize(("text", "message"), [
    (CELL + text_of(table("a")).split("[[part]]")[0], r"part frames \[\] with a"),
    (CELL + "[[part]]" + text_of(table("a")).split("[[part]]")[1], "without a .registration"),
    (registered(CELL, "a").replace("[[part]]", "[[part]]\nsize = 1"), "unknown key part"),
    (registered(CELL, "a").replace('"GO"', '"MAYBE"'), "MAYBE"),
    (registered(CELL, "a") + "[[part]]" + text_of(table("a")).split("[[part]]")[1],
     "of different names"),
])  # fmt: skip
def test_half_a_registration_is_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        parse_cell(text.encode(), "cell.toml")


def test_frames_by_name() -> None:
    two = table("front", "back")
    assert two.frame("back").name == "back"
    with pytest.raises(ConfigurationError, match=r"2 part frames: front, back\. Try: --part front"):
        two.frame()
    with pytest.raises(ConfigurationError, match="no part 'top' in the cell; it has front, back"):
        two.frame("top")
    with pytest.raises(ShapeError, match="of different names"):
        table("front", "front")


def test_a_urdf_keeps_its_place() -> None:
    text = 'schema = 1\n[robot]\nurdf = "arm.urdf"  # ours\n'
    moved = rename_files(text, lambda name: "../cells/" + name)
    assert moved == text.replace("arm.urdf", "../cells/arm.urdf")
    assert rename_files(CELL, lambda name: "x") == CELL


def arms() -> list[RobotModel]:
    tool = pose_from_xyz_abc(np.array([0.06, -0.04, 0.25]), np.deg2rad([10.0, 20.0, 30.0]))
    kuka = preset("KUKA KR160 R1570")
    return [
        kuka.with_tool(tool),
        replace(kuka, limits=0.9 * kuka.limits, link_mass=np.arange(6.0)),
        RobotModel(
            name="workshop",
            convention="mdh",
            theta=np.deg2rad([0.0, -90.0, 0.0]),
            alpha=np.deg2rad([0.0, -90.0, 17.123456]),
            d=np.array([0.4, 0.0, 0.123456789]),
            a=np.array([0.0, 0.025, 0.4]),
        ),
    ]


@pytest.mark.parametrize("robot", arms(), ids=lambda robot: f"{robot.name} {robot.dof}")
def test_a_cell_written_is_the_cell_read(robot: RobotModel) -> None:
    cell = Cell(
        robot=robot,
        T_flange_target=pose_from_xyz_abc(np.array([0.01, 0.02, 0.03]), np.zeros(3)),
        target_sigma=1e-3,
        frame="tracker",
        tracker=one_sigma(5e-6, 2e-6),
        repeatability=5e-5,
        payload=Load(mass=np.array([12.5]), com=np.array([[0.0, 0.01, 0.1]])),
        T_base_frame=pose_from_xyz_abc(np.array([1.0, 0.0, 0.5]), np.deg2rad([90.0, 0.0, 180.0])),
        compliance_prior=np.full(robot.dof, 1e-6),
    )
    text = cell_text(cell)
    found = parse_cell(text.encode(), "workshop.toml")
    assert cell_text(found) == text
    assert nominal_identity(found.robot).same(nominal_identity(robot))
    for name in ("T_flange_target", "T_base_frame", "tracker_position", "compliance_prior"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(cell, name), rtol=1e-12, atol=1e-14
        )
    for name in ("T_flange_tool", "limits", "link_mass", "link_com", "gravity"):
        np.testing.assert_allclose(getattr(found.robot, name), getattr(robot, name), atol=1e-13)
    assert (found.frame, found.target_sigma) == ("tracker", pytest.approx(1e-3))
    assert found.tracker.sigma_range(np.array(3.0)) == pytest.approx(11e-6)
    np.testing.assert_allclose(found.payload.com, cell.payload.com, atol=1e-15)


def test_coupled_joints_are_written_with_their_map() -> None:
    robot = replace(preset("ABB IRB 6660-205/1.9"), name="renamed")
    text = cell_text(Cell(robot=robot))
    again = parse_cell(text.encode(), "renamed.toml")
    assert nominal_identity(again.robot).same(nominal_identity(robot))


def test_bounds_that_a_cell_file_cannot_say_are_refused() -> None:
    uneven = replace(one_sigma(5e-6, 2e-6), angle_bound=9e-6)
    with pytest.raises(ConfigurationError, match=r"which cell\.toml cannot hold"):
        cell_text(Cell(robot=preset("UR5"), tracker=uneven))
