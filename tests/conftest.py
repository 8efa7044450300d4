"""Fixtures every room may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the measured data sets; tests that need it are skipped where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ROBOTRUE_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"measured data not found at {folder}; set ROBOTRUE_DATA")
    return folder
