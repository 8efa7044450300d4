from __future__ import annotations

import warnings

import numpy as np
import pytest
from learners_rows import NOISE, kernel, rows, truth
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from robotrue.calibration.learners import GaussianProcess
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError

LENGTH, AMPLITUDE, WHITE = [1.3, 3.0, 1.7, 6.0], 1.4, 0.05
HELD = {"length": LENGTH, "amplitude": AMPLITUDE, "noise": WHITE}


@pytest.fixture(scope="module")
def oracle():
    X, y = rows(60, seed=3)
    fixed = ConstantKernel(AMPLITUDE**2) * RBF(LENGTH) + WhiteKernel(WHITE**2)
    return X, y, GaussianProcessRegressor(fixed, alpha=0.0, optimizer=None).fit(X, y)


def test_mean_deviation_covariance_and_evidence_are_those_of_scikit_learn(oracle):
    X, y, peer = oracle
    ours = GaussianProcess(mean="zero", **HELD).fit(X, y)
    there, _ = rows(700, seed=4)
    mean, deviation = ours.predict(there, return_std=True)
    peer_mean, peer_deviation = peer.predict(there, return_std=True)
    np.testing.assert_allclose(mean, peer_mean, atol=1e-9)
    np.testing.assert_allclose(deviation, peer_deviation, rtol=1e-7)
    _, covariance = ours.predict(there[:20], return_cov=True)
    _, peer_covariance = peer.predict(there[:20], return_cov=True)
    np.testing.assert_allclose(covariance, peer_covariance, atol=1e-9)
    assert ours.log_marginal_likelihood_ == pytest.approx(peer.log_marginal_likelihood_value_)


def test_known_variances_and_weights_are_the_alpha_of_scikit_learn():
    X, y = rows(40, seed=5)
    random = np.random.default_rng(5)
    variance, weight = random.uniform(0.0, 0.1, 40), random.uniform(0.2, 5.0, 40)
    peer = GaussianProcessRegressor(
        ConstantKernel(AMPLITUDE**2) * RBF(LENGTH),
        alpha=(WHITE**2 + variance) / weight,
        optimizer=None,
    ).fit(X, y)
    ours = GaussianProcess(mean="zero", **HELD).fit(X, y, weight, variance)
    there, _ = rows(50, seed=6)
    mean, deviation = ours.predict(there, return_std=True, noisy=False)
    peer_mean, peer_deviation = peer.predict(there, return_std=True)
    np.testing.assert_allclose(mean, peer_mean, atol=1e-9)
    np.testing.assert_allclose(deviation, peer_deviation, rtol=1e-6)
    assert ours.log_marginal_likelihood_ == pytest.approx(peer.log_marginal_likelihood_value_)


def test_without_the_weak_prior_the_evidence_is_as_large_as_that_of_scikit_learn():
    X, y = rows(50, seed=7)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        peer = GaussianProcessRegressor(
            ConstantKernel(1.0, (1e-4, 1e4)) * RBF([1.0, 2.0, 1.0, 5.0], (1e-2, 1e3))
            + WhiteKernel(0.01, (1e-8, 1e2)),
        ).fit(X, y)
    ours = GaussianProcess(mean="zero", prior="none").fit(X, y)
    assert ours.log_marginal_likelihood_ > peer.log_marginal_likelihood_value_ - 0.01


@pytest.mark.parametrize("kind", ["ard", "isotropic"])
@pytest.mark.parametrize("mean", ["constant", "estimated", "zero"])
@pytest.mark.parametrize("weights", ["precision", "repeats"])
def test_the_gradient_is_that_of_finite_differences(kind, mean, weights):
    X, y = rows(30, seed=8)
    random = np.random.default_rng(8)
    model = GaussianProcess(
        kernel=kind, mean=mean, weights=weights, length=1.5, amplitude=1.0, noise=0.1
    ).fit(X, y, random.uniform(0.5, 3.0, 30), random.uniform(0.0, 0.02, 30))
    theta = np.log([*([1.5, 2.5, 1.2, 4.0] if kind == "ard" else [1.8]), 1.2, 0.2])
    _, gradient = model.log_marginal_likelihood(theta, eval_gradient=True)
    for k, axis in enumerate(1e-5 * np.eye(len(theta))):
        up, down = (model.log_marginal_likelihood(theta + s * axis) for s in (1.0, -1.0))
        assert gradient[k] == pytest.approx((up - down) / 2e-5, rel=1e-4, abs=1e-4)


