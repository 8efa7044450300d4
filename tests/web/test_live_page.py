"""The page Live in a browser: a sensing service past the workbench, limits, alarms kept."""

from __future__ import annotations

import asyncio
import itertools
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from serving import watching
from web_shop import Served

sys.path.insert(0, str(Path(__file__).parents[1] / "online"))

from estimate_cases import estimates

from robotrue.online.link import Health
from robotrue.online.sinks import SinkSettings, open_sink

NOW = "(document.querySelector('#errors td:nth-child(2)')?.textContent ?? '')"


@pytest.fixture
def sensing() -> Iterator[str]:
    """A sensing service's sink, fed by a formula in a thread; its address."""
    there, ended, found = threading.Event(), threading.Event(), []

    async def serve() -> None:
        healths = (Health(name="rsi://x", connected=True, late=3),)
        settings = SinkSettings(
            cell="c7", note="simulated", joints=6, healths=lambda: healths, environment={}
        )
        sink = open_sink("ws://127.0.0.1:0", settings)
        await sink.open()
        found.append(f"ws://127.0.0.1:{sink.port}")
        there.set()
        for k in itertools.count(0, 20):
            if ended.is_set():
                break
            await sink.write(estimates(k, 20))
            await asyncio.sleep(0.02)
        await sink.close()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    try:
        assert there.wait(20.0)
        yield found[0]
    finally:
        ended.set()
        thread.join(20.0)


def test_a_service_is_watched_and_its_alarms_are_kept(
    browser: Any, served: Served, sensing: str
) -> None:
    with watching(browser, served, locale="en-GB") as seen:
        page = seen.page
        page.goto("/live")
        seen.find("live-address").fill(sensing)
        seen.find("live-watch").click()
        page.wait_for_url("**/live?source=*")
        page.wait_for_function("document.getElementById('state')?.dataset.state === 'good'")
        assert page.locator("#note").inner_text().lower() == "simulated"
        assert "rsi://x" in page.locator("#links tbody").inner_text()
        page.wait_for_function("+document.getElementById('counts')?.dataset.painted > 0")
        source = page.url.rpartition("=")[2]
        seen.find("limit-x").fill("25")
        seen.find("limits-save").click()
        seen.find("alarm-now").wait_for()

        api = httpx.Client(base_url=served.address, trust_env=False)
        api.put(
            f"/api/live/sources/{source}/limits", json={"x_um": 60.0, "y_um": 0.0, "z_um": 0.0}
        ).raise_for_status()
        seen.find("alarm-now").wait_for(state="detached")
        page.reload()
        row = seen.find("alarms").locator("tbody tr").first
        assert "ex" in row.inner_text()
        (alarm,) = api.get(f"/api/live/sources/{source}/alarms").json()["items"]
        assert alarm["over"]
        assert 25.0 < abs(alarm["value_um"]) <= 40.0
        assert alarm["band_um"] == pytest.approx(4.0)
        assert len(api.get(f"/api/live/sources/{source}/alarms.csv").text.splitlines()) == 2
        page.wait_for_function(f"{NOW} !== ''")
        assert seen.find("limit-x").input_value() == "60"
        page.set_viewport_size({"width": 820, "height": 1100})
        assert page.evaluate("document.documentElement.scrollWidth") <= 820
        api.delete(f"/api/items/document/{source}").raise_for_status()
        api.close()
