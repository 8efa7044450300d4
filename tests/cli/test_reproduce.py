"""``robotrue reproduce deng2022`` on two arms, as JSON and as files; the tables from its result."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from robotrue.app.operations.reproduce import ReproduceRequest, run
from robotrue.cli.terminal import run_operation
from robotrue_reproductions.papers import find_paper
from robotrue_reproductions.reproduction import Reproduction, figure


def find(document, table, name, quantity):
    (found,) = [
        f
        for f in document["figures"]
        if (f["table"], f["name"], f["quantity"]) == (table, name, quantity)
    ]
    return found


def test_the_papers_figures_stand_beside_ours(cli, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    words = ("deng2022", "--robots", "2", "--quick", "--json", "-o", folder)
    document = cli("reproduce", *words).document
    assert document["simulated"] is True
    assert (document["scenario"], document["robots"]) == ("S2A", 2)
    assert {f["table"] for f in document["figures"]} == {
        "4",
        "4 readings",
        "5",
        "6, 7",
        "8",
        "9",
        "11",
    }
    ours = find(document, "8", "Tr-GPR", "mean")
    assert ours["paper"] == 0.182
    assert ours["quartile_low"] <= ours["median"] <= ours["quartile_high"]
    assert 0.1 < ours["median"] < 0.2
    assert find(document, "6, 7", "complete", "poses")["median"] == 756
    for f in document["figures"]:
        if f["table"] == "6, 7":
            assert f["median"] == f["paper"]
    told = " ".join(u["what"] for u in document["unmet"])
    assert "GPR-50 = 0.658" in told
    assert "eq. 25" in told
    assert json.loads((folder / "deng2022.json").read_text()) == document
    with (folder / "deng2022.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(document["figures"])
    assert rows[0]["table"] == "4"


def test_the_tables_are_labelled_simulated(monkeypatch, capsys) -> None:
    figures = (figure("8", "Tr-GPR", "mean", "mm", 0.182, [0.1, 0.2, 0.3]),)
    result = Reproduction(scenario="S1A", robots=3, figures=figures)
    paper = replace(find_paper("deng2022"), run=lambda request, progress: result)
    monkeypatch.setattr("robotrue_reproductions.papers.find_paper", lambda name: paper)
    request = ReproduceRequest(paper="deng2022", scenario="S1A", robots=3, quick=True)
    run_operation(run, request, as_json=False)
    text = capsys.readouterr().out
    assert "SIMULATED: 3 arms of scenario S1A" in text
    assert "0.182" in text
    assert "0.150 - 0.250" in text
    assert "Not reproduced, and why" in text


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("deng2023",), "no reproduction of 'deng2023'"),
        (("deng2022", "--scenario", "S9"), "no scenario 'S9'"),
        (("deng2022", "--robots", "0"), "0 robots"),
    ],
)
def test_what_cannot_be_reproduced_is_refused(cli, words, told) -> None:
    outcome = cli("reproduce", *words)
    assert outcome.code == 1
    assert told in outcome.err
