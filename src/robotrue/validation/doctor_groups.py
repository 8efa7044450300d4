"""Rows that are off alike, of another reflector, repeated, or with joints of another moment.

Joints are not those of the point if read while the arm settled, a row late, or by another clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.screening import duplicate_rows
from robotrue.robot.model import RobotModel
from robotrue.validation.doctor_case import Case, open_case
from robotrue.validation.doctor_evidence import (
    HOPELESS,
    USUAL,
    CauseName,
    Evidence,
    Hypothesis,
    columns_fit,
    learn,
    log_choices,
    weigh_noise,
)
from robotrue.validation.doctor_segments import SEGMENTS, Picked, Segment, estimate_columns

LARGEST_SHARE: Final = 0.4
"""Largest share of faulty rows; of more it is not determined which are right."""
ROUNDS: Final = 6
SEEDS: Final = 8
LEAST: Final = 3
MOST_PARTS: Final = 20
"""Parts of a long set whose rows are named one by one."""
REPEATED_ODDS: Final = 30.0
"""Log odds of repeated rows, which need no statistics."""
MOVED: Final = 1e-3
"""rad: joints that moved by more cannot leave the point where it was, to the last digit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scattered:
    """Rows anywhere in the file that are off in the same way.

    Attributes:
        segment: Their fault.
    """

    segment: Segment

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the likeliest group."""
        arm = residuals.case
        group, odds, width = self._find_group(residuals)
        if group is None or odds < HOPELESS:
            return ()
        chosen = arm.chosen[group]
        if len(arm.chosen) < arm.count:
            chosen = self._find_others(arm, chosen)
        price = -log_choices(len(group), np.flatnonzero(group))
        sizes = np.array([width])
        found = Picked(inside=group, rows=chosen, log_odds=odds, sizes=sizes, price=price)
        return [self.segment.build(residuals, found)]

    def _find_group(self, residuals: Evidence) -> tuple[BoolArray | None, float, float]:
        columns = self.segment.make_columns(residuals.case)[residuals.case.chosen]
        best: BoolArray | None = None
        most, width = -np.inf, 0.0
        for group in _grow_groups(residuals, columns, float(self.segment.widths[-1])):
            odds, size = columns_fit(residuals, columns * group[:, None, None], self.segment.widths)
            odds += log_choices(len(group), np.flatnonzero(group))
            if odds > most:
                best, most, width = group, odds, size
        return best, most, width

    def _find_others(self, arm: Case, first: IntArray) -> IntArray:
        """Rows of a long set that are off alike, part by part; each part is fitted alone."""
        parts = -(-arm.count // len(arm.chosen))
        if parts > MOST_PARTS:
            return first
        found = [first]
        left = np.setdiff1d(np.arange(arm.count), arm.chosen)
        for part in (left[k :: parts - 1] for k in range(parts - 1)):
            case = open_case(arm.robot, arm.rows, arm.settings, part)
            group, odds, _ = self._find_group(learn(case))
            if group is not None and odds > 0.0:
                found.append(part[group])
        return np.sort(np.concatenate(found))


def _grow_groups(residuals: Evidence, columns: Array, width: float) -> Iterator[BoolArray]:
    """Yields groups of rows that one set of coefficients makes likelier, from several seeds."""
    gap, covariance = residuals.predict_left_out()
    inverse = np.linalg.inv(covariance)
    force = np.einsum("niq,nij,nj->nq", columns, inverse, gap)
    weight = np.einsum("niq,nij,njr->nqr", columns, inverse, columns)
    eye = np.eye(columns.shape[2]) / width**2
    single = np.linalg.solve(weight + eye, force[:, :, None])[:, :, 0]
    seeds = np.argsort(-np.einsum("nq,nq->n", single, force))[:SEEDS]
    seen: set[bytes] = set()
    for seed in seeds.tolist():
        group = _alike(single[seed], force, weight)
        for _ in range(ROUNDS):
            if not LEAST <= group.sum() <= LARGEST_SHARE * len(group):
                break
            before = group
            group = _regroup(residuals, columns, group, width)
            if (group == before).all():
                break
        if LEAST <= group.sum() <= LARGEST_SHARE * len(group) and group.tobytes() not in seen:
            seen.add(group.tobytes())
            yield group


def _alike(value: Array, force: Array, weight: Array) -> BoolArray:
    """Rows that the coefficients make likelier by more than a fair share of choices costs."""
    gain = force @ value - 0.5 * np.einsum("q,nqr,r->n", value, weight, value)
    return np.asarray(gain > 1.5)


def _regroup(residuals: Evidence, columns: Array, group: BoolArray, width: float) -> BoolArray:
    """The group again, with the arm and the coefficients fitted to it."""
    n, _, q = columns.shape
    flat = (columns * group[:, None, None]).reshape(3 * n, q)
    value = estimate_columns(residuals, flat.reshape(n, 3, q), width)
    across = residuals.precision @ flat
    inner = np.linalg.inv(flat.T @ across + np.eye(q) / width**2)
    pull = residuals.pull - across @ (inner @ (flat.T @ residuals.pull))
    blocks = residuals.precision.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n), :]
    rows = across.reshape(n, 3, q)
    blocks = blocks - np.einsum("niq,qr,njr->nij", rows, inner, rows)
    gap = np.linalg.solve(blocks, pull.reshape(n, 3, 1))[:, :, 0]
    gap = gap + np.einsum("niq,q->ni", columns, value) * group[:, None]
    force = np.einsum("niq,nij,nj->nq", columns, blocks, gap)
    return _alike(value, force, np.einsum("niq,nij,njr->nqr", columns, blocks, columns))


def shift_columns(arm: Case) -> Array:
    """Columns of a shift in the frame of the measurement."""
    return np.broadcast_to(np.eye(3), (arm.count, 3, 3))


ONE_DIRECTION: Final = Segment(
    cause="one-direction",
    make_columns=shift_columns,
    advice="look for a second reflector, a reflection or a beam that was interrupted and set again",
    describe=lambda value, size: (
        f"single rows are off by the same vector ({value[0] / MM:+.3f}, {value[1] / MM:+.3f}, "
        f"{value[2] / MM:+.3f}) mm"
    ),
)
SCATTERED: Final = (
    Scattered(segment=ONE_DIRECTION),
    *(Scattered(segment=each) for each in SEGMENTS if each.cause in ("reflector", "scale")),
)


def find_repeats(rows: MeasurementSet, robot: RobotModel) -> list[Hypothesis]:
    """Returns duplicated rows, and points that were not measured again, where there are any."""
    later = np.array([row for _, row in duplicate_rows(rows)], dtype=np.int64)
    stated: tuple[tuple[CauseName, str, str, IntArray], ...] = (
        (
            "duplicates",
            "rows repeat earlier ones to the last digit",
            "export the measurements again",
            later,
        ),
        (
            "stale-points",
            "the point is that of another row to the last digit, the joints are not",
            "wait for a new reading of the instrument at each pose",
            _stale_rows(rows),
        ),
    )
    return [
        Hypothesis(
            cause=cause,
            text=text,
            log_odds=REPEATED_ODDS,
            rows=wrong,
            cure=partial(_leave_out, rows, wrong),
            advice=advice,
        )
        for cause, text, advice, wrong in stated
        if len(wrong)
    ]


def _leave_out(rows: MeasurementSet, wrong: IntArray) -> MeasurementSet:
    return rows.subset(np.setdiff1d(np.arange(len(rows)), wrong))


def _stale_rows(rows: MeasurementSet) -> IntArray:
    _, first, inverse = np.unique(rows.position, axis=0, return_index=True, return_inverse=True)
    origin = first[inverse.reshape(-1)]
    moved = np.abs(rows.joints - rows.joints[origin]).max(axis=1) > MOVED
    return np.flatnonzero(moved & (origin != np.arange(len(rows))))


EARLY_SD: Final = np.array([0.02, 0.03, 0.045, 0.07, 0.1, 0.2, 0.5]) * DEG
"""Scatter of joints read while the arm settles."""
LAGS: Final = np.array([1e-4, 1e-3, 1e-2, 1e-1, 1.0])
"""Part of a step between rows by which joints are early or late."""
ROWS_APART: Final = 0.8
"""Of a whole row: from here on it is a shift of rows rather than a clock."""
HALF: Final = 0.5
"""Lag from which rows no more follow from the row before: an error at the end would grow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointsEarly:
    """Each row's joints are off at random, as when they are read while the arm still moves."""

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the likeliest scatter, where it is beyond that of a healthy arm."""
        arm = residuals.case
        drive = arm.drive @ np.swapaxes(arm.drive, 1, 2)
        # White noise learned without the scatter has its size already: start from the usual.
        quiet = replace(USUAL, geometry=residuals.scales.geometry)
        tried = [weigh_noise(arm, quiet, size**2 * drive) for size in EARLY_SD.tolist()]
        sd = float(EARLY_SD[int(np.argmax(tried))])
        if max(tried) < residuals.log_evidence:
            return ()
        noisy = learn(arm, start=quiet, noise=sd**2 * drive)
        clean = max(residuals.log_evidence, weigh_noise(arm, noisy.scales))

        def weigh_rows() -> MeasurementSet:
            spread = sd**2 * arm.drives @ np.swapaxes(arm.drives, 1, 2)
            return replace(arm.rows, covariance=arm.rows.covariance + spread)

        return [
            Hypothesis(
                cause="joints-early",
                text=f"joints scatter by {sd / DEG:.3f} deg about the position of the arm: they "
                "were read while it settled",
                log_odds=noisy.log_evidence - clean,
                rows=np.arange(arm.count),
                cure=weigh_rows,
                advice="wait until the arm is at rest before reading both, or log the commanded "
                "joints; the cure weights each row by the uncertainty of its joints",
            )
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """Joints that are early or late by a part of the way to the row before or after."""

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the likelier of the two directions."""
        tried = [_build_lag(residuals, step, 0.0) for step in (-1, 1)]
        likely = [each for each in tried if each is not None]
        return [max(likely, key=lambda each: each.log_odds)] if likely else ()


