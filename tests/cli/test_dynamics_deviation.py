"""``robotrue dynamics fit`` and ``validate`` as a script would call them."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.dynamics.formats.dynamics_csv import write_windows
from robotrue.errors import ConfigurationError, ModelMismatchError

sys.path.insert(0, str(Path(__file__).parents[1] / "dynamics"))
from window_cases import planted, stated_arm

CELL = """schema = 1

[robot]
preset = "irb6660"
stiffness_Nm_per_rad = [{}]

[tool]
xyz_mm = [320, 0, 160]
"""


@pytest.fixture
def folder(tmp_path):
    stiffness = ", ".join(f"{k:.0f}" for k in stated_arm().stiffness)
    (tmp_path / "cell.toml").write_text(CELL.format(stiffness))
    write_windows(tmp_path / "w.csv", planted(passes=(0, 1), each=24))
    return tmp_path


def call(*arguments):
    return CliRunner().invoke(app, ["dynamics", *map(str, arguments)])


def test_fit_then_judge_new_windows(folder):
    cell, model = folder / "cell.toml", folder / "m.robotrue"
    result = call("fit", folder / "w.csv", "--cell", cell, "-o", model, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["windows"] == 48
    assert document["passes"] == ["p0", "p1"]
    assert len(document["compliance_factor"]) == 6
    assert document["training_rmse_um"] < 1.0
    write_windows(folder / "new.csv", planted(passes=(3,), each=12, seed=5))
    out = folder / "e.csv"
    result = call("validate", folder / "new.csv", "--model", model, "-o", out, "--json")
    assert result.exit_code == 0, result.output
    found = {s["method"]: s for s in json.loads(result.stdout)["scores"]}
    assert found["deviation"]["rmse_um"] < found["prediction"]["rmse_um"]
    lines = out.read_text().splitlines()
    assert lines[0] == "pass,error_um,sd_um,deviation_um,physics_um,standing"
    assert len(lines) == 13


def test_fit_of_the_paper_prints_its_tables_and_is_used(folder):
    model, out = folder / "jin.robotrue", folder / "e.csv"
    arguments = ("fit", folder / "w.csv", "--cell", folder / "cell.toml", "--method", "jin2022")
    result = call(*arguments, "-o", model)
    assert result.exit_code == 0, result.output
    for word in (
        "table 1",
        "eigenvalue",
        "contribution %",
        "table 3",
        "support vectors",
        "rmse um",
    ):
        assert word in result.output
    document = json.loads(call(*arguments, "-o", model, "--json").stdout)
    assert document["method"] == "jin2022"
    assert len(document["table1"]["rows"]) == 48
    assert sum(document["table2"]["eigenvalues"]) == pytest.approx(8.0)
    assert len(document["table3"]["loadings"]) == document["table2"]["components"]
    result = call("validate", folder / "w.csv", "--model", model, "-o", out, "--json")
    assert result.exit_code == 0, result.output
    found = {s["method"]: s for s in json.loads(result.stdout)["scores"]}
    assert found["paper"]["rmse_um"] == document["rmse_um"]["training"]


def test_validate_by_held_out_windows(folder):
    result = call(
        "validate", folder / "w.csv", "--cell", folder / "cell.toml", "--split", "unseen", "--json"
    )
    assert result.exit_code == 0, result.output
    found = {s["method"]: s for s in json.loads(result.stdout)["scores"]}
    assert set(found) == {"prediction", "paper", "deviation"}
    assert found["deviation"]["windows"] == 24
    share = found["deviation"]
    assert share["coverage_95"] is not None
    assert share["coverage_95_low"] < 0.95 <= share["coverage_95_high"]
    assert 1.0 < share["effective_windows"] < 24.0
    assert found["prediction"]["effective_windows"] is None


def test_what_is_missing_is_said(folder):
    bare = folder / "bare.toml"
    bare.write_text('schema = 1\n\n[robot]\npreset = "irb6660"\n')
    result = call("fit", folder / "w.csv", "--cell", bare, "-o", folder / "m")
    assert isinstance(result.exception, ConfigurationError)
    assert "states no joint stiffness" in str(result.exception)
    result = call(
        "fit", folder / "w.csv", "--cell", folder / "cell.toml", "-o", folder / "m",
        "--direction=1,0,0",
    )  # fmt: skip
    assert isinstance(result.exception, ModelMismatchError)
    assert "f_mean_N is the force along y, the error is stated along x" in str(result.exception)
    result = call("validate", folder / "w.csv")
    assert isinstance(result.exception, ConfigurationError)
    assert not (folder / "m").exists()


def test_windows_alone_do_not_change(folder):
    before = (folder / "w.csv").read_bytes()
    result = call("fit", folder / "w.csv", "--cell", folder / "cell.toml", "-o", folder / "w.csv")
    assert isinstance(result.exception, ConfigurationError)
    assert (folder / "w.csv").read_bytes() == before
    assert np.isfinite(planted(passes=(0,), each=12).measured).all()
