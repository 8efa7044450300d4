"""``robotrue serve`` and all its processes killed at random moments: what is lost, what is half.

``python benchmarks/kill_serve.py [--kills 200] [--seed 1]`` prints a summary. Clients upload files,
make programs of them, rename, delete and bring back, and ask for jobs, all through HTTP; what the
server has acknowledged they note. Meanwhile the server, the process that reads files, the one that
works on jobs or the one of a job gets SIGKILL; a server that died is started again. At the end
nothing noted may be missing, nothing may stand half, and every job must have come to its end.
"""

from __future__ import annotations

import argparse
import hashlib
import http.client
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
KINDS = {"write": "kill_store:write"}
LONGEST = 1.5
"""s from the first answer, or the first program made, after a kill to the next, at most."""
PATIENCE = 240.0
CLIENTS = 3
START = "import sys; import kill_serve\nkill_serve.serve(sys.argv[1], int(sys.argv[2]))"


def serve(folder: str, port: int) -> None:
    """The server, as the command starts it, but for jobs that take a moment instead of minutes."""
    from robotrue.web import server
    from robotrue.web.serve_settings import ServeSettings

    wanted = ServeSettings(workspace=Path(folder), port=port, kinds=KINDS)
    server.serve(wanted, ready=lambda address: None)


@dataclass
class Client:
    """Writes through HTTP and notes what was acknowledged."""

    port: int
    draw: random.Random
    over: threading.Event
    written: list[tuple[str, int, str, bool]] = field(default_factory=list)
    contents: dict[str, str] = field(default_factory=dict)
    uploads: dict[str, str] = field(default_factory=dict)
    jobs: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def run(self) -> None:
        """Goes on until told otherwise; a server that is away is asked again."""
        while not self.over.is_set():
            try:
                self._once()
            except (OSError, http.client.HTTPException):
                self.counts["requests without an answer"] += 1
                self.over.wait(0.1)

    def _once(self) -> None:
        choice = self.draw.random()
        if choice < 0.06 or (not self.written and choice < 0.5):
            self._program()
        elif choice < 0.12:
            answer = self.ask("POST", "/api/jobs", {"kind": "write", "parameters": {}})
            self.jobs.append(answer["id"])
        elif choice < 0.25 or not self.written:
            self._upload(self.draw.randrange(1, 2_000_000))
        else:
            self._change(self.draw.choice(self.written)[0])

    def _upload(self, size: int) -> str:
        word = f"{self.draw.random():.12f}"
        text = f"DEF part()\n; {word * (size // 14)}\nPTP {{A1 {word},A2 -90,A3 90}}\nEND\n"
        made = self.ask("POST", f"/api/files?name={word}.src", text.encode())
        self.uploads[made["id"]] = hashlib.sha256(text.encode()).hexdigest()
        return str(made["id"])

    def _program(self) -> None:
        key = self._upload(self.draw.randrange(1, 20_000))
        digest = self.uploads.pop(key)  # whether it is used up is known only with the answer
        name = f"{self.draw.random():.12f}"
        made = self.ask("POST", "/api/programs", {"uploads": [key], "name": name})
        self.contents[made["id"]] = digest
        self._note(made)

    def _change(self, id: str) -> None:
        now = self.ask("GET", f"/api/items/program/{id}")
        choice = self.draw.random()
        if now["deleted"] or (choice < 0.2 and now["version"] > 1):
            self._note(self.ask("POST", f"/api/items/program/{id}/undo?version={now['version']}"))
        elif choice < 0.7:
            name = f"{self.draw.random():.12f}"
            self._note(self.ask("PATCH", f"/api/items/program/{id}", {"name": name}))
        else:
            self._note(self.ask("DELETE", f"/api/items/program/{id}"))

    def _note(self, made: dict[str, Any]) -> None:
        self.written.append((made["id"], made["version"], made["name"], made["deleted"]))

    def ask(self, method: str, path: str, body: object = None) -> dict[str, Any]:
        """Returns the answer; one that is a refusal counts as none."""
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            sent = body if isinstance(body, bytes) else json.dumps(body).encode() if body else None
            line.request(method, path, sent, {"Content-Type": "application/json"})
            answer = line.getresponse()
            found = answer.read()
        finally:
            line.close()
        self.counts[f"answers {answer.status // 100}xx"] += 1
        if answer.status >= 300:
            raise http.client.HTTPException(found.decode())
        return dict(json.loads(found))


