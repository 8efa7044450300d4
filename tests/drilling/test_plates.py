"""Plates that face different ways, errors of X and Y, feet and heads of other forms on the link."""

from __future__ import annotations

import csv
import json
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.drilling.clamp_watch import foot_sample
from robotrue.drilling.foot_file import FootSetup, read_foot
from robotrue.drilling.head import normal_from_tilt, rotation
from robotrue.errors import ConfigurationError, FormatError, RobotrueError
from robotrue.simulation.drilling_machine import clamp, drilling_machine, random_campaign

FOOT = """[foot]
radius_mm = 60
angles_deg = [90, 210, 330]

[head]
pivot_to_tip_mm = [0.0, 0.0, -350.0]
sense = [-1, 1]
"""
FIVE = """[foot]
radius_mm = [45, 45, 70, 70, 70]
angles_deg = [0, 180, 60, 200, 300]

[head]
order = "BA"
pivot_to_tip_mm = [0.0, 0.0, -300.0]
sense = [1, -1]
"""
RUN = "from robotrue.cli.main import run; run()"


def call(*arguments: str | Path) -> dict:
    done = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    if isinstance(done.exception, RobotrueError):
        raise done.exception
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def fill_in(path: Path, seed: int) -> None:
    """Does what a user does with a sheet: clamps as it says and writes the readings (simulated)."""
    machine = drilling_machine(seed, sag=np.array([[0.003, 0.0], [0.0, 0.002]]))
    rows = list(csv.DictReader(path.read_text().splitlines()))

    def column(*names: str) -> Array:
        return np.array([[float(row[name]) for name in names] for row in rows])

    made = clamp(
        machine,
        column("a_deg", "b_deg") * DEG,
        column("force_N")[:, 0],
        column("z_mm")[:, 0] * MM,
        np.random.default_rng(seed),
        axes=column("axis_A_deg", "axis_B_deg") * DEG,
    )
    for row, readings in zip(rows, made.readings / MM, strict=True):
        row.update({f"d{k + 1}_mm": f"{v:.6f}" for k, v in enumerate(readings)})
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def test_plates_over_a_range_let_a_sag_be_learned(tmp_path: Path) -> None:
    foot, sheet = tmp_path / "foot.toml", tmp_path / "sheet.csv"
    foot.write_text(FOOT)
    plan = call("drill", "plan", foot, "-o", sheet, "--clamps", "60", "--axis-a-deg", "-30,30",
                "--axis-b-deg", "0,40", "--plates", "5")  # fmt: skip
    at = {(p["A_deg"], p["B_deg"]) for p in plan["plates"]}
    assert {(-30.0, 0.0), (30.0, 40.0), (-30.0, 40.0), (30.0, 0.0), (0.0, 20.0)} == at
    rows = list(csv.DictReader(sheet.read_text().splitlines()))
    assert [row["plate"] for row in rows] == [f"P{k}" for k in range(1, 6) for _ in range(12)]
    for each in plan["plates"]:  # every clamp of a plate sees that plate, however the head stands
        own = [row for row in rows if row["plate"] == each["plate"]]
        axes, tilt, square = (
            np.array([[float(row[name]) for name in names] for row in rows]) * DEG
            for rows, names in (
                (own, ("axis_A_deg", "axis_B_deg")), (own, ("a_deg", "b_deg")),
                ([each], ("A_deg", "B_deg")),
            )
        )  # fmt: skip
        turned = rotation("AB", axes * [-1.0, 1.0])
        normal = np.einsum("nij,nj->ni", turned, normal_from_tilt("AB", tilt))
        plate = normal_from_tilt("AB", square[0] * [-1.0, 1.0])
        assert np.abs(normal - plate).max() < 1e-5
        assert np.ptp(tilt, axis=0).min() > 3.0 * DEG
    fill_in(sheet, 3)
    model = tmp_path / "m.robotrue"
    learned = call("drill", "fit", foot, sheet, "-o", model, "--kind", "interactions")
    assert learned["inputs"] == ["A", "B"]
    alone = call("drill", "fit", foot, sheet, "-o", tmp_path / "n.robotrue", "--kind",
                 "interactions", "--inputs", "none")  # fmt: skip
    assert learned["held_out_mean_deg"] < 0.3 * alone["held_out_mean_deg"]
    foot.write_text(FOOT.replace("[-1, 1]", "[1, 1]"))
    with pytest.raises(RobotrueError, match="reversed axes A"):
        call("drill", "fit", foot, sheet, "-o", model)


