"""Jobs: done in other processes, failed, cancelled, killed and begun anew, on both databases."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest
import shop_kinds
from shop_kinds import KINDS

from robotrue.errors import (
    ConfigurationError,
    ConvergenceError,
    DatabaseDownError,
    MissingExtraError,
)
from robotrue.store import items, jobs, journal
from robotrue.store.jobs import Job
from robotrue.store.jobs_claim import (
    Claim,
    claim,
    fail,
    finish,
    lock_claimed,
    lock_path,
    reclaim,
    report_progress,
    requeue,
    worker_name,
)
from robotrue.store.jobs_work import attempt
from robotrue.store.jobs_worker import run_worker
from robotrue.store.locks import POSIX, hold_alone
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Workspace

PATIENCE = 120.0
# Whole processes are started on one of the two only: what they do to the rows is tested on both.
IN_FILE = pytest.mark.parametrize("workspace", ["sqlite"], indirect=True)
ON_SERVER = pytest.mark.parametrize("workspace", ["postgresql"], indirect=True)


def worked(workspace: Workspace, **more: object) -> int:
    return run_worker(
        workspace.folder,
        workspace.url,
        kinds=KINDS,
        until_idle=True,
        **more,  # type: ignore[arg-type]
    )


def names(workspace: Workspace) -> int:
    return items.search(workspace, DOCUMENT, ItemQuery()).total


def attempted(workspace: Workspace, kind: str, parameters: dict[str, object]) -> jobs.Job:
    """Does a job in this process."""
    id = jobs.submit(workspace, kind, parameters)
    found = claim(workspace, [kind], worker_name("here"))
    assert found is not None
    if kind == "endless":
        jobs.cancel(workspace, id)
    attempt(workspace.folder, workspace.url, KINDS.get(kind, f"shop_kinds:{kind}"), found[1])
    assert not list((workspace.folder / "scratch").iterdir())
    return jobs.status(workspace, id)


def test_a_job_is_done(workspace: Workspace) -> None:
    found = attempted(workspace, "write", {"count": 3})
    assert (found.state, found.progress, found.attempts) == ("done", 1.0, 1)
    assert found.remarks == ("all written",)
    assert found.result is not None
    first = items.get(workspace, DOCUMENT, found.result["documents"][0])
    assert workspace.content(first.attachments[0].sha256) == f"{found.id} 0".encode()


def test_a_job_fails_with_what_it_failed_with(workspace: Workspace) -> None:
    error = attempted(workspace, "fail", {}).error
    assert error is not None
    assert (error["kind"], error["line"], error["hint"]) == ("ConfigurationError", 3, "5")
    error = attempted(workspace, "break_down", {}).error
    assert error is not None
    assert (error["kind"], error["message"]) == ("ZeroDivisionError", "a?b")
    assert "break_down" in error["trace"]
    error = attempted(workspace, "nothing", {}).error
    assert error is not None
    assert "no kind of job is 'shop_kinds:nothing'" in error["message"]


def test_a_job_sees_that_it_is_cancelled(workspace: Workspace, tmp_path: Path) -> None:
    assert attempted(workspace, "endless", {"begun": str(tmp_path / "b")}).state == "cancelled"


@ON_SERVER
def test_a_killed_process_is_begun_anew(workspace: Workspace) -> None:
    id = jobs.submit(workspace, "die", {"times": 1, "count": 3})
    other = jobs.submit(workspace, "unknown", {})
    with pytest.raises(ConvergenceError, match="is queued after"):
        jobs.wait(workspace, id, timeout=0.0)
    assert worked(workspace) == 2
    found = jobs.status(workspace, id)
    assert (found.state, found.attempts) == ("done", 2)
    why = [e.detail.get("why") for e in journal.entries(workspace, item=id).items]
    assert "its process was ended by SIGKILL" in why
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


@IN_FILE
def test_running_jobs_are_cancelled_and_survive_their_worker(
    workspace: Workspace, started: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    begun = tmp_path / "deaf"
    id = jobs.submit(workspace, "deaf", {"begun": str(begun)})
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
    assert jobs.cancel(workspace, orphan).state == "cancelled"
    worked(workspace)
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
        assert lock_claimed(into, mine) is not None
        assert not finish(into, mine, {}, [])
    assert jobs.status(workspace, id).state == "running"


def test_an_earlier_attempt_of_the_same_worker_writes_nothing(workspace: Workspace) -> None:
    """The worker's name alone does not tell a process that came back from the one that is at it."""
    id = jobs.submit(workspace, "write", {"count": 1}, attempts_allowed=2)
    first = claim(workspace, ["write"], "elsewhere/same")
    assert first is not None
    requeue(workspace, first[1], "its process was killed")
    second = claim(workspace, ["write"], "elsewhere/same")
    assert second is not None
    assert (first[1].attempt, second[1].attempt) == (1, 2)
    assert not report_progress(workspace, first[1], 0.9, "late")
    fail(workspace, first[1], {"kind": "Late", "message": "of the first attempt"}, [])
    with workspace.write() as into:
        assert lock_claimed(into, first[1]) is None
        assert not finish(into, first[1], {"late": True}, [])
    job = jobs.status(workspace, id)
    assert (job.state, job.progress, job.text) == ("running", 0.0, "")
    with workspace.write() as into:
        assert finish(into, second[1], {}, [])
    assert jobs.status(workspace, id).result == {}