def test_a_mean_integrated_out_is_the_limit_of_a_wide_prior_on_it():
    X, y = rows(25, seed=9)
    y = y + 7.0
    wide = 1e3
    K = AMPLITUDE**2 * kernel(X, X, LENGTH) + wide**2 + WHITE**2 * np.eye(25)
    there, _ = rows(40, seed=10)
    near = AMPLITUDE**2 * kernel(there, X, LENGTH) + wide**2
    model = GaussianProcess(**HELD).fit(X, y)
    mean, deviation = model.predict(there, return_std=True, noisy=False)
    np.testing.assert_allclose(mean, near @ np.linalg.solve(K, y), atol=1e-5)
    variance = AMPLITUDE**2 + wide**2 - np.einsum("ij,ji->i", near, np.linalg.solve(K, near.T))
    np.testing.assert_allclose(deviation[:, 0] ** 2, variance, atol=1e-5)


def test_an_estimated_mean_is_generalised_least_squares_and_taken_as_known():
    X, y = rows(25, seed=9)
    K = AMPLITUDE**2 * kernel(X, X, LENGTH) + WHITE**2 * np.eye(25)
    ones = np.ones(25)
    expected = ones @ np.linalg.solve(K, y) / (ones @ np.linalg.solve(K, ones))
    model = GaussianProcess(mean="estimated", **HELD).fit(X, y)
    np.testing.assert_allclose(model.mean_, expected, rtol=1e-9)
    zero = GaussianProcess(mean="zero", **HELD).fit(X, y - expected)
    there, _ = rows(40, seed=10)
    mean, deviation = model.predict(there, return_std=True)
    zero_mean, zero_deviation = zero.predict(there, return_std=True)
    np.testing.assert_allclose(mean, zero_mean + expected, atol=1e-9)
    np.testing.assert_allclose(deviation, zero_deviation, rtol=1e-9)
    assert model.log_marginal_likelihood_ == pytest.approx(zero.log_marginal_likelihood_)


def test_equations_28_31_and_32_of_the_paper_are_reached():
    X, y = rows(30, seed=11)
    there, _ = rows(20, seed=12)
    sigma_l, sigma_f, sigma = 2.5, 1.3, 0.05
    squares = ((there[:, None] - X[None]) ** 2).sum(axis=2)
    C = sigma_f**2 * np.exp(-((X[:, None] - X[None]) ** 2).sum(axis=2) / (2.0 * sigma_l))
    near = sigma_f**2 * np.exp(-squares / (2.0 * sigma_l))
    solved = np.linalg.solve(C + sigma**2 * np.eye(30), np.c_[y, near.T])
    model = GaussianProcess(
        kernel="isotropic",
        denominator="literal",
        mean="zero",
        length=sigma_l,
        amplitude=sigma_f,
        noise=sigma,
        optimise=False,
    ).fit(X, y)
    mean, deviation = model.predict(there, return_std=True, noisy=False)
    np.testing.assert_allclose(mean, near @ solved[:, :3], atol=1e-9)
    eta = sigma_f**2 - np.einsum("ij,ji->i", near, solved[:, 3:])
    np.testing.assert_allclose(deviation[:, 1] ** 2, eta, atol=1e-10)
    np.testing.assert_allclose(model.length_, sigma_l)


def test_outputs_apart_are_as_many_single_fits():
    X, y = rows(30, seed=13)
    together = GaussianProcess(shared=False).fit(X, y)
    mean, deviation = together.predict(X[:7] + 0.1, return_std=True)
    for j in range(3):
        alone = GaussianProcess().fit(X, y[:, j])
        one, spread = alone.predict(X[:7] + 0.1, return_std=True)
        np.testing.assert_allclose(mean[:, j], one, rtol=1e-9)
        np.testing.assert_allclose(deviation[:, j], spread, rtol=1e-9)
        assert together.noise_[j] == alone.noise_


def test_the_correlation_between_outputs_is_seen():
    X, _ = rows(80, seed=14)
    random = np.random.default_rng(14)
    root = np.linalg.cholesky(kernel(X, X, LENGTH) + WHITE**2 * np.eye(80))
    mixed = root @ random.normal(size=(80, 2)) @ np.linalg.cholesky([[1.0, 0.8], [0.8, 1.0]]).T
    found = GaussianProcess().fit(X, mixed).output_correlation_
    assert found[0, 1] == pytest.approx(0.8, abs=0.12)  # sd of a correlation of 80 rows 0.04


