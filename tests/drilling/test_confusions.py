"""Mirrored and exchanged sensors, axes of the wrong sense: named, not learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.adjust import adjustment
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.campaign_checks import (
    campaign_warnings,
    check_campaign,
    check_head,
    find_step,
)
from robotrue.drilling.campaign_csv import ProductionRecord
from robotrue.drilling.clamp_watch import ClampSettings
from robotrue.drilling.foot_file import FootSetup
from robotrue.drilling.foot_model import NormalModel, estimate_tilt, fit_model
from robotrue.drilling.foot_zero import check_exchange, read_zero
from robotrue.drilling.head import Head, normal_from_tilt, rotation, tilt_from_normal
from robotrue.drilling.hole_session import HoleSession, MovedHole
from robotrue.drilling.production import refine_model
from robotrue.drilling.production_references import check_references, find_cause
from robotrue.errors import ImplausibleDataError
from robotrue.simulation.drilling_machine import DrillingMachine, drilling_machine, random_campaign

HEAD = Head(p_pivot_tip=np.zeros(3))
GAUGE = 0.005 * DEG


@pytest.fixture(scope="module")
def machine() -> DrillingMachine:
    return drilling_machine(4)


@pytest.fixture(scope="module")
def campaign(machine: DrillingMachine) -> Campaign:
    return random_campaign(machine, 60, np.random.default_rng(4))


@pytest.fixture(scope="module")
def model(machine: DrillingMachine, campaign: Campaign) -> NormalModel:
    return fit_model(machine.foot, HEAD, campaign, kind="interactions")[0]


def with_readings(campaign: Campaign, change: Callable[[Array], Array]) -> Campaign:
    clamps = campaign.clamps
    return replace(campaign, clamps=replace(clamps, readings=change(clamps.readings)))


@pytest.mark.parametrize("sensor", [0, 1, 2])
def test_one_mirrored_sensor_of_a_campaign_is_named(
    machine: DrillingMachine, campaign: Campaign, sensor: int
) -> None:
    sign = np.where(np.arange(3) == sensor, -1.0, 1.0)
    with pytest.raises(
        ImplausibleDataError, match=rf"sensor {sensor + 1} travels -(1\.0|0\.9)"
    ) as it:
        check_campaign(machine.foot, with_readings(campaign, lambda d: d * sign))
    assert "wired in reverse" in it.value.message
    assert "turn the sign of its column" in str(it.value.hint)


def test_one_sensor_in_another_unit_is_named(machine: DrillingMachine, campaign: Campaign) -> None:
    with pytest.raises(ImplausibleDataError, match=r"sensor 3 travels 1\.[23]\d+ times as far"):
        check_campaign(machine.foot, with_readings(campaign, lambda d: d * [1.0, 1.0, 1.3]))


@pytest.mark.parametrize("plates", [1, 4])
def test_axes_that_count_the_other_way_round_are_named(campaign: Campaign, plates: int) -> None:
    random = np.random.default_rng(plates)
    attitudes = random.uniform(-20.0, 20.0, (plates, 2)) * DEG
    plate = attitudes[np.arange(60) % plates]
    axes = plate - random.uniform(-4.0, 4.0, (60, 2)) * DEG
    seen = np.einsum("nji,nj->ni", rotation("AB", axes), normal_from_tilt("AB", plate))
    recorded = replace(
        campaign,
        tilt=tilt_from_normal("AB", seen),
        clamps=replace(campaign.clamps, axes=axes + random.normal(0.0, 0.02, (60, 2)) * DEG),
    )
    check_head(HEAD, recorded)
    check_head(HEAD, replace(recorded, clamps=replace(recorded.clamps, axes=np.zeros((60, 2)))))
    random_axes = random.uniform(-0.4, 0.4, (60, 2))
    check_head(HEAD, replace(recorded, clamps=replace(recorded.clamps, axes=random_axes)))
    for sense, named in (
        ((-1.0, 1.0), "axes A\\."),
        ((1.0, -1.0), "axes B\\."),
        ((-1.0, -1.0), "A and B"),
    ):
        with pytest.raises(ImplausibleDataError, match=named) as it:
            check_head(replace(HEAD, sense=sense), recorded)
        assert "sense = [1, 1]" in str(it.value.hint)


def test_a_plane_that_was_moved_during_a_campaign_is_reported() -> None:
    random = np.random.default_rng(1)
    for seed in range(1, 9):
        machine = drilling_machine(seed, nonlinear=seed % 2 == 0, friction=seed % 4 == 0)
        sound = random_campaign(machine, 30 + 30 * (seed % 2), random)
        assert find_step(machine.foot, sound) is None
        assert campaign_warnings(machine.foot, sound) == ()
        later = np.arange(len(sound))[:, None] >= 17
        moved = replace(sound, tilt=sound.tilt + np.where(later, [0.12 * DEG, -0.05 * DEG], 0.0))
        step = find_step(machine.foot, moved)
        assert step is not None
        assert step.clamp == 18
        np.testing.assert_allclose(step.tilt / DEG, [0.12, -0.05], atol=0.03)
        (said,) = campaign_warnings(machine.foot, moved)
        assert f"from clamp 18 of {len(sound)} on the stated tilts are +0.1" in said


def test_a_mirrored_or_disturbed_sensor_of_one_clamp_gives_no_move(
    machine: DrillingMachine, model: NormalModel
) -> None:
    holes = random_campaign(machine, 40, np.random.default_rng(9), held_out=True)
    refused = 0
    for i in range(40):
        one = holes.take(np.array([i]))
        assert adjustment(model, one.clamps, np.zeros(2)).notes == ()
        mirrored = replace(one.clamps, readings=one.clamps.readings * [-1.0, 1.0, 1.0])
        try:
            found = adjustment(model, mirrored, np.zeros(2))
        except ImplausibleDataError:
            refused += 1
        else:  # it hardly moved the normal, or the operator hears of it
            off = np.abs(found.tilt - one.tilt).max() / DEG
            assert off < 1.1
            assert found.notes or off < 0.11
    assert refused > 30
    clamps = holes.clamps.take(np.array([0]))
    shifted = replace(clamps, readings=clamps.readings + np.array([0.25, 0.0, 0.0]) * MM)
    (note,) = adjustment(model, shifted, np.zeros(2)).notes
    assert "the normal is 0.1" in note
    assert "drill zero" in note


CONFUSIONS = {
    "A turned the other way": ([-1.0, 1.0], None),
    "A and B turned the other way": ([-1.0, -1.0], None),
    "before the move": ([0.0, 0.0], None),
    "column 2 is sensor 1, column 1 is sensor 2": ([1.0, 1.0], lambda d: d[:, [1, 0, 2]]),
    "sensor 3 reads with the other sign": ([1.0, 1.0], lambda d: d * [1.0, 1.0, -1.0]),
}


@pytest.mark.parametrize("named", CONFUSIONS)
def test_references_far_off_name_their_cause(
    machine: DrillingMachine, model: NormalModel, named: str
) -> None:
    turn, change = CONFUSIONS[named]
    random = np.random.default_rng(11)
    holes = random_campaign(machine, 12, random, held_out=True)
    if change is not None:
        holes = with_readings(holes, change)
    moved = estimate_tilt(model, holes.clamps).tilt
    record = ProductionRecord(
        clamps=holes.clamps,
        left=holes.tilt - moved * turn + random.normal(0.0, GAUGE, (12, 2)),
        hole=tuple(map(str, range(12))),
        source="holes.csv",
        provenance=holes.provenance,
    )
    expected = refine_model(model, record, truth="gauge", reference=GAUGE).expected
    with pytest.raises(ImplausibleDataError, match=named) as it:
        check_references(record.left, expected, "holes.csv", find_cause(model, record))
    assert "deg rms" in it.value.message
    # the same, reference by reference: none is learned, and from the fourth on it is named
    waiting = {
        name: MovedHole(clamps=holes.clamps.take(np.array([i])), tilt=moved[i], version=1)
        for i, name in enumerate(record.hole)
    }
    session = HoleSession(model, settings=ClampSettings(), reference=GAUGE, waiting=waiting)
    said = []
    for i in np.argsort(-np.hypot(*record.left.T))[:5]:
        with pytest.raises(ImplausibleDataError, match="it is not used") as it:
            session.take_reference(record.hole[i], record.left[i], "gauge")
        said.append(named in it.value.message)
    assert said == [False] * 3 + [True] * 2
    assert session.model.version == model.version


def test_a_zero_of_exchanged_sensors_is_named(machine: DrillingMachine, tmp_path: Path) -> None:
    zero = np.array([10.231, 9.977, 10.102])
    setup = FootSetup(foot=machine.foot, head=HEAD, count=None, zero=zero * MM, source="foot.toml")
    random = np.random.default_rng(2)
    for order, exchanged in (([0, 1, 2], False), ([2, 1, 0], True)):
        raw = (zero + random.normal(0.0, 0.003, (6, 3)))[:, order]
        rows = "\n".join(",".join(map(repr, map(float, row))) for row in raw)
        (tmp_path / "zero.csv").write_text(f"raw1_mm,raw2_mm,raw3_mm\n{rows}\n")
        found = read_zero(tmp_path / "zero.csv", setup)
        if not exchanged:
            check_exchange(found, setup)
            continue
        with pytest.raises(
            ImplausibleDataError, match="column 3 is sensor 1, column 1 is sensor 3"
        ):
            check_exchange(found, setup)
        # a zero that really moved is taken, and one where the foot file has none
        check_exchange(
            replace(found, zero=found.zero + 40.0 * UM * np.arange(3)), replace(setup, zero=None)
        )
        check_exchange(replace(found, zero=zero * MM + 40.0 * UM * np.arange(3)), setup)
