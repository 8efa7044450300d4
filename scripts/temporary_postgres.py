"""A PostgreSQL server for tests and developers, in a temporary folder that goes with it.

``python scripts/temporary_postgres.py`` starts one, prints its URL and runs until Ctrl-C.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PACKAGE = "postgresql"
USER = "robotrue"
PATIENCE = 30.0
"""s until it must answer."""


class NotInstalled(Exception):
    """The server's programs are not there; the message names the Debian package."""


def programs() -> Path:
    """Returns the folder of the newest server's programs."""
    found = sorted(
        Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda each: int(each.parts[-3])
    )
    if found:
        return found[-1].parent
    on_path = shutil.which("initdb")
    if on_path is None:
        raise NotInstalled(f"PostgreSQL is not installed: apt-get install {PACKAGE}")
    return Path(on_path).resolve().parent


@dataclass
class Server:
    """A server that can be restarted.

    Attributes:
        url: Of its first database.
    """

    url: str
    bin: Path
    folder: Path
    port: int
    who: dict[str, object]
    process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Starts it and waits until it answers."""
        command = [self.bin / "postgres", "-D", self.folder / "data", "-p", str(self.port)]
        options = ["-k", self.folder, "-c", "listen_addresses=127.0.0.1", "-c", "fsync=off"]
        with (self.folder / "log").open("ab") as log:
            self.process = subprocess.Popen(  # noqa: S603
                [*command, *options], **self.who, stdout=subprocess.DEVNULL, stderr=log
            )
        _answering(self.bin, self.process, self.port, self.folder / "log")

    def stop(self, *, fast: bool) -> None:
        """Stops it: ``fast`` rolls transactions back and ends sessions, otherwise it just ends."""
        if self.process is None:
            return
        self.process.send_signal(signal.SIGINT if fast else signal.SIGQUIT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(PATIENCE)
        self.process.kill()


@contextlib.contextmanager
def server() -> Iterator[Server]:
    """Gives a server in a temporary folder; both end with the block."""
    bin = programs()
    folder = Path(tempfile.mkdtemp(prefix="robotrue-postgres-"))
    password = secrets.token_urlsafe(12)
    (folder / "password").write_text(password)
    who = _owner(folder)
    try:
        initdb = [bin / "initdb", "-D", folder / "data", "-U", USER, "--no-sync"]
        secret = ["--auth=scram-sha-256", f"--pwfile={folder / 'password'}"]
        made = subprocess.run(  # noqa: S603
            [*initdb, *secret, "-E", "UTF8", "--locale=C"], **who, capture_output=True, text=True
        )
        if made.returncode:
            raise RuntimeError(made.stderr)
        port = _free_port()
        url = f"postgresql+psycopg://{USER}:{password}@127.0.0.1:{port}/postgres"
        started = Server(url=url, bin=bin, folder=folder, port=port, who=who)
        try:
            started.start()
            yield started
        finally:
            started.stop(fast=False)  # at once: all of it is thrown away
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def running() -> Iterator[str]:
    """Gives the URL of a server's first database; the server ends with the block."""
    with server() as started:
        yield started.url


def _owner(folder: Path) -> dict[str, object]:
    """Who runs it: the server refuses root, so then it is the package's own user."""
    if os.name != "posix" or os.geteuid() != 0:
        return {}
    for path in (folder, folder / "password"):
        shutil.chown(path, "postgres", "postgres")
    return {"user": "postgres", "group": "postgres", "extra_groups": [], "cwd": folder}


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def _answering(bin: Path, server: subprocess.Popen[bytes], port: int, log: Path) -> None:
    until = time.monotonic() + PATIENCE
    ready = [bin / "pg_isready", "-q", "-h", "127.0.0.1", "-p", str(port)]
    while subprocess.run(ready).returncode:  # noqa: S603
        if server.poll() is not None or time.monotonic() > until:
            raise RuntimeError(f"PostgreSQL did not start: {log.read_text()[-2000:]}")
        time.sleep(0.05)


def main() -> None:
    """Starts one and waits."""
    try:
        with running() as url:
            sys.stdout.write(f"export ROBOTRUE_DB='{url}'\nCtrl-C ends it and deletes it.\n")
            sys.stdout.flush()
            with contextlib.suppress(KeyboardInterrupt):
                signal.pause()
    except NotInstalled as missing:
        raise SystemExit(str(missing)) from None


if __name__ == "__main__":
    main()
