"""Jobs with a ``save`` of their own take files as the commands do. SIMULATED arms."""

from __future__ import annotations

from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any, Final

import pandas as pd
import pytest
import shop
from mark_cases import Lab, _drilling
from web_shop import Client, Shop, fill, write_files

from robotrue.app.files_context import FilesContext
from robotrue.app.job_kinds import job_kinds
from robotrue.app.registry import operation_of
from robotrue.app.reporting import Silent
from robotrue.core.provenance import Provenance
from robotrue.simulation import table_practice
from robotrue.store import cells, items, jobs, models, programs
from robotrue.store.jobs_claim import claim
from robotrue.store.jobs_work import attempt
from robotrue.store.model_file import read_model
from robotrue.store.nouns import CELL, DOCUMENT, MEASUREMENT, MODEL
from robotrue.store.records import ItemQuery
from robotrue.web.language import LANGUAGES, Wording
from robotrue_reproductions.deng2022.design_files import write_design

ENGLISH = {"accept-language": "en"}
SPACES: Final = 2
"""Of the paper's five sub-spaces."""
EACH: Final = 4
"""Target poses in each of them."""
AROUND: Final = "radius_mm=800..1400,height_mm=700..1200"
BY_PAPER: Final[dict[str, Any]] = {
    "method": "deng2022", "sub_spaces": SPACES, "rounds": 2,
    "source_region": f"angle_deg=-40..-30,{AROUND}",
    "target_region": f"angle_deg=-30..-5,{AROUND}",
}  # fmt: skip


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    found = fill(tmp_path_factory.mktemp("jobs") / "shop", files)
    with found.workspace:
        yield found


@pytest.fixture
def here(client: Client, own: Shop) -> Any:
    return client(shop=own, kinds=job_kinds())


def send(here: Any, path: Path) -> dict[str, str]:
    answer = here.post("/api/files", params={"name": path.name}, content=path.read_bytes())
    assert answer.status_code == 201, answer.text
    return {"upload": answer.json()["id"]}


def do(here: Any, own: Shop, kind: str, /, **parameters: Any) -> jobs.Job:
    """Asks for a job as the form does, and does it in this process."""
    asked = here.post("/api/jobs", json={"kind": kind, "parameters": parameters})
    assert asked.status_code == 202, asked.text
    found = claim(own.workspace, [kind], "here/files")
    assert found is not None
    attempt(own.workspace.folder, None, job_kinds()[kind], found[1])
    return jobs.status(own.workspace, found[1].job)


def shown(here: Any, job: jobs.Job) -> str:
    return unescape(here.get(f"/tools/{job.kind}?job={job.id}", headers=ENGLISH).text)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's source, and the poses of two of its sub-spaces."""
    folder = tmp_path_factory.mktemp("design")
    write_design(folder, "S2A", 1)
    head, *lines = (folder / "target.csv").read_text().splitlines()
    rows = [line for k in range(SPACES) for line in lines[1 + 16 * k :][:EACH]]
    (folder / "target.csv").write_text("\n".join([head, lines[0], *rows]) + "\n")
    return folder


def test_the_paper_s_transfer_is_done_from_the_page(here: Any, own: Shop, design: Path) -> None:
    """What the form sends gives the model that the command gives, its table and its page."""
    cell = cells.add(own.workspace, design / "cell.toml", name="Mill")
    form = unescape(here.get("/tools/transfer", headers=ENGLISH).text)
    for name in ("from_region[]", "measurements[]", "mapping", "method", "sub_spaces", "reading[]"):
        assert f'name="{name}"' in form, name
    done = do(
        here, own, "transfer", cell=cell.id, **BY_PAPER,
        from_region=[send(here, design / "source.csv")],
        measurements=[send(here, design / "target.csv")],
    )  # fmt: skip
    assert done.result is not None, done.error
    record = items.get(own.workspace, MODEL, done.result["model"]["id"])
    stated = {
        "cell": design / "cell.toml", "source": (f"source={design / 'source.csv'},region",),
        "measurements": (design / "target.csv",), "output": design / "new.robotrue", **BY_PAPER,
    }  # fmt: skip
    operation = operation_of("transfer")
    operation.run(operation.request.model_validate(stated), FilesContext(Silent()))
    mine = models.model_of(own.workspace, record).model.training_summary()
    theirs = read_model(design / "new.robotrue").model.training_summary()
    assert mine.method == theirs.method == "deng2022"
    for name in ("selection", "sub_spaces", "readings", "inflation"):
        assert mine[name] == theirs[name], name
    assert record.settings == {"relation": "region", "method": "deng2022"}
    assert record.refs("cell")[0].id == cell.id
    kept = [items.get(own.workspace, MEASUREMENT, ref.id) for ref in record.refs("data")]
    assert [(each.name, each.poses) for each in kept] == [("target", 8), ("source", 126)]
    assert [each.name for each in record.files("report")] == ["report.html"]
    page = shown(here, done)
    for words in ("sub-spaces of the target", "candidates on 8 target poses", "SIMULATED"):
        assert words in page, words
    assert "scratch" not in page
    back = unescape(here.get(f"/tools/transfer?again={done.id}", headers=ENGLISH).text)
    assert "target.csv" in back


