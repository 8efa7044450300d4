"""Builds the wheel and tries it in clean environments, as a user would install it.

    python scripts/smoke_wheel.py                    # with each Python 3.11 to 3.13 found here
    python scripts/smoke_wheel.py --python python3.12

For each interpreter: a new virtual environment, the wheel with the extra ``all`` and the pinned
versions of ``constraints.txt``, and then, away from the checkout: ``robotrue doctor``, the demo, a
program compensated, and a page of the workbench fetched from ``robotrue serve``.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import Final

HOME: Final = Path(__file__).resolve().parents[1]
VERSIONS: Final = ("3.11", "3.12", "3.13")
PATIENCE: Final = 120
"""s that the workbench may take to answer before it counts as failed."""


def find_interpreters() -> list[str]:
    """Returns an executable for each supported Python of this computer."""
    found = []
    for version in VERSIONS:
        beside = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
        path = shutil.which(f"python{version}")
        # A pyenv shim answers for versions that are not selected by failing: the real one first.
        candidates = [str(beside[-1])] if beside else [path] if path else []
        found += [each for each in candidates if _answers(each, version)]
    return found


def _answers(python: str, version: str) -> bool:
    told = subprocess.run([python, "-V"], capture_output=True, text=True)  # noqa: S603
    return told.returncode == 0 and told.stdout.split()[-1].startswith(f"{version}.")


def call(*arguments: str | Path, cwd: Path) -> str:
    """Returns what a command prints.

    Raises:
        SystemExit: It fails; its output is in the message.
    """
    # The checkout must not answer for the wheel.
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "PIP_"))}
    done = subprocess.run(  # noqa: S603
        [str(each) for each in arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise SystemExit(
            f"{' '.join(map(str, arguments))}: exit {done.returncode}\n{done.stdout}{done.stderr}"
        )
    return done.stdout


def try_wheel(wheel: Path, python: str, folder: Path) -> None:
    """Installs a wheel in a new environment below a folder and uses it.

    Raises:
        SystemExit: A step fails.
    """
    call(python, "-m", "venv", folder / "env", cwd=folder)
    programs = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
    call(
        programs / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
        "-c", HOME / "constraints.txt", f"robotrue[all] @ {wheel.as_uri()}", cwd=folder,
    )  # fmt: skip
    robotrue = programs / "robotrue"
    found = json.loads(call(robotrue, "doctor", "--json", cwd=folder))
    lacking = {name for name, there in found["extras"].items() if not there} - {"postgres"}
    if found["faults"] or lacking:
        raise SystemExit(f"robotrue doctor: {found['faults']}, extras not installed: {lacking}")
    call(robotrue, "demo", "--out", folder / "demo", cwd=folder)
    call(robotrue, "calibrate", "cell.toml", "calibration.csv", "-o", "again.robotrue",
         "--method", "elastic", cwd=folder / "demo")  # fmt: skip
    call(robotrue, "compensate", "again.robotrue", "flange_hole.src", "-o", "again.src",
         cwd=folder / "demo")  # fmt: skip
    _fetch_page(robotrue, folder)


def _fetch_page(robotrue: Path, folder: Path) -> None:
    """Starts the workbench on a free port, waits for its first page, and ends it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [str(robotrue), "serve", "workspace", "--port", str(port)]
    server = subprocess.Popen(  # noqa: S603
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    until = time.monotonic() + PATIENCE
    try:
        while True:
            try:
                page = urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=10).read()
                break
            except OSError as cause:  # refused, reset, or no answer in time
                if server.poll() is not None or time.monotonic() > until:
                    told = server.stdout.read() if server.poll() is not None else str(cause)
                    raise SystemExit(f"robotrue serve did not answer: {told}") from None
                time.sleep(0.2)
    finally:
        server.terminate()
        server.wait(30)
    if b"robotrue" not in page:
        raise SystemExit(f"robotrue serve: not its page: {page[:300]!r}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds the wheel and prints a line for each interpreter."""
    parser = argparse.ArgumentParser(description="The wheel, tried in clean environments.")
    parser.add_argument("--python", action="append", help="an interpreter; may be repeated")
    wanted = parser.parse_args(arguments).python or find_interpreters()
    if not wanted:
        raise SystemExit(f"no Python {', '.join(VERSIONS)} was found.")
    with tempfile.TemporaryDirectory(prefix="robotrue-wheel-") as name:
        folder = Path(name)
        call(sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check",
             "--no-deps", "--wheel-dir", folder, HOME, cwd=folder)  # fmt: skip
        (wheel,) = folder.glob("robotrue-*.whl")
        for k, python in enumerate(wanted):
            place = folder / str(k)
            place.mkdir()
            try_wheel(wheel, python, place)
            version = call(python, "-V", cwd=folder).strip()
            sys.stdout.write(f"{wheel.name}: installed, demo, workbench on {version}\n")
            sys.stdout.flush()
            shutil.rmtree(place)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
