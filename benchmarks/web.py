"""The workbench: start, memory, uploads, and pictures a second of the 3-D view drawn in software.

    python benchmarks/web.py [--quick] [--first-page]

A fresh server of a fresh workspace on a free port. Times are wall clock with the processor time of
the processes concerned beside it: on a busy machine the latter is what the program costs. The scene
is synthetic (2,000 arrows and a path of 100,000 points, seed 1), turned by the mouse in headless
Chromium; its row says how coarse the picture had become. The first page is compared with a page of
bare FastAPI, in turn in the same run; ``--first-page`` prints this alone.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CHROMIUM = "/usr/bin/chromium"
FLAGS = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-accelerated-2d-canvas",
    "--no-sandbox",
]
CELL = 'schema = 1\n[robot]\npreset = "KUKA KR160 R1570"\n'
TICK = os.sysconf("SC_CLK_TCK")
STARTS, FIRST_PAGE_S, BARE_PAGES = 5, 1.3, 2.5
SERVE = "from robotrue.cli.main import run; run()"
BARE = """
import socket, sys, uvicorn
from fastapi import FastAPI
from fastapi.responses import HTMLResponse
app = FastAPI()
@app.get("/", response_class=HTMLResponse)
def page() -> str:
    return "<!doctype html><title>bare</title>"
listener = socket.create_server(("127.0.0.1", 0))
print(f"at http://127.0.0.1:{listener.getsockname()[1]}/", flush=True)
uvicorn.Server(uvicorn.Config(app, log_level="error")).run(sockets=[listener])
"""
SCENE = """([arrows, points]) => {
  let state = 1; const random = () => (state = (state * 48271) % 2147483647) / 2147483647;
  const some = (n, scale, shift) =>
    Float32Array.from({length: 3 * n}, () => scale * random() + shift);
  const view = window.benchScene;
  view.arrows("arrows", some(arrows, 1.2, -0.2), some(arrows, 2e-3, -1e-3), {top: 2e-3});
  const path = new Float32Array(3 * points), error = new Float32Array(points);
  for (let i = 0; i < points; i++) {
    const turn = i / 60, height = 0.4 + (0.5 * i) / points;
    path.set([0.9 + 0.3 * Math.cos(turn), 0.3 * Math.sin(turn), height], 3 * i);
    error[i] = 1e-3 * random();
  }
  view.near = true; view.toolPath(path, error, 1e-3); view.frames = 0;
}"""


def cpu(pid: int, named: str = "") -> float:
    """Processor time of a process and all below it, s; of those with a word in their name."""
    total, waiting = 0.0, [pid]
    children: dict[int, list[int]] = {}
    times: dict[int, float] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = entry.read_text().rpartition(")")
            fields = rest.split()
        except OSError:
            continue
        own = int(entry.parent.name)
        children.setdefault(int(fields[1]), []).append(own)
        if named in name:
            times[own] = (int(fields[11]) + int(fields[12])) / TICK
    while waiting:
        each = waiting.pop()
        total += times.get(each, 0.0)
        waiting += children.get(each, [])
    return total


def resident(pid: int) -> float:
    """Resident memory of one process, MB."""
    found = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())
    return int(found[1]) / 1024.0 if found else float("nan")


@contextmanager
def served(folder: Path, source: str = SERVE) -> Iterator[tuple[str, int, float, float]]:
    """A fresh server: address, process, s to the first page, s of processor time for it."""
    command = [sys.executable, "-c", source]
    log = folder / "log"
    begin = time.perf_counter()
    with log.open("w") as told:
        process = subprocess.Popen(
            [*command, "serve", str(folder / "shop"), "--port", "0"], stderr=told, stdout=told
        )
    try:
        while not (found := re.search(r"at (http://\S+)/", log.read_text())):
            assert process.poll() is None, log.read_text()
            time.sleep(0.01)
        urllib.request.urlopen(found[1] + "/", timeout=60).read()  # noqa: S310
        took = time.perf_counter() - begin
        yield found[1], process.pid, took, cpu(process.pid)
    finally:
        process.terminate()
        process.wait(20)


def row(case: str, reach: str, measured: str, good: bool) -> None:
    """One line of the common table."""
    print(f"RESULT | {case} | - | {reach} | {measured} | {'reached' if good else 'missed'}")


def upload(address: str, pid: int, megabytes: int) -> None:
    """Sends a file of random bytes and looks at the server's memory meanwhile."""
    with tempfile.NamedTemporaryFile() as big:
        for _ in range(megabytes):
            big.write(os.urandom(1 << 20))
        big.flush()
        before, most = resident(pid), 0.0
        sender = subprocess.Popen(
            [
                *("curl", "-sf", "-o", os.devnull, "-T", big.name, "-X", "POST"),
                f"{address}/api/files?name=big.src",
            ]
        )
        while sender.poll() is None:
            most = max(most, resident(pid))
            time.sleep(0.02)
    assert sender.returncode == 0, "the file was not taken"
    grown = most - before
    row(f"upload of {megabytes} MB, growth", "<= 64 MB", f"{grown:.1f} MB", grown <= 64.0)


