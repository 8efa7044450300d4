"""A whole session at the part in a browser: a wrong touch caught, server killed, an end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from serving import Watched, serving, watching
from touch_shop import Bench, touch_bench, write_touch_files
from web_shop import Served

WRONG = 4
"""Touch that is made at another point than the one asked for."""
Entered = Callable[[str], None]


def state_of(served: Served, id: str) -> dict[str, Any]:
    return dict(httpx.get(f"{served.address}/api/touching/{id}", timeout=60.0).json())


def enter(watched: Watched, served: Served, id: str, bench: Bench, *, at: int | None = None) -> int:
    """Touches what the page proposes and types in what the controller shows; returns the point."""
    seen = state_of(served, id)
    feature = int(seen["next"]["feature"])
    assert watched.find("next-name").inner_text() == seen["features"][feature]["name"]
    point = seen["features"][feature if at is None else at]["point_mm"]
    watched.find("reading").fill(bench.line(point, seen["next"]["joints_deg"]))
    watched.page.keyboard.press("Enter")
    watched.page.wait_for_function(
        "v => Number(document.querySelector('[data-testid=touch]')?.dataset.version) > v",
        arg=seen["version"],
    )
    return feature


def begin(watched: Watched, served: Served, folder: Path) -> str:
    """A cell, and a session that begins with a list of features."""
    write_touch_files(folder)
    watched.page.goto("/")
    watched.drop(folder / "cell.toml")
    watched.find("scene").wait_for()
    watched.page.goto("/registration")
    watched.find("features-file").set_input_files(str(folder / "block simulated.csv"))
    watched.find("begin-tolerance").fill("2.5")
    watched.find("begin-form").locator("details summary").click()
    watched.find("begin-rough_mm").fill("50")
    watched.find("begin").click()
    watched.find("next").wait_for()
    return str(watched.page.url.split("id=")[1])


def test_a_session_from_the_first_touch_to_the_kept_frame(
    browser: Any, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder, bench = tmp_path_factory.mktemp("touched") / "shop", touch_bench()
    with serving(folder) as served:
        with watching(browser, served) as watched:
            id = begin(watched, served, tmp_path)
            for _ in range(WRONG - 1):
                enter(watched, served, id, bench)
            watched.page.reload()
            watched.find("radius").wait_for()
            seen = state_of(served, id)
            assert seen["kept"] == WRONG - 1
            asked = seen["next"]["feature"]
            other = next(
                k
                for k, each in enumerate(seen["features"])
                if each["state"] == "open"
                and k != asked
                and each["name"][:3] == seen["features"][asked]["name"][:3]
            )
            enter(watched, served, id, bench, at=other)
            assert "σ" in watched.find("held-off").inner_text()
            assert seen["features"][other]["name"] in watched.find("suspicions").inner_text()
        served.process.kill()  # between the reading and the decision
        served.process.wait(10.0)
    with serving(folder) as served, watching(browser, served) as watched:
        watched.page.goto(f"/registration?id={id}")
        watched.find("held").wait_for()
        watched.find("retake").click()
        watched.find("next").wait_for()
        assert state_of(served, id)["kept"] == WRONG - 1
        with watching(browser, served) as other_one:  # a colleague looks on
            other_one.page.goto(f"/registration?id={id}")
            other_one.find("next").wait_for()
            touched = enter(watched, served, id, bench)
            row = other_one.page.locator(f'[data-feature="{touched}"] .tag.good')
            row.wait_for()
        watched.find("undo").click()
        watched.page.locator(f'[data-feature="{touched}"] .tag.plain').wait_for()
        for _ in range(2):
            enter(watched, served, id, bench)
        assert watched.find("estimate").locator("b").first.inner_text() in ("GO", "NO-GO")
        for size in ((1280, 800), (820, 1180)):
            watched.page.set_viewport_size({"width": size[0], "height": size[1]})
            assert watched.page.evaluate("document.documentElement.scrollWidth") <= size[0]
            assert watched.find("take").bounding_box()["height"] >= 48.0
        watched.find("finish-name").fill("Block <1>")
        watched.find("finish").click()
        watched.find("frames").wait_for()
        assert watched.page.locator("h1").inner_text() == "Block <1>"
        made = httpx.get(f"{served.address}/api/items/registration").json()["items"]
        assert [each["name"] for each in made] == ["Block <1>"]
        watched.find("go-on").click()
        watched.find("result").wait_for()
