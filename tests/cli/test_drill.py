"""``robotrue drill``: the contract others script against, from foot file to frozen model."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.errors import RobotrueError
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign

FOOT = """[foot]
radius_mm = 60
angles_deg = [90, 210, 330]

[head]
pivot_to_tip_mm = [0.0, 0.0, -350.0]
"""


def call(*arguments: str | Path) -> dict:
    """JSON of a command that succeeds."""
    done = CliRunner().invoke(app, ["drill", *map(str, arguments), "--json"])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with foot, campaign, test and model."""
    folder = tmp_path_factory.mktemp("drill")
    machine = drilling_machine(2, nonlinear=True, friction=True)
    random = np.random.default_rng(2)
    (folder / "foot.toml").write_text(FOOT)
    write_campaign(folder / "campaign.csv", random_campaign(machine, 45, random))
    write_campaign(folder / "test.csv", random_campaign(machine, 60, random, held_out=True))
    call(
        "fit", folder / "foot.toml", folder / "campaign.csv", "-o", folder / "m.robotrue",
        "--kind", "physics",
    )  # fmt: skip
    return folder


def test_fit_says_how_it_did_where_it_had_not_seen(job: Path, tmp_path: Path) -> None:
    out = call("fit", job / "foot.toml", job / "campaign.csv", "-o", tmp_path / "m.robotrue",
               "--kind", "interactions")  # fmt: skip
    assert out["kind"] == "interactions"
    assert 0.0 < out["held_out_mean_deg"] < 0.1
    assert [t["term"] for t in out["terms"]] == ["1", "a", "b", "F", "z", "F a", "F b", "F F"]
    assert out["envelope"]["force_N"] == [0.0, 981.0]


def test_the_patents_regression_is_told_by_its_five_terms(job: Path, tmp_path: Path) -> None:
    out = call("fit", job / "foot.toml", job / "campaign.csv", "-o", tmp_path / "m.robotrue",
               "--kind", "patent")  # fmt: skip
    assert [t["term"] for t in out["terms"]] == ["1", "a", "b", "F", "z"]


def test_evaluate_compares_uncorrected_patent_and_ours(job: Path) -> None:
    out = call("evaluate", job / "m.robotrue", job / "test.csv")
    for name in ("uncorrected", "patent", "ours"):
        assert 0.0 < out[name]["mean_deg"] <= out[name]["p95_deg"] <= out[name]["max_deg"]
    assert out["ours"]["mean_deg"] < 0.5 * out["patent"]["mean_deg"]
    assert out["patent"]["mean_deg"] < 0.5 * out["uncorrected"]["mean_deg"]


def test_adjust_gives_tilt_deviations_and_the_move(job: Path) -> None:
    rows = list(csv.DictReader((job / "test.csv").read_text().splitlines()[1:]))
    for row in rows[:5]:
        out = call(
            "adjust", job / "m.robotrue",
            "--reading", ",".join(row[f"d{k}_mm"] for k in (1, 2, 3)),
            "--force", row["force_N"], "--z", row["z_mm"], "--as", "gcode",
        )  # fmt: skip
        for axis in "ab":
            off = out[f"{axis}_deg"] - float(row[f"{axis}_deg"])
            assert abs(off) < 5.0 * out[f"{axis}_sigma_deg"] + 0.01
        move = out["move"]
        assert move["A_deg"] == pytest.approx(out["a_deg"], abs=1e-9)
        a, b = np.array([move["A_deg"], move["B_deg"]]) * DEG
        tip = -350.0 * np.array([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b) - 1.0])
        shift = [move[f"d{x}_mm"] for x in "XYZ"]
        np.testing.assert_allclose(shift, -tip, atol=1e-9)
        assert out["program"].startswith("G91\nG1 X")


def test_a_foot_without_a_head_leaves_the_shift_open(job: Path, tmp_path: Path) -> None:
    (tmp_path / "foot.toml").write_text(FOOT.partition("[head]")[0])
    call("fit", tmp_path / "foot.toml", job / "campaign.csv", "-o", tmp_path / "m.robotrue",
         "--kind", "patent")  # fmt: skip
    out = call("adjust", tmp_path / "m.robotrue", "--reading", "1,0,-1", "--force", "100",
               "--z", "0")  # fmt: skip
    assert out["move"]["dX_mm"] is None
    assert "pivot_to_tip_mm" in out["notes"][0]


def test_a_plan_is_a_sheet_to_fill_in(job: Path, tmp_path: Path) -> None:
    out = call("plan", job / "foot.toml", "-o", tmp_path / "sheet.csv", "--clamps", "20")
    assert out["clamps"] == 20
    rows = list(csv.DictReader((tmp_path / "sheet.csv").read_text().splitlines()))
    assert {float(row["force_N"]) for row in rows} <= {0.0, 250.0, 500.0, 750.0, 1000.0}
    assert all(row["d1_mm"] == "" for row in rows)
    assert max(np.hypot(float(r["a_deg"]), float(r["b_deg"])) for r in rows) <= 4.0


