"""The commands of the pages about registering, tool and blank answer as printed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = (
    "three-points-and-rounds",
    "tool-point-from-the-table",
    "from-cam-to-program",
    "test-with-slots",
    "transfer-between-regions",
)


@pytest.mark.parametrize("page", PAGES)
def test_the_answers_of_a_page_are_current(page: str) -> None:
    done = subprocess.run(  # noqa: S603  our own pages
        [sys.executable, str(ROOT / "docs/run_examples.py"), "--check", f"docs/howto/{page}.md"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
