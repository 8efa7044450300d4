"""The general reader: units, signs, orientations, layouts, as a mapping states them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.measurement.formats.mapping import ColumnMapping, build_mapping, read_layouts
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.robot.model import Configuration

PLAIN = ColumnMapping(name="shop", joints=("A1", "A2"), position=("X", "Y", "Z"))


def read(folder: Path, text: str | bytes, mapping: ColumnMapping, **options: object):
    path = folder / "shop.txt"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_measurements(path, mapping=mapping, **options)


def test_units_signs_offsets_and_differences(tmp_path: Path) -> None:
    mapping = replace(
        PLAIN,
        joints_unit="rad",
        joints_sign=(-1.0, 1.0),
        joints_offset=(0.5, 0.0),
        position_unit="um",
        position_minus=("dX", "dY", "dZ"),
        position_sign=(1.0, -1.0, 1.0),
        position_offset=(10.0, 0.0, 0.0),
    )
    m = read(tmp_path, "A1 A2 X Y Z dX dY dZ\n0.1 0.2 100 200 300 1 2 3\n", mapping)
    np.testing.assert_allclose(m.joints, [[0.4, 0.2]])
    np.testing.assert_allclose(m.position / UM, [[109.0, -198.0, 297.0]])


@pytest.mark.parametrize(
    ("form", "values", "expected"),
    [
        ("rz_ry_rx", (10, 20, 30), Rotation.from_euler("xyz", [10, 20, 30], degrees=True)),
        ("rx_ry_rz", (10, 20, 30), Rotation.from_euler("XYZ", [10, 20, 30], degrees=True)),
        ("rotation_vector", (10, 20, 30), Rotation.from_rotvec([10, 20, 30], degrees=True)),
        ("abc", (30, 20, 10), Rotation.from_euler("xyz", [10, 20, 30], degrees=True)),
        ("wpr", (10, 20, 30), Rotation.from_euler("xyz", [10, 20, 30], degrees=True)),
        ("oat", (10, 20, 30), Rotation.from_euler("ZYZ", [10, 20, 30], degrees=True)),
        ("wxyz", (0.5, 0.5, -0.5, 0.5), Rotation.from_quat([0.5, -0.5, 0.5, 0.5])),
        ("xyzw", (0.5, 0.5, -0.5, 0.5), Rotation.from_quat([0.5, 0.5, -0.5, 0.5])),
    ],
)
def test_orientation_forms(
    tmp_path: Path, form: str, values: tuple[float, ...], expected: Rotation
) -> None:
    names = tuple("abcd"[: len(values)])
    mapping = replace(PLAIN, rotation=names, rotation_form=form)
    head = " ".join(("A1 A2 X Y Z", *names))
    m = read(tmp_path, f"{head}\n1 2 3 4 5 {' '.join(map(str, values))}\n", mapping)
    np.testing.assert_allclose(m.rotation[0], expected.as_matrix(), atol=1e-12)


@pytest.mark.parametrize(
    ("form", "order"), [("rz_ry_rx", "xyz"), ("rx_ry_rz", "XYZ"), ("oat", "ZYZ")]
)
def test_orientation_covariance_is_that_of_the_angles(
    tmp_path: Path, form: str, order: str
) -> None:
    names = ("a", "b", "c")
    mapping = replace(PLAIN, rotation=names, rotation_form=form, rotation_std=("sa", "sb", "sc"))
    angles, std = np.array([10.0, 40.0, -70.0]), np.array([0.01, 0.02, 0.03])
    line = " ".join(str(v) for v in (1, 2, 3, 4, 5, *angles, *std))
    m = read(tmp_path, f"A1 A2 X Y Z a b c sa sb sc\n{line}\n", mapping)
    middle = Rotation.from_euler(order, angles, degrees=True)
    step = 1e-4
    axes = [
        (Rotation.from_euler(order, angles + step * e, degrees=True) * middle.inv()).as_rotvec()
        / (step * DEG)
        for e in np.eye(3)
    ]
    expected = np.transpose(axes) @ np.diag((std * DEG) ** 2) @ np.array(axes)
    np.testing.assert_allclose(m.rotation_covariance[0], expected, rtol=1e-5, atol=1e-12)


def test_quaternion_that_is_none(tmp_path: Path) -> None:
    mapping = replace(PLAIN, rotation=("a", "b", "c", "d"), rotation_form="wxyz")
    with pytest.raises(FormatError, match=r"shop.txt:2: column 'a' is part of a quaternion of"):
        read(tmp_path, "A1 A2 X Y Z a b c d\n1 2 3 4 5 1 1 0 0\n", mapping)


def test_constants_stand_in_for_columns(tmp_path: Path) -> None:
    mapping = replace(
        PLAIN,
        force=("FX", "FY", "FZ"),
        station=("station",),
        constants={"FX": 0.0, "FY": 0.0, "FZ": -300.0, "station": 2.0},
    )
    m = read(tmp_path, "A1,A2,X,Y,Z\n1,2,3,4,5\n", mapping)
    assert m.wrench[0].tolist() == [0, 0, -300, 0, 0, 0]
    assert m.station.tolist() == [2]


def test_without_header_and_after_a_preamble(tmp_path: Path) -> None:
    mapping = ColumnMapping(
        name="bare", joints=("2", "3"), position=("4", "5", "6"), header=False, skip_lines=2
    )
    m = read(tmp_path, "Instrument 7\nno date\n99;1;2;3,5;4;5\n98;1;2;3;4;6\n", mapping)
    np.testing.assert_allclose(m.position[0] / MM, [3.5, 4, 5])
    assert m.source_row.tolist() == [3, 4]


def test_old_code_page_in_the_header_only(tmp_path: Path) -> None:
    text = "A1 [°],A2 [°],X,Y,Z\n1,2,3,4,5\n"
    mapping = replace(PLAIN, joints=("A1 [°]", "A2 [°]"))
    assert len(read(tmp_path, text.encode("cp1252"), mapping)) == 1
    named = replace(mapping, set_name=("Z",))
    data = text.replace("5\n", "Süd\n").encode("cp1252")
    with pytest.raises(FormatError, match=r"shop.txt:2: byte 0xfc is not UTF-8"):
        read(tmp_path, data, named)
    mapping = replace(
        named, encoding="cp1252", position=("X", "Y", "zero"), constants={"zero": 0.0}
    )
    assert read(tmp_path, data, mapping).group_names == ("Süd",)
    with pytest.raises(FormatError, match="no encoding 'utf-9'"):
        read(tmp_path, data, replace(mapping, encoding="utf-9"))


def test_sets_become_groups(tmp_path: Path) -> None:
    mapping = replace(PLAIN, set_name=("block",))
    m = read(tmp_path, "A1,A2,X,Y,Z,block\n1,2,3,4,5,b\n1,2,3,4,6,a\n1,2,3,4,7,b\n", mapping)
    assert m.group_names == ("b", "a")
    assert m.group.tolist() == [0, 1, 0]
    assert len(m.sources) == 2


def test_instrument_and_frame_come_from_the_caller(tmp_path: Path) -> None:
    m = read(
        tmp_path,
        "A1,A2,X,Y,Z\n1,2,3,4,5\n",
        PLAIN,
        frame="tracker",
        instrument=lambda p: np.tile(np.eye(3) * 4e-10, (len(p), 1, 1)),
    )
    assert m.frame == "tracker"
    np.testing.assert_allclose(m.covariance[0], 4e-10 * np.eye(3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": ()}, "names no joint columns"),
        ({"position": ("X",)}, "position names 1 columns, expected 3"),
        ({"rotation": ("a", "b", "c"), "rotation_form": "wxyz"}, "rotation names 3 columns"),
        ({"joints_sign": (1.0,)}, "joints_sign needs 2 values"),
        ({"position_sign": ()}, "position_sign needs 3 values"),
        ({"joints_unit": "grad"}, "joints_unit is 'grad', allowed: deg, rad"),
        ({"position_unit": "ft"}, "position_unit is 'ft', allowed: mm, m, um, inch"),
        ({"factors": {"colour": 2.0}}, "factor 2.0 of 'colour', expected a number for one of"),
        ({"axes": "controller", "joints_offset": (0.0, 1.0)}, "the robot's own relation"),
        ({"optional": ("colour",)}, "no group 'colour' to leave out"),
    ],
)
def test_mapping_that_cannot_be(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        replace(PLAIN, **change)


def test_unknown_layout_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no measurement layout 'faro'; known are canon"):
        read_measurements(tmp_path / "x.csv", mapping="faro")
    assert set(read_layouts()) == {"ur10-landgraf", "ur10-landgraf-std", "ur5-jacobi"}


def test_comments_units_and_two_header_lines(tmp_path: Path) -> None:
    text = (
        "// tracker export\n% by hand\n;made on Monday\nA1;A2;Nominal;;;Actual;;\n;;X;Y;Z;X;Y;Z\n"
        "deg;deg;m;m;m;m;m;m\n# pause\n1;2;3;4;5;3,5;4;5\n"
    )
    mapping = replace(
        PLAIN,
        position=("Actual X", "Actual Y", "Actual Z"),
        position_unit="m",
        header_lines=2,
    )
    m = read(tmp_path, text, mapping)
    np.testing.assert_allclose(m.position, [[3.5, 4, 5]])
    assert m.source_row.tolist() == [8]
    with pytest.raises(FormatError, match=r"shop.txt:5: column 'Actual X' is in m by the row of u"):
        read(tmp_path, text, replace(mapping, position_unit="mm"))


def test_a_semicolon_before_numbers_is_a_blank_cell(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"shop.txt:3: column 'A1' is blank"):
        read(tmp_path, "A1;A2;X;Y;Z\n1;2;3;4;5\n;2;3;4;5\n", PLAIN)
    assert len(read(tmp_path, "A1,A2,X,Y,Z\n1,2,3,4,5\n; 1 2\n", PLAIN)) == 1


def test_factors_and_inverse_quaternions(tmp_path: Path) -> None:
    mapping = replace(
        PLAIN,
        position_unit="inch",
        position_std=("U", "U", "U"),
        factors={"position_std": 0.5},
        rotation=("a", "b", "c", "d"),
        rotation_form="xyzw",
        rotation_inverse=True,
    )
    turn = Rotation.from_euler("XYZ", [10, 20, 30], degrees=True)
    quaternion = " ".join(f"{value:.9f}" for value in turn.inv().as_quat())
    m = read(tmp_path, f"A1 A2 X Y Z U a b c d\n1 2 1 2 3 2e-3 {quaternion}\n", mapping)
    np.testing.assert_allclose(m.position[0] / MM, [25.4, 50.8, 76.2])
    np.testing.assert_allclose(m.covariance[0], (25.4e-6) ** 2 * np.eye(3))
    np.testing.assert_allclose(m.rotation[0], turn.as_matrix(), atol=1e-8)


def test_a_further_joint_is_not_cut_off(tmp_path: Path) -> None:
    text = "A1 A2 A3 X Y Z\n1 2 3 4 5 6\n"
    with pytest.raises(FormatError, match=r"column 'a3' continues the joints A1 to A2, of which"):
        read(tmp_path, text, PLAIN)
    assert read(tmp_path, text, replace(PLAIN, ignore=("A3",))).dof == 2


def test_one_column_needs_no_list() -> None:
    stated = {"name": "shop", "joints": ["A1"], "position": ["X", "Y", "Z"], "target": "target"}
    assert build_mapping(stated).target == ("target",)


def test_axes_of_the_controller_count_as_the_robot_says(tmp_path: Path) -> None:
    mapping = replace(PLAIN, axes="controller")
    text = "A1 A2 X Y Z\n10 -80 3 4 5\n"
    controller = Configuration(sign=-np.ones(2), offset=np.array([0.0, -90.0]) * DEG)
    m = read(tmp_path, text, mapping, relation=controller.to_model)
    np.testing.assert_allclose(m.joints / DEG, [[-10.0, -10.0]])
    with pytest.raises(FormatError, match="A1, A2 are axes of the controller, and no robot states"):
        read(tmp_path, text, mapping)
