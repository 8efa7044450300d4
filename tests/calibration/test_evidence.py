"""Linear models by evidence, against the same model written as a dense Gaussian process."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.evidence import PriorGroup, posterior, spread, sums_of
from robotrue.calibration.scale_learning import learn

NOISE = 0.3


@pytest.fixture(scope="module")
def case():
    """150 poses of 3 numbers, two groups of columns: one at work, one idle."""
    rng = np.random.default_rng(5)
    columns = rng.standard_normal((450, 40))
    weights = np.concatenate([0.8 * rng.standard_normal(20), np.zeros(20)])
    values = columns @ weights + NOISE * rng.standard_normal(450)
    groups = [
        PriorGroup(name="at work", columns=np.arange(20), sd=1.0, rest=1e-4),
        PriorGroup(name="idle", columns=np.arange(20, 40), sd=0.5, rest=1e-4),
    ]
    return columns, values, groups


def dense(columns, values, sd, noise, queries):
    """Mean, covariance and log evidence of the equivalent Gaussian process."""
    kernel = (columns * sd**2) @ columns.T + noise * np.eye(len(values))
    cross = (queries * sd**2) @ columns.T
    solved = np.linalg.solve(kernel, values)
    covariance = (queries * sd**2) @ queries.T - cross @ np.linalg.solve(kernel, cross.T)
    log_det = np.linalg.slogdet(2 * np.pi * kernel)[1]
    return cross @ solved, covariance, -0.5 * (values @ solved + log_det)


def test_weight_space_equals_the_dense_process(case):
    columns, values, groups = case
    queries = np.random.default_rng(6).standard_normal((12, 40))
    sums = sums_of([(columns[:200], values[:200], 200), (columns[200:], values[200:], 250)], 40)
    fit = posterior([sums], groups, np.array([NOISE**2]))
    sd = np.repeat([1.0, 0.5], 20)
    mean, covariance, evidence = dense(columns, values, sd, NOISE**2, queries)
    np.testing.assert_allclose(queries @ fit.mean, mean, atol=1e-10)
    np.testing.assert_allclose(spread(fit.root, queries[None])[0], covariance, atol=1e-10)
    assert fit.evidence == pytest.approx(evidence, abs=1e-7)


def test_two_channels_carry_their_own_noise(case):
    columns, values, groups = case
    first, second = (
        sums_of([(columns[part], values[part], 225)], 40)
        for part in (slice(0, 225), slice(225, 450))
    )
    fit = posterior([first, second], groups, np.array([NOISE**2, 4.0 * NOISE**2]))
    scale = np.repeat([1.0, 2.0], 225)
    whole = sums_of([(columns / scale[:, None], values / scale, 450)], 40)
    one = posterior([whole], groups, np.array([NOISE**2]))
    np.testing.assert_allclose(fit.mean, one.mean, atol=1e-10)


def test_learning_finds_scales_and_noise_and_silences_the_idle_group(case):
    columns, values, groups = case
    sums = sums_of([(columns, values, 450)], 40)
    start = posterior([sums], groups, np.array([1.0]))
    fit = learn([sums], groups, np.array([1.0]))
    assert fit.evidence > start.evidence + 50.0
    assert fit.scale("at work") == pytest.approx(0.8, rel=0.35)
    assert fit.scale("idle") < 0.05
    assert np.sqrt(fit.noise[0]) == pytest.approx(NOISE, rel=0.1)


def test_rows_taken_away_equal_rows_never_seen(case):
    columns, values, groups = case
    whole = sums_of([(columns, values, 450)], 40)
    part = sums_of([(columns[:90], values[:90], 90)], 40)
    rest = sums_of([(columns[90:], values[90:], 360)], 40)
    noise = np.array([NOISE**2])
    without = posterior([whole.without(part)], groups, noise)
    np.testing.assert_allclose(without.mean, posterior([rest], groups, noise).mean, atol=1e-9)
