"""The page Plan: a plan asked for in a browser, its poses seen, a way into an error that helps."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from serving import WAIT, serving, watching
from web_shop import Client, Served, Shop, fill, unpacked, write_files

from robotrue.app.job_kinds import job_kinds
from robotrue.robot.presets import preset
from robotrue.store import items, jobs, measurements
from robotrue.store.jobs_claim import claim
from robotrue.store.jobs_work import attempt
from robotrue.store.nouns import DOCUMENT
from robotrue.web.parts.curve import Line, curve

JOB = WAIT
"""ms that a job may take on a machine with other things to do."""


@pytest.fixture(scope="module")
def shop_served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder, files = tmp_path_factory.mktemp("plan") / "shop", tmp_path_factory.mktemp("files")
    write_files(files)
    fill(folder, files).workspace.close()
    with serving(folder) as found:
        yield found


def done(shop: Shop, kind: str, parameters: dict[str, Any]) -> jobs.Job:
    """Does a job in this process."""
    id = jobs.submit(shop.workspace, kind, parameters)
    found = claim(shop.workspace, [kind], "here/plan")
    assert found is not None
    attempt(shop.workspace.folder, None, job_kinds()[kind], found[1])
    return jobs.status(shop.workspace, id)


def test_a_plan_tells_how_the_instrument_sees_its_poses(client: Client, filled: Shop) -> None:
    asked = {"cell": filled.cell.id, "model": filled.model.id, "poses": 5, "candidates": 60}
    made = done(filled, "plan", asked)
    assert made.result is not None, made.error
    here = client()
    plan = here.get(f"/api/plans/{made.result['document']['id']}").json()
    assert plan["simulated"] is True  # the model it starts from is
    assert len(plan["joints_deg"]) == 5
    controller = preset("KUKA KR160 R1570").controller
    assert controller is not None  # the table is typed into a pendant: its axes, not the model's
    axes = controller.to_controller(np.deg2rad(plan["joints_deg"]))
    np.testing.assert_allclose(np.deg2rad(plan["axes_deg"]), axes, atol=1e-9)
    assert plan["visibility"]["tracker"] is False
    tips = unpacked(plan["scene"]["robot"]["tool"])[:, 0]
    assert abs(tips - unpacked(plan["scene"]["points"]["position"])).max() < 1e-5
    assert here.get(f"/api/plans/{filled.cell.id}").status_code == 404
    page = here.get(f"/plan?id={made.result['document']['id']}").text
    assert len(re.findall(r'class="act" data-testid="download"', page)) == 1  # the next step


def test_sheets_and_tables_show_the_axes_of_the_controller(client: Client, filled: Shop) -> None:
    """What a person types into a pendant is in the sheets and on the pages, not model joints."""
    controller = preset("KUKA KR160 R1570").controller
    assert controller is not None
    asked = {"cell": filled.cell.id, "model": filled.model.id, "poses": 5, "candidates": 60}
    checked = {"model": filled.model.id, "poses": 6}
    for kind, parameters in (("plan", asked), ("drift_plan", checked)):
        made = done(filled, kind, parameters)
        assert made.result is not None, made.error
        record = items.get(filled.workspace, DOCUMENT, made.result["document"]["id"])
        sheet = next(each for each in record.attachments if each.name.endswith("poses.csv"))
        text = filled.workspace.content(sheet.sha256).decode()
        rows = list(csv.DictReader(line for line in text.splitlines() if line[0] != "#"))
        joints, axes = ([[float(row[f"{letter}{k}_deg"]) for k in range(1, 7)] for row in rows]
                        for letter in "ja")  # fmt: skip
        expected = np.rad2deg(controller.to_controller(np.deg2rad(joints)))
        np.testing.assert_allclose(axes, expected, atol=1e-5)
    assert "A6 °" in client().get(f"/drift?model={filled.model.id}").text
    address = f"/measurements?id={filled.measured.id}&part=rows&sort=-joints_2"
    page = client().get(address).text
    assert "A2 ° ▼" in page
    cells = [float(cell) for cell in re.findall("<td>([^<]+)</td>", page)]
    shown = np.reshape(cells, (-1, 10))
    assert (np.diff(shown[:, 2]) <= 0.0).all()
    stored = measurements.rows_of(filled.workspace, filled.measured)
    order = [stored.source_row.tolist().index(int(line)) for line in shown[:, 0]]
    displayed = np.rad2deg(controller.to_controller(stored.joints[order]))
    np.testing.assert_allclose(shown[:, 1:7], displayed, atol=6e-4)


def test_too_few_poses_are_refused_with_a_hint(filled: Shop) -> None:
    failed = done(filled, "plan", {"cell": filled.cell.id, "poses": 3})
    assert failed.state == "failed"
    assert failed.error is not None
    assert failed.error["hint"] == "10 poses give a first model, 30 a good one."


def test_a_curve_lies_within_its_paper_and_escapes_its_words() -> None:
    drawn = curve(
        [4, 5, 6], [Line(label="<b>", values=[2.0, 0.5, 0.05], low=[1, 0.4, 0.04], high=[3, 1, 1])],
        title="t", across="n", up="mm", floor=(0.03, "floor"),
    )  # fmt: skip
    assert "<b>" not in drawn
    (points,) = [part.split('"')[0] for part in drawn.split('polyline class="ours" points="')[1:]]
    pairs = [tuple(map(float, each.split(","))) for each in points.split()]
    assert [x for x, _ in pairs] == sorted(x for x, _ in pairs)
    assert [y for _, y in pairs] == sorted(y for _, y in pairs)  # falling curve, y down the page
    assert all(0 < x < 760 and 0 < y < 300 for x, y in pairs)


def test_a_plan_from_form_to_posture(browser: Any, shop_served: Served, tmp_path: Path) -> None:
    with watching(browser, shop_served) as watched:
        page = watched.page
        page.goto("/plan")
        watched.find("plan-poses").fill("5")
        watched.find("region-kind").select_option("box")
        for axis, low, high in (("x", 700, 1300), ("y", -500, 500), ("z", 500, 1200)):
            watched.find(f"region-{axis}_mm-low").fill(str(low))
            watched.find(f"region-{axis}_mm-high").fill(str(high))
        page.locator("details.more summary").click()
        page.locator("input[name=candidates]").fill("60")
        watched.find("plan-krl").check()
        watched.find("plan-start").click()
        watched.find("plan-curve").wait_for(timeout=JOB)
        assert watched.find("download").count() == 2  # the table and the controller's program
        assert watched.find("poses").locator("tbody tr").count() == 5
        watched.find("scene").and_(page.locator('[data-state="ready"]')).wait_for()
        watched.find("poses").locator("tbody tr").nth(2).click()
        assert "3" in watched.find("picked").locator("h3").inner_text()
        page.set_viewport_size({"width": 820, "height": 1100})
        assert page.evaluate("document.documentElement.scrollWidth") <= 820
    job = httpx.get(f"{shop_served.address}/api/jobs?kind=plan").json()["items"][0]
    assert job["parameters"]["region"] == "x_mm=700..1300,y_mm=-500..500,z_mm=500..1200"
    assert job["parameters"]["krl"] is True
