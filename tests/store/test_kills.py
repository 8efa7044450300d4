"""The kill benchmark, a little of it: processes killed at random moments lose nothing."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

AT = Path(__file__).resolve().parents[2] / "benchmarks" / "kill_store.py"
pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="needs fork and /proc, which Linux has"
)

NewUrl = Callable[[], str | None]


def test_killed_processes_lose_nothing(tmp_path: Path, new_url: NewUrl) -> None:
    spec = importlib.util.spec_from_file_location("kill_store", AT)
    assert spec is not None
    assert spec.loader is not None
    kill_store = importlib.util.module_from_spec(spec)
    sys.modules["kill_store"] = kill_store
    spec.loader.exec_module(kill_store)
    found = kill_store.killed(tmp_path / "shop", new_url(), kills=12, seed=3, longest=0.15)
    assert found["writes noted"] > 0
    assert found["jobs done"] == found["jobs submitted"] > 0
    for name in (
        "noted writes lost",
        "jobs with half or double results",
        "documents of jobs beyond theirs",
        "faults found by verify",
        "files no row names",
        "files left over from killed processes",
    ):
        assert found[name] == 0, name
    assert found["integrity check"] in ("ok", "server")
