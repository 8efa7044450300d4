"""The zero on the calibration tool; the memory of a refinement; references of another model."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign_csv import ProductionRecord, read_production, write_campaign
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot_file import FootSetup, read_foot
from robotrue.drilling.foot_model import estimate_tilt, fit_model, use_zero
from robotrue.drilling.foot_zero import read_zero, with_zero
from robotrue.drilling.head import Head
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.production import refine_model
from robotrue.drilling.production_references import check_references, choose_memory
from robotrue.errors import (
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
    RobotrueError,
)
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign

FOOT = """# the foot of cell 4
[foot]
radius_mm = 60
angles_deg = [90, 210, 330]
count_um = 1.0
zero_counts = [10000, 10000, 10000]   # of last year

[head]
pivot_to_tip_mm = [0.0, 0.0, -350.0]
"""
GAUGE = 0.005 * DEG
HEAD = Head(p_pivot_tip=np.zeros(3))


def call(*arguments: str | Path) -> dict[str, object]:
    done = CliRunner().invoke(app, ["drill", *map(str, arguments), "--json"])
    if isinstance(done.exception, RobotrueError):
        raise done.exception
    assert done.exit_code == 0, done.output
    found: dict[str, object] = json.loads(done.stdout)
    return found


@pytest.fixture
def zeros(tmp_path: Path) -> np.ndarray:
    """Counts of 8 seats, 4 readings each, with the foot file beside them."""
    random = np.random.default_rng(5)
    truth = np.array([10231.0, 9977.0, 10102.0])
    seat = np.repeat(random.normal(0.0, 6.0, (8, 3)), 4, axis=0)
    raw = truth + seat + random.normal(0.0, 2.0, (32, 3))
    lines = [f"{i // 4},{','.join(map(repr, map(float, row)))}" for i, row in enumerate(raw)]
    head = "seat,raw1_counts,raw2_counts,raw3_counts\n"
    (tmp_path / "zero.csv").write_text(head + "\n".join(lines) + "\n")
    (tmp_path / "foot.toml").write_text(FOOT)
    return raw


def test_the_zero_is_the_mean_of_seats_and_their_scatter(zeros: np.ndarray, tmp_path: Path) -> None:
    out = call("zero", tmp_path / "foot.toml", tmp_path / "zero.csv", "-o", tmp_path / "new.toml")
    means = zeros.reshape(8, 4, 3).mean(axis=1)
    np.testing.assert_allclose(out["zero_mm"], means.mean(axis=0) / 1000.0, rtol=0, atol=1e-9)
    sigma = means.std(axis=0, ddof=1) / np.sqrt(8)
    np.testing.assert_allclose(out["zero_sigma_um"], sigma, rtol=1e-9)
    # three sensors at 120 deg on 60 mm, written out: a from the y, b from the x of each sensor, of
    # each seat, and Student's t of 7 degrees of freedom
    x, y = 60.0 * np.array([0.0, -(0.75**0.5), 0.75**0.5]), 60.0 * np.array([1.0, -0.5, -0.5])
    tilts = means / 1000.0 @ np.stack([y, x], axis=-1) / (1.5 * 60.0**2)
    hand = np.degrees(tilts.std(axis=0, ddof=1) / np.sqrt(8) * np.sqrt(7 / 5))
    np.testing.assert_allclose(out["tilt_sigma_deg"], hand, rtol=1e-9)
    text = (tmp_path / "new.toml").read_text()
    assert "# the foot of cell 4" in text
    setup = read_foot(tmp_path / "new.toml")
    assert setup.zero is not None
    assert setup.zero_sigma is not None
    np.testing.assert_allclose(setup.zero / UM, means.mean(axis=0), rtol=0, atol=1e-5)
    np.testing.assert_allclose(setup.zero_sigma / UM, sigma, rtol=1e-5)
    assert setup.taken_zero is not None
    np.testing.assert_allclose(setup.taken_zero.tilt_sigma / DEG, hand, rtol=0, atol=1e-6)


def test_a_zero_taken_since_widens_the_stated_deviation_and_references_narrow_it(
    zeros: np.ndarray, tmp_path: Path
) -> None:
    foot, first, second = (tmp_path / name for name in ("foot.toml", "a.toml", "b.toml"))
    call("zero", foot, tmp_path / "zero.csv", "-o", first)
    lines = (tmp_path / "zero.csv").read_text().splitlines()
    (tmp_path / "again.csv").write_text("\n".join(lines[:21]) + "\n")  # five seats
    call("zero", foot, tmp_path / "again.csv", "-o", second)
    machine, model = drilling_machine(3), tmp_path / "m.robotrue"
    campaign = random_campaign(machine, 60, np.random.default_rng(3))
    write_campaign(tmp_path / "campaign.csv", campaign)
    call("fit", first, tmp_path / "campaign.csv", "-o", model, "--kind", "interactions")
    seen = campaign.clamps  # one of the campaign: readings whose plane stands where it should
    reading = ",".join(repr(float(v)) for v in seen.readings[0] / MM)
    clamp = ("--reading", reading, "--force", f"{seen.force[0]}", "--z", f"{seen.height[0] / MM}")
    plain, same, other = (
        call("adjust", model, *clamp, *beside)
        for beside in ((), ("--foot", first), ("--foot", second))
    )
    assert same["a_sigma_deg"] == plain["a_sigma_deg"]  # the campaign has learned its error
    zero_sigma = np.hypot(
        *(read_foot(path).taken_zero.tilt_sigma / DEG for path in (first, second))  # type: ignore[union-attr]
    )
    hand = np.hypot([plain["a_sigma_deg"], plain["b_sigma_deg"]], zero_sigma)
    np.testing.assert_allclose([other["a_sigma_deg"], other["b_sigma_deg"]], hand, rtol=1e-6)
    assert f"{zero_sigma[0]:.4f} deg in a" in " ".join(map(str, other["notes"]))  # type: ignore[call-overload]
    # sixty references measured with the new zero: the model now knows it, and says no more
    holes = random_campaign(machine, 60, np.random.default_rng(4), held_out=True)
    moved = use_zero(read_model(model), read_foot(second).taken_zero)
    moved_zero = holes.clamps.readings + np.array([8.0, 0.0, 0.0]) * UM
    shifted = replace(holes, clamps=replace(holes.clamps, readings=moved_zero))
    record = ProductionRecord(
        clamps=shifted.clamps,
        left=holes.tilt - estimate_tilt(moved, shifted.clamps).tilt,
        hole=tuple(map(str, range(60))),
        source="",
        provenance=holes.provenance,
    )
    after = refine_model(moved, record, truth="gauge", reference=GAUGE).model
    assert after.new_zero is None
    assert use_zero(after, read_foot(second).taken_zero).new_zero is None
    write_model(tmp_path / "after.robotrue", after)
    refined_model = call("adjust", tmp_path / "after.robotrue", *clamp, "--foot", second)
    assert refined_model["a_sigma_deg"] < other["a_sigma_deg"]  # type: ignore[operator]
    assert refined_model["notes"] == []


def test_a_foot_file_of_sensors_alone_is_read_as_independent_ones(tmp_path: Path) -> None:
    text = FOOT.replace("count_um = 1.0", "count_um = 1.0\nzero_sigma_um = [3.0, 3.0, 3.0]")
    (tmp_path / "foot.toml").write_text(text)
    zero = read_foot(tmp_path / "foot.toml").taken_zero
    assert zero is not None
    hand = np.degrees(3e-3 * np.sqrt(2.0 / 3.0) / 60.0)
    np.testing.assert_allclose(zero.tilt_sigma / DEG, [hand, hand], rtol=1e-9)
    (tmp_path / "foot.toml").write_text(text.replace("[3.0, 3.0, 3.0]", "[3.0, 3.0, 3.0, 3.0]"))
    with pytest.raises(RobotrueError, match="4 values of zero_sigma_um for 3 sensors"):
        read_foot(tmp_path / "foot.toml")


def test_adjust_takes_raw_readings_with_the_new_zero(zeros: np.ndarray, tmp_path: Path) -> None:
    foot, new = tmp_path / "foot.toml", tmp_path / "new.toml"
    call("zero", foot, tmp_path / "zero.csv", "-o", new)
    machine = drilling_machine(3)
    campaign = random_campaign(machine, 20, np.random.default_rng(3))
    model, _ = fit_model(machine.foot, HEAD, campaign, kind="patent")
    write_model(tmp_path / "m.robotrue", model)
    zero = read_foot(new).zero
    assert zero is not None
    less = campaign.clamps.readings[0]
    force = ("--force", f"{campaign.clamps.force[0]}", "--z", "0")
    raw = ",".join(repr(float(v)) for v in (less + zero) / UM)
    first = call("adjust", tmp_path / "m.robotrue", "--raw", raw, "--foot", new, *force)
    reading = ",".join(repr(float(v)) for v in less * 1000.0)
    second = call("adjust", tmp_path / "m.robotrue", "--reading", reading, *force)
    assert first["a_deg"] == pytest.approx(second["a_deg"], abs=1e-9)
    with pytest.raises(RobotrueError, match="give the readings once"):
        call("adjust", tmp_path / "m.robotrue", *force)
    with pytest.raises(RobotrueError, match="the foot has no zero"):
        call("adjust", tmp_path / "m.robotrue", "--raw", raw, *force)


def test_a_zero_of_few_seats_or_with_a_row_far_off_is_refused(
    zeros: np.ndarray, tmp_path: Path
) -> None:
    setup = read_foot(tmp_path / "foot.toml")
    lines = (tmp_path / "zero.csv").read_text().splitlines()
    few = tmp_path / "few.csv"
    few.write_text("\n".join(lines[:13]) + "\n")
    with pytest.raises(ObservabilityError, match="3 seats of the tool, at least 5"):
        read_zero(few, setup)
    lines[7] = "1,10231,9477,10102"
    few.write_text("\n".join(lines) + "\n")
    with pytest.raises(ImplausibleDataError, match=r"sensor 2 reads 9\.4770 mm") as caught:
        read_zero(few, setup)
    assert caught.value.line == 8
    # a seat that lies askew, and five seats of which four lie close by chance
    lines[7] = (tmp_path / "zero.csv").read_text().splitlines()[7]
    askew = [f"1,{10231 + k},10077,{10002 - k}" if x.startswith("1,") else x
             for k, x in enumerate(lines)]  # fmt: skip
    few.write_text("\n".join(askew) + "\n")
    with pytest.raises(ImplausibleDataError, match="off the mean of the other seats"):
        read_zero(few, setup)
    close = "".join(f"{10000 + v},9977,10102\n" for v in (0, 1, -2, 2, 25))
    few.write_text("raw1_counts,raw2_counts,raw3_counts\n" + close)
    assert read_zero(few, setup).rows == 5
    found = read_zero(tmp_path / "zero.csv", setup)
    in_mm = with_zero(FOOT, replace(found, counts=False), setup)
    assert "zero_mm" in in_mm
    assert "zero_counts" not in in_mm


def refined(seed: int, zero_um: float, count: int) -> tuple[float, ...]:
    """Mean tilt left (deg) of a test before and after references of a shifted zero (simulated)."""
    machine, random = drilling_machine(seed), np.random.default_rng(3000 + seed)
    model, _ = fit_model(machine.foot, HEAD, random_campaign(machine, 60, random),
                         kind="interactions")  # fmt: skip
    zero = np.array([zero_um, 0.0, 0.0]) * UM
    holes, test = (random_campaign(machine, 200, random, held_out=True) for _ in range(2))
    holes, test = (
        replace(c, clamps=replace(c.clamps, readings=c.clamps.readings + zero))
        for c in (holes.take(slice(0, count)), test)
    )
    tilt = estimate_tilt(model, holes.clamps).tilt
    record = ProductionRecord(
        clamps=holes.clamps,
        left=holes.tilt - tilt + random.normal(0.0, GAUGE, (count, 2)),
        hole=tuple(map(str, range(count))),
        source="holes.csv",
        provenance=holes.provenance,
    )
    after = refine_model(model, record, truth="gauge", reference=GAUGE).model
    return tuple(evaluate_test(each, test).ours.mean / DEG for each in (model, after))


def test_sixty_references_take_out_a_zero_and_never_make_a_sound_model_worse() -> None:
    shifted = np.array([refined(seed, 10.0, 60) for seed in range(1, 6)])
    assert (shifted[:, 0] > 0.005).all()
    assert shifted[:, 1].mean() < 0.004
    sound = np.array([refined(seed, 0.0, 15) for seed in range(1, 6)])
    assert (sound[:, 1] <= 1.02 * sound[:, 0]).all()


def test_a_drifting_zero_is_remembered_shortly() -> None:
    machine, random = drilling_machine(2), np.random.default_rng(2)
    model, _ = fit_model(machine.foot, HEAD, random_campaign(machine, 30, random),
                         kind="interactions")  # fmt: skip
    causes = np.column_stack([random.uniform(-3.0, 3.0, (120, 2)), random.uniform(0.0, 1.0, 120)])
    drift = 0.05 * DEG * np.sin(np.linspace(0.0, 9.0, 120))[:, None] * np.ones(2)
    left = drift + random.normal(0.0, GAUGE, (120, 2))
    choice = choose_memory(model.refinement, causes, left, reference=GAUGE)
    assert choice.start is not None
    assert choice.start.forgetting == 0.95
    assert len(choice.trials) == 4
    few = choose_memory(model.refinement, causes[:5], left[:5], reference=GAUGE)
    assert few.trials == ()


def test_references_of_another_model_or_unit_are_refused(tmp_path: Path) -> None:
    machine = drilling_machine(2)
    setup = FootSetup(foot=machine.foot, head=HEAD, count=None, zero=None, source="")
    head = "hole,version,left_a_deg,left_b_deg,d1_mm,d2_mm,d3_mm,force_N,z_mm\n"
    rows = "".join(f"H{k},{4 if k < 2 else 3},0.01,0,0.1,0,0.02,500,0\n" for k in range(4))
    (tmp_path / "holes.csv").write_text(head + rows)
    with pytest.raises(ModelMismatchError, match="version 3 of the model moved hole H2") as caught:
        read_production(tmp_path / "holes.csv", setup, version=4)
    assert caught.value.line == 4
    assert "2 of 4 references are older" in caught.value.message
    assert len(read_production(tmp_path / "holes.csv", setup).hole) == 4
    sound, expected = np.full((9, 2), 0.004 * DEG), np.full((9, 2), 0.005 * DEG)
    assert check_references(sound, expected, "holes.csv") == ""
    assert "0.0800 deg rms" in check_references(20.0 * sound, expected, "holes.csv")
    with pytest.raises(ImplausibleDataError, match="arc minutes"):
        check_references(70.0 * sound, expected, "holes.csv")
