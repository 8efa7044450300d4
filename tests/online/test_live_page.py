"""The live page in a browser: what a person at the machine sees and does."""

import asyncio
import contextlib
import itertools
import shutil

import numpy as np
import pytest
from estimate_cases import estimates

from robotrue.online.estimates import Doubt
from robotrue.online.link import Health
from robotrue.online.sinks import SinkSettings, open_sink

playwright = pytest.importorskip("playwright.async_api")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs the Debian package chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-gpu-compositing"]
NOW = "document.querySelector('#errors td:nth-child(2)').textContent"
DOUBT = np.zeros(3000, dtype=np.int64)
DOUBT[1000:1500] = int(Doubt.BAD_FORCE)
DOUBT[2000:2500] = int(Doubt.EXTRAPOLATED)


async def _text(page, selector):
    return await page.locator(selector).inner_text(timeout=15_000)


async def _until(page, script):
    async with asyncio.timeout(20):  # the page's own policy forbids wait_for_function
        while not await page.evaluate(script):
            await asyncio.sleep(0.02)


@contextlib.asynccontextmanager
async def _fed(sink, start, doubt):
    """Estimates come, 50 blocks a second, for as long as the block lasts."""

    async def feed():
        for k in itertools.count(start, 20):
            await sink.write(estimates(k, 20, doubt=doubt))
            await asyncio.sleep(0.02)

    feeding = asyncio.create_task(feed())
    try:
        yield
    finally:
        feeding.cancel()
        await asyncio.gather(feeding, return_exceptions=True)


async def _blue_share(page, selector, left, right):
    """Share of the pixels between two fractions of the width that have the colour of a trace."""
    return await page.evaluate(
        """([selector, left, right]) => {
          const canvas = document.querySelector(selector);
          const from = Math.round(58 + left * (canvas.width - 66));
          const wide = Math.round((right - left) * (canvas.width - 66));
          const data = canvas.getContext("2d").getImageData(from, 0, wide, canvas.height).data;
          let found = 0;
          for (let i = 0; i < data.length; i += 4)
            if (data[i + 2] - data[i] > 60) found++;
          return found / (data.length / 4);
        }""",
        [selector, left, right],
    )


async def _scene(page, sink, hosts, faults):
    await page.goto(f"http://127.0.0.1:{sink.port}/")
    await _until(page, "document.getElementById('link').dataset.state === 'up'")
    for k in range(0, 3000, 100):
        await sink.write(estimates(k, 100, doubt=DOUBT[k : k + 100]))
    await page.select_option("#window", "2")
    await _until(page, f"{NOW}.length > 1")
    found = {"title": await page.title(), "note": await _text(page, "#note")}
    found["links"] = await _text(page, "#links tbody")
    await page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 200)))")
    # the window shows 1 s to 3 s: flagged from 0 to 1/4, sound to 1/2, physics alone to 3/4
    found["gap"] = await _blue_share(page, "#error-x", 0.03, 0.22)
    found["sound"] = await _blue_share(page, "#error-x", 0.28, 0.47)
    await _until(page, "document.getElementById('state').dataset.state === 'bad'")
    found["stale"] = await _text(page, "#state")
    await _until(page, f"{NOW} === '—'")
    await page.keyboard.press("Space")
    await _until(page, "!document.getElementById('veil').hidden")
    await page.keyboard.press("Space")
    await _until(page, "document.getElementById('veil').hidden")
    async with _fed(sink, 3000, Doubt.NONE):
        await _until(page, "document.getElementById('state').dataset.state === 'good'")
        await _until(page, f"{NOW} !== '—'")
    async with _fed(sink, 200_000, Doubt.OUTSIDE):
        await _until(page, "document.getElementById('state').textContent.includes('outside')")
        await _until(page, f"{NOW} === '—'")
    await page.click("#language")
    found["chinese"] = await _text(page, "#pause")
    found["lang"] = await page.evaluate("document.documentElement.lang")
    return {**found, "hosts": hosts, "faults": faults}


@pytest.fixture(scope="module")
def seen():
    healths = (Health(name="rsi://x", connected=True, late=3, turnaround_p50=2e-5),)

    async def run():
        settings = SinkSettings(
            cell="c7", note="simulated", healths=lambda: healths, environment={}
        )
        sink = open_sink("ws://127.0.0.1:0", settings)
        await sink.open()
        try:
            async with playwright.async_playwright() as p:
                browser = await p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
                page = await browser.new_page(locale="en-GB", color_scheme="light")
                hosts, faults = set(), []
                page.on("request", lambda r: hosts.add(r.url.split("/")[2].split(":")[0]))
                page.on("console", lambda m: m.type == "error" and faults.append(m.text))
                page.on("pageerror", lambda e: faults.append(str(e)))
                try:
                    return await asyncio.wait_for(_scene(page, sink, hosts, faults), 90)
                finally:
                    await browser.close()
        finally:
            await sink.close()

    return asyncio.run(run())


def test_nothing_is_asked_of_another_host_and_nothing_fails(seen):
    assert seen["hosts"] == {"127.0.0.1"}
    assert seen["faults"] == []


def test_simulated_stands_where_everybody_sees_it(seen):
    assert seen["note"].lower() == "simulated"
    assert seen["title"].startswith("simulated: c7")


def test_no_line_leads_over_a_stretch_that_is_not_valid(seen):
    assert seen["sound"] > 0.01
    assert seen["gap"] == 0.0


def test_the_state_is_that_of_now(seen):
    assert "Nothing has come for" in seen["stale"]


def test_counters_and_languages(seen):
    assert "rsi://x" in seen["links"]
    assert "0.02" in seen["links"]
    assert seen["chinese"] == "暂停"
    assert seen["lang"] == "zh-CN"
