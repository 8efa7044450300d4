"""The square-root update against the textbook, whatever the order and the blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import arm

from robotrue.calibration.belief import (
    Belief,
    add_variance,
    condition,
    spread_columns,
    standard_terms,
    with_centres,
    with_harmonics,
    with_nuisances,
)
from robotrue.calibration.calibrated_model import model_of
from robotrue.calibration.model import require_belief
from robotrue.calibration.terms.smooth import SmoothBasis
from robotrue.errors import ConfigurationError

HARMONICS = 3


@pytest.fixture
def belief():
    rng = np.random.default_rng(3)
    robot = arm()
    size = len(robot.errors) + 2 * 6 * HARMONICS + 6
    return Belief(
        robot=robot,
        terms=standard_terms(6, np.arange(1.0, HARMONICS + 1.0)),
        mean=1e-4 * rng.standard_normal(size),
        root=1e-4 * rng.standard_normal((40, size)),
        white=2e-5,
        repeatability=2e-5,
        inflation=1.0,
        T_tracker_base={},
    )


@pytest.fixture
def rows(belief):
    rng = np.random.default_rng(4)
    columns = 1e4 * rng.standard_normal((70, len(belief.mean)))
    return columns, columns @ belief.mean + rng.standard_normal(70)


def test_update_is_that_of_kalman(belief, rows):
    columns, values = rows
    prior = belief.root.T @ belief.root
    gain = prior @ columns.T @ np.linalg.inv(columns @ prior @ columns.T + np.eye(70))
    after = condition(belief, columns, values)
    scale = np.sqrt(np.trace(prior))
    np.testing.assert_allclose(
        after.mean, belief.mean + gain @ (values - columns @ belief.mean), atol=1e-9 * scale
    )
    np.testing.assert_allclose(
        after.root.T @ after.root, prior - gain @ columns @ prior, atol=1e-9 * scale**2
    )


def test_block_by_block_is_all_at_once_in_any_order(belief, rows):
    columns, values = rows
    whole = condition(belief, columns, values)
    order = np.random.default_rng(5).permutation(70)
    parts = belief
    for block in np.array_split(order, 7):
        parts = condition(parts, columns[block], values[block])
    np.testing.assert_allclose(parts.mean, whole.mean, rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        parts.root.T @ parts.root, whole.root.T @ whole.root, rtol=0, atol=1e-15
    )


def test_covariance_never_grows_and_never_turns_indefinite(belief, rows):
    columns, values = rows
    after = condition(belief, 1e6 * columns, 1e6 * values)  # rows far better than the prior
    before = belief.root.T @ belief.root
    lost = np.linalg.eigvalsh(before - after.root.T @ after.root)
    assert lost.min() > -1e-12 * np.trace(before)
    assert (after.variance >= 0.0).all()


def test_widening_adds_variance_and_nothing_else(belief):
    extra = np.zeros(len(belief.mean))
    extra[::5] = 4e-8
    wide = add_variance(belief, extra)
    np.testing.assert_allclose(wide.variance, belief.variance + extra)
    np.testing.assert_array_equal(wide.mean, belief.mean)


def test_new_harmonics_leave_the_old_ones_where_they_belong(belief):
    more = with_harmonics(belief, HARMONICS + 2)
    place, old = more.place("ripple"), belief.place("ripple")
    waves = more.mean[place].reshape(6, HARMONICS + 2, 2)
    np.testing.assert_array_equal(waves[:, :HARMONICS], belief.mean[old].reshape(6, HARMONICS, 2))
    assert not waves[:, HARMONICS:].any()
    np.testing.assert_array_equal(more.mean[place.stop :], belief.mean[old.stop :])


def test_centres_and_nuisances_stand_at_the_end(belief):
    basis = SmoothBasis(centres=np.random.default_rng(6).random((4, 12)), scale=np.ones(12))
    wide = with_nuisances(with_centres(belief, basis), np.full(6, 0.1))
    smooth = wide.place("smooth")
    assert smooth.stop - smooth.start == 12
    assert wide.nuisances == 6
    np.testing.assert_allclose(wide.variance[wide.end :], 0.01)
    assert not wide.mean[smooth.start :].any()


def test_model_and_belief_are_two_forms_of_one_thing(belief):
    again = model_of(belief, {}).belief()
    np.testing.assert_array_equal(again.mean, belief.mean)
    np.testing.assert_allclose(again.root.T @ again.root, belief.root.T @ belief.root, atol=1e-20)
    tall = replace(belief, root=np.vstack([belief.root] * 9) / 3.0)  # more rows than columns
    square = model_of(tall, {})
    assert len(square.root) <= len(belief.mean)
    np.testing.assert_allclose(square.root.T @ square.root, belief.root.T @ belief.root, atol=1e-18)


@pytest.mark.parametrize("places", [[], [0, 1, 2], [1, 2, 4, 7], [5, 6, 0], [2, 3, 2]])
def test_columns_are_spread_over_their_places_by_runs(places):
    root = np.random.default_rng(1).standard_normal((4, len(places)))
    expected = np.zeros((4, 8))
    for column, place in enumerate(places):
        expected[:, place] = root[:, column]
    np.testing.assert_array_equal(spread_columns(root, np.array(places, int), 8), expected)


def test_a_model_keeps_the_root_made_for_it_without_a_copy(belief):
    model = model_of(belief, {})
    assert model.root.base is None
    assert not model.root.flags.writeable
    assert not np.shares_memory(model.root, belief.root)


def test_a_model_without_joint_covariance_is_refused():
    class Poses:
        def belief(self):
            return None

    with pytest.raises(ConfigurationError, match="a Poses has no covariance"):
        require_belief(Poses())
