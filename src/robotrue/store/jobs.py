"""Jobs: requested here, executed by workers; requests, status, cancellation.

States go ``queued`` -> ``running`` -> ``done``, ``failed`` or ``cancelled``. A job whose process
died is queued again, until it died ``attempts_allowed`` times. Its results are saved together with
the state ``done``, or not at all.
"""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, Final, NewType

from sqlalchemy import ColumnElement, Float, extract, func, literal_column, select, type_coerce
from sqlalchemy.orm import Session

from robotrue.core.json_values import plain_text
from robotrue.errors import ConfigurationError, ConvergenceError
from robotrue.store import journal
from robotrue.store.query_defaults import LIMIT
from robotrue.store.records import ResultPage
from robotrue.store.schema import JobRow
from robotrue.store.workspace import Transaction, Workspace, now, reading, transaction

JobId = NewType("JobId", str)

QUEUED: Final = "queued"
RUNNING: Final = "running"
DONE: Final = "done"
FAILED: Final = "failed"
CANCELLED: Final = "cancelled"
STATES: Final = (QUEUED, RUNNING, DONE, FAILED, CANCELLED)
OVER: Final = frozenset({DONE, FAILED, CANCELLED})
ATTEMPTS: Final = 3
NOUN: Final = "job"
_EVERY: Final = 0.1
"""s between two looks of :func:`wait`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """State of a job.

    Attributes:
        id: Never changes.
        kind: Operation: ``calibrate``, ``compensate``, ...
        parameters: JSON values; items by their ids.
        state: One of ``STATES``.
        progress: 0 to 1.
        text: Its current step.
        remarks: Its remarks so far.
        result: JSON values; resulting items by their ids. None before it is done.
        error: ``kind``, ``message``, ``hint`` of the error it failed with.
        attempts: How often it was started.
        attempts_allowed: How often it may be started.
        cancel: Whether its end was requested.
        worker: The worker that runs it.
        submitted: When it was queued.
        started: When it was last started.
        finished: When it was over.
    """

    id: JobId
    kind: str
    parameters: Mapping[str, object]
    state: str
    progress: float
    text: str
    remarks: tuple[str, ...]
    result: Mapping[str, Any] | None
    error: Mapping[str, Any] | None
    attempts: int
    attempts_allowed: int
    cancel: bool
    worker: str
    submitted: datetime
    started: datetime | None
    finished: datetime | None

    @property
    def over(self) -> bool:
        """It is done, has failed or was cancelled."""
        return self.state in OVER


def submit(
    where: Workspace | Transaction,
    kind: str,
    parameters: Mapping[str, object],
    *,
    attempts_allowed: int = ATTEMPTS,
) -> JobId:
    """Returns the id of a job that now waits for a worker that knows its kind.

    Raises:
        ConfigurationError: The parameters are no JSON values.
    """
    try:
        text = json.dumps(dict(parameters), allow_nan=False)
        if not plain_text([kind, parameters]):
            raise ValueError("a NUL character or half of one")
        stated = json.loads(text)
    except (TypeError, ValueError) as cause:
        raise ConfigurationError(
            f"parameters of a job that are no JSON values ({cause})."
        ) from None
    id = JobId(str(uuid.uuid4()))
    with transaction(where) as into:
        into.session.add(
            JobRow(
                id=id,
                kind=kind,
                parameters=stated,
                state=QUEUED,
                progress=0.0,
                text="",
                remarks=[],
                attempts=0,
                attempts_allowed=attempts_allowed,
                cancel=False,
                worker="",
                heartbeat=0.0,
                submitted=now(),
            )
        )
        journal.record(into, "submitted", NOUN, id, detail={"kind": kind})
    return id


def status(where: Workspace | Transaction, id: str) -> Job:
    """Returns the current state of a job.

    Raises:
        ConfigurationError: There is none.
    """
    with reading(where) as session:
        return job_of(row_of(session, id))


def search(
    where: Workspace | Transaction,
    *,
    state: str | None = None,
    kind: str | None = None,
    offset: int = 0,
    limit: int = LIMIT,
) -> ResultPage[Job]:
    """Returns jobs, the newest first; of one state or kind, or all."""
    if state is not None and state not in STATES:
        raise ConfigurationError(f"state {state!r}, expected {', '.join(STATES)}.")
    chosen = select(JobRow)
    if state is not None:
        chosen = chosen.where(JobRow.state == state)
    if kind is not None:
        chosen = chosen.where(JobRow.kind == kind)
    with reading(where) as session:
        total = (
            session.scalar(chosen.with_only_columns(func.count(), maintain_column_froms=True)) or 0
        )
        page = chosen.order_by(JobRow.submitted.desc(), JobRow.id.desc())
        rows = session.scalars(page.offset(offset).limit(limit))
        found = tuple(job_of(row) for row in rows)
    return ResultPage(items=found, total=total, offset=offset)


def cancel(where: Workspace | Transaction, id: str) -> Job:
    """Returns a job that is over or will be: a queued one at once, a running one when it sees it.

    A running job that does not see it within the worker's patience is killed. What is over stays.

    Raises:
        ConfigurationError: There is none.
    """
    with transaction(where) as into:
        row = row_of(into.session, id, lock=True)
        if row.state not in OVER and not row.cancel:
            row.cancel = True
            journal.record(into, "cancel asked", NOUN, id)
            if row.state == QUEUED:
                end(into, row, CANCELLED)
        into.session.flush()
        return job_of(row)


def wait(workspace: Workspace, id: str, *, timeout: float) -> Job:
    """Returns the job when it is over.

    Args:
        workspace: Where it was submitted; another process must run a worker there.
        id: Of the job.
        timeout: s.

    Raises:
        ConvergenceError: It is not over by then; it continues.
        ConfigurationError: There is none.
    """
    until = time.monotonic() + timeout
    while True:
        found = status(workspace, id)
        if found.over:
            return found
        if time.monotonic() >= until:
            raise ConvergenceError(
                f"job {id} is {found.state} after {timeout:g} s ({found.progress:.0%} done).",
                hint="robotrue jobs run starts a worker; robotrue jobs list shows its progress.",
            )
        time.sleep(min(_EVERY, max(until - time.monotonic(), 0.0)))


def row_of(session: Session, id: str, *, lock: bool = False) -> JobRow:
    """Returns the row of a job, also by the beginning of its id; ``lock`` excludes other writers.

    Raises:
        ConfigurationError: There is none, or more than one begins so.
    """
    chosen = select(JobRow).where(JobRow.id.startswith(id, autoescape=True)).limit(2)
    chosen = chosen.execution_options(populate_existing=True)
    found = list(session.scalars(chosen.with_for_update() if lock else chosen))
    if len(found) != 1 or len(id) < 4:
        raise ConfigurationError(
            f"{'more than one' if len(found) > 1 else 'no'} job is {id!r}.",
            hint="robotrue jobs list shows them.",
        )
    return found[0]


def end(
    into: Transaction, row: JobRow, state: str, error: Mapping[str, object] | None = None
) -> None:
    """Ends a job, with an entry in the journal."""
    row.state, row.finished = state, now()
    row.error = None if error is None else dict(error)
    if state == DONE:
        row.progress = 1.0
    journal.record(into, state, NOUN, row.id, detail={"kind": row.kind, "attempts": row.attempts})


def job_of(row: JobRow) -> Job:
    """Returns the record of a row."""
    values = {item.name: getattr(row, item.name) for item in fields(Job)}
    return Job(**{**values, "remarks": tuple(row.remarks)})


def clock(session: Session) -> ColumnElement[float]:
    """Returns the time of the database, s: one clock for workers on several machines."""
    if session.get_bind().dialect.name == "postgresql":
        return type_coerce(extract("epoch", func.clock_timestamp()), Float[float]())
    return literal_column("((julianday('now') - 2440587.5) * 86400.0)", Float[float]())
