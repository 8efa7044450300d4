"""Runs the commands of a how-to page and compares what they answer with what is printed there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def check_answers(page: str) -> None:
    done = subprocess.run(  # noqa: S603  our own pages
        [sys.executable, str(ROOT / "docs/run_examples.py"), "--check", f"docs/howto/{page}.md"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
