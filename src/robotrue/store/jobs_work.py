"""One attempt at a job, in a separate process: input and output of the job's function.

A kind of job is a function by name, ``module:function``, that takes a :class:`Work` and returns
what is to be written, as a function of a transaction. That is called once, at the end, in the
transaction that marks the job ``done``: partial results are never visible.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from multiprocessing import parent_process
from pathlib import Path
from typing import Final, TypeAlias

from robotrue.errors import ConfigurationError, DatabaseDownError, RobotrueError
from robotrue.store.jobs import Job, status
from robotrue.store.jobs_claim import Claim, fail, finish, report_progress
from robotrue.store.workspace import Transaction, Workspace

SCRATCH: Final = "scratch"
EVERY: Final = 0.3
"""s between two progress notes of a job."""


class Cancelled(Exception):
    """Raised to end a job that was cancelled, or that another worker has claimed."""


class Work:
    """Context of a job's function.

    Attributes:
        workspace: For reading; the returned function writes the results.
        job: Its kind and parameters.
        folder: Temporary and empty; removed afterwards.
        remarks: Its remarks.
    """

    def __init__(self, workspace: Workspace, job: Job, folder: Path, claim: Claim) -> None:
        self.workspace, self.job, self.folder = workspace, job, folder
        self.remarks: list[str] = []
        self._claim = claim
        self._noted = -EVERY

    @property
    def parameters(self) -> Mapping[str, object]:
        """Parameters of the request."""
        return self.job.parameters

    def step(self, text: str, done: int, of: int) -> None:
        """Writes the job's progress; call it often. A database that is down does not stop the job.

        Raises:
            Cancelled: It is to end.
        """
        if time.monotonic() - self._noted < EVERY:
            return
        self._noted = time.monotonic()
        share = min(max(done / of, 0.0), 1.0) if of else 0.0
        with contextlib.suppress(DatabaseDownError):
            if not report_progress(self.workspace, self._claim, share, text):
                raise Cancelled

    def remark(self, text: str) -> None:
        """Keeps one line that the user should read."""
        self.remarks.append(text)


Publish: TypeAlias = Callable[[Transaction], Mapping[str, object]]
"""Writes what came of a job; returns its result, JSON values."""
Kind: TypeAlias = Callable[[Work], Publish]


def kind_named(target: str) -> Kind:
    """Returns the function that ``module:function`` names.

    Raises:
        ConfigurationError: There is none.
    """
    module, _, name = target.partition(":")
    try:
        found: Kind = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as cause:
        raise ConfigurationError(f"no kind of job is {target!r} ({cause}).") from cause
    return found


def attempt(folder: Path, url: str | None, target: str, claim: Claim) -> None:
    """Runs a job once, and marks it done, failed or cancelled.

    Raises:
        DatabaseDownError: The database does not answer: the job is to be queued again.
    """
    with Workspace.open(folder, url) as workspace, _scratch(folder, claim.job) as scratch:
        work = Work(workspace, status(workspace, claim.job), scratch, claim)
        try:
            publish = kind_named(target)(work)
            with workspace.write() as into:
                if not finish(into, claim, publish(into), work.remarks):
                    raise Cancelled
        except Cancelled:
            fail(workspace, claim, {"kind": "Cancelled", "message": "cancelled"}, work.remarks)
        except DatabaseDownError:
            raise
        except RobotrueError as cause:
            fail(workspace, claim, fault(cause), work.remarks)
        except Exception as cause:  # a fault of the program: the job fails, the worker continues
            fail(workspace, claim, fault(cause), work.remarks)


def attempt_as_child(folder: Path, url: str | None, target: str, claim: Claim) -> None:
    """Does a job once in a process that ends when its parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C ends
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    try:
        attempt(folder, url, target, claim)
    except DatabaseDownError as cause:
        raise SystemExit(str(cause)) from None  # the worker queues the job again


def fault(cause: Exception) -> dict[str, object]:
    """Returns an error as JSON values."""
    found: dict[str, object] = {"kind": type(cause).__name__, "message": str(cause)}
    if isinstance(cause, RobotrueError):
        found["message"] = cause.message
        found |= {"source": cause.source, "line": cause.line, "hint": cause.hint}
    else:
        found["trace"] = "".join(traceback.format_exception(cause))
    return found


@contextlib.contextmanager
def _scratch(folder: Path, job: str) -> Iterator[Path]:
    path = folder / SCRATCH / f"{job}-{uuid.uuid4().hex}"
    path.mkdir(parents=True)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def tidy(folder: Path, job: str) -> None:
    """Removes what dead attempts at a job left in its folder."""
    for left in (folder / SCRATCH).glob(f"{job}-*"):
        shutil.rmtree(left, ignore_errors=True)


def _leave_with_parent() -> None:
    """Ends this process when its parent is killed, which nothing else would report."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
