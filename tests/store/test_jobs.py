"""Jobs: done in other processes, failed, cancelled, killed and begun anew, on both databases."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import shop_kinds
from shop_kinds import KINDS

from robotrue.errors import ConfigurationError, ConvergenceError, MissingExtraError
from robotrue.store import items, jobs, journal
from robotrue.store.jobs_claim import claim, done, held, reclaim, worker_name
from robotrue.store.jobs_worker import run_worker
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import Query
from robotrue.store.workspace import Workspace

PATIENCE = 60.0


def worked(workspace: Workspace, **more: object) -> int:
    return run_worker(
        workspace.folder,
        workspace.url,
        kinds=KINDS,
        until_idle=True,
        **more,  # type: ignore[arg-type]
    )


def names(workspace: Workspace) -> int:
    return items.listed(workspace, DOCUMENT, Query()).total


def test_a_worker_does_what_waits(workspace: Workspace, tmp_path: Path) -> None:
    bad = jobs.submit(workspace, "fail", {})
    broken = jobs.submit(workspace, "break_down", {})
    good = jobs.submit(workspace, "die", {"times": 1, "count": 3})
    lost = jobs.submit(workspace, "die", {"times": 9, "count": 2}, attempts_allowed=1)
    other = jobs.submit(workspace, "unknown", {})
    with pytest.raises(ConvergenceError, match="is queued after"):
        jobs.wait(workspace, good, timeout=0.0)
    assert worked(workspace, slots=2) == 5

    found = jobs.status(workspace, good)
    assert (found.state, found.progress, found.attempts) == ("done", 1.0, 2)
    assert found.remarks == ("all written",)
    assert found.result is not None
    first = items.get(workspace, DOCUMENT, found.result["documents"][0])
    assert workspace.content(first.attachments[0].sha256) == f"{good} 0".encode()

    error = jobs.status(workspace, bad).error
    assert error is not None
    assert (error["kind"], error["line"], error["hint"]) == ("ConfigurationError", 3, "5")
    error = jobs.status(workspace, broken).error
    assert error is not None
    assert (error["kind"], error["message"]) == ("ZeroDivisionError", "a?b")
    assert "break_down" in error["trace"]

    why = [e.detail.get("why") for e in journal.entries(workspace, item=good).items]
    assert "its process was ended by SIGKILL" in why
    error = jobs.status(workspace, lost).error
    assert error is not None
    assert "died in attempt 1 of 1" in error["message"]
    assert jobs.status(workspace, other).state == "queued"
    assert names(workspace) == 3
    assert not list((workspace.folder / "scratch").iterdir())
    assert not list((workspace.folder / "workers").iterdir())


@pytest.fixture
def started(workspace: Workspace) -> Iterator[subprocess.Popen[bytes]]:
    """A worker in a process of its own."""
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import shop_kinds; from robotrue.store.jobs_worker import run_worker\n"
        "if __name__ == '__main__':\n"
        "    run_worker(sys.argv[2], sys.argv[3] or None, kinds=shop_kinds.KINDS, patience=0.5)\n"
    )
    folder = str(Path(shop_kinds.__file__).parent)
    path = workspace.folder.parent / "worker.py"
    path.write_text(script)
    command = [sys.executable, str(path), folder, str(workspace.folder), workspace.url or ""]
    with subprocess.Popen(command) as worker:  # noqa: S603
        yield worker
        worker.kill()


def appears(path: Path) -> None:
    until = time.monotonic() + PATIENCE
    while not path.exists():
        assert time.monotonic() < until, f"{path} did not appear"
        time.sleep(0.02)


def test_running_jobs_are_cancelled_and_survive_their_worker(
    workspace: Workspace, started: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    for kind in ("endless", "deaf"):  # one sees that it is cancelled, one must be killed
        begun = tmp_path / kind
        id = jobs.submit(workspace, kind, {"begun": str(begun)})
        appears(begun)
        assert jobs.cancel(workspace, id).state == "running"
        assert jobs.wait(workspace, id, timeout=PATIENCE).state == "cancelled"
    begun = tmp_path / "begun"
    orphan = jobs.submit(workspace, "deaf", {"begun": str(begun)})
    appears(begun)
    started.send_signal(signal.SIGKILL)
    started.wait(PATIENCE)
    assert jobs.status(workspace, orphan).state == "running"
    assert reclaim(workspace) == 1
    assert reclaim(workspace) == 0
    again = jobs.status(workspace, orphan)
    assert (again.state, again.attempts) == ("queued", 1)
    jobs.cancel(workspace, orphan)
    worked(workspace)
    assert jobs.status(workspace, orphan).state == "cancelled"
    assert names(workspace) == 0
    assert not list((workspace.folder / "scratch").iterdir())


def test_a_job_is_claimed_once(workspace: Workspace) -> None:
    for _ in range(12):
        jobs.submit(workspace, "write", {"count": 1})
    taken: list[str] = []

    def take() -> None:
        with Workspace.open(workspace.folder, workspace.url) as mine:
            while (found := claim(mine, ["write"], worker_name("x"))) is not None:
                taken.append(found[0].id)

    threads = [threading.Thread(target=take) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert len(taken) == len(set(taken)) == 12


def test_a_lost_claim_writes_nothing(workspace: Workspace) -> None:
    id = jobs.submit(workspace, "write", {"count": 1})
    found = claim(workspace, ["write"], "elsewhere/gone")
    assert found is not None
    job, mine = found
    assert (job.id, job.state, job.attempts) == (id, "running", 1)
    jobs.cancel(workspace, id)
    with workspace.write() as into:
        assert held(into, mine) is not None
        assert not done(into, mine, {}, [])
    assert jobs.status(workspace, id).state == "running"


def test_workers_on_other_machines_are_dead_when_silent(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    id = jobs.submit(workspace, "write", {"count": 1}, attempts_allowed=1)
    assert claim(workspace, ["write"], "elsewhere/gone") is not None
    assert reclaim(workspace) == 0
    monkeypatch.setattr("robotrue.store.jobs_claim.STALE", -1.0)
    assert reclaim(workspace) == 1
    assert jobs.status(workspace, id).state == "failed"


def test_a_stopped_worker_leaves_its_job_to_the_next(workspace: Workspace, tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    id = jobs.submit(workspace, "endless", {"begun": str(begun)})
    run_worker(workspace.folder, workspace.url, kinds=KINDS, stop=begun.exists, patience=5.0)
    found = jobs.status(workspace, id)
    assert (found.state, found.attempts) == ("queued", 1)


def test_a_kind_that_is_none_fails(workspace: Workspace) -> None:
    id = jobs.submit(workspace, "odd", {})
    run_worker(
        workspace.folder, workspace.url, kinds={"odd": "shop_kinds:nothing"}, until_idle=True
    )
    error = jobs.status(workspace, id).error
    assert error is not None
    assert "no kind of job is 'shop_kinds:nothing'" in error["message"]


def test_states_are_known(workspace: Workspace) -> None:
    with pytest.raises(ConfigurationError, match="state 'lost', expected queued"):
        jobs.listed(workspace, state="lost")


def test_dask_is_an_extra(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match="distributed is not installed"):
        worked(workspace, dask="tcp://127.0.0.1:8786")


@pytest.mark.parametrize("workspace", ["sqlite"], indirect=True)
def test_a_killed_dask_worker_loses_nothing(workspace: Workspace) -> None:
    distributed = pytest.importorskip("distributed")
    with pytest.raises(ConfigurationError, match="no Dask scheduler answers"):
        worked(workspace, dask="nonsense://127.0.0.1:9")
    id = jobs.submit(workspace, "write", {"count": 30, "pause": 0.05})
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as cluster:
        thread = threading.Thread(
            target=worked, args=(workspace,), kwargs={"dask": cluster.scheduler_address}
        )
        thread.start()
        until = time.monotonic() + PATIENCE
        while jobs.status(workspace, id).progress == 0.0 and time.monotonic() < until:
            time.sleep(0.02)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            busy = [address for address, calls in client.processing().items() if calls]
            pids = client.run(os.getpid, workers=busy)
        for pid in pids.values():
            os.kill(pid, signal.SIGKILL)
        assert len(pids) == 1
        found = jobs.wait(workspace, id, timeout=PATIENCE)
        thread.join(PATIENCE)
    assert found.state == "done"
    assert names(workspace) == 30
