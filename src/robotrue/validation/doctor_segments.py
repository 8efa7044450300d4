"""Effects that begin at a row: tracker bumped, drift, another reflector, scale, payload."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import displacement_columns
from robotrue.core.units import MM
from robotrue.robot.forward import walk
from robotrue.robot.statics import NO_LOAD, Load, torque_at
from robotrue.validation.doctor_case import Case
from robotrue.validation.doctor_evidence import (
    HOPELESS,
    WIDTHS,
    CauseName,
    Evidence,
    Hypothesis,
    column_odds,
    columns_fit,
    move_points,
)

LEAST: Final = 4
"""Rows of a segment."""
MOST_EDGES: Final = 31
"""Edges between which blocks are searched."""
SCALE_WIDTHS: Final = np.array([1e-4, 5e-4, 2e-3, 1e-2, 1.0, 30.0])
"""Sd of a relative error of lengths: from the air to millimetres read as inches."""

SHIFT_AND_TURN: Final = np.array([[1.0] * 6, [1.0] * 3 + [0.05] * 3])
"""A motion turns the points as far as it shifts them, or hardly at all."""

ONE_KILOGRAM: Final = Load(mass=np.ones(1))

MakeColumns = Callable[[Case], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Picked:
    """Rows that were picked as having one common deviation.

    Attributes:
        inside: (n,) of the examined rows.
        rows: Of the whole set.
        log_odds: Log Bayes factor, less the price.
        sizes: (q,) m, likeliest sd of each coefficient of the effect.
        price: Log of the choices.
        text: Of an effect that was subtracted already; empty at the first step.
    """

    inside: BoolArray
    rows: IntArray
    log_odds: float
    sizes: Array
    price: float
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Rows from one on, or of a block, that are off in the same way.

    Attributes:
        cause: Its name.
        make_columns: Columns (N, 3, q) of all rows of the set.
        advice: What to do.
        describe: Text from the coefficients (q,) and the effect (m rms).
        widths: (w,) sd of the coefficients, each as likely.
        shares: (s, q) relative sizes of the columns, each as likely.
        heads: Whether the first rows may be the wrong ones. Where the frame or the reflector is not
            known, wrong first rows and wrong last rows are one hypothesis: the first are right.
    """

    cause: CauseName
    make_columns: MakeColumns
    advice: str
    describe: Callable[[Array, float], str]
    widths: Array = field(default_factory=lambda: WIDTHS)
    shares: Array = field(default_factory=lambda: np.ones((1, 1)))
    heads: bool = False

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the likeliest segment, if there are rows enough for one."""
        arm = residuals.case
        count = len(arm.chosen)
        if count < 3 * LEAST:
            return ()
        columns = self.make_columns(arm)[arm.chosen]
        tried = [
            (*find_segment(residuals, columns * share, self.widths, heads=self.heads), share)
            for share in self.shares
        ]
        first, last, odds, width, share = max(tried, key=lambda each: each[2])
        if odds < HOPELESS:
            return ()
        inside = np.zeros(count, dtype=bool)
        inside[first:last] = True
        chosen = _whole_rows(arm.chosen, inside, arm.count)
        among = float(np.log(len(self.shares)))
        found = Picked(
            inside=inside,
            rows=chosen,
            log_odds=odds - among,
            sizes=width * share,
            price=choice_price(first, last, count) + among,
        )
        others = np.setdiff1d(np.arange(arm.count), chosen)
        rival = partial(self.build, residuals, replace(found, inside=~inside, rows=others))
        return [replace(self.build(residuals, found), rival=rival if self.heads else None)]

    def build(self, residuals: Evidence, picked: Picked) -> Hypothesis:
        """Returns the hypothesis of some rows, their effect estimated and subtracted."""
        arm = residuals.case
        every = picked.sizes * self.make_columns(arm)
        columns = every[arm.chosen] * picked.inside[:, None, None]

        def revise(value: Array) -> Hypothesis:
            effect = np.zeros((arm.count, 3))
            effect[picked.rows] = every[picked.rows] @ value
            size = float(np.sqrt((effect[picked.rows] ** 2).sum(axis=1).mean()))
            text = picked.text or self.describe(picked.sizes * value, size)

            def refine(again: Evidence) -> Hypothesis | None:
                return self.build(again, replace(picked, text=text))

            return Hypothesis(
                cause=self.cause,
                text=text,
                log_odds=picked.log_odds,
                rows=picked.rows,
                cure=lambda: move_points(arm.rows, effect),
                advice=self.advice,
                columns=columns,
                price=picked.price,
                revise=revise,
                refine=refine,
            )

        return revise(estimate_columns(residuals, columns, 1.0))


def estimate_columns(residuals: Evidence, columns: Array, width: float) -> Array:
    """Returns the coefficients (q,) of columns (n, 3, q) with a prior sd, the arm fitted too."""
    flat = columns.reshape(len(residuals.lower), -1)
    white = residuals.root @ flat
    precision = white.T @ white + np.eye(flat.shape[1]) / width**2
    return np.asarray(np.linalg.solve(precision, white.T @ residuals.white_values))


def find_segment(
    residuals: Evidence, columns: Array, widths: Array = WIDTHS, *, heads: bool = False
) -> tuple[int, int, float, float]:
    """Returns first and end row of the likeliest segment, its log Bayes factor, its width.

    Every tail and every block of the rows is tried; the odds pay for that choice.
    """
    n = len(columns)
    root = residuals.root.reshape(-1, n, 3)
    parts = np.einsum("mni,niq->nmq", root, columns)
    upto = np.concatenate([np.zeros((1, *parts.shape[1:])), np.cumsum(parts, axis=0)])
    edges = np.unique(np.linspace(0, n, min(n + 1, MOST_EDGES)).astype(np.int64))
    pairs = [
        (a, b)
        for i, a in enumerate(edges.tolist())
        for b in edges[i + 1 :].tolist()
        if LEAST <= b - a <= n - LEAST and (a > 0 or heads)
    ]
    best = _best_of(pairs, upto, residuals.white_values, widths, n)
    if len(edges) <= n:  # coarse edges: each then moves on its own
        step = -(-n // (len(edges) - 1))
        a, b = best[:2]
        near = [
            (i, j)
            for i in range(max(0, a - step), min(n, a + step + 1))
            for j in range(max(0, b - step), min(n, b + step) + 1)
            if LEAST <= j - i <= n - LEAST and (i > 0) == (a > 0) and (b < n or j == n)
        ]
        best = _best_of(near, upto, residuals.white_values, widths, n)
    return best


def _best_of(
    pairs: Sequence[tuple[int, int]], upto: Array, white: Array, widths: Array, n: int
) -> tuple[int, int, float, float]:
    if not pairs:
        return 0, 0, -np.inf, float(widths[0])
    index = np.array(pairs)
    odds, which = np.zeros(len(index)), np.zeros(len(index), dtype=np.int64)
    for start in range(0, len(index), 256):
        part = slice(start, start + 256)
        block = upto[index[part, 1]] - upto[index[part, 0]]
        precision = np.matmul(np.swapaxes(block, 1, 2), block)
        odds[part], which[part] = column_odds(precision, block.transpose(0, 2, 1) @ white, widths)
    odds = odds - np.array([choice_price(a, b, n) for a, b in pairs])
    k = int(odds.argmax())
    return int(index[k, 0]), int(index[k, 1]), float(odds[k]), float(widths[which[k]])


def choice_price(first: int, last: int, count: int) -> float:
    """Returns the log of the segments as likely: half of the belief is in tails, half in blocks."""
    return float(np.log(4.0 * count) if first == 0 or last == count else 2.0 * np.log(count))


def _whole_rows(chosen: IntArray, inside: Array, count: int) -> IntArray:
    """Rows of the whole set whose nearest examined row is inside."""
    nearest = np.abs(np.arange(count)[:, None] - chosen[None, :]).argmin(axis=1)
    return np.flatnonzero(inside[nearest])


def motion_columns(arm: Case) -> Array:
    """Columns of a rigid motion of the instrument, turns over the size of the cloud of points."""
    points = arm.rows.position[arm.chosen]
    about = points.mean(axis=0)
    size = max(float(np.sqrt(((points - about) ** 2).sum(axis=1).mean())), 1e-3)
    return displacement_columns((arm.rows.position - about) / size)


def drift_columns(arm: Case) -> Array:
    """Columns of a rigid motion in proportion to the row number; the first row stays."""
    return motion_columns(arm) * np.linspace(0.0, 1.0, arm.count)[:, None, None]


def flange_columns(arm: Case) -> Array:
    """Columns of another place of the reflector on the flange."""
    return arm.flange_turn


def scale_columns(arm: Case) -> Array:
    """The column of a factor on the positions, over a metre."""
    return arm.rows.position[:, :, None]


def payload_columns(arm: Case) -> Array:
    """Columns of a change of payload, a joint each: its compliance is learned with it."""
    robot = arm.state.robot.nominal()
    chain = walk(robot, arm.rows.joints)
    torque = torque_at(robot, chain, ONE_KILOGRAM) - torque_at(robot, chain, NO_LOAD)
    size = np.maximum(np.abs(torque[arm.chosen]).max(axis=0), 1e-9)
    return np.asarray(arm.drives * (torque / size)[:, None, :])


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """The instrument or its mount that moves all the time."""

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the drift of all rows."""
        arm = residuals.case
        every = drift_columns(arm)
        columns = every[arm.chosen]
        tried = [(*columns_fit(residuals, columns * share), share) for share in SHIFT_AND_TURN]
        odds, width, share = max(tried, key=lambda each: each[0])
        price = float(np.log(len(tried)))
        if odds < HOPELESS:
            return ()
        sizes = width * share

        def revise(value: Array) -> Hypothesis:
            size = float(np.linalg.norm(sizes[:3] * value[:3])) / MM
            return Hypothesis(
                cause="drift",
                text=f"the instrument drifts by {size:.3f} mm from the first row to the last",
                log_odds=odds - price,
                rows=np.arange(arm.count),
                cure=lambda: move_points(arm.rows, every @ (sizes * value)),
                advice="let instrument and mount warm up, and shoot fixed points during the run",
                columns=sizes * columns,
                price=price,
                revise=revise,
            )

        return [revise(estimate_columns(residuals, sizes * columns, 1.0))]


