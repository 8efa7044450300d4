from __future__ import annotations

import numpy as np
import pytest
from learners_rows import NOISE, rows, truth
from sklearn.linear_model import Ridge

from robotrue.calibration.learners import GaussianProcess, TrAdaBoostR2
from robotrue.calibration.learners.tradaboost import weighted_median
from robotrue.errors import ConfigurationError, ShapeError

N, M = 30, 12
RIDGE = Ridge(alpha=1e-3)
READINGS = ("frozen", "literal", "pardoe", "decay")


@pytest.fixture(scope="module")
def domains():
    source, source_y = rows(N, seed=1)
    X, y = rows(M, seed=2)
    y[3] += 6.0  # one row far off, so that all others have small relative errors
    return X, y, source, 1.2 * source_y + 0.3


def by_hand(X, y, source, source_y, reading, over, rounds, omega):
    """Equations 19 to 24 written row by row."""
    inputs, outputs = np.r_[source, X], np.r_[source_y, y]
    weight = [1.0 / (N + M)] * (N + M)
    beta_s = 1.0 / (1.0 + (2.0 * np.log(N) / rounds) ** 0.5)
    models, betas, weights = [], [], []
    for _ in range(rounds):
        weights.append(weight)
        model = Ridge(alpha=1e-3).fit(inputs, outputs, np.array(weight) * (N + M))
        miss = [
            np.sqrt(sum((omega[c] * (outputs[i, c] - p[c])) ** 2 for c in range(3)))
            for i, p in enumerate(model.predict(inputs))
        ]
        largest = max(miss) if reading == "pardoe" else max(miss[N:])
        e = [min(1.0, value / largest) for value in miss]
        epsilon = sum(e[i] * weight[i] for i in range(N, N + M))
        if over == "target":
            epsilon /= sum(weight[N:])
        if epsilon > 0.5:
            break
        beta = epsilon / (1.0 - epsilon)
        models.append(model)
        betas.append(beta)
        new = list(weight)
        for i in range(N, N + M):
            power = -e[i] if reading == "pardoe" else 1.0 - e[i]
            new[i] = weight[i] * beta**power
        if reading == "frozen":
            ratio = sum(weight[N:]) / sum(new[N:])
            new[N:] = [ratio * value for value in new[N:]]
        for i in range(N):
            if reading == "literal":
                new[i] = np.log(1.0 / beta)
            elif reading in ("pardoe", "decay"):
                new[i] = weight[i] * beta_s ** e[i]
        weight = [value / sum(new) for value in new]
    return models, np.array(betas), np.array(weights[: len(betas)])


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("over", ["target", "all"])
@pytest.mark.parametrize("combination", ["weighted-median", "literal"])
def test_every_reading_is_its_equations_written_by_hand(domains, reading, over, combination):
    X, y, source, source_y = domains
    omega = [2.0, 1.0, 0.5]
    models, betas, weights = by_hand(X, y, source, source_y, reading, over, 5, omega)
    assert len(models) >= 2
    found = TrAdaBoostR2(
        RIDGE,
        rounds=5,
        source_weights=reading,
        error_over=over,
        combination=combination,
        output_weights=omega,
    ).fit(X, y, X_source=source, y_source=source_y)
    np.testing.assert_allclose(found.betas_, betas)
    np.testing.assert_allclose(found.weights_, weights)
    there, _ = rows(20, seed=3)
    each = np.stack([model.predict(there) for model in models])
    logs = np.log(1.0 / betas)
    if combination == "literal":
        expected = logs.sum() * np.median(betas[:, None, None] * each, axis=0)
    else:
        expected = np.empty((20, 3))
        for i in range(20):
            for c in range(3):
                order = np.argsort(each[:, i, c])
                reached = np.cumsum(logs[order]) >= 0.5 * logs.sum()
                expected[i, c] = each[order[np.argmax(reached)], i, c]
    np.testing.assert_allclose(found.predict(there), expected)


def test_measurement_weights_of_each_row_take_the_place_of_three_numbers(domains):
    X, y, source, source_y = domains
    given = {"X_source": source, "y_source": source_y}
    omega = np.array([2.0, 1.0, 0.5])
    same = TrAdaBoostR2(RIDGE, rounds=4, source_weights="pardoe", output_weights=omega).fit(
        X, y, **given
    )
    rows = {"error_weights": np.tile(omega, (M, 1)), "source_error_weights": np.tile(omega, (N, 1))}
    each = TrAdaBoostR2(RIDGE, rounds=4, source_weights="pardoe").fit(X, y, **given, **rows)
    np.testing.assert_allclose(each.weights_, same.weights_)
    rows["error_weights"] = np.tile(omega, (M, 1)) * (np.arange(M) != 3)[:, None]
    blind = TrAdaBoostR2(RIDGE, rounds=4).fit(X, y, **given, error_weights=rows["error_weights"])
    predicted = blind.estimators_[0].predict(X)
    missed = np.linalg.norm(rows["error_weights"] * (y - predicted), axis=1)
    assert missed[3] == 0.0
    assert blind.errors_[0] == pytest.approx(np.mean(missed / missed.max()))
    with pytest.raises(ShapeError, match=r"error weights of shape \(3,\), expected \(12, 3\)"):
        TrAdaBoostR2(RIDGE).fit(X, y, error_weights=omega)


