"""The process beside the server: answers, refusals with all their words, deaths."""

from __future__ import annotations

import asyncio
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robotrue.app.job_kinds import job_kinds
from robotrue.errors import RobotrueError
from robotrue.store import jobs
from robotrue.store.workspace import Workspace
from robotrue.web import job_process
from robotrue.web.job_process import JobProcess
from robotrue.web.workers import GRACE, KEPT, MOST, Answers, QueryWorkers, _Refusal


def test_an_answer_survives_the_death_of_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workers, calls = QueryWorkers(), calls_in(tmp_path, monkeypatch)

    async def story() -> None:
        assert await workers.ask(calls.known) == ANSWER
        (pool,) = workers._running
        for process in pool._processes.values():
            process.kill()
            process.join(10.0)
        assert await workers.ask(calls.known) == ANSWER

    try:
        asyncio.run(asyncio.wait_for(story(), 60.0))
    finally:
        workers.stop()


class Context:
    """Starts no process; the first attempts find that what starts them was killed."""

    faults: tuple[Exception, ...] = (EOFError("unexpected EOF"), ConnectionRefusedError())

    def __init__(self) -> None:
        self.started = 0

    def Process(self, **_: object) -> Context:
        return self

    def start(self) -> None:
        self.started += 1
        for fault in self.faults[self.started - 1 : self.started]:
            raise fault

    def is_alive(self) -> bool:
        return self.started > len(self.faults)

    def kill(self) -> None:
        """Nothing runs."""

    def join(self, _: float) -> None:
        """Nothing runs."""


def test_jobs_go_on_after_what_starts_their_process_was_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = Context()
    monkeypatch.setattr(job_process, "child_context", lambda: context)
    monkeypatch.setattr(job_process, "LOOK", 0.01)

    async def story() -> None:
        with Workspace.create(tmp_path / "shop") as workspace:
            jobs.submit(workspace, "slow", {})
            watch = asyncio.create_task(JobProcess(workspace, {"slow": "none:none"}).watch())
            while not context.is_alive() and not watch.done():
                await asyncio.sleep(0.01)
            watch.cancel()
            with pytest.raises(asyncio.CancelledError):
                await watch

    asyncio.run(asyncio.wait_for(story(), 60.0))
    assert context.started == len(context.faults) + 1


BLOCKING = """
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

def wait():
    while not Path(__file__).with_name("go").exists():
        time.sleep(0.02)

def work(work):
    if work.job.kind == "slow":
        wait()
    return lambda into: {}
"""
"""Kinds of jobs; the slow one waits for a file, and nobody else does."""


ANSWER = b"{}"


def calls_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A module with two functions that answer; one waits for a file."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "shop_calls", raising=False)
    (tmp_path / "shop_calls.py").write_text(
        f"{BLOCKING}\ndef known():\n    return {ANSWER!r}\n"
        f"\ndef known_late():\n    wait()\n    return {ANSWER!r}\n"
    )
    return importlib.import_module("shop_calls")


def test_a_slow_question_holds_up_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workers, calls = QueryWorkers(), calls_in(tmp_path, monkeypatch)

    async def story() -> None:
        slow = [asyncio.create_task(workers.ask(calls.known_late)) for _ in range(MOST - 1)]
        for _ in range(2):
            assert await workers.ask(calls.known) == ANSWER
        assert not any(each.done() for each in slow)
        more = asyncio.create_task(workers.ask(calls.known_late))
        last = asyncio.create_task(workers.ask(calls.known))
        await asyncio.sleep(3 * GRACE)
        assert len(workers._running) == MOST  # and the last one waits, or was first
        (tmp_path / "go").touch()
        assert set(await asyncio.gather(*slow, more, last)) == {ANSWER}
        assert len(workers._running) == 1

    try:
        asyncio.run(asyncio.wait_for(story(), 100.0))
    finally:
        workers.stop()


def test_a_slow_job_holds_up_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "job_kinds.py").write_text(BLOCKING)
    with Workspace.create(tmp_path / "shop") as workspace:
        slow = jobs.submit(workspace, "slow", {})
        quick = jobs.submit(workspace, "quick", {})
        kinds = {"slow": "job_kinds:work", "quick": "job_kinds:work"}
        process = JobProcess(workspace, kinds)

        async def story() -> None:
            watching = asyncio.create_task(process.watch())
            try:
                done = await asyncio.to_thread(jobs.wait, workspace, quick, timeout=90.0)
                assert done.state == jobs.DONE
                assert jobs.status(workspace, slow).state == jobs.RUNNING
                (tmp_path / "go").touch()
                done = await asyncio.to_thread(jobs.wait, workspace, slow, timeout=90.0)
                assert done.state == jobs.DONE
            finally:
                watching.cancel()
                await asyncio.gather(watching, return_exceptions=True)

        asyncio.run(story())


def test_an_error_comes_back_with_all_its_words() -> None:
    class OddError(RobotrueError):
        pass

    error = _Refusal(OddError("2 mm.", source="a.csv", line=7, hint="3 mm")).error()
    assert isinstance(error, OddError)
    assert str(error) == "a.csv:7: 2 mm. Try: 3 mm"


class Counted(QueryWorkers):
    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[object, ...]] = []

    async def ask(self, call: Callable[..., Any], *args: object, **kwargs: object) -> Any:
        self.asked.append(args)
        await asyncio.sleep(0)
        return call(*args)


def spell(number: int) -> bytes:
    if number < 0:
        raise RobotrueError("no.")
    return f"({number},)".encode()


def test_a_question_is_asked_once_and_a_refusal_again() -> None:
    workers = Counted()
    answers = Answers(workers)

    async def story() -> None:
        both = await asyncio.gather(answers.once(spell, 1), answers.once(spell, 1))
        assert both == [b"(1,)", b"(1,)"]
        assert await answers.once(spell, 1) == b"(1,)"
        assert workers.asked == [(1,)]
        for _ in range(2):
            with pytest.raises(RobotrueError, match="no"):
                await answers.once(spell, -1)
        assert workers.asked.count((-1,)) == 2
        for k in range(KEPT + 1):
            await answers.once(spell, k)
        await answers.once(spell, 0)
        assert workers.asked.count((0,)) == 2  # the oldest one went

    asyncio.run(asyncio.wait_for(story(), 20.0))


def test_a_job_is_done_by_a_process_that_is_there_only_for_it(tmp_path: Path) -> None:
    with Workspace.create(tmp_path / "shop") as workspace:
        id = jobs.submit(workspace, "calibrate", {"shoe_size": 43})
        process = JobProcess(workspace, job_kinds())

        async def story() -> jobs.Job:
            watching = asyncio.create_task(process.watch())
            try:
                return await asyncio.to_thread(jobs.wait, workspace, id, timeout=90.0)
            finally:
                watching.cancel()
                await asyncio.gather(watching, return_exceptions=True)

        found = asyncio.run(story())
        assert found.state == jobs.FAILED
        assert found.error is not None
        assert found.error["message"].startswith("unknown parameter 'shoe_size'")
        assert not process._alive()
