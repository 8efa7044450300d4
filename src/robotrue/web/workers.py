"""Processes beside the server for what is quick but heavy: reading a file, drawing a scene.

Numeric libraries take hundreds of megabytes; here they are loaded by the first question that needs
them, in a process of its own, and the server stays small and answers meanwhile. What takes longer
than a few seconds is no question but a job of the store. A file can be slow to read all the same:
then the next question gets a process of its own.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Final, ParamSpec, TypeVar

from robotrue.errors import RobotrueError
from robotrue.web.child_processes import child_context

P = ParamSpec("P")
R = TypeVar("R")
PATIENCE: Final = 120.0
"""s until a question counts as one that will never be answered."""
GRACE: Final = 2.0
"""s that a question waits for a busy process; loading the libraries in another takes as long."""
MOST: Final = 4
"""Processes at a time."""


class Unanswered(RobotrueError):
    """A question whose process died or took too long."""


class QueryWorkers:
    """Processes that answer one query each at a time.

    One is started by the first question and stays. Others are started while it is busy, at most
    :data:`MOST`, and end when they have answered.
    """

    def __init__(self) -> None:
        self._running: set[ProcessPoolExecutor] = set()
        self._idle: asyncio.LifoQueue[ProcessPoolExecutor] = asyncio.LifoQueue()

    async def ask(self, call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Returns what a function returns, called in another process.

        Args:
            call: Of a file that imports what it needs when it is called, as
                ``robotrue.app.workbench.workbench_calls``.
            args: Its arguments.
            kwargs: Likewise.

        Raises:
            Unanswered: It took more than two minutes, or its process died twice.
            RobotrueError: What the function raised.
        """
        for attempt in (1, 2):
            process = await self._process()
            try:
                future = process.submit(_call, call, args, kwargs)
                answer = await asyncio.wait_for(asyncio.wrap_future(future), PATIENCE)
            except BrokenProcessPool:
                self._end(process)
                if attempt == 2:
                    raise Unanswered(
                        "the process that worked on this ended.", hint="look for a lack of memory."
                    ) from None
            except TimeoutError:
                self._end(process)
                raise Unanswered(
                    f"no answer within {PATIENCE:g} s.", hint="do it on the command line."
                ) from None
            except BaseException:  # nobody waits for the answer any more
                self._end(process)
                raise
            else:
                self._release(process)
                break
        if isinstance(answer, _Refusal):
            raise answer.error()
        return answer

    def stop(self) -> None:
        """Ends all processes, whatever they are doing."""
        for process in tuple(self._running):
            self._end(process)

    async def _process(self) -> ProcessPoolExecutor:
        """Returns an idle process, or a new one where none becomes idle soon."""
        while self._running:
            try:
                async with asyncio.timeout(GRACE):
                    process = await self._idle.get()
            except TimeoutError:
                if len(self._running) < MOST:
                    break
                continue
            if process in self._running:
                return process
        process = ProcessPoolExecutor(1, mp_context=child_context(), initializer=_begin)
        self._running.add(process)
        return process

    def _release(self, process: ProcessPoolExecutor) -> None:
        if self._idle.empty():
            self._idle.put_nowait(process)
        else:  # the load is over, one is enough
            self._end(process)

    def _end(self, process: ProcessPoolExecutor) -> None:
        self._running.discard(process)
        for each in list((process._processes or {}).values()):
            each.kill()
        process.shutdown(wait=False, cancel_futures=True)


class _Refusal:
    """An error of ours on its way between processes, with all its fields."""

    def __init__(self, error: RobotrueError) -> None:
        self.kind = type(error)
        self.facts = (error.message, error.source, error.line, error.hint)

    def error(self) -> RobotrueError:
        message, source, line, hint = self.facts
        return self.kind(message, source=source, line=line, hint=hint)


def _call(
    call: Callable[..., R], args: tuple[object, ...], kwargs: dict[str, object]
) -> R | _Refusal:
    try:
        return call(*args, **kwargs)
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
