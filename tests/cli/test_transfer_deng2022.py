"""What ``robotrue transfer --method deng2022`` refuses; a transfer is in tests/docs. SIMULATED."""

from __future__ import annotations

import re

import pandas as pd
import pytest

from robotrue.app.registered import open_model
from robotrue.calibration.deng2022.readings import DengReadings, parse_readings
from robotrue.calibration.deng2022.transfer_gpr import fit_pose_gpr
from robotrue.cell.config import read_cell
from robotrue.core.regions import bound_cylinder
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.planning.information import settings_of
from robotrue.store.model_file import write_model
from robotrue_reproductions.deng2022.design_files import write_design


@pytest.fixture(scope="module")
def design(tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    write_design(folder, "S2A", 1)
    return folder


def transfer(cli, folder, *more, source="source.csv", target="target.csv", spaces=5):
    spaces = () if spaces is None else ("--sub-spaces", spaces)
    return cli("transfer", folder / "cell.toml", folder / target, "--source",
               f"west={folder / source},region", "-o", folder / "new.robotrue", *spaces,
               "--method", "deng2022", *more)  # fmt: skip


def edited(design, name, change, source="target.csv"):
    table = pd.read_csv(design / source, comment="#")
    change(table).to_csv(design / name, index=False)
    return name


def test_source_and_target_that_are_the_same_or_exchanged(cli, design):
    same = transfer(cli, design, target="source.csv")
    assert same.code == 1
    assert "126 of 126 target measurements are source measurements too, the first at line" in (
        same.err
    )
    exchanged = transfer(cli, design, source="target.csv", target="source.csv", spaces=None)
    assert exchanged.code == 1
    assert "the source spans 70 deg, the target only 10 deg" in exchanged.err
    assert "are source and target exchanged?" in exchanged.err


def test_metres_for_millimetres_are_refused_with_both_units(cli, design):
    columns = ["x_mm", "y_mm", "z_mm"]
    name = edited(design, "metres.csv", lambda t: t.assign(**{c: t[c] / 1000 for c in columns}))
    got = transfer(cli, design, target=name)
    assert got.code == 1
    assert "metres were read as millimetres" in got.err


def test_too_few_rows_of_a_region_and_of_a_sub_space(cli, design):
    few = edited(design, "gap.csv", lambda t: t.iloc[[*range(18), *range(32, 80)]])
    got = transfer(cli, design, target=few)
    assert got.code == 1
    assert "2 target poses in sub-space 2 of 5, angles -15 to -5 deg, expected 3 or more" in got.err
    assert "--sub-spaces" in got.err
    small = edited(design, "small.csv", lambda t: t.iloc[::20], "source.csv")
    assert "7 source poses, expected 8 or more" in transfer(cli, design, source=small).err


def test_regions_that_overlap_and_poses_outside(cli, design):
    region = "radius_mm=800..1400,height_mm=700..1200"
    got = transfer(cli, design, "--source-region", f"angle_deg=-40..-25,{region}",
                   "--target-region", f"angle_deg=-30..40,{region}")  # fmt: skip
    assert got.code == 1
    assert "share 5 deg about joint 1; " in got.err
    assert "target poses lie in it, the first at line" in got.err
    got = transfer(cli, design, "--target-region", f"angle_deg=-30..30,{region}")
    assert "target poses lie outside the target region (angle -30 to 30 deg" in got.err
    assert re.search(r"the first, line \d+ of target.csv, at angle [34]\d", got.err)
    got = transfer(cli, design, "--source-region", "x_mm=1..2,y_mm=1..2,z_mm=1..2")
    assert "is a box; the paper's regions turn about joint 1" in got.err


def test_options_that_cannot_be(cli, design):
    alone = cli("transfer", design / "cell.toml", design / "target.csv", "--source",
                f"west={design / 'source.csv'}", "-o", design / "x.robotrue",
                "--rounds", 3)  # fmt: skip
    assert alone.code == 1
    assert "--rounds is an option of --method deng2022; the method is auto" in alone.err
    got = transfer(cli, design, "--reading", "shrink=zero")
    assert "reading 'shrink=zero', expected NAME=VALUE with one of transform, attitude" in got.err
    got = transfer(cli, design, "--reading", "transform=literal")
    assert "eq. 12 multiplies X_sd'" in got.err
    without = cli("transfer", design / "cell.toml", "--source", f"w={design / 'source.csv'}",
                  "-o", design / "x.robotrue", "--method", "deng2022")  # fmt: skip
    assert "no target pose was measured" in without.err


def test_readings_of_texts():
    found = parse_readings(["ridge=fixed", "ridge_value=10", "rounds=3"], attitude="fixed")
    assert found == DengReadings(ridge="fixed", ridge_value=10.0, rounds=3, attitude="fixed")
    with pytest.raises(ConfigurationError, match="rounds='many', expected a number"):
        parse_readings(["rounds=many"])
    with pytest.raises(ConfigurationError, match="shrink_to 'nowhere'; readings are"):
        parse_readings(["shrink_to=nowhere"])


def test_another_payload_than_the_measured_one_is_refused(design, tmp_path):
    """No load enters a model of poses: its error would be silently that of the measured one."""
    text = (design / "cell.toml").read_text()
    cell, rows = read_cell(design / "cell.toml"), read_measurements(design / "source.csv")
    robot, region = cell.measured_robot, bound_cylinder(rows.position)
    model = fit_pose_gpr(robot, rows, region, settings_of(cell))
    write_model(tmp_path / "poses.robotrue", model, cell)
    for mass in ("50", "70"):
        (tmp_path / f"{mass}.toml").write_text(text.replace("mass_kg = 50", f"mass_kg = {mass}"))
    assert open_model(tmp_path / "poses.robotrue", tmp_path / "50.toml")[1] is not None
    with pytest.raises(ModelMismatchError) as refused:
        open_model(tmp_path / "poses.robotrue", tmp_path / "70.toml")
    assert "states 70 kg at (0, 0, 84) mm, and the model was measured under 50 kg" in str(
        refused.value
    )
