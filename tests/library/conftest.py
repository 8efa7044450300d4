"""One simulated cell for all tests of the library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robotrue as rt
from robotrue.library.model_object import Model


@pytest.fixture(scope="session")
def practice(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = rt.write_practice_cell(tmp_path_factory.mktemp("practice"))
    text = (folder / "flange_hole.src").read_text().splitlines()
    (folder / "part.src").write_text("\n".join([*text[:40], "END", ""]))
    return folder


@pytest.fixture(scope="session")
def model(practice: Path) -> Model:
    return rt.calibrate(practice / "cell.toml", practice / "calibration.csv", method="geometric")


@pytest.fixture(scope="session")
def points(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four corners of a part and two points above it, measured in base; mm."""
    nominal = np.array(
        [[0, 0, 0], [400, 0, 0], [400, 200, 0], [0, 200, 0], [50, 100, 120], [350, 100, 120]]
    )
    measured = nominal + np.array([1200.0, -150.0, 600.0])
    rows = [
        ",".join(map(str, [name, *a, *b]))
        for name, a, b in zip("ABCDEF", nominal, measured, strict=True)
    ]
    path = tmp_path_factory.mktemp("points") / "points.csv"
    path.write_text("\n".join(["name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm", *rows, ""]))
    return path
