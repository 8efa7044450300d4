"""What kills, restarts and clock jumps cost: job workers, PostgreSQL, ``drill run``, ``sense``.

``python benchmarks/kill_commands.py CASE [--times 50] [--seed 1]`` prints a summary of one case:

- ``jobs``: ``robotrue jobs run`` gets SIGKILL at random moments and is started again.
- ``postgres``: the database server is restarted under two writers and a worker.
- ``clock``: the computer's clock jumps by up to a day under two writers and a worker.
- ``drill``: ``robotrue drill run`` gets SIGKILL while a simulated head drills and measures.
- ``sense``: ``robotrue sense --record`` gets SIGKILL and goes on with ``--resume``.

Nothing acknowledged may be missing, nothing may be half or double.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path
from typing import Any
from unittest import mock

HERE = Path(__file__).resolve().parent
RUN = "from robotrue.cli.main import run; run()"
QUICK_JOBS = (
    "from robotrue.app.operations import workspace_jobs\n"
    "import robotrue.cli.main as main\n"
    "workspace_jobs.job_kinds = lambda: {'write': 'kill_store:write'}\n"
    "main.run()"
)
"""The command, but for jobs that take a moment instead of minutes."""
Row = dict[str, int | str]


def jobs(folder: Path, times: int, seed: int) -> Row:
    """The worker's process killed; every job is done once and whole."""
    from kill_store import PER_JOB

    from robotrue.store import items
    from robotrue.store import jobs as store_jobs
    from robotrue.store.nouns import DOCUMENT
    from robotrue.store.records import ItemQuery
    from robotrue.store.verify import verify
    from robotrue.store.workspace import Workspace

    draw = random.Random(seed)  # noqa: S311
    shop = folder / "shop"
    Workspace.create(shop).close()
    call = [sys.executable, "-c", QUICK_JOBS, "jobs", "run", "--workspace", str(shop)]
    submitted: list[str] = []
    killed = 0
    with Workspace.open(shop) as workspace:
        while killed < times:
            waiting = store_jobs.search(workspace, state="queued", limit=1).total
            for _ in range(waiting, 3):
                submitted.append(store_jobs.submit(workspace, "write", {}, attempts_allowed=10_000))
            with _process(call) as process:
                assert process.stderr is not None
                process.stderr.readline()  # it works
                time.sleep(draw.uniform(0.0, 0.6))
                process.send_signal(signal.SIGKILL)
            killed += 1
    done = subprocess.run(
        [*call, "--until-idle"], env=_environment(), capture_output=True, text=True
    )
    with Workspace.open(shop) as workspace:
        states = Counter(store_jobs.status(workspace, id).state for id in submitted)
        half = sum(
            items.search(workspace, DOCUMENT, ItemQuery(where={"name": id})).total != PER_JOB
            for id in submitted
        )
        found = verify(workspace)
    return {
        "worker killed": killed,
        "jobs submitted": len(submitted),
        "jobs done": states["done"],
        "jobs not done": len(submitted) - states["done"],
        "jobs with half or double results": half,
        "faults found by verify": len(found.faults),
        "files no row names": len(found.unnamed),
        "exit of the last worker": done.returncode,
    }


def postgres(folder: Path, times: int, seed: int) -> Row:
    """The server restarted, in turn after it has ended its sessions and at once."""
    import kill_store

    draw = random.Random(seed)  # noqa: S311
    with kill_store.temporary_postgres().server() as server:

        def restart() -> None:
            server.stop(fast=draw.random() < 0.5)
            time.sleep(draw.uniform(0.0, 0.3))
            server.start()

        return _under_trouble(folder / "shop", server.url, times, seed, restart)


def clock(folder: Path, times: int, seed: int) -> Row:
    """The clock of the computer, and so of SQLite, jumps by up to a day, mostly forth and back."""
    draw = random.Random(seed)  # noqa: S311
    told = folder / "offset_s"
    told.write_text("0")

    def jump() -> None:
        away = draw.uniform(-86_400.0, 86_400.0)
        told.with_suffix(".new").write_text(str(round(away)))
        told.with_suffix(".new").replace(told)

    with _clock_moved(told):
        return _under_trouble(folder / "shop", None, times, seed, jump)