@dataclass
class Host:
    """The server, started again whenever it was killed."""

    folder: Path
    port: int
    process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Starts it; who asks too early waits for the port."""
        environment = {**os.environ, "PYTHONPATH": str(HERE)}
        command = [sys.executable, "-c", START, str(self.folder), str(self.port)]
        with (self.folder.parent / "log").open("ab") as told:
            self.process = subprocess.Popen(command, env=environment, stdout=told, stderr=told)

    def answers(self, patience: float = 60.0) -> bool:
        """Returns whether it came up within some seconds."""
        until = time.monotonic() + patience
        while time.monotonic() < until:
            try:
                with socket.create_connection(("127.0.0.1", self.port), timeout=1.0):
                    return True
            except OSError:
                time.sleep(0.05)
        return False

    def kill(self, draw: random.Random) -> str:
        """Kills it, or a process below it; returns which."""
        assert self.process is not None
        below = _below(self.process.pid)
        if below and draw.random() < 0.6:
            name, pid = draw.choice(below)
            _kill(pid)
            return name
        _kill(self.process.pid)
        self.process.wait(60)
        self.start()
        return "server"


def _below(pid: int) -> list[tuple[str, int]]:
    """The processes under one, by what they are; helpers of the interpreter left out."""
    found = []
    for each in _children(pid):
        try:
            command = Path(f"/proc/{each}/cmdline").read_bytes()
        except OSError:
            continue
        if b"resource_tracker" in command:
            continue
        inner = [child for _, child in _below(each)]
        found.append(("process below the server", each))
        found += [("process of a job", child) for child in inner]
    return found


def _children(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):  # whichever thread started them
        try:
            found += [int(each) for each in task.read_text().split()]
        except OSError:
            continue
    return found


def _kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:  # it ended by itself just now
        return


def killed(folder: Path, kills: int, seed: int, longest: float = LONGEST) -> dict[str, int | str]:
    """Returns what became of a workspace whose server was killed that often."""
    draw = random.Random(seed)  # noqa: S311
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    host, over, counts = Host(folder, port), threading.Event(), Counter[str]()
    host.start()
    clients = [Client(port, random.Random(seed + k), over) for k in range(CLIENTS)]  # noqa: S311
    threads = [threading.Thread(target=each.run, daemon=True) for each in clients]
    try:
        for each in threads:
            each.start()
        for _ in range(kills):
            if draw.random() < 0.9:  # else it may die before it stands
                assert host.answers(), (folder.parent / "log").read_text()[-3000:]
                _served(clients, programs=draw.random() < 0.25)
            time.sleep(draw.uniform(0.0, longest))
            counts[f"killed: {host.kill(draw)}"] += 1
        over.set()
        for each in threads:
            each.join(120)
        assert host.answers()
        _finish(clients[0])
    finally:
        over.set()
        if host.process is not None:
            host.process.terminate()
            host.process.wait(60)
    for client in clients:
        counts.update(client.counts)
    return {**_judged(folder, clients), **dict(sorted(counts.items()))}


def _served(clients: list[Client], *, programs: bool) -> None:
    """Waits until something more was acknowledged, or until a program was made."""

    def done() -> int:
        if programs:
            return sum(len(each.contents) for each in clients)
        return sum(len(each.written) + len(each.jobs) + len(each.uploads) for each in clients)

    before, until = done(), time.monotonic() + 20.0
    while done() <= before and time.monotonic() < until:
        time.sleep(0.02)


def _finish(client: Client) -> None:
    """Waits until no job waits or is under way."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        states = [client.ask("GET", f"/api/jobs?state={s}&limit=1") for s in ("queued", "running")]
        if not any(each["total"] for each in states):
            return
        time.sleep(0.2)


