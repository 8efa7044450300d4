"""``report``, ``drift``, ``drift-plan`` and ``export`` from the command line."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shop

from robotrue.report.json import is_intact
from robotrue.robot.statics import Load
from robotrue.store.model_file import read_model, write_model


def test_the_certificate_and_its_twin(cli, work):
    page = work / "cert.html"
    outcome = cli(
        "report", "calibration", work / "model.rtm", work / "test.csv", "-o", page,
        "--lang", "zh", "--tolerance-mm", 0.3, "--force-sigma-n", 20, "--json",
    )  # fmt: skip
    assert outcome.code == 0
    told = outcome.document
    assert told["check"]["n"] == 40
    parts = told["contributions_mm"]
    combined = np.sqrt(
        sum(v**2 for k, v in parts.items() if k not in ("range", "angle", "instrument"))
    )
    assert told["expanded_uncertainty_mm"] == pytest.approx(2.0 * combined)
    assert parts["force"] > 0.0
    assert '<html lang="zh-CN">' in page.read_text("utf-8")
    twin = json.loads((work / "cert.json").read_text("utf-8"))
    assert is_intact(twin)
    assert twin["provenance"]["model file"].startswith("model.rtm sha256:")


def test_a_certificate_without_a_check_is_a_claim(cli, work):
    outcome = cli("report", "calibration", work / "model.rtm", "-o", work / "c.json")
    assert outcome.code == 0
    assert "Not checked on separate poses" in (work / "c.json").read_text("utf-8")


def test_a_program_is_judged(cli, work):
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "out.src",
              "--allow-steps")  # fmt: skip
    assert got.code == 0
    outcome = cli(
        "report", "program", work / "part.src", work / "out.src", "--model", work / "model.rtm",
        "--tolerance-mm", 0.5, "-o", work / "p.json", "--json",
    )  # fmt: skip
    assert outcome.code == 0
    # One target of the shop's program is out of reach: nothing can be said of it.
    assert outcome.document["verdict"] == "NO-GO"
    assert "1 of 4 targets are not proven" in outcome.document["text"]


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("report", "calibration", "model.rtm", "-o", "c.docx"), ".html, .pdf, .json"),
        (("report", "calibration", "model.rtm", "-o", "c.html", "--lang", "fr"), "'fr'"),
        (("report", "registration", "cell.toml", "-o", "r.html"), "not registered"),
        (("report", "calibration", "model.rtm", "-o", "c.json", "--tolerance-mm", -1), "above 0"),
        (("drift", "model.rtm", "two.csv"), "poses"),
        (("drift-plan", "model.rtm", "-o", "p.csv", "--poses", 3), "4 or more"),
        (("export", "urdf", "model.rtm", "-o", "a.urdf"), "--lossy"),
        (("export", "dh", "model.rtm", "-o", "a.csv", "--at", "moon"), "target or tool"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(cli, work, args, words):
    joints = shop.postures(2, seed=9)
    shop.write_csv(work / "two.csv", joints, shop.points(joints))
    before = sorted(work.iterdir())
    given = [work / a if isinstance(a, str) and "." in a else a for a in args]
    outcome = cli(*given)
    assert outcome.code == 1
    assert words in outcome.err
    assert sorted(work.iterdir()) == before


def test_poses_planned_measured_and_judged(cli, work):
    sheet = work / "poses.csv"
    planned = cli("drift-plan", work / "model.rtm", "-o", sheet, "--poses", 6, "--json")
    assert planned.code == 0
    assert planned.document["sd"]["joint 2"]["theta2_deg"] < 0.01
    lines = [line for line in sheet.read_text().splitlines() if not line.startswith("#")]
    joints = np.deg2rad([[float(v) for v in line.split(",")[:6]] for line in lines[1:]])
    assert len(joints) == 6
    position = shop.points(joints, noise_seed=6)
    shop.write_csv(work / "again.csv", joints, position)
    kept = cli("drift", work / "model.rtm", work / "again.csv", "--json")
    assert kept.code == 0
    assert kept.document["verdict"] == "keep"
    moved = position + np.array([4e-4, -2e-4, 0.0])
    shop.write_csv(work / "moved.csv", joints, moved)
    found = cli("drift", work / "model.rtm", work / "moved.csv", "--json").document
    assert found["verdict"] == "update"
    best = found["causes"][0]
    assert best["name"] == "base"
    assert best["shift"]["x_mm"] == pytest.approx(0.4, abs=5.0 * best["sd"]["x_mm"])
    told = cli("drift", work / "model.rtm", work / "moved.csv")
    assert "robotrue transfer" in told.err


def test_check_poses_are_chosen_under_the_payload_of_the_cell(cli, work):
    """Fails when the noise is predicted without the load: a heavy one hides a slipped joint 2."""
    stored = read_model(work / "model.rtm")
    heavy = Load(mass=np.array([300.0]), com=np.array([[0.02, 0.0, 0.12]]))
    write_model(work / "heavy.rtm", stored.model, replace(stored.cell, payload=heavy))
    known = {}
    for name in ("model", "heavy"):
        planned = cli(
            "drift-plan", work / f"{name}.rtm", "-o", work / f"{name}.csv", "--poses", 6, "--json"
        )
        assert planned.code == 0
        known[name] = planned.document["sd"]["joint 2"]["theta2_deg"]
    assert known["heavy"] > 1.3 * known["model"]


def test_the_arm_goes_out_in_three_forms(cli, work):
    named = "geometry,gear,compliance"
    for kind, name in (("urdf", "arm.urdf"), ("dh", "arm.csv"), ("controller", "arm.txt")):
        outcome = cli(
            "export", kind, work / "model.rtm", "-o", work / name, "--lossy", named, "--at",
            "tool", "--json",
        )  # fmt: skip
        assert outcome.code == 0
        assert outcome.document["misses_largest_mm"] >= 0.0
    side = json.loads((work / "arm.compliance.json").read_text())
    assert side["compliance_rad_per_Nm"][1] == pytest.approx(1.0 / shop.STIFFNESS[1], rel=0.2)
