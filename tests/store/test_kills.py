"""The kill benchmark, a little of it: processes killed at random moments lose nothing."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="needs fork and /proc, which Linux has"
)

NewUrl = Callable[[], str | None]


def benchmark(name: str) -> ModuleType:
    """Returns one of the benchmarks as a module that its child processes find, too."""
    if str(BENCHMARKS) not in sys.path:
        sys.path.append(str(BENCHMARKS))
    return importlib.import_module(name)


def test_killed_processes_lose_nothing(tmp_path: Path, new_url: NewUrl) -> None:
    kill_store = benchmark("kill_store")
    found = kill_store.killed(tmp_path / "shop", new_url(), kills=12, seed=3, longest=0.15)
    whole(found)


def test_a_database_server_that_restarts_ends_no_writer_and_no_worker(
    server: str, tmp_path: Path
) -> None:
    whole(benchmark("kill_commands").postgres(tmp_path, 4, 1))


def test_a_clock_that_jumps_ends_no_writer_and_no_worker(tmp_path: Path) -> None:
    found = benchmark("kill_commands").clock(tmp_path, 8, 1)
    whole(found)
    assert found["attempts at them"] <= found["jobs submitted"] + 2  # those killed at the end


def test_a_killed_job_command_loses_nothing(tmp_path: Path) -> None:
    found = benchmark("kill_commands").jobs(tmp_path, 2, 1)
    assert found["jobs done"] == found["jobs submitted"] > 0
    assert found["jobs with half or double results"] == found["faults found by verify"] == 0


def whole(found: dict[str, Any]) -> None:
    """Checks that everything noted is there, once."""
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
    for name in ("writers that ended by themselves", "workers that ended by themselves"):
        assert found.get(name, 0) == 0, name
    assert found["integrity check"] in ("ok", "server")
