"""Laws of the learners: units, order of rows, weights, and the limits of transfer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.calibration.learners import GaussianProcess, TrAdaBoostR2, TransferGaussianProcess

HELD = {"length": [1.3, 3.0, 1.7], "amplitude": 1.4, "noise": 0.05}
N, M = 24, 8
seeds = st.integers(0, 2**31)
scales = st.floats(-6.0, 6.0).map(lambda power: 10.0**power)


def rows(seed: int, n: int = N) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    X = random.uniform(-1.0, 1.0, (n, 3)) * [1.0, 2.0, 4.0]
    y = np.c_[np.sin(2.0 * X[:, 0]) + 0.3 * X[:, 1], np.cos(X[:, 2]) - X[:, 1]]
    return X, y + 0.05 * random.normal(size=(n, 2))


def both(model, X):
    mean, deviation = model.predict(X, return_std=True)
    return np.stack([mean, deviation])


@settings(max_examples=10, deadline=None)
@given(seeds, scales, scales, st.floats(-1e3, 1e3))
def test_units_and_origin_of_inputs_and_outputs_do_not_matter(seed, inside, outside, shift):
    X, y = rows(seed % 50)
    there, _ = rows(seed % 50 + 1)
    plain = both(GaussianProcess().fit(X, y), there)
    moved = GaussianProcess().fit(inside * (X + shift), outside * (y + shift))
    mean, deviation = both(moved, inside * (there + shift))
    np.testing.assert_allclose(mean / outside - shift, plain[0], atol=2e-3)
    np.testing.assert_allclose(deviation / outside, plain[1], rtol=2e-2)


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_the_order_of_rows_and_of_outputs_does_not_matter(seed):
    X, y = rows(seed)
    there, _ = rows(seed + 1)
    order = np.random.default_rng(seed).permutation(N)
    plain = both(GaussianProcess(**HELD).fit(X, y), there)
    mixed = both(GaussianProcess(**HELD).fit(X[order], y[order][:, ::-1]), there)
    np.testing.assert_allclose(mixed[..., ::-1], plain, atol=1e-9)
    boosted = TrAdaBoostR2(GaussianProcess(**HELD), rounds=4).fit(X, y).predict(there)
    again = TrAdaBoostR2(GaussianProcess(**HELD), rounds=4).fit(X[order], y[order]).predict(there)
    np.testing.assert_allclose(again, boosted, atol=1e-7)


@settings(max_examples=15, deadline=None)
@given(seeds, st.sampled_from(["precision", "repeats"]))
def test_a_row_twice_is_a_row_of_weight_two(seed, weights):
    X, y = rows(seed)
    there, _ = rows(seed + 1)
    times = np.random.default_rng(seed).integers(0, 4, N)
    times[:2] = 1, 2
    weighted = GaussianProcess(weights=weights, **HELD).fit(X, y, times)
    repeated = GaussianProcess(weights=weights, **HELD).fit(
        np.repeat(X, times, axis=0), np.repeat(y, times, axis=0)
    )
    np.testing.assert_allclose(both(weighted, there), both(repeated, there), atol=1e-8)
    if weights == "repeats":
        assert weighted.log_marginal_likelihood_ == pytest.approx(
            repeated.log_marginal_likelihood_, rel=1e-9
        )


@settings(max_examples=15, deadline=None)
@given(seeds, st.floats(0.01, 100.0))
def test_equal_weights_are_the_plain_process_with_the_noise_over_the_weight(seed, weight):
    X, y = rows(seed)
    there, _ = rows(seed + 1)
    wider = {**HELD, "noise": HELD["noise"] * weight**0.5}
    model = GaussianProcess(**wider).fit(X, y, np.full(N, weight))
    plain = GaussianProcess(**HELD).fit(X, y)
    mean, deviation = model.predict(there, return_std=True, noisy=False)
    expected, spread = plain.predict(there, return_std=True, noisy=False)
    np.testing.assert_allclose(mean, expected, atol=1e-9)
    np.testing.assert_allclose(deviation, spread, atol=1e-9)
    boosted = TrAdaBoostR2(GaussianProcess(**HELD), rounds=1).fit(X, y, np.full(N, weight))
    np.testing.assert_allclose(boosted.predict(there), plain.predict(there), atol=1e-9)


@settings(max_examples=5, deadline=None)
@given(seeds)
def test_unit_weights_change_nothing_that_is_learned(seed):
    X, y = rows(seed)
    plain, unit = GaussianProcess().fit(X, y), GaussianProcess().fit(X, y, np.ones(N))
    np.testing.assert_array_equal(unit.predict(X), plain.predict(X))
    assert unit.noise_ == plain.noise_


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_rho_zero_is_the_target_alone(seed):
    X, y = rows(seed, M)
    source = rows(seed + 1)
    there, _ = rows(seed + 2)
    alone = GaussianProcess(**HELD).fit(X, y)
    model = TransferGaussianProcess(
        length=HELD["length"],
        amplitude=2.0,
        difference=HELD["amplitude"],
        rho=0.0,
        noise=HELD["noise"],
        source_noise=0.2,
        fall_back=False,
    ).fit(X, y, X_source=source[0], y_source=source[1])
    np.testing.assert_allclose(both(model, there), both(alone, there), atol=1e-8)
    assert model.correlation_ == 0.0


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_rho_one_without_difference_is_both_pooled(seed):
    X, y = rows(seed, M)
    source = rows(seed + 1)
    there, _ = rows(seed + 2)
    pooled = GaussianProcess(**HELD).fit(np.r_[X, source[0]], np.r_[y, source[1]])
    model = TransferGaussianProcess(
        mean="constant",
        difference=0.0,
        rho=1.0,
        source_noise=HELD["noise"],
        fall_back=False,
        **HELD,
    ).fit(X, y, X_source=source[0], y_source=source[1])
    np.testing.assert_allclose(both(model, there), both(pooled, there), atol=1e-8)
    assert model.log_marginal_likelihood_ == pytest.approx(pooled.log_marginal_likelihood_)


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_rounds_of_equal_weights_are_the_plain_process(seed):
    X, y = rows(seed)
    there, _ = rows(seed + 1)
    plain = GaussianProcess(**HELD).fit(X, y)
    one = TrAdaBoostR2(GaussianProcess(**HELD), rounds=1).fit(X, y)
    np.testing.assert_allclose(one.predict(there), plain.predict(there), atol=1e-9)
