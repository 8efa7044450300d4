"""Tool paths as CSV, and which reader a file goes to."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import MM
from robotrue.errors import FormatError, ShapeError
from robotrue.program.formats.toolpath_csv import read_toolpath_csv
from robotrue.program.formats.toolpaths import read_toolpath


def test_all_columns_in_any_order_and_case():
    text = (
        "# made by hand\n"
        "Z_mm,x_mm,y_mm,i,j,k,rapid,feed_mm_per_min,operation,tool\n"
        "3,1,2,0,0,1,1,,rough,7\n"
        "\n"
        "3,4,2,0,0.6,0.8,0,600,,\n"
        "3,5,2,0,0.6,0.8,,,finish,\n"
    )
    path = read_toolpath_csv(text.encode(), source="left.csv")
    np.testing.assert_allclose(path.position, np.array([[1, 2, 3], [4, 2, 3], [5, 2, 3]]) * MM)
    np.testing.assert_allclose(path.axis[1], [0, 0.6, 0.8])
    assert path.rapid.tolist() == [True, False, False]
    np.testing.assert_allclose(path.feed[1:], 0.01)
    assert path.line.tolist() == [3, 5, 6]
    assert path.operations == ("rough", "finish")
    assert path.operation.tolist() == [0, 0, 1]
    assert path.tools == (("7", 3),)
    assert path.name == "left"


def test_three_columns_are_enough():
    path = read_toolpath_csv(b"x_mm;y_mm;z_mm\n1;2;3\n", source="a.csv")
    assert path.axis.tolist() == [[0.0, 0.0, 1.0]]
    assert np.isnan(path.feed).all()


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("x_mm,y_mm,z_mm,rapd\n1,2,3,1\n", 1, "did you mean rapid?"),
        ("x_mm,y_mm\n1,2\n", 1, "no column 'z_mm'"),
        ("x_mm,y_mm,z_mm,i,j\n1,2,3,0,0\n", 1, "no column 'k'"),
        ("x_mm,y_mm,z_mm,x_mm\n1,2,3,1\n", 1, "appears twice"),
        ("x_mm,y_mm,z_mm\n1,2,3\n1,2\n", 3, "2 cells, expected 3"),
        ("x_mm,y_mm,z_mm\n1,2,3\n1,two,3\n", 3, "y_mm is 'two'"),
        ("x_mm,y_mm,z_mm\n1,2,\n", 2, "z_mm is ''"),
        ("x_mm,y_mm,z_mm\n1,2,inf\n", 2, "expected a finite number"),
        ("x_mm,y_mm,z_mm,i,j,k\n1,2,3,0,0,1\n1,2,3,0,0,0\n", 3, "length 0"),
        ("x_mm,y_mm,z_mm,rapid\n1,2,3,maybe\n", 2, "rapid is 'maybe'"),
        ("x_mm,y_mm,z_mm,feed_mm_per_min\n1,2,3,-5\n", 2, "feed_mm_per_min is -5"),
        ("x_mm,y_mm,z_mm,feed_mm_per_min\n1,2,3,1e9\n", 2, "at most 180000"),
        ("x_mm,y_mm,z_mm\n", 1, "no row with a point"),
    ],
)
def test_every_bad_cell_is_named_with_its_line(text, line, says):
    with pytest.raises(FormatError) as refused:
        read_toolpath_csv(text.encode(), source="p.csv")
    assert refused.value.line == line
    assert says in str(refused.value)
    assert refused.value.source == "p.csv"


def test_the_content_chooses_the_reader(tmp_path):
    (tmp_path / "a.txt").write_text("x_mm,y_mm,z_mm\n1,2,3\n")
    (tmp_path / "b.txt").write_text("UNITS/MM\nGOTO/1,2,3\n")
    (tmp_path / "c.txt").write_text("LIN {X 1,Y 2,Z 3}\n")
    first, second = (read_toolpath(tmp_path / name) for name in ("a.txt", "b.txt"))
    assert first.position.tolist() == second.position.tolist()
    with pytest.raises(FormatError, match="neither APT"):
        read_toolpath(tmp_path / "c.txt")


def test_a_path_keeps_its_invariants():
    path = read_toolpath_csv(b"x_mm,y_mm,z_mm\n1,2,3\n2,2,3\n", source="a.csv")
    with pytest.raises(ShapeError, match=r"axis has shape \(2, 3\)"):
        path.with_points(np.array([0, 1]), position=np.zeros((3, 3)), rapid=np.zeros(2, bool))
    moved = path.with_points(
        np.array([1, 0, 0]), position=np.zeros((3, 3)), rapid=np.array([False, True, False])
    )
    assert moved.line.tolist() == [3, 2, 2]
