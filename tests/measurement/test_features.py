"""Features of a part as CSV: columns, directions, and every refusal with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.errors import FormatError
from robotrue.measurement.formats.part_points import read_features

GOOD = """# block 12
name,px_mm,py_mm,pz_mm,nx,ny,nz,ax,ay,az,part
K1,0,0,10,,,,0,-2,0,left
K1,0,0,10,,,,0,0,1,left
F2,400,20.5,0,0,0,-1,,,,right
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "features.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_points_normals_and_directions(tmp_path: Path) -> None:
    found = read_features(written(tmp_path, GOOD))
    assert found.names == ("K1", "K1", "F2")
    assert found.parts == ("left", "right")
    assert found.part.tolist() == [0, 0, 1]
    np.testing.assert_allclose(found.point[2], [0.4, 0.0205, 0.0])
    np.testing.assert_allclose(found.access[0], [0.0, -1.0, 0.0])
    np.testing.assert_allclose(found.normal[2], [0.0, 0.0, -1.0])
    assert np.isnan(found.normal[:2]).all()
    assert np.isnan(found.access[2]).all()
    assert len(found.digest) == 64


def test_a_decimal_comma_and_no_directions(tmp_path: Path) -> None:
    found = read_features(written(tmp_path, "name;px_mm;py_mm;pz_mm\nA;1,5;2,5;3\n"))
    np.testing.assert_allclose(found.point, [[1.5e-3, 2.5e-3, 3e-3]])
    assert found.parts == ("part",)
    assert np.isnan(found.access).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,px_mm,py_mm\nA,1,2\n", ":1: no column pz_mm; the file has name, px_mm, py_mm."),
        ("name,px_mm,py_mm,pz\nA,1,2,3\n", ":1: unknown column 'pz'; allowed are name, px_mm,"),
        (
            "name,px_mm,py_mm,pz_mm,ax,ay\nA,1,2,3,0,1\n",
            ":1: no column az; the file has name, px_mm, py_mm, pz_mm, ax, ay.",
        ),
        (
            "name,px_mm,py_mm,pz_mm\nA,1,2,3\nB,1,x,3\n",
            ":3: py_mm is x, expected a finite number. Try: correct or delete that row.",
        ),
        ("name,px_mm,py_mm,pz_mm\nA,1,2,nan\n", ":2: pz_mm is nan, expected a finite number."),
        ("name,px_mm,py_mm,pz_mm\n,1,2,3\n", ":2: column 'name' is blank, expected a name."),
        (
            "name,px_mm,py_mm,pz_mm,nx,ny,nz\nA,1,2,3,10,0,0\n",
            ":2: nx, ny, nz has length 10, expected a direction of length 0.5 to 2. Try: a "
            "direction such as 0,0,1; not a point.",
        ),
    ],
)
def test_refusals(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(FormatError) as caught:
        read_features(path)
    assert str(caught.value).startswith(f"{path}{message}")
