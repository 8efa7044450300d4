"""Machine positions as causes, corrections of joint targets, feet of other forms, refused data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import adjustment, targets_document
from robotrue.drilling.campaign import Campaign, conditions
from robotrue.drilling.campaign_checks import campaign_warnings, check_campaign
from robotrue.drilling.campaign_csv import read_campaign, write_campaign
from robotrue.drilling.clamp_watch import ClampSettings, foot_sample
from robotrue.drilling.correction import learning_errors, residual_tilt
from robotrue.drilling.correction_trials import choose_trial, resolve_inputs, usable_positions
from robotrue.drilling.drill_defaults import Corrects
from robotrue.drilling.evaluate import evaluate_test, terms_of
from robotrue.drilling.foot import Foot
from robotrue.drilling.foot_file import FootSetup
from robotrue.drilling.foot_model import fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.hole_session import HoleSession
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.physics import fit_physics, log_evidence
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.simulation.drilling_machine import (
    DrillingMachine,
    drilling_machine,
    random_campaign,
)

HEAD = Head(p_pivot_tip=np.array([0.0, 0.0, -0.35]))
SAG = np.array([[0.003, 0.0], [0.0, 0.0]])
"""rad per rad: .03 deg per 10 deg of A."""
SWING = 30.0 * DEG


def sagging(seed: int, count: int = 60) -> tuple[DrillingMachine, Campaign, Campaign]:
    """A machine whose head sags with A, a campaign and a test over 30 deg of A and B."""
    machine, random = drilling_machine(seed, sag=SAG), np.random.default_rng(1000 + seed)
    campaign = random_campaign(machine, count, random, swing=SWING)
    return machine, campaign, random_campaign(machine, 100, random, held_out=True, swing=SWING)


@pytest.mark.parametrize("corrects", ["readings", "joints"])
def test_a_sag_with_a_is_learned_from_the_positions_of_the_axes(corrects: Corrects) -> None:
    for seed in (1, 2, 3):
        machine, campaign, test = sagging(seed)
        used, trials = resolve_inputs("auto", machine.foot, campaign, corrects=corrects)
        assert used == ("A", "B") == choose_trial(trials).inputs
        left = {}
        for inputs in ((), used):
            model, _ = fit_model(
                machine.foot, HEAD, campaign, kind="interactions", inputs=inputs, corrects=corrects
            )
            left[inputs] = evaluate_test(model, test).ours.mean / DEG
        assert left[()] > 0.03
        assert left[used] < 0.006


def test_positions_that_do_not_count_are_not_chosen() -> None:
    machine, random = drilling_machine(4), np.random.default_rng(4)
    campaign = random_campaign(machine, 60, random, swing=SWING)
    assert resolve_inputs("auto", machine.foot, campaign)[0] == ()


def test_a_position_that_follows_the_tilt_is_no_cause_and_is_reported() -> None:
    machine, campaign, _ = sagging(5)
    same = replace(campaign, clamps=replace(campaign.clamps, axes=0.1 + campaign.tilt))
    assert usable_positions(machine.foot, same)[0] == ()
    assert any("deviation of A follows" in said for said in campaign_warnings(machine.foot, same))
    with pytest.raises(ObservabilityError, match=r"--inputs AB: .*follows from"):
        resolve_inputs("AB", machine.foot, same)
    with pytest.raises(ObservabilityError, match="does not record them"):
        resolve_inputs("XY", machine.foot, same)


def test_the_gradient_of_the_evidence_with_positions() -> None:
    machine, campaign, _ = sagging(2, 30)
    causes = conditions(machine.foot, campaign.order, campaign.clamps)
    errors = learning_errors(machine.foot, campaign, "joints")
    inputs = ("A", "B")
    theta = np.array(fit_physics(causes, errors, 2e-6, inputs=inputs).theta) + 0.3
    _, gradient = log_evidence(theta, causes, errors, inputs)
    for k in range(len(theta)):
        to = np.eye(len(theta))[k] * 1e-5
        up, down = (log_evidence(theta + s * to, causes, errors, inputs)[0] for s in (1.0, -1.0))
        assert (up - down) / 2e-5 == pytest.approx(gradient[k], rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("kind", ["patent", "physics"])
def test_a_model_with_positions_of_joint_targets_survives_its_file(
    kind: str, tmp_path: Path
) -> None:
    machine, campaign, test = sagging(6, 30)
    model, _ = fit_model(
        machine.foot, HEAD, campaign, kind=kind, inputs=("A", "B"), corrects="joints"
    )
    write_model(tmp_path / "m.robotrue", model)
    again = read_model(tmp_path / "m.robotrue")
    assert (again.correction.inputs, again.correction.corrects) == (("A", "B"), "joints")
    np.testing.assert_array_equal(evaluate_test(model, test).left, evaluate_test(again, test).left)
    with pytest.raises(ImplausibleDataError, match="uses the machine's A, B"):
        evaluate_test(again, replace(test, clamps=replace(test.clamps, axes=())))


def test_the_learned_turn_is_added_to_the_theoretical_target() -> None:
    machine, campaign, test = sagging(7)
    model, _ = fit_model(
        machine.foot, HEAD, campaign, kind="patent", inputs=("A", "B"), corrects="joints"
    )
    terms = terms_of(model, campaign)
    assert [t["term"] for t in terms] == ["1", "a", "b", "F", "z", "A", "B"]
    assert terms[5]["coefficient_deg"][0] == pytest.approx(0.03, abs=0.002)
    clamp = test.clamps.take(slice(0, 1))
    found = adjustment(model, clamp, clamp.axes[0])
    said = targets_document(found)
    target = [said[f"{n}_theoretical_deg"] + said[f"{n}_compensation_deg"] for n in "AB"]
    np.testing.assert_allclose(target, found.move.axes / DEG, atol=1e-12)


def test_positions_go_through_a_campaign_file(tmp_path: Path) -> None:
    machine, campaign, _ = sagging(8, 20)
    place = np.random.default_rng(8).uniform(0.0, 2.0, (20, 2))
    campaign = replace(campaign, clamps=replace(campaign.clamps, place=place))
    write_campaign(tmp_path / "c.csv", campaign)
    setup = FootSetup(foot=machine.foot, head=HEAD, count=None, zero=None, source="")
    again, _ = read_campaign(tmp_path / "c.csv", setup, "AB")
    np.testing.assert_allclose(again.clamps.place, place, atol=1e-6 * MM)
    np.testing.assert_allclose(again.clamps.axes, campaign.clamps.axes, atol=1e-6 * DEG)


FEET = {
    "three, unequal": Foot(
        radius=np.array([45.0, 60.0, 80.0]) * MM, angle=np.array([10.0, 140.0, 265.0]) * DEG
    ),
    "four": Foot(
        radius=np.array([50.0, 50.0, 70.0, 70.0]) * MM,
        angle=np.array([0.0, 95.0, 180.0, 270.0]) * DEG,
    ),
}


@pytest.mark.parametrize("corrects", ["readings", "joints"])
@pytest.mark.parametrize("form", FEET)
def test_feet_of_other_forms_are_corrected(form: str, corrects: Corrects) -> None:
    machine, random = drilling_machine(9, foot=FEET[form]), np.random.default_rng(9)
    campaign = random_campaign(machine, 60, random)
    test = random_campaign(machine, 100, random, held_out=True)
    check_campaign(machine.foot, campaign)
    model, _ = fit_model(machine.foot, HEAD, campaign, kind="interactions", corrects=corrects)
    assert evaluate_test(model, test).ours.mean < 0.005 * DEG
    assert np.mean(residual_tilt(machine.foot, None, test)) > 0.05 * DEG
    clamp = test.clamps.take(slice(0, 1))
    found = adjustment(model, clamp, np.zeros(2))
    np.testing.assert_allclose(found.tilt, test.tilt[0], atol=0.02 * DEG)
    if form == "four":
        stuck = np.array(clamp.readings)
        stuck[0, 2] += 1.0 * MM
        with pytest.raises(ImplausibleDataError, match="lie on no plane"):
            adjustment(model, replace(clamp, readings=stuck), np.zeros(2))


def test_exchanged_tilts_and_kilonewtons_are_refused_and_one_force_is_reported() -> None:
    machine, random = drilling_machine(10, foot=FEET["three, unequal"]), np.random.default_rng(10)
    campaign = random_campaign(machine, 30, random)
    check_campaign(machine.foot, campaign)
    for tilt, said in (
        (campaign.tilt[:, ::-1], "a_deg and b_deg are exchanged"),
        (campaign.tilt * np.array([-1.0, 1.0]), "a_deg has the other sign"),
        (campaign.tilt * np.array([1.0, -1.0]), "b_deg has the other sign"),
    ):
        with pytest.raises(ImplausibleDataError, match=said):
            check_campaign(machine.foot, replace(campaign, tilt=tilt))
    clamps = campaign.clamps
    with pytest.raises(ImplausibleDataError, match=r"0\.981 N, expected 5 N or more"):
        check_campaign(
            machine.foot, replace(campaign, clamps=replace(clamps, force=clamps.force / 1000.0))
        )
    assert campaign_warnings(machine.foot, campaign) == ()
    one = replace(campaign, clamps=replace(clamps, force=np.full(30, 500.0)))
    (said,) = campaign_warnings(machine.foot, one)
    assert said.startswith("all 30 clamps are at 500 N")
    assert "--forces-n" in said


def test_a_foot_of_four_sensors_and_its_axes_go_through_a_session() -> None:
    machine = drilling_machine(11, foot=FEET["four"], sag=SAG)
    random = np.random.default_rng(11)
    campaign = random_campaign(machine, 60, random, swing=SWING)
    model, _ = fit_model(machine.foot, HEAD, campaign, kind="interactions", inputs=("A", "B"))
    holes = random_campaign(machine, 9, random, held_out=True, swing=SWING)
    hole = holes.take(holes.clamps.force == holes.clamps.force.max())
    session = HoleSession(model, settings=ClampSettings(), reference=0.005 * DEG)
    setup = FootSetup(foot=machine.foot, head=HEAD, count=None, zero=None, source="")
    clamp = hole.clamps
    values = {f"d{k + 1}_mm": float(v / MM) for k, v in enumerate(clamp.readings[0])}
    values |= {"force_N": float(clamp.force[0]), "z_mm": float(clamp.height[0] / MM)}
    values |= {f"{n}_deg": float(v / DEG) for n, v in zip("AB", clamp.axes[0], strict=True)}
    answers = [
        session.push(foot_sample({**values, "X_mm": 3.0, "Y_mm": 4.0}, setup, 0.01 * k))
        for k in range(30)
    ]
    (answer,) = [a for a in answers if a is not None]
    assert answer.adjustment is not None, answer.refused
    assert answer.clamps is not None
    np.testing.assert_allclose(answer.clamps.axes, clamp.axes, atol=1e-12)
    np.testing.assert_allclose(answer.clamps.place, [[3e-3, 4e-3]], atol=1e-12)
    alone = replace(answer.clamps, axes=())
    with pytest.raises(ImplausibleDataError, match="uses the machine's A, B"):
        adjustment(model, alone, np.zeros(2))
    far = replace(answer.clamps, axes=np.array([[60.0, 0.0]]) * DEG)
    notes = adjustment(model, replace(far, readings=far.readings + 0.0), np.zeros(2)).notes
    assert any(note.startswith("A is 60 deg, the campaign covers") for note in notes)
