"""Paths of constant or slowly turning attitude: fitted, and never answered by nominal (simulated).

The paths and their floor, plain least squares, are those of benchmarks/constant_attitude.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from constant_attitude import is_better, run, simulate

from robotrue.app.measured_rows import read_together
from robotrue.app.reporting import Silent
from robotrue.calibration.methods import METHODS, fit
from robotrue.cell.config import read_cell
from robotrue.core.units import MM
from robotrue.planning.information import settings_of
from robotrue.validation.evaluation import evaluate
from robotrue.validation.selection import fit_auto

FAST = ("nominal", "geometric")
PATHS = (0, 2, 4, 5, 6, 7, 8, 14, 17, 20, 21, 23, 26, 29, 33)
"""Seeds: lines of both frames, offsets beyond 3 % of the reach, turning and constant attitude."""


@pytest.mark.parametrize("seed", PATHS)
def test_a_path_is_fitted_about_as_well_as_by_least_squares(seed):
    outcome = run(simulate(seed), FAST)
    assert not outcome.refusal
    assert not outcome.unsettled
    assert not is_better(outcome)


def test_a_line_says_that_the_turn_about_it_is_not_seen():
    case = simulate(3, "line")
    assert case.train.frame == "tracker"
    summary = fit(case.robot, case.train, method="geometric", settings=case.settings)
    doubts = summary.training_summary()["doubts"]
    assert summary.training_summary()["verdict"] == "conditional"
    assert any("the turn of tracker station 0 about" in doubt for doubt in doubts)


def test_a_spread_set_does_not():
    case = simulate(25)
    model = fit(case.robot, case.train, method="geometric", settings=case.settings)
    assert not any("the turn of" in doubt for doubt in model.training_summary()["doubts"])


@pytest.mark.parametrize(("number", "reach"), [(1, 0.036), (2, 0.010), (3, 0.020)])
def test_circles_of_constant_attitude(data_dir, number, reach):
    folder = data_dir / "circle-constant-attitude" / str(number)
    if not folder.exists():
        pytest.skip(f"{folder} not found")
    cell = read_cell(folder / "cell.toml")
    train, test = (
        read_together(cell, [folder / f"{name}.csv"], None, reporter=Silent())
        for name in ("train", "test")
    )
    table = {name: METHODS[name] for name in FAST}
    model = fit_auto(cell.measured_robot, train, settings_of(cell), methods=table)
    assert model.training_summary()["method"] == "geometric"
    assert np.linalg.norm(evaluate(model, test).after, axis=1).mean() <= reach * MM
