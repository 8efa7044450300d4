"""Who does which job: claimed by one worker, kept by its heartbeat, queued again when it dies."""

from __future__ import annotations

import json
import socket
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

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
from robotrue.store.locks import POSIX, abandoned
from robotrue.store.schema import JobRow
from robotrue.store.workspace import Transaction, Workspace, now

WORKERS: Final = "workers"
STALE: Final = 30.0
"""s without a heartbeat after which a worker of another machine is taken for dead. Of this machine
its lock tells, at once and whatever the clock does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One attempt at one job: only while it holds may anything be written for the job."""

    job: str
    attempt: int
    worker: str


def worker_name(token: str) -> str:
    """Returns the name of a worker process: its machine and a token of its own."""
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


def held(into: Transaction, claim: Claim) -> JobRow | None:
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


def beat(workspace: Workspace, worker: str) -> None:
    """Says that a worker lives."""
    with workspace.write() as into:
        into.session.execute(
            update(JobRow)
            .where(JobRow.worker == worker, JobRow.state == RUNNING)
            .values(heartbeat=clock(into.session))
        )


def report(workspace: Workspace, claim: Claim, progress: float, text: str) -> bool:
    """Notes how far a job is; returns whether it may go on: not cancelled, not somebody else's."""
    with workspace.write() as into:
        row = held(into, claim)
        if row is None or row.cancel:
            return False
        row.progress, row.text = progress, text
        return True


def done(into: Transaction, claim: Claim, result: Mapping[str, Any], remarks: list[str]) -> bool:
    """Puts the job done with its result; returns False, and does nothing, if the claim is lost."""
    row = held(into, claim)
    if row is None or row.cancel:
        return False
    row.result, row.remarks, row.text = json_values(result), _text(remarks), ""
    end(into, row, DONE)
    return True


def failed(
    workspace: Workspace, claim: Claim, error: Mapping[str, Any], remarks: list[str]
) -> None:
    """Puts the job failed with what it failed with, or cancelled if that was asked for."""
    with workspace.write() as into:
        row = held(into, claim)
        if row is not None:
            row.remarks = _text(remarks)
            end(
                into, row, CANCELLED if row.cancel else FAILED, None if row.cancel else _text(error)
            )


def died(workspace: Workspace, claim: Claim, why: str) -> None:
    """Queues again what a dead process was at, or puts it over: nothing of the attempt stands."""
    with workspace.write() as into:
        row = held(into, claim)
        if row is not None:
            _again(into, row, why)


def released(workspace: Workspace, claim: Claim) -> None:
    """Queues again what a worker that was stopped was at; the attempt does not count."""
    with workspace.write() as into:
        row = held(into, claim)
        if row is not None:
            row.attempts -= 1
            _again(into, row, "its worker was stopped")


def reclaim(workspace: Workspace) -> int:
    """Returns how many jobs of dead workers were queued again or put over."""
    under_way = select(JobRow).where(JobRow.state == RUNNING)
    with workspace.read() as session:
        suspects = [row.id for row in session.scalars(under_way) if _dead(workspace, session, row)]
    count = 0
    for id in suspects:
        with workspace.write() as into:
            same = under_way.where(JobRow.id == id).with_for_update(skip_locked=True)
            row = into.session.scalars(same).first()
            if row is None or not _dead(workspace, into.session, row):
                continue
            _again(into, row, "its worker died")
            count += 1
    return count


def running(workspace: Workspace) -> dict[str, str]:
    """Returns the worker of every job that is being done."""
    with workspace.read() as session:
        rows = session.execute(select(JobRow.id, JobRow.worker).where(JobRow.state == RUNNING))
        return {id: worker for id, worker in rows}


def _text(value: Any) -> Any:
    """The value without NUL characters, which no database keeps: messages may quote any file."""
    return json.loads(json.dumps(json_values(value)).replace("\\u0000", "?"))


def _dead(workspace: Workspace, session: Session, row: JobRow) -> bool:
    """Whether a job's worker has let go of its lock or, on another machine, is silent for long."""
    lock = lock_path(workspace.folder, row.worker)
    if row.worker.rpartition("/")[0] == socket.gethostname() and POSIX and lock.is_file():
        return abandoned(lock)
    silent = select(JobRow.id).where(JobRow.id == row.id, JobRow.heartbeat < clock(session) - STALE)
    return session.scalar(silent) is not None


def _again(into: Transaction, row: JobRow, why: str) -> None:
    detail = {"kind": row.kind, "attempt": row.attempts, "why": why}
    journal.record(into, "died", NOUN, row.id, detail=detail)
    if row.cancel:
        end(into, row, CANCELLED)
    elif row.attempts >= row.attempts_allowed:
        message = f"its process died in attempt {row.attempts} of {row.attempts_allowed}: {why}."
        hint = "see whether memory ran out; submit it again."
        end(into, row, FAILED, {"kind": "Died", "message": message, "hint": hint})
    else:
        row.state, row.worker, row.progress, row.text = QUEUED, "", 0.0, ""
