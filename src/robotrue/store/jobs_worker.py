"""A worker: claims jobs, runs each in a separate process, and queues lost ones again."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, Protocol, TypeAlias, cast

from robotrue.errors import DatabaseDownError
from robotrue.store.jobs import RUNNING, status
from robotrue.store.jobs_claim import (
    WORKERS,
    Claim,
    claim,
    list_running,
    lock_path,
    reclaim,
    requeue,
    send_heartbeat,
    worker_name,
)
from robotrue.store.jobs_work import SCRATCH, attempt, attempt_as_child, tidy
from robotrue.store.locks import hold_alone, is_abandoned
from robotrue.store.query_defaults import SLOTS
from robotrue.store.workspace import Workspace

if TYPE_CHECKING:
    from multiprocessing.context import SpawnContext

    from robotrue.compensation.chunk_dask import DaskFuture

Start: TypeAlias = Literal["spawn", "fork", "forkserver"]
LOOK: Final = 0.05
"""s between two looks at the processes."""
BEAT: Final = 2.0
"""s between two heartbeats, and between two looks for jobs of dead workers."""
SEE: Final = 0.5
"""s between two looks whether a job was cancelled."""
STOPPED: Final = "its worker was stopped"
DASK_ANSWER: Final = 10
"""s within which a Dask scheduler must answer."""
PATIENCE: Final = 1.0
"""s between cancelling a job and killing its process."""


class JobRun(Protocol):
    """One attempt that is under way."""

    def poll(self) -> str | None:
        """Returns None while it runs, "" when it ended by itself, else the cause of its death."""
        ...

    def kill(self) -> None:
        """Ends it."""
        ...


class Engine(Protocol):
    """Executes attempts: processes of this machine, or the workers of a scheduler."""

    def begin(self, workspace: Workspace, target: str, claim: Claim) -> JobRun:
        """Starts an attempt and returns it."""
        ...


class ProcessRun:
    """An attempt in a process of this machine."""

    def __init__(self, workspace: Workspace, target: str, claim: Claim, start: Start) -> None:
        arguments = (workspace.folder, workspace.url, target, claim)
        context = cast("SpawnContext", get_context(start))  # its base has no Process
        self._process = context.Process(target=attempt_as_child, args=arguments)
        self._process.start()

    def poll(self) -> str | None:
        """Returns None while it runs, "" when it ended by itself, else the cause of its death."""
        code = self._process.exitcode
        if code is None:
            return None
        self._process.join()
        if code >= 0:
            return "" if code == 0 else f"its process ended with {code}"
        return f"its process was ended by {signal.Signals(-code).name}"

    def kill(self) -> None:
        """Ends it."""
        self._process.kill()


class ProcessEngine:
    """Attempts in new processes of this machine.

    Attributes:
        start: Start method: ``spawn``, ``forkserver`` where a fork server has the libraries loaded,
            or ``fork`` where no state of this process can interfere.
    """

    def __init__(self, start: Start) -> None:
        self.start: Start = start

    def begin(self, workspace: Workspace, target: str, claim: Claim) -> JobRun:
        """Starts an attempt and returns it."""
        return ProcessRun(workspace, target, claim, self.start)


class DaskEngine:
    """The workers of a Dask scheduler, on several machines. Needs the extra ``dask``.

    They need this robotrue and must see the workspace's folder and database. If one dies, the
    scheduler gives its job to another; nothing of the first attempt stands.
    """

    def __init__(self, address: str) -> None:
        from robotrue.compensation.chunk_dask import connect_scheduler

        self._client = connect_scheduler(address, timeout=DASK_ANSWER)

    def begin(self, workspace: Workspace, target: str, claim: Claim) -> JobRun:
        """Returns an attempt that was handed to the scheduler."""
        future = self._client.submit(
            attempt, workspace.folder, workspace.url, target, claim, pure=False
        )
        return DaskRun(future)

    def __enter__(self) -> DaskEngine:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()


class DaskRun:
    """An attempt on one of the workers."""

    def __init__(self, future: DaskFuture) -> None:
        self._future = future

    def poll(self) -> str | None:
        """Returns None while it runs, "" when it ended by itself, else the cause of its death."""
        match self._future.status:
            case "pending":
                return None
            case "finished":
                return ""
            case "error":
                cause = self._future.exception()
                return f"Dask lost it ({type(cause).__name__})"
            case word:
                return f"Dask says it is {word}"

    def kill(self) -> None:
        """Revokes the attempt; a worker that has started it writes nothing any more."""
        self._future.cancel(force=True)


@dataclass
class _Attempt:
    claim: Claim
    run: JobRun
    seen: float = 0.0
    cancelled: float | None = None


@dataclass
class Worker:
    """A worker at a workspace.

    Attributes:
        workspace: Where jobs wait.
        kinds: Its kinds of jobs: ``module:function`` by kind.
        engine: Where attempts are made.
        slots: Jobs at a time.
        patience: s between cancelling a job and killing its process.
        done: Attempts that ended, by whatever.
    """

    workspace: Workspace
    kinds: Mapping[str, str]
    engine: Engine
    slots: int
    patience: float = PATIENCE
    done: int = 0
    _name: str = field(default_factory=lambda: worker_name(uuid.uuid4().hex))
    _attempts: list[_Attempt] = field(default_factory=list)
    _beaten: float = -BEAT
    _down: bool = False

    def run(self, *, until_idle: bool, stop: Callable[[], bool]) -> None:
        """Works until it is stopped, or until the queue is empty.

        While the database does not answer it waits; jobs under way go on.
        """
        folder = self.workspace.folder
        (folder / WORKERS).mkdir(exist_ok=True)
        lock = lock_path(folder, self._name)
        with hold_alone(lock, wait=True):
            try:
                while not stop() and self._goes_on(until_idle):
                    time.sleep(BEAT if self._down else LOOK)
            finally:
                self._leave()
                lock.unlink(missing_ok=True)

    def _goes_on(self, until_idle: bool) -> bool:
        """Looks once at everything; returns whether there may be more to do."""
        try:
            if self._down:
                self._release_unknown()
            self._look()
            idle = until_idle and not self._attempts and not self._begin()
        except DatabaseDownError as cause:
            if not self._down:
                logging.getLogger("robotrue").warning("%s Waiting for it.", cause)
            self._down = True
            return True
        self._down = False
        return not idle

    def _release_unknown(self) -> None:
        """Queues again what is this worker's only in the database: the claim's answer was lost."""
        under = {current.claim.job for current in self._attempts}
        for lost in list_running(self.workspace):
            if lost.worker == self._name and lost.job not in under:
                requeue(self.workspace, lost, STOPPED, spent=False)

    def _look(self) -> None:
        for current in list(self._attempts):
            self._check(current)
        if time.monotonic() - self._beaten >= BEAT:
            self._beaten = time.monotonic()
            send_heartbeat(self.workspace, self._name)
            reclaim(self.workspace)
            _forget_the_dead(self.workspace)
        while len(self._attempts) < self.slots and self._begin():
            pass

    def _begin(self) -> bool:
        claimed = claim(self.workspace, self.kinds, self._name)
        if claimed is None:
            return False
        job, own = claimed
        run = self.engine.begin(self.workspace, self.kinds[job.kind], own)
        self._attempts.append(_Attempt(claim=own, run=run))
        return True

    def _check(self, current: _Attempt) -> None:
        why = current.run.poll()
        if why is None:
            self._kill_if_cancelled(current)
            return
        requeue(self.workspace, current.claim, why or "its process ended without a result")
        tidy(self.workspace.folder, current.claim.job)
        self._attempts.remove(current)
        self.done += 1

    def _kill_if_cancelled(self, current: _Attempt) -> None:
        """Kills what was cancelled and does not see it."""
        now = time.monotonic()
        if current.cancelled is not None:
            if now - current.cancelled > self.patience:
                current.run.kill()
        elif now - current.seen >= SEE:
            current.seen = now
            job = status(self.workspace, current.claim.job)
            lost = job.state != RUNNING or job.attempts != current.claim.attempt
            current.cancelled = now if job.cancel or lost else None

    def _leave(self) -> None:
        """Ends running attempts; other workers, or this one later, start them again."""
        for current in self._attempts:
            current.run.kill()
        for current in self._attempts:
            until = time.monotonic() + self.patience
            while current.run.poll() is None and time.monotonic() < until:
                time.sleep(LOOK)
            requeue(self.workspace, current.claim, STOPPED, spent=False)
            tidy(self.workspace.folder, current.claim.job)
        self._attempts.clear()


def run_worker(
    path: str | Path,
    url: str | None = None,
    *,
    kinds: Mapping[str, str],
    slots: int = SLOTS,
    until_idle: bool = False,
    stop: Callable[[], bool] = lambda: False,
    dask: str | None = None,
    patience: float = PATIENCE,
    start: Start = "spawn",
) -> int:
    """Runs jobs of a workspace; returns the number of attempts.

    Args:
        path: Folder of the workspace.
        url: Of its database, where that is not the one in the folder.
        kinds: Supported kinds: ``module:function`` by kind; jobs of other kinds are left waiting.
        slots: Jobs at a time.
        until_idle: End when no job waits.
        stop: Polled for whether to end; the next worker restarts running jobs.
        dask: Address of a scheduler whose workers see the same folder and database; None: this
            machine.
        patience: s between cancelling a job and killing its process.
        start: How processes of this machine are started, see :class:`ProcessEngine`.

    Raises:
        ConfigurationError: No workspace, or no scheduler answers.
        MissingExtraError: A scheduler is named and Dask is not installed.
    """
    with contextlib.ExitStack() as stack:
        workspace = stack.enter_context(Workspace.open(path, url))
        engine = ProcessEngine(start) if dask is None else stack.enter_context(DaskEngine(dask))
        worker = Worker(workspace, kinds, engine, slots=slots, patience=patience)
        worker.run(until_idle=until_idle, stop=stop)
        return worker.done


def _forget_the_dead(workspace: Workspace) -> None:
    """Removes locks of dead workers that have no job, and folders of jobs that are not done now."""
    folder = workspace.folder
    dead = [lock for lock in (folder / WORKERS).glob("*.lock") if is_abandoned(lock)]
    scratch = os.listdir(folder / SCRATCH) if (folder / SCRATCH).is_dir() else []
    if not dead and not scratch:
        return
    running = list_running(workspace)
    busy = {own.worker.rpartition("/")[2] for own in running}
    for lock in dead:
        if lock.stem not in busy:
            lock.unlink(missing_ok=True)
    for job in {name[:36] for name in scratch} - {own.job for own in running}:
        tidy(folder, job)
