"""The data doctor on the command line: named by `inspect --doctor` and `calibrate`, cured there."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def bumped(work: Path) -> Path:
    """The poses of the calibration, the instrument 0.6 mm higher from the 41st on."""
    head, *lines = (work / "cal.csv").read_text(encoding="utf-8").splitlines()
    place = [name.strip() for name in head.split(",")].index("z_mm")
    for k in range(40, len(lines)):
        cells = lines[k].split(",")
        cells[place] = f"{float(cells[place]) + 0.6:.6f}"
        lines[k] = ",".join(cells)
    path = work / "bumped.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def test_inspect_names_the_cause_the_lines_and_the_cure(cli, work: Path, bumped: Path) -> None:
    got = cli("inspect", bumped, "--doctor", work / "cell.toml", "--json")
    assert got.code == 0
    (found,) = got.document["doctor"]["findings"]
    assert found["cause"] == found["cure"] == "instrument-moved"
    assert found["lines"][0] == 42
    assert found["odds"] > 100.0
    assert found["after_mm"] < found["before_mm"]


def test_calibrate_warns_and_cures_only_when_asked(cli, work: Path, bumped: Path) -> None:
    before = bumped.read_bytes()
    told = cli("calibrate", work / "cell.toml", bumped, "-o", work / "m.rtm", "--method", "nominal",
               "--json")  # fmt: skip
    assert told.code == 0
    assert "data doctor: Tracker moved" in told.document["doubts"][0]
    assert told.document["verdict"] == "conditional"
    cured = cli("calibrate", work / "cell.toml", bumped, "-o", work / "c.rtm", "--method",
                "nominal", "--cure", "instrument-moved", "--json")  # fmt: skip
    assert cured.code == 0
    assert cured.document["lineage"][0]["step"] == "cure"
    assert cured.document["cure"]["cause"] == "instrument-moved"
    assert cured.document["rms_m"] < told.document["rms_m"]
    assert bumped.read_bytes() == before
    other = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "d.rtm",
                "--cure", "drift")  # fmt: skip
    assert other.code != 0
    assert "finds nothing" in other.err
