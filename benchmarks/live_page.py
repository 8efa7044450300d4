"""Live page: updates that come and are painted each second, and what the server costs.

A formula makes 1,000 estimates a second (nothing here is measured on a robot); they go through the
WebSocket sink to a headless Chromium, which draws them in software: once the sink's own page, once
the page Live of the workbench, past `robotrue serve` in a process of its own.

    python benchmarks/live_page.py [--seconds 10] [--shots DIR] [--rate 50] [--only sink|workbench]
"""

import argparse
import asyncio
import contextlib
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import numpy as np

from robotrue.online.estimates import Doubt, EstimateBlock
from robotrue.online.link import Health
from robotrue.online.sinks import SinkSettings, open_sink

PER_SECOND, BLOCK = 1000, 20


def block(start):
    """A cut that begins, turns and ends, a force that drops out and a pose outside the models."""
    k = np.arange(start, start + BLOCK)
    t = k / PER_SECOND
    cut = np.clip(np.sin(2 * np.pi * t / 8.0) * 3.0, 0.0, 1.0)
    tooth = np.sin(2 * np.pi * 118.0 * t) + 0.3 * np.sin(2 * np.pi * 29.5 * t)
    static = np.stack([-38.0 * cut, 21.0 * cut, -9.0 * cut * (1.0 + 0.2 * np.sin(0.7 * t))], 1)
    shake = np.stack([6.0 * tooth, 9.0 * tooth, 1.5 * tooth], 1) * cut[:, None]
    wander = np.stack([np.sin(0.9 * t), np.cos(0.6 * t), np.sin(0.4 * t)], 1)
    error = (static + shake + wander) * 1e-6
    doubt = np.zeros(BLOCK, dtype=np.int64)
    phase = t % 8.0
    doubt[(phase > 2.2) & (phase < 2.7)] = int(Doubt.BAD_FORCE)
    doubt[(phase >= 2.7) & (phase < 3.0)] = int(Doubt.SETTLING)
    doubt[(phase > 6.0) & (phase < 7.0)] = int(Doubt.EXTRAPOLATED)
    doubt[(phase > 7.2) & (phase < 7.5)] = int(Doubt.OUTSIDE)
    wide = np.where(doubt == int(Doubt.EXTRAPOLATED), 2.5, 1.0)
    hide = np.where((doubt & int(Doubt.INVALID)) == 0, 0.0, np.nan)[:, None]
    force = np.stack([310.0 * cut, -180.0 * cut, 85.0 * cut], 1) * (1.0 + 0.35 * tooth[:, None])
    return EstimateBlock(
        host_time=t + 5000.0,
        error=error + hide,
        sd=np.outer(wide, [2.4e-6, 2.1e-6, 1.8e-6]) + hide,
        static=static * 1e-6 + hide,
        wrench=np.hstack([force, 0.02 * force]) + hide,
        joints=np.radians([12.0, -71.5, 98.2, 4.1, 63.0, -20.0]) + 0.02 * np.outer(t, np.ones(6)),
        sequence=k,
        doubt=doubt,
    )


def healths():
    count = int(time.monotonic() * 250) % 1_000_000
    return (
        Health(name="rsi://0.0.0.0:49152", connected=True, received=count, late=2,
               turnaround_p50=2.1e-5, turnaround_p99=1.4e-4),
        Health(name="rdt://192.0.2.7", connected=True, received=4 * count, lost=3, reconnects=1,
               last_fault="no record for 0.5 s"),
        Health(name="mqtt://broker:1883/robotrue/cell-3", connected=False, received=count // 50,
               dropped=40, last_fault="connection refused"),
    )  # fmt: skip


async def feed(sink, stop):
    """Writes blocks at their times until ``stop`` is set; never hurries to catch up."""
    start, begun = 0, time.monotonic()
    while not stop.is_set():
        await sink.write(block(start))
        start += BLOCK
        late = begun + start / PER_SECOND - time.monotonic()
        if late > 0:
            await asyncio.sleep(late)


async def alone(seconds=5.0):
    """Returns the share of a core that making the estimates costs without any sink."""

    class Nowhere:
        async def write(self, estimates):
            pass

    stop = asyncio.Event()
    feeding = asyncio.create_task(feed(Nowhere(), stop))
    cpu = time.process_time()
    await asyncio.sleep(seconds)
    cpu = (time.process_time() - cpu) / seconds
    stop.set()
    await feeding
    return cpu


