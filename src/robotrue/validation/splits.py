"""Ways to hold out poses, each for another question.

A random split tests the interpolation of a model between training neighbours; blocks of rows test
its robustness to drift and order; regions test its extrapolation; sets test its transfer to another
campaign. On one measured arm the same model scores 0.15 mm on a random split and 0.87 mm on a
region split: print both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.errors import ShapeError
from robotrue.measurement.measurement_set import MeasurementSet

SplitKind: TypeAlias = Literal["random", "blocks", "regions", "sets"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Split(Columns):
    """Rows to fit on and rows held out.

    Attributes:
        name: E.g. ``"blocks 2/5"``.
        kind: What the split tests.
        train: (k,) row indices, ascending.
        test: (m,) row indices, ascending; disjoint from ``train``.
    """

    name: str
    kind: SplitKind
    train: Annotated[IntArray, Column("_")]
    test: Annotated[IntArray, Column("_")]

    def _check_rules(self) -> None:
        """Both parts need rows, and share none."""
        for name in ("train", "test"):
            if not len(getattr(self, name)):
                raise ShapeError(
                    f"split {self.name!r} has an empty {name} part.",
                    hint="fewer folds, or more poses.",
                )
        if len(np.intersect1d(self.train, self.test)):
            raise ShapeError(f"split {self.name!r}: a row is in both train and test.")

    def mask_left_out(self, rows: int) -> BoolArray:
        """Returns a mask (rows,) of all rows but those to fit on."""
        left_out = np.ones(rows, dtype=bool)
        left_out[self.train] = False
        return left_out


def random_folds(n: int, *, folds: int = 5, seed: int = 0) -> tuple[Split, ...]:
    """Returns ``folds`` random splits that together hold out every row once.

    With ``folds`` equal to ``n`` this is leave-one-out.

    Raises:
        ShapeError: Fewer rows than folds, or fewer than two folds.
    """
    _check_folds(n, folds)
    label = np.empty(n, dtype=np.int64)
    label[np.random.default_rng(seed).permutation(n)] = np.arange(n) % folds
    return _by_label(label, "random")


def random_share(n: int, *, test_share: float = 0.2, seed: int = 0) -> Split:
    """Returns one random split with ``test_share`` of the rows held out (80/20 by default).

    Raises:
        ShapeError: A part would be empty.
    """
    held = round(n * test_share)
    order = np.random.default_rng(seed).permutation(n)
    return Split(
        name=f"random {100 * (1 - test_share):.0f}/{100 * test_share:.0f}, seed {seed}",
        kind="random",
        train=np.sort(order[held:]),
        test=np.sort(order[:held]),
    )


def contiguous_blocks(n: int, *, blocks: int = 5) -> tuple[Split, ...]:
    """Returns splits that hold out one run of consecutive rows each.

    Raises:
        ShapeError: Fewer rows than blocks, or fewer than two blocks.
    """
    _check_folds(n, blocks)
    return _by_label(np.arange(n) * blocks // n, "blocks")


def slabs(values: Array, *, count: int = 3) -> tuple[Split, ...]:
    """Returns splits that hold out one slab of equal row count along a scalar each.

    Args:
        values: (n,) what to sort by: one coordinate, or joint 1.
        count: Number of slabs.

    Raises:
        ShapeError: Fewer rows than slabs, or fewer than two slabs.
    """
    n = len(values)
    _check_folds(n, count)
    rank = np.empty(n, dtype=np.int64)
    rank[np.argsort(values, kind="stable")] = np.arange(n)
    return _by_label(rank * count // n, "regions")


def spatial_regions(measurements: MeasurementSet, *, count: int = 3) -> tuple[Split, ...]:
    """Returns slabs along the direction in which the measured points spread most.

    Deterministic, and the same in any frame: the direction is the first principal axis of the
    positions, its sign fixed by the first row.
    """
    centred = measurements.position - measurements.position.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    along = centred @ axis
    return slabs(along * (1.0 if along[0] >= 0.0 else -1.0), count=count)


def leave_one_set_out(measurements: MeasurementSet) -> tuple[Split, ...]:
    """Returns one split per group of the set: the group held out, all others trained on.

    Raises:
        ShapeError: The set has one group only.
    """
    groups = np.unique(measurements.group)
    if len(groups) < 2:
        raise ShapeError(
            "leave-one-set-out needs at least 2 sets, there is 1.",
            hint="give several files, or use contiguous blocks.",
        )
    names = [measurements.group_names[int(g)] for g in groups]
    return _by_label(np.searchsorted(groups, measurements.group), "sets", names)


def _check_folds(n: int, folds: int) -> None:
    if not 2 <= folds <= n:
        raise ShapeError(f"{folds} parts of {n} rows, expected 2 to {n} parts.")


def _by_label(
    label: npt.NDArray[np.int64], kind: SplitKind, names: Sequence[str] | None = None
) -> tuple[Split, ...]:
    count = int(label.max()) + 1
    return tuple(
        Split(
            name=f"{kind} {names[k] if names else f'{k + 1}/{count}'}",
            kind=kind,
            train=np.flatnonzero(label != k),
            test=np.flatnonzero(label == k),
        )
        for k in range(count)
    )


def without_unseen_targets(measurements: MeasurementSet, split: Split) -> Split | None:
    """Returns the split without held-out rows of reflectors it has no other rows of.

    None if none stay.
    """
    target = measurements.target
    seen = np.isin(target[split.test], target[split.train])
    if seen.all():
        return split
    return replace(split, test=split.test[seen]) if seen.any() else None


def space_rows(rows: IntArray, most: int) -> IntArray:
    """Returns at most ``most`` of some rows (k,), evenly spaced."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).astype(np.int64)]