def test_workers_on_other_machines_are_dead_when_silent(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    id = jobs.submit(workspace, "write", {"count": 1}, attempts_allowed=1)
    assert claim(workspace, ["write"], "elsewhere/gone") is not None
    assert reclaim(workspace) == 0
    monkeypatch.setattr("robotrue.store.jobs_claim.STALE", -1.0)
    assert reclaim(workspace) == 1
    assert jobs.status(workspace, id).state == "failed"


@pytest.mark.skipif(not POSIX, reason="needs locks, which POSIX has")
def test_a_worker_of_this_machine_lives_as_long_as_its_lock_whatever_the_clock_does(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    id = jobs.submit(workspace, "write", {"count": 1})
    name = worker_name("here")
    lock = lock_path(workspace.folder, name)
    lock.parent.mkdir(exist_ok=True)
    monkeypatch.setattr("robotrue.store.jobs_claim.STALE", -1.0)  # the clock has jumped ahead
    with hold_alone(lock, wait=True):
        assert claim(workspace, ["write"], name) is not None
        assert reclaim(workspace) == 0
        assert jobs.status(workspace, id).state == "running"
    assert reclaim(workspace) == 1
    assert jobs.status(workspace, id).state == "queued"


@pytest.mark.skipif(not POSIX, reason="needs locks, which POSIX has")
@ON_SERVER
def test_a_worker_outlives_a_database_that_is_down(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Down after a claim was written and before its answer came: the job is queued again."""
    id = jobs.submit(workspace, "write", {"count": 1})
    calls: list[str] = []

    def lost(where: Workspace, kinds: Collection[str], worker: str) -> tuple[Job, Claim] | None:
        found = claim(where, kinds, worker)
        calls.append(worker)
        if len(calls) == 1:
            raise DatabaseDownError("the connection went while it answered.")
        return found

    monkeypatch.setattr("robotrue.store.jobs_worker.claim", lost)
    monkeypatch.setattr("robotrue.store.jobs_worker.BEAT", 0.05)
    run_worker(workspace.folder, workspace.url, kinds=KINDS, until_idle=True)
    found = jobs.status(workspace, id)
    assert (found.state, found.attempts) == ("done", 1)


@ON_SERVER
def test_a_stopped_worker_leaves_its_job_to_the_next(workspace: Workspace, tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    id = jobs.submit(workspace, "endless", {"begun": str(begun)})
    run_worker(workspace.folder, workspace.url, kinds=KINDS, stop=begun.exists, patience=5.0)
    found = jobs.status(workspace, id)
    assert (found.state, found.attempts) == ("queued", 0)


def test_states_are_known(workspace: Workspace) -> None:
    with pytest.raises(ConfigurationError, match="state 'lost', expected queued"):
        jobs.search(workspace, state="lost")


def test_dask_is_an_extra(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match="distributed is not installed"):
        worked(workspace, dask="tcp://127.0.0.1:8786")


@IN_FILE
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
