"""Each module that writes a practice cell creates the folder it is given."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

MODULES = ("table_practice", "rail_practice", "warm_shift", "mastering_practice")


@pytest.mark.parametrize("name", MODULES)
def test_a_practice_cell_creates_its_folder(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "cell"
    import_module(f"robotrue.simulation.{name}").main([str(folder)])
    assert (folder / "cell.toml").is_file()