SEGMENTS: Final = (
    Segment(
        cause="instrument-moved",
        make_columns=motion_columns,
        shares=SHIFT_AND_TURN,
        advice="shoot fixed points again, or number these rows as a separate station",
        describe=lambda value, size: (
            f"the instrument or its frame moved: these rows are off by {size / MM:.3f} mm"
        ),
    ),
    Segment(
        cause="reflector",
        make_columns=flange_columns,
        advice="check the reflector and its nest; number a second reflector in a target column",
        describe=lambda value, size: (
            f"another reflector, or another place of it: {size / MM:.3f} mm off on the flange"
        ),
    ),
    Segment(
        cause="scale",
        make_columns=scale_columns,
        advice="check the unit and the atmospheric correction of these rows",
        describe=lambda value, size: (
            f"positions are {_tell_factor(1.0 / max(1.0 - float(value[0]), 1e-9))}"
        ),
        widths=SCALE_WIDTHS,
        heads=True,
    ),
    Segment(
        cause="payload",
        make_columns=payload_columns,
        advice="state the payload of these rows in a payload column",
        describe=lambda value, size: (
            f"another payload: the drives wind up and move the point by {size / MM:.3f} mm"
        ),
    ),
)


def _tell_factor(factor: float) -> str:
    if abs(factor - 1.0) < 0.01:
        return f"longer by {1e6 * (factor - 1.0):+.0f} um/m"
    return f"multiplied by {factor:.4g}"