@contextlib.contextmanager
def _clock_moved(told: Path) -> Any:
    """Shifts the clock of this process and of those it forks by what a file says, in s."""
    from sqlalchemy import literal_column

    from robotrue.store import items, jobs, jobs_claim, journal, workspace

    real_now, offset = workspace.now, lambda: float(told.read_text())

    def now() -> Any:
        return real_now() + timedelta(seconds=offset())

    def clock(session: Any) -> Any:
        return literal_column(f"((julianday('now') - 2440587.5) * 86400.0 + {offset():.1f})")

    with ExitStack() as stack:
        for module in (workspace, jobs, jobs_claim, items, journal):
            for name, shifted in (("now", now), ("clock", clock)):
                if hasattr(module, name):
                    stack.enter_context(mock.patch.object(module, name, shifted))
        yield


def _under_trouble(
    shop: Path, url: str | None, times: int, seed: int, trouble: Callable[[], None]
) -> Row:
    """Two writers and a worker at work while something happens again and again."""
    import kill_store

    from robotrue.errors import RobotrueError
    from robotrue.store.workspace import Workspace

    draw = random.Random(seed + 1)  # noqa: S311
    Workspace.create(shop, url).close()
    notes = [shop.parent / f"notes{k}" for k in range(2)]
    running = [
        kill_store.FORK.Process(target=kill_store.writer, args=(shop, url, each, seed + k))
        for k, each in enumerate(notes)
    ]
    running.append(kill_store.FORK.Process(target=kill_store.worker, args=(shop, url)))
    submitted: list[str] = []
    unanswered = 0
    for each in running:
        each.start()
    for _ in range(times):
        time.sleep(draw.uniform(0.0, 0.6))
        trouble()
        try:
            with Workspace.open(shop, url) as workspace:
                if kill_store.jobs.search(workspace, state="queued", limit=1).total < 4:
                    submitted.append(kill_store._submit(workspace))
        except RobotrueError:
            unanswered += 1
    alive = [each.is_alive() for each in running]
    for each in running:
        each.kill()
        each.join(30.0)
    return {
        "times": times,
        "writers that ended by themselves": 2 - sum(alive[:2]),
        "workers that ended by themselves": 1 - alive[2],
        "requests without an answer": unanswered,
        **kill_store._judged(shop, url, notes, submitted),
    }


