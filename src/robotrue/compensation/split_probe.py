"""Moves compensated point by point, and how far the controller's own way between the ends is off.

A move is cut into equal parts, a part into equal steps. Every step is compensated as a target of
its own, under the force that acts there. What the controller does instead is a straight line
between the compensated ends of a part, or the circle through its compensated begin, middle and end;
where a language has arcs of a plane only, that circle seen along the normal of the plane.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.compensation.arcs import circles, from_circles, from_helices, from_segments
from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.split_shapes import JobMoves, Shapes, along, loads
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
GOOD: Final = (Status.COMPENSATED, Status.UNCHANGED_NO_ERROR)
"""Where the arm lands on the target."""
_ROWS: Final = 1 << 16
"""Points compensated at a time."""
_EXACT: Final = 1e-10
"""m and rad the inversion may leave here: deviations of short moves are small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Moves compensated point by point; n points of k moves.

    Attributes:
        base: (k,) row of the begin of each move; its step j is row ``base + j``.
        count: (k,) steps of each move.
        steps: Steps of a part.
        shapes: Of the moves.
        position: (n, 3) m, base, wanted.
        solved: (n,) what the controller would have to be told, in the base.
    """

    base: IntArray
    count: IntArray
    steps: int
    shapes: Shapes
    position: Array
    solved: Compensation


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveDeviations:
    """How far the controller's way is from the compensated one, per move (k,).

    Attributes:
        size: m, largest distance; NaN where a point could not be compensated, or is not known.
        bounded: ``size`` was not measured but is a bound, see
            :func:`~robotrue.compensation.split_deviation.job_deviation`.
        turn: rad, largest angle between the two orientations; NaN where not measured.
        at: Fraction of the move where the distance is largest; NaN likewise.
        place: (k, 3) m, base, wanted position there; NaN likewise.
        length: m of path.
        status: :class:`Status` that explains what is not known; ``UNCHANGED_SOURCE`` where the move
            has no begin or end that is compensated.
    """

    size: Array
    bounded: BoolArray
    turn: Array
    at: Array
    place: Array
    length: Array
    status: IntArray

    def put(self, rows: IntArray | slice, found: MoveDeviations) -> None:
        """Replaces what is known of some moves."""
        for name in self.__slots__:
            getattr(self, name)[rows] = getattr(found, name)


def unknown_deviations(k: int) -> MoveDeviations:
    """Returns room for the deviations of k moves."""
    size, turn, at, length = np.full((4, k), np.nan)
    return MoveDeviations(
        size=size,
        bounded=np.zeros(k, dtype=np.bool_),
        turn=turn,
        at=at,
        place=np.full((k, 3), np.nan),
        length=length,
        status=np.full(k, int(Status.UNCHANGED_SOURCE)),
    )


def measure_moves(
    job: JobMoves, rows: IntArray, parts: IntArray, *, steps: int = STEPS
) -> MoveDeviations:
    """Returns the deviations of some moves (k,), each cut into its number of equal parts."""
    out, first = unknown_deviations(len(rows)), 0
    for samples in sample_moves(job, rows, parts, steps):
        last = first + len(samples.base)
        out.put(slice(first, last), _deviations(samples))
        first = last
    return out


def sample_moves(job: JobMoves, rows: IntArray, parts: IntArray, steps: int) -> Iterator[Samples]:
    """Yields runs of the moves (k,) with their points compensated, in order.

    Args:
        job: The compensated job.
        rows: (k,) moves.
        parts: (k,) equal parts of each.
        steps: Steps of a part; even.
    """
    points, first = np.cumsum(parts * steps + 2), 0
    while first < len(rows):
        before = int(points[first - 1]) if first else 0
        last = max(first + 1, int(np.searchsorted(points, before + _ROWS, side="right")))
        yield _sample(job, rows[first:last], parts[first:last], steps)
        first = last


def _sample(job: JobMoves, rows: IntArray, parts: IntArray, steps: int) -> Samples:
    """Returns moves compensated point by point; joints at the begin choose the branch."""
    moves, shapes = job.moves, job.shapes(rows)
    k, count = len(parts), parts * steps
    # A move that does not begin where the one before it ends has two rows more: an axis target that
    # brings the arm there, and its begin.
    fresh = np.ones(k, dtype=np.bool_)
    fresh[1:] = moves.start[rows[1:]] != moves.end[rows[:-1]]
    points = count + 2 * fresh
    base = np.cumsum(points) - count - 1
    move = np.repeat(np.arange(k), points)
    n = len(move)
    step = np.arange(n) - base[move]
    t = np.clip(step / count[move], 0.0, 1.0)
    position, rotation = along(shapes, move, t)
    arrival = base[fresh] - 1
    axes = np.full((n, 6), np.nan)
    begin = job.joints[moves.start[rows[fresh]]]
    axes[arrival] = _controller(job.model.robot).to_controller(begin)
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
        tool=job.poses.tool[moves.end[rows]][move],
        T_base_frame=np.eye(4)[None],
        T_flange_tool=job.poses.tools,
    )
    settings = _settings(job.settings, loads(shapes, move, t))
    solved = compensate(job.model, program, settings=settings)
    return Samples(
        base=base, count=count, steps=steps, shapes=shapes, position=position, solved=solved
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


def _deviations(samples: Samples) -> MoveDeviations:
    """Returns how far the controller's way is from the points, per move; k > 0."""
    shapes, steps = samples.shapes, samples.steps
    told, status = samples.solved.replacement.position, samples.solved.status
    first = np.cumsum(samples.count) - samples.count
    move = np.repeat(np.arange(len(first)), samples.count)
    inside = np.arange(len(move)) - first[move]
    row = samples.base[move] + inside
    node = row - inside % steps
    size = from_segments(told[row], told[node], told[node + steps])
    flat = np.isfinite(shapes.normal[:, 0])
    bow = np.flatnonzero((shapes.circular & ~flat)[move])
    if len(bow):
        size[bow] = _from_arcs(told, row[bow], node[bow], steps)
    # An arc of a plane is kept whole, or becomes lines.
    bow = np.flatnonzero((flat & (samples.count == steps))[move])
    if len(bow):
        begin, middle, end = (told[node[bow] + k] for k in (0, steps // 2, steps))
        size[bow] = from_helices(told[row[bow]], begin, middle, end, shapes.normal[move[bow]])
    fault = np.where(np.isin(status, GOOD), 0, status)
    faults = np.maximum.reduceat(fault[row], first)
    faults = np.maximum(faults, fault[samples.base + samples.count])
    size = np.where(np.isfinite(size), size, np.inf)
    largest = np.maximum.reduceat(size, first)
    peaks = np.flatnonzero(size == largest[move])
    worst = peaks[np.searchsorted(move[peaks], np.arange(len(first)))]
    known = np.isfinite(largest) & (faults == 0)
    turn = np.maximum.reduceat(_turns(samples, row, node), first)
    return MoveDeviations(
        size=np.where(known, largest, np.nan),
        bounded=np.zeros(len(first), dtype=np.bool_),
        turn=np.where(known, turn, np.nan),
        at=inside[worst] / samples.count,
        place=samples.position[row[worst]],
        length=shapes.length,
        status=np.where(known, int(Status.COMPENSATED), faults),
    )


def _from_arcs(told: Array, row: IntArray, node: IntArray, steps: int) -> Array:
    """Distances (n,) m of points from the circles of their parts."""
    parts, which = np.unique(node, return_inverse=True)
    circle = circles(*(told[parts + k] for k in (0, steps // 2, steps)))
    return from_circles(told[row], circle, which.astype(np.int64))


def _turns(samples: Samples, row: IntArray, node: IntArray) -> Array:
    """Angles (n,) rad between the orientations told and those interpolated between the nodes."""
    told = samples.solved.replacement.rotation
    first, last = told[node], told[node + samples.steps]
    way = rotation_vector_from_matrix(np.swapaxes(first, 1, 2) @ last)
    share = (row - node) / samples.steps
    between = first @ matrix_from_rotation_vector(share[:, None] * way)
    off = np.swapaxes(between, 1, 2) @ told[row]
    return np.asarray(np.linalg.norm(rotation_vector_from_matrix(off), axis=1))
