"""Expected errors of a program's targets for the charts of its page, however many targets it has.

The expected error of a target is its predicted error plus the radius that holds 95 % of the scatter
about it, as the 3-D view and the verdict use it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG, UM
from robotrue.robot.model import Configuration

DRAWN: Final = 240
"""Targets that are drawn at most; of more, the largest of each of so many stretches."""
BINS: Final = 24
SMALLEST: Final = 0.1 * UM
"""Lengths below are drawn as this one."""
STILL: Final = 1e-6 * DEG
"""An axis that turns by less is at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedErrors(Columns):
    """n targets in the order of the program.

    Attributes:
        number: (n,) of the target in the program, from 1.
        line: (n,) one-based, in its file.
        before: (n,) m, expected before; NaN where unknown.
        after: (n,) m, expected after; NaN where unknown.
        mover: (n,) axis that turns most on the way to the target, from 0; -1: unknown or none.
        point: (n,) index of the target in the 3-D view; -1: not drawn there.
    """

    number: Annotated[IntArray, Column("n")]
    line: Annotated[IntArray, Column("n")]
    before: Annotated[Array, Column("n", unit="m", nan=True)]
    after: Annotated[Array, Column("n", unit="m", nan=True)]
    mover: Annotated[IntArray, Column("n")]
    point: Annotated[IntArray, Column("n")]

    def __len__(self) -> int:
        return len(self.number)


def find_movers(joints: Array, controller: Configuration) -> IntArray:
    """Returns the displayed axis (n,) that turns most from the target before; -1: none, unknown.

    Args:
        joints: (n, dof) rad of one program, NaN where unknown.
        controller: How the axes are displayed.
    """
    movers = np.full(len(joints), -1)
    turned = np.abs(np.diff(controller.to_controller(joints), axis=0))
    known = np.flatnonzero(np.nan_to_num(turned).max(axis=1, initial=0.0) > STILL)
    known = known[np.isfinite(turned[known]).all(axis=1)]
    movers[known + 1] = turned[known].argmax(axis=1)
    return movers


def describe_errors(errors: ExpectedErrors, files: Sequence[str]) -> dict[str, object]:
    """Returns targets to draw, a histogram and sizes by moving axis; JSON values in m.

    Args:
        errors: Of at least one target, all known.
        files: Name of the file of each target of the program.
    """
    return {
        **count_sizes(errors.before, errors.after),
        "rows": [_describe_target(errors, row, files) for row in choose_rows(errors)],
        "thinned": len(errors) > DRAWN,
        "last": int(errors.number[-1]),
        "movers": [
            _describe_axis(errors, axis) for axis in np.unique(errors.mover[errors.mover >= 0])
        ],
    }


def count_sizes(before: Array, after: Array) -> dict[str, object]:
    """Returns the ends of a logarithmic scale and a histogram on it; JSON values in m.

    Args:
        before: (n,) m, one or more errors, all known.
        after: (n,) m.
    """
    both = np.maximum(np.stack([before, after]), SMALLEST)
    low, high = float(both.min()) / 1.1, float(both.max()) * 1.1
    edges = np.geomspace(low, high, BINS + 1)
    counts = [np.histogram(each, edges)[0].tolist() for each in both]
    return {
        "low_m": low,
        "high_m": high,
        "counts": dict(zip(("before", "after"), counts, strict=True)),
    }


def _describe_target(errors: ExpectedErrors, row: int, files: Sequence[str]) -> dict[str, object]:
    return {
        "file": files[errors.number[row] - 1],
        "number": int(errors.number[row]),
        "line": int(errors.line[row]),
        "before_m": float(errors.before[row]),
        "after_m": float(errors.after[row]),
        "point": int(errors.point[row]),
    }


def choose_rows(errors: ExpectedErrors) -> list[int]:
    """Returns the rows to draw: all, or the largest error of each stretch."""
    if len(errors) <= DRAWN:
        return list(range(len(errors)))
    largest = np.maximum(errors.before, errors.after)
    edges = np.linspace(0, len(errors), DRAWN + 1).astype(np.int64)
    pairs = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    return [first + int(largest[first:end].argmax()) for first, end in pairs]


def _describe_axis(errors: ExpectedErrors, axis: int) -> dict[str, object]:
    """Means and largest errors of the targets on whose way an axis turns most."""
    rows = np.flatnonzero(errors.mover == axis)
    largest = rows[np.maximum(errors.before, errors.after)[rows].argmax()]
    return {
        "axis": int(axis) + 1,
        "targets": len(rows),
        "point": int(errors.point[largest]),
        **{
            f"{name}_{kind}_m": float(value)
            for name, size in (("before", errors.before[rows]), ("after", errors.after[rows]))
            for kind, value in (("mean", size.mean()), ("max", size.max()))
        },
    }
