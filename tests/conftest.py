"""Fixtures every room may use."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path
from typing import Final

import pytest

TESTS: Final = Path(__file__).resolve().parent
sys.path.insert(0, str(TESTS))
LONGEST: Final = (
    "web/test_newcomer.py",
    "web/test_story.py",
    "cli/test_marks.py",
    "docs/test_demo_pages.py",
    "docs/test_dynamic_pages.py",
    "docs/test_shop_pages.py",
    "web/test_registration_page.py",
    "cli/test_demo.py",
    "web/test_drift_page.py",
    "web/test_choices.py",
    "compensation/test_configuration_chosen.py",
    "cli/test_compensate_configuration.py",
    "web/test_hostile_names.py",
    "compensation/test_compensate_file.py",
    "web/test_tools_browser.py",
    "web/test_cell_form.py",
    "web/test_plan_page.py",
    "web/test_drilling_page.py",
    "web/test_browser.py",
    "store/test_kills.py",
    "store/test_jobs.py",
    "program/test_krl_repeats.py",
    "drilling/test_refinement.py",
    "drilling/test_corrections.py",
    "web/test_kills_of_server.py",
    "cli/test_compensate.py",
    "program/test_linear_time.py",
)
"""Files of tests that take the longest, in this order."""

# A third of the collection went into looking for garbage among millions of modules' objects.
gc.disable()


def pytest_collection_finish() -> None:
    """Looks for garbage again, but not among what stays: the modules and the tests."""
    gc.enable()
    gc.freeze()
    gc.set_threshold(5000, 20, 20)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begins with the longest files; the others follow as they come.

    Workers take whole files, see scripts/check: a long file at the end leaves one worker alone.
    """
    numbers = {TESTS / name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: numbers.get(item.path, len(LONGEST)))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the measured data sets; tests that need it are skipped where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ROBOTRUE_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"measured data not found at {folder}; set ROBOTRUE_DATA")
    return folder
