"""A page of every operation: forms made from requests, files that are kept, results that stay."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from mark_cases import Lab
from mark_cases import fill as fill_lab
from record_cases import HEADER, joint_rows
from web_shop import Client, Shop, fill, write_files

from robotrue.app.job_files import job_fields
from robotrue.app.job_kinds import job_kinds
from robotrue.app.registry import job_operations, listings, operation_of, why_no_job
from robotrue.app.request import InputFile, Item, Output, fields_of
from robotrue.core.provenance import Provenance
from robotrue.drilling.drill_defaults import CAMPAIGN
from robotrue.online.record_frames import Kind
from robotrue.online.record_writer import RecordWriter
from robotrue.store import cells, documents, items, jobs
from robotrue.store.jobs_claim import claim
from robotrue.store.jobs_work import attempt
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import ItemQuery
from robotrue.store.verify import verify
from robotrue.web.language import LANGUAGES
from robotrue.web.pages import SCREENS
from robotrue.web.uploads import FOLDER


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    """A shop of this file's own: its jobs leave documents."""
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    found = fill(tmp_path_factory.mktemp("tools") / "shop", files)
    with found.workspace:
        yield found


@pytest.fixture
def here(client: Client, own: Shop) -> Any:
    return client(shop=own, kinds=job_kinds())


def send(here: Any, name: str, content: str | bytes) -> dict[str, str]:
    """The parameter that means a file sent along."""
    body = content.encode() if isinstance(content, str) else content
    answer = here.post("/api/files", params={"name": name}, content=body)
    assert answer.status_code == 201, answer.text
    return {"upload": answer.json()["id"]}


def do(here: Any, own: Shop, kind: str, /, **parameters: Any) -> jobs.Job:
    """Asks for a job as the form does, and does it in this process."""
    asked = here.post("/api/jobs", json={"kind": kind, "parameters": parameters})
    assert asked.status_code == 202, asked.text
    return work(own, kind)


def work(own: Shop, kind: str) -> jobs.Job:
    found = claim(own.workspace, [kind], "here/tools")
    assert found is not None
    attempt(own.workspace.folder, None, job_kinds()[kind], found[1])
    return jobs.status(own.workspace, found[1].job)


def page_of(here: Any, job: jobs.Job) -> str:
    answer = here.get(f"/tools/{job.kind}?job={job.id}", headers={"accept-language": "en"})
    assert answer.status_code == 200
    return unescape(answer.text)


