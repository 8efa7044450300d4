"""Bad input on generated pages: refused or told with value, file, line and remedy. SIMULATED."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import touched
from mark_cases import Lab, _drilling, _dynamics
from test_register_rounds import CORNER, FRAME, KLM
from web_shop import Client, Shop, fill, write_files

from robotrue.app.job_kinds import job_kinds
from robotrue.core.provenance import Provenance
from robotrue.store import cells, jobs
from robotrue.store.jobs_claim import claim
from robotrue.store.jobs_work import attempt
from robotrue_reproductions.deng2022.design_files import write_design


@dataclass(frozen=True)
class Place:
    """A shop of this file's own with files of every kind, and its interface."""

    here: Any
    own: Shop
    lab: Lab

    def send(self, path: Path) -> dict[str, str]:
        answer = self.here.post("/api/files", params={"name": path.name}, content=path.read_bytes())
        assert answer.status_code == 201, answer.text
        return {"upload": answer.json()["id"]}

    def text(self, name: str, text: str) -> dict[str, str]:
        self.lab(name).write_text(text)
        return self.send(self.lab(name))

    def do(self, kind: str, /, **parameters: Any) -> jobs.Job:
        asked = self.here.post("/api/jobs", json={"kind": kind, "parameters": parameters})
        assert asked.status_code == 202, asked.text
        found = claim(self.own.workspace, [kind], "here/bad")
        assert found is not None
        attempt(self.own.workspace.folder, None, job_kinds()[kind], found[1])
        return jobs.status(self.own.workspace, found[1].job)

    def page(self, job: jobs.Job) -> str:
        address = f"/tools/{job.kind}?job={job.id}"
        return unescape(self.here.get(address, headers={"accept-language": "en"}).text)


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Shop, Lab]]:
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    lab = Lab(tmp_path_factory.mktemp("lab"), "", Provenance(simulated=True))
    _drilling(lab)
    _dynamics(lab)
    own = fill(tmp_path_factory.mktemp("bad") / "shop", files)
    with own.workspace:
        yield own, lab


@pytest.fixture
def place(client: Client, shelf: tuple[Shop, Lab]) -> Place:
    own, lab = shelf
    return Place(here=client(shop=own, kinds=job_kinds()), own=own, lab=lab)


def poses(place: Place, rows: int, scale: float = 1.0) -> dict[str, str]:
    table = pd.read_csv(place.own.folder / "simulated.csv", comment="#")[:rows]
    table[["x_mm", "y_mm", "z_mm"]] *= scale
    return place.text("simulated poses.csv", table.to_csv(index=False))


def few_rows(place: Place) -> jobs.Job:
    return place.do("calibrate", cell=place.own.cell.id, measurements=[poses(place, 3)])


def metres(place: Place) -> jobs.Job:
    return place.do("calibrate", cell=place.own.cell.id, measurements=[poses(place, 20, 1e-3)])


def exchanged_sides(place: Place) -> jobs.Job:
    write_design(place.lab.folder, "S2A", 1)
    cell = cells.add(place.own.workspace, place.lab("cell.toml"), name="Mill")
    return place.do(
        "transfer", cell=cell.id, method="deng2022",
        from_region=[place.send(place.lab("target.csv"))],
        measurements=[place.send(place.lab("source.csv"))],
    )  # fmt: skip


def moved_table(place: Place) -> jobs.Job:
    sent = []
    for number in (1, 2, 3):
        shift = np.array([0.002, 0.0, 0.0]) if number == 3 else 0.0
        position = touched.in_base(CORNER, seed=number) + shift
        path = place.lab(f"round{number}.csv")
        sent.append(place.send(touched.write(path, CORNER, names=KLM, position=position)))
    return place.do("register_rounds", cell=place.own.cell.id, rounds=sent, frame=FRAME)


def overlapping_windows(place: Place) -> jobs.Job:
    table = pd.read_csv(place.lab("windows.csv"), comment="#")
    start = np.arange(len(table), dtype=float)
    start[2] -= 0.5
    table = table.assign(start_s=start, end_s=start + 1.0)
    windows = place.text("shared.csv", table.to_csv(index=False))
    return place.do("dynamics_fit", windows=windows, cell=place.send(place.lab("arm.toml")))


def learn(place: Place, campaign: dict[str, str]) -> jobs.Job:
    foot = place.send(place.lab("foot.toml"))
    return place.do("drill_fit", campaign=campaign, foot=foot, kind="patent")


def old_references(place: Place) -> jobs.Job:
    learned = learn(place, place.send(place.lab("campaign.csv")))
    assert learned.result is not None, learned.error
    *head, names, row = place.lab("records.csv").read_text().splitlines()
    records = "\n".join([*head, f"hole,version,{names}", f"H7,0,{row}"]) + "\n"
    model = learned.result["document"]["id"]
    return place.do(
        "drill_refine", model=model, records=place.text("old.csv", records), truth="gauge"
    )


def one_force(place: Place) -> jobs.Job:
    table = pd.read_csv(place.lab("campaign.csv"), comment="#").assign(force_N=500.0)
    return learn(place, place.text("one.csv", table.to_csv(index=False)))


BAD: dict[str, tuple[Callable[[Place], jobs.Job], tuple[str, ...]]] = {
    "too few rows": (few_rows, ("3 poses",)),
    "metres for millimetres": (metres, ("metres were read as millimetres",)),
    "sides exchanged": (exchanged_sides, ("are source and target exchanged?", " deg")),
    "windows that overlap": (overlapping_windows, ("windows that overlap", "shared.csv:")),
    "a campaign at one force": (one_force, ("are at 500 N", "Try: two forces or more")),
    "references older than the model": (old_references, ("hole H7", "old.csv:")),
}
"""What is done, and what the page of the refusal says."""


@pytest.mark.parametrize("what", BAD)
def test_it_is_refused_with_its_remedy(place: Place, what: str) -> None:
    act, words = BAD[what]
    done = act(place)
    assert done.state == "failed"
    assert done.error is not None
    assert done.error["hint"], done.error
    shown = place.page(done)
    for each in (*words, done.error["hint"]):
        assert each in shown, (each, done.error)


def test_a_table_that_was_moved_is_told(place: Place) -> None:
    done = moved_table(place)
    assert done.state == "done", done.error
    assert "before round 3 the part moved by 2.0" in place.page(done)