def test_refine_and_freeze(job: Path, tmp_path: Path) -> None:
    rows = list(csv.DictReader((job / "test.csv").read_text().splitlines()[1:]))[:20]
    with (tmp_path / "holes.csv").open("w") as stream:
        names = ["hole", "left_a_deg", "left_b_deg", *list(rows[0])[2:]]
        out = csv.DictWriter(stream, names)
        out.writeheader()
        for i, row in enumerate(rows):
            kept = {k: v for k, v in row.items() if k not in ("a_deg", "b_deg")}
            out.writerow({"hole": f"H{i}", "left_a_deg": 0.01, "left_b_deg": -0.01, **kept})
    model = tmp_path / "m2.robotrue"
    found = call("refine", job / "m.robotrue", tmp_path / "holes.csv", "-o", model,
                 "--truth", "hole gauge", "--sigma-deg", "0.005")  # fmt: skip
    assert found["records"] == 20
    assert found["refinement"]["truths"] == ["hole gauge"]
    np.testing.assert_allclose(found["refinement"]["constant_deg"], [0.01, -0.01], atol=0.002)
    freeze = ("refine", job / "m.robotrue", tmp_path / "holes.csv", "-o", model,
              "--truth", "hole gauge", "--allowed-deg", "0.2", "--freeze")  # fmt: skip
    with pytest.raises(RobotrueError, match="it is not frozen"):
        call(*freeze, job / "test.csv")
    frozen = call(*freeze, _turned(job / "test.csv", tmp_path / "turned.csv"))
    assert frozen["frozen"]["version"] == 1
    assert frozen["frozen"]["clamps"] == 60


def _turned(test: Path, out: Path) -> Path:
    """The test with true tilts that are off as the references say."""
    mark, *lines = test.read_text().splitlines()
    assert mark.startswith("# robotrue SIMULATED")
    rows = list(csv.DictReader(lines))
    for row in rows:
        row |= {f"{n}_deg": float(row[f"{n}_deg"]) + v for n, v in (("a", 0.01), ("b", -0.01))}
    with out.open("w") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return out


def test_the_report_says_simulated(job: Path, tmp_path: Path) -> None:
    page = tmp_path / "drill.html"
    call("report", job / "m.robotrue", job / "test.csv", "-o", page, "--simulated")
    text = page.read_text()
    assert "SIMULATED" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    twin = json.loads(page.with_suffix(".json").read_text())
    (tilt,) = [b for s in twin["sections"] for b in s["blocks"] if b.get("kind") == "tilt"]
    assert len(tilt["after_deg"]) == 60


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("adjust", "m.robotrue", "--reading", "1,2", "--force", "1", "--z", "1"), "3 numbers"),
        (("adjust", "m.robotrue", "--reading", "9,-9,0", "--force", "1", "--z", "1"), "reach"),
        (("adjust", "m.robotrue", "--reading", "1,0,-1", "--force", "5000", "--z", "1"), "covers"),
        (
            ("adjust", "m.robotrue", "--reading", "1,0,-1", "--force", "1", "--z", "1",
             "--as", "krl"),
            "without --robot",
        ),
        (("fit", "foot.toml", "campaign.csv", "-o", "campaign.csv"), "a robotrue file is written"),
        (("fit", "foot.toml", "campaign.csv", "-o", "x", "--kind", "best"), "expected auto"),
        (("plan", "foot.toml", "-o", "x.csv", "--tilt-deg", "20"), "follows up to 8 deg"),
        (("plan", "foot.toml", "-o", "x.csv", "--clamps", "5"), "at least 15"),
        (("evaluate", "campaign.csv", "test.csv"), "not a robotrue model"),
    ],
)  # fmt: skip
def test_refusals(
    job: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(job)
    before = {path.name: path.read_bytes() for path in job.iterdir()}
    with pytest.raises(RobotrueError, match=message):
        call(*arguments)
    assert {path.name: path.read_bytes() for path in job.iterdir()} == before


def test_a_robot_carries_the_foot(job: Path) -> None:
    with pytest.raises(RobotrueError, match="without --joints-deg"):
        call("adjust", job / "m.robotrue", "--reading", "1,0,-1", "--force", "1", "--z", "1",
             "--robot", job / "m.robotrue")  # fmt: skip


def test_units_of_the_campaign_file(job: Path) -> None:
    row = next(csv.DictReader((job / "campaign.csv").read_text().splitlines()[1:]))
    assert abs(float(row["d1_mm"])) * MM < 0.02
