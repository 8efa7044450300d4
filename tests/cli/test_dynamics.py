"""``robotrue dynamics predict|frf|force``: the contract others script against, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

N = 2000
RATE = 2000.0
STIFFNESS, HERTZ, DAMPING = 2e6, 30.0, 0.03
CUT = """
kind = "flat"
mode = "slot"
diameter_mm = 16
teeth = 2
helix_deg = 30
depth_mm = 1
width_mm = 16
feed_per_tooth_mm = 0.05
spindle_rpm = 3600
tangential_N_per_mm2 = 800
radial_N_per_mm2 = 170
axial_N_per_mm2 = 220
"""


def receptance(f: np.ndarray) -> np.ndarray:
    ratio = f / HERTZ
    return 1.0 / (STIFFNESS * (1.0 - ratio**2 + 2j * DAMPING * ratio))


def write_frf(path: Path, *, power: int = 0, unit: str = "m_per_N", step: float = 0.25) -> Path:
    f = np.arange(4.0, 200.0, step)
    g = receptance(f) * (2j * np.pi * f) ** power
    table = {"f_Hz": f, f"Gyy_re_{unit}": g.real, f"Gyy_im_{unit}": g.imag}
    pd.DataFrame(table).to_csv(path, index=False)
    return path


def write_force(path: Path, force: np.ndarray | None = None) -> Path:
    t = np.arange(N) / RATE
    if force is None:
        force = np.where(t < 0.5, 50.0 * np.sin(2 * np.pi * 2.0 * t) ** 2, 0.0)
    zero = np.zeros(N)
    columns = {"t_s": t, "fx_N": zero, "fy_N": force, "fz_N": zero}
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    write_frf(tmp_path / "FRF.csv")
    write_force(tmp_path / "FORCE.csv")
    (tmp_path / "cut.toml").write_text(CUT, encoding="utf-8")
    return tmp_path


def predict(cli, lab: Path, *more: object):
    return cli("dynamics", "predict", "--frf", lab / "FRF.csv", "--force", lab / "FORCE.csv",
               "-o", lab / "OUT.csv", *more)  # fmt: skip


def test_predict_contract(cli, lab: Path) -> None:
    got = predict(cli, lab, "--static-um-per-n", "yy=0.5", "--json")
    assert got.code == 0
    out = pd.read_csv(lab / "OUT.csv")
    assert list(out.columns) == ["t_s", "ex_um", "ey_um", "ez_um"]
    assert len(out) == N
    assert out["ex_um"].isna().all()
    # 4 Hz against a mode at 30 Hz: nearly static, 0.5 um/N.
    quasi_static = 0.5 * pd.read_csv(lab / "FORCE.csv")["fy_N"]
    assert (out["ey_um"] - quasi_static).abs().max() < 1.0
    d = got.document
    assert d["valid"] is True
    assert d["invalid"] == []
    assert d["samples"] == N
    assert d["rate_Hz"] == pytest.approx(RATE)
    assert d["pairs"] == ["yy"]
    assert d["valid_Hz"] == [4.0, 199.75]
    assert d["static_known"] is True
    assert d["between_lines"] == "modes"
    assert d["modes_Hz"] == pytest.approx([HERTZ], rel=1e-6)
    assert d["static_um"] == [None, pytest.approx(0.5 * 12.5, rel=1e-3), None]
    assert d["peak_um"][1] == pytest.approx(25.0, rel=0.05)
    for key in ("rms_um", "dynamic_rms_um", "circular_max_um", "padding_s", "force_above_band",
                "left_out_error", "rebuild_error", "mean_force_N", "output_csv"):  # fmt: skip
        assert key in d
    assert any("fx is zero throughout" in note for note in d["notes"])


def test_a_dead_channel_along_which_the_tool_yields(cli, lab: Path) -> None:
    frf = pd.read_csv(lab / "FRF.csv")
    frf["Gzz_re_m_per_N"], frf["Gzz_im_m_per_N"] = frf["Gyy_re_m_per_N"], frf["Gyy_im_m_per_N"]
    frf.to_csv(lab / "FRF.csv", index=False)
    got = predict(cli, lab, "--json")
    assert got.code == 0
    assert got.document["valid"] is False
    assert "fz is exactly zero" in got.document["invalid"][0]
    assert "NOT VALID" in predict(cli, lab).out


def test_predict_in_words(cli, lab: Path) -> None:
    got = predict(cli, lab)
    assert got.code == 0
    assert "static part um" in got.out
    assert "(a guess)" in got.out
    assert "no data below 4 Hz" in got.err


def test_between_lines_as_told(cli, lab: Path) -> None:
    assert predict(cli, lab, "--between", "lines", "--json").document["modes_Hz"] is None
    assert predict(cli, lab, "--between", "modes", "--json").document["between_lines"] == "modes"


def test_predict_draws(cli, lab: Path) -> None:
    assert predict(cli, lab, "--report", lab / "figure.png").code == 0
    assert (lab / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("power", [1, 2])
def test_another_form_under_the_name_of_a_receptance(cli, lab: Path, power: int) -> None:
    write_frf(lab / "FRF.csv", power=power)
    got = predict(cli, lab, "--json")
    assert got.code == 1
    assert got.fault["kind"] == "ImplausibleDataError"
    assert not (lab / "OUT.csv").exists()


def test_an_accelerance_by_its_name_is_the_same_response(cli, lab: Path) -> None:
    assert predict(cli, lab).code == 0
    want = pd.read_csv(lab / "OUT.csv")["ey_um"]
    write_frf(lab / "FRF.csv", power=2, unit="m_per_s2_per_N")
    assert predict(cli, lab).code == 0
    np.testing.assert_allclose(pd.read_csv(lab / "OUT.csv")["ey_um"], want, atol=0.01)


@pytest.mark.parametrize(
    ("spoil", "kind", "said"),
    [
        (lambda t: t.rename(columns={"fy_N": "fy"}), "FormatError", "another unit or in none"),
        (lambda t: t.assign(fy_N=t["fy_N"].where(t.index != 7)), "FormatError", "fy_N is blank"),
        (lambda t: t.drop(index=range(40, 50)), "ImplausibleDataError", "missing"),
        (lambda t: t.assign(fy_N=(t["fy_N"] * 655).round()), "ImplausibleDataError", "counts"),
        (lambda t: t.assign(fy_N=3.0), "ImplausibleDataError", "not connected"),
    ],
)
def test_bad_force(cli, lab: Path, spoil, kind: str, said: str) -> None:
    spoil(pd.read_csv(lab / "FORCE.csv")).to_csv(lab / "FORCE.csv", index=False)
    got = predict(cli, lab, "--json")
    assert got.code == 1
    assert got.fault["kind"] == kind
    assert said in got.fault["message"]
    assert got.fault["line"] is not None
    assert got.fault["hint"]
    assert not (lab / "OUT.csv").exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--between", "splines"), "expected one of auto, lines, modes"),
        (("--static-um-per-n", "yy"), "expected pair=um/N"),
        (("--static-um-per-n", "xx=1"), "no pair xx"),
        (("--static-um-per-n", "yy=-1"), "yields the way it is pushed"),
        (("--padding-s", "-1"), "padding of -1 s"),
        (("--report", "figure.bmp"), "expected one of .png"),
    ],
)
def test_options_refused(cli, lab: Path, more, said: str, monkeypatch) -> None:
    monkeypatch.chdir(lab)
    got = predict(cli, lab, *more)
    assert got.code == 1
    assert said in got.err
    assert not (lab / "OUT.csv").exists()


def test_output_over_an_input(cli, lab: Path) -> None:
    got = cli("dynamics", "predict", "--frf", lab / "FRF.csv", "--force", lab / "FORCE.csv", "-o",
              lab / "FORCE.csv")  # fmt: skip
    assert got.code == 1
    assert "which is an input" in got.err


def test_frf_checks_and_converts(cli, lab: Path) -> None:
    got = cli("dynamics", "frf", lab / "FRF.csv", "-o", lab / "again.csv", "--modes",
              lab / "modes.robotrue", "--static-um-per-n", "yy=0.5", "--report",
              lab / "frf.svg", "--json")  # fmt: skip
    assert got.code == 0
    d = got.document
    assert d["modes"]["frequency_Hz"] == pytest.approx([HERTZ], rel=1e-6)
    assert d["modes"]["damping"] == pytest.approx([DAMPING], rel=1e-4)
    assert d["static_um_per_N"] == [[pytest.approx(0.5)]]
    again = pd.read_csv(lab / "again.csv")
    assert list(again.columns) == ["f_Hz", "Gyy_re_m_per_N", "Gyy_im_m_per_N"]
    assert again["Gyy_re_m_per_N"][0] == pytest.approx(0.5e-6)
    assert (lab / "modes.robotrue").exists()
    assert b"<svg" in (lab / "frf.svg").read_bytes()[:400]


def test_frf_of_hits(cli, lab: Path) -> None:
    n, every = 16384, 4096
    t = np.arange(n) / 1024.0
    force = np.zeros(n)
    for k in range(4):
        force[every * k + 200 : every * k + 206] = 900.0 * np.sin(np.pi * np.arange(6) / 5) ** 2
    f = np.fft.rfftfreq(2 * n, 1.0 / 1024.0)
    accelerance = -((2 * np.pi * f) ** 2) * receptance(f)
    moved = np.fft.irfft(accelerance * np.fft.rfft(force, 2 * n), 2 * n)[:n]
    pd.DataFrame({"t_s": t, "fy_N": force, "ay_m_per_s2": moved}).to_csv(
        lab / "hit.csv", index=False
    )
    got = cli("dynamics", "frf", lab / "hit.csv", "-o", lab / "H.csv", "--json")
    assert got.code == 0
    (hit,) = got.document["hits"]
    assert (hit["used"], hit["left_out"], hit["axis"]) == (4, [], "y")
    assert got.document["measured_as"] == "accelerance"
    assert np.abs(np.array(got.document["modes"]["frequency_Hz"]) / HERTZ - 1.0).min() < 1e-3
    words = cli("dynamics", "frf", lab / "hit.csv")
    assert "4 hits used, 0 not" in words.out
    assert "damping %" in words.out


def test_frf_refused(cli, lab: Path) -> None:
    got = cli("dynamics", "frf", lab / "FRF.csv", "-o", lab / "x.mat")
    assert got.code == 1
    assert "expected .csv or .uff" in got.err
    got = cli("dynamics", "frf", lab / "FRF.csv", lab / "FRF.csv")
    assert got.code == 1
    assert "0 hammer columns" in got.err


def test_force_of_a_cut(cli, lab: Path) -> None:
    got = cli("dynamics", "force", lab / "cut.toml", "-o", lab / "out.csv", "--json")
    assert got.code == 0
    d = got.document
    assert d["simulated"] is True
    assert d["tooth_passing_Hz"] == 120.0
    # Slot: N a c / 4 K, Altintas 2012, eq. 2.22.
    assert d["mean_N"] == pytest.approx([-4.25, 20.0, 2 * 0.05 * 220 / np.pi], rel=1e-6)
    assert list(pd.read_csv(lab / "out.csv", comment="#").columns) == [
        "t_s",
        "fx_N",
        "fy_N",
        "fz_N",
    ]
    beside = cli("dynamics", "force", lab / "cut.toml", "--measured", lab / "out.csv")
    assert beside.code == 0
    assert "measured" in beside.out


def write_slots(path: Path, turn) -> Path:
    rows = []
    for c in (0.03, 0.05, 0.08, 0.12):
        edge = np.array([-30.0, 28.0, 1.4 * np.pi / 2]) * 2.0 / np.pi
        rows.append([c, *turn(np.array([-85.0 * c, 400.0 * c, 440.0 * c / np.pi]) + edge)])
    columns = ["feed_per_tooth_mm", "fx_mean_N", "fy_mean_N", "fz_mean_N"]
    pd.DataFrame(rows, columns=columns).to_csv(path, index=False)
    return path


def test_coefficients_from_slots(cli, lab: Path) -> None:
    slots = write_slots(lab / "slots.csv", lambda f: f)
    got = cli("dynamics", "force", lab / "cut.toml", "--slots", slots, "-o", lab / "new.toml",
              "--json")  # fmt: skip
    assert got.code == 0
    want = {"tangential_N_per_mm2": 800.0, "radial_N_per_mm2": 170.0, "axial_N_per_mm2": 220.0,
            "tangential_edge_N_per_mm": 28.0, "radial_edge_N_per_mm": 30.0,
            "axial_edge_N_per_mm": 1.4}  # fmt: skip
    assert got.document["coefficients"] == pytest.approx(want, rel=1e-6)
    assert set(got.document["deviations"]) == set(want)
    assert cli("dynamics", "force", lab / "new.toml").code == 0


def test_swapped_dynamometer(cli, lab: Path) -> None:
    slots = write_slots(lab / "slots.csv", lambda f: f[[1, 0, 2]])
    got = cli("dynamics", "force", lab / "cut.toml", "--slots", slots, "--json")
    assert got.code == 1
    assert "x and y swapped" in got.fault["message"]


def test_force_along_a_path(cli, lab: Path) -> None:
    (lab / "along.csv").write_text("path_mm,depth_mm,width_mm\n0,0,0\n10,1,16\n20,2,16\n")
    got = cli("dynamics", "force", lab / "cut.toml", "--along", lab / "along.csv", "-o",
              lab / "table.csv", "--json")  # fmt: skip
    assert got.code == 0
    table = pd.read_csv(lab / "table.csv", comment="#")
    assert list(table.columns) == ["path_mm", "fx_N", "fy_N", "fz_N"]
    assert table["fy_N"].tolist() == pytest.approx([0.0, 20.0, 40.0], rel=1e-6)


@pytest.mark.parametrize(
    ("text", "more", "said"),
    [
        (CUT.replace("teeth = 2", "teeth = 2.5"), (), "expected a whole number"),
        (CUT.replace("helix_deg", "helix"), (), "unknown key helix"),
        (CUT.replace("depth_mm = 1", ""), (), "no depth_mm"),
        (CUT.replace("depth_mm = 1", "depth_mm = 0"), (), "depth of the cut is 0"),
        (CUT + "x = ", (), "not TOML"),
        (CUT, ("--slots", "a.csv", "--along", "b.csv"), "one at a time"),
        (CUT, ("--slots", "FORCE.csv"), "no column feed_per_tooth_mm"),
        (CUT, ("--rate-hz", "200"), "200 samples/s for teeth that pass at 120 Hz"),
    ],
)
def test_force_refused(cli, lab: Path, text: str, more, said: str, monkeypatch) -> None:
    monkeypatch.chdir(lab)
    (lab / "cut.toml").write_text(text, encoding="utf-8")
    got = cli("dynamics", "force", "cut.toml", *more)
    assert got.code == 1
    assert said in got.err


def write_readings(path: Path, *, turns: float = 90.0) -> Path:
    from robotrue.core.rotations import matrix_from_abc

    rx = turns * np.array([0, 1, -1, 0, 0, 2])
    ry = turns * np.array([0, 0, 0, 1, -1, 0])
    R = matrix_from_abc(np.deg2rad(np.column_stack([0 * rx, ry, rx])))
    pull = R.transpose(0, 2, 1) @ [0.0, 0.0, -18.5 * 9.80665]
    moment = np.cross([0.012, -0.006, 0.145], pull)
    table = np.column_stack([rx, ry, 0 * rx, pull + np.array([5.0, -3.0, 8.0]), moment])
    names = ["rx_deg", "ry_deg", "rz_deg", "fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"]
    pd.DataFrame(table, columns=names).to_csv(path, index=False)
    return path


def test_sensor(cli, tmp_path: Path) -> None:
    poses = write_readings(tmp_path / "poses.csv")
    got = cli("dynamics", "sensor", poses, "-o", tmp_path / "held.robotrue", "--json")
    assert got.code == 0
    d = got.document
    assert d["mass_kg"] == pytest.approx(18.5, rel=1e-9)
    assert d["centre_mm"] == pytest.approx([12.0, -6.0, 145.0], rel=1e-6)
    assert d["force_offset_N"] == pytest.approx([5.0, -3.0, 8.0], rel=1e-9)
    assert d["condition"] == pytest.approx(2.236, abs=0.01)
    assert (tmp_path / "held.robotrue").exists()
    assert "18.500 +- " in cli("dynamics", "sensor", poses).out


def test_sensor_refused(cli, tmp_path: Path) -> None:
    poses = write_readings(tmp_path / "poses.csv", turns=15.0)
    got = cli("dynamics", "sensor", poses, "--json")
    assert got.fault["kind"] == "ObservabilityError"
    assert "at most 5" in got.fault["message"]
    pd.read_csv(poses).drop(columns="mz_Nm").to_csv(poses, index=False)
    got = cli("dynamics", "sensor", poses, "--json")
    assert "no column mz_Nm" in got.fault["message"]
    assert got.fault["line"] == 1
