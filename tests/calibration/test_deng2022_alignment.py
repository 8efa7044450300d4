from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.deng2022.alignment import (
    RIDGES,
    align,
    carry_source,
    design,
    leave_one_out,
    measurement_weights,
    ridge_solution,
    row_transform,
    turned_labels,
    weighted_columns,
)
from robotrue.calibration.deng2022.domains import turned_features
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError

ANGLE = 25 * DEG


@pytest.fixture
def cloud():
    rng = np.random.default_rng(3)
    features = np.column_stack(
        [
            rng.uniform([0.7, -0.7, 0.7], [1.1, -0.5, 1.2], (126, 3)),
            rng.uniform(-0.2, 0.2, (126, 3)),
        ]
    )
    errors = 1e-3 * np.column_stack(
        [features[:, 0] - 0.4, np.sin(3 * features[:, 1]), features[:, 2] ** 2]
    )
    return features, errors


def test_least_squares_t_is_the_transpose_of_eq_11(cloud):
    features, _ = cloud
    points = features[:16, :3]
    image = turned_features(features[:16], ANGLE, "turning")[:, :3]
    keywords = {"source": features[:, :3], "mapped_source": points, "mapped_target": image}
    known = row_transform("known-angle", ANGLE, **keywords)
    fitted = row_transform("least-squares", 0.0, **keywords)
    np.testing.assert_allclose(fitted, known, atol=1e-11)
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    eq_11 = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(fitted.T, eq_11, atol=1e-11)


def test_literal_t_cannot_be_multiplied_and_says_why(cloud):
    features, _ = cloud
    with pytest.raises(ShapeError, match=r"X_sd' \(4 x 126.*16 x 4.*not conformable"):
        row_transform(
            "literal",
            ANGLE,
            source=features[:, :3],
            mapped_source=features[:16, :3],
            mapped_target=features[:16, :3],
        )


def test_points_in_a_plane_do_not_determine_t(cloud):
    flat = cloud[0][:16, :3].copy()
    flat[:, 2] = 0.9
    with pytest.raises(ObservabilityError, match="in a plane"):
        row_transform("least-squares", ANGLE, source=flat, mapped_source=flat, mapped_target=flat)


def test_omega_m_on_output_columns_does_not_change_h(cloud):
    D = design(*(a[:16] for a in cloud), "positions")
    Y = cloud[1][16:32] / MM
    centre = np.zeros((7, 3))
    plain = ridge_solution(D, Y, 1e-3)
    weighted = weighted_columns(D, Y, 1e-3, np.array([40.0, 3.0, 0.2]), centre)
    np.testing.assert_allclose(weighted, plain, rtol=0.0, atol=1e-13 * np.abs(plain).max())


def test_a_column_of_weight_zero_stays_at_the_centre(cloud):
    D = design(*(a[:16] for a in cloud), "positions")
    centre = turned_labels(ANGLE, "positions")
    got = weighted_columns(D, cloud[1][:16] / MM, 1.0, np.array([1.0, 0.0, 1.0]), centre)
    np.testing.assert_array_equal(got[:, 1], centre[:, 1])
    assert np.abs(got[:, 0] - centre[:, 0]).max() > 1e-4


@pytest.mark.parametrize("ridge", [1e-4, 1.0, 100.0])
@pytest.mark.parametrize("weighted", [False, True])
def test_leave_one_out_equals_brute_force(cloud, ridge, weighted):
    D = design(*(a[:16] for a in cloud), "pose")
    Y = cloud[1][20:36] / MM
    rows = np.linspace(0.5, 2.0, 16) if weighted else None
    centre = turned_labels(ANGLE, "pose")
    brute = 0.0
    for k in range(16):
        left = np.arange(16) != k
        some = None if rows is None else rows[left]
        H = ridge_solution(D[left], Y[left], ridge, rows=some, centre=centre)
        brute += (1.0 if rows is None else rows[k]) * np.sum((Y[k] - D[k] @ H) ** 2)
    found = leave_one_out(D, Y, ridge, rows=rows, centre=centre)
    assert found == pytest.approx(brute, rel=1e-6)


def _aligned(cloud, readings, count=16):
    features, errors = cloud
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    there = errors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    mapped = np.arange(0, 126, 126 // count)[:count]
    found = align(
        readings,
        ANGLE,
        source=features,
        source_errors=errors,
        mapped=mapped,
        target=turned_features(features, ANGLE, readings.attitude)[mapped],
        target_errors=there[mapped],
        covariance=np.tile((20 * UM) ** 2 * np.eye(3), (count, 1, 1)),
        distance=np.zeros(count),
    )
    moved, carried = carry_source(found, readings, features, errors)
    return found, moved, np.abs(carried - there).max()


def test_errors_that_turn_with_the_pose_are_carried(cloud):
    found, moved, away = _aligned(cloud, DengReadings())
    assert away < 1e-6
    assert found.ridge in RIDGES
    np.testing.assert_allclose(moved, turned_features(cloud[0], ANGLE, "turning"), atol=1e-14)


def test_a_large_lambda_shrinks_to_no_error_or_to_the_rotation(cloud):
    strong = {"ridge": "fixed", "ridge_value": 1e12}
    _, _, zero = _aligned(cloud, DengReadings(**strong, shrink_to="zero"))
    _, _, rotation = _aligned(cloud, DengReadings(**strong, shrink_to="rotation"))
    assert zero == pytest.approx(np.abs(cloud[1]).max(), rel=0.5)
    assert rotation < 1e-9


def test_a_fixed_attitude_is_not_turned(cloud):
    _, moved, _ = _aligned(cloud, DengReadings(attitude="fixed", transform="least-squares"))
    np.testing.assert_array_equal(moved[:, 3:], cloud[0][:, 3:])


def test_measurement_weights_vanish_below_the_trackers_deviation():
    covariance = np.tile(np.diag([1e-10, 1e-10, 1e-10]), (2, 1, 1))
    errors = np.array([[1e-3, -5e-6, 2e-5], [0.0, 1e-5, 1e-4]])
    got = measurement_weights(errors, covariance)
    np.testing.assert_allclose(got, [[100.0, 0.0, 2.0], [0.0, 0.0, 10.0]], rtol=1e-12)


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"transform": "printed"}, "transform 'printed'"),
        ({"rounds": 0}, "0 boosting rounds"),
        ({"ridge_value": -1.0}, "ridge_value -1.0"),
        ({"overlap_weight": 0.0}, "overlap_weight 0.0"),
        ({"length": 0.0}, "length 0.0 mm"),
        ({"kernel_rows": 5}, "kernel_rows 5"),
    ],
)
def test_readings_that_mean_nothing_are_refused(values, match):
    with pytest.raises(ConfigurationError, match=match):
        DengReadings(**values)
