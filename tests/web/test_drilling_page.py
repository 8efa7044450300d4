"""The page Drilling in a browser: campaign, model, test and report, the monitor of a session."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
from serving import watching
from web_shop import Served

from robotrue.simulation.drilling_machine import drilling_machine, write_practice_files


def test_from_campaign_to_report(browser: Any, served: Served, tmp_path: Path) -> None:
    write_practice_files(drilling_machine(4), tmp_path, seed=4)
    with watching(browser, served, locale="en-GB") as seen:
        page = seen.page
        page.goto("/drilling?view=model")
        seen.drop(tmp_path / "foot.toml", tmp_path / "simulated-campaign.csv")
        seen.find("campaigns").wait_for()
        seen.drop(tmp_path / "simulated-test.csv")
        page.wait_for_function("document.querySelectorAll('[data-testid=learn]').length === 2")
        campaigns = {
            each["name"]: each["id"]
            for each in httpx.get(f"{served.address}/api/items/document", trust_env=False).json()[
                "items"
            ]
            if each["kind"] == "drilling campaign"
        }
        asked = {"campaign": campaigns["simulated-campaign"], "kind": "patent"}
        page.evaluate("(p) => { bench.job('drill_fit', p); }", asked)
        seen.find("trials").wait_for()
        assert "linear" in seen.find("drill-model").inner_text()
        seen.find("judge").click()
        seen.find("drill-tests").wait_for()
        assert seen.find("drill-monitor").get_attribute("data-holes") == "30"
        report = seen.find("drill-report").get_attribute("href")
        found = httpx.get(f"{served.address}{report}", trust_env=False)
        assert found.status_code == 200
        assert "simulated" in found.text.lower()


def entries(hole: str, left: float, *, alarm: bool = False, frozen: int = 0) -> str:
    """A move and what a gauge measured after it, as a session writes them."""
    move = {
        "kind": "answer", "hole": hole, "version": 3, "status": "move", "a_deg": 1.2,
        "b_deg": -0.8, "a_sigma_deg": 0.002, "b_sigma_deg": 0.002,
        "written_utc": "2026-03-01T12:00:00.000+00:00",
    }  # fmt: skip
    reference = {
        "kind": "reference", "hole": hole, "version": 3, "left_a_deg": left, "left_b_deg": 0.0,
        "status": "alarm" if alarm else "recorded", "truth": "hole gauge (simulated)",
        "shift_deg": [left, 0.0], "said": "", "frozen": frozen,
    }  # fmt: skip
    return json.dumps(move) + "\n" + json.dumps(reference) + "\n"


def test_a_session_is_followed(browser: Any, served: Served) -> None:
    place = served.folder / "drilling"
    place.mkdir(exist_ok=True)
    journal = place / "line-1.jsonl"
    journal.write_text("".join(entries(f"H{k}", 0.01 * k, frozen=2) for k in range(1, 4)))
    with watching(browser, served, locale="en-GB") as seen:
        page = seen.page
        page.goto("/drilling")
        monitor = seen.find("drill-monitor")
        monitor.and_(page.locator("[data-holes='3']")).wait_for()
        assert seen.find("drill-alarms").inner_text() == "0"
        assert "frozen as 2" in monitor.inner_text()
        page.locator(".simulated").wait_for()
        with journal.open("a") as file:
            file.write(entries("H4", 0.2, alarm=True))
        monitor.and_(page.locator("[data-holes='4']")).wait_for()
        listed = seen.find("drill-alarm-list").inner_text()
        assert "+0.200 deg in a" in listed
        assert "Frozen version 2 is thawed" in listed
        assert "alarm" in seen.find("drill-holes").locator("tbody tr").first.inner_text()
        page.set_viewport_size({"width": 820, "height": 1100})
        assert page.evaluate("document.documentElement.scrollWidth") <= 820
