"""Corrections of simulated feet: what they leave, how sure they are, how they are chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.units import DEG
from robotrue.drilling.campaign import Campaign, conditions, reading_errors
from robotrue.drilling.correction import fit_correction, residual_tilt
from robotrue.drilling.correction_trials import choose_trial, held_out_blocks, try_all
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot import FLAT, Skin
from robotrue.drilling.foot_model import fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.physics import fit_physics, log_evidence
from robotrue.drilling.regression import fit_linear, significance
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.simulation.drilling_machine import (
    AS_LEFT,
    DrillingMachine,
    drilling_machine,
    random_campaign,
)


def campaigns(
    seed: int, count: int, *, nonlinear: bool = False, friction: bool = False
) -> tuple[DrillingMachine, Campaign, Campaign]:
    """A machine, a campaign and a test of 200 clamps."""
    machine = drilling_machine(seed, nonlinear=nonlinear, friction=friction)
    random = np.random.default_rng(seed + 1000)
    learned = random_campaign(machine, count, random)
    return machine, learned, random_campaign(machine, 200, random, held_out=True)


def test_the_patents_regression_finds_the_terms_of_an_exactly_linear_error() -> None:
    machine, campaign, _ = campaigns(1, 60)
    causes = conditions(machine.foot, campaign.order, campaign.clamps)
    truth = np.random.default_rng(3).normal(0.0, 1e-4, (5, 3))
    x = np.column_stack([np.ones(60), causes.table])
    fitted = fit_linear("patent", causes, x @ truth)
    np.testing.assert_allclose(fitted.coefficients, truth, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(fitted.predict(causes)[0], x @ truth, rtol=0.0, atol=1e-16)


def test_height_is_the_term_that_does_not_count() -> None:
    machine, campaign, _ = campaigns(3, 120)
    causes = conditions(machine.foot, campaign.order, campaign.clamps)
    terms = significance(
        fit_linear("interactions", causes, reading_errors(machine.foot, campaign)), causes
    )
    largest = {term.term: float(np.abs(term.coefficient).max()) for term in terms}
    assert largest["z"] < 0.1 * min(v for k, v in largest.items() if k in ("1", "F"))
    assert max(abs(term.t).max() for term in terms if term.term == "F") > 20.0


def test_the_gradient_of_the_evidence() -> None:
    machine, campaign, _ = campaigns(2, 30, nonlinear=True, friction=True)
    causes = conditions(machine.foot, campaign.order, campaign.clamps)
    errors = reading_errors(machine.foot, campaign)
    theta = np.array(fit_physics(causes, errors, 2e-6).theta) + 0.3
    _, gradient = log_evidence(theta, causes, errors)
    step = 1e-5
    for k in range(len(theta)):
        to = np.eye(len(theta))[k] * step
        up, down = (log_evidence(theta + s * to, causes, errors)[0] for s in (1.0, -1.0))
        assert (up - down) / (2.0 * step) == pytest.approx(gradient[k], rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("seed", [11, 12])
def test_known_causes_beat_the_patent_where_friction_acts(seed: int) -> None:
    machine, campaign, test = campaigns(seed, 120, nonlinear=True, friction=True)
    left = {
        kind: np.mean(
            residual_tilt(machine.foot, fit_correction(kind, machine.foot, campaign), test)
        )
        for kind in ("patent", "interactions", "physics")
    }
    before = np.mean(residual_tilt(machine.foot, None, test))
    assert left["patent"] < 0.5 * before
    assert left["physics"] < 0.5 * left["interactions"] < left["patent"]
    assert left["physics"] < 0.015 * DEG


def test_regions_hold_what_they_say() -> None:
    shares = []
    for seed in range(20, 26):
        machine, campaign, test = campaigns(seed, 60, nonlinear=True, friction=True)
        model, _ = fit_model(machine.foot, Head(p_pivot_tip=np.zeros(3)), campaign, kind="physics")
        shares.append(evaluate_test(model, test).covered)
    assert 0.90 < np.mean(shares) <= 0.99


def test_the_simplest_correction_wins_where_nothing_more_is_to_be_learned() -> None:
    machine, campaign, _ = campaigns(5, 60)
    assert choose_trial(try_all(machine.foot, campaign)).kind == "interactions"


def test_blocks_hold_out_whole_forces_and_whole_directions() -> None:
    machine, campaign, _ = campaigns(6, 60)
    forces, sectors = held_out_blocks(machine.foot, campaign)
    assert (len(forces), len(sectors)) == (5, 4)
    force = campaign.clamps.force
    for block in forces:
        assert len(np.unique(force[block])) == 1
        assert not np.isin(force[~block], force[block]).any()
    assert (np.sum(sectors, axis=0) == 1).all()


def test_more_moves_cannot_undo_friction_of_random_approaches() -> None:
    machine = drilling_machine(7, nonlinear=True, friction=True)
    random = np.random.default_rng(7)
    campaign = random_campaign(machine, 120, random, approach=AS_LEFT)
    test = random_campaign(machine, 200, random, held_out=True, approach=AS_LEFT)
    left = residual_tilt(machine.foot, fit_correction("physics", machine.foot, campaign), test)
    assert np.mean(left) > 0.02 * DEG


def test_a_curved_skin_is_taken_into_account_or_tilts_every_hole() -> None:
    skin = Skin(kind="cylinder", radius=0.8, axis=20.0 * DEG)
    machine = drilling_machine(12, skin=skin)
    random = np.random.default_rng(12)
    test = random_campaign(machine, 100, random)
    known = residual_tilt(machine.foot, None, test)
    flat = residual_tilt(replace(machine.foot, skin=FLAT), None, test)
    assert np.abs(flat - known).max() > 0.05 * DEG
    learned = fit_correction("interactions", machine.foot, random_campaign(machine, 60, random))
    assert np.mean(residual_tilt(machine.foot, learned, test)) < 0.004 * DEG


def test_fewer_clamps_than_terms_are_refused() -> None:
    machine, campaign, _ = campaigns(8, 8)
    causes = conditions(machine.foot, campaign.order, campaign.clamps)
    with pytest.raises(ObservabilityError, match="8 clamps for the 8 terms"):
        fit_linear("interactions", causes, reading_errors(machine.foot, campaign))


def test_one_force_alone_cannot_tell_its_term() -> None:
    machine, campaign, _ = campaigns(9, 60)
    same = campaign.take(np.flatnonzero(campaign.clamps.force == 0.0))
    with pytest.raises(ObservabilityError, match="does not separate the term"):
        fit_correction("patent", machine.foot, same)


def test_tilts_in_another_order_than_the_heads_are_refused() -> None:
    machine, campaign, _ = campaigns(10, 30)
    with pytest.raises(ConfigurationError, match="order AB, the head's is BA"):
        fit_model(machine.foot, Head(order="BA", p_pivot_tip=np.zeros(3)), campaign)
