"""One simulated cell for all tests of the library."""

from __future__ import annotations

from pathlib import Path

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
