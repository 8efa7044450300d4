"""Moves compensated point by point, and how far the controller's own way between the ends is off.

A move is cut into equal parts, a part into equal steps. Every step is compensated as a target of
its own, under the force that acts there. What the controller does instead is a straight line
between the compensated ends of a part, or the circle through its compensated begin, middle and end;
where a language has arcs of a plane only, that circle seen along the normal of the plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.arcs import circles, from_circles, from_helices, from_segments
from robotrue.compensation.compensate import compensate
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.split_shapes import Shapes, along, loads
from robotrue.compensation.status import Status
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.program.program import Motion, Program, Reason
from robotrue.robot.model import Configuration, RobotModel

STEPS: Final = 14
"""Steps of a part: a line is furthest off in the middle, an arc 0.211 from either end (3 / 14)."""
COARSE: Final = 2
"""Steps of a part when only the middle of a line is looked at."""
_EXACT: Final = 1e-10
"""m and rad the inversion may leave here: deviations of short moves are small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Moves compensated point by point; n points of k moves.

    Attributes:
        base: (k,) row of the begin of each move; its step j is row ``base + j``.
        count: (k,) steps of each move.
        steps: Steps of a part.
        circular: (k,) arcs.
        normal: (k, 3) of the plane that an arc cannot leave; NaN for all others.
        fresh: (k,) the begin is not the end of the move before.
        position: (n, 3) m, base, wanted.
        told: (n, 3) m, base, what the controller would have to be told.
        rotation: (n, 3, 3) wanted.
        told_rotation: (n, 3, 3) likewise.
        joints: (n, 6) rad commanded.
        status: (n,) :class:`Status`.
    """

    base: IntArray
    count: IntArray
    steps: int
    circular: BoolArray
    normal: Array
    fresh: BoolArray
    position: Array
    told: Array
    rotation: Array
    told_rotation: Array
    joints: Array
    status: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviations:
    """How far the controller's way is from the compensated one, per move (k,).

    Attributes:
        size: m, largest distance; NaN where a point could not be compensated.
        turn: rad, largest angle between the two orientations there.
        at: Fraction of the move where the distance is largest.
        place: (k, 3) m, base, wanted position there.
        status: :class:`Status` of the points; not ``COMPENSATED`` where ``size`` is NaN.
    """

    size: Array
    turn: Array
    at: Array
    place: Array
    status: IntArray


def sample(
    model: ErrorModel,
    shapes: Shapes,
    tools: Array,
    tool: IntArray,
    begin: Array,
    linked: BoolArray,
    parts: IntArray,
    steps: int,
    settings: CompensationSettings,
) -> Samples:
    """Returns moves compensated point by point.

    Args:
        model: Error of the robot.
        shapes: k moves.
        tools: (t, 4, 4) T_flange_tool.
        tool: (k,) index into ``tools``.
        begin: (k, 6) rad, joints at the begin of each move: they choose the branch.
        linked: (k,) the move begins where the one before it here ends.
        parts: (k,) equal parts of each.
        steps: Steps of a part; even.
        settings: Guards; its load is replaced by that of the shapes where they have one.
    """
    k = len(parts)
    count = parts * steps
    fresh = ~linked
    # A fresh move has two rows more: an axis target that brings the arm there, and its begin.
    rows = count + 2 * fresh
    ends = np.cumsum(rows)
    base = ends - count - 1
    n = int(ends[-1]) if k else 0
    move = np.repeat(np.arange(k), rows)
    step = np.arange(n) - base[move]
    t = np.clip(step / count[move], 0.0, 1.0)
    position, rotation = along(shapes, move, t)
    arrival = base[fresh] - 1
    axes = np.full((n, 6), np.nan)
    axes[arrival] = _controller(model.robot).to_controller(begin[fresh])
    reason = np.zeros(n, dtype=np.int64)
    reason[arrival] = Reason.JOINT_TARGET
    program = Program(
        name="",
        dialect="",
        data=b"",
        position=position,
        rotation=rotation,
        axes=axes,
        motion=np.where(reason > 0, int(Motion.PTP), int(Motion.LIN)),
        reason=reason,
        words=np.full((n, 0), NO_WORD),
        words_of="",
        line=np.zeros(n, dtype=np.int64),
        frame=np.zeros(n, dtype=np.int64),
        tool=tool[move],
        T_base_frame=np.eye(4)[None],
        T_flange_tool=tools,
    )
    found = compensate(model, program, settings=_settings(settings, loads(shapes, move, t)))
    return Samples(
        base=base,
        count=count,
        steps=steps,
        circular=shapes.circular,
        normal=shapes.normal,
        fresh=fresh,
        position=position,
        told=found.replacement.position,
        rotation=rotation,
        told_rotation=found.replacement.rotation,
        joints=found.joints,
        status=found.status,
    )


def _settings(settings: CompensationSettings, wrench: Array) -> CompensationSettings:
    exact = replace(
        settings,
        covariance=False,
        axis_targets=False,
        min_shift=0.0,
        tolerance=min(settings.tolerance, _EXACT),
        turn_tolerance=min(settings.turn_tolerance, _EXACT),
    )
    return replace(exact, wrench=wrench) if len(wrench) else exact


def _controller(robot: RobotModel) -> Configuration:
    own = Configuration(sign=np.ones(robot.dof), offset=np.zeros(robot.dof))
    return robot.controller or own


def deviations(samples: Samples) -> Deviations:
    """Returns how far the controller's way is from the points, per move."""
    k, steps = len(samples.base), samples.steps
    move = np.repeat(np.arange(k), samples.count)
    inside = np.arange(len(move)) - np.repeat(
        np.cumsum(samples.count) - samples.count, samples.count
    )
    node = samples.base[move] + inside - inside % steps
    row = samples.base[move] + inside
    size = from_segments(samples.told[row], samples.told[node], samples.told[node + steps])
    flat = np.isfinite(samples.normal[:, 0])
    bow = np.flatnonzero((samples.circular & ~flat)[move])
    if len(bow):
        size[bow] = _from_arcs(samples, row[bow], node[bow])
    # An arc of a plane is kept whole, or becomes lines.
    bow = np.flatnonzero((flat & (samples.count == steps))[move])
    if len(bow):
        begin, middle, end = (samples.told[node[bow] + k] for k in (0, steps // 2, steps))
        normal = samples.normal[move[bow]]
        size[bow] = from_helices(samples.told[row[bow]], begin, middle, end, normal)
    turn = _turned(samples, row, node)
    good = np.isin(samples.status, (Status.COMPENSATED, Status.UNCHANGED_NO_ERROR))
    first = np.cumsum(samples.count) - samples.count
    bad = np.where(good[row], 0, samples.status[row])
    last = samples.base + samples.count
    status = np.maximum(
        np.maximum.reduceat(bad, first) if k else np.empty(0, np.int64),
        np.where(good[last], 0, samples.status[last]),
    )
    size = np.where(np.isfinite(size), size, np.inf)
    largest = np.maximum.reduceat(size, first) if k else np.empty(0)
    found = np.flatnonzero(size == largest[move])
    worst = found[np.searchsorted(move[found], np.arange(k))]
    known = np.isfinite(largest) & (status == 0)
    return Deviations(
        size=np.where(known, largest, np.nan),
        turn=np.where(known, np.maximum.reduceat(turn, first) if k else np.empty(0), np.nan),
        at=inside[worst] / samples.count,
        place=samples.position[row[worst]],
        status=np.where(known, int(Status.COMPENSATED), status),
    )


def _from_arcs(samples: Samples, row: IntArray, node: IntArray) -> Array:
    """Distances (n,) m of points from the circles of their parts."""
    parts, which = np.unique(node, return_inverse=True)
    middle = parts + samples.steps // 2
    through = [samples.told[each] for each in (parts, middle, parts + samples.steps)]
    return from_circles(samples.told[row], circles(*through), which.astype(np.int64))


def _turned(samples: Samples, row: IntArray, node: IntArray) -> Array:
    """Angles (n,) rad between the orientations told and those interpolated between the nodes."""
    first, last = samples.told_rotation[node], samples.told_rotation[node + samples.steps]
    way = rotation_vector_from_matrix(np.swapaxes(first, 1, 2) @ last)
    share = (row - node) / samples.steps
    between = first @ matrix_from_rotation_vector(share[:, None] * way)
    off = np.swapaxes(between, 1, 2) @ samples.told_rotation[row]
    return np.asarray(np.linalg.norm(rotation_vector_from_matrix(off), axis=1))
