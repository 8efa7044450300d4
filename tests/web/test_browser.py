"""The whole story in a browser: cell, tracker file, columns, scene, program; bad files; reload."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import shop
from serving import Watched, watching
from web_shop import POSES, SEED, Served, write_files


@pytest.fixture
def watched(browser: Any, served: Served) -> Iterator[Watched]:
    with watching(browser, served) as found:
        yield found


def test_from_cell_to_judged_program(watched: Watched, tmp_path: Path, served: Served) -> None:
    write_files(tmp_path)
    page = watched.page
    page.goto("/")
    watched.drop(tmp_path / "cell.toml")
    watched.find("scene").and_(page.locator('[data-state="ready"]')).wait_for()

    page.goto("/measurements")
    joints = shop.postures(POSES, SEED)
    odd = shop.write_csv(tmp_path / "simulated odd.csv", joints, shop.points(joints, noise_seed=1))
    odd.write_text(odd.read_text().replace("x_mm,y_mm,z_mm", "here,there,up"))
    watched.drop(odd)
    watched.find("column-x").select_option("here")
    watched.find("column-y").select_option("up")  # the wrong way round: the file is mirrored
    watched.find("column-z").select_option("there")
    watched.find("look-again").click()
    assert "mirrored or exchanged axes" in watched.find("fault").inner_text()
    assert watched.find("take-in").count() == 0
    watched.find("column-y").select_option("there")
    watched.find("column-z").select_option("up")
    watched.find("look-again").click()
    watched.find("take-in").click()
    watched.find("rows").wait_for()
    assert watched.find("rows").locator("tbody tr").count() == POSES

    page.goto("/programs")
    watched.drop(tmp_path / "part.src")
    watched.find("download").wait_for()
    assert watched.find("compensate").count() == 0  # nothing to compensate with yet

    asked = httpx.get(f"{served.address}/api/items/program").json()["items"]
    assert [each["name"] for each in asked] == ["part.src"]
    page.goto(f"/programs?id={asked[0]['id']}")
    watched.find("delete").click()
    page.wait_for_url("**/programs")
    assert watched.find("programs").count() == 0
    page.goto("/history")
    assert watched.find("journal").locator("tbody tr").count() >= 5
    watched.find("undo").click()
    watched.find("undo").wait_for(state="detached")
    page.goto("/programs")
    assert watched.find("programs").locator("tbody tr").count() == 1


def test_a_bad_file_is_refused_in_plain_words(watched: Watched, tmp_path: Path) -> None:
    bad = tmp_path / "cell.toml"
    bad.write_text('schema = 1\n[robot]\npreset = "KUKA KR 9000"\n')
    watched.provoked = ("status of 4",)  # the refusal itself
    watched.page.goto("/programs")
    watched.drop(bad)
    watched.find("upload-fault").wait_for()
    assert "error" in watched.find("upload-fault").inner_text()


def test_language_light_and_keys(watched: Watched) -> None:
    page = watched.page
    page.goto("/history")
    assert page.title() == "History · robotrue"
    watched.find("view-menu").click()
    with page.expect_navigation():
        watched.find("view-language").select_option("zh")
    assert page.title() == "历史 · robotrue"
    watched.find("theme").click()
    dark = page.evaluate("document.documentElement.dataset.theme")
    page.reload()
    assert page.evaluate("document.documentElement.dataset.theme") == dark
    page.keyboard.press("?")
    watched.find("shortcuts").wait_for()
    page.keyboard.press("Escape")
    page.keyboard.press(watched.find("nav-programs").get_attribute("data-shortcut"))
    page.wait_for_url("**/programs")
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_on_a_tablet_nothing_is_cut_off(watched: Watched) -> None:
    watched.page.set_viewport_size({"width": 820, "height": 1100})
    for path in ("/", "/measurements", "/calibration", "/programs", "/history"):
        watched.page.goto(path)
        watched.page.locator("#sheet").wait_for()
        assert watched.page.evaluate("document.documentElement.scrollWidth") <= 820, path
        for link in watched.page.locator("nav a").all():
            box = link.bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 40.0
