"""The process that runs the workspace's jobs while the server runs, each in a child process.

It exists only while jobs wait. If it dies, the next worker queues its job again; if the server
dies, it ends with it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import Mapping
from multiprocessing.process import BaseProcess
from typing import Final

from robotrue.errors import RobotrueError
from robotrue.store import jobs
from robotrue.store.workspace import Workspace
from robotrue.web.workers import child_context, child_start, end_with_parent

LOOK: Final = 1.0
"""s between two looks whether a job waits."""
SLOTS: Final = min(4, max(2, os.cpu_count() or 1))
"""Jobs at a time; two on one core as well, so that a long job does not hold up a short one."""


class JobProcess:
    """Keeps a worker running while jobs wait."""

    def __init__(self, workspace: Workspace, kinds: Mapping[str, str]) -> None:
        """Makes it; :meth:`watch` is what runs.

        Args:
            workspace: Where jobs wait.
            kinds: Its kinds of jobs: ``module:function`` by kind; empty: jobs are left to others.
        """
        self._workspace, self._kinds = workspace, kinds
        self._process: BaseProcess | None = None
        self._wake = asyncio.Event()
        self._orphans = True  # an earlier server may have left jobs of dead workers

    def wake(self) -> None:
        """Wakes the process: a job has just been queued."""
        self._wake.set()

    async def watch(self) -> None:
        """Starts the process whenever a job waits, until cancelled."""
        try:
            while self._kinds:
                if not self._alive() and await asyncio.to_thread(self._waiting):
                    self._start()
                # Not wait_for: before Python 3.12 it drops a cancellation that meets the event.
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(LOOK):
                        await self._wake.wait()
                self._wake.clear()
        finally:
            self.stop()

    def stop(self) -> None:
        """Ends the process; the next one restarts its job."""
        if self._process is not None and self._process.is_alive():
            self._process.kill()
            self._process.join(5.0)
        self._process = None

    def _alive(self) -> bool:
        return self._process is not None and self._process.is_alive()

    def _waiting(self) -> bool:
        if self._process is not None and self._process.exitcode:
            self._orphans = True
        states = (jobs.QUEUED, jobs.RUNNING) if self._orphans else (jobs.QUEUED,)
        try:
            return any(jobs.search(self._workspace, state=each, limit=1).total for each in states)
        except RobotrueError:  # a database that is away for a moment
            return False

    def _start(self) -> None:
        where = (str(self._workspace.folder), self._workspace.url, dict(self._kinds))
        process = child_context().Process(target=_work, args=where)  # type: ignore[attr-defined]
        try:
            process.start()
        except (EOFError, OSError):  # what starts processes was just killed: the next look retries
            return
        self._process, self._orphans = process, False


def _work(folder: str, url: str | None, kinds: dict[str, str]) -> None:
    from robotrue.store.jobs_worker import run_worker

    threading.Thread(target=end_with_parent, daemon=True).start()
    run_worker(folder, url, kinds=kinds, slots=SLOTS, until_idle=True, start=child_start())
