"""Joints that are not those of the point: read while the arm settled, a row late, by a clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.validation.doctor_evidence import USUAL, Evidence, columns_fit, learn, weigh_noise
from robotrue.validation.doctor_segments import estimate_columns
from robotrue.validation.doctor_suspicion import Hypothesis

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
    """The hypothesis of a lag beside one that is removed from the examined rows already.

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
