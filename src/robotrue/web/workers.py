"""One process beside the server for what is quick but heavy: reading a file, drawing a scene.

Numeric libraries take hundreds of megabytes; here they are loaded by the first question that needs
them, in a process of its own, and the server stays small and answers meanwhile. What takes longer
than a few seconds is no question but a job of the store.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from typing import Final, TypeAlias

from robotrue.errors import RobotrueError

Fact: TypeAlias = str | int | float | bool | None
PATIENCE: Final = 120.0
"""s until a question counts as one that will never be answered."""


class Unanswered(RobotrueError):
    """A question whose process died or took too long."""


class Workers:
    """A pool of one process, started by the first question and again after it died."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None

    async def ask(self, question: str, *facts: Fact) -> bytes:
        """Returns what a function of ``web/questions`` returns, called in the other process.

        Args:
            question: ``file.function``; by its name, so that the server need not import it.
            facts: Its arguments.

        Raises:
            Unanswered: It took more than two minutes, or its process died twice.
            RobotrueError: What the function raised.
        """
        for attempt in (1, 2):
            try:
                future = self._running().submit(_call, question, facts)
                answer = await asyncio.wait_for(asyncio.wrap_future(future), PATIENCE)
                break
            except BrokenProcessPool:
                self.stop()
                if attempt == 2:
                    raise Unanswered(
                        "the process that worked on this ended.", hint="look for a lack of memory."
                    ) from None
            except TimeoutError:
                self.stop()
                raise Unanswered(
                    f"no answer within {PATIENCE:g} s.", hint="do it on the command line."
                ) from None
        if isinstance(answer, _Refusal):
            raise answer.error()
        return answer

    def stop(self) -> None:
        """Ends the process, whatever it is doing."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        for process in list((pool._processes or {}).values()):
            process.kill()
        pool.shutdown(wait=False, cancel_futures=True)

    def _running(self) -> ProcessPoolExecutor:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin)
        return self._pool


class _Refusal:
    """An error of ours on its way between processes, with all its fields."""

    def __init__(self, error: RobotrueError) -> None:
        self.kind = type(error)
        self.facts = (error.message, error.source, error.line, error.hint)

    def error(self) -> RobotrueError:
        message, source, line, hint = self.facts
        return self.kind(message, source=source, line=line, hint=hint)


def answered(question: str, facts: tuple[Fact, ...]) -> bytes:
    """Returns what a function of ``web/questions`` returns, called here.

    Raises:
        RobotrueError: What it raised.
    """
    file, _, name = question.partition(".")
    asked = getattr(import_module(f"robotrue.web.questions.{file}"), name)
    return bytes(asked(*facts))


def _call(question: str, facts: tuple[Fact, ...]) -> bytes | _Refusal:
    try:
        return answered(question, facts)
    except RobotrueError as error:
        return _Refusal(error)


def end_with_parent() -> None:
    """Waits for the parent process and ends this one: a server that is killed takes it along."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _begin() -> None:
    threading.Thread(target=end_with_parent, daemon=True).start()
