"""The page Drift check, and what its jobs leave: poses, verdict, updated model, reports."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shop
from serving import serving, watching
from test_plan_page import JOB, done
from web_shop import Client, Shop, fill, write_files

from robotrue.app.job_kinds import job_kinds
from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.store import items, jobs
from robotrue.store.jobs_claim import claim
from robotrue.store.jobs_work import attempt
from robotrue.store.nouns import DOCUMENT, DRIFT_CHECK, MODEL

POSES = 6


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    """A shop of this file's own."""
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    return fill(tmp_path_factory.mktemp("drift") / "shop", files)


def slipped(joint: int, by: float) -> RobotModel:
    arm = shop.actual()
    errors = np.array(arm.errors)
    errors[parameter_slice(6, "theta")][joint] += by
    found: RobotModel = arm.with_errors(errors)
    return found


def measured(joints: Array, arm: RobotModel, monkeypatch: pytest.MonkeyPatch) -> Array:
    with monkeypatch.context() as instead:
        instead.setattr(shop, "actual", lambda: arm)
        return np.asarray(shop.points(joints, noise_seed=3))


def check_poses(found: Shop) -> Array:
    made = done(found, "drift_plan", {"model": found.model.id, "poses": POSES})
    assert made.result is not None, made.error
    record = items.get(found.workspace, DOCUMENT, made.result["document"]["id"])
    assert [each.name for each in record.attachments] == ["check_poses.csv"]
    assert record.refs("model")[0].id == found.model.id
    return np.asarray(record.detail["joints_deg"]) * DEG


def test_a_slipped_joint_is_found_and_the_model_brought_up_to_date(
    place: Shop, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    joints = check_poses(place)
    path = tmp_path / "simulated again.csv"
    shop.write_csv(path, joints, measured(joints, slipped(2, 4e-4), monkeypatch))
    here = client(shop=place)
    sent = here.post("/api/files", params={"name": path.name}, content=path.read_bytes()).json()
    asked = {"uploads": [sent["id"]], "model": place.model.id}
    job = here.post("/api/drift-checks", json=asked)
    assert job.status_code == 202
    data = job.json()["parameters"]["measurements"]
    made = done_waiting(place)
    check = items.get(place.workspace, DRIFT_CHECK, made["check"]["id"])
    assert check.verdict == "update"
    assert check.detail["causes"][0]["name"] == "joint 3"
    assert check.detail["simulated"] is True
    assert [each.to.id for each in check.links] == [place.model.id, *data]

    updated = done(place, "transfer", {"model": place.model.id, "measurements": data})
    assert updated.result is not None, updated.error
    record = items.get(place.workspace, MODEL, updated.result["model"]["id"])
    assert record.refs("parent")[0].id == place.model.id
    again = done(place, "drift", {"model": record.id, "measurements": data})
    assert again.result is not None
    assert again.result["verdict"] == "keep"


def done_waiting(found: Shop) -> dict[str, Any]:
    """Does the job that waits; returns its result."""
    taken = claim(found.workspace, list(job_kinds()), "here/drift")
    assert taken is not None
    attempt(found.workspace.folder, None, job_kinds()[taken[0].kind], taken[1])
    over = jobs.status(found.workspace, taken[0].id)
    assert over.result is not None, over.error
    return dict(over.result)


def test_too_few_check_poses_are_refused(place: Shop) -> None:
    failed = done(place, "drift_plan", {"model": place.model.id, "poses": 3})
    assert failed.error is not None
    assert "needs 4 or more" in failed.error["message"]


def test_a_certificate_is_left_in_the_forms_asked_for(place: Shop) -> None:
    pytest.importorskip("typst", reason="pip install typst")
    asked = {"model": place.model.id, "measurements": [place.measured.id]}
    made = done(place, "report", asked)
    assert made.result is not None, made.error
    record = items.get(place.workspace, DOCUMENT, made.result["document"]["id"])
    assert record.refs("about")[0].id == place.model.id
    forms = {each.name.rpartition(".")[2]: each for each in record.attachments}
    assert list(forms) == ["html", "pdf", "json"]
    assert place.workspace.content(forms["pdf"].sha256).startswith(b"%PDF")
    assert json.loads(place.workspace.content(forms["json"].sha256))["simulated"] is True
    assert not any(str(place.workspace.folder) in each for each in made.remarks)

    made = done(place, "report", {**asked, "lang": "zh", "forms": ["html"]})
    assert made.result is not None, made.error
    record = items.get(place.workspace, DOCUMENT, made.result["document"]["id"])
    assert [each.name for each in record.attachments] == ["certificate_zh.html"]
    assert 'lang="zh-CN"' in place.workspace.content(record.attachments[0].sha256).decode()
    odd = done(place, "report", {**asked, "forms": ["docx"]})
    assert odd.error is not None
    assert "'docx'" in odd.error["message"]


def test_a_program_report_needs_both_programs(place: Shop) -> None:
    asked = {"program": place.program.id, "tolerance_mm": 0.5, "forms": ["json"]}
    failed = done(place, "report", asked)
    assert failed.error is not None
    assert "was not compensated" in failed.error["message"]
    cut = done(place, "compensate", {"program": place.program.id, "model": place.model.id})
    assert cut.result is not None, cut.error
    made = done(place, "report", {**asked, "program": cut.result["program"]["id"]})
    assert made.result is not None, made.error
    record = items.get(place.workspace, DOCUMENT, made.result["document"]["id"])
    assert record.detail["verdict"] == "NO-GO"  # one target is out of reach
    assert [each.role for each in record.links] == ["about", "model", "before"]
    nothing = done(place, "report", {"lang": "en"})
    assert nothing.error is not None
    assert "nothing to report on" in nothing.error["message"]


def test_a_file_dropped_on_the_page_becomes_a_verdict(
    browser: Any, place: Shop, tmp_path: Path
) -> None:
    joints = check_poses(place)
    path = tmp_path / "simulated today.csv"
    shop.write_csv(path, joints, shop.points(joints, noise_seed=8))
    with serving(place.workspace.folder) as served, watching(browser, served) as watched:
        watched.page.goto(f"/drift?model={place.model.id}")
        assert watched.find("check-poses").locator("tbody tr").count() == POSES
        watched.drop(path)
        watched.find("drift-verdict").wait_for(timeout=JOB)
        assert "KEEP" in watched.find("drift-verdict").inner_text()
        assert "SIMULATED" in watched.find("drift-verdict").inner_text()
        assert watched.find("residuals").locator("tbody tr").count() == POSES
        watched.page.goto(f"/drift?model={place.model.id}")
        assert watched.find("checks").locator("tbody tr").count() >= 1
