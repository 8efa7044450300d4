"""``robotrue slot-test`` and ``robotrue reproduce feng2018``: JSON, tables, page, refusals."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from robotrue_reproductions.feng2018.way_results import WAYS


def test_a_simulated_test_says_so_and_what_it_cannot_see(cli, tmp_path: Path) -> None:
    page = tmp_path / "slots.html"
    document = cli("slot-test", "--seed", "2", "-o", page, "--json").document
    assert document["simulated"] is True
    assert document["chosen"] == "calibrated"
    ways = {way["key"]: way for way in document["ways"]}
    assert list(ways) == [way.key for way in WAYS if way.key != "planned-90"]
    assert ways["calibrated"]["mismatch_mm"] < 0.1 < ways["drawn"]["mismatch_mm"]
    assert ways["paper"]["per_frame"] == 0.0
    assert ways["per-side"]["per_frame"] == 1.0
    assert ways["paper"]["rms_mm"] > ways["calibrated"]["rms_mm"]
    assert document["datum_knocked_1_mm"]["verdict"] == "is off"
    assert document["datum_at_rest"]["verdict"] == "holds"
    text = page.read_text()
    assert "SIMULATED DATA" in text
    assert text.count("<svg") == 3
    assert "m (part)" in text
    assert "What the steps cannot see" in text
    assert "http" not in text


def test_measured_steps_are_judged(cli, tmp_path: Path) -> None:
    steps = tmp_path / "steps.csv"
    steps.write_text("slot,step_mm\n1,0.68\n2,0.71\n3,0.73\n4,0.69\n")
    document = cli("slot-test", steps, "--json").document
    assert document["simulated"] is False
    assert document["mismatch_mm"] == pytest.approx(0.7025)
    assert document["sd_mm"] == pytest.approx(0.02217, abs=1e-5)
    assert document["tip_mm"] == pytest.approx(0.35125)
    assert document["per_frame"] == 0.0
    assert document["uneven"] is None
    told = cli("slot-test", steps).out
    assert "+0.351 mm across the tool" in told
    assert "SIMULATED" not in told
    assert "Probe a datum" in told
    own = cli("slot-test", steps, "--per-side", "--json").document
    assert own["per_frame"] == 1.0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--way", "best"), "no way 'best'"),
        (("--seed", "-1"), "seed -1"),
        (("-o", "no/such/page.html"), "does not exist"),
    ],
)
def test_what_cannot_be_simulated(cli, words, told) -> None:
    outcome = cli("slot-test", *words)
    assert outcome.code == 1
    assert told in outcome.err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--across", "x"), "--across 'x'"),
        (("--first-abc-deg", "0,0"), "--first-abc-deg '0,0'"),
        (("--across", "0,0,0"), "no direction"),
    ],
)
def test_what_cannot_be_judged(cli, tmp_path: Path, words, told) -> None:
    steps = tmp_path / "steps.csv"
    steps.write_text("slot,step_mm\n1,0.68\n")
    outcome = cli("slot-test", steps, *words)
    assert outcome.code == 1
    assert told in outcome.err


def test_feng2018_stands_beside_simulated_cells(cli, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    words = ("feng2018", "--robots", "2", "--quick", "--json", "-o", folder)
    document = cli("reproduce", *words).document
    assert document["simulated"] is True
    assert "Feng" in document["source"]
    tables = {f["table"] for f in document["figures"]}
    assert tables == {"worked", "readings", "floor", "slots", "sculpture", "blind"}
    found = {(f["table"], f["name"], f["quantity"]): f for f in document["figures"]}
    left = found["worked", "left after the first pass", "worst of K, L, M"]
    assert left["median"] < 1e-9
    for k, axis in enumerate("zyx"):
        total = found["worked", "both printed turns as one", axis]["median"]
        assert total == pytest.approx((3.771368, 2.613335, 4.010708)[k], abs=5e-7)
    diverging = [
        found["readings", "eq. 12 as printed, transposed", q]["median"]
        for q in ("start", "after pass 1", "after pass 2", "after pass 3")
    ]
    assert diverging == pytest.approx([36, 64, 127, 249], abs=0.5)
    assert found["floor", "no noise, same posture", "oscillation"]["median"] < 1e-3
    paper = found["slots", "3 points on the front, tip from CAD (the paper)", "step"]
    assert paper["paper"] == 0.7025
    assert paper["p05"] <= paper["median"] <= paper["p95"]
    frame = found["blind", "frame off by 6 mm and 3 deg about each axis", "step"]
    assert frame["median"] == pytest.approx(0.0, abs=1e-9)
    assert found["blind", "block knocked by 1 mm", "datum says off"]["median"] == 100.0
    told = " ".join(u["what"] for u in document["unmet"])
    assert "from 20 to 0.7" in told
    assert json.loads((folder / "feng2018.json").read_text()) == document
    with (folder / "feng2018.csv").open(newline="") as stream:
        assert len(list(csv.DictReader(stream))) == len(document["figures"])
