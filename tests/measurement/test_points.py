"""POINTS.csv: what is written is read, and how blanks, parts and normals are taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.errors import FormatError
from robotrue.measurement.formats.part_points import read_points, write_points
from robotrue.measurement.probing_set import ProbingSet

RNG = np.random.default_rng(3)
NORMAL = np.array([[np.nan] * 3, [0.0, 0.0, 1.0], [0.6, -0.8, 0.0], [np.nan] * 3])


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize("joints", [True, False])
def test_written_and_read_back(tmp_path: Path, joints: bool) -> None:
    touches = ProbingSet(
        names=("K", "L", "M", "K"),
        point=RNG.normal(size=(4, 3)),
        joints=RNG.normal(size=(4, 6)) if joints else np.empty((0, 0)),
        position=np.empty(0) if joints else RNG.normal(size=(4, 3)),
        normal=NORMAL,
        part=np.array([0, 0, 1, 1]),
    )
    write_points(tmp_path / "p.csv", touches, ("front", "back"))
    found = read_points(tmp_path / "p.csv")
    assert found.parts == ("front", "back")
    assert found.touches.names == touches.names
    assert found.touches.labels == ("K", "L", "M", "K (2)")
    for name in ("point", "joints", "position", "normal", "part"):
        np.testing.assert_allclose(getattr(found.touches, name), getattr(touches, name), rtol=1e-14)
    np.testing.assert_array_equal(found.touches.lines, [2, 3, 4, 5])
    assert found.touches.source == f"p.csv sha256:{found.digest}"


def test_semicolons_decimal_commas_and_any_order(tmp_path: Path) -> None:
    text = "X_mm;y_mm;z_mm;Name;pz_mm;py_mm;px_mm\n1000,5;0;250;K1;3;2,5;1\n"
    found = read_points(written(tmp_path / "p.csv", text)).touches
    np.testing.assert_allclose(found.position, [[1.0005, 0.0, 0.25]])
    np.testing.assert_allclose(found.point, [[0.001, 0.0025, 0.003]])


def test_blank_and_zero_normals_are_full_points(tmp_path: Path) -> None:
    text = (
        "name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm,nx,ny,nz\n"
        "a,1,2,3,4,5,6,,,\nb,1,2,3,4,5,6,0,0,0\nc,1,2,3,4,5,6,0,0,-1\n"
    )
    found = read_points(written(tmp_path / "p.csv", text)).touches
    np.testing.assert_array_equal(found.full, [True, True, False])
    text = text.replace("a,1,2,3,4,5,6,,,", "a,1,2,3,4,5,6,0,,1")
    with pytest.raises(FormatError, match=r"p\.csv:2: ny of 'a' is blank"):
        read_points(written(tmp_path / "p.csv", text))


def test_joints_go_before_measured_points(tmp_path: Path) -> None:
    text = "name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm,j1_deg,j2_deg\na,1,2,3,4,5,6,90,180\n"
    found = read_points(written(tmp_path / "p.csv", text)).touches
    np.testing.assert_allclose(found.joints, [[np.pi / 2, np.pi]])
    assert np.isnan(found.position).all()


def test_axes_of_the_controller_are_counted_as_the_robot_says(tmp_path: Path) -> None:
    sign = np.array([-1.0, 1.0])

    def relation(axes: np.ndarray) -> np.ndarray:
        return sign * axes

    text = "name,px_mm,py_mm,pz_mm,a1_deg,a2_deg\na,1,2,3,90,180\n"
    path = written(tmp_path / "p.csv", text)
    np.testing.assert_allclose(read_points(path, relation).touches.joints, [[-np.pi / 2, np.pi]])
    for few in ("a1_deg\na,1,2,3,90\n", "a1_deg,a2_deg,a3_deg\na,1,2,3,90,1,1\n"):
        written(path, "name,px_mm,py_mm,pz_mm," + few)
        with pytest.raises(FormatError, match="columns of axes, the robot has another number"):
            read_points(path, relation)


def test_a_misspelt_column_is_named(tmp_path: Path) -> None:
    text = "name,px_mm,py_mm,pz_m,x_mm,y_mm,z_mm\na,1,2,3,4,5,6\n"
    with pytest.raises(FormatError, match="unknown column 'pz_m'") as caught:
        read_points(written(tmp_path / "p.csv", text))
    assert caught.value.hint == "rename it to 'pz_mm', or remove it."


def test_sockets_have_no_columns(tmp_path: Path) -> None:
    place = ProbingSet(names=("a",), point=np.zeros((1, 3)), joints=np.ones((1, 6)), sockets=(0,))
    with pytest.raises(FormatError, match="have no columns"):
        write_points(tmp_path / "p.csv", place)
    assert not (tmp_path / "p.csv").exists()
