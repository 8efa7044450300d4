"""robotrue plan: files written, keys, and messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shop

from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.program.formats import read_job

REGION = "angle_deg=-30..30,radius_mm=800..1500,height_mm=400..1400"
QUICK = ("--candidates", 120)


def test_plan_measure_calibrate(cli, work: Path) -> None:
    """The whole way: plan, fill in what the tracker reads, calibrate, beat as many random poses."""
    poses, program, page = work / "poses.csv", work / "poses.src", work / "plan.html"
    got = cli("plan", work / "cell.toml", "-n", 16, "-o", poses, "--program", program, "--report",
              page, "--region", REGION, "--json", *QUICK)  # fmt: skip
    assert got.code == 0, got.err
    document = got.document
    assert document["poses"] == 16
    assert document["candidates"] == 120
    assert sum(document["rejected"].values()) + 120 == document["drawn"]
    for key in ("expected_mean_mm", "expected_rms_mm", "random_mean_mm", "random_low_mm"):
        assert len(document[key]) == 17
    assert document["floor_mean_mm"] < document["expected_mean_mm"][-1]
    joints = np.deg2rad(document["joints_deg"])
    np.testing.assert_allclose(document["commanded_mm"], 1e3 * shop.commanded(joints), atol=1e-6)
    assert len(read_job(program)[0]) == 32
    text = page.read_text(encoding="utf-8")
    assert "<svg" in text
    assert "Reasons of rejected postures" in text
    assert "line of sight was not checked" in text
    assert "16 poses written" in got.err

    lines = poses.read_text().splitlines()
    points = shop.points(joints, noise_seed=5)
    filled = [
        line.replace(",,,,", "," + ",".join(f"{v * 1e3:.6f}" for v in p) + ",")
        for line, p in zip(lines[2:], points, strict=True)
    ]
    poses.write_text("\n".join([*lines[:2], *filled]) + "\n")
    assert len(read_measurements(poses)) == 16
    done = cli("calibrate", work / "cell.toml", poses, "-o", work / "m.rtm", "--method", "elastic")
    assert done.code == 0, done.err
    planned = cli("validate", work / "m.rtm", work / "test.csv", "--json").document["mean_mm"]
    joints = shop.postures(16, seed=9)
    shop.write_csv(work / "random.csv", joints, shop.points(joints, noise_seed=5))
    cli("calibrate", work / "cell.toml", work / "random.csv", "-o", work / "m.rtm", "--method",
        "elastic")  # fmt: skip
    random = cli("validate", work / "m.rtm", work / "test.csv", "--json").document["mean_mm"]
    assert planned < random


def test_the_table_is_in_millimetres(cli, work: Path) -> None:
    got = cli("plan", work / "cell.toml", "-n", 8, "-o", work / "p.csv", *QUICK)
    assert got.code == 0
    assert "expected mean error, mm" in got.out
    last = got.out.strip().splitlines()[-1].split()
    assert last[0] == "8"
    assert float(last[1]) < float(last[2])
    assert "candidates from" in got.err


def test_where_a_program_works(cli, work: Path) -> None:
    got = cli("plan", work / "cell.toml", "-n", 8, "-o", work / "p.csv", "--program-targets",
              work / "part.src", "--json", *QUICK)  # fmt: skip
    assert got.code == 0, got.err
    mean = got.document["expected_mean_mm"]
    assert mean[-1] < mean[0]


def test_more_poses_for_a_calibrated_arm(cli, work: Path) -> None:
    got = cli("plan", work / "cell.toml", "-n", 3, "-o", work / "p.csv", "--model",
              work / "model.rtm", "--json", *QUICK)  # fmt: skip
    assert got.code == 0, got.err
    assert got.document["expected_mean_mm"][0] < 0.3


def test_loads_and_tolerance(cli, work: Path) -> None:
    got = cli("plan", work / "cell.toml", "-n", 14, "-o", work / "p.csv", "--payload", "20",
              "--payload", "80,10,0,150", "--tolerance-um", 20, "--json", *QUICK)  # fmt: skip
    assert got.code == 0, got.err
    loads = [load["mass_kg"] for load in got.document["loads"]]
    assert loads == [20.0, 80.0]
    assert got.document["stopped"] == (got.document["poses"] < 14)


BAD = [
    (("--region", "angle=-20..20"), "ConfigurationError", "expected three ranges LOW..HIGH of"),
    (("--region", "x_mm=2..1,y_mm=0..1,z_mm=0..1"), "ConfigurationError", "expected three ranges"),
    (("--criterion", "A"), "ConfigurationError", "criterion 'A', expected I or D."),
    (("--approach", "both"), "ConfigurationError", "approach 'both', expected one-side or"),
    (("--payload", "heavy"), "ConfigurationError", "payload 'heavy', expected KG or KG,X,Y,Z"),
    (("-n", 2), "ConfigurationError", "2 poses, expected at least 4"),
    (("-n", 6, "--trigger-output", 0, "--program", "p.src"), "ConfigurationError", "output 0,"),
    (("--tolerance-um", -1), "ConfigurationError", "tolerance -1 um, expected 0 or more."),
]


@pytest.mark.parametrize(("options", "kind", "words"), BAD, ids=range(len(BAD)))
def test_bad_requests(cli, work: Path, monkeypatch, options, kind: str, words: str) -> None:
    monkeypatch.chdir(work)
    got = cli("plan", "cell.toml", "-o", "p.csv", *QUICK, *options, "--json")
    assert got.code == 1
    assert got.fault["kind"] == kind
    assert words in got.fault["message"]
    assert not Path("p.src").exists()


def test_an_input_is_not_overwritten(cli, work: Path) -> None:
    got = cli("plan", work / "cell.toml", "-o", work / "cell.toml", "--json")
    assert got.fault["kind"] == "ConfigurationError"
    got = cli("plan", work / "cell.toml", "-o", work / "p.csv", "--region", REGION,
              "--program-targets", work / "part.src", "--json")  # fmt: skip
    assert "both set where" in got.fault["message"]


def test_a_program_for_another_maker_is_refused(cli, work: Path) -> None:
    (work / "ur.toml").write_text('schema = 1\n[robot]\npreset = "UR5"\n')
    got = cli("plan", work / "ur.toml", "-n", 6, "-o", work / "p.csv", "--program",
              work / "p.src", "--json", *QUICK)  # fmt: skip
    assert got.fault["kind"] == "ModelMismatchError"
    assert "written in KRL" in got.fault["message"]
    assert not (work / "p.src").exists()
    assert not (work / "p.csv").exists()


def test_poses_from_a_recorded_list(cli, work: Path) -> None:
    joints = shop.postures(16, 21)
    shop.write_csv(work / "recorded.csv", joints, None)
    axes = np.rad2deg(shop.nominal().controller.to_controller(joints))
    words = (",".join(f"A{k} {v:.6f}" for k, v in enumerate(row, 1)) for row in axes)
    (work / "recorded.dat").write_text("".join(f"E6AXIS P={{{word}}}\n" for word in words))
    for name, first in (("recorded.csv", 2), ("recorded.dat", 1)):
        got = cli("plan", work / "cell.toml", "-n", 5, "-o", work / "p.csv", "--json",
                  "--from", work / name)  # fmt: skip
        assert got.code == 0, got.err
        planned = np.deg2rad(got.document["joints_deg"])
        gap = np.abs(planned[:, None] - joints[None]).max(axis=2)
        assert gap.min(axis=1).max() < 1e-7
        lines = ", ".join(str(row + first) for row in gap.argmin(axis=1))
        assert f"chosen lines of {name}, in this order: {lines}" in got.err
