"""Nothing a user can see goes away unnoticed: commands, options, routes, formats, kinds of jobs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason="pip install robotrue[web]")

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "inventory.py"


def test_no_feature_of_the_inventory_is_missing() -> None:
    """Fails when a command, option, default, route, format or parameter is gone or renamed."""
    done = subprocess.run(  # noqa: S603
        [sys.executable, str(SCRIPT), "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    assert " 0 missing" in done.stdout
