"""Touches from a table: repeated ones are averaged, a bad cell is named with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.registration.touch_file import TouchColumns, mean_touches, read_touches
from robotrue.core.units import MM
from robotrue.errors import FormatError

TABLE = "name,x_mm,y_mm,z_mm\nA,1,2,3\nB,10,0,0\nA,3,2,1\nB,10,0,0\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "touches.csv"
    path.write_text(text)
    return path


def test_touches_of_one_feature_are_averaged_in_order(tmp_path: Path) -> None:
    found = mean_touches(read_touches(written(tmp_path, TABLE)))
    assert found.names == ("A", "B")
    np.testing.assert_allclose(found.position / MM, [[2, 2, 2], [10, 0, 0]])
    np.testing.assert_array_equal(found.count, [2, 2])
    np.testing.assert_allclose(found.scatter / MM, [1.0, 0.0, 1.0])


def test_other_columns_and_units(tmp_path: Path) -> None:
    path = written(tmp_path, "Point;X;Y;Z\nA;0,1;0,2;0,3\n")
    found = read_touches(path, TouchColumns(name="point", position=("X", "Y", "Z"), unit=1.0))
    np.testing.assert_allclose(found.position, [[0.1, 0.2, 0.3]])
    assert np.isnan(mean_touches(found).scatter).all()


def test_bad_files_are_named_with_their_line(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"touches.csv:3: y_mm of 'B' is oops"):
        read_touches(written(tmp_path, "name,x_mm,y_mm,z_mm\nA,1,2,3\nB,1,oops,3\n"))
    with pytest.raises(FormatError, match=r"no column 'z_mm'; the file has name, x_mm, y_mm"):
        read_touches(written(tmp_path, "name,x_mm,y_mm\nA,1,2\n"))
