"""``robotrue workspace`` and ``robotrue jobs``: the whole job from a tracker file to a program."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robotrue.app.job_kinds import job_kinds
from robotrue.app.operations.workspace_jobs import parse_parameters
from robotrue.core.files import sha256
from robotrue.errors import ConfigurationError
from robotrue.store import items, jobs
from robotrue.store.jobs_claim import claim
from robotrue.store.jobs_work import attempt
from robotrue.store.nouns import DOCUMENT, MODEL, PROGRAM
from robotrue.store.workspace import Workspace

Command = Callable[..., Any]


@pytest.fixture
def folder(tmp_path: Path, cli: Command, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("ROBOTRUE_DB", raising=False)
    made = tmp_path / "shop"
    monkeypatch.setenv("ROBOTRUE_WORKSPACE", str(made))
    assert cli("workspace", "init", made).code == 0
    return made


def submitted(cli: Command, kind: str, *parameters: str) -> str:
    words = [word for each in parameters for word in ("-p", each)]
    found = cli("jobs", "submit", kind, *words, "--json")
    assert found.code == 0, found.err
    return str(found.document["id"])


def done(folder: Path, id: str) -> jobs.Job:
    """Does a job in this process, as its own process would."""
    with Workspace.open(folder) as workspace:
        found = claim(workspace, list(job_kinds()), "here/x")
        assert found is not None
        assert found[0].id == id
        attempt(folder, None, job_kinds()[found[0].kind], found[1])
        return jobs.status(workspace, id)


def result(job: jobs.Job, name: str) -> dict[str, Any]:
    assert job.error is None, job.error
    assert job.result is not None
    return dict(job.result[name])


def test_the_whole_story(folder: Path, shelf: Path, cli: Command, tmp_path: Path) -> None:
    assert cli("workspace", "add", "cell", shelf / "cell.toml", "--name", "left").code == 0
    cal = cli("workspace", "add", "measurement", shelf / "cal.csv", "--cell", "left", "--json")
    assert (cal.document["name"], cal.document["frame"]) == ("cal", "base")
    assert cli("workspace", "add", "measurement", shelf / "test.csv", "--cell", "left").code == 0
    assert cli("workspace", "add", "program", shelf / "part.src").code == 0

    job = done(folder, submitted(cli, "calibrate", "cell=left", "measurements=cal",
                                 "method=geometric", "name=spring"))  # fmt: skip
    model = result(job, "model")
    assert "poses from 1 file" in " ".join(job.remarks)
    judged = done(folder, submitted(cli, "validate", "model=spring", "measurements=test"))
    refused = done(folder, submitted(cli, "compensate", "program=part.src", "model=spring"))
    assert refused.error is not None
    assert refused.error["kind"] == "StepError"
    assert any("out of the robot's reach" in remark for remark in refused.remarks)
    cut = done(folder, submitted(cli, "compensate", "program=part.src", "model=spring",
                                 "allow_steps=true"))  # fmt: skip
    again = done(folder, submitted(cli, "compensate", "program=part.src, compensated",
                                   "model=spring"))  # fmt: skip

    with Workspace.open(folder) as workspace:
        record = items.get(workspace, MODEL, model["id"])
        assert (record.method, record.settings) == ("geometric", {"method": "geometric"})
        assert record.refs("data")[0].id == cal.document["id"]
        assert [each.role for each in record.attachments] == ["model", "report"]
        page = items.get(workspace, DOCUMENT, result(judged, "document")["id"])
        after = items.get(workspace, PROGRAM, result(cut, "program")["id"])
        assert page.detail["mean_mm"] < 0.2 * page.detail["before"]["mean_mm"]
        assert {link.role for link in page.links} == {"model", "data"}
        assert after.refs("model")[0].id == record.id
        written = workspace.content(after.files("program")[0].sha256)
    assert cut.result is not None
    assert cut.result["compensated"] > 0

    # The very bytes of the command, from the very model of the workspace.
    (tmp_path / "out").mkdir()
    assert cli("workspace", "show", "spring", "-o", tmp_path / "out").code == 0
    target = tmp_path / "by_command.src"
    model_file = tmp_path / "out" / "model.rtm"
    assert (
        cli("compensate", model_file, shelf / "part.src", "-o", target, "--allow-steps").code == 0
    )
    assert sha256(target.read_bytes()) == sha256(written)

    # What is compensated already is refused: its identity came along.
    assert again.state == "failed"
    assert again.error is not None
    assert again.error["kind"] == "ModelMismatchError"
    assert cli("jobs", "show", again.id).code == 0
    assert "ModelMismatchError" in cli("jobs", "show", again.id).out


def test_a_plan_is_kept_with_its_files(folder: Path, shelf: Path, cli: Command) -> None:
    assert cli("workspace", "add", "cell", shelf / "cell.toml", "--name", "left").code == 0
    id = submitted(cli, "plan", "cell=left", "poses=5", "candidates=60", "krl=true")
    made = result(done(folder, id), "document")
    shown = cli("workspace", "show", made["id"], "--json").document
    assert [each["name"] for each in shown["files"]] == ["poses.csv", "report.html", "measure.src"]
    assert (shown["kind"], shown["detail"]["poses"]) == ("plan", 5)


def test_items_are_listed_deleted_and_carried_over(
    folder: Path, shelf: Path, cli: Command, tmp_path: Path
) -> None:
    assert cli("workspace", "add", "program", shelf / "part.src", "--note", "first cut").code == 0
    listed = cli("workspace", "list", "program", "--where", "file_count=1", "--json").document
    assert (listed["total"], listed["items"][0]["note"]) == (1, "first cut")
    id = listed["items"][0]["id"]
    assert "part.src" in cli("workspace", "list", "program", "--text", "PART").out
    assert cli("workspace", "list", "--json").document["nouns"]["program"] == 1
    assert cli("workspace", "delete", "part.src").code == 0
    assert cli("workspace", "list", "program", "--json").document["total"] == 0
    assert cli("workspace", "undo", id[:8], "--json").document["version"] == 3
    entries = cli("workspace", "history", id, "--json").document["entries"]
    assert [each["action"] for each in entries] == ["restored", "deleted", "added"]
    assert "restored" in cli("workspace", "history").out

    project = tmp_path / "project.zip"
    assert cli("workspace", "export", project).code == 0
    other = tmp_path / "other"
    assert cli("workspace", "init", other).code == 0
    taken = cli("workspace", "import", project, "-w", other, "--json").document
    assert (taken["rows"]["programs"], taken["files"]) == (3, 1)
    assert cli("workspace", "show", id, "-w", other, "--json").document["note"] == "first cut"
    assert cli("workspace", "verify", "-w", other, "--json").document["faults"] == []
    blob = next(p for p in (other / "blobs").rglob("*") if p.is_file())
    blob.chmod(0o644)
    blob.write_bytes(b"x")
    broken = cli("workspace", "verify", "-w", other)
    assert broken.code == 1
    assert "altered or damaged" in broken.err


def test_a_worker_is_started_and_says_why_a_job_failed(folder: Path, cli: Command) -> None:
    id = submitted(cli, "plan", "cell=nowhere")
    other = submitted(cli, "plan", "nonsense=1")
    assert done(folder, id).state == "failed"
    assert cli("jobs", "run", "--until-idle", "--json").document["attempts"] == 1
    found = cli("jobs", "list", "--state", "failed", "--json").document["jobs"]
    messages = {each["id"]: each["error"]["message"] for each in found}
    assert "no cell is 'nowhere'" in messages[id]
    assert "unknown parameter 'nonsense'" in messages[other]
    assert cli("jobs", "cancel", id, "--json").document["state"] == "failed"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("workspace", "list", "nonsense"), "'nonsense' is no noun"),
        (("workspace", "list", "cell", "--where", "dof"), "expected FIELD=VALUE"),
        (("workspace", "list", "cell", "--sort", "nonsense"), "no field 'nonsense'"),
        (("workspace", "list", "measurement", "--where", "poses=x"), "expected a whole number"),
        (("workspace", "show", "nothing"), "no item is 'nothing'"),
        (("workspace", "add", "job", "x"), "is not imported from files"),
        (("workspace", "add", "measurement", "x.csv"), "without the cell"),
        (("workspace", "add", "program", "missing.src"), "cannot read"),
        (("workspace", "import", "missing.zip"), "not an export"),
        (("workspace", "init", "."), "the folder is not empty"),
        (("jobs", "submit", "dance"), "'dance' is no kind of job"),
        (("jobs", "submit", "plan", "-p", "poses"), "expected NAME=VALUE"),
        (("jobs", "submit", "plan", "-p", "poses={"), "is no JSON"),
        (("jobs", "show", "0000"), "no job is '0000'"),
        (("jobs", "list", "-w", "nowhere"), "no workspace"),
        (("jobs", "run", "-w", "nowhere"), "no workspace"),
    ],
)
def test_what_cannot_be_is_refused(
    folder: Path,
    cli: Command,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    (folder.parent / "else").write_text("")
    monkeypatch.chdir(folder.parent)
    found = cli(*words)
    assert (found.code, message in found.err) == (1, True), found.err


def test_parameters_are_read_as_they_are_meant() -> None:
    found = parse_parameters(
        ["cell=12345678", "poses=30", "krl=true", "tolerance_um=0.5", "seed=-1"]
    )
    assert found == {"cell": "12345678", "poses": 30, "krl": True, "tolerance_um": 0.5, "seed": -1}
    assert parse_parameters(["measurements=a", "measurements=1e5"]) == {
        "measurements": ["a", "1e5"]
    }
    assert parse_parameters(['model={"id": "x", "version": 2}', "region=a=1..2"]) == {
        "model": {"id": "x", "version": 2},
        "region": "a=1..2",
    }
    with pytest.raises(ConfigurationError, match="expected NAME=VALUE"):
        parse_parameters(["=3"])


def test_the_store_is_an_extra(folder: Path, cli: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    known = sys.modules["importlib.util"].find_spec
    monkeypatch.setattr(
        "robotrue.cli.generate.find_spec",
        lambda name: None if name == "alembic" else known(name),
    )
    found = cli("workspace", "list")
    assert found.code == 1
    assert "pip install 'robotrue[store]'" in found.err


def test_the_bin_is_emptied_by_those_who_say_so(folder: Path, shelf: Path, cli: Command) -> None:
    made = cli("workspace", "add", "cell", shelf / "cell.toml", "--name", "left", "--json").document
    assert cli("workspace", "delete", "left").code == 0
    recent = cli("workspace", "empty-bin", "--json").document
    assert (recent["removed"], recent["files"]) == ([], 0)  # not yet 30 days
    asked = cli("workspace", "empty-bin", "--older-than-days", 0)
    assert asked.code != 0
    assert "--yes" in asked.err
    assert "'left'" in asked.err
    gone = cli("workspace", "empty-bin", "--older-than-days", 0, "--yes", "--json").document
    assert made["id"] in [each["id"] for each in gone["removed"]]
    assert gone["files"] >= 1
    assert cli("workspace", "undo", made["id"]).code != 0
    assert cli("workspace", "verify").code == 0
