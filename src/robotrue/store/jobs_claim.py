"""Claims on jobs: one worker claims a job, keeps it by heartbeat, or loses it to the queue."""

from __future__ import annotations

import json
import socket
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar, cast

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from robotrue.core.json_values import json_values
from robotrue.store import journal
from robotrue.store.jobs import (
    CANCELLED,
    DONE,
    FAILED,
    NOUN,
    QUEUED,
    RUNNING,
    Job,
    clock,
    end,
    job_of,
)
from robotrue.store.locks import POSIX, is_abandoned
from robotrue.store.schema import JobRow
from robotrue.store.workspace import Transaction, Workspace, now

T = TypeVar("T")
WORKERS: Final = "workers"
STALE: Final = 30.0
"""s without a heartbeat after which a worker of another machine counts as dead. Its lock
detects a dead worker of this machine, at once and independently of the clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One attempt at one job: only while it holds may anything be written for the job."""

    job: str
    attempt: int
    worker: str


def worker_name(token: str) -> str:
    """Returns the name of a worker process: its machine and a random token."""
    return f"{socket.gethostname()}/{token}"


def lock_path(folder: Path, worker: str) -> Path:
    """Returns the file that a worker holds locked as long as it lives."""
    return folder / WORKERS / f"{worker.rpartition('/')[2]}.lock"


def claim(workspace: Workspace, kinds: Collection[str], worker: str) -> tuple[Job, Claim] | None:
    """Returns the oldest job that waits, now this worker's; None where none of the kinds waits."""
    waiting = select(JobRow).where(JobRow.state == QUEUED, JobRow.kind.in_(list(kinds)))
    waiting = waiting.order_by(JobRow.submitted, JobRow.id).limit(1)
    with workspace.read() as session:
        if session.scalars(waiting).first() is None:
            return None
    with workspace.write() as into:
        row = into.session.scalars(waiting.with_for_update(skip_locked=True)).first()
        if row is None:
            return None
        row.state, row.worker, row.started = RUNNING, worker, now()
        row.attempts, row.progress, row.text, row.remarks = row.attempts + 1, 0.0, "", []
        row.heartbeat = clock(into.session)
        detail = {"kind": row.kind, "attempt": row.attempts}
        journal.record(into, "begun", NOUN, row.id, detail=detail)
        into.session.flush()
        into.session.refresh(row)
        return job_of(row), Claim(job=row.id, attempt=row.attempts, worker=worker)


def lock_claimed(into: Transaction, claim: Claim) -> JobRow | None:
    """Returns the job's row, locked, if the claim still holds."""
    chosen = select(JobRow).where(
        JobRow.id == claim.job,
        JobRow.attempts == claim.attempt,
        JobRow.worker == claim.worker,
        JobRow.state == RUNNING,
    )
    return into.session.scalars(
        chosen.with_for_update().execution_options(populate_existing=True)
    ).first()


def send_heartbeat(workspace: Workspace, worker: str) -> None:
    """Renews the lease of a worker on all its jobs."""
    with workspace.write() as into:
        into.session.execute(
            update(JobRow)
            .where(JobRow.worker == worker, JobRow.state == RUNNING)
            .values(heartbeat=clock(into.session))
        )


def report_progress(workspace: Workspace, claim: Claim, progress: float, text: str) -> bool:
    """Writes a job's progress; returns whether it may continue: not cancelled, not reassigned."""
    with workspace.write() as into:
        row = lock_claimed(into, claim)
        if row is None or row.cancel:
            return False
        row.progress, row.text = progress, text
        return True


def finish(
    into: Transaction, claim: Claim, result: Mapping[str, object], remarks: list[str]
) -> bool:
    """Marks the job as done with its result; returns False if the claim is lost."""
    row = lock_claimed(into, claim)
    if row is None or row.cancel:
        return False
    row.result, row.remarks, row.text = json_values(result), _without_nul(remarks), ""
    end(into, row, DONE)
    return True


def fail(
    workspace: Workspace, claim: Claim, error: Mapping[str, object], remarks: list[str]
) -> None:
    """Ends the job as failed with its error, or as cancelled if cancellation was requested."""
    with workspace.write() as into:
        row = lock_claimed(into, claim)
        if row is not None:
            row.remarks = _without_nul(remarks)
            if row.cancel:
                end(into, row, CANCELLED)
            else:
                end(into, row, FAILED, _without_nul(error))


def requeue(workspace: Workspace, claim: Claim, why: str, *, spent: bool = True) -> None:
    """Queues the job of a dead process again, or ends it; its partial results are discarded.

    Args:
        workspace: Where the job waits.
        claim: Of the attempt.
        why: It ended.
        spent: Whether the attempt counts; that of a worker that was stopped does not.
    """
    with workspace.write() as into:
        row = lock_claimed(into, claim)
        if row is not None:
            row.attempts -= 0 if spent else 1
            _requeue_row(into, row, why)


def reclaim(workspace: Workspace) -> int:
    """Returns the number of jobs of dead workers that were queued again or ended."""
    with workspace.read() as session:
        if not _rows_of_dead(workspace, session):
            return 0
    with workspace.write() as into:
        rows = _rows_of_dead(workspace, into.session, lock=True)
        for row in rows:
            _requeue_row(into, row, "its worker died")
        return len(rows)


def list_running(workspace: Workspace) -> list[Claim]:
    """Returns the claim of every job that is under way."""
    columns = select(JobRow.id, JobRow.attempts, JobRow.worker).where(JobRow.state == RUNNING)
    with workspace.read() as session:
        rows = session.execute(columns).all()
    return [Claim(job=id, attempt=attempt, worker=worker) for id, attempt, worker in rows]


def _rows_of_dead(workspace: Workspace, session: Session, *, lock: bool = False) -> list[JobRow]:
    """Returns the jobs whose worker released its lock or, on another machine, lost its lease.

    Args:
        workspace: Whose folder holds the workers' locks.
        session: For the query.
        lock: Whether to lock the rows; those locked by another session are left out.
    """
    silent = JobRow.heartbeat < clock(session) - STALE
    chosen = select(JobRow, silent).where(JobRow.state == RUNNING)
    if lock:
        chosen = chosen.with_for_update(skip_locked=True)
    dead = []
    for row, lease_over in session.execute(chosen):
        path = lock_path(workspace.folder, row.worker)
        local = row.worker.rpartition("/")[0] == socket.gethostname() and POSIX and path.is_file()
        if is_abandoned(path) if local else lease_over:
            dead.append(row)
    return dead


def _without_nul(value: T) -> T:
    """Returns the value without NUL, which no database keeps: messages may quote any file."""
    return cast(T, json.loads(json.dumps(json_values(value)).replace("\\u0000", "?")))


def _requeue_row(into: Transaction, row: JobRow, why: str) -> None:
    detail = {"kind": row.kind, "attempt": row.attempts, "why": why}
    journal.record(into, "died", NOUN, row.id, detail=detail)
    if row.cancel:
        end(into, row, CANCELLED)
    elif row.attempts >= row.attempts_allowed:
        message = f"its process died in attempt {row.attempts} of {row.attempts_allowed}: {why}."
        hint = "check the memory; submit it again."
        end(into, row, FAILED, {"kind": "Died", "message": message, "hint": hint})
    else:
        row.state, row.worker, row.progress, row.text = QUEUED, "", 0.0, ""
