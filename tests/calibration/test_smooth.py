"""The smooth residual: its evidence against scikit-learn, its centres against the full kernel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from robotrue.calibration.learners.process import centre_rows, log_evidence
from robotrue.calibration.terms.smooth import (
    SmoothBasis,
    choose_centres,
    features,
    learn_smooth,
    unit_kernel,
)

sklearn = pytest.importorskip("sklearn.gaussian_process")
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel  # noqa: E402

LENGTH = np.array([0.6, 1.5, 3.0, 0.8, 2.0, 4.0])


@pytest.fixture(scope="module")
def joints():
    return np.random.default_rng(8).uniform(-1.0, 1.0, (120, 3))


def evidence_of(x, y):
    data = centre_rows(x, y, np.ones(len(x)), isotropic=False, mean="zero", prior=False)
    return lambda scales: log_evidence(data, scales)


def test_evidence_and_gradient_equal_scikit_learn(joints):
    values = np.random.default_rng(9).standard_normal((120, 1))
    amplitude, noise = 0.7, 0.4
    kernel = ConstantKernel(amplitude**2) * RBF(LENGTH) + WhiteKernel(noise**2)
    process = sklearn.GaussianProcessRegressor(kernel, alpha=0.0, optimizer=None)
    process.fit(features(joints), values[:, 0])
    expected, slope = process.log_marginal_likelihood(kernel.theta, eval_gradient=True)
    scales = np.log([*LENGTH, amplitude, noise])
    value, gradient = evidence_of(features(joints), values)(scales)
    assert value == pytest.approx(expected, rel=1e-10)
    # scikit-learn differentiates by the logarithm of variances, half of ours.
    by_variance = np.concatenate([[gradient[-2] / 2], gradient[:-2], [gradient[-1] / 2]])
    np.testing.assert_allclose(by_variance, slope, rtol=1e-7, atol=1e-7)


def test_gradient_of_three_axes_equals_differences(joints):
    values = np.random.default_rng(10).standard_normal((120, 3))
    scales = np.log([*LENGTH, 0.7, 0.4])
    x = features(joints)
    evidence = evidence_of(x, values)
    _, gradient = evidence(scales)
    slope = approx_fprime(scales, lambda s: evidence(s)[0], 1e-6)
    np.testing.assert_allclose(gradient, slope, rtol=1e-4, atol=1e-3)


def test_noise_alone_gives_no_evidence(joints):
    values = 1e-5 * np.random.default_rng(11).standard_normal((120, 3))
    assert learn_smooth(joints, values).gain < 3.0


def test_smooth_field_is_found(joints):
    field = 5e-5 * np.stack([np.sin(2 * joints[:, 0]), joints[:, 1] ** 2, joints[:, 2]], axis=1)
    values = field + 1e-5 * np.random.default_rng(12).standard_normal((120, 3))
    found = learn_smooth(joints, values)
    assert found.gain > 100.0
    assert found.noise == pytest.approx(1e-5, rel=0.2)


def test_all_poses_as_centres_carry_the_whole_kernel(joints):
    basis = choose_centres(joints, LENGTH, most=120, enough=1e-7)
    carried = basis.columns(joints)
    scaled = features(joints) / LENGTH
    np.testing.assert_allclose(carried @ carried.T, unit_kernel(scaled, scaled), atol=1e-5)


def test_centres_leave_no_more_than_stated(joints):
    basis = choose_centres(joints, LENGTH, most=120, enough=0.05)
    assert len(basis.centres) < 120
    assert (1.0 - (basis.columns(joints) ** 2).sum(axis=1)).max() <= 0.05 + 1e-6


def test_table_weights_give_the_same_mean(joints):
    basis = choose_centres(joints, LENGTH, most=30, enough=0.0)
    weights = np.random.default_rng(13).standard_normal((len(basis.centres), 3))
    table = basis.table_weights(weights)
    scaled = features(joints) * basis.scale
    direct = unit_kernel(scaled, basis.centres) @ table
    np.testing.assert_allclose(direct, basis.columns(joints) @ weights, atol=1e-8)
    assert isinstance(basis, SmoothBasis)
