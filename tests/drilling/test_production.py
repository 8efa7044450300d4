"""Moves, refusals, files, and a model's life in production."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import adjustment
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.campaign_checks import check_campaign
from robotrue.drilling.campaign_csv import read_campaign, write_campaign
from robotrue.drilling.foot import Foot
from robotrue.drilling.foot_file import read_foot
from robotrue.drilling.foot_model import NormalModel, estimate_tilt, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.production import freeze_model, record_of, update_model
from robotrue.drilling.refinement import Remaining, Watch, update_watch
from robotrue.errors import (
    ArchiveError,
    ConfigurationError,
    FormatError,
    ImplausibleDataError,
    ObservabilityError,
)
from robotrue.simulation.drilling_machine import DrillingMachine, drilling_machine, random_campaign

HEAD = Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
FOOT = "[foot]\nradius_mm = 60.0\nangles_deg = [90.0, 210.0, 330.0]\n"


@pytest.fixture(scope="module")
def job() -> tuple[DrillingMachine, NormalModel, Campaign, Campaign]:
    """A machine, its model, the campaign and a test."""
    machine = drilling_machine(1, nonlinear=True, friction=True)
    random = np.random.default_rng(1)
    campaign = random_campaign(machine, 45, random)
    test = random_campaign(machine, 60, random, held_out=True)
    model, _ = fit_model(machine.foot, HEAD, campaign, kind="physics", digest="campaign")
    return machine, model, campaign, test


Job = tuple[DrillingMachine, NormalModel, Campaign, Campaign]


def test_a_model_comes_back_from_its_file(job: Job, tmp_path: Path) -> None:
    _, model, campaign, test = job
    for kind in ("physics", "gp", "cubic"):
        model, _ = fit_model(model.foot, HEAD, campaign, kind=kind)
        write_model(tmp_path / "m.robotrue", model)
        back = read_model(tmp_path / "m.robotrue")
        ours, theirs = estimate_tilt(model, test.clamps), estimate_tilt(back, test.clamps)
        np.testing.assert_array_equal(ours.tilt, theirs.tilt)
        np.testing.assert_array_equal(ours.covariance, theirs.covariance)
        assert back.kind == kind
        assert back.envelope.approach == model.envelope.approach


def test_another_archive_is_no_drilling_model(tmp_path: Path) -> None:
    from robotrue.core.archive import Archive, write_archive

    path = tmp_path / "x.robotrue"
    write_archive(path, Archive(kind="error-model/learned", schema=1, document={}, arrays={}))
    with pytest.raises(ArchiveError, match="expected 'drilling-normal'"):
        read_model(path)


def test_one_move_squares_the_spindle(job: Job) -> None:
    _, model, _, test = job
    for row in range(20):
        move = adjustment(model, test.clamps.take(np.array([row])), np.zeros(2))
        off = move.move.axes - test.tilt[row]
        sigma = np.sqrt(np.diag(move.covariance))
        assert (np.abs(off) < 5.0 * sigma).all()
        assert np.hypot(*off) < 0.05 * DEG


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"force": np.array([2500.0])}, "clamp force is 2500 N, the campaign covers 0 to 981 N"),
        ({"readings": np.array([[9.0, -4.5, -4.5]]) * MM}, "the foot and its campaign reach"),
        ({"readings": np.array([[np.nan, 0.0, 0.0]])}, "readings"),
    ],
)
def test_the_machine_is_not_told_to_move_on_a_guess(
    job: Job, change: dict[str, np.ndarray], message: str
) -> None:
    _, model, _, test = job
    with pytest.raises(Exception, match=message):
        adjustment(model, replace(test.clamps.take(np.array([0])), **change), np.zeros(2))


def test_a_sensor_at_its_stop_is_named(job: Job) -> None:
    _, model, _, test = job
    foot = replace(model.foot, reading_range=np.array([-5.0, 5.0]) * MM)
    clamps = replace(test.clamps.take(np.array([0])), readings=np.array([[0.1, 5.0, 0.2]]) * MM)
    with pytest.raises(ImplausibleDataError, match="sensor 2 reads 5"):
        adjustment(replace(model, foot=foot), clamps, np.zeros(2))


def test_four_sensors_show_the_one_at_an_edge() -> None:
    from robotrue.drilling.campaign import Clamps
    from robotrue.drilling.foot import readings
    from robotrue.drilling.head import normal_from_tilt

    foot = Foot(radius=np.full(4, 60.0 * MM), angle=np.array([45.0, 135.0, 225.0, 315.0]) * DEG)
    random = np.random.default_rng(4)
    tilt = random.uniform(-3.0, 3.0, (30, 2)) * DEG
    d = readings(foot, normal_from_tilt("AB", tilt), np.zeros(30))
    d = d + random.normal(0.0, 2e-6, d.shape)
    clamps = Clamps(readings=d, force=random.uniform(0, 900, 30), height=random.uniform(0, 0.1, 30))
    model, _ = fit_model(foot, HEAD, Campaign(clamps=clamps, tilt=tilt), kind="patent")
    fallen = np.array(d[:1])
    fallen[0, 2] += 0.5 * MM
    with pytest.raises(ImplausibleDataError, match="lie on no plane"):
        adjustment(model, replace(clamps.take(np.array([0])), readings=fallen), np.zeros(2))


def test_heights_and_approaches_the_campaign_has_not_seen_are_told(job: Job) -> None:
    _, model, _, test = job
    clamps = replace(
        test.clamps.take(np.array([0])), height=np.array([0.5]), approach=("from below",)
    )
    notes = adjustment(model, clamps, np.zeros(2)).notes
    assert "from below" in notes[0]
    assert "height is 500 mm" in notes[1]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda d: d[:, [1, 0, 2]], "column 2 is sensor 1, column 1 is sensor 2"),
        (lambda d: d * [1.0, 0.0, 1.0], "sensor 2 moves by 0.0000 mm"),
        (lambda d: -d, "fall where they should grow"),
        (lambda d: d * 1e-3, "times as far as the tilts"),
    ],
)
def test_campaigns_that_cannot_be(job: Job, spoil, message: str) -> None:  # type: ignore[no-untyped-def]
    machine, _, campaign, _ = job
    clamps = replace(campaign.clamps, readings=spoil(np.array(campaign.clamps.readings)))
    with pytest.raises(ImplausibleDataError, match=message):
        check_campaign(machine.foot, replace(campaign, clamps=clamps))


def test_a_campaign_of_a_few_clamps_or_one_tilt_is_refused(job: Job) -> None:
    machine, _, campaign, _ = job
    with pytest.raises(ObservabilityError, match="5 clamps, at least 8"):
        check_campaign(machine.foot, campaign.take(np.arange(5)))
    still = replace(campaign, tilt=np.zeros_like(campaign.tilt))
    with pytest.raises(ObservabilityError, match=r"move the sensors by 0\.0000 mm"):
        check_campaign(machine.foot, still)


def test_a_campaign_comes_back_from_its_file(job: Job, tmp_path: Path) -> None:
    _, _, campaign, _ = job
    (tmp_path / "foot.toml").write_text(FOOT)
    write_campaign(tmp_path / "c.csv", campaign)
    back, digest = read_campaign(tmp_path / "c.csv", read_foot(tmp_path / "foot.toml"), "AB")
    np.testing.assert_allclose(back.clamps.readings, campaign.clamps.readings, atol=5.1e-10)
    np.testing.assert_allclose(back.tilt, campaign.tilt, atol=5.1e-7 * DEG)
    assert len(digest) == 64


def test_raw_counts_need_the_mandrels_zero(tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_text(
        "a_deg,b_deg,raw1_counts,raw2_counts,raw3_counts,force_N,z_mm\n1,0,100,200,300,0,0\n"
    )
    (tmp_path / "foot.toml").write_text(FOOT)
    with pytest.raises(ConfigurationError, match="raw readings, and the foot has no zero"):
        read_campaign(tmp_path / "c.csv", read_foot(tmp_path / "foot.toml"), "AB")
    (tmp_path / "foot.toml").write_text(FOOT + "zero_counts = [90, 190, 290]\ncount_um = 1.0\n")
    got, _ = read_campaign(tmp_path / "c.csv", read_foot(tmp_path / "foot.toml"), "AB")
    np.testing.assert_allclose(got.clamps.readings, np.full((1, 3), 1e-5), rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a_deg,b_deg,force_N,z_mm\n1,2,3,4\n", "c.csv:1: no readings"),
        ("a_deg,b_deg,d1_mm,d2_mm,d3_mm,force_N,z_mm\n1,2,3,4,nan,6,7\n", "c.csv:2: "),
        ("a_deg,b_deg,d1_mm,d2_mm,d3_mm,force_N,z_mm\n90,2,3,4,5,6,7\n", "a tilt of 90 deg"),
        (
            "a_deg,b_deg,d1_mm,d2_mm,d3_mm,d4_mm,force_N,z_mm\n1,2,3,4,5,6,7,8\n",
            "'d4_mm' is unknown",
        ),
        ("a_deg,d1_mm,d2_mm,d3_mm,force_N,z_mm\n1,2,3,4,5,6\n", "no column 'b_deg'"),
    ],
)
def test_files_that_are_no_campaign(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "c.csv").write_text(text)
    (tmp_path / "foot.toml").write_text(FOOT)
    with pytest.raises(FormatError, match=message):
        read_campaign(tmp_path / "c.csv", read_foot(tmp_path / "foot.toml"), "AB")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (FOOT.replace("angles_deg", "angle_deg"), "foot.toml:3: unknown key foot.angle_deg"),
        (FOOT.replace("330.0", "90.0"), "one line"),
        (FOOT + "zero_counts = [1, 2, 3]\n", "the length of a count"),
        (FOOT + "zero_mm = [1, 2, 3, 4]\n", "4 zero readings for 3 sensors"),
        (FOOT + "[skin]\nshape = 'sphere'\nradius_mm = 'fitted'\n", "3 sensors for 4 unknowns"),
    ],
)
def test_files_that_are_no_foot(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "foot.toml").write_text(text)
    with pytest.raises(ConfigurationError, match=message):
        read_foot(tmp_path / "foot.toml")


@pytest.mark.parametrize("truth", ["", "  ", "foot", "Own", "sensors"])
def test_the_foot_is_not_its_own_judge(truth: str) -> None:
    with pytest.raises(ConfigurationError, match="not an outside reference"):
        Remaining(hole="1", tilt=np.zeros(2), cause=np.zeros(3), truth=truth)


def run_holes(
    machine: DrillingMachine, model: NormalModel, holes: Campaign, seed: int
) -> tuple[NormalModel, np.ndarray, list[int]]:
    """Drills holes with a gauge behind each (simulated): model, tilt left (n,) deg, alarms."""
    random = np.random.default_rng(seed)
    left, alarms = np.empty(len(holes)), []
    for i in range(len(holes)):
        found = estimate_tilt(model, holes.clamps.take(np.array([i])))
        off = holes.tilt[i] - found.tilt[0]
        left[i] = np.hypot(*off) / DEG
        gauge = 0.005 * DEG
        record = record_of(str(i), found, off + random.normal(0.0, gauge, 2), "hole gauge")
        step = update_model(model, found, record, reference=gauge)
        model = step.model
        if step.alarm:
            alarms.append(i)
    return model, left, alarms


def test_a_shifted_zero_is_seen_and_learned(job: Job) -> None:
    machine, model, _, test = job
    model = freeze_model(model, test, "test", allowed=0.1 * DEG)
    random = np.random.default_rng(9)
    shifted = replace(machine, offset=machine.offset + np.array([50.0, -50.0, 25.0]) * 1e-6)
    before = random_campaign(machine, 60, random, held_out=True)
    after = random_campaign(shifted, 100, random, held_out=True)
    model, left, alarms = run_holes(machine, model, before, 1)
    assert not alarms
    assert model.frozen is not None
    assert model.refinement.records == 0
    kept = estimate_tilt(model, after.clamps).tilt
    model, left, alarms = run_holes(shifted, model, after, 2)
    assert alarms
    assert alarms[0] < 15
    assert model.frozen is None
    stale = np.hypot(*(after.tilt - kept).T) / DEG
    assert np.mean(left[30:]) < 0.5 * np.mean(stale[30:])


def test_a_model_is_not_frozen_on_its_own_campaign_or_when_it_is_not_good(job: Job) -> None:
    _, model, campaign, test = job
    with pytest.raises(ConfigurationError, match="the campaign of the model"):
        freeze_model(model, campaign, "campaign", allowed=1.0 * DEG)
    with pytest.raises(ConfigurationError, match="the model is not frozen"):
        freeze_model(model, test, "test", allowed=1e-4 * DEG)


def test_plain_noise_raises_hardly_an_alarm_and_one_outlier_none() -> None:
    random = np.random.default_rng(3)
    state, alarms = Watch(), 0
    for score in random.normal(size=(4000, 2)):
        state = update_watch(state, score)
        if state.alarm:
            alarms, state = alarms + 1, Watch()
    assert alarms <= 4
    assert not update_watch(Watch(), np.array([50.0, 0.0])).alarm
