"""The process beside the server: answers, refusals with all their words, deaths."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from robotrue.errors import RobotrueError
from robotrue.store import jobs
from robotrue.store.workspace import Workspace
from robotrue.web.answers import KEPT, Answers
from robotrue.web.job_process import JobProcess
from robotrue.web.workers import Fact, Workers, _Refusal


def test_an_answer_survives_the_death_of_its_process() -> None:
    workers = Workers()

    async def story() -> None:
        assert await workers.ask("kinds.known", "") == b'{"kinds":[]}'
        pool = workers._pool
        assert pool is not None
        for process in pool._processes.values():
            process.kill()
            process.join(10.0)
        assert await workers.ask("kinds.known", "") == b'{"kinds":[]}'

    try:
        asyncio.run(asyncio.wait_for(story(), 60.0))
    finally:
        workers.stop()


def test_an_error_comes_back_with_all_its_words() -> None:
    class OddError(RobotrueError):
        pass

    error = _Refusal(OddError("2 mm.", source="a.csv", line=7, hint="3 mm")).error()
    assert isinstance(error, OddError)
    assert str(error) == "a.csv:7: 2 mm. Try: 3 mm"


class Counted(Workers):
    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[Fact, ...]] = []

    async def ask(self, question: str, *facts: Fact) -> bytes:
        self.asked.append(facts)
        await asyncio.sleep(0)
        if facts == (-1,):
            raise RobotrueError("no.")
        return str(facts).encode()


def test_a_question_is_asked_once_and_a_refusal_again() -> None:
    workers = Counted()
    answers = Answers(workers)

    async def story() -> None:
        both = await asyncio.gather(answers.once("q", 1), answers.once("q", 1))
        assert both == [b"(1,)", b"(1,)"]
        assert await answers.once("q", 1) == b"(1,)"
        assert workers.asked == [(1,)]
        for _ in range(2):
            with pytest.raises(RobotrueError, match="no"):
                await answers.once("q", -1)
        assert workers.asked.count((-1,)) == 2
        for k in range(KEPT + 1):
            await answers.once("q", k)
        await answers.once("q", 0)
        assert workers.asked.count((0,)) == 2  # the oldest one went

    asyncio.run(asyncio.wait_for(story(), 20.0))


def test_a_job_is_done_by_a_process_that_is_there_only_for_it(tmp_path: Path) -> None:
    with Workspace.create(tmp_path / "shop") as workspace:
        id = jobs.submit(workspace, "calibrate", {"shoe_size": 43})
        process = JobProcess(workspace, "robotrue.cli.job_kinds:KINDS")

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