def test_what_the_printed_equations_do_and_why_they_are_not_the_default(domains):
    X, y, source, source_y = domains
    given = {"X_source": source, "y_source": source_y}
    printed = TrAdaBoostR2(source_weights="literal", error_over="all").fit(X, y, **given)
    share = printed.weights_[1]
    assert share[:N].min() > 20.0 * share[N:].max()  # eq. 24: source rows outweigh the target
    np.testing.assert_allclose(share[:N], share[0])  # whatever their error
    assert printed.errors_[0] < M / (N + M) < 0.5  # eq. 22: the limit of 0.5 is out of reach
    right = TrAdaBoostR2().fit(X, y, **given)
    scaled = TrAdaBoostR2(combination="literal").fit(X, y, **given)
    there, _ = rows(50, seed=3)
    ratio = np.median(scaled.predict(there) / right.predict(there))
    assert abs(ratio - 1.0) > 0.3  # eq. 25: another scale than that of the outputs


def test_overlap_weights_are_the_initial_weights(domains):
    X, y, source, source_y = domains
    inside = np.where(np.arange(M) < 4, 3.0, 1.0)
    found = TrAdaBoostR2(RIDGE, rounds=1).fit(X, y, inside, source, source_y)
    expected = np.r_[np.ones(N), inside]
    np.testing.assert_allclose(found.weights_[0], expected / expected.sum())


def test_one_kernel_for_all_rounds_is_the_same_as_fits_with_held_hyper_parameters(domains):
    X, y, source, source_y = domains
    held = GaussianProcess(length=2.0, amplitude=1.5, noise=0.1)
    there, _ = rows(50, seed=4)
    quick, slow = (
        TrAdaBoostR2(held, rounds=6, hyper_parameters=how)
        .fit(X, y, X_source=source, y_source=source_y)
        .predict(there, return_std=True)
        for how in ("first-round", "each-round")
    )
    np.testing.assert_allclose(quick, slow, atol=1e-8)


def test_separate_outputs_are_combined_alike(domains):
    X, y, source, source_y = domains
    base = GaussianProcess(shared=False)
    model = TrAdaBoostR2(base, rounds=3).fit(X, y, X_source=source, y_source=source_y)
    each = np.stack([e.predict(X) for e in model.estimators_])
    expected = weighted_median(each, np.log(1.0 / model.betas_))
    np.testing.assert_allclose(model.predict(X), expected, atol=1e-9)


def test_a_source_like_the_target_helps():
    X, y = rows(M, seed=2)
    source, source_y = rows(100, seed=5)
    there, measured = rows(300, seed=6)
    model = TrAdaBoostR2().fit(X, y, X_source=source, y_source=source_y)
    mean, deviation = model.predict(there, return_std=True)
    error = np.abs(mean - truth(there)).mean()
    assert error < 1.5 * NOISE
    assert error < 0.2 * np.abs(GaussianProcess().fit(X, y).predict(there) - truth(there)).mean()
    assert 0.9 < (np.abs(measured - mean) < 1.96 * deviation).mean() <= 1.0


def test_a_learner_without_error_ends_the_rounds():
    X = np.linspace(0.0, 1.0, 9)[:, None]
    model = TrAdaBoostR2(Ridge(alpha=0.0), rounds=5).fit(X, np.zeros(9))
    assert len(model.estimators_) == 1
    np.testing.assert_allclose(model.predict(X), 0.0)


def test_the_weighted_median_is_the_value_at_half_of_the_weight():
    values = np.array([[3.0], [1.0], [2.0]])
    assert weighted_median(values, np.array([1.0, 1.0, 1.0]))[0] == 2.0
    assert weighted_median(values, np.array([5.0, 1.0, 1.0]))[0] == 3.0
    assert weighted_median(values, np.array([1.0, 5.0, 1.0]))[0] == 1.0


@pytest.mark.parametrize(
    ("parameters", "error"),
    [
        ({"source_weights": "constant"}, ConfigurationError),
        ({"combination": "mean"}, ConfigurationError),
        ({"rounds": 0}, ConfigurationError),
        ({"output_weights": [1.0, 1.0]}, ShapeError),
        ({"output_weights": [1.0, -1.0, 1.0]}, ShapeError),
    ],
)
def test_a_parameter_that_cannot_be_used_is_refused(domains, parameters, error):
    X, y, *_ = domains
    with pytest.raises(error):
        TrAdaBoostR2(**parameters).fit(X, y)
