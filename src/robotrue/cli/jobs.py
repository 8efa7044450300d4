"""``robotrue jobs``: asked for, shown, cancelled, done."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from threading import Event
from typing import Any, Final

from robotrue.cli.console import count, emit_facts, emit_json, emit_table, say
from robotrue.cli.kinds import KINDS
from robotrue.cli.workspace import opened
from robotrue.core.provenance import Provenance, simulation_mark
from robotrue.errors import ConfigurationError
from robotrue.store import jobs
from robotrue.store.jobs import Job
from robotrue.store.jobs_worker import run_worker

JSON: Final = re.compile(r"true|false|null|-?\d+(\.\d+)?")
TEXTS: Final = frozenset(
    {"cell", "measurements", "model", "program", "registration", "name", "note"}
)
"""Parameters that are ids or names."""


def run_submit(folder: Path, kind: str, parameters: Sequence[str], *, as_json: bool) -> None:
    """Asks for a job."""
    if kind not in KINDS:
        raise ConfigurationError(f"{kind!r} is no kind of job, expected {', '.join(KINDS)}.")
    with opened(folder) as workspace:
        id = jobs.submit(workspace, kind, _parameters(parameters))
        found = jobs.status(workspace, id)
    say(f"job {id} waits; robotrue jobs run does it")
    if as_json:
        emit_json(document(found))


def _parameters(stated: Sequence[str]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    repeated: set[str] = set()
    for each in stated:
        name, equals, text = each.partition("=")
        if not equals or not name:
            raise ConfigurationError(f"-p {each!r}, expected NAME=VALUE.", hint="-p cell=left")
        value = _value(name, text)
        if name in repeated:
            found[name].append(value)
        elif name in found:
            found[name] = [found[name], value]
            repeated.add(name)
        else:
            found[name] = value
    return found


def _value(name: str, text: str) -> Any:
    """JSON where it is some; ids and names are text, also where they look like numbers."""
    if text[:1] in "[{" or (name not in TEXTS and JSON.fullmatch(text)):
        try:
            return json.loads(text)
        except ValueError as cause:
            raise ConfigurationError(f"-p {name}={text!r} is no JSON ({cause}).") from None
    return text


def run_list(folder: Path, *, state: str | None, limit: int, as_json: bool) -> None:
    """Shows the jobs, the newest first."""
    with opened(folder) as workspace:
        page = jobs.listed(workspace, state=state, limit=limit)
    if as_json:
        emit_json({"total": page.total, "jobs": [document(each) for each in page.items]})
        return
    emit_table(
        f"{count(page.total, 'job')}",
        ("id", "kind", "state", "done", "attempts", "submitted", "", ""),
        [
            (
                each.id[:8],
                each.kind,
                each.state,
                f"{each.progress:.0%}",
                str(each.attempts),
                _time(each.submitted),
                each.text if each.error is None else str(each.error["message"]),
                simulation_mark(_simulated(each)),
            )
            for each in page.items
        ],
        words=True,
    )


def run_show(folder: Path, job: str, *, as_json: bool) -> None:
    """Shows one job."""
    with opened(folder) as workspace:
        found = jobs.status(workspace, job)
    if as_json:
        emit_json(document(found))
        return
    facts = [
        ("id", found.id),
        ("state", f"{found.state}, {found.progress:.0%}, attempt {found.attempts}"),
        ("submitted", _time(found.submitted)),
        ("finished", _time(found.finished)),
        *((name, json.dumps(value)) for name, value in found.parameters.items()),
        *((f"result: {name}", json.dumps(value)) for name, value in (found.result or {}).items()),
        *((f"error: {n}", str(v)) for n, v in (found.error or {}).items() if v and n != "trace"),
        *(("remark", remark) for remark in found.remarks),
    ]
    emit_facts(f"job {found.kind}", facts, Provenance(simulated=_simulated(found)))


def run_cancel(folder: Path, job: str, *, as_json: bool) -> None:
    """Ends a job."""
    with opened(folder) as workspace:
        found = jobs.cancel(workspace, job)
    say(f"job {found.id} is {found.state}" + ("" if found.over else " and will be cancelled"))
    if as_json:
        emit_json(document(found))


def run_worker_here(
    folder: Path, *, until_idle: bool, slots: int, dask: str | None, as_json: bool
) -> None:
    """Does jobs until told to stop, or until nothing waits."""
    stopped = Event()
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: stopped.set())
    say("working; Ctrl-C stops, and what is under way is begun anew by the next worker")
    done = run_worker(
        folder, kinds=KINDS, slots=slots, until_idle=until_idle, stop=stopped.is_set, dask=dask
    )
    say(f"{count(done, 'attempt')} made")
    if as_json:
        emit_json({"attempts": done})


def _simulated(found: Job) -> bool:
    """Whether the result of a job that is done says so."""
    return bool((found.result or {}).get("simulated"))


def document(found: Job) -> dict[str, Any]:
    """Returns a job as JSON values."""
    told = asdict(found)
    for name in ("submitted", "started", "finished"):
        at = told[name]
        told[name] = None if at is None else at.isoformat()
    return {"simulated": _simulated(found), **told}


def _time(at: datetime | None) -> str:
    return "" if at is None else f"{at.astimezone():%Y-%m-%d %H:%M:%S}"
