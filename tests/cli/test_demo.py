from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from robotrue.app.demo_measured import run_measured_demo
from robotrue.app.demo_virtual import run_virtual_demo
from robotrue.app.files_context import FilesContext
from robotrue.app.reporting import Silent
from robotrue.program.formats import read_program
from robotrue.simulation.flange_hole import FlangeHole, side_rows

ROOT = Path(__file__).resolve().parents[2]


class Steps(Silent):
    """Keeps the share of the job that is behind."""

    def __init__(self):
        self.shares = []

    def step(self, text, done, of):
        self.shares.append(done / of)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    steps = Steps()
    folder = tmp_path_factory.mktemp("demo")
    result = run_virtual_demo(folder, FilesContext(steps), seed=1)
    return result, steps.shares


def test_the_demo_leaves_everything_to_run_it_again(demo):
    folder = demo[0].folder
    for name in (
        "cell.toml",
        "calibration.csv",
        "held_out.csv",
        "flange_hole.src",
        "flange_hole_compensated.src",
        "model.robotrue",
        "demo.html",
        "results.json",
    ):
        assert (folder / name).stat().st_size > 0


def test_the_compensated_program_lands_nearer_and_says_simulated(demo):
    results = demo[0].results
    assert results["simulated"] is True
    assert results["dry_run"]["after"]["mean_mm"] < 0.3 * results["dry_run"]["before"]["mean_mm"]
    assert results["held_out"]["after"]["mean_mm"] < 0.1
    assert results["hole"]["after"]["position_mm"] < results["hole"]["before"]["position_mm"]
    assert json.loads((demo[0].folder / "results.json").read_text()) == results
    assert "SIMULATED" in demo[0].page.read_text()
    assert all("SIMULATED" in str(table.rows) for table in demo[0].tables)


def test_the_readme_prints_the_numbers_of_the_demo(demo):
    """A value on a rounding boundary may be printed up on one processor, down on the next."""
    results, readme = demo[0].results, (ROOT / "README.md").read_text(encoding="utf-8")
    rows = {
        "50 held-out poses, mean mm": ("held_out", "mean_mm"),
        "39 targets on the hole's path, mean mm": ("dry_run", "mean_mm"),
        "milled 210 mm hole, position mm": ("hole", "position_mm"),
        "milled 210 mm hole, contour mean mm": ("hole", "contour_mean_mm"),
    }
    for row, (part, key) in rows.items():
        printed = re.search(rf"\| {re.escape(row)} \|.*\| ([\d.]+) -> ([\d.]+) \|", readme)
        assert printed is not None, row
        for text, when in zip(printed.groups(), ("before", "after"), strict=True):
            assert float(text) == pytest.approx(results[part][when][key], abs=0.0011), row


def test_only_numbers_of_targets_differ(demo):
    before, after = (
        (demo[0].folder / name).read_bytes().splitlines()
        for name in ("flange_hole.src", "flange_hole_compensated.src")
    )
    assert len(before) == len(after)
    changed = [b for a, b in zip(before, after, strict=True) if a != b]
    assert all(line.startswith((b"LIN {", b"CIRC {")) for line in changed)
    program = read_program(demo[0].folder / "flange_hole_compensated.src")
    wanted = read_program(demo[0].folder / "flange_hole.src")
    rows = side_rows(wanted, FlangeHole(), 1)
    moved = np.linalg.norm(program.position[rows] - wanted.position[rows], axis=1)
    assert 0.2e-3 < moved.mean() < 4e-3


def test_progress_goes_from_nothing_to_done(demo):
    steps = demo[1]
    assert steps[0] == 0.0
    assert steps[-1] == 1.0
    assert steps == sorted(steps)


@pytest.mark.data
def test_the_demo_on_the_ur10(data_dir, tmp_path):
    result = run_measured_demo(data_dir, tmp_path, FilesContext(Silent()), seed=1, rows=150)
    assert result.simulated is False
    random = result.results["held_out"][0]
    assert random["after"]["mean_mm"] < 0.6 * random["before_aligned"]["mean_mm"]
    kinds = {row["split"].split()[0] for row in result.results["held_out"]}
    assert kinds == {"random", "blocks", "regions"}
    path = result.results["path_predicted"]
    assert path["after_by_other_model"]["mean_mm"] < 0.5 * path["before"]["mean_mm"]
    assert "PREDICTED" in result.tables[1].title
