"""What a page shows and where it leads: the model chosen, alarms in one row, jobs, refusals."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from serving import serving, watching
from web_shop import Client, Served, Shop, fill, write_files

from robotrue.store import models
from robotrue.web.alarms import Alarm
from robotrue.web.live_sources import add_source, record_alarm
from robotrue.web.models import shown_model

ALARM = Alarm(
    key="a1", axis="x", begun=datetime(2026, 3, 1, 12, tzinfo=UTC), value_um=33.0, band_um=4.0,
    limit_um=25.0, duration_s=0.0, over=False,
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A served shop with two models and an alarm."""

    served: Served
    shop: Shop
    refined: str


def staged(folder: Path, files: Path) -> tuple[Shop, str]:
    write_files(files)
    found = fill(folder, files)
    newer = models.add(
        found.workspace, files / "model.rtm", name="Block, refined", parents=[found.model.ref],
        cell=found.cell.ref,
    )  # fmt: skip
    source = add_source(found.workspace, "ws://127.0.0.1:9", "Cutting <3>").id
    for each in (ALARM, replace(ALARM, value_um=41.0, duration_s=3.2, over=True)):
        record_alarm(found.workspace, source, each)
    return found, newer.id


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("choices") / "shop"
    shop, refined = staged(folder, tmp_path_factory.mktemp("files"))
    shop.workspace.close()
    with serving(folder) as served:
        yield Stage(served=served, shop=shop, refined=refined)


def test_the_chosen_model_stays_until_another_is_chosen(client: Client, tmp_path: Path) -> None:
    (tmp_path / "files").mkdir()
    shop, refined = staged(tmp_path / "shop", tmp_path / "files")
    with shop.workspace:
        here = client(shop=shop)
        renamed = here.patch(f"/api/items/model/{shop.model.id}", json={"name": "Old"})
        assert renamed.json()["version"] == 2
        in_use = asyncio.run(shown_model(shop.workspace, None))
        assert in_use.model is not None
        assert in_use.model.id == shop.model.id  # neither a newer model nor a name changes it
        assert in_use.offered[0].id == refined
        assert here.put("/api/chosen-model", json={"model": "nothing"}).status_code == 404
        made = here.put("/api/chosen-model", json={"model": shop.model.id}).json()
        again = here.put("/api/chosen-model", json={"model": refined}).json()
        assert (again["id"], again["version"]) == (made["id"], 2)  # a choice is a version, too
        assert here.delete(f"/api/items/model/{refined}").status_code == 200
        assert here.put("/api/chosen-model", json={"model": refined}).status_code == 400
        assert here.delete("/api/chosen-model").status_code == 204
        assert here.delete("/api/chosen-model").status_code == 204


def test_a_page_keeps_its_model_and_all_pages_the_chosen_one(browser: Any, stage: Stage) -> None:
    with watching(browser, stage.served) as seen:
        page = seen.page
        page.goto("/programs")
        assert "Planted" in seen.find("model-chip").inner_text()  # a newer one changes nothing
        seen.find("model-chip").click()
        seen.find("model-other").filter(has_text="refined").click()
        page.wait_for_url(f"**/programs?model={stage.refined}")
        seen.find("programs").locator("tbody tr").first.click()
        page.wait_for_url("**/programs?id=*&model=*")
        seen.find("verdict").wait_for()
        assert "GO" not in seen.find("verdict").locator("b").inner_text()  # nobody stated one
        seen.find("tolerance").fill("0.3")
        seen.find("tolerance").press("Enter")
        page.wait_for_url("**tolerance_mm=0.3*")
        assert "GO" in seen.find("verdict").locator("b").inner_text()
        assert "refined" in seen.find("model-chip").inner_text()
        seen.find("model-chip").click()
        with page.expect_navigation():
            seen.find("model-choose").click()
        assert "model=" not in page.url
        assert "tolerance_mm=0.3" in page.url
        page.goto("/measurements")
        assert "refined" in seen.find("model-chip").inner_text()
        httpx.put(
            f"{stage.served.address}/api/chosen-model",
            json={"model": stage.shop.model.id},
            trust_env=False,
        ).raise_for_status()
        page.reload()
        assert "Planted" in seen.find("model-chip").inner_text()
        seen.find("model-chip").focus()
        page.keyboard.press("Enter")
        seen.find("model-choose").focus()
        with page.expect_navigation():
            page.keyboard.press("Enter")
        assert "refined" in seen.find("model-chip").inner_text()


def test_an_alarm_is_one_row_of_history(browser: Any, stage: Stage) -> None:
    with watching(browser, stage.served, locale="zh-CN") as seen:
        seen.page.goto("/history")
        rows = seen.find("journal").locator("tbody tr").filter(has_text="报警")
        assert rows.count() == 1
        assert "Cutting <3> x：41 µm，限值 25 µm，持续 3.2 s" in rows.inner_text()


def test_a_job_of_somebody_else_leads_nobody_away(browser: Any, stage: Stage) -> None:
    asked = {
        "kind": "compensate",
        "parameters": {"program": stage.shop.program.id, "model": stage.refined},
    }
    with watching(browser, stage.served) as seen:
        address = f"/programs?id={stage.shop.program.id}"
        httpx.post(
            f"{stage.served.address}/api/jobs", json=asked, trust_env=False, timeout=60.0
        ).raise_for_status()
        seen.page.goto(address)
        seen.find("job-open").wait_for()
        assert seen.page.url.endswith(address)
        seen.find("job-open").click()
        seen.page.wait_for_url(lambda url: stage.shop.program.id not in url)
        assert "line 8: unchanged" in seen.find("left-as-it-was").inner_text()
    done = httpx.get(f"{stage.served.address}/api/jobs", trust_env=False, timeout=60.0).text
    assert str(stage.served.folder) not in done  # nor where the server keeps its files


def test_a_refusal_stands_on_the_page_in_its_language(browser: Any, stage: Stage) -> None:
    with watching(browser, stage.served, locale="zh-CN") as seen:
        seen.provoked = ("status of 400", "net::ERR_")
        seen.page.goto("/live")
        seen.find("live-address").fill("http://<b>x</b>")
        seen.find("live-watch").click()
        said = seen.find("refused").inner_text()
        assert "设置错误" in said
        assert "expected ws://host:port" in said
        seen.find("live-address").fill("ws://127.0.0.1:10")
        seen.page.context.set_offline(True)
        seen.find("live-watch").click()
        seen.find("refused").filter(has_text="无法连接").wait_for()
        assert seen.find("live-watch").is_enabled()  # one may try again


def test_every_field_of_a_new_cell_can_be_read(browser: Any, stage: Stage) -> None:
    with watching(browser, stage.served) as seen:
        for width in (1280, 820):
            seen.page.set_viewport_size({"width": width, "height": 900})
            seen.page.goto("/?new=1")
            seen.find("cell-tool_x_mm").wait_for()
            for field in seen.find("cell-form").locator("input").all():
                box = field.bounding_box()
                assert box is not None
                assert box["width"] > 100.0, field.get_attribute("data-testid")


def test_an_address_without_a_page_says_so_and_leads_back(browser: Any, stage: Stage) -> None:
    with watching(browser, stage.served, locale="zh-CN") as seen:
        seen.provoked = ("status of 404",)
        answer = seen.page.goto("/nowhere/at/all")
        assert answer.status == 404
        assert "未找到" in seen.page.locator("h1").inner_text()
        seen.find("home").click()
        seen.find("stages").wait_for()
    plain = httpx.get(f"{stage.served.address}/nowhere", trust_env=False)
    assert plain.status_code == 404
