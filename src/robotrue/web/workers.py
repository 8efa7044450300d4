"""Processes next to the server for quick but heavy queries: reading a file, drawing a scene.

Numeric libraries take hundreds of megabytes; here they are loaded by the first query that needs
them, in a separate process, and the server stays small and answers meanwhile. Work of more than a
few seconds is not a query but a job of the store. A file can still be slow to read: then the next
query gets another process.

Children are forked from a process that has loaded the libraries already: loading them takes seconds
of a core, and a query, a worker and each of its jobs need the same ones. The server itself has
threads and is never forked. Where the system cannot fork, each is spawned.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Final, ParamSpec, TypeAlias, TypeVar

from robotrue.errors import RobotrueError
from robotrue.store.jobs_worker import Start

P = ParamSpec("P")
R = TypeVar("R")
PATIENCE: Final = 120.0
"""s until a question counts as one that will never be answered."""
GRACE: Final = 2.0
"""s that a question waits for a busy process; loading the libraries in another takes as long."""
MOST: Final = 4
"""Processes at a time."""
KEPT: Final = 24
"""Answers kept: neither a version of an item nor the query changes."""
BYTES: Final = 16 * 1024 * 1024
"""Of all answers together."""
Key: TypeAlias = tuple[Hashable, ...]
LIBRARIES: Final = [
    "matplotlib.figure",
    "numba",
    "pandas",  # pyarrow loads it with the first array or table
    "pyarrow.dataset",
    "scipy.optimize",
    "scipy.spatial.transform",
    "robotrue.app.operations.calibrate",
    "robotrue.app.workbench.workbench_calls",
    "robotrue.app.workspace_context",
    "robotrue.report.page",
    "robotrue.store.jobs_worker",
]
"""What nearly every child imports."""
Context: TypeAlias = multiprocessing.context.BaseContext


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
            except BaseException:  # the answer is not needed any more
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


class Answers:
    """Runs each query once; two equal queries at the same time wait for one answer."""

    def __init__(self, workers: QueryWorkers) -> None:
        self._workers = workers
        self._kept: OrderedDict[Key, bytes] = OrderedDict()
        self._asked: dict[Key, asyncio.Task[bytes]] = {}

    async def once(self, call: Callable[P, bytes], *args: P.args, **kwargs: P.kwargs) -> bytes:
        """Returns the cached answer; the arguments must name versions, so that it stays valid.

        Raises:
            RobotrueError: What the function raised; it is called again next time.
        """
        key = (call, args, *kwargs.items())
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        if key not in self._asked:
            self._asked[key] = asyncio.create_task(self._workers.ask(call, *args, **kwargs))
            self._asked[key].add_done_callback(lambda _: self._asked.pop(key, None))
        answer = await asyncio.shield(self._asked[key])
        self._kept[key] = answer
        while len(self._kept) > KEPT or sum(map(len, self._kept.values())) > BYTES:
            self._kept.popitem(last=False)
        return answer


def child_start() -> Start:
    """Returns how children are started here."""
    return "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"


def child_context() -> Context:
    """Returns what starts children; the libraries are loaded with the first of them."""
    context = multiprocessing.get_context(child_start())
    context.set_forkserver_preload(LIBRARIES)
    return context
