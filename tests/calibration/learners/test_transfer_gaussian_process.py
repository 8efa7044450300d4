from __future__ import annotations

import numpy as np
import pytest
from learners_rows import NOISE, kernel, rows, truth

from robotrue.calibration.learners import GaussianProcess, TransferGaussianProcess
from robotrue.calibration.learners.process import (
    centre_rows,
    left_out_rows,
    log_evidence,
    process_posterior,
)
from robotrue.errors import ConfigurationError, ShapeError

LENGTH, A, B, RHO, NOISE_T, NOISE_S = np.array([1.3, 3.0, 1.7, 6.0]), 1.2, 0.4, 0.7, 0.05, 0.1
THETA = np.array([*np.log(LENGTH), np.log(A), np.log(B), RHO, np.log(NOISE_T), np.log(NOISE_S)])


def covariance(X: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Written from the definition: rho times one process, plus another on target rows."""
    share = np.where(target, RHO, 1.0)
    common = A**2 * np.outer(share, share) + B**2 * np.outer(target, target)
    return kernel(X, X, LENGTH) * common


@pytest.fixture
def data():
    X, y = rows(30, seed=1)
    random = np.random.default_rng(1)
    return centre_rows(
        X,
        y,
        random.uniform(0.5, 2.0, 30),
        isotropic=False,
        mean="per-domain",
        prior=True,
        target=np.arange(30) >= 22,
    )


def test_evidence_is_that_of_the_covariance_written_out(data):
    X, y = data.inputs, data.outputs
    noise = np.where(data.target, NOISE_T, NOISE_S) ** 2 / data.weight
    K = covariance(X, data.target) + np.diag(noise)
    H = np.column_stack([~data.target, data.target]).astype(float)
    inner = H.T @ np.linalg.solve(K, H)
    P = np.linalg.inv(K) - np.linalg.solve(K, H) @ np.linalg.solve(inner, np.linalg.solve(K, H).T)
    logs = np.linalg.slogdet(K)[1] + np.linalg.slogdet(inner)[1] + 28 * np.log(2.0 * np.pi)
    expected = -0.5 * (np.trace(y.T @ P @ y) + 3 * logs)
    assert log_evidence(data, THETA)[0] == pytest.approx(expected)


def test_the_gradient_is_that_of_finite_differences(data):
    _, gradient = log_evidence(data, THETA)
    for k, axis in enumerate(1e-5 * np.eye(len(THETA))):
        slope = (log_evidence(data, THETA + axis)[0] - log_evidence(data, THETA - axis)[0]) / 2e-5
        assert gradient[k] == pytest.approx(slope, rel=1e-4, abs=1e-4)


def test_prediction_is_that_of_the_joint_normal_distribution(data):
    there, _ = rows(9, seed=2)
    wide = 1e3
    X = np.concatenate([data.inputs, there - data.centre])
    target = np.concatenate([data.target, np.ones(9, dtype=bool)])
    apart = np.equal.outer(target, target)
    K = covariance(X, target) + wide**2 * apart
    noise = np.where(data.target, NOISE_T, NOISE_S) ** 2 / data.weight
    trained = K[:30, :30] + np.diag(noise)
    near = K[30:, :30]
    mean, variance = process_posterior(data, THETA).mean_and_variance(there)
    np.testing.assert_allclose(mean, near @ np.linalg.solve(trained, data.outputs), atol=1e-4)
    left = K[30:, 30:] - near @ np.linalg.solve(trained, near.T)
    np.testing.assert_allclose(variance, left.diagonal(), atol=1e-4)
    np.testing.assert_allclose(process_posterior(data, THETA).covariance(there), left, atol=1e-4)


def test_left_out_target_rows_are_predicted_from_all_others(data):
    residual, variance = left_out_rows(data, THETA)
    assert residual.shape == (8, 3)
    K = covariance(data.inputs, data.target) + 1e6 * np.equal.outer(data.target, data.target)
    K += np.diag(np.where(data.target, NOISE_T, NOISE_S) ** 2 / data.weight)
    others = np.arange(30) != 24
    weights = np.linalg.solve(K[np.ix_(others, others)], K[others, 24])
    expected = data.outputs[24] - weights @ data.outputs[others]
    np.testing.assert_allclose(residual[2], expected, atol=1e-4)
    assert variance[2] == pytest.approx(K[24, 24] - weights @ K[others, 24], abs=1e-4)


SOURCES = {
    "scaled and offset": lambda y: 0.8 * y + 0.5,
    "mirrored": lambda y: -y,
}


@pytest.mark.parametrize("kind", SOURCES)
def test_a_related_source_helps_and_intervals_cover(kind):
    error, alone, covered = [], [], []
    for seed in range(4):
        X, y = rows(8, seed=seed)
        source, source_y = rows(80, seed=seed + 100)
        there, measured = rows(200, seed=seed + 200)
        model = TransferGaussianProcess().fit(
            X, y, X_source=source, y_source=SOURCES[kind](source_y)
        )
        mean, deviation = model.predict(there, return_std=True)
        assert model.used_source_
        assert abs(model.correlation_) > 0.95
        error.append(np.abs(mean - truth(there)).mean())
        covered.append((np.abs(measured - mean) < 1.96 * deviation).mean())
        only = GaussianProcess().fit(X, y).predict(there)
        alone.append(np.abs(only - truth(there)).mean())
    assert np.mean(error) < 0.25 * np.mean(alone)
    assert 0.88 < np.mean(covered) < 0.99


def test_a_source_of_noise_is_never_much_worse_than_the_target_alone():
    used = 0
    for seed in range(4):
        X, y = rows(30, seed=seed)
        source, source_y = rows(80, seed=seed + 100)
        wrong = np.random.default_rng(seed).permutation(source_y)
        there, _ = rows(200, seed=seed + 200)
        model = TransferGaussianProcess().fit(X, y, X_source=source, y_source=wrong)
        alone = GaussianProcess().fit(X, y)
        used += model.used_source_
        worse = np.abs(model.predict(there) - truth(there)).mean()
        assert worse < 1.15 * np.abs(alone.predict(there) - truth(there)).mean()
        pooled = GaussianProcess().fit(np.r_[X, source], np.r_[y, wrong])
        assert worse < 0.5 * np.abs(pooled.predict(there) - truth(there)).mean()
    assert used <= 2


def test_falling_back_is_the_plain_process():
    X, y = rows(40, seed=5)
    source, source_y = rows(60, seed=6)
    wrong = np.random.default_rng(5).permutation(source_y)
    model = TransferGaussianProcess().fit(X, y, X_source=source, y_source=wrong)
    assert not model.used_source_
    assert model.advantage_ < 0.0
    assert np.isnan(model.rho_)
    alone = GaussianProcess().fit(X, y)
    np.testing.assert_allclose(model.predict(X), alone.predict(X))
    for ask in ({"return_std": True}, {"return_cov": True}):
        for ours, plain in zip(model.predict(X, **ask), alone.predict(X, **ask), strict=True):
            np.testing.assert_allclose(ours, plain)
    forced = TransferGaussianProcess(fall_back=False).fit(X, y, X_source=source, y_source=wrong)
    assert forced.used_source_


def test_one_target_row_is_enough_with_a_source():
    source, source_y = rows(80, seed=7)
    X, y = rows(1, seed=8)
    there, _ = rows(100, seed=9)
    model = TransferGaussianProcess().fit(X, y + 0.4, X_source=source, y_source=source_y)
    error = np.abs(model.predict(there) - truth(there) - 0.4).mean()
    assert error < 4.0 * NOISE
    assert model.used_source_


def test_source_rows_that_do_not_match_are_refused():
    X, y = rows(6, seed=10)
    with pytest.raises(ShapeError, match="source rows have"):
        TransferGaussianProcess().fit(X, y, X_source=X[:, :3], y_source=y)
    with pytest.raises(ShapeError, match="X_source without y_source"):
        TransferGaussianProcess().fit(X, y, X_source=X)
    with pytest.raises(ShapeError, match="without X_source"):
        TransferGaussianProcess().fit(X, y, y_source=y)
    with pytest.raises(ConfigurationError, match="mean is 'estimated'"):
        TransferGaussianProcess(mean="estimated").fit(X, y)
