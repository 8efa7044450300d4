"""The whole story in a browser, from the tracker's file to the program that is downloaded."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from datetime import timedelta
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
import shop
from serving import WAIT, Watched, serving, watching
from web_shop import SEED, Served, Shop, fill, write_files

from robotrue.cli.main import run

POSES_OF_STORY = 30


@pytest.fixture(scope="module")
def empty(kernels: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("story") / "shop") as found:
        yield found


@pytest.fixture(scope="module")
def known(kernels: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Served, Shop]]:
    """A served workspace with one of everything."""
    folder, files = tmp_path_factory.mktemp("known") / "shop", tmp_path_factory.mktemp("files")
    write_files(files)
    filled = fill(folder, files)
    filled.workspace.close()
    with serving(folder) as found:
        yield found, filled


def robotrue(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    """The command line in this process."""
    monkeypatch.setattr(sys, "argv", ["robotrue", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        run()
    assert not stopped.value.code


def downloaded(watched: Watched, link: Any, folder: Path) -> Path:
    """The file behind a link, as the browser keeps it."""
    with watched.page.expect_download() as coming:
        link.click()
    kept = folder / coming.value.suggested_filename
    coming.value.save_as(kept)
    return kept


def jobs_of(served: Served, kind: str) -> list[dict[str, Any]]:
    return list(httpx.get(f"{served.address}/api/jobs", params={"kind": kind}).json()["items"])


def show_quarter(route: Any) -> None:
    """A quarter of the job was done in its first minute."""
    answer = route.fetch()
    started = parsedate_to_datetime(answer.headers["date"]) - timedelta(minutes=1)
    job = {"state": "running", "over": False, "progress": 0.25, "started": started.isoformat()}
    route.fulfill(response=answer, json=answer.json() | job)


def over(served: Served, job: dict[str, Any]) -> dict[str, Any]:
    """A job once it is over."""
    until = time.monotonic() + WAIT / 1e3
    while not job["over"] and time.monotonic() < until:
        time.sleep(0.1)
        job = httpx.get(f"{served.address}/api/jobs/{job['id']}").json()
    return job


def test_from_tracker_file_to_downloaded_program(
    browser: Any, empty: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is downloaded is byte for byte what the command line writes of the same files."""
    write_files(tmp_path)
    joints = shop.postures(POSES_OF_STORY, SEED)
    tracker = shop.write_csv(
        tmp_path / "simulated.csv", joints, shop.points(joints, noise_seed=SEED)
    )
    text = tracker.read_text().replace("x_mm,y_mm,z_mm", "Px,Py,Pz")
    tracker.write_text(f"# robotrue SIMULATED: virtual tracker\n{text}")
    (tmp_path / "download").mkdir()
    with watching(browser, empty) as watched:
        page = watched.page
        page.goto("/")
        watched.drop(tmp_path / "cell.toml")
        watched.find("scene").and_(page.locator('[data-state="ready"]')).wait_for()

        page.goto("/measurements")
        watched.drop(tracker)
        for axis in "xyz":
            watched.find(f"column-{axis}").select_option(f"P{axis}")
        watched.find("look-again").click()
        watched.find("preview-ready").wait_for()
        watched.find("take-in").click()
        watched.find("rows").wait_for()

        watched.find("calibrate-with").click()
        assert watched.find("pick-set").is_checked()
        watched.find("pick-set").uncheck()
        watched.find("calibrate").click()
        page.get_by_text("No set of poses is selected").wait_for()
        assert not jobs_of(empty, "calibrate")
        watched.find("pick-set").check()
        watched.find("method").select_option("geometric")
        page.route("**/api/jobs/*", show_quarter)
        watched.find("calibrate").click()
        watched.find("job").wait_for()
        assert not jobs_of(empty, "calibrate")[0]["over"]
        assert watched.find("job-progress").inner_text() == "25 %, about 3 min left"
        page.unroute_all(behavior="wait")  # an answer under way is still given by show_quarter
        page.reload()  # in mid-job: it goes on, and is there again
        page.wait_for_url("**/calibration?model=*")
        watched.find("calibration-tiles").wait_for()
        assert [job["attempts"] for job in jobs_of(empty, "calibrate")] == [1]
        assert watched.find("simulated").or_(page.locator(".simulated")).count() >= 1

        page.goto("/programs")
        watched.drop(tmp_path / "part.src")
        page.wait_for_url("**/programs?id=*")
        watched.find("verdict").wait_for()
        before = page.url
        watched.find("compensate").click()
        page.wait_for_function("before => location.href !== before", arg=before)
        watched.find("verdict").wait_for()
        assert watched.find("compensate").count() == 0  # it is compensated
        made = downloaded(watched, watched.find("download").first, tmp_path / "download")

    mapping = tmp_path / "columns.toml"
    names = ", ".join(f'"j{k}_deg"' for k in range(1, 7))
    mapping.write_text(f'name = "as chosen"\njoints = [{names}]\nposition = ["Px", "Py", "Pz"]\n')
    model, after = tmp_path / "model.rtm", tmp_path / "after" / "part.src"
    after.parent.mkdir()
    robotrue(
        monkeypatch, "calibrate", tmp_path / "cell.toml", tracker, "--mapping", mapping,
        "--method", "geometric", "-o", model,
    )  # fmt: skip
    robotrue(monkeypatch, "compensate", model, tmp_path / "part.src", "-o", after)
    assert made.name == "part.src"
    assert made.read_bytes() == after.read_bytes()
    assert made.read_bytes() != (tmp_path / "part.src").read_bytes()


def test_two_people_at_once(browser: Any, known: tuple[Served, Shop]) -> None:
    """Two languages, two jobs of one program; one deletes what the other looks at."""
    served, filled = known
    address = f"/programs?id={filled.program.id}"
    with (
        watching(browser, served, locale="en-GB") as anna,
        watching(browser, served, locale="zh-CN") as bo,
    ):
        for each, word in ((anna, "Compensate"), (bo, "补偿")):
            each.page.goto(address)
            each.find("verdict").wait_for()
            assert word in each.find("compensate").inner_text()
        for each in (anna, bo):
            each.find("compensate").click()
        made = []
        for each in (anna, bo):
            each.page.wait_for_function(f"!location.href.includes('{filled.program.id}')")
            each.find("verdict").wait_for()
            made.append(each.page.url.partition("id=")[2])
        done = [over(served, job) for job in jobs_of(served, "compensate")]
        assert [job["state"] for job in done] == ["done", "done"]
        results = {job["result"]["program"]["id"] for job in done}
        assert len(results) == 2
        assert results >= set(made)  # whichever was there first

        for each in (anna, bo):
            each.page.goto(address)
            each.find("verdict").wait_for()
        anna.find("delete").click()
        anna.page.wait_for_url("**/programs")
        bo.provoked = ("status of 409",)  # that it was too late
        bo.find("compensate").click()  # of what is no longer there
        bo.find("job-fault").wait_for()
        assert "Part" in bo.find("job-fault").inner_text()
        for each in (anna, bo):
            each.page.goto(address)
            each.find("undo").wait_for()
            assert each.find("compensate").count() == 0
        for each in (anna, bo):  # both bring it back: it is not deleted again by the second
            each.find("undo").click()
            each.find("delete").wait_for()
        found = httpx.get(f"{served.address}/api/items/program/{filled.program.id}").json()
        assert (found["deleted"], found["version"]) == (False, 3)
