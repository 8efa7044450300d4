"""The benchmark that kills the served workbench, a little of it: nothing acknowledged is lost."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="needs /proc, which Linux has"
)


def test_a_killed_server_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.delenv("ROBOTRUE_DB", raising=False)
    spec = importlib.util.spec_from_file_location("kill_serve", BENCHMARKS / "kill_serve.py")
    assert spec is not None
    assert spec.loader is not None
    kill_serve = importlib.util.module_from_spec(spec)
    sys.modules["kill_serve"] = kill_serve
    spec.loader.exec_module(kill_serve)
    found = kill_serve.killed(tmp_path / "shop", kills=5, seed=2, longest=0.5)
    assert found["uploads acknowledged, not yet used"] + found["jobs acknowledged"] > 0
    for name in (
        "acknowledged writes lost",
        "programs with other content",
        "programs made twice of one request",
        "acknowledged uploads lost or altered",
        "jobs that never ended",
        "jobs with half or double results",
        "faults found by verify",
        "files no row names",
        "files left over from killed processes",
    ):
        assert found[name] == 0, name
    assert found["integrity check"] == "ok"
