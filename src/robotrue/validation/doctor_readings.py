"""Columns of joints that were misread: shifted rows, a sign, an exchange, an offset, a turn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import apply
from robotrue.core.rotations import skew
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset, preset_names
from robotrue.validation.doctor_case import Case, open_case, robust_frame
from robotrue.validation.doctor_evidence import Evidence, columns_fit, fit_rows, learn
from robotrue.validation.doctor_suspicion import CauseName, Hypothesis

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
        text: What is wrong with the present one.
        advice: What to do.
        rows: The set as it then reads.
        robot: The arm as it then is.
        lost: Rows that have no joints then.
    """

    cause: CauseName
    text: str
    advice: str
    rows: MeasurementSet
    robot: RobotModel
    lost: IntArray = field(default_factory=lambda: NO_ROWS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Misread:
    """Columns read in another order or sense, rows shifted, another robot stated."""

    def look(self, rows: MeasurementSet, residuals: Evidence, arm: Case) -> Sequence[Hypothesis]:
        """Returns the readings that fit much better, examined in full."""
        some = arm.chosen[:: -(-len(arm.chosen) // COMPARED)]
        allowed = BETTER * nominal_misfit(arm.robot, arm.rows.subset(some))
        tried = list(list_readings(arm.robot, arm.rows))
        misfits = [nominal_misfit(each.robot, each.rows.subset(some)) for each in tried]
        order = np.argsort(misfits)[:EXAMINED]
        return [
            examine(tried[k], rows, residuals, arm, float(np.log(len(tried))))
            for k in order.tolist()
            if misfits[k] < allowed
        ]


def examine(
    reading: ColumnReading, rows: MeasurementSet, residuals: Evidence, arm: Case, price: float
) -> Hypothesis:
    """Returns the hypothesis of a reading: its own fit against that of the file as it stands."""
    case = open_case(reading.robot, reading.rows, arm.settings, arm.chosen)
    odds = fit_rows(case).log_evidence - residuals.log_evidence - price
    other = reading.robot is not arm.robot
    put_right = replace(rows, joints=reading.rows.joints)
    wrong = np.flatnonzero((reading.rows.joints != rows.joints).any(axis=1))
    return Hypothesis(
        cause=reading.cause,
        text=reading.text,
        log_odds=odds,
        rows=wrong if len(wrong) else np.arange(len(rows)),
        cured=None if other else put_right.subset(np.setdiff1d(np.arange(len(rows)), reading.lost)),
        advice=reading.advice,
        robot=reading.robot if other else None,
    )


def list_readings(robot: RobotModel, rows: MeasurementSet) -> Iterator[ColumnReading]:
    """Yields every other reading of the joint columns, and other robots of the size."""
    joints = rows.joints
    for step, word in ((-1, "before"), (1, "after")):
        moved = np.roll(joints, step, axis=0)
        moved[-1 if step < 0 else 0] = np.nan
        # The joints of a row are those of the row before: its own stand in the row after.
        yield ColumnReading(
            cause="shifted-rows",
            text=f"joints are those of the row {word}",
            advice="export joints and points by one trigger; the cure shifts them back by a row",
            rows=_fill_end(rows, moved),
            lost=np.flatnonzero(np.isnan(moved).any(axis=1)),
            robot=robot,
        )
    for j in range(robot.dof):
        turned = joints.copy()
        turned[:, j] *= -1.0
        yield ColumnReading(
            cause="joint-sign",
            text=f"joint {j + 1} has the wrong sign",
            advice=f"change the sign of joint {j + 1} in the column mapping",
            rows=replace(rows, joints=turned),
            robot=robot,
        )
    for a, b in combinations(range(robot.dof), 2):
        swapped = joints.copy()
        swapped[:, [a, b]] = joints[:, [b, a]]
        yield ColumnReading(
            cause="joints-exchanged",
            text=f"the columns of joints {a + 1} and {b + 1} are exchanged",
            advice=f"exchange joints {a + 1} and {b + 1} in the column mapping",
            rows=replace(rows, joints=swapped),
            robot=robot,
        )
    for name in preset_names():
        other = preset(name)
        near = abs(other.reach / robot.with_tool(np.eye(4)).reach - 1.0) < SAME_SIZE
        if other.dof == robot.dof and near and other.name != robot.name:
            yield ColumnReading(
                cause="preset",
                text=f"the arm is a {other.name}, the cell states {robot.name}",
                advice=f'write preset = "{other.name}" in the cell file',
                rows=rows,
                robot=other.with_tool(robot.T_flange_tool),
            )


def _fill_end(rows: MeasurementSet, joints: Array) -> MeasurementSet:
    """Rows with shifted joints; the row at the end that has none keeps its own."""
    lost = np.asarray(np.isnan(joints).any(axis=1))
    filled = np.where(lost[:, None], rows.joints, joints)
    return replace(rows, joints=filled)


def nominal_misfit(robot: RobotModel, rows: MeasurementSet) -> float:
    """Returns the rms distance in m from the nominal arm after frames and reflector, trimmed."""
    T = forward(robot.nominal(), rows.joints)
    points, flange = T[:, :3, 3], T[:, :3, :3] @ robot.T_flange_tool[:3, :3].T
    squares = []
    for station in np.unique(rows.station).tolist():
        mine = rows.station == station
        squares.append(_aligned_squares(points[mine], flange[mine], rows.position[mine]))
    size = np.sort(np.concatenate(squares))
    kept = size[: max(int(TRIMMED * len(size)), 1)]
    return float(np.sqrt(kept.mean()))


def _aligned_squares(points: Array, flange: Array, seen: Array) -> Array:
    """Squared distances (n,) m^2 after the best frame and reflector, by trimmed steps."""
    if len(points) < 4:
        return np.zeros(len(points))
    offset = np.zeros(3)
    gap = np.zeros_like(points)
    for _ in range(ROUNDS):
        moved = points + flange @ offset
        T = robust_frame(moved, seen, DRAWS)
        placed = apply(T, moved)
        gap = seen - placed
        turn = T[:3, :3] @ flange
        columns = np.concatenate(
            [np.broadcast_to(np.eye(3), turn.shape), -skew(placed - placed.mean(axis=0)), turn],
            axis=2,
        )
        size = (gap**2).sum(axis=1)
        near = size <= np.quantile(size, TRIMMED)
        flat = columns[near].reshape(-1, 9)
        step = np.linalg.lstsq(flat, gap[near].ravel(), rcond=1e-8)[0]
        gap = gap - (columns @ step)
        offset = offset + np.clip(step[6:], -0.3, 0.3)
    return np.asarray((gap**2).sum(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class JointOffset:
    """A joint whose zero is elsewhere by more than mastering leaves.

    Rows show the offset of the file and the zero error of the arm as one angle. A model of the
    cured rows predicts rows that are read and cured alike as well as one of clean rows does; at the
    controller's joints it lacks the arm's own zero error of that joint.
    """

    def look(self, rows: MeasurementSet, residuals: Evidence, arm: Case) -> Sequence[Hypothesis]:
        """Returns the joint that explains most, its offset found by three fits."""
        odds = [columns_fit(residuals, arm.drive[:, :, [j]], OFFSETS)[0]
                for j in range(arm.robot.dof)]  # fmt: skip
        j = int(np.argmax(odds))
        if odds[j] < 0.0:
            return ()
        evidence = learn(arm, OFFSETS[-1] * arm.drive[:, :, [j]], residuals.scales)
        value = float(OFFSETS[-1] * evidence.coefficients()[0])
        if abs(value) < LARGE:
            return ()
        joints = rows.joints.copy()
        joints[:, j] += value
        for _ in range(3):  # the zero of a joint that is degrees off is not linear
            case = open_case(arm.robot, replace(rows, joints=joints), arm.settings, arm.chosen)
            evidence = learn(case, 0.01 * case.drive[:, :, [j]], residuals.scales)
            joints[:, j] += float(0.01 * evidence.coefficients()[0])
        value = float(joints[0, j] - rows.joints[0, j])
        # Only the sum of both is in the rows: the cure removes the arm's own zero error as well.
        own = arm.settings.scales.theta
        effect = own * float(np.sqrt((arm.drive[:, :, j] ** 2).sum(axis=1).mean()))
        reading = ColumnReading(
            cause="joint-offset",
            text=f"joint {j + 1} is off by {-value / DEG:+.3f} deg, the arm's own zero error "
            f"included (sd {own / DEG:.3f} deg, {effect / MM:.3f} mm)",
            advice="check the zero of that column, and the mastering of the joint; subtract the "
            "offset itself where it is known, for the cure removes the arm's own zero error, too",
            rows=replace(arm.rows, joints=joints),
            robot=arm.robot,
        )
        price = float(np.log(arm.robot.dof)) + 3.0
        return [examine(reading, rows, residuals, arm, price)] if abs(value) > LARGE else []


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTurn:
    """Rows with a joint a full turn away from the others."""

    def look(self, rows: MeasurementSet, residuals: Evidence, arm: Case) -> Sequence[Hypothesis]:
        """Returns the joints whose rows lie in two heaps a turn apart, or beyond the limits."""
        out = []
        for j in range(arm.robot.dof):
            turns = _turns_off(rows.joints[:, j], arm.robot.limits[j])
            wrong = np.flatnonzero(turns)
            if not len(wrong):
                continue
            joints = rows.joints.copy()
            joints[:, j] -= TURN * turns
            out.append(
                Hypothesis(
                    cause="joint-turn",
                    text=f"joint {j + 1} is off by 360 deg",
                    log_odds=30.0,
                    rows=wrong,
                    cured=replace(rows, joints=joints),
                    advice=f"subtract the turn of joint {j + 1} in these rows",
                )
            )
        return out


def _turns_off(angles: Array, limits: Array) -> Array:
    """Turns (n,) by which the smaller heap of a joint's angles stands away; zeros if none does."""
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