def compare_first_pages(folder: Path) -> None:
    """Starts the workbench and a bare page in turn; prints medians of wall and processor time."""
    times: dict[str, list[tuple[float, float]]] = {SERVE: [], BARE: []}
    for _ in range(STARTS):
        for source, measured in times.items():
            with served(folder, source) as (_, _, took, spent):
                measured.append((took, spent))
    (ours, ours_cpu), (bare, bare_cpu) = (
        tuple(map(statistics.median, zip(*measured, strict=True))) for measured in times.values()
    )
    told = (
        f"{ours:.2f} s ({ours_cpu:.2f} s CPU); bare FastAPI {bare:.2f} s ({bare_cpu:.2f} s CPU): "
        f"{ours / bare:.1f} bare pages"
    )
    good = ours <= FIRST_PAGE_S or ours <= BARE_PAGES * bare
    row(f"first page, cold, median of {STARTS}", "<= 1.3 s or 2.5 bare pages", told, good)


def pictures(address: str, seconds: float) -> None:
    """Turns the scene with the mouse; counts pictures, and what each cost the browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(120_000)
        page.goto(address)
        page.wait_for_selector('[data-testid="scene"][data-state="ready"]')
        page.evaluate(SCENE, [2000, 100_000])
        page.mouse.move(700, 500)
        page.mouse.down()
        began, spent = time.perf_counter(), cpu(os.getpid(), "chrom")
        turned = 0
        while time.perf_counter() - began < seconds:
            turned += 1
            page.mouse.move(700 + 250 * ((turned % 40) / 40), 500 + 60 * ((turned % 17) / 17))
        took = time.perf_counter() - began
        frames, coarse = page.evaluate("[window.benchScene.frames, window.benchScene.coarse]")
        cost = (cpu(os.getpid(), "chrom") - spent) / max(frames, 1)
        page.mouse.up()
        browser.close()
    case = "3-D view, 2,000 arrows and 100,000 points, turned (simulated scene)"
    told = f"{frames / took:.1f} /s, {1e3 * cost:.0f} ms CPU each, resolution x{coarse:.2f}"
    row(case, ">= 15 /s", told, frames / took >= 15.0)


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a smaller file, a shorter turn")
    parser.add_argument("--first-page", action="store_true", help="only the first page")
    stated = parser.parse_args()
    quick = stated.quick
    with tempfile.TemporaryDirectory() as place:
        with served(Path(place)):  # sets the workspace up, and the byte code is written
            pass
        compare_first_pages(Path(place))
        if stated.first_page:
            return
        with served(Path(place)) as (address, pid, took, spent):
            told = f"{took:.2f} s, {spent:.2f} s CPU"
            row("serve to first page, cold", "<= 2 s", told, took <= 2.0)
            row("memory idle", "<= 150 MB", f"{resident(pid):.0f} MB", resident(pid) <= 150.0)
            upload(address, pid, 20 if quick else 200)
            sent = subprocess.run(
                ["curl", "-s", "--data-binary", CELL, f"{address}/api/files?name=cell.toml"],
                capture_output=True,
                check=True,
            )
            key = re.search(r'"id":"(\w+)"', sent.stdout.decode())
            assert key is not None, sent.stdout
            body = f'{{"uploads":["{key[1]}"]}}'
            subprocess.run(
                [
                    *("curl", "-s", "-o", os.devnull, "-H", "Content-Type: application/json"),
                    *("-d", body, f"{address}/api/cells"),
                ],
                check=True,
            )
            pictures(address, 4.0 if quick else 10.0)


if __name__ == "__main__":
    main()
