"""Drilling over the HTTP interface: what is taken in, journals that are followed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from web_shop import Client, Shop

from robotrue.drilling.journal_lines import whole_lines
from robotrue.errors import FormatError
from robotrue.simulation.drilling_machine import drilling_machine, write_practice_files


def line(hole: str, **more: Any) -> str:
    return json.dumps({"kind": "answer", "hole": hole, "status": "refused", "version": 1, **more})


@pytest.fixture(scope="module")
def practice(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("practice")
    write_practice_files(drilling_machine(4), folder, seed=4)
    return folder


def sent(here: Any, *paths: Path) -> Any:
    ids = [
        here.post("/api/files", params={"name": path.name}, content=path.read_bytes()).json()["id"]
        for path in paths
    ]
    return here.post("/api/drilling", json={"uploads": ids})


def test_a_campaign_comes_with_its_foot_and_the_next_one_knows_it(
    client: Client, practice: Path, tmp_path: Path
) -> None:
    here = client()
    campaign, test = practice / "simulated-campaign.csv", practice / "simulated-test.csv"
    assert "without its foot file" in sent(here, campaign).json()["detail"]
    made = sent(here, practice / "foot.toml", campaign).json()
    assert made["kind"] == "drilling campaign"
    assert (made["detail"]["clamps"], made["detail"]["simulated"]) == (60, True)
    assert [each["name"] for each in made["attachments"]] == ["foot.toml", campaign.name]
    assert sent(here, test).json()["detail"]["clamps"] == 30
    swapped = tmp_path / "swapped.csv"
    swapped.write_text(campaign.read_text().replace("d1_mm,d2_mm", "d2_mm,d1_mm"))
    refused = sent(here, swapped)
    assert refused.status_code == 422
    assert "sensors are exchanged" in refused.json()["detail"]
    assert sent(here, campaign, test).status_code == 400


def test_a_journal_is_followed_from_line_to_line(client: Client, filled: Shop) -> None:
    here, place = client(), filled.workspace.folder / "drilling"
    place.mkdir(exist_ok=True)
    path = place / "line.jsonl"
    path.write_text(line("1") + "\n" + line("2") + "\n" + line("3")[:20])
    first = here.get("/api/drilling/journals/line.jsonl").json()
    assert [each["hole"] for each in first["entries"]] == ["1", "2"]
    assert first["next"] < first["size"]
    with path.open("a") as file:
        file.write(line("3")[20:] + "\n")
    rest = here.get(f"/api/drilling/journals/line.jsonl?after={first['next']}").json()
    assert [each["hole"] for each in rest["entries"]] == ["3"]
    assert rest["next"] == rest["size"]
    path.write_text(line("9") + "\n")  # another session in the same file
    anew = here.get(f"/api/drilling/journals/line.jsonl?after={rest['next']}").json()
    assert anew["anew"]
    assert [each["hole"] for each in anew["entries"]] == ["9"]
    assert here.get("/api/drilling/journals/line.jsonl?after=5").status_code == 400


@pytest.mark.parametrize("name", ["..%2Fworkspace.jsonl", "other.jsonl", "line.toml", "%00.jsonl"])
def test_only_journals_of_the_folder_are_read(client: Client, filled: Shop, name: str) -> None:
    (filled.workspace.folder / "workspace.jsonl").write_text(line("1") + "\n")
    assert client().get(f"/api/drilling/journals/{name}").status_code in (400, 404)


def test_a_line_that_is_none_is_named() -> None:
    data = (line("1") + "\nhello\n").encode()
    with pytest.raises(FormatError, match=r"x\.jsonl:2: not a line of a drilling journal"):
        whole_lines(data, source="x.jsonl")
    with pytest.raises(FormatError, match="not a line"):
        whole_lines(line("1", kind="other").encode() + b"\n", source="x")
