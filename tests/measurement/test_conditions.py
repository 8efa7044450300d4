"""Columns of temperature, time and external axes, and rows along a rail."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.conditions import ArmConditions, Rail, no_conditions
from robotrue.core.units import DEG, ZERO_CELSIUS
from robotrue.errors import FormatError, ShapeError
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.measured_files import read_measurements, read_queries
from robotrue.measurement.measurement_set import MeasurementSet, concatenate

JOINTS = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg"
HEADER = f"{JOINTS},x_mm,y_mm,z_mm"
ROW = "10,20,30,40,50,60,1289.5,334.9,1027.3"


def written(folder: Path, text: str) -> Path:
    path = folder / "meas.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_temperatures_of_arm_and_joints_time_and_external_axes(tmp_path: Path) -> None:
    warm = ",".join(f"temperature{i}_C" for i in range(1, 7))
    names = f"{HEADER},temperature_C,{warm},time_s,e1_mm,e3_deg"
    text = f"{names}\n{ROW},20,21,22,23,24,25,26,90.5,1500,30\n"
    rows = read_measurements(written(tmp_path, text))
    np.testing.assert_allclose(rows.joint_temperature[0] - ZERO_CELSIUS, np.arange(21.0, 27.0))
    stated = rows.conditions
    np.testing.assert_allclose(stated.temperature, rows.joint_temperature)
    assert stated.time.tolist() == [90.5]
    np.testing.assert_allclose(rows.external[0, [0, 2]], [1.5, 30.0 * DEG])
    assert np.isnan(rows.external[0, [1, 3, 4, 5]]).all()
    asked = read_queries(tmp_path / "meas.csv")
    np.testing.assert_array_equal(asked.conditions.external, rows.external)


def test_of_measured_points_the_rail_alone_is_a_condition(tmp_path: Path) -> None:
    rows = read_measurements(written(tmp_path, f"{HEADER},e1_mm,e3_deg\n{ROW},1500,30\n"))
    assert np.isnan(rows.conditions.external).all()
    railed = replace(rows, rail=Rail(number=1, direction=np.eye(3)[1]))
    np.testing.assert_array_equal(railed.conditions.external[0], [1.5, *5 * [np.nan]])


def test_without_columns_nothing_is_stated(tmp_path: Path) -> None:
    stated = read_measurements(written(tmp_path, f"{HEADER}\n{ROW}\n")).conditions
    assert stated.temperature.shape == (1, 1)
    assert np.isnan(stated.temperature).all()
    assert np.isnan(stated.time).all()
    assert np.isnan(stated.external).all()


def test_time_stamps_count_from_1970_in_utc(tmp_path: Path) -> None:
    text = f"{HEADER},timestamp\n{ROW},1970-01-01T00:01:00\n{ROW},1970-01-01T03:00:30+02:00\n"
    rows = read_measurements(written(tmp_path, text))
    assert rows.time.tolist() == [60.0, 3630.0]
    with pytest.raises(FormatError, match=r":2: column 'timestamp' is 'noon', expected as 2026"):
        read_measurements(written(tmp_path, f"{HEADER},timestamp\n{ROW},noon\n"))


def test_a_foreign_file_names_its_columns(tmp_path: Path) -> None:
    mapping = ColumnMapping(
        name="log",
        joints=tuple(JOINTS.split(",")),
        position=("x_mm", "y_mm", "z_mm"),
        temperature=("arm",),
        external=("", "table_deg"),
    )
    path = written(tmp_path, f"{HEADER},arm,table_deg\n{ROW},22,90\n")
    rows = read_measurements(path, mapping=mapping)
    np.testing.assert_allclose(rows.external[0, 1], np.pi / 2.0)
    assert np.isnan(rows.external[0, 0])
    path = written(tmp_path, f"{HEADER},arm,table\n{ROW},22,90\n")
    with pytest.raises(FormatError, match="column 'table' of an external axis has no unit"):
        read_measurements(path, mapping=replace(mapping, external=("", "table")))


@pytest.mark.parametrize("frame", ["base", "tracker"])
def test_a_rail_is_written_as_the_floor_sees_it(tmp_path: Path, frame: str) -> None:
    rail = Rail(number=2, direction=np.array([0.0, 1.0, 0.0]), at=0.5)
    external = np.full((3, 6), np.nan)
    external[:, 1] = [0.5, 1.0, 2.5]
    rows = MeasurementSet(
        joints=np.arange(18.0).reshape(3, 6) / 10.0,
        position=np.arange(9.0).reshape(3, 3),
        covariance=np.tile(1e-10 * np.eye(3), (3, 1, 1)),
        frame=frame,
        external=external,
        rail=rail,
    )
    write_canonical(tmp_path / "rows.csv", rows)
    again = read_measurements(tmp_path / "rows.csv", frame=frame)
    np.testing.assert_allclose(again.external[:, 1], external[:, 1])
    moved = np.array([0.0, 0.5, 2.0])
    floor = rows.position + (frame == "base") * moved[:, None] * rail.direction
    np.testing.assert_allclose(again.position, floor, atol=1e-12)
    np.testing.assert_allclose(rows.carried[:, 1], (frame == "tracker") * moved)
    assert concatenate([rows, rows]).rail is rail
    with pytest.raises(ShapeError, match="rail differs"):
        concatenate([rows, again])


def test_one_row_of_conditions_stands_for_all() -> None:
    assert len(no_conditions().spread(4)) == 4
    assert len(ArmConditions(temperature=np.full((4, 1), 290.0)).spread(4)) == 4
    with pytest.raises(ShapeError, match="conditions of 2 postures, expected 1 or 4"):
        no_conditions(2).spread(4)
