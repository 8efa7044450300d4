"""Splits: every row held out once, none on both sides, each kind as it says."""

from __future__ import annotations

import numpy as np
import pytest
from validation_fakes import measured

from robotrue.errors import ShapeError
from robotrue.measurement.measurement_set import concatenate
from robotrue.validation.splits import (
    Split,
    contiguous_blocks,
    leave_one_set_out,
    random_folds,
    random_share,
    slabs,
    spatial_regions,
)


def all_splits():
    one, two = measured(31, seed=1), measured(24, seed=2)
    both = concatenate([one, two])
    return {
        "random": (random_folds(55, folds=5, seed=3), 55),
        "leave one out": (random_folds(7, folds=7), 7),
        "blocks": (contiguous_blocks(55, blocks=4), 55),
        "slabs": (slabs(one.position[:, 1], count=3), 31),
        "regions": (spatial_regions(both, count=4), 55),
        "sectors": (slabs(both.joints[:, 0]), 55),
        "sets": (leave_one_set_out(both), 55),
    }


@pytest.mark.parametrize("kind", list(all_splits()))
def test_every_row_is_held_out_exactly_once_and_never_trained_on(kind):
    splits, n = all_splits()[kind]
    for split in splits:
        assert len(np.intersect1d(split.train, split.test)) == 0
        assert np.array_equal(np.union1d(split.train, split.test), np.arange(n))
    assert np.array_equal(np.sort(np.concatenate([s.test for s in splits])), np.arange(n))


def test_random_share_holds_out_the_share_and_depends_on_the_seed():
    first, again, other = (random_share(50, test_share=0.2, seed=s) for s in (1, 1, 2))
    assert (len(first.train), len(first.test)) == (40, 10)
    assert np.array_equal(first.test, again.test)
    assert not np.array_equal(first.test, other.test)


def test_blocks_are_runs_of_rows():
    for split in contiguous_blocks(23, blocks=4):
        assert np.array_equal(np.diff(split.test), np.ones(len(split.test) - 1))


def test_regions_do_not_interleave_along_their_axis():
    poses = measured(40, seed=4)
    along = poses.position[:, 2]
    for split in slabs(along, count=4):
        inside = along[split.test]
        others = along[split.train]
        assert not ((others > inside.min()) & (others < inside.max())).any()


def test_sets_are_named_after_their_group():
    names = [s.name for s in leave_one_set_out(concatenate([measured(5), measured(6, seed=1)]))]
    assert names == ["sets set 1", "sets set 1"]


def test_regions_do_not_depend_on_the_frame():
    poses = measured(60, seed=5)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = type(poses)(
        joints=poses.joints, position=poses.position @ turn.T + 1.0, covariance=poses.covariance
    )
    for a, b in zip(spatial_regions(poses), spatial_regions(moved), strict=True):
        assert np.array_equal(a.test, b.test)


def test_impossible_splits_are_refused():
    with pytest.raises(ShapeError, match="8 parts of 5 rows, expected 2 to 5 parts"):
        contiguous_blocks(5, blocks=8)
    with pytest.raises(ShapeError, match="at least 2 sets, there is 1"):
        leave_one_set_out(measured(9))
    with pytest.raises(ShapeError, match="both train and test"):
        Split(name="bad", kind="random", train=np.array([0, 1]), test=np.array([1]))
    with pytest.raises(ShapeError, match="empty test part"):
        Split(name="bad", kind="random", train=np.array([0]), test=np.zeros(0, dtype=int))
