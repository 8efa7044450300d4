"""What others script against: keys, columns, streams, exit codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shop

from robotrue.calibration.methods import METHODS

STATISTICS = {"n", "mean_mm", "max_mm", "p95_mm", "std_mm"}


def test_calibrate_json_and_model_file(cli, work: Path) -> None:
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "m.rtm",
              "--method", "elastic", "--json")  # fmt: skip
    assert got.code == 0
    assert got.document["model"] == str(work / "m.rtm")
    assert got.document["method"] == "elastic"
    assert got.document["rows"] == 60
    assert got.document["rms_m"] < 5e-5
    assert got.document["verdict"] in ("determined", "conditional")
    for key in ("doubts", "unseen", "screened_rows", "sources", "data_sha256", "parameters"):
        assert key in got.document
    assert not any("alike" in line for line in got.document["doubts"])
    assert "60 poses from 1 file" in got.err
    assert (work / "m.rtm").read_bytes() == (work / "model.rtm").read_bytes()


def test_calibrate_speaks_in_millimetres(cli, work: Path) -> None:
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "m.rtm",
              "--method", "elastic")  # fmt: skip
    rows = {line.strip().split("  ")[0]: line for line in got.out.splitlines() if line.strip()}
    assert rows["method"].split()[-1] == "elastic"
    assert rows["residual rms"].split()[-1] == "mm"
    assert rows["verdict"]
    assert got.err.count("cannot be separated") == 1
    assert "warning: " in got.err or "determined" in got.out


@pytest.mark.parametrize("method", ["nominal", "geometric", "elastic"])
def test_each_method_predicts_better_than_nothing(cli, work: Path, method: str) -> None:
    model = work / "m.rtm"
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", model, "--method", method,
              "--json")  # fmt: skip
    assert got.code == 0
    assert got.document["method"] == method
    held_out = cli("validate", model, work / "test.csv", "--json").document
    assert held_out["mean_mm"] < held_out["before"]["mean_mm"]


def test_method_auto_says_which_won(cli, work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in sorted(set(METHODS) - {"nominal", "elastic"}):  # the contest, not its contestants
        monkeypatch.delitem(METHODS, name)
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "m.rtm", "--json")
    assert got.code == 0
    assert got.document["selection"]["winner"] in got.err
    held_out = cli("validate", work / "m.rtm", work / "test.csv", "--json").document
    assert held_out["mean_mm"] < 0.06


def test_validate_json(cli, work: Path) -> None:
    got = cli("validate", work / "model.rtm", work / "test.csv", "--json")
    document = got.document
    assert got.code == 0
    assert set(document) >= STATISTICS | {"coverage_95", "before"}
    assert set(document["before"]) >= STATISTICS
    assert document["n"] == 40
    assert document["mean_mm"] < 0.05 < document["before"]["mean_mm"]
    assert 0.8 <= document["coverage_95"] <= 1.0


def test_validate_one_pose_says_what_it_cannot_say(cli, work: Path) -> None:
    lines = (work / "test.csv").read_text().splitlines(keepends=True)
    head = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    (work / "one.csv").write_text("".join(lines[: head + 2]))
    got = cli("validate", work / "model.rtm", work / "one.csv")
    assert got.code == 0
    assert "1 pose: only the error of these poses is known. Unknown: the accuracy" in got.err


def test_validate_table_and_report(cli, work: Path) -> None:
    got = cli("validate", work / "model.rtm", work / "test.csv", "--report", work / "r.html")
    assert got.code == 0
    for row in ("base and tool as stated", "before: base and tool corrected", "after"):
        assert any(line.strip().startswith(row) for line in got.out.splitlines())
    assert (work / "r.html").read_text(encoding="utf-8").startswith("<!")
    assert "95 % region" in got.err


def test_calibrate_report(cli, work: Path) -> None:
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "m.rtm",
              "--method", "elastic", "--report", work / "r.html")  # fmt: skip
    assert got.code == 0
    assert "Calibration" in (work / "r.html").read_text(encoding="utf-8")


def test_predict_columns_and_values(cli, work: Path) -> None:
    joints = shop.postures(25, seed=9)
    shop.write_csv(work / "q.csv", joints, None)
    got = cli("predict", work / "model.rtm", work / "q.csv", "-o", work / "p.csv", "--json")
    assert got.code == 0
    assert got.document["n"] == 25
    assert got.document["output"] == str(work / "p.csv")
    table = pd.read_csv(work / "p.csv")
    assert list(table) == ["ex_mm", "ey_mm", "ez_mm", "sx_mm", "sy_mm", "sz_mm"]
    error = table.iloc[:, :3].to_numpy() * 1e-3
    sigma = table.iloc[:, 3:].to_numpy() * 1e-3
    truth = shop.points(joints) - shop.commanded(joints)  # actual minus commanded
    assert np.linalg.norm(error - truth, axis=1).mean() < 4e-5
    assert (sigma > 0.0).all()
    assert got.document["mean_mm"] == pytest.approx(
        np.linalg.norm(error, axis=1).mean() * 1e3, rel=1e-4
    )


def test_predict_under_a_wrench_bends_as_the_arm_does(cli, work: Path) -> None:
    joints = shop.postures(25, seed=9)
    wrench = {f"f{a}_N": np.full(25, f) for a, f in zip("xyz", shop.FORCE[:3], strict=True)}
    shop.write_csv(work / "free.csv", joints, None)
    shop.write_csv(work / "held.csv", joints, None, wrench)
    for name in ("free", "held"):
        assert cli("predict", work / "model.rtm", work / f"{name}.csv",
                   "-o", work / f"{name}.out").code == 0  # fmt: skip
    free, held = (pd.read_csv(work / f"{n}.out").to_numpy()[:, :3] * 1e-3 for n in ("free", "held"))
    bend = shop.points(joints, shop.FORCE) - shop.points(joints)
    assert np.linalg.norm(bend, axis=1).mean() > 3e-4
    assert (
        np.linalg.norm(held - free - bend, axis=1).max() < 0.15 * np.linalg.norm(bend, axis=1).max()
    )


def test_every_optional_column(cli, work: Path) -> None:
    joints = shop.postures(60, seed=1)
    n = len(joints)
    zero = np.zeros(n)
    extra = {
        **{f"s{a}_mm": np.full(n, 0.02) for a in "xyz"},
        **{f"c{a}_mm2": np.full(n, 1e-5) for a in ("xy", "xz", "yz")},
        **{f"f{a}_N": zero for a in "xyz"},
        **{f"m{a}_Nm": zero for a in "xyz"},
        **{f"approach{i}": np.ones(n) for i in range(1, 7)},
        "temperature_C": np.full(n, 21.5),
        "payload_kg": np.full(n, 50.0),
        **dict(zip(("payload_x_mm", "payload_y_mm", "payload_z_mm"),
                   np.tile([[20.0], [0.0], [120.0]], n), strict=True)),
        "target": [0] * n,
        "station": [0] * n,
        "set": ["morning"] * 30 + ["evening"] * 30,
    }  # fmt: skip
    shop.write_csv(work / "full.csv", joints, shop.points(joints, noise_seed=2), extra)
    got = cli("calibrate", work / "cell.toml", work / "full.csv", "-o", work / "m.rtm",
              "--method", "elastic", "--json")  # fmt: skip
    assert got.code == 0
    assert got.document["rms_m"] < 5e-5
    seen = cli("inspect", work / "full.csv", "--json").document
    assert seen["sets"] == ["morning", "evening"]
    assert seen["mean_sigma_um"] == pytest.approx(20.0)


def test_measured_orientation_is_used(cli, work: Path) -> None:
    from robotrue.core.rotations import abc_from_matrix
    from robotrue.robot.statics import deflect_arm

    joints = shop.postures(40, seed=11)
    state, _ = deflect_arm(shop.actual(), joints, shop.PAYLOAD)
    angles = np.rad2deg(abc_from_matrix(state.rotation))[:, ::-1]
    extra = dict(zip(("rx_deg", "ry_deg", "rz_deg"), angles.T, strict=True))
    shop.write_csv(work / "pose.csv", joints, shop.points(joints, noise_seed=2), extra)
    got = cli("calibrate", work / "cell.toml", work / "pose.csv", "-o", work / "m.rtm",
              "--method", "elastic", "--json")  # fmt: skip
    assert got.code == 0
    assert got.document["numbers"] == 6 * 40
    assert cli("inspect", work / "pose.csv", "--json").document["full_poses"] == 40


def test_several_files_are_one_calibration(cli, work: Path) -> None:
    lines = (work / "cal.csv").read_text().splitlines()
    (work / "a.csv").write_text("\n".join(lines[:31]) + "\n")
    (work / "b.csv").write_text("\n".join([lines[0], *lines[31:]]) + "\n")
    got = cli("calibrate", work / "cell.toml", work / "a.csv", work / "b.csv", "-o",
              work / "m.rtm", "--method", "elastic", "--json")  # fmt: skip
    assert "60 poses from 2 files" in got.err
    assert [s.split()[0] for s in got.document["sources"]] == ["a.csv", "b.csv"]
    one = pd.read_csv(_predicted(cli, work, work / "model.rtm"))
    two = pd.read_csv(_predicted(cli, work, work / "m.rtm"))
    np.testing.assert_allclose(one, two, atol=2e-6)  # printed to 1e-6 mm


def _predicted(cli, work: Path, model: Path) -> Path:
    out = work / f"{model.stem}.out"
    assert cli("predict", model, work / "test.csv", "-o", out).code == 0
    return out


MAPPING = """name = "our-tracker"
joints = ["A1", "A2", "A3", "A4", "A5", "A6"]
joints_sign = [-1, -1, -1, -1, -1, -1]
joints_offset = [0, -90, 90, 0, 0, 0]
position = ["X", "Y", "Z"]
position_unit = "m"
delimiter = ";"
decimal = ","
"""


def test_mapping_file_reads_controller_axes(cli, work: Path) -> None:
    """A = -q + (0, -90, 90, 0, 0, 0), metres, decimal comma: the same rows in another layout."""
    table = pd.read_csv(work / "cal.csv").to_numpy()
    axes = -table[:, :6] + np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    frame = pd.DataFrame(np.c_[axes, table[:, 6:] * 1e-3],
                         columns=[*(f"A{i}" for i in range(1, 7)), *"XYZ"])  # fmt: skip
    frame.to_csv(work / "other.txt", sep=";", decimal=",", index=False)
    (work / "map.toml").write_text(MAPPING)
    got = cli("calibrate", work / "cell.toml", work / "other.txt", "-o", work / "m.rtm",
              "--method", "elastic", "--mapping", work / "map.toml", "--json")  # fmt: skip
    assert got.code == 0, got.err
    first = pd.read_csv(_predicted(cli, work, work / "model.rtm"))
    np.testing.assert_allclose(first, pd.read_csv(_predicted(cli, work, work / "m.rtm")), atol=2e-6)
    seen = cli("inspect", work / "other.txt", "--mapping", work / "map.toml", "--json")
    assert seen.document["poses"] == 60
    queried = cli("predict", work / "m.rtm", work / "other.txt", "-o", work / "p.csv",
                  "--mapping", work / "map.toml", "--json")  # fmt: skip
    assert queried.document["n"] == 60


def test_excel(cli, work: Path) -> None:
    pytest.importorskip("openpyxl", reason="writes the workbook of this test")
    pd.read_csv(work / "test.csv").to_excel(work / "test.xlsx", index=False)
    got = cli("validate", work / "model.rtm", work / "test.xlsx", "--json")
    plain = cli("validate", work / "model.rtm", work / "test.csv", "--json")
    assert got.code == 0
    assert got.document["mean_mm"] == pytest.approx(plain.document["mean_mm"], abs=1e-6)
    assert cli("inspect", work / "test.xlsx", "--json").document["poses"] == 40


@pytest.mark.parametrize("command", [
    ("calibrate",), ("validate", "model.rtm"), ("predict", "model.rtm"), ("compensate",),
    ("inspect",), ("calibrate", "cell.toml", "cal.csv"), ("inspect", "cell.toml", "--jason"),
    ("recalibrate", "cell.toml"),
])  # fmt: skip
def test_a_wrong_command_line_is_2(cli, work: Path, command: tuple[str, ...]) -> None:
    got = cli(*(work / a if "." in a else a for a in command))
    assert got.code == 2
    assert got.out == ""
    assert "Usage: robotrue" in got.err


@pytest.mark.parametrize("command", [
    ("calibrate", "cell.toml", "gone.csv", "-o", "m.rtm"),
    ("validate", "gone.rtm", "test.csv"),
    ("predict", "model.rtm", "gone.csv", "-o", "p.csv"),
    ("compensate", "model.rtm", "gone.src", "-o", "o.src"),
    ("inspect", "gone.csv"),
])  # fmt: skip
def test_a_file_that_is_not_there_is_1(cli, work: Path, command: tuple[str, ...]) -> None:
    got = cli(*(work / a if "." in a else a for a in command), "--json")
    assert got.code == 1
    assert got.fault["kind"] == "FormatError"
    assert Path(got.fault["source"]).stem == "gone"
    assert f"{got.fault['source']}: cannot read: No such file" in got.err


def test_errors_are_json_on_stdout_only_when_asked(cli, work: Path) -> None:
    plain = cli("inspect", work / "gone.csv")
    assert plain.out == ""
    asked = cli("inspect", work / "gone.csv", "--json")
    assert set(asked.fault) == {"kind", "message", "source", "line", "hint"}
    assert asked.err == plain.err


def test_version_and_help(cli) -> None:
    import robotrue

    assert cli("--version").out == f"robotrue {robotrue.__version__}\n"
    got = cli("--help")
    assert got.code == 0
    for name in ("demo", "calibrate", "validate", "predict", "compensate", "inspect"):
        assert name in got.out


HEAVY = ("numpy", "scipy", "numba", "pandas", "matplotlib", "pydantic")


@pytest.mark.parametrize("call", ["import robotrue", "import robotrue.cli.main", "help"])
def test_answers_at_once_without_heavy_imports(call: str) -> None:
    run = "import sys; from robotrue.cli.main import run; sys.argv = ['robotrue', '--help']; run()"
    code = (
        "import atexit, json, sys\n"
        f"atexit.register(lambda: print('LOADED' + json.dumps([m for m in {HEAVY} "
        "if m in sys.modules])))\n" + (run if call == "help" else call)
    )
    done = subprocess.run(  # noqa: S603 - this interpreter
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**os.environ}
    )
    assert json.loads(done.stdout.rpartition("LOADED")[2]) == []


def test_json_through_a_pipe_is_all_of_stdout(work: Path) -> None:
    done = subprocess.run(  # noqa: S603 - this interpreter
        [sys.executable, "-c", "from robotrue.cli.main import run; run()", "validate",
         work / "model.rtm", work / "test.csv", "--json"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert json.loads(done.stdout)["n"] == 40
    assert "40 poses" in done.stderr


@pytest.mark.data
@pytest.mark.parametrize("tracker", ['[tracker]\nframe = "unknown"\n', ""])
def test_ur10_in_a_tracker_frame(cli, data_dir: Path, tmp_path: Path, tracker: str) -> None:
    """The layout says that its frame is the tracker's, whether the cell does or not."""
    lines = (data_dir / "ur10-landgraf/Series_B/measurements_joint_configurations.csv").read_text()
    head, *rows = lines.splitlines()
    for name, part in (("fit", rows[::5]), ("new", rows[1::25])):
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *part]) + "\n")
    (tmp_path / "ur10.toml").write_text(f'schema = 1\n[robot]\npreset = "UR10"\n{tracker}')
    got = cli("calibrate", tmp_path / "ur10.toml", tmp_path / "fit.csv", "-o", tmp_path / "m.rtm",
              "--method", "elastic", "--json")  # fmt: skip
    assert got.code == 0, got.err
    assert got.document["rows"] == 299
    held_out = cli("validate", tmp_path / "m.rtm", tmp_path / "new.csv", "--json").document
    assert held_out["mean_mm"] < 0.5 < held_out["before_aligned"]["mean_mm"]


@pytest.mark.data
def test_ur5_in_the_base_frame(cli, data_dir: Path, tmp_path: Path) -> None:
    grid, rand = (data_dir / f"ur5-jacobi/3D_UR5_uncalibrated_{n}_cleaned.csv"
                  for n in ("grid", "random"))  # fmt: skip
    lines = grid.read_text().splitlines()
    (tmp_path / "grid.csv").write_text("\n".join([lines[0], *lines[1::4]]) + "\n")
    (tmp_path / "ur5.toml").write_text('schema = 1\n[robot]\npreset = "UR5"\n')
    got = cli("calibrate", tmp_path / "ur5.toml", tmp_path / "grid.csv", "-o", tmp_path / "m.rtm",
              "--method", "elastic")  # fmt: skip
    assert got.code == 0, got.err
    held_out = cli("validate", tmp_path / "m.rtm", rand, "--json").document
    assert held_out["n"] == 20
    assert held_out["mean_mm"] < 0.15 < held_out["before"]["mean_mm"]
