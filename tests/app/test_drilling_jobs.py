"""Drilling models learned and judged as jobs: the same operations as the commands (simulated)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotrue.app.files_context import check_outputs
from robotrue.app.job_kinds import job_kinds
from robotrue.app.operations.drill_run import DrillRunRequest
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.drilling.drill_defaults import CAMPAIGN
from robotrue.errors import ConfigurationError
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign
from robotrue.store import documents, jobs
from robotrue.store.items import get
from robotrue.store.jobs_claim import claim, worker_name
from robotrue.store.jobs_work import attempt
from robotrue.store.nouns import DOCUMENT
from robotrue.store.workspace import Workspace

FOOT = "[foot]\nradius_mm = 60\nangles_deg = [90, 210, 330]\n"


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """A workspace with the campaigns ``learned`` and ``test``, and one without its foot."""
    (tmp_path / "foot.toml").write_text(FOOT)
    machine, random = drilling_machine(2), np.random.default_rng(2)
    made = Workspace.create(tmp_path / "space")
    for name, count in (("learned", 20), ("test", 12)):
        rows = tmp_path / f"{name}.csv"
        write_campaign(rows, random_campaign(machine, count, random, held_out=name == "test"))
        documents.add(made, CAMPAIGN, name=name, files=[tmp_path / "foot.toml", rows])
    documents.add(made, CAMPAIGN, name="footless", files=[tmp_path / "test.csv"])
    return made


def done(workspace: Workspace, kind: str, /, **parameters: Any) -> jobs.Job:
    """A job, done in this process."""
    id = jobs.submit(workspace, kind, parameters)
    found = claim(workspace, [kind], worker_name("here"))
    assert found is not None
    attempt(workspace.folder, workspace.url, job_kinds()[kind], found[1])
    return jobs.status(workspace, id)


def left(workspace: Workspace, job: jobs.Job) -> Any:
    """The document that a job left."""
    assert job.state == "done", job.error
    assert job.result is not None
    return get(workspace, DOCUMENT, job.result["document"]["id"])


def test_a_campaign_becomes_a_model_and_a_test(workspace: Workspace) -> None:
    learned = done(workspace, "drill_fit", campaign="learned", kind="patent")
    model = left(workspace, learned)
    assert model.kind == "drilling model"
    assert model.detail["clamps"] == 20
    assert model.detail["simulated"] is True
    assert "output" not in model.detail
    assert any("X, Y, Z of a move are unknown" in each for each in learned.remarks)
    assert not any(str(workspace.folder) in each for each in learned.remarks)
    test = left(workspace, done(workspace, "drill_report", model=model.id, campaign="test"))
    assert test.kind == "drilling test"
    assert len(test.detail["left_deg"]) == test.detail["clamps"] == 12
    assert test.detail["limit_deg"] == 0.1
    assert {each.name for each in test.attachments} == {"report.html", "report.json"}


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("drill_fit", {"campaign": "footless"}, "'footless' has no foot file"),
        ("drill_fit", {"campaign": "learned", "kind": "best"}, "kind 'best', expected auto, "),
        ("drill_report", {"model": "test", "campaign": "test"}, "expected a drilling model"),
        ("drill_report", {"model": "test", "campaign": "test", "limit_deg": 0}, "expected above 0"),
    ],
)
def test_what_cannot_be_is_refused(
    workspace: Workspace, kind: str, parameters: dict[str, Any], message: str
) -> None:
    job = done(workspace, kind, **parameters)
    assert job.error is not None
    assert message in job.error["message"]


def test_a_model_is_not_judged_by_its_own_campaign(workspace: Workspace) -> None:
    model = left(workspace, done(workspace, "drill_fit", campaign="learned", kind="patent"))
    job = done(workspace, "drill_report", model=model.id, campaign="learned")
    assert job.error is not None
    assert "campaign of the model" in job.error["message"]


def test_only_the_model_may_be_written_over(tmp_path: Path) -> None:
    for name in ("m.robotrue", "foot.robotrue"):
        (tmp_path / name).touch()
    names = {"model": tmp_path / "m.robotrue", "foot": tmp_path / "foot.robotrue"}
    asked = {**names, "journal": tmp_path / "j.jsonl"}
    check_outputs(DrillRunRequest(**asked, output=names["model"]))
    with pytest.raises(ConfigurationError, match="which is an input"):
        check_outputs(DrillRunRequest(**asked, output=names["foot"]))