QUERIES = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg\n0,-90,90,0,0,0\n10,-80,85,5,10,0\n"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """Small data for every command, simulated."""
    found = Lab(tmp_path_factory.mktemp("lab") / "files", "", Provenance(simulated=True))
    fill_lab(found)
    return found


@pytest.fixture(scope="module")
def fitted(own: Shop) -> str:
    """Id of a model that was learned, with all that reports and exports want of one."""
    asked = {"cell": own.cell.id, "measurements": [own.measured.id], "method": "geometric"}
    jobs.submit(own.workspace, "calibrate", asked)
    done = work(own, "calibrate")
    assert done.result is not None, done.error
    return str(done.result["model"]["id"])


def test_every_operation_has_a_page_or_a_reason(here: Any) -> None:
    shown = here.get("/tools", headers={"accept-language": "en"}).text
    for each in listings():
        row = re.search(rf'data-operation="{each.name}".*?</div>', shown, re.DOTALL)
        assert row is not None, each.name
        page, reason = f'href="/tools/{each.name}"' in row[0], 'class="note"' in row[0]
        assert page is not reason, each.name
        assert page is (each.name in job_kinds()), each.name
    named = {name for screen in SCREENS for name in screen.operations}
    assert named <= {each.name for each in listings()}
    assert {why_no_job(each) for each in listings()} == {
        "", "service", "workspace", "jobs", "machine",
    }  # fmt: skip
    assert set(job_operations()) >= {"predict", "dynamics_fit", "calibrate", "drill_refine"}


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_form_has_every_field_with_its_words(here: Any, language: str) -> None:
    for kind, operation in job_operations().items():
        answer = here.get(f"/tools/{kind}", headers={"accept-language": language})
        shown = unescape(answer.text)
        assert answer.status_code == 200, kind
        assert 'data-testid="fault"' not in shown, kind
        assert not re.search(r"<script(?! src=| type=)|\son\w+=", answer.text), kind
        for field in job_fields(operation):
            (place,) = re.findall(
                rf'data-testid="field-{field.name}".*?</(?:label|div)>', shown, re.DOTALL
            )
            assert f'name="{field.name}' in place, f"{kind}.{field.name}"
            if field.kind in (int, float) and field.default is not None:
                assert f'value="{field.default:g}"' in place, f"{kind}.{field.name}"


def test_a_page_of_no_operation_is_refused(here: Any) -> None:
    for name in ("nothing", "sense_run", "workspace_delete", "__init__"):
        shown = here.get(f"/tools/{name}", headers={"accept-language": "en"}).text
        assert "no page is made of the operation" in shown
    assert here.get("/tools/predict/more").status_code == 404
    assert (
        "Page not found."
        in here.get("/tools/predict?job=none", headers={"accept-language": "en"}).text
    )


CASES: dict[str, tuple[dict[str, str], dict[str, Any], str, tuple[str, ...]]] = {
    "predict": ({"queries": "q.csv"}, {"model": "model"}, "predictions", ("predict.csv",)),
    "dynamics_force": ({"cut": "cut.toml"}, {"output": True}, "N", ("dynamics_force.csv",)),
    "dynamics_fit": (
        {"windows": "windows.csv", "cell": "arm.toml"}, {"output": "mine.robotrue"},
        "deviation learned from", ("mine.robotrue",),
    ),
    "dynamics_predict": (
        {"frf": "frf.csv", "force": "force.csv"}, {"report": True},
        "error", ("dynamics_predict.csv", "dynamics_predict_report.png"),
    ),
    "sense_align": (
        {"joints": "jog.csv", "force": "jog_force.csv"}, {}, "ms", ("sense_align.json",),
    ),
    "drill_plan": ({"foot": "foot.toml"}, {"clamps": 20}, "clamps", ("drill_plan.csv",)),
    "slot_test": ({"measured": "steps.csv"}, {}, "step", ()),
    "inspect": ({"path": "part.src"}, {}, "part.src", ()),
    "export_dh": ({}, {"model": "fitted", "lossy": "gear"}, "", ("export_dh.csv",)),
    "report_calibration": (
        {}, {"model": "fitted"}, "", ("report_calibration.html", "report_calibration.json"),
    ),
    "diff": (
        {}, {"before": "program", "after": "program", "output": "same.csv"}, "part.src:",
        ("same.csv",),
    ),
}  # fmt: skip
"""Files that are sent, further parameters, a word of the page, files that come of it."""


@pytest.mark.parametrize("kind", CASES)
def test_a_form_becomes_a_result_that_stays(
    here: Any, own: Shop, fitted: str, lab: Lab, kind: str
) -> None:
    files, further, word, written = CASES[kind]
    items_of = {"model": own.model.id, "program": own.program.id, "fitted": fitted}
    parameters = {k: items_of.get(str(v), v) for k, v in further.items()}
    sent = {name: send(here, file, lab(file).read_bytes()) for name, file in files.items()}
    done = do(here, own, kind, **parameters, **sent)
    assert done.state == "done", done.error
    assert done.result is not None
    record = items.get(own.workspace, DOCUMENT, done.result["document"]["id"])
    names = [each.name for each in record.attachments]
    assert set(names) >= {*written}
    assert sum(name.endswith(".json") for name in names) >= 1
    shown = page_of(here, done)
    assert word in shown
    assert all(name in shown for name in (*names, *files.values()))
    simulated = record.detail["simulated"]
    assert simulated is (done.result["simulated"] is True)
    assert ("SIMULATED" in shown.partition('id="sheet"')[2]) is simulated
    for file in record.attachments:  # nothing says where the server keeps its files
        assert b"scratch" not in own.workspace.content(file.sha256), file.name
    assert "scratch" not in shown
    assert {link.to.id for link in record.links} >= {
        v for v in parameters.values() if v in items_of.values()
    }
    assert f"/tools/{kind}?job={done.id}" in here.get("/history").text
    assert f"/tools/{kind}?job={done.id}" in here.get(f"/tools/{kind}").text
    again = do(here, own, kind, **done.parameters)  # its files are kept: it can be done again
    assert again.state == "done"
    assert again.parameters == done.parameters
    incoming = own.workspace.folder / FOLDER
    assert not any(incoming.iterdir()) if incoming.is_dir() else True
    found = verify(own.workspace)
    assert (found.faults, found.unnamed) == ((), ())


def test_a_cell_may_be_that_of_a_model(here: Any, own: Shop, fitted: str, lab: Lab) -> None:
    """What is written names the model without a folder, and the model stands beside it."""
    sent = send(here, "points.csv", lab("points.csv").read_bytes())
    done = do(here, own, "register", cell=fitted, points=sent, output="stands.toml")
    assert done.result is not None, done.error
    record = items.get(own.workspace, DOCUMENT, done.result["document"]["id"])
    files = {each.name: own.workspace.content(each.sha256) for each in record.attachments}
    named = set(re.findall(r'"([^"]+\.(?:rtm|robotrue))"', files["stands.toml"].decode()))
    assert named
    assert named <= set(files)
    assert fitted in {link.to.id for link in record.links}
    for kind, cell in (("map", own.cell.id), ("map", fitted)):
        asked = {"angle_deg": "-10,10", "radius_mm": "1000,1200", "height_mm": "800,1000"}
        done = do(here, own, kind, model=cell, **asked, grid="2,2,2", sectors=1)
        assert done.state == "done", done.error
    shown = here.get("/tools/map").text
    assert own.cell.id in shown
    assert fitted in shown


def test_a_cell_of_the_workspace_is_read_as_a_file(here: Any, own: Shop, lab: Lab) -> None:
    arm = cells.add(own.workspace, lab("arm.toml"), name="Mill")
    windows = send(here, "windows.csv", lab("windows.csv").read_bytes())
    done = do(here, own, "dynamics_fit", windows=windows, cell=arm.id)
    assert done.result is not None, done.error
    record = items.get(own.workspace, DOCUMENT, done.result["document"]["id"])
    assert arm.id in {link.to.id for link in record.links}
    assert "dynamics_fit.robotrue" in page_of(here, done)


def test_files_of_a_record_are_read_as_one_folder(here: Any, own: Shop, tmp_path: Path) -> None:
    for _ in range(2):  # a segment each
        writer = RecordWriter(tmp_path / "record", HEADER)
        writer.put(Kind.JOINTS, joint_rows(0, 100))
        writer.close()
    segments = sorted(each for each in (tmp_path / "record").iterdir() if each.stat().st_size)
    assert len(segments) == 2
    sent = [send(here, each.name, each.read_bytes()) for each in segments]
    done = do(here, own, "record_info", folder=sent)
    assert done.state == "done", done.error
    assert all(each.name in page_of(here, done) for each in segments)
    assert "<h2>record folder" in page_of(here, done)
    lone = do(here, own, "record_info", folder=send(here, "lone.csv", "a,b\n"))
    assert lone.state == "failed"


def test_what_one_job_wrote_is_read_by_the_next(here: Any, own: Shop, lab: Lab) -> None:
    files = [lab("foot.toml"), lab("campaign.csv")]
    campaign = documents.add(own.workspace, CAMPAIGN, name="clamps", files=files)
    learned = do(here, own, "drill_fit", campaign=campaign.id, kind="patent")
    assert learned.result is not None, learned.error
    model = learned.result["document"]["id"]
    records = send(here, "records.csv", lab("records.csv").read_bytes())
    refined = do(here, own, "drill_refine", model=model, records=records, truth="a gauge")
    assert refined.result is not None, refined.error
    known = send(here, "known.csv", lab("known.csv").read_bytes())
    refined_model = refined.result["document"]["id"]
    assert refined_model in here.get("/tools/drill_evaluate").text
    judged = do(here, own, "drill_evaluate", model=refined_model, test=known)
    assert judged.state == "done", judged.error
    plan = do(here, own, "drill_plan", foot=send(here, "foot.toml", lab("foot.toml").read_bytes()))
    assert plan.result is not None, plan.error
    wrong = do(
        here,
        own,
        "drill_evaluate",
        model=plan.result["document"]["id"],
        test=known_again(here, lab),
    )
    assert wrong.state == "failed"
    assert wrong.error is not None
    assert wrong.error["kind"] in ("ArchiveError", "FormatError"), wrong.error


def known_again(here: Any, lab: Lab) -> dict[str, str]:
    return send(here, "known.csv", lab("known.csv").read_bytes())


def test_a_form_comes_back_with_the_values_of_a_run(here: Any, own: Shop) -> None:
    sent = send(here, "again.csv", QUERIES)
    done = do(here, own, "predict", model=own.model.id, queries=sent, output="mine.csv")
    assert f"/tools/predict?again={done.id}" in page_of(here, done)
    form = unescape(here.get(f"/tools/predict?again={done.id}").text)
    assert 'name="output" value="mine.csv"' in form
    assert re.search(r'<option value="[^>]*again.csv[^>]*" selected', form)
    assert f'<option value="{own.model.id}" selected' in form
    fresh = unescape(here.get("/tools/predict").text)
    assert 'name="output" value="predict.csv"' in fresh


def test_what_runs_until_it_is_stopped_is_a_service() -> None:
    for each in listings():
        operation = operation_of(each.name)
        told = [field.entry.help for field in fields_of(operation.request)]
        if any("Ctrl-C" in help for help in told):
            assert operation.is_service, f"{each.name} needs is_service=True"


def test_no_parameter_of_a_job_is_a_file_of_the_server() -> None:
    for kind, operation in job_operations().items():
        for field in job_fields(operation):
            path = field.kind is Path and not isinstance(field.entry, InputFile | Output)
            assert not path, f"{kind}.{field.name}"
            words = field.entry.metavar or field.entry.help
            if not isinstance(field.entry, InputFile | Output | Item):
                assert "=FILE" not in words, f"{kind}.{field.name} names files: InputFile"


def test_several_files_become_one_input(here: Any, own: Shop, lab: Lab) -> None:
    """Tool paths of two sides, each sent along; the refusal names file and line."""
    paths = [send(here, f"side {k}.apt", lab("top.apt").read_bytes()) for k in (1, 2)]
    wrong = send(here, "side 3.apt", "PARTNO/X\nGOTO/1,2\nFINI\n")
    failed = do(here, own, "program", cell=own.cell.id, toolpaths=[*paths, wrong])
    assert failed.state == "failed"
    assert failed.error is not None
    assert (failed.error["source"], failed.error["line"]) == ("side 3.apt", 2)


def test_a_refused_file_is_told_with_its_line(here: Any, own: Shop) -> None:
    bad = QUERIES.replace("-80", "minus eighty")
    failed = do(here, own, "predict", model=own.model.id, queries=send(here, "odd.csv", bad))
    assert failed.state == "failed"
    assert failed.error is not None
    shown = page_of(here, failed)
    assert "odd.csv:3: " in shown
    assert "minus eighty" in shown
    assert "scratch" not in str(here.get(f"/api/jobs/{failed.id}").json())


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no file": ({"queries": None}, "'queries' is missing: a file."),
    "no such upload": ({"queries": {"upload": "0" * 32}}, "there is no upload"),
    "an upload that is a path": ({"queries": {"upload": "../../x"}}, "there is no upload"),
    "a path": ({"queries": {"path": "/etc/passwd"}}, "queries"),
    "an upload for an item": ({"model": {"upload": "0" * 32}}, "no file that can be sent along"),
    "a name with a path": ({"output": "../up.csv"}, "without a folder"),
    "a name of the server": ({"output": "/srv/up.csv"}, "without a folder"),
    "a name with a drive": ({"output": "C:\\up.csv"}, "without a folder"),
    "a hidden name": ({"output": ".up.csv"}, "without a folder"),
    "a long name": ({"output": "a" * 130 + ".csv"}, "without a folder"),
    "another suffix": ({"output": "up.html"}, "a CSV table is written (.csv)"),
    "no name": ({"output": 7}, "output"),
}


@pytest.mark.parametrize("what", BAD)
def test_what_cannot_be_is_refused_and_leaves_nothing(here: Any, own: Shop, what: str) -> None:
    changed, message = BAD[what]
    sent = send(here, "q.csv", QUERIES)
    before = items.search(own.workspace, DOCUMENT, ItemQuery()).total
    asked = {"model": own.model.id, "queries": sent, **changed}
    answer = here.post("/api/jobs", json={"kind": "predict", "parameters": asked})
    assert answer.status_code in (400, 404), answer.text
    assert message in answer.json()["detail"]
    assert items.search(own.workspace, DOCUMENT, ItemQuery()).total == before
    assert (
        here.delete(f"/api/files/{sent['upload']}").status_code == 204
    )  # still there to try again


def test_a_file_that_is_too_large_is_refused(client: Client, own: Shop) -> None:
    small = client(shop=own, kinds=job_kinds(), upload_limit=1000, upload_total=10**6)
    assert small.post("/api/files?name=q.csv", content=b"x" * 1001).status_code == 413


def test_names_of_files_lose_their_folders(here: Any, own: Shop) -> None:
    done = do(
        here, own, "predict", model=own.model.id, queries=send(here, "../../q x.csv", QUERIES)
    )
    assert done.parameters["queries"]["file"] == "q x.csv"
    assert done.state == "done"


@pytest.mark.parametrize("file", ["/etc/hostname", "../../../secret.csv", "..\\secret.csv"])
def test_a_file_that_is_sent_names_no_file_of_the_server(here: Any, own: Shop, file: str) -> None:
    text = f"schema = 1\n[controller]\nfiles = [{file!r}]\n"
    failed = do(here, own, "inspect", path=send(here, "cell.toml", text))
    assert failed.error is not None
    assert "which did not come with it" in failed.error["message"]


def test_a_file_kept_here_is_read_again(here: Any, own: Shop) -> None:
    """A file of an item: that of the program, by the value that its form offers."""
    offered = unescape(here.get("/tools/inspect").text)
    value = next(
        json.loads(each)
        for each in re.findall(r"<option value=\"({.*?})\">", offered)
        if json.loads(each)["id"] == own.program.id
    )
    done = do(here, own, "inspect", path=value)
    assert done.state == "done", done.error
    assert own.program.name in page_of(here, done)
    gone = do(here, own, "inspect", path={**value, "file": "other.src"})
    assert gone.error is not None
    assert "has no file 'other.src'" in gone.error["message"]