@pytest.mark.parametrize(("n", "outputs", "draws"), [(12, 3, 30), (20, 1, 40), (50, 3, 12)])
def test_95_percent_intervals_cover_with_few_rows(n, outputs, draws):
    """Functions drawn from processes with lengths of 1 to 10 standard deviations of the input."""
    covered, plugged = [], []
    for seed in range(draws):
        random = np.random.default_rng(1000 * n + seed)
        X = random.uniform(-1.0, 1.0, (n + 60, 4))
        length = np.exp(random.uniform(np.log(0.6), np.log(6.0), 4))
        root = np.linalg.cholesky(kernel(X, X, length) + 0.05**2 * np.eye(n + 60))
        y = root @ random.normal(size=(n + 60, outputs))
        model = GaussianProcess().fit(X[:n], y[:n])
        mean, deviation = model.predict(X[n:], return_std=True)
        miss = np.abs(y[n:].reshape(60, -1) - mean.reshape(60, -1))
        inside = 1.96 * deviation.reshape(60, -1)
        covered.append((miss < inside).mean())
        plugged.append((miss < inside / np.sqrt(model.inflation_)).mean())
    assert 0.91 < np.mean(covered) < 0.985
    if n < 50:
        assert np.mean(plugged) < np.mean(covered) - 0.02


def test_restarts_are_seeded_and_never_worse():
    X, y = rows(20, seed=15)
    once = GaussianProcess(restarts=0).fit(X, y)
    first = GaussianProcess(restarts=3, random_state=4).fit(X, y)
    again = GaussianProcess(restarts=3, random_state=4).fit(X, y)
    np.testing.assert_array_equal(first.length_, again.length_)
    assert first.log_marginal_likelihood_ > once.log_marginal_likelihood_ - 1.0


def test_fewer_than_a_handful_of_hyper_parameters_left_free_are_learned_given_the_others():
    X, y = rows(80, seed=16)
    model = GaussianProcess(length=LENGTH, amplitude=AMPLITUDE).fit(X, y)
    np.testing.assert_allclose(model.length_, LENGTH)
    assert model.amplitude_ == pytest.approx(AMPLITUDE)
    assert model.noise_ == pytest.approx(NOISE, rel=0.2)
    assert np.abs(model.predict(X) - truth(X)).mean() < NOISE


def test_left_out_rows_are_predicted_from_the_others():
    X, y = rows(15, seed=17)
    residual, variance = GaussianProcess(**HELD).fit(X, y).predict_left_out()
    others = GaussianProcess(**HELD).fit(np.delete(X, 4, 0), np.delete(y, 4, 0))
    mean, deviation = others.predict(X[[4]], return_std=True)
    np.testing.assert_allclose(residual[4], y[4] - mean[0], atol=1e-10)
    assert variance[4] == pytest.approx(deviation[0, 0] ** 2)


def test_other_weights_on_the_same_rows_are_a_fit_with_these_weights():
    X, y = rows(20, seed=18)
    weight = np.random.default_rng(18).uniform(0.1, 3.0, 20)
    quick = GaussianProcess(**HELD).fit(X, y).reweight(weight)
    slow = GaussianProcess(**HELD).fit(X, y, weight)
    np.testing.assert_allclose(quick.predict(X + 0.1), slow.predict(X + 0.1), atol=1e-10)


@pytest.mark.parametrize(
    ("parameters", "error", "words"),
    [
        ({"kernel": "matern"}, ConfigurationError, "kernel is 'matern'; allowed are ard"),
        ({"mean": "linear"}, ConfigurationError, "mean is 'linear'"),
        ({"noise": -1.0}, ConfigurationError, "noise is -1.0"),
        ({"amplitude": 0.0}, ConfigurationError, "a positive number"),
        ({"length": [1.0, 2.0]}, ShapeError, r"length has shape \(2,\)"),
        ({"optimise": False}, ConfigurationError, "length not given"),
        ({"restarts": -1}, ConfigurationError, "restarts is -1"),
    ],
)
def test_a_parameter_that_cannot_be_used_is_named(parameters, error, words):
    X, y = rows(10, seed=19)
    with pytest.raises(error, match=words):
        GaussianProcess(**parameters).fit(X, y)


def test_coinciding_rows_without_noise_are_refused():
    X, y = rows(10, seed=20)
    with pytest.raises(ObservabilityError, match="not positive definite"):
        GaussianProcess(length=1.0, amplitude=1.0, noise=0.0).fit(X[[*range(10), 3]], y[[0] * 11])


@pytest.mark.parametrize(
    ("weight", "variance"),
    [([-1.0] * 10, None), ([0.0] * 10, None), (None, [1.0]), (None, [-1.0] * 10)],
)
def test_weights_and_variances_that_cannot_be_are_refused(weight, variance):
    X, y = rows(10, seed=21)
    with pytest.raises((ShapeError, ValueError)):
        GaussianProcess().fit(X, y, weight, variance)