def test_items_and_a_model_are_sources_too(here: Any, own: Shop, tmp_path: Path) -> None:
    joints = shop.postures(4, seed=11)
    shop.write_csv(tmp_path / "few simulated.csv", joints, shop.points(joints, noise_seed=12))
    done = do(
        here, own, "transfer", cell=own.cell.id, from_campaign=[own.model.id],
        measurements=[send(here, tmp_path / "few simulated.csv")],
    )  # fmt: skip
    assert done.result is not None, done.error
    record = items.get(own.workspace, MODEL, done.result["model"]["id"])
    assert [each.id for each in record.refs("parent")] == [own.model.id]
    assert record.settings["relation"] == "campaign"


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "nothing known": ({}, "neither a cell nor a model is stated"),
    "an option of the other method": (
        {"cell": "cell", "from_campaign": ["measured"], "sub_spaces": 2}, "deng2022",
    ),
    "no measured source": (
        {"cell": "cell", "from_region": ["model"], "method": "deng2022"}, "takes one source",
    ),
    "a model without poses": ({"model": "model"}, "no measurements were stated"),
    "a mapping of nothing": (
        {"cell": "cell", "from_campaign": ["measured"], "mapping": "file"}, "is unused",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_a_transfer_that_cannot_be_is_refused(
    here: Any, own: Shop, tmp_path: Path, what: str
) -> None:
    (tmp_path / "map.toml").write_text('joints = "A{}"\n')
    asked, message = REFUSED[what]
    ids: dict[str, Any] = {
        "cell": own.cell.id, "model": own.model.id, "measured": own.measured.id,
    }  # fmt: skip

    def state(value: Any) -> Any:
        if isinstance(value, list):
            return [ids[each] for each in value]
        return send(here, tmp_path / "map.toml") if value == "file" else ids.get(value, value)

    stated = {name: state(value) for name, value in asked.items()}
    failed = do(here, own, "transfer", **stated)
    assert failed.error is not None
    assert message in failed.error["message"]


def test_a_table_of_another_layout_is_calibrated_with_its_mapping(
    here: Any, own: Shop, tmp_path: Path
) -> None:
    """calibrate, validate and drift read what is sent, which becomes a measurement set."""
    table = pd.read_csv(own.folder / "simulated.csv", comment="#")
    foreign = {f"j{k}_deg": f"A{k}" for k in range(1, 7)} | {f"{x}_mm": x.upper() for x in "xyz"}
    table.rename(columns=foreign).to_csv(tmp_path / "simulated foreign.csv", index=False)
    (tmp_path / "map.toml").write_text(MAPPING)
    sent = send(here, tmp_path / "simulated foreign.csv")
    done = do(
        here, own, "calibrate", cell=own.cell.id, measurements=[sent], method="geometric",
        mapping=send(here, tmp_path / "map.toml"),
    )  # fmt: skip
    assert done.result is not None, done.error
    record = items.get(own.workspace, MODEL, done.result["model"]["id"])
    (data,) = record.refs("data")
    taken = items.get(own.workspace, MEASUREMENT, data.id)
    assert {each.name for each in taken.files("raw")} == {"simulated foreign.csv", "map.toml"}
    plain = own.folder / "simulated.csv"
    checked = do(here, own, "validate", model=record.id, measurements=[send(here, plain)])
    assert checked.result is not None, checked.error
    assert "before" in shown(here, checked)
    count = items.search(own.workspace, MEASUREMENT, ItemQuery()).total
    again = do(here, own, "validate", **checked.parameters)  # its poses are there already
    assert again.state == "done", again.error
    assert items.search(own.workspace, MEASUREMENT, ItemQuery()).total == count
    drifted = do(here, own, "drift", model=own.model.id, measurements=send(here, plain))
    assert drifted.result is not None, drifted.error
    assert drifted.result["verdict"] in shown(here, drifted)


MAPPING = """joints = ["A1", "A2", "A3", "A4", "A5", "A6"]
position = ["X", "Y", "Z"]
"""


def test_points_on_a_rotary_table_are_sent_with_the_page_of_calibrations(
    here: Any, own: Shop, tmp_path: Path
) -> None:
    table_practice.main([str(tmp_path)])
    cell = cells.add(own.workspace, tmp_path / "cell.toml", name="Arm and table")
    form = unescape(here.get("/calibration", headers=ENGLISH).text)
    assert '<input type="file" name="table" data-testid="table">' in form
    assert "Points on a rotary table (optional)" in form
    done = do(
        here, own, "calibrate", cell=cell.id, method="elastic",
        measurements=[send(here, tmp_path / "measured.csv")],
        table=send(here, tmp_path / "table.csv"),
    )  # fmt: skip
    assert done.result is not None, done.error
    record = items.get(own.workspace, MODEL, done.result["model"]["id"])
    learned = models.model_of(own.workspace, record).model.training_summary()
    assert learned["table"]["points"] == 4
    page = unescape(here.get(f"/calibration?model={record.id}&part=learned", headers=ENGLISH).text)
    assert "table E2: axis off by" in page


def test_the_table_of_a_job_advises_fields_of_the_page(
    here: Any, own: Shop, tmp_path: Path
) -> None:
    """A command line would be advised its options."""
    text = (own.folder / "part.src").read_text()
    files = [tmp_path / name for name in ("first.src", "second.src")]
    for file in files:
        file.write_text(text.replace("DEF part", f"DEF {file.stem}"))
    program = programs.add(own.workspace, files, name="Job")
    done = do(here, own, "compensate", model=own.model.id, program=program.id)
    assert done.result is not None, done.error
    page = f"/programs?id={done.result['program']['id']}"
    for language in LANGUAGES:
        told = unescape(here.get(page, headers={"accept-language": language}).text)
        tables = told.partition('data-testid="job-tables"')[2].partition('data-testid="left-as')[0]
        label = Wording(language)("programs.axis_targets")
        assert f"compensate with “{label}”" in tables
        assert "--" not in tables
    assert "compensate with “" in shown(here, done)


def test_a_hierarchical_plan_is_made_by_a_job(here: Any, own: Shop, design: Path) -> None:
    cell = cells.add(own.workspace, design / "cell.toml", name="Planned")
    around = "radius_mm=800..1400,height_mm=700..1200"
    asked = {
        "cell": cell.id, "method": "hierarchical", "sub_spaces": 2, "target_poses": 8,
        "source_region": f"angle_deg=-40..-30,{around}", "grid": "2,3,2",
        "target_region": f"angle_deg=-30..0,{around}", "tool_abc_deg": "0,150,0",
        "posture_deg": "0,-90,90,0,60,0",
    }  # fmt: skip
    done = do(here, own, "plan", **asked)
    assert done.result is not None, done.error
    record = items.get(own.workspace, DOCUMENT, done.result["document"]["id"])
    assert [each.name for each in record.attachments] == ["poses.csv", "poses_target.csv"]
    assert (record.kind, record.detail["target_poses"]) == ("hierarchical plan", 8)
    assert "sub-space 2" in shown(here, done)
    assert record.id not in here.get("/plan").text
    lost = do(here, own, "plan", **{**asked, "method": "information"})
    assert lost.error is not None
    assert "is an option of --method hierarchical" in lost.error["message"]


def test_a_campaign_is_sent_with_its_foot(here: Any, own: Shop, tmp_path: Path) -> None:
    lab = Lab(tmp_path / "lab", "", Provenance(simulated=True))
    lab.folder.mkdir()
    _drilling(lab)
    foot = send(here, lab("foot.toml"))
    learned = do(
        here, own, "drill_fit", campaign=send(here, lab("campaign.csv")), foot=foot, kind="patent"
    )
    assert learned.result is not None, learned.error
    model = learned.result["document"]["id"]
    (data,) = items.get(own.workspace, DOCUMENT, model).refs("data")
    campaign = items.get(own.workspace, DOCUMENT, data.id)
    assert {each.name for each in campaign.attachments} == {"campaign.csv", "foot.toml"}
    judged = do(here, own, "drill_report", model=model, campaign=send(here, lab("known.csv")))
    assert judged.result is not None, judged.error
    assert CELL.name == "cell"
