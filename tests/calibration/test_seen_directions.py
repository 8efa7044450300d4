"""Learning in the directions that the rows show gives the posterior of all weights."""

import numpy as np
import pytest

from robotrue.calibration import scale_learning
from robotrue.calibration.evidence import PriorGroup, sums_of
from robotrue.calibration.scale_learning import find_scales
from robotrue.calibration.seen_directions import find_seen

CYCLES = 30
TURNED = 0.6  # rad, range of the joint


@pytest.fixture(scope="module")
def problem():
    """Waves on a joint that moved through a tenth of a turn, and two plain columns."""
    rng = np.random.default_rng(5)
    phase = rng.uniform(0.0, TURNED, 400)[:, None] * np.arange(1.0, CYCLES + 1.0)
    columns = np.hstack([rng.normal(size=(400, 2)), np.sin(phase), np.cos(phase)])
    truth = np.concatenate([[2.0, -1.0], 0.5 * rng.normal(size=2 * CYCLES)])
    values = columns @ truth + rng.normal(size=400)
    groups = [
        PriorGroup(name="plain", columns=np.arange(2), sd=3.0),
        PriorGroup(name="waves", columns=np.arange(2, columns.shape[1]), sd=0.2, rest=1e-3),
    ]
    return [sums_of([(columns, values, 400.0)], columns.shape[1])], groups, columns


def test_a_joint_that_moved_little_shows_few_of_its_waves(problem):
    channels, groups, columns = problem
    seen = find_seen(channels, groups, np.ones(1))
    assert seen is not None
    assert 2 + CYCLES // 5 < seen.turns[-1].place.stop < columns.shape[1] // 2
    assert find_seen(channels, groups[:1], np.ones(1)) is not None  # a weight in no group


def test_columns_that_rows_show_one_by_one_stay_as_they_are(problem):
    columns = problem[2][:, :2]
    channels = [sums_of([(columns, columns.sum(axis=1), 400.0)], 2)]
    assert find_seen(channels, problem[1][:1], np.ones(1)) is None


def test_the_posterior_is_that_of_all_weights(problem, monkeypatch):
    channels, groups, columns = problem
    less = find_scales(channels, groups, np.ones(1), steps=12)
    monkeypatch.setattr(scale_learning, "find_seen", lambda *_: None)
    whole = find_scales(channels, groups, np.ones(1), steps=12)
    assert less.steps == whole.steps
    np.testing.assert_allclose(less.evidence, whole.evidence, atol=1e-2)
    np.testing.assert_allclose(less.noise, whole.noise, rtol=1e-4)
    np.testing.assert_allclose(less.scale("waves"), whole.scale("waves"), rtol=1e-3)
    np.testing.assert_allclose(columns @ less.mean, columns @ whole.mean, atol=1e-3)
    spread = [(w.root**2).sum(axis=0) for w in (less, whole)]
    np.testing.assert_allclose(*spread, rtol=5e-3)  # also of waves that no row shows