def _judged(folder: Path, clients: list[Client]) -> dict[str, int | str]:
    """Compares the workspace with what was acknowledged."""
    from kill_store import PER_JOB, _stands
    from sqlalchemy import text

    from robotrue.store import items, jobs
    from robotrue.store.nouns import DOCUMENT, PROGRAM
    from robotrue.store.records import ItemQuery
    from robotrue.store.verify import verify
    from robotrue.store.workspace import Workspace

    written = [each for client in clients for each in client.written]
    contents = {k: v for client in clients for k, v in client.contents.items()}
    uploads = {k: v for client in clients for k, v in client.uploads.items()}
    asked = [each for client in clients for each in client.jobs]
    with Workspace.open(folder) as workspace:
        lost = sum(not _stands(workspace, *each, noun=PROGRAM) for each in written)
        other = sum(
            items.get(workspace, PROGRAM, id).attachments[0].sha256 != digest
            for id, digest in contents.items()
        )
        away = sum(not _is_there(folder / "incoming" / id, d) for id, d in uploads.items())
        known = [jobs.status(workspace, id) for id in asked]
        every = jobs.search(workspace, limit=1000).items
        done = [each for each in every if each.state == jobs.DONE]
        half = sum(
            items.search(workspace, DOCUMENT, ItemQuery(where={"name": each.id})).total
            != (PER_JOB if each.state == jobs.DONE else 0)
            for each in every
        )
        first = [each.name for each in _all(workspace, PROGRAM)]
        found = verify(workspace)
        with workspace.engine.connect() as connection:
            integrity = str(connection.execute(text("PRAGMA integrity_check")).scalar())
    left = [p for n in ("staged", "scratch") for p in (folder / n).rglob("*") if p.is_file()]
    return {
        "writes acknowledged": len(written),
        "acknowledged writes lost": lost,
        "programs with other content": other,
        "programs made twice of one request": len(first) - len(set(first)),
        "uploads acknowledged, not yet used": len(uploads),
        "acknowledged uploads lost or altered": away,
        "jobs acknowledged": len(asked),
        "jobs done": len(done),
        "jobs begun anew after a death": sum(each.attempts > 1 for each in every),
        "jobs given up after three deaths": sum(each.state == jobs.FAILED for each in every),
        "jobs that never ended": sum(not each.over for each in every)
        + sum(not each.over for each in known),
        "jobs with half or double results": half,
        "faults found by verify": len(found.faults),
        "files no row names": len(found.unnamed),
        "files left over from killed processes": len(left),
        "integrity check": integrity,
    }


def _all(workspace: Any, noun: Any) -> list[Any]:
    """The first versions of all items, deleted ones, too."""
    from robotrue.store import items
    from robotrue.store.records import ItemQuery

    found = []
    for deleted in (False, True):
        page, offset = None, 0
        while page is None or page.items:
            page = items.search(
                workspace, noun, ItemQuery(limit=1000, offset=offset, deleted=deleted)
            )
            offset += 1000
            found += [items.get(workspace, noun, each.id, version=1) for each in page.items]
    return found


def _is_there(place: Path, digest: str) -> bool:
    files = list(place.iterdir()) if place.is_dir() else []
    return [hashlib.sha256(each.read_bytes()).hexdigest() for each in files] == [digest]


def main() -> None:
    asked = argparse.ArgumentParser()
    asked.add_argument("--kills", type=int, default=200)
    asked.add_argument("--seed", type=int, default=1)
    options = asked.parse_args()
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as place:
        found = killed(Path(place) / "shop", options.kills, options.seed)
    for name, value in found.items():
        print(f"{name:>40}  {value}")
    print(f"{'s':>40}  {time.monotonic() - begun:.0f}")


if __name__ == "__main__":
    main()
