"""The model file: what goes in comes out, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.core.archive import read_archive, write_archive
from robotrue.core.units import UM
from robotrue.errors import ArchiveError, FormatError
from robotrue.measurement.tracker import one_sigma
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load
from robotrue.store.model_file import CELL_SCHEMA, read_model, write_model


@pytest.fixture
def cell() -> Cell:
    tool, target = np.eye(4), np.eye(4)
    tool[:3, 3], target[:3, 3] = (0.0, 0.0, 0.2), (0.08, 0.0, 0.05)
    prior = np.full(6, np.nan)
    prior[1] = 5e-7
    return Cell(
        robot=preset("KUKA KR160 R1570").with_tool(tool),
        T_flange_target=target,
        frame="tracker",
        tracker_position=np.array([1.0, 2.0, 0.5]),
        tracker=one_sigma(5 * UM, 2 * UM),
        repeatability=4e-5,
        payload=Load(mass=np.array([30.0]), com=np.array([[0.0, 0.1, 0.2]])),
        compliance_prior=prior,
        source="/somewhere/cell.toml",
        digest="ab" * 32,
    )


@pytest.fixture
def model(cell: Cell) -> CalibratedModel:
    robot = cell.measured_robot
    errors = 1e-4 * np.random.default_rng(1).standard_normal(len(robot.errors))
    return CalibratedModel(
        robot=robot,
        errors=errors,
        covariance=1e-10 * np.eye(len(errors)),
        repeatability=1e-5,
        white=2e-5,
        T_tracker_base={0: np.eye(4)},
        summary={"method": "elastic"},
    )


def test_cell_and_model_come_back(tmp_path: Path, cell: Cell, model: CalibratedModel) -> None:
    write_model(tmp_path / "m.rtm", model, cell)
    back = read_model(tmp_path / "m.rtm")
    np.testing.assert_array_equal(back.model.mean_tables().robot.errors, model.errors)
    for name in ("T_flange_target", "T_base_frame", "tracker_position", "compliance_prior"):
        np.testing.assert_array_equal(getattr(back.cell, name), getattr(cell, name))
    for name in ("frame", "tracker", "repeatability", "digest"):
        assert getattr(back.cell, name) == getattr(cell, name)
    np.testing.assert_array_equal(back.cell.robot.T_flange_tool, cell.robot.T_flange_tool)
    np.testing.assert_array_equal(back.cell.payload.com, cell.payload.com)
    assert back.cell.source == "cell.toml"  # no path of one machine travels with the model


def test_the_cell_file_travels_with_the_model(tmp_path: Path, model: CalibratedModel) -> None:
    frames = "//TOOL 3\n///NAME A\n0.000,0.000,200.000,0.00,0.00,0.00\n"
    text = (
        "# ours\nschema = 1\n[controller]\nfiles = ['saved/TOOL.CND']  # of Monday\n"
        '[robot]\npreset = "kr160"\n[target]\nxyz_mm = [80, 0, 50]\naxis = [0, 0, 1]\n'
        "[[obstacle]]\nsphere_mm = [1, 2, 3, 4]\n"
    )
    (tmp_path / "saved").mkdir()
    (tmp_path / "saved" / "TOOL.CND").write_text(frames)
    (tmp_path / "cell.toml").write_text(text)
    cell = read_cell(tmp_path / "cell.toml")
    write_model(tmp_path / "m.rtm", model, cell)
    back = read_model(tmp_path / "m.rtm").cell
    assert back.text == text.replace("'saved/TOOL.CND'", '"TOOL.CND"')
    assert back.files == {"TOOL.CND": frames.encode()}
    assert back.controller.tools["3"][2, 3] == 0.2
    assert len(back.obstacles) == 1
    np.testing.assert_array_equal(back.target_axis, cell.target_axis)
    # Values that were changed since are written, and nothing of the old text is left.
    changed = replace(cell, repeatability=9e-5)
    write_model(tmp_path / "changed.rtm", model, changed)
    again = read_model(tmp_path / "changed.rtm").cell
    assert again.repeatability == pytest.approx(9e-5)
    assert "of Monday" not in again.text
    np.testing.assert_array_equal(again.controller.tools["3"], cell.controller.tools["3"])


def test_the_same_model_gives_the_same_bytes(
    tmp_path: Path, cell: Cell, model: CalibratedModel
) -> None:
    write_model(tmp_path / "a.rtm", model, cell)
    write_model(tmp_path / "b.rtm", read_model(tmp_path / "a.rtm").model, cell)
    assert (tmp_path / "a.rtm").read_bytes() == (tmp_path / "b.rtm").read_bytes()


def test_a_forged_cell_reads_no_file_of_this_computer(
    tmp_path: Path, cell: Cell, model: CalibratedModel
) -> None:
    robot = '[robot]\npreset = "KUKA KR160 R1570"\n[controller]\nfiles = ["$config.dat"]\n'
    (tmp_path / "cell.toml").write_text(f"schema = 1\n{robot}")
    (tmp_path / "$config.dat").write_text("DEFDAT $CONFIG\nENDDAT\n")
    path = tmp_path / "m.rtm"
    write_model(path, model, read_cell(tmp_path / "cell.toml"))
    archive = read_archive(path)
    stated = archive.document["cell"]
    assert list(stated["files"]) == ["$config.dat"]
    forged = {**stated, "files": {}, "source": str(tmp_path / "cell.toml")}
    write_archive(path, replace(archive, document={**archive.document, "cell": forged}))
    with pytest.raises(ArchiveError, match="did not come with it"):
        read_model(path)


def test_refusals(tmp_path: Path, cell: Cell, model: CalibratedModel) -> None:
    path = tmp_path / "m.rtm"
    write_model(path, model, cell)
    whole = read_archive(path)

    def written(**cell_changes: object) -> Path:
        stated = {**whole.document["cell"], **cell_changes}
        kept = {k: v for k, v in stated.items() if v is not None or k == "tracker_position"}
        write_archive(path, replace(whole, document={**whole.document, "cell": kept}))
        return path

    with pytest.raises(ArchiveError, match=f"reads up to {CELL_SCHEMA}"):
        read_model(written(schema=CELL_SCHEMA + 1))
    with pytest.raises(ArchiveError, match="incomplete"):
        read_model(written(text=None))
    bare = {k: v for k, v in whole.document.items() if k != "cell"}
    write_archive(path, replace(whole, document=bare))
    with pytest.raises(ArchiveError, match="no cell"):
        read_model(path)
    path.write_text("schema = 1\n")
    with pytest.raises(ArchiveError, match="not a model file"):
        read_model(path)
    with pytest.raises(FormatError, match="cannot read"):
        read_model(tmp_path / "gone.rtm")
