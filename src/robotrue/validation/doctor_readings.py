"""Columns of joints that were misread: shifted rows, a sign, an exchange, an offset, a turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import displacement_columns
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import similar_presets
from robotrue.validation.doctor_case import Case, open_case, robust_frame
from robotrue.validation.doctor_evidence import (
    CauseName,
    Evidence,
    Hypothesis,
    columns_fit,
    fit_rows,
    learn,
)

BETTER: Final = 0.75
"""A reading that leaves less than this part of the misfit is examined in full."""
EXAMINED: Final = 2
COMPARED: Final = 60
"""Rows by which readings are compared, at most."""
TRIMMED: Final = 0.8
"""Part of the rows whose misfit counts."""
ROUNDS: Final = 2
SAME_SIZE: Final = 0.25
"""Relative difference of reach within which presets are tried."""
TURN: Final = 2.0 * np.pi
NO_ROWS: Final = np.zeros(0, dtype=np.int64)
OFFSETS: Final = np.array([0.01, 0.03, 0.1])
"""rad, sd of an offset that is an error of the file."""
DRAWS: Final = 10
LARGE: Final = 5e-3
"""rad, 0.29 deg: an offset of a joint beyond what mastering leaves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnReading:
    """Another way to read the file.

    Attributes:
        cause: Its name.
        text: Fault of the present one.
        advice: What to do.
        joints: (n, dof) rad, the columns of joints as they then read.
        robot: The arm as it then is, without its tool; None: as stated.
        lost: Rows that have no joints then.
    """

    cause: CauseName
    text: str
    advice: str
    joints: Array
    robot: RobotModel | None = None
    lost: IntArray = field(default_factory=lambda: NO_ROWS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Misread:
    """Columns read in another order or sense, rows shifted, another robot stated."""

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the readings that fit much better, examined in full."""
        arm = residuals.case
        tried = list_readings(arm.robot, arm.rows.joints)
        misfits = compare_readings(arm, tried)
        return [
            examine(tried[k], residuals, float(np.log(len(tried))))
            for k in np.argsort(misfits[1:])[:EXAMINED].tolist()
            if misfits[1 + k] < BETTER * misfits[0]
        ]


def examine(reading: ColumnReading, residuals: Evidence, price: float) -> Hypothesis:
    """Returns the hypothesis of another reading: its fit against that of the file as read."""
    arm, robot = residuals.case, reading.robot
    put_right = arm.rows if robot is not None else replace(arm.rows, joints=reading.joints)
    robot = robot and robot.with_tool(arm.robot.T_flange_tool)
    case = open_case(robot or arm.robot, put_right, arm.settings, arm.chosen)
    wrong = np.flatnonzero((reading.joints != arm.rows.joints).any(axis=1))
    kept = np.setdiff1d(np.arange(arm.count), reading.lost)
    return Hypothesis(
        cause=reading.cause,
        text=reading.text,
        log_odds=fit_rows(case).log_evidence - residuals.log_evidence - price,
        rows=wrong if len(wrong) else np.arange(arm.count),
        cure=None if robot is not None else lambda: put_right.subset(kept),
        advice=reading.advice,
        robot=robot,
    )


def list_readings(robot: RobotModel, joints: Array) -> list[ColumnReading]:
    """Returns every other reading of the joint columns (n, dof) rad, and other robots alike."""
    readings = []
    for step, word, lost in ((-1, "before", len(joints) - 1), (1, "after", 0)):
        # The joints of a row are those of the row before: its own are in the row after. The row at
        # the end that has none keeps its own.
        moved = np.roll(joints, step, axis=0)
        moved[lost] = joints[lost]
        readings.append(
            ColumnReading(
                cause="shifted-rows",
                text=f"joints are those of the row {word}",
                advice="export joints and points by one trigger; the cure shifts them back by a "
                "row",
                joints=moved,
                lost=np.array([lost]),
            )
        )
    for j in range(robot.dof):
        turned = joints.copy()
        turned[:, j] *= -1.0
        readings.append(
            ColumnReading(
                cause="joint-sign",
                text=f"joint {j + 1} has the wrong sign",
                advice=f"change the sign of joint {j + 1} in the column mapping",
                joints=turned,
            )
        )
    for a, b in combinations(range(robot.dof), 2):
        swapped = joints.copy()
        swapped[:, [a, b]] = joints[:, [b, a]]
        readings.append(
            ColumnReading(
                cause="joints-exchanged",
                text=f"the columns of joints {a + 1} and {b + 1} are exchanged",
                advice=f"exchange joints {a + 1} and {b + 1} in the column mapping",
                joints=swapped,
            )
        )
    readings.extend(
        ColumnReading(
            cause="preset",
            text=f"the arm is a {other.name}, the cell states {robot.name}",
            advice=f'write preset = "{other.name}" in the cell file',
            joints=joints,
            robot=other,
        )
        for other in similar_presets(robot, SAME_SIZE)
    )
    return readings


def compare_readings(arm: Case, readings: Sequence[ColumnReading]) -> Array:
    """Returns the rms distances (1 + k,) in m from the nominal arm, of the file and its readings.

    Frames and reflector are fitted, the worst rows left out.
    """
    some = arm.chosen[:: -(-len(arm.chosen) // COMPARED)]
    nominal, tool = arm.robot.nominal(), arm.robot.T_flange_tool
    own = [reading.joints[some] for reading in readings if reading.robot is None]
    stacked = np.concatenate([arm.rows.joints[some], *own])
    others = [reading.robot for reading in readings if reading.robot is not None]
    T = [forward(nominal, stacked)]
    T += [forward(other, arm.rows.joints[some]) @ tool for other in others]
    poses = np.concatenate(T).reshape(-1, len(some), 4, 4)
    points, flange = poses[..., :3, 3], poses[..., :3, :3] @ tool[:3, :3].T
    station, seen = arm.rows.station[some], arm.rows.position[some]
    squares = [
        _aligned_squares(points[:, mine], flange[:, mine], seen[mine])
        for mine in (station == k for k in np.unique(station))
    ]
    size = np.sort(np.concatenate(squares, axis=1), axis=1)
    return np.asarray(np.sqrt(size[:, : max(int(TRIMMED * len(some)), 1)].mean(axis=1)))


def _aligned_squares(points: Array, flange: Array, seen: Array) -> Array:
    """Squared distances (k, n) m^2 after the best frames and reflectors, by trimmed steps."""
    if len(seen) < 4:
        return np.zeros(points.shape[:2])
    offset = np.zeros((len(points), 3))
    for _ in range(ROUNDS):
        moved = points + (flange @ offset[:, None, :, None])[..., 0]
        T = robust_frame(moved, seen, DRAWS)[:, None]
        placed = (T[..., :3, :3] @ moved[..., None])[..., 0] + T[..., :3, 3]
        gap = seen - placed
        lever = placed - placed.mean(axis=1, keepdims=True)
        columns = np.concatenate([displacement_columns(lever), T[..., :3, :3] @ flange], axis=3)
        size = (gap**2).sum(axis=2)
        near = size <= np.quantile(size, TRIMMED, axis=1, keepdims=True)
        flat = (columns * near[..., None, None]).reshape(len(points), -1, 9)
        right = (gap * near[..., None]).reshape(len(points), -1, 1)
        step = (np.linalg.pinv(flat, rcond=1e-8) @ right)[:, None]
        gap = gap - (columns @ step)[..., 0]
        offset = offset + np.clip(step[:, 0, 6:, 0], -0.3, 0.3)
    return np.asarray((gap**2).sum(axis=2))


@dataclass(frozen=True, slots=True, kw_only=True)
class JointOffset:
    """A joint whose zero is elsewhere by more than mastering leaves.

    Rows show the offset of the file and the zero error of the arm as one angle. A model of the
    cured rows predicts rows that are read and cured alike as well as one of clean rows does; at the
    controller's joints it lacks the arm's own zero error of that joint.
    """

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the joint that explains most, its offset found by three fits."""
        arm = residuals.case
        odds = [columns_fit(residuals, arm.drive[:, :, [j]], OFFSETS)[0]
                for j in range(arm.robot.dof)]  # fmt: skip
        j = int(np.argmax(odds))
        if odds[j] < 0.0:
            return ()
        evidence = learn(arm, OFFSETS[-1] * arm.drive[:, :, [j]], residuals.scales)
        value = float(OFFSETS[-1] * evidence.coefficients()[0])
        if abs(value) < LARGE:
            return ()
        joints = arm.rows.joints.copy()
        joints[:, j] += value
        for _ in range(3):  # the zero of a joint that is degrees off is not linear
            case = open_case(arm.robot, replace(arm.rows, joints=joints), arm.settings, arm.chosen)
            evidence = learn(case, 0.01 * case.drive[:, :, [j]], residuals.scales)
            joints[:, j] += float(0.01 * evidence.coefficients()[0])
        value = float(joints[0, j] - arm.rows.joints[0, j])
        # Only the sum of both is in the rows: the cure removes the arm's own zero error as well.
        own = arm.settings.scales.theta
        effect = own * float(np.sqrt((arm.drive[:, :, j] ** 2).sum(axis=1).mean()))
        reading = ColumnReading(
            cause="joint-offset",
            text=f"joint {j + 1} is off by {-value / DEG:+.3f} deg, the arm's own zero error "
            f"included (sd {own / DEG:.3f} deg, {effect / MM:.3f} mm)",
            advice="check the zero of that column, and the mastering of the joint; subtract the "
            "offset itself where it is known, for the cure removes the arm's own zero error, too",
            joints=joints,
        )
        price = float(np.log(arm.robot.dof)) + 3.0
        return [examine(reading, residuals, price)] if abs(value) > LARGE else []


def find_turns(rows: MeasurementSet, robot: RobotModel) -> list[Hypothesis]:
    """Returns the joints whose rows lie in two heaps a turn apart, or beyond the limits."""
    hypotheses = []
    for j in range(robot.dof):
        turns = _turns_off(rows.joints[:, j], robot.limits[j])
        if turns.any():
            joints = rows.joints.copy()
            joints[:, j] -= TURN * turns
            hypotheses.append(
                Hypothesis(
                    cause="joint-turn",
                    text=f"joint {j + 1} is off by 360 deg",
                    log_odds=30.0,
                    rows=np.flatnonzero(turns),
                    cure=partial(replace, rows, joints=joints),
                    advice=f"subtract the turn of joint {j + 1} in these rows",
                )
            )
    return hypotheses


def _turns_off(angles: Array, limits: Array) -> Array:
    """Returns the turns (n,) that separate a joint's smaller cluster of angles; else zeros."""
    beyond = np.where(angles > limits[1] + DEG, 1.0, np.where(angles < limits[0] - DEG, -1.0, 0.0))
    if beyond.any():
        back = angles - TURN * beyond
        within = (back > limits[0] - DEG) & (back < limits[1] + DEG)
        # Else the column is that of another joint.
        return np.asarray(beyond * within.all())
    order = np.sort(angles)
    gaps = np.diff(order)
    if not len(gaps) or gaps.max() < 0.5 * TURN:
        return np.zeros_like(angles)
    edge = order[int(gaps.argmax())]
    upper = angles > edge
    wrong, sign = (upper, 1.0) if upper.sum() <= 0.5 * len(angles) else (~upper, -1.0)
    moved = angles - TURN * sign * wrong
    better = np.ptp(moved) < np.ptp(angles) - 0.5 * TURN
    return np.asarray(sign * wrong) if better else np.zeros_like(angles)
