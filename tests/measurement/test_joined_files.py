"""A joint list and a list of points become rows: by order, by name, by time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.measurement.formats.joint_literals import read_joint_literals
from robotrue.measurement.formats.mapping import ColumnMapping, build_mapping
from robotrue.measurement.formats.measured_files import open_sheet
from robotrue.measurement.formats.table import read_table
from robotrue.measurement.measurement_set import MeasurementSet

TABLE = "Punkt;A1;A2;t\nP1;1,5;2;10,0\nP2;3;4;20,1\n\nP3;5;6;30,2\n"
POINTS = "Name,X,Y,Z,Time\nP3,31,32,33,00:00:32.7\nP1,11,12,13,00:00:12.5\nP2,21,22,23,00:00:22.6\n"
RAPID = """MODULE poses
  ! CONST jointtarget old:=[[9,9,9,9,9,9],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST jointtarget p1:=[[10,-20,30.5,0,45,-90],[9E9,9E9,9E9,9E9,9E9,9E9]];
  MoveAbsJ [[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;
ENDMODULE
"""
KRL = "DECL E6AXIS XP1={A1 10,A2 -20,A3 30.5,A4 0,A5 45,A6 -90,E1 0.0}\n;DECL E6AXIS X={A1 1}\n"
FANUC = """/POS
P[1:"home"]{
   GP1:
  UF : 0, UT : 1,
  J1=    10.000 deg, J2=   -20.000 deg, J3=    30.500 deg,
  J4=     0.000 deg, J5=    45.000 deg, J6=   -90.000 deg
};
P[2]{
   GP1:
  UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',
  X =   500.0  mm, Y = 0.0 mm, Z = 1.0 mm, W = 0.0 deg, P = 0.0 deg, R = 0.0 deg
};
"""
UR = """def poses():
  # q0 = [0,0,0,0,0,0]
  p1 = [0.1, -0.2, 0.3, 0, 0.5, -1.5]
  movej([1,2,3,4,5,6])
"""


def read(folder: Path, **joint_list: object) -> tuple[MeasurementSet, tuple[str, ...]]:
    mapping = build_mapping(
        {
            "name": "run",
            "joints": ["A1", "A2"],
            "position": ["X", "Y", "Z"],
            "joint_list": {"file": "joints.csv", **joint_list},
        },
        folder / "run.toml",
    )
    sheet, mapping = open_sheet(folder / "points.csv", mapping)
    return read_table(sheet, mapping), sheet.remarks


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "joints.csv").write_text(TABLE)
    (tmp_path / "points.csv").write_text(POINTS)
    return tmp_path


def x_of_joints(rows: MeasurementSet) -> dict[float, float]:
    return dict(
        zip(
            np.round(rows.joints[:, 0] / DEG, 6), np.round(rows.position[:, 0] / MM, 6), strict=True
        )
    )


def test_rows_in_the_same_order(folder: Path) -> None:
    rows, remarks = read(folder)
    assert x_of_joints(rows) == {1.5: 31.0, 3.0: 11.0, 5.0: 21.0}
    assert remarks == ("3 rows joined by their order",)
    assert rows.source_row.tolist() == [2, 3, 4]
    assert {file.name for file in rows.provenance.files} == {"joints.csv", "points.csv"}


def test_counts_that_differ_are_refused_with_both(folder: Path) -> None:
    (folder / "joints.csv").write_text(TABLE + "P4;7;8;40\n")
    with pytest.raises(FormatError, match=r"4 rows of joints, 3 rows of points in points.csv"):
        read(folder)


def test_rows_of_the_same_name(folder: Path) -> None:
    (folder / "points.csv").write_text(POINTS + "P1,11.1,12,13,50\nM1,1,1,1,60\n")
    rows, remarks = read(folder, by="name", joint_column="Punkt", point_column="Name")
    assert rows.position[:, 0].tolist() == pytest.approx([0.031, 0.011, 0.021, 0.0111])
    assert (rows.joints[:, 0] / DEG).tolist() == pytest.approx([5.0, 1.5, 3.0, 1.5])
    assert remarks == (
        "4 rows joined by name",
        "1 of 5 rows of points.csv have no partner: line 6",
    )
    (folder / "joints.csv").write_text(TABLE + "P2;7;8;40\n")
    with pytest.raises(FormatError, match=r"joints.csv:6: name 'p2' is also on line 3"):
        read(folder, by="name", joint_column="Punkt", point_column="Name")


def test_rows_nearest_in_time_and_the_lag_is_told(folder: Path) -> None:
    columns = {"by": "time", "joint_column": "t", "point_column": "Time", "tolerance_s": 0.5}
    rows, remarks = read(folder, **columns, lag_s=2.4)
    assert x_of_joints(rows) == {5.0: 31.0, 1.5: 11.0, 3.0: 21.0}
    assert remarks[0].startswith("3 rows joined by time within 0.5 s of a lag of 2.400 s: points")
    assert "+2.500 s (median)" in remarks[0]
    with pytest.raises(FormatError, match="no row of 3 has a partner among 3"):
        read(folder, **columns)
    with pytest.raises(ConfigurationError, match="tolerance_s is None, a join by time needs"):
        read(folder, by="time")


def test_a_lag_is_found_where_the_stops_differ(folder: Path) -> None:
    stops: Array = np.array([0.0, 7.0, 19.0, 24.0, 40.0])
    joints = "".join(f"{i};0;{t:.1f}\n" for i, t in enumerate(stops))
    (folder / "joints.csv").write_text("A1;A2;t\n" + joints)
    points = "".join(f"{i},0,0,{t + 3.25:.2f}\n" for i, t in enumerate(stops[1:], 1))
    (folder / "points.csv").write_text("X,Y,Z,t\n" + points)
    stated = {"by": "time", "joint_column": "t", "tolerance_s": 0.5, "lag_s": "find"}
    rows, remarks = read(folder, **stated)
    assert x_of_joints(rows) == {1.0: 1.0, 2.0: 2.0, 3.0: 3.0, 4.0: 4.0}
    assert remarks[1] == "1 of 5 rows of joints.csv have no partner: line 2"
    even = "".join(f"{i};0;{10 * i}\n" for i in range(6))
    (folder / "joints.csv").write_text("A1;A2;t\n" + even)
    (folder / "points.csv").write_text("X,Y,Z,t\n" + even.replace(";0;", ",0,0,"))
    with pytest.raises(FormatError, match=r"the lag is not plain: 0\.000 s joins 6 rows"):
        read(folder, **stated)


@pytest.mark.parametrize(
    ("text", "names", "radians"),
    [
        (RAPID, ("p1", "line 4"), False),
        (KRL, ("XP1",), False),
        (FANUC, ("home",), False),
        (UR, ("p1", "line 4"), True),
    ],
)
def test_joints_written_in_programs(
    tmp_path: Path, text: str, names: tuple[str, ...], radians: bool
) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    found = read_joint_literals(path)
    assert found is not None
    sheet, in_radians = found
    assert (sheet.column("name"), in_radians) == (names, radians)
    first = [0.1, -0.2, 0.3, 0.0, 0.5, -1.5] if radians else [10, -20, 30.5, 0, 45, -90]
    assert [float(cell) for cell in sheet.cells[0][1:]] == first


def test_program_and_points_with_axes_of_the_controller(tmp_path: Path) -> None:
    (tmp_path / "poses.mod").write_text(RAPID)
    (tmp_path / "points.csv").write_text("X,Y,Z\n1,2,3\n4,5,6\n")
    stated = {"position": ["X", "Y", "Z"], "joint_list": {"file": "poses.mod"}}
    mapping = build_mapping({"name": "run", **stated}, tmp_path / "run.toml")
    sheet, mapping = open_sheet(tmp_path / "points.csv", mapping)
    rows = read_table(sheet, mapping, relation=lambda axes: axes + 0.5)
    np.testing.assert_allclose(rows.joints[1], np.arange(1, 7) * DEG + 0.5)


def test_a_literal_of_another_number_of_joints(tmp_path: Path) -> None:
    path = tmp_path / "iiwa.dat"
    path.write_text("DECL E6AXIS P={A1 1,A2 2,A3 3,A4 4,A5 5,A6 6,A7 7}\n")
    with pytest.raises(FormatError, match=r"iiwa.dat:1: 7 joints in a literal of KRL, expected 6"):
        read_joint_literals(path)


def test_a_mapping_without_joints_and_without_a_list() -> None:
    with pytest.raises(ConfigurationError, match="names no joint columns"):
        ColumnMapping(name="x", joints=(), position=("X", "Y", "Z"))


SA_COMMAS = """// SpatialAnalyzer, millimetres
Main,Robot poses,p 2,21,22,23
Main,Robot poses,p 1,11,12,13
// end
Main,Robot poses,p 3,31,32,33
"""
SA_BLANKS = """// SpatialAnalyzer, millimetres
Main  "Robot poses"  "p 2"  21  22  23
Main  Poses          "p 1"  11  12  13
"Main part"  Poses   "p 3"  31  32  33
"""
POLYWORKS_BLANKS = '"p 2" 21.0 22.0 23.0\n"p 1"  11.0 12.0 13.0\n"p 3"  31.0 32.0 33.0\n'
POLYWORKS_TABS = "p 2\t21\t22\t23\t0\t0\t1\np 1\t11\t12\t13\t0\t0\t1\np 3\t31\t32\t33\t0\t1\t0\n"


@pytest.mark.parametrize(
    ("text", "name"),
    [(SA_COMMAS, 3), (SA_BLANKS, 3), (POLYWORKS_BLANKS, 1), (POLYWORKS_TABS, 1)],
)
@pytest.mark.parametrize("by", ["name", "order"])
def test_point_lists_without_a_header(tmp_path: Path, text: str, name: int, by: str) -> None:
    (tmp_path / "points.txt").write_text(text)
    (tmp_path / "joints.csv").write_text("Name;A1;A2\nP 2;2;0\nP 1;1;0\nP 3;3;0\n")
    mapping = build_mapping(
        {
            "name": "run",
            "joints": ["A1", "A2"],
            "position": [str(name + k) for k in (1, 2, 3)],
            "header": False,
            "joint_list": {
                "file": "joints.csv",
                "by": by,
                "joint_column": "Name",
                "point_column": str(name),
            },
        },
        tmp_path / "run.toml",
    )
    rows = read_table(*open_sheet(tmp_path / "points.txt", mapping))
    assert x_of_joints(rows) == {2.0: 21.0, 1.0: 11.0, 3.0: 31.0}
