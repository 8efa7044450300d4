"""Writers, workers and jobs of a workspace killed at random moments: what is lost, what is half.

``python benchmarks/kill_store.py [--kills 200] [--seed 1] [--postgres]`` prints a summary. Two
writers add, change, delete and bring back items with files; two workers do jobs that write many
documents in one transaction. One of them, or the process of a job, gets SIGKILL; a new one takes
its place. A writer notes what it has written only after it stood. At the end nothing noted may be
missing, every job must be done with all its documents and no other, and no file may lie about.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from importlib.util import module_from_spec, spec_from_file_location
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from sqlalchemy import text

from robotrue.errors import RobotrueError
from robotrue.store import documents, items, jobs
from robotrue.store.jobs_claim import reclaim
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.jobs_worker import ProcessEngine, Worker
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import ItemQuery
from robotrue.store.verify import verify
from robotrue.store.workspace import Transaction, Workspace

FORK = get_context("fork")  # thousands of processes: a new interpreter for each takes a second
PER_JOB = 12
LONGEST = 0.6
"""s between two kills, at most."""
PATIENCE = 120.0


def write(work: Work) -> Publish:
    """The job: several files, one document each, all at the end."""
    paths = []
    for k in range(PER_JOB):
        work.step("writing", k, PER_JOB)
        paths.append(work.folder / f"{k}.txt")
        paths[-1].write_text(f"{work.job.id} {k}" * 200)
        time.sleep(0.002)

    def publish(into: Transaction) -> Mapping[str, Any]:
        made = [documents.add(into, "part", name=work.job.id, files=[path]) for path in paths]
        return {"documents": [each.id for each in made]}

    return publish


def writer(folder: Path, url: str | None, notes: Path, seed: int) -> None:
    """Writes until it is killed, and notes what stands."""
    draw, mine = random.Random(seed), []  # noqa: S311
    with Workspace.open(folder, url) as workspace, notes.open("a") as out:
        while True:
            try:
                written = _write_once(workspace, notes, draw, mine)
            except RobotrueError:  # the database is away: nothing was acknowledged
                time.sleep(0.05)
                continue
            if written is not None:
                out.write(json.dumps(written) + "\n")
                out.flush()


def _write_once(
    workspace: Workspace, notes: Path, draw: random.Random, mine: list[str]
) -> tuple[str, int, str, bool] | None:
    """Adds, changes, deletes or brings back one item; what then stands, or None."""
    word = f"{draw.random():.12f}"
    chosen = draw.choice(mine) if mine and draw.random() < 0.7 else None
    if chosen is None:
        source = notes.with_suffix(f".{word}")
        source.write_text(word * draw.randrange(1, 20_000))
        try:
            made = documents.add(workspace, "note", name=word, files=[source])
        finally:
            source.unlink()
        mine.append(made.id)
    elif items.get(workspace, DOCUMENT, chosen).deleted or draw.random() < 0.3:
        if items.get(workspace, DOCUMENT, chosen).version == 1:
            return None
        made = items.undo(workspace, DOCUMENT, chosen)
    elif draw.random() < 0.5:
        made = items.change(workspace, DOCUMENT, chosen, name=word)
    else:
        made = items.delete(workspace, DOCUMENT, chosen)
    return made.id, made.version, made.name, made.deleted


def worker(folder: Path, url: str | None) -> None:
    """Does jobs until it is killed."""
    with Workspace.open(folder, url) as workspace:
        kinds = {"write": f"{__name__}:write"}
        Worker(workspace, kinds, ProcessEngine("fork"), slots=2).run(
            until_idle=False, stop=lambda: False
        )


def killed(
    folder: Path, url: str | None, kills: int, seed: int, longest: float = LONGEST
) -> dict[str, int | str]:
    """Returns what became of a workspace whose processes were killed that often."""
    draw = random.Random(seed)  # noqa: S311
    Workspace.create(folder, url).close()
    notes = [folder.parent / f"notes{k}" for k in range(2)]
    begin: list[tuple[str, Callable[[int], BaseProcess]]] = [
        *(("writer", _starter(writer, folder, url, each)) for each in notes),
        *(("worker", _starter(worker, folder, url)) for _ in range(2)),
    ]
    running = [start(seed + k) for k, (_, start) in enumerate(begin)]
    counts: Counter[str] = Counter()
    submitted: list[str] = []
    for k in range(kills):
        with Workspace.open(folder, url) as workspace:
            if jobs.search(workspace, state="queued", limit=1).total < 4:
                submitted += [_submit(workspace) for _ in range(4)]
        time.sleep(draw.uniform(0.0, longest))
        which = draw.randrange(len(begin))
        name, pid = begin[which][0], running[which].pid
        child = draw.choice(_children(pid) or [None]) if name == "worker" else None
        if child is not None and draw.random() < 0.6:
            counts["job"] += _kill(child)
            continue
        counts[name] += _kill(pid)
        running[which].join(PATIENCE)
        running[which] = begin[which][1](seed + 10 * k)
    for (name, _), process in zip(begin, running, strict=True):
        counts[f"{name}, at the end"] += _kill(process.pid)
        process.join(PATIENCE)
    return {
        **_judged(folder, url, notes, submitted),
        **{f"killed: {k}": n for k, n in counts.items()},
    }


def _starter(target: Callable[..., None], *arguments: Any) -> Callable[[int], BaseProcess]:
    def start(seed: int) -> BaseProcess:
        own = (*arguments, seed) if target is writer else arguments
        process = FORK.Process(target=target, args=own)
        process.start()
        return process

    return start


def _submit(workspace: Workspace) -> str:
    return jobs.submit(workspace, "write", {}, attempts_allowed=10_000)


def _kill(pid: int | None) -> int:
    try:
        os.kill(pid or 0, signal.SIGKILL)
    except ProcessLookupError:  # a job that ended by itself just now
        return 0
    return 1


def _children(pid: int | None) -> list[int]:
    try:
        return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def _judged(
    folder: Path, url: str | None, notes: list[Path], submitted: list[str]
) -> dict[str, int | str]:
    """Works off what is left, then compares everything with what was noted."""
    with Workspace.open(folder, url) as workspace:
        until = time.monotonic() + PATIENCE
        while jobs.search(workspace, state="running", limit=1).total and time.monotonic() < until:
            reclaim(workspace)  # the last ones killed
            time.sleep(0.05)
        Worker(workspace, {"write": f"{__name__}:write"}, ProcessEngine("fork"), slots=1).run(
            until_idle=True, stop=lambda: False
        )
        states = Counter(jobs.status(workspace, id).state for id in submitted)
        attempts = sum(jobs.status(workspace, id).attempts for id in submitted)
        half = sum(
            items.search(workspace, DOCUMENT, ItemQuery(where={"name": id})).total != PER_JOB
            for id in submitted
        )
        parts = items.search(workspace, DOCUMENT, ItemQuery(where={"kind": "part"}, limit=1)).total
        noted = [json.loads(line) for each in notes for line in each.read_text().splitlines()]
        lost = sum(not _stands(workspace, *each) for each in noted)
    with Workspace.open(folder, url) as workspace:
        found = verify(workspace)
        left = [
            path
            for name in ("staged", "scratch", "workers")
            for path in (folder / name).rglob("*")
            if path.is_file()
        ]
        integrity = "server"
        if url is None:
            with workspace.engine.connect() as connection:
                integrity = str(connection.execute(text("PRAGMA integrity_check")).scalar())
    return {
        "writes noted": len(noted),
        "noted writes lost": lost,
        "jobs submitted": len(submitted),
        "jobs done": states["done"],
        "attempts at them": attempts,
        "jobs with half or double results": half,
        "documents of jobs beyond theirs": parts - PER_JOB * len(submitted),
        "files in the workspace": found.files,
        "faults found by verify": len(found.faults),
        "files no row names": len(found.unnamed),
        "files left over from killed processes": len(left),
        "integrity check": integrity,
    }


def _stands(
    workspace: Workspace, id: str, version: int, name: str, deleted: bool, noun: Any = DOCUMENT
) -> bool:
    try:
        found = items.get(workspace, noun, id, version=version)
    except Exception:  # whatever it is: it is not there
        return False
    return (found.name, found.deleted) == (name, deleted)


def main() -> None:
    asked = argparse.ArgumentParser()
    asked.add_argument("--kills", type=int, default=200)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--postgres", action="store_true")
    options = asked.parse_args()
    begun = time.monotonic()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        url = stack.enter_context(temporary_postgres().running()) if options.postgres else None
        found = killed(folder / "shop", url, options.kills, options.seed)
    print("PostgreSQL" if options.postgres else "SQLite")
    for name, value in found.items():
        print(f"{name:>40}  {value}")
    spent = sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )
    print(f"{'CPU s (without those killed by init)':>40}  {spent:.0f}")
    print(f"{'s':>40}  {time.monotonic() - begun:.0f}")


def temporary_postgres() -> Any:
    """Returns the module that starts a server in a temporary folder."""
    path = Path(__file__).resolve().parents[1] / "scripts" / "temporary_postgres.py"
    spec = spec_from_file_location("temporary_postgres", path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    sys.modules["kill_store"] = sys.modules["__main__"]
    main()