def _build_lag(
    residuals: Evidence, step: int, removed: float, read: MeasurementSet | None = None
) -> Hypothesis | None:
    """Returns the hypothesis of a lag in addition to one removed from the examined rows already.

    Args:
        residuals: Of the rows without the lag that is removed.
        step: -1: joints of the row before are mixed in; 1: of the row after.
        removed: Lag that the examined rows have no more.
        read: The rows with that lag; None where none is removed yet.
    """
    arm = residuals.case
    rows = arm.rows if read is None else read
    way = joint_steps(arm.rows.joints, step)
    column = np.einsum("nid,nd->ni", arm.drive, way[arm.chosen])[:, :, None]
    odds, width = columns_fit(residuals, column, LAGS)
    other = "before" if step < 0 else "after"

    def revise(value: Array) -> Hypothesis:
        lag = removed - width * float(value[0])
        size = float(np.sqrt(((arm.drives @ (lag * way)[:, :, None]) ** 2).sum(axis=(1, 2)).mean()))

        def refine(again: Evidence) -> Hypothesis | None:
            return _build_lag(again, step, lag, rows)

        return Hypothesis(
            cause="shifted-rows" if lag > ROWS_APART else "clock",
            text=f"joints are {100.0 * lag:.3g} % of the way to those of the row {other} "
            f"({size / MM:.3f} mm): the clocks of controller and instrument differ",
            log_odds=odds - np.log(2.0),
            rows=np.arange(len(rows.joints)),
            cure=lambda: _remove_lag(rows, lag, step),
            advice="take both readings at rest, or by one trigger",
            columns=width * column,
            price=float(np.log(2.0)),
            revise=revise,
            refine=refine,
        )

    value = estimate_columns(residuals, width * column, 1.0)
    return revise(value) if width * float(value[0]) < removed else None


def _remove_lag(rows: MeasurementSet, lag: float, step: int) -> MeasurementSet:
    """Rows whose joints q' were ``(1 - lag) q + lag (q of the row before or after)``, with q.

    The row at the end from which the others follow has no row to be mixed with: it is left out.
    A lag of half a row and more is removed to first order.
    """
    if not 0.0 <= lag < HALF:
        return replace(rows, joints=rows.joints - lag * joint_steps(rows.joints, step))
    read = rows.joints if step < 0 else rows.joints[::-1]
    joints = read.copy()
    for k in range(1, len(joints)):
        joints[k] = (read[k] - lag * joints[k - 1]) / (1.0 - lag)
    joints = joints if step < 0 else joints[::-1]
    kept = np.arange(1, len(joints)) if step < 0 else np.arange(len(joints) - 1)
    return replace(rows, joints=joints).subset(kept)


def joint_steps(joints: Array, step: int) -> Array:
    """Returns the way (n, dof) rad from each row to the one before (-1) or after (1) it."""
    way = np.zeros_like(joints)
    if step < 0:
        way[1:] = joints[:-1] - joints[1:]
    else:
        way[:-1] = joints[1:] - joints[:-1]
    return way
