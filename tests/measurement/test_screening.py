"""Odd rows are found, named and counted; good rows stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.errors import ImplausibleDataError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.measurement.screening import screen

SIGMA = 5e-5


def planted(n: int = 200, seed: int = 1) -> tuple[MeasurementSet, Array, Array]:
    rng = np.random.default_rng(seed)
    covariance = np.tile(np.diag([1.0, 4.0, 9.0]) * SIGMA**2, (n, 1, 1))
    residuals = rng.normal(size=(n, 3)) * [SIGMA, 2 * SIGMA, 3 * SIGMA]
    m = MeasurementSet(
        joints=rng.uniform(-1, 1, (n, 6)),
        position=rng.normal(size=(n, 3)) + residuals,
        covariance=covariance,
        group_names=("grid",),
        sources=("grid.csv sha256:ab",),
    )
    return m, residuals, covariance


def test_clean_rows_stay() -> None:
    result = screen(*planted())
    assert result.kept.all()
    assert result.findings == ()
    np.testing.assert_allclose(result.scale, 1.0, atol=0.2)


def test_outlier_is_named() -> None:
    m, residuals, covariance = planted()
    residuals = residuals.copy()
    residuals[17] = [0.0, 0.0, 2.1e-3]
    result = screen(m, residuals, covariance)
    assert np.flatnonzero(~result.kept).tolist() == [17]
    (finding,) = result.findings
    assert (finding.group, finding.source, finding.line) == ("grid", "grid.csv", 18)
    assert finding.dropped
    assert str(finding).startswith("grid.csv:18: residual 2.100 mm, 1")
    assert str(finding).endswith(" sigma (limit 6)")


def test_model_error_widens_the_scale() -> None:
    m, residuals, covariance = planted()
    result = screen(m, residuals * 20.0, covariance)
    assert result.kept.all()
    np.testing.assert_allclose(result.scale, 20.0, rtol=0.2)


def test_each_group_has_its_own_middle() -> None:
    first, second = planted(seed=1), planted(seed=2)
    m = concatenate([first[0], replace(second[0], sources=("night.csv sha256:cd",))])
    residuals = np.concatenate([first[1], second[1] + [0.01, 0.0, 0.0]])
    covariance = np.concatenate([first[2], second[2]])
    assert screen(m, residuals, covariance).kept.all()
    residuals[250] += [0.002, 0.0, 0.0]
    (finding,) = screen(m, residuals, covariance).findings
    assert (finding.source, finding.line) == ("night.csv", 51)


def test_exact_repeat_is_dropped_and_unlike_repeat_reported() -> None:
    m, residuals, covariance = planted()
    rows = [*range(200), 3, 5]
    m, residuals, covariance = m.subset(rows), residuals[rows], covariance[rows]
    position = m.position.copy()
    position[201] += [0.0, 0.004, 0.0]
    result = screen(replace(m, position=position), residuals, covariance)
    assert np.flatnonzero(~result.kept).tolist() == [200]
    assert [f.reason.split(" (")[0] for f in result.findings] == [
        "the same as line 4 to the last digit",
        "the pose of line 6 again, 4.000 mm apart",
    ]
    assert [f.dropped for f in result.findings] == [True, False]


def test_too_many_odd_rows_raise() -> None:
    m, residuals, covariance = planted()
    residuals = residuals.copy()
    residuals[:10] += 0.005
    with pytest.raises(ImplausibleDataError) as caught:
        screen(m, residuals, covariance)
    assert str(caught.value).startswith(
        "grid.csv:1: 10 of 200 rows are odd, at most 2.0% may be dropped. First: grid.csv:1: res"
    )
    assert (~screen(m, residuals, covariance, most=0.05).kept).sum() == 10


def test_shapes_are_checked() -> None:
    m, residuals, covariance = planted()
    with pytest.raises(ShapeError, match="residuals has shape"):
        screen(m, residuals[:5], covariance)
    with pytest.raises(ShapeError, match="not positive definite"):
        screen(m, residuals, -covariance)
