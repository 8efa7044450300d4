"""``robotrue serve`` under clients that send too much, too slowly or too often; loopback only.

``python benchmarks/hostile_clients.py`` prints one line for each attack: one request head of
300 MB, 1,500 connections that never end their head, 400 password guesses whose bodies come at once.
The limits are those of the command.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import re
import resource
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HEADER = 300 * 1024 * 1024
HALF_OPEN = 1500
GUESSES = 400
PASSWORD = "correct horse"  # noqa: S105
START = "from robotrue.cli.main import run; run()"


class Server:
    """The served workbench."""

    def __init__(self, folder: Path) -> None:
        log = folder / "log"
        command = [sys.executable, "-c", START, "serve", str(folder / "shop"), "--port", "0"]
        with log.open("w") as out:
            self.process = subprocess.Popen(
                [*command, "--password-env", "BENCH_PASSWORD"],
                stdout=out,
                stderr=out,
                env={**os.environ, "BENCH_PASSWORD": PASSWORD},
            )
        until = time.monotonic() + 120.0
        while not (found := re.search(r"at http://127.0.0.1:(\d+)/", log.read_text())):
            if time.monotonic() > until or self.process.poll() is not None:
                raise SystemExit(f"the server did not start: {log.read_text()}")
            time.sleep(0.1)
        self.port = int(found[1])

    def cpu_seconds(self) -> float:
        """Returns what the server's own process has used."""
        stat = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")

    def connections(self) -> int:
        """Returns how many connections the server has open."""
        found = 0
        for each in Path(f"/proc/{self.process.pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                found += each.readlink().name.startswith("socket:")
        return found

    def connect(self, address: str) -> socket.socket:
        """Returns a connection from an address of loopback."""
        return socket.create_connection(("127.0.0.1", self.port), 60.0, source_address=(address, 0))

    def login(self, address: str) -> tuple[int, float]:
        """Returns the answer to the right password, and the seconds until it came."""
        since = time.perf_counter()
        client = http.client.HTTPConnection(
            "127.0.0.1", self.port, 120.0, source_address=(address, 0)
        )
        with contextlib.closing(client):
            client.request("POST", "/login", body=f"secret={PASSWORD.replace(' ', '+')}")
            return client.getresponse().status, time.perf_counter() - since


@contextlib.contextmanager
def measured(server: Server) -> Iterator[dict[str, float]]:
    """Gives CPU seconds of the server and the longest wait of a client that logs in meanwhile."""
    found = {"cpu": server.cpu_seconds(), "wait": 0.0, "refused": 0}
    over = threading.Event()

    def other() -> None:
        while not over.is_set():
            try:
                status, seconds = server.login("127.0.0.9")
            except OSError:
                status, seconds = 0, 0.0
            found["refused"] += status != 303
            found["wait"] = max(found["wait"], seconds)
            over.wait(0.2)

    thread = threading.Thread(target=other)
    thread.start()
    yield found
    over.set()
    thread.join()
    found["cpu"] = server.cpu_seconds() - found["cpu"]


def others(found: dict[str, float]) -> str:
    return (
        f"server {found['cpu']:.2f} s CPU; another address logs in meanwhile: "
        f"{found['refused']:.0f} refused, longest wait {found['wait']:.2f} s"
    )


def endless_header(server: Server) -> None:
    since, sent, piece = time.perf_counter(), 0, b"a" * 65536
    with measured(server) as found:
        with server.connect("127.0.0.2") as connection:
            connection.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Long: ")
            with contextlib.suppress(ConnectionError):
                while sent < HEADER:
                    sent += connection.send(piece)
        seconds = time.perf_counter() - since
    print(
        f"head of {HEADER >> 20} MB: connection ended after {sent / 1e6:.1f} MB sent, "
        f"{seconds:.2f} s; {others(found)}"
    )


def half_open(server: Server) -> None:
    with contextlib.ExitStack() as stack, measured(server) as found:
        before, most = server.connections(), 0
        for _ in range(HALF_OPEN):
            connection = stack.enter_context(server.connect("127.0.0.2"))
            with contextlib.suppress(ConnectionError):
                connection.sendall(b"GET / HTTP/1.1\r\nHost: ")
            most = max(most, server.connections() - before)
        since = time.perf_counter()
        while server.connections() > before + 1 and time.perf_counter() - since < 60.0:
            time.sleep(0.1)
        seconds, left = time.perf_counter() - since, server.connections() - before
    print(
        f"{HALF_OPEN} half-open heads: at most {most} open at a time, {left} open {seconds:.1f} s "
        f"after the last; {others(found)}"
    )


def guesses(server: Server) -> None:
    body = b"secret=guess"
    head = b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n"
    head += b"Expect: 100-continue\r\nContent-Length: %d\r\n\r\n" % len(body)
    ready = threading.Barrier(GUESSES)

    def guess(_: int) -> str:
        said = b""
        try:
            with server.connect("127.0.0.3") as connection:
                connection.sendall(head)
                said = connection.recv(65536)
                ready.wait(60.0)
                connection.sendall(body)
                said = connection.recv(65536)
        except ConnectionError:
            with contextlib.suppress(threading.BrokenBarrierError):
                if not said:
                    ready.wait(60.0)
        return said.split(b" ")[1].decode() if said else "dropped"

    with measured(server) as found, ThreadPoolExecutor(GUESSES) as pool:
        codes = Counter(pool.map(guess, range(GUESSES)))
    told = {"403": "compared", "429": "refused uncompared", "dropped": "connections dropped"}
    counts = ", ".join(f"{codes[code]} {said}" for code, said in told.items())
    fresh, _ = server.login("127.0.0.4")
    print(f"{GUESSES} guesses at once: {counts} {dict(codes)}; {others(found)}")
    print(f"right password of a fresh address afterwards: HTTP {fresh} (303 is in)")


def main() -> None:
    resource.setrlimit(
        resource.RLIMIT_NOFILE, (4096, max(4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    )
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder))
        try:
            server.login("127.0.0.9")
            endless_header(server)
            half_open(server)
            guesses(server)
        finally:
            server.process.terminate()
            server.process.wait(20.0)


if __name__ == "__main__":
    main()