@pytest.mark.parametrize(
    ("further", "message"),
    [
        (("--axis-a-deg", "5,5"), "faces one way only"),
        (("--axis-a-deg", "30,-30"), "lowest first"),
        (("--axis-a-deg", "-9,9", "--axis-b-deg", "-9,9", "--plates", "2"), "at least 3"),
        (("--axis-a-deg", "-9,9", "--plates", "5"), "at least 5 on each"),
    ],
)
def test_plates_that_cannot_be(tmp_path: Path, further: Sequence[str], message: str) -> None:
    (tmp_path / "foot.toml").write_text(FOOT)
    with pytest.raises(ConfigurationError, match=message):
        call("drill", "plan", tmp_path / "foot.toml", "-o", tmp_path / "s.csv", "--clamps", "20",
             *further)  # fmt: skip


def test_adjust_uses_x_and_y_against_the_truth(tmp_path: Path) -> None:
    machine = drilling_machine(5, warp=np.array([[0.0, 0.002], [0.001, 0.0]]))
    random = np.random.default_rng(5)
    (tmp_path / "foot.toml").write_text(FOOT)
    write_campaign(tmp_path / "campaign.csv", random_campaign(machine, 60, random, travel=0.8))
    model = tmp_path / "m.robotrue"
    learned = call("drill", "fit", tmp_path / "foot.toml", tmp_path / "campaign.csv", "-o", model,
                   "--kind", "interactions")  # fmt: skip
    assert learned["inputs"] == ["X", "Y"]
    holes = random_campaign(machine, 4, random, held_out=True, travel=0.8)
    largest = 0.0
    for i in range(4):
        c = holes.clamps.take(np.array([i]))
        clamped = ("--reading", ",".join(f"{v / MM:.6f}" for v in c.readings[0]),
                   "--force", f"{c.force[0]:.3f}", "--z", f"{c.height[0] / MM:.3f}")  # fmt: skip
        at = ",".join(f"{v / MM:.3f}" for v in c.place[0])
        found = call("drill", "adjust", model, *clamped, "--xy", at)
        off = np.array([found["a_deg"], found["b_deg"]]) - holes.tilt[i] / DEG
        assert np.abs(off).max() < 4.0 * max(found["a_sigma_deg"], found["b_sigma_deg"]) < 0.05
        elsewhere = call("drill", "adjust", model, *clamped, "--xy", "0,0")
        largest = max(largest, abs(elsewhere["a_deg"] - holes.tilt[i, 0] / DEG))
    assert largest > 0.04  # .002 rad per m over half a metre: X and Y count
    with pytest.raises(RobotrueError, match="uses the machine's X, Y"):
        call("drill", "adjust", model, *clamped)


def test_a_foot_of_five_sensors_on_a_mirrored_head_drills_over_the_link(tmp_path: Path) -> None:
    foot, practice = tmp_path / "five.toml", tmp_path / "practice"
    foot.write_text(FIVE)
    machine = ("--foot", foot, "--seed", "4")
    written = call("simulate", "drill", "--write", practice, *machine)
    stated, own = (read_foot(path).head for path in (written["files"][0], foot))
    assert stated is not None
    assert own is not None
    assert (stated.order, stated.sense) == (own.order, own.sense) == ("BA", (1.0, -1.0))
    model, journal = tmp_path / "five.robotrue", tmp_path / "holes.jsonl"
    call("drill", "fit", *written["files"][:2], "-o", model, "--kind", "interactions")
    desk = started("drill", "run", model, "--journal", journal, "--from", "udp://127.0.0.1:0",
                   "--quiet-ms", "60")  # fmt: skip
    try:
        assert desk.stderr is not None
        found = re.search(r"udp://127\.0\.0\.1:\d+", desk.stderr.readline())
        assert found is not None
        head = started("simulate", "drill", *machine, "--holes", "3", "--pause-s", "0", "--to",
                       found[0], "--json")  # fmt: skip
        out, err = head.communicate(timeout=100)
        assert head.returncode == 0, err
    finally:
        desk.send_signal(signal.SIGTERM)
        desk.communicate(timeout=20)
    figures = json.loads(out)
    assert (figures["moved"], figures["refused"], figures["without_answer"]) == (3, 0, 0)
    assert figures["tilt_left_max_deg"] < 0.05 < figures["tilt_before_mean_deg"]


def started(*arguments: str | Path) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603 - this interpreter
        [sys.executable, "-c", RUN, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_machine_with_more_sensors_than_the_foot_is_refused() -> None:
    setup = FootSetup(foot=drilling_machine(1).foot, head=None, count=None, zero=None, source="")
    values = {f"d{k}_mm": 0.1 for k in range(1, 5)} | {"force_N": 1.0, "z_mm": 0.0}
    with pytest.raises(FormatError, match="d4_mm of a machine with more sensors than the 3"):
        foot_sample({**values, "A_deg": 0.0, "B_deg": 0.0}, setup, 0.0)
