"""A model seen at a few postures: the same fits and predictions there with far fewer columns."""

from __future__ import annotations

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.calibration.sources import SeenRipple, see_at_postures
from robotrue.calibration.transfer import TransferSource, carry_source, fit_transfer

SETTINGS = FitSettings(payload=PAYLOAD)


@pytest.fixture(scope="module")
def source():
    rng = np.random.default_rng(31)
    return fit(
        arm(),
        measure(planted(arm(), rng), postures(arm(), 60, rng), rng),
        method="ripple",
        settings=SETTINGS,
    )


@pytest.fixture(scope="module")
def target():
    rng = np.random.default_rng(32)
    return measure(planted(arm(), np.random.default_rng(31)), postures(arm(), 9, rng), rng)


def test_predictions_at_the_postures_stay(source, target):
    seen = see_at_postures(source, target.joints)
    assert isinstance(seen.belief().ripple, SeenRipple)
    assert seen.belief().ripple.size == target.joints.size < source.belief().ripple.size
    query = Query(joints=target.joints, load=PAYLOAD)
    stated, again = source.predict(query), seen.predict(query)
    np.testing.assert_allclose(again.error, stated.error, rtol=1e-9)
    np.testing.assert_allclose(again.covariance, stated.covariance, rtol=1e-6, atol=1e-18)


@pytest.mark.parametrize("relation", ["region", "campaign"])
@pytest.mark.parametrize("build", [fit_transfer, carry_source])
def test_a_fit_of_some_rows_predicts_the_others_alike(source, target, relation, build):
    some, query = target.subset(np.arange(6)), Query(joints=target.joints[6:], load=PAYLOAD)
    answers = []
    for model in (source, see_at_postures(source, target.joints)):
        given = TransferSource(model=model, relation=relation)
        given = [given] if build is fit_transfer else given
        answers.append(build(arm(), some, given, SETTINGS).predict(query))
    np.testing.assert_allclose(answers[1].error, answers[0].error, atol=1e-9)
    np.testing.assert_allclose(answers[1].covariance, answers[0].covariance, rtol=1e-4, atol=1e-16)


def test_a_model_with_few_cycles_comes_back_as_it_is(source):
    many = postures(arm(), 200, np.random.default_rng(33))
    assert see_at_postures(source, many) is source
