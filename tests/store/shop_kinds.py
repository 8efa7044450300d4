"""Kinds of jobs for the tests, done in other processes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robotrue.errors import ConfigurationError
from robotrue.store import documents
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.workspace import Transaction

KINDS = {
    name: f"{__name__}:{name}" for name in ("write", "fail", "break_down", "endless", "deaf", "die")
}


def write(work: Work) -> Publish:
    """Writes as many documents as asked for, each with a file; all at once, at the end."""
    count = int(work.parameters["count"])
    paths = []
    for k in range(count):
        work.step(f"file {k}", k, count)
        paths.append(work.folder / f"{k}.txt")
        paths[-1].write_text(f"{work.job.id} {k}")
        time.sleep(float(work.parameters.get("pause", 0.0)))
    work.remark("all written")

    def publish(into: Transaction) -> Mapping[str, Any]:
        made = [documents.add(into, "part", name=work.job.id, files=[path]) for path in paths]
        return {"documents": [each.id for each in made]}

    return publish


def fail(work: Work) -> Publish:
    """Fails as a method does."""
    raise ConfigurationError("the value is 7 mm, expected 5 mm.", source="a.csv", line=3, hint="5")


def break_down(work: Work) -> Publish:
    """Fails as a program does that has a fault."""
    raise ZeroDivisionError("a\0b")


def endless(work: Work) -> Publish:
    """Goes on until it is cancelled."""
    Path(work.parameters["begun"]).touch()
    while True:
        work.step("going on", 1, 2)
        time.sleep(0.02)


def deaf(work: Work) -> Publish:
    """Goes on and never looks whether it is cancelled."""
    Path(work.parameters["begun"]).touch()
    while True:
        time.sleep(0.02)


def die(work: Work) -> Publish:
    """Is killed in its first attempts, after it has written files."""
    (work.folder / "half").write_text("half")
    if work.job.attempts <= int(work.parameters["times"]):
        os.kill(os.getpid(), signal.SIGKILL)
    return write(work)
