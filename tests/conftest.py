"""Fixtures every room may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begins with the files marked ``first``, by their number; the others follow as they come.

    Two workers take whole files, see scripts/check. The first two compile the kernels, each other
    ones, and the rest finds the machine code on the disk; long files early leave no worker alone
    with one at the end.
    """
    numbers = {
        item.path: mark.args[0] for item in items if (mark := item.get_closest_marker("first"))
    }
    items.sort(key=lambda item: numbers.get(item.path, len(items)))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the measured data sets; tests that need it are skipped where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ROBOTRUE_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"measured data not found at {folder}; set ROBOTRUE_DATA")
    return folder
