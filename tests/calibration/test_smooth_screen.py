"""Blocks left out, by refits and in closed form, and linearisation of the fit. Simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures

from robotrue.calibration.estimate import estimate
from robotrue.calibration.evidence import PriorGroup, posterior
from robotrue.calibration.held_out_blocks import (
    AMPLITUDES,
    compare_left_out,
    label_blocks,
    sums_without,
)
from robotrue.calibration.learned import (
    LearnedMethod,
    LearnedParts,
    climb_ladder,
    first_design,
    measure_bend,
    settle_linearisation,
)
from robotrue.calibration.methods import FitSettings
from robotrue.calibration.parameters import retract
from robotrue.calibration.settings import free_groups
from robotrue.calibration.terms.smooth import choose_centres
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import deflect_arm
from robotrue.validation.evaluation import evaluate

SETTINGS = FitSettings(payload=PAYLOAD, repeatability=6e-5)
ROWS = 210
AMPLITUDE = 2e-4


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(5)
    joints = postures(arm(), ROWS, rng)
    state, _ = deflect_arm(planted(arm(), rng), joints, PAYLOAD)
    bump = 2e-4 * np.stack([np.sin(2 * joints[:, 0]), np.cos(3 * joints[:, 1]), joints[:, 2]], 1)
    return MeasurementSet(
        joints=joints,
        position=state.position + bump + 2e-5 * rng.standard_normal((ROWS, 3)),
        covariance=np.tile(4e-10 * np.eye(3), (ROWS, 1, 1)),
    )


@pytest.fixture(scope="module")
def fit(data):
    parts = LearnedParts(highest=16)
    physical = estimate(arm(), data, SETTINGS, free_groups("elastic"))
    at = climb_ladder(first_design(physical, data, SETTINGS, parts), parts)
    basis = choose_centres(data.joints, np.full(12, 1.5), most=20, enough=0.05)
    return at, at.design.with_centres(basis)


def refit_error(design, sums, groups, noise):
    """Mean error of every block, predicted from the other blocks' rows at given scales."""
    block = label_blocks(ROWS)
    lengths = np.zeros(ROWS)
    for k in np.unique(block):
        weights = posterior(sums_without(design, sums, block == k), groups, noise)
        for item in design.rows(block == k):
            off = (item.values - item.columns @ weights.mean)[:, :3, None]
            lengths[item.rows] = np.linalg.norm(item.lower[:, :3, :3] @ off, axis=1)[:, 0]
    return float(lengths[design.weights > 0.0].mean())


def test_blocks_left_out_in_closed_form_are_refits_without_them(fit):
    at, richer = fit
    plain, smooth = compare_left_out(richer, at.weights, AMPLITUDE)
    noise = at.weights.noise
    expected = refit_error(at.design, at.sums, at.weights.groups, noise)
    assert plain == pytest.approx(expected, rel=1e-6)
    scales = {group.name: group.sd for group in at.weights.groups}
    sums, found = richer.sums(), []
    for share in AMPLITUDES:
        groups: list[PriorGroup] = richer.groups({**scales, "smooth": share * AMPLITUDE})
        found.append(refit_error(richer, sums, groups, noise))
    assert smooth == pytest.approx(min(found), rel=1e-6)
    assert smooth < plain  # there is a smooth error


def test_a_block_is_predicted_as_by_the_refit_without_it(data):
    method = LearnedMethod(name="gp", parts=LearnedParts(highest=16))
    whole = method.fit_whole(arm(), data, replace(SETTINGS, repeatability=1e-5))
    assert whole.base is not None  # it has a smooth residual
    block = label_blocks(ROWS) == 2
    refit = whole.refit(block, whole.base.refit(block))
    seen = evaluate(
        whole.model_of(refit, block), data.subset(np.flatnonzero(block)), payload=PAYLOAD
    )
    found = whole.held_out_block(block)
    np.testing.assert_allclose(found.error, seen.after, atol=1e-6)
    np.testing.assert_allclose(found.covariance, seen.covariance, rtol=0.02, atol=1e-11)
    assert whole.held_out_block(label_blocks(ROWS) < 2) is None


def test_a_linearisation_far_from_the_fit_is_renewed_until_the_arm_follows_it(data):
    parts = LearnedParts(highest=16)
    physical = estimate(arm(), data, SETTINGS, free_groups("elastic"))
    design = first_design(physical, data, SETTINGS, parts)
    step = np.zeros(design.layout.size)
    step[parameter_slice(arm().dof, "theta")][1:3] = 0.02, -0.02
    far = replace(design, state=retract(design.layout, design.state, step))
    at = climb_ladder(far, parts)
    assert measure_bend(at) > 1e-4
    assert measure_bend(settle_linearisation(at)) < 5e-6
