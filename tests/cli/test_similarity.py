"""``robotrue similarity``: regions of measured poses, refused where they cannot be. SIMULATED."""

from __future__ import annotations

import csv

import pandas as pd
import pytest

from robotrue_reproductions.deng2022.design_files import write_design

AROUND = "radius_mm=800..1400,height_mm=700..1200"
SECTORS = [(f"S{k}", f"angle_deg={-20 + 10 * k}..{-10 + 10 * k},{AROUND}") for k in range(4)]


@pytest.fixture(scope="module")
def design(tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    write_design(folder, "S2A", 1)
    return folder


def compare(cli, folder, *more, regions=SECTORS, file="grid.csv"):
    stated = [word for name, limits in regions for word in ("--region", f"{name}={limits}")]
    return cli("similarity", folder / "cell.toml", folder / file, "-o", folder / "sim.csv",
               *stated, *more)  # fmt: skip


def test_the_three_sub_spaces_of_the_validation_region(cli, design):
    got = compare(cli, design, "--curves", design / "curves.csv", "--report",
                  design / "page.html", "--json")  # fmt: skip
    assert got.code == 0, got.err
    regions = got.document["regions"]
    assert [each["region"] for each in regions] == ["S1", "S2", "S3"]
    assert [each["points"] for each in regions] == [126] * 3
    assert max(each["furthest_pair_mm"] for each in regions) < 1e-3
    values = [each["similarity"]["per-point"] for each in regions]
    assert values == sorted(values, reverse=True)
    assert min(values) > 0.9
    lines = (design / "sim.csv").read_text().splitlines()
    assert lines[0].startswith("# robotrue SIMULATED")
    table = list(csv.DictReader(lines[1:]))
    assert float(table[0]["per-point"]) == pytest.approx(values[0], abs=1e-6)
    curves = pd.read_csv(design / "curves.csv", comment="#")
    assert len(curves) == 3 * 126
    assert (curves[["reference_ex_mm", "region_ex_mm"]].abs().max() < 3.0).all()
    page = (design / "page.html").read_text()
    assert "SIMULATED" in page.upper()
    assert page.count("<svg") == 1


def test_sectors_and_boxes_and_sets(cli, design):
    got = compare(cli, design, "--json", regions=[])
    kinds = [each["kind"] for each in got.document["regions"]]
    assert kinds == ["cylinder"] * 3 + ["cube"] * 3
    assert got.document["compared"] == 3
    one = compare(cli, design, "--by-set", regions=[])
    assert one.code == 1
    assert "all 378 poses belong to one set" in one.err
    table = pd.read_csv(design / "grid.csv", comment="#")
    table["set"] = ["A", "B", "C"] * 126
    table.sort_values("set").to_csv(design / "mixed.csv", index=False)
    mixed = compare(cli, design, "--by-set", regions=[], file="mixed.csv")
    assert "regions A and B overlap by" in mixed.err


def test_what_is_refused(cli, design):
    both = compare(cli, design, "--by-set")
    assert "--region and --by-set both set" in both.err
    wrong = compare(cli, design, regions=[("A", "angle=1..2")])
    assert "--region A= 'angle=1..2', expected three ranges" in wrong.err
    far = compare(cli, design, regions=[SECTORS[0], ("far", f"angle_deg=90..100,{AROUND}")])
    assert far.code == 1
    assert "region far (angle 90 to 100 deg" in far.err
    assert "these cover angle -20 to 20 deg" in far.err
    table = pd.read_csv(design / "grid.csv", comment="#")
    table[["x_mm", "y_mm", "z_mm"]] /= 1000.0
    table.to_csv(design / "metres.csv", index=False)
    assert "metres were read as millimetres" in compare(cli, design, file="metres.csv").err
    assert "--apart-mm -1, expected more than 0" in compare(cli, design, "--apart-mm", -1).err