@contextlib.asynccontextmanager
async def workbench(port):
    """Serves an empty workspace that listens to the sink; yields its page and the process."""
    import httpx

    start = "from robotrue.cli.main import run; run()"
    with tempfile.TemporaryDirectory() as place, open(f"{place}/log", "w") as log:
        command = [sys.executable, "-c", start, "serve", f"{place}/shop", "--port", "0"]
        process = subprocess.Popen(command, stdout=log, stderr=log)
        try:
            while not (found := re.search(r"at (http://\S+)/", open(f"{place}/log").read())):
                await asyncio.sleep(0.05)
            async with httpx.AsyncClient(base_url=found[1], trust_env=False) as client:
                body = {"address": f"ws://127.0.0.1:{port}", "name": "cell-3"}
                made = (await client.post("/api/live/sources", json=body)).json()
                limits = {"x_um": 40.0, "y_um": 0.0, "z_um": 0.0}
                where = f"/api/live/sources/{made['id']}"
                await client.put(f"{where}/limits", json=limits)
                await asyncio.sleep(2.0)
                yield f"{found[1]}/live", process
                alarms = (await client.get(f"{where}/alarms")).json()["items"]
                print(f"alarms kept by the workbench: {len(alarms)}")
        finally:
            process.terminate()
            process.wait()


def spent(process):
    """CPU-seconds of this process, or of another one, and its memory in MB."""
    if process is None:
        return time.process_time(), float("nan")
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    ticks = os.sysconf("SC_CLK_TCK")
    memory = int(fields[21]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return (int(fields[11]) + int(fields[12])) / ticks, memory


async def look(address, seconds, shots, process=None):
    from playwright.async_api import async_playwright

    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
             "--disable-gpu-compositing", "--disable-accelerated-2d-canvas"]  # fmt: skip
    async with async_playwright() as p:
        browser = await p.chromium.launch(executable_path="/usr/bin/chromium", args=flags)
        found = []
        for name, scheme, locale, size, wait in (
            ("light", "light", "en-GB", (1280, 800), seconds),
            ("dark", "dark", "en-GB", (1280, 800), 9.0 if shots else 0),
            ("chinese", "light", "zh-CN", (1280, 800), 9.0 if shots else 0),
            ("tablet", "dark", "en-GB", (820, 1180), 9.0 if shots else 0),
        ):
            if not wait:
                continue
            context = await browser.new_context(
                color_scheme=scheme, locale=locale, viewport={"width": size[0], "height": size[1]}
            )
            page = await context.new_page()
            faults, hosts = [], set()
            page.on("console", lambda m, f=faults: m.type == "error" and f.append(m.text))
            page.on("pageerror", lambda e, f=faults: f.append(str(e)))
            page.on("request", lambda r, h=hosts: h.add(r.url.split("/")[2]))
            await page.goto(address)
            await page.wait_for_selector("#counts[data-painted]:not([data-painted='0'])")
            first = await page.evaluate(
                "[performance.now(), +counts.dataset.received, +counts.dataset.painted]"
            )
            cpu = spent(process)[0]
            await asyncio.sleep(wait)
            last = await page.evaluate(
                "[performance.now(), +counts.dataset.received, +counts.dataset.painted]"
            )
            cpu = (spent(process)[0] - cpu) / wait
            who = "server and feed" if process is None else "server"
            memory = "" if process is None else f"  {spent(process)[1]:.0f} MB"
            each = await page.evaluate("counts.dataset.paintMs")
            span = (last[0] - first[0]) / 1e3
            if shots:
                await page.screenshot(path=str(shots / f"live_{name}.png"))
            found.append((name, (last[1] - first[1]) / span, (last[2] - first[2]) / span, cpu))
            print(f"{name:8s} come {found[-1][1]:5.1f}/s  painted {found[-1][2]:5.1f}/s, "
                f"{each} ms each  "
                  f"{who} {100 * cpu:4.1f} % of one core{memory}  "
                  f"hosts {sorted(hosts)}  faults {faults}")  # fmt: skip
            await context.close()
        await browser.close()


async def main(seconds, shots, rate, only):
    print(f"without a sink: {100 * await alone():4.1f} % of one core")
    settings = SinkSettings(cell="cell-3", note="simulated", healths=healths)
    sink = open_sink(f"ws://127.0.0.1:0?rate={rate}", settings)
    await sink.open()
    stop = asyncio.Event()
    feeding = asyncio.create_task(feed(sink, stop))
    try:
        if only != "workbench":
            await look(f"http://127.0.0.1:{sink.port}/", seconds, shots)
        if only != "sink":
            print("the page of the workbench")
            async with workbench(sink.port) as (address, process):
                await look(address, seconds, shots, process)
    finally:
        stop.set()
        await feeding
        await sink.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=50.0)
    parser.add_argument("--shots", type=pathlib.Path)
    parser.add_argument("--only", choices=("sink", "workbench"))
    args = parser.parse_args()
    asyncio.run(main(args.seconds, args.shots, args.rate, args.only))
