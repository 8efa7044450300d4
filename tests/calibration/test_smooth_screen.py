"""Parts left out, by refits and by elimination, and linearisation of the fit. Simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures

from robotrue.calibration import learned
from robotrue.calibration.estimate import estimate
from robotrue.calibration.evidence import PriorGroup, posterior
from robotrue.calibration.held_out_blocks import label_blocks, sums_without
from robotrue.calibration.learned import (
    LearnedMethod,
    LearnedParts,
    climb_ladder,
    first_design,
)
from robotrue.calibration.methods import FitSettings
from robotrue.calibration.parameters import retract
from robotrue.calibration.relinearisation import measure_bend, settle_linearisation
from robotrue.calibration.settings import free_groups
from robotrue.calibration.smooth_screen import (
    AMPLITUDES,
    add_smooth_columns,
    compare_left_out,
)
from robotrue.calibration.terms.smooth import choose_centres
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import deflect_arm
from robotrue.validation.evaluation import evaluate
from robotrue.validation.selection import default_splits, fit_auto

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


def refit_error(design, sums, groups, noise, parts):
    """Mean error of the parts, each predicted from the other rows at given scales."""
    means = []
    for part in parts:
        weights = posterior(sums_without(design, sums, part), groups, noise)
        lengths = []
        for item in design.rows(part & (design.weights > 0.0)):
            off = (item.values - item.columns @ weights.mean)[:, :3, None]
            lengths.append(np.linalg.norm(item.lower[:, :3, :3] @ off, axis=1)[:, 0])
        means.append(np.concatenate(lengths).mean())
    return float(np.mean(means))


BLOCKS = [label_blocks(ROWS) == k for k in range(5)]


@pytest.mark.parametrize("parts", [[], [np.arange(ROWS) < 40, np.arange(ROWS) % 3 == 0]])
def test_parts_left_out_by_elimination_are_refits_without_them(fit, parts):
    at, richer = fit
    sums, found = richer.sums(), []
    plain, smooth = compare_left_out(richer, sums, at.weights, AMPLITUDE, parts)
    noise = at.weights.noise
    expected = refit_error(at.design, at.sums, at.weights.groups, noise, parts or BLOCKS)
    assert plain == pytest.approx(expected, rel=1e-6)
    scales = {group.name: group.sd for group in at.weights.groups}
    for share in AMPLITUDES:
        groups: list[PriorGroup] = richer.groups({**scales, "smooth": share * AMPLITUDE})
        found.append(refit_error(richer, sums, groups, noise, parts or BLOCKS))
    assert smooth == pytest.approx(min(found), rel=1e-6)
    assert smooth < plain  # there is a smooth error


def test_sums_with_a_smooth_residual_grow_from_those_without(fit):
    at, richer = fit
    assert not any(s.few for s in at.sums)
    for found, made in zip(add_smooth_columns(richer, at.sums), richer.sums(), strict=True):
        np.testing.assert_allclose(found.gram, made.whole_gram(), rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(found.pull, made.pull, rtol=1e-9, atol=1e-6)
        assert (found.power, found.count) == pytest.approx((made.power, made.count))


def test_auto_fits_no_smooth_residual_by_which_its_folds_gain_nothing(data, monkeypatch):
    seen = []

    def lose(design, sums, fit, amplitude, parts, kept):
        seen.append(parts)
        return 1e-4, 2e-4

    monkeypatch.setattr(learned, "compare_left_out", lose)
    method = LearnedMethod(name="gp", parts=LearnedParts(highest=16))
    model = fit_auto(arm(), data, SETTINGS, methods={"gp": method})
    assert str(model.training_summary()["smooth"]).startswith("not fitted")
    left_out = [np.sort(fold.test) for fold in default_splits(data)]
    assert [np.flatnonzero(part).tolist() for part in seen[0]] == [t.tolist() for t in left_out]


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
