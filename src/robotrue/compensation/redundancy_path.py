"""Runs of a program that one rotation about the tool axis can go through, with points in between.

A run starts where a joint move ends (or at an axis target, which stays as it is) and continues
through straight moves, arcs and splines up to the next joint move. Between far targets points are
added where the controller drives: on the line or the circle, attitude turned evenly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.compensation.arcs import circles, on_circles
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.program import Motion, Program, Reason

_TURN_LENGTH: Final = 0.2
"""m of path that a radian of attitude counts as."""
_TURN: Final = 5.0 * DEG
_APART: Final = 20.0 * MM


@dataclass(frozen=True, slots=True, kw_only=True)
class SpinRun:
    """n targets one after the other, n at least 2.

    Attributes:
        rows: (n,) rows of the program; all but the first are reached by feeding moves.
        fixed: The first is an axis target.
        fault: Why the run is left as it is; empty if it need not be.
    """

    rows: IntArray
    fixed: bool
    fault: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DenseRun:
    """A run with points between far targets.

    Attributes:
        position: (d, 3) m in base.
        first: (d,) target whose attitude the move begins with.
        last: (d,) target whose attitude it ends with.
        share: (d,) completed share of the turn from one to the other.
        target: (d,) target the point leads to.
        at: (n,) where the targets are.
        along: (d,) m of path so far; turns count as well.
    """

    position: Array
    first: IntArray
    last: IntArray
    share: Array
    target: IntArray
    at: IntArray
    along: Array

    def attitudes(self, rotation: Array) -> Array:
        """Returns R_base_tool (d, 3, 3) on the way, from those of the targets (n, 3, 3)."""
        begin, end = rotation[self.first], rotation[self.last]
        turn = rotation_vector_from_matrix(np.swapaxes(begin, 1, 2) @ end)
        out = begin @ matrix_from_rotation_vector(self.share[:, None] * turn)
        whole = self.share[self.at] == 1.0  # an arc does not take the attitude of its via point
        out[self.at[whole]] = rotation[whole]
        return np.asarray(out)


def runs_of(program: Program, known: BoolArray) -> tuple[SpinRun, ...]:
    """Returns the runs of a program in file order.

    Args:
        program: As read.
        known: (n,) pose and joints of the target are known.
    """
    used = np.flatnonzero(program.motion != Motion.UNUSED)
    feeding = np.isin(
        program.motion[used], (Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.SPLINE)
    )
    starts = np.flatnonzero(~feeding)
    if len(used) and feeding[0]:
        starts = np.concatenate([[0], starts])
    out = []
    for begin, end in zip(starts, np.append(starts[1:], len(used)), strict=True):
        rows = used[begin:end]
        if len(rows) > 1:
            out.append(_run(program, rows, known))
    return tuple(out)


def _run(program: Program, rows: IntArray, known: BoolArray) -> SpinRun:
    axes = np.asarray(program.reason[rows] == Reason.JOINT_TARGET)
    fault = ""
    if (program.reason[rows][~axes] != Reason.NONE).any():
        fault = "a target among them cannot be read"
    elif axes[1:].any():
        fault = "an axis target is reached by a straight move"
    elif (program.tool[rows] != program.tool[rows[-1]]).any():
        fault = "the tool changes on the way"
    elif not known[rows].all():
        fault = "the arm does not reach all of them as they stand"
    return SpinRun(rows=rows, fixed=bool(axes[0]), fault=fault)


def dense_run(position: Array, rotation: Array, motion: IntArray) -> DenseRun:
    """Returns a run with points every 20 mm and every 5 deg.

    Args:
        position: (n, 3) m in base.
        rotation: (n, 3, 3) in base.
        motion: (n,) :class:`~robotrue.program.program.Motion`.
    """
    n = len(position)
    end = np.flatnonzero(motion == Motion.ARC_END)
    end = end[(end > 1) & (motion[end - 1] == Motion.ARC_VIA)]
    circle = circles(position[end - 2], position[end - 1], position[end])
    round_ = np.isfinite(circle.radius)
    first, last = np.maximum(np.arange(n) - 1, 0), np.arange(n)
    begin, finish = np.zeros(n), np.ones(n)  # share of the turn at the ends of each move
    first[end], last[end - 1] = end - 2, end
    half = np.where(round_, circle.second / np.where(round_, circle.third, 1.0), 0.5)
    begin[end], finish[end - 1] = half, half
    length = np.linalg.norm(position - position[np.maximum(np.arange(n) - 1, 0)], axis=1)
    length[end[round_] - 1] = (circle.radius * circle.second)[round_]
    length[end[round_]] = (circle.radius * (circle.third - circle.second))[round_]
    turn = np.linalg.norm(
        rotation_vector_from_matrix(np.swapaxes(rotation[first], 1, 2) @ rotation[last]), axis=1
    ) * (finish - begin)
    parts = np.maximum(np.ceil(np.maximum(length / _APART, turn / _TURN)), 1.0).astype(np.int64)
    parts[0] = 1
    at = np.cumsum(parts) - 1
    target = np.repeat(np.arange(n), parts)
    blend = (np.arange(len(target)) - (at - parts)[target]) / parts[target]
    before = position[np.maximum(target - 1, 0)]
    place = before + blend[:, None] * (position[target] - before)
    number = np.full(n, -1)
    number[end - 1] = number[end] = np.where(round_, np.arange(len(end)), -1)
    low, high = np.zeros(n), np.zeros(n)
    low[end], high[end - 1], high[end] = circle.second, circle.second, circle.third
    curved = np.flatnonzero(number[target] >= 0)
    t = target[curved]
    place[curved] = on_circles(circle, number[t], low[t] + blend[curved] * (high - low)[t])
    step = ((length + _TURN_LENGTH * turn) / parts)[target]
    step[0] = 0.0
    return DenseRun(
        position=place,
        first=first[target],
        last=last[target],
        share=begin[target] + blend * (finish - begin)[target],
        target=target,
        at=at,
        along=np.cumsum(step),
    )
