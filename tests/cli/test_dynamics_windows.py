"""``robotrue dynamics windows`` on a pass made by hand, and what it refuses."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.dynamics.formats.dynamics_csv import read_windows
from robotrue.errors import (
    ConfigurationError,
    FormatError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)

sys.path.insert(0, str(Path(__file__).parents[1] / "dynamics"))
import pass_cases as made


def call(*arguments):
    return CliRunner().invoke(app, ["dynamics", "windows", *map(str, arguments)])


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pass")
    return folder, made.write_pass(folder)


def table(path):
    from robotrue.core.units import DEG, UM

    w = read_windows(path)
    return np.column_stack(
        [w.joints / DEG, w.force, w.force_peak, w.force_mean, w.predicted / UM, w.measured / UM]
    ), w


def refused(kind, text, *arguments):
    result = call(*arguments)
    assert isinstance(result.exception, kind), (result.output, result.exception)
    assert text in str(result.exception), str(result.exception)


@pytest.mark.parametrize(
    ("suffix", "carried"),
    [
        (".csv", "base"), (".tdms", "spindle"), (".mat", "spindle"), (".mat", "tool"),
        (".uff", "spindle"),
    ],
)  # fmt: skip
def test_windows_are_those_made_by_hand(tmp_path, suffix, carried):
    arguments = made.write_pass(tmp_path, suffix, carried)
    result = call(*arguments, "--json")
    assert result.exit_code == 0, (result.output, result.exception)
    found, windows = table(tmp_path / "windows.csv")
    expected = made.windows_by_hand()
    assert found.shape == expected.shape == (12, 13)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    document = json.loads(result.stdout)
    np.testing.assert_allclose(document["stages_s"]["entry"], [made.ENTRY, made.STEADY], atol=1e-6)
    np.testing.assert_allclose(document["stages_s"]["exit"], [made.LEAVING, made.END], atol=1e-6)
    np.testing.assert_allclose(windows.span[0], [1.1, 2.1], atol=1e-6)
    assert document["dry_run"]
    assert windows.zero_taken.all()


def test_a_second_pass_stands_behind_the_first(lab):
    folder, arguments = lab
    assert call(*arguments).exit_code == 0
    second = folder / "both.csv"
    again = [*arguments, "--onto", folder / "windows.csv", "--name", "2"]
    again[again.index(folder / "windows.csv")] = second
    assert call(*again).exit_code == 0
    assert read_windows(second).pass_names == ("1", "2")
    assert call(*again, "--keep-zero").exit_code == 0
    np.testing.assert_array_equal(read_windows(second).zero_taken, np.arange(24) < 12)
    again[-1] = "1"
    refused(ConfigurationError, "a pass '1' is in", *again)


def changed(arguments, option, value):
    out = list(arguments)
    if option in out:
        out[out.index(option) + 1] = value
    else:
        out += [option, value]
    return out


def test_too_few_windows(lab):
    _, arguments = lab
    refused(ObservabilityError, "in 12.000 s of steady cutting: not one fits", *arguments,
            "--window-s", 20)  # fmt: skip
    few = call(*arguments, "--window-s", 2)
    assert few.exit_code == 0
    assert "6 windows: `dynamics fit` needs 12 or more" in few.output


def test_windows_that_overlap(lab):
    folder, arguments = lab
    edges = folder / "edges.csv"
    edges.write_text("start_s,end_s\n2,3\n3,4\n3.9,5\n")
    result = call(*arguments, "--edges", edges)
    assert isinstance(result.exception, FormatError)
    assert "from 3.900 s, before the end of another at 4.000 s" in str(result.exception)
    assert result.exception.line == 4
    edges.write_text("start_s,end_s\n2,3\n3,4\n4,5\n")
    assert call(*arguments, "--edges", edges).exit_code == 0
    text = (folder / "windows.csv").read_text().replace(",4.0,5.0,", ",3.5,4.5,")
    (folder / "shared.csv").write_text(text)
    with pytest.raises(FormatError, match="windows that overlap"):
        read_windows(folder / "shared.csv")


def test_units_of_force_and_joints(lab, tmp_path):
    _, arguments = lab
    time, clock = made.force_time(), made.joint_time()
    small = np.column_stack([time, made.reading() / 1e3])
    made.write_table(tmp_path / "kn.csv", ("t_s", "fx_N", "fy_N", "fz_N"), small)
    refused(ImplausibleDataError, "these look like kN", tmp_path / "kn.csv", *arguments[1:])
    names = tuple(f"j{k}_deg" for k in range(1, 7))
    rad = np.column_stack([clock, made.joints_at(clock)])
    made.write_table(tmp_path / "rad.csv", ("t_s", *names), rad)
    refused(ImplausibleDataError, "these look like radians",
            *changed(arguments, "--joints", tmp_path / "rad.csv"))  # fmt: skip
    bare = np.column_stack([time, made.reading()])
    made.write_table(tmp_path / "bare.csv", ("t_s", "fx", "fy", "fz"), bare)
    refused(FormatError, "in another unit or in none", tmp_path / "bare.csv", *arguments[1:])


def test_dry_run_of_another_path(lab, tmp_path):
    _, arguments = lab
    clock = np.arange(0.0, 20.0, 0.01)
    other = made.pass_joints(made.START - 0.01 + made.FEED * clock, (0.002, 0.0))
    names = tuple(f"j{k}_deg" for k in range(1, 7))
    table = np.column_stack([clock + 40.0, np.degrees(other)])
    made.write_table(tmp_path / "other.csv", ("t_s", *names), table)
    refused(ModelMismatchError, "2.00 mm from the path of the dry run, expected 0.5 at most",
            *changed(arguments, "--dry-joints", tmp_path / "other.csv"))  # fmt: skip
    k = arguments.index("--dry-joints")
    rest = [*arguments[:k], *arguments[k + 2 :]]
    refused(ConfigurationError, "a laser record and its joints", *rest)


def test_clocks_that_share_no_time(lab):
    _, arguments = lab
    for name in ("joints", "laser"):
        refused(ImplausibleDataError, f"the {name} run from ", *arguments,
                f"--{name}-shift-s", 100)  # fmt: skip


def test_shifts_align_clocks(lab, tmp_path):
    folder, arguments = lab
    shown = made.laser_time()
    late = made.edge_of(made.START + made.FEED * shown) + made.cut_error()
    rows = np.column_stack([shown + 7.0, late * 1e6])
    made.write_table(tmp_path / "late.csv", ("t_s", "d_um"), rows)
    moved = changed(arguments, "--laser", tmp_path / "late.csv")
    assert call(*moved, "--laser-shift-s", -7).exit_code == 0
    found, _ = table(folder / "windows.csv")
    np.testing.assert_allclose(found[:, -1], made.windows_by_hand()[:, -1], rtol=1e-9)


def test_sensor_frames_that_no_sensor_has(lab):
    folder, arguments = lab
    refused(
        ModelMismatchError, "a sensor frame that is mirrored", *arguments, "--sensor-axes=y,x,z"
    )
    refused(ConfigurationError, "expected where the sensor's x, y and z point", *arguments,
            "--sensor-axes=x,x,z")  # fmt: skip
    refused(ConfigurationError, "a rotating dynamometer without the angle of the spindle",
            *changed(arguments, "--carried-by", "spindle"))  # fmt: skip
    slow = folder / "slow.csv"
    time = np.arange(-0.1, made.SECONDS + 0.1, 0.015)
    angle = np.degrees(made.spindle_angle(time))
    made.write_table(slow, ("t_s", "angle_deg"), np.column_stack([time, angle]))
    refused(ConfigurationError, "record the angle at the rate of the force",
            *changed(arguments, "--carried-by", "spindle"), "--spindle-angle", slow)  # fmt: skip


def test_records_that_hold_no_single_pass(lab, tmp_path):
    _, arguments = lab
    rows = np.column_stack([made.force_time(), made.reading()])
    names = ("t_s", "fx_N", "fy_N", "fz_N")
    made.write_table(tmp_path / "late.csv", names, rows[2400:])
    refused(ImplausibleDataError, "the record begins in the cut", tmp_path / "late.csv",
            *arguments[1:])  # fmt: skip
    gap = rows.copy()
    gap[10000:12000, 1:] = gap[:1, 1:]
    gap[10000:12000, 3] += np.linspace(0.0, 1e-3, 2000)
    made.write_table(tmp_path / "gap.csv", names, gap)
    refused(ImplausibleDataError, "the tool leaves the cut at 5.000 s", tmp_path / "gap.csv",
            *arguments[1:])  # fmt: skip


def test_predict_adds_what_was_learned(lab, tmp_path):
    from window_cases import planted, stated_arm

    from robotrue.core.archive import write_archive
    from robotrue.dynamics.paper_regression import fit_paper

    folder, _ = lab
    model = fit_paper(planted(passes=(0, 1), each=24), stated_arm())
    write_archive(tmp_path / "jin.robotrue", model.to_archive())
    pushed = made.force_on_tool() + made.DRIFT * made.force_time()[:, None]
    rows = np.column_stack([made.force_time(), pushed])
    made.write_table(tmp_path / "base.csv", ("t_s", "fx_N", "fy_N", "fz_N"), rows)
    arguments = [
        "dynamics", "predict", "--frf", folder / "frf.csv", "--force", tmp_path / "base.csv",
        "--between", "lines", "-o", tmp_path / "e.csv", "--deviation", tmp_path / "jin.robotrue",
        "--spindle-rpm", 3000, "--joints", folder / "joints.csv", "--json",
    ]  # fmt: skip
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 0, (result.output, result.exception)
    learned = json.loads(result.stdout)["learned"]
    assert len(learned["start_s"]) == 14
    found = np.genfromtxt(tmp_path / "e.csv", delimiter=",", names=True)
    inside = slice(6 * 2000, 7 * 2000)
    np.testing.assert_allclose(
        found["e_um"][inside], -found["ey_um"][inside] + learned["deviation_um"][6], rtol=1e-6
    )
    assert np.isnan(found["e_um"][-1])
    short = [str(each) for each in arguments if each not in ("--spindle-rpm", 3000)]
    failed = CliRunner().invoke(app, short)
    assert "needs the joints of the record and the speed" in str(failed.exception)


def test_noise_of_the_joints_is_no_way(lab, tmp_path):
    _, arguments = lab
    clock = made.joint_time()
    shaken = np.degrees(made.joints_at(clock))
    shaken += 3e-4 * np.random.default_rng(1).standard_normal(shaken.shape)
    names = tuple(f"j{k}_deg" for k in range(1, 7))
    made.write_table(tmp_path / "j.csv", ("t_s", *names), np.column_stack([clock, shaken]))
    result = call(*changed(arguments, "--joints", tmp_path / "j.csv"), "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["path_mm"]["steady"] == pytest.approx(60.0, abs=0.5)