def sense(folder: Path, times: int, seed: int) -> Row:
    """Killed in the middle of recording; the record ends whole, each sample once and in order."""
    import replay_day

    from robotrue.online.record import segments

    draw = random.Random(seed)  # noqa: S311
    replay_day.inputs(folder)
    repeats = max(2, times // 4)
    record, killed = folder / "record", 0
    call = replay_day.command(folder, record, repeats)
    for attempt in range(20 * times):
        with _process(call) as process:
            before = _size(record, segments)
            grown = draw.uniform(0.0, 60.0 * replay_day.BYTES * replay_day.FORCE_RATE / 10)
            while process.poll() is None and killed < times:
                if _size(record, segments) > before + grown:
                    process.send_signal(signal.SIGKILL)
                    killed += 1
                    break
                time.sleep(0.005)
            code = process.wait()
        if code == 0:
            break
        if code != -signal.SIGKILL:
            raise SystemExit(f"sense ended with {code} in attempt {attempt + 1}")
    rows, _ = replay_day.checked(record, 0)
    force = repeats * replay_day.PERIOD * replay_day.FORCE_RATE
    joints = repeats * replay_day.PERIOD * replay_day.JOINT_RATE
    return {
        "killed": killed,
        "force samples lost": force - rows["force"],
        "joint samples lost": joints - rows["joints"],
        "estimates lost": force - rows["estimates"],
    }


def _size(record: Path, segments: Callable[[Path], list[Path]]) -> int:
    return sum(p.stat().st_size for p in segments(record)) if record.exists() else 0


def drill(folder: Path, times: int, seed: int) -> Row:
    """Killed between clamp, move and reference; what was acknowledged is in journal and model."""
    import numpy as np

    from robotrue.drilling.foot_model import fit_model
    from robotrue.drilling.head import Head
    from robotrue.drilling.journal import Journal
    from robotrue.drilling.model_archive import read_model, write_model
    from robotrue.simulation.drilling_machine import drilling_machine, random_campaign

    draw = random.Random(seed)  # noqa: S311
    machine = drilling_machine(4)
    head = Head(p_pivot_tip=np.array([0.0, 0.0, -0.35]))
    campaign = random_campaign(machine, 60, np.random.default_rng(4))
    first, _ = fit_model(machine.foot, head, campaign, kind="interactions")
    start, after, journal = folder / "m.robotrue", folder / "after.robotrue", folder / "j.jsonl"
    write_model(start, first)
    answered: list[str] = []
    recorded: list[str] = []
    sent: set[str] = set()
    killed = refused = 0
    hole = 0
    while killed < times:
        model = after if after.exists() else start
        call = [sys.executable, "-c", RUN, "drill", "run", str(model), "--journal", str(journal)]
        call += ["--from", "udp://127.0.0.1:0", "-o", str(after), "--truth", "gauge", "--json"]
        call += ["--quiet-ms", "40"]
        with _process([*call]) as process:
            assert process.stderr is not None
            said = process.stderr.readline()
            found = re.search(rb"udp://127\.0\.0\.1:(\d+)", said)
            if found is None:
                refused += 1
                raise SystemExit(said.decode() + process.stderr.read().decode())
            at = time.monotonic() + draw.uniform(0.05, 1.0)
            with _line(int(found[1])) as line:
                while time.monotonic() < at:
                    hole += 1
                    answer = _clamp(line, f"K{hole}", at)
                    if answer is None or answer["status"] != "move":
                        continue
                    answered.append(f"K{hole}")
                    if draw.random() < 0.7:
                        sent.add(f"K{hole}")
                        left = {"hole": f"K{hole}", "left_a_deg": 0.002, "left_b_deg": -0.001}
                        answer = _ask(line, left, at)
                        if answer is not None and answer["status"] in ("recorded", "alarm"):
                            recorded.append(f"K{hole}")
            process.send_signal(signal.SIGKILL)
            killed += 1
    with Journal(journal) as kept:
        answers, version = kept.state.answered, kept.state.version
    lines = [json.loads(each) for each in journal.read_text().splitlines() if each]
    moves = Counter(x["hole"] for x in lines if x.get("status") == "move")
    steps = Counter(x["hole"] for x in lines if x.get("status") in ("recorded", "alarm"))
    return {
        "killed": killed,
        "starts refused": refused,
        "moves acknowledged": len(answered),
        "moves missing from the journal": sum(moves[name] != 1 for name in answered),
        "clamps in the journal": answers,
        "references acknowledged": len(recorded),
        "references missing from the journal": sum(steps[name] != 1 for name in recorded),
        "references recorded twice": sum(n > 1 for n in steps.values()),
        "references nobody sent": sum(name not in sent for name in steps),
        "version of the model less references in the journal": read_model(after).version
        - 1
        - sum(steps.values()),
        "version the journal names": version,
    }


@contextlib.contextmanager
def _line(port: int) -> Any:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.connect(("127.0.0.1", port))
        line.settimeout(0.01)
        yield line


def _clamp(line: socket.socket, hole: str, until: float) -> dict[str, Any] | None:
    """Sends still readings of the foot until an answer about the hole comes."""
    values = {"hole": hole, "d1_mm": 0.1, "d2_mm": 0.12, "d3_mm": 0.08, "force_N": 500.0}
    off = {**values, "force_N": 0.0}
    for _ in range(8):  # the foot is lifted first
        line.send(json.dumps(off).encode())
    return _ask(line, {**values, "z_mm": 0.0, "A_deg": 0.0, "B_deg": 0.0}, until)


def _ask(line: socket.socket, values: dict[str, Any], until: float) -> dict[str, Any] | None:
    while time.monotonic() < until:
        line.send(json.dumps(values).encode())
        try:
            answer = json.loads(line.recv(65536))
        except (TimeoutError, OSError):
            continue
        if answer.get("hole") == values["hole"]:
            return dict(answer)
    return None


@contextlib.contextmanager
def _process(call: list[str]) -> Any:
    with subprocess.Popen(
        call, env=_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def _environment() -> dict[str, str]:
    paths = [str(HERE), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


CASES: dict[str, Callable[[Path, int, int], Row]] = {
    each.__name__: each for each in (jobs, postgres, clock, drill, sense)
}


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("case", choices=sorted(CASES))
    asked.add_argument("--times", type=int, default=50)
    asked.add_argument("--seed", type=int, default=1)
    options = asked.parse_args()
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        found = CASES[options.case](Path(folder), options.times, options.seed)
    print(options.case)
    for name, value in found.items():
        print(f"{name:>52}  {value}")
    print(f"{'s':>52}  {time.monotonic() - begun:.0f}")


if __name__ == "__main__":
    sys.path.insert(0, str(HERE))
    main()
