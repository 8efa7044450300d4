"""Statistics against numbers worked by hand; coverage against its own binomial error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from robotrue.errors import ShapeError
from robotrue.validation.metrics import (
    chi2_quantile,
    coverage,
    coverage_probability,
    error_statistics,
    log_density,
    wilson_interval,
)


def test_statistics_of_four_vectors_by_hand():
    result = error_statistics(
        np.array([[3e-4, 4e-4, 0.0], [0.0, 0.0, -1e-3], [1e-3, 0.0, 0.0], [0.0, 5e-4, 0.0]])
    )
    # Lengths 0.5, 1, 1, 0.5 mm.
    assert result.n == 4
    assert result.mean == pytest.approx(0.75e-3)
    assert result.max == pytest.approx(1e-3)
    assert result.p95 == pytest.approx(1e-3)
    assert result.std == pytest.approx(0.25e-3 * np.sqrt(4 / 3))
    assert result.rms == pytest.approx(np.sqrt(0.625) * 1e-3)
    assert result.three_sigma == pytest.approx(result.mean + 3 * result.std)
    assert result.axis_mean == pytest.approx([3.25e-4, 2.25e-4, -2.5e-4])
    assert result.axis_max == pytest.approx([1e-3, 5e-4, 1e-3])


def test_one_point_has_no_spread():
    assert error_statistics(np.array([[1e-3, 0.0, 0.0]])).std == 0.0


def test_no_points_and_nan_are_refused():
    with pytest.raises(ShapeError, match="no points"):
        error_statistics(np.zeros((0, 3)))
    with pytest.raises(ShapeError, match="finite"):
        error_statistics(np.array([[np.nan, 0.0, 0.0]]))


@pytest.mark.parametrize("level", [0.5, 0.9, 0.95, 0.99])
def test_exact_gaussians_are_covered_at_the_stated_level(level):
    rng = np.random.default_rng(11)
    n = 20_000
    factor = rng.normal(size=(n, 3, 3)) * 1e-4 + np.eye(3) * 5e-5
    covariance = factor @ np.swapaxes(factor, 1, 2) + 1e-10 * np.eye(3)
    residual = (np.linalg.cholesky(covariance) @ rng.normal(size=(n, 3, 1)))[..., 0]
    result = coverage(residual, covariance, level)
    error = np.sqrt(level * (1 - level) / n)
    assert abs(result.share - level) < 4 * error
    assert np.all(np.abs(result.axis_share - level) < 4 * error)
    assert result.low < result.share < result.high


def test_claims_half_as_large_are_caught():
    rng = np.random.default_rng(12)
    residual = rng.normal(0, 1e-4, (300, 3))
    tight = coverage(residual, np.tile(0.25e-8 * np.eye(3), (300, 1, 1)))
    loose = coverage(residual, np.tile(4e-8 * np.eye(3), (300, 1, 1)))
    assert tight.share < 0.6
    assert not tight.is_honest
    assert loose.share > 0.99
    assert not loose.is_honest


def test_coverage_probability_is_uniform_for_honest_covariances():
    rng = np.random.default_rng(13)
    residual = rng.normal(0, 1e-4, (2000, 3))
    probability = coverage_probability(residual, np.tile(1e-8 * np.eye(3), (2000, 1, 1)))
    assert stats.kstest(probability, "uniform").pvalue > 0.01


def test_log_density_agrees_with_scipy():
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]]) * 1e-8
    residual = np.array([[1e-4, -2e-4, 0.5e-4]])
    expected = stats.multivariate_normal(np.zeros(3), covariance).logpdf(residual[0])
    assert log_density(residual, covariance[None])[0] == pytest.approx(expected, rel=1e-12)


def test_wilson_interval_against_the_printed_formula_and_the_ends():
    low, high = wilson_interval(17, 20)
    z, p, n = 1.959963984540054, 0.85, 20
    centre, half = (p + z * z / 40) / (1 + z * z / n), z * np.sqrt(p * 0.15 / n + z * z / 1600)
    assert low == pytest.approx(centre - half / (1 + z * z / n), rel=1e-12)
    assert high == pytest.approx(centre + half / (1 + z * z / n), rel=1e-12)
    assert wilson_interval(10, 10)[1] == pytest.approx(1.0, abs=1e-12)
    assert wilson_interval(0, 10)[0] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ShapeError, match="11 of 10 points"):
        wilson_interval(11, 10)


def test_chi_square_quantile_as_tabulated():
    assert chi2_quantile(0.95, 3) == pytest.approx(7.8147, abs=5e-5)


def test_a_flat_covariance_is_named():
    flat = np.tile(1e-8 * np.eye(3), (4, 1, 1))
    flat[2, 2, 2] = 0.0
    with pytest.raises(ShapeError, match="covariance of row 2 is not positive definite"):
        coverage(np.zeros((4, 3)), flat)
