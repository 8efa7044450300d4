"""Deviation of straight and circular moves between their compensated targets.

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
from robotrue.compensation.split_shapes import JobMoves, JobPoses, Shapes, along, loads
from robotrue.compensation.status import Status
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import UM
from robotrue.program.program import Motion, Program, Reason

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
RESOLUTION: Final = 0.1 * UM
"""Lines that are surely nearer than this are not looked at one by one."""
_ARM: Final = 0.5
"""m a turn of the tool counts for: a radian bows a line as half a metre of path does."""
_PROBED: Final = 2048
"""Lines used to estimate the curvature of the correction, this many spread evenly and as many
longest."""
_SAFETY: Final = 4.0
_FULLY: Final = 1000
"""Largest number of worst lines checked in all steps without a tolerance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Moves compensated point by point; n points of k moves.

    Attributes:
        base: (k,) row of the begin of each move; its step j is row ``base + j``.
        count: (k,) steps of each move.
        steps: Steps of a part.
        shapes: Of the moves.
        position: (n, 3) m, base, wanted.
        solved: (n,) targets to command, in the base.
    """

    base: IntArray
    count: IntArray
    steps: int
    shapes: Shapes
    position: Array
    solved: Compensation


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveDeviations:
    """Deviation of the controller's path from the compensated one, per move (k,).

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
    axes[arrival] = job.model.robot.controller.to_controller(begin)
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


def _deviations(samples: Samples) -> MoveDeviations:
    """Returns the distance of the controller's path from the points, per move; k > 0."""
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
    """Returns angles (n,) rad between commanded orientations and interpolated ones."""
    told = samples.solved.replacement.rotation
    first, last = told[node], told[node + samples.steps]
    way = rotation_vector_from_matrix(np.swapaxes(first, 1, 2) @ last)
    share = (row - node) / samples.steps
    between = first @ matrix_from_rotation_vector(share[:, None] * way)
    off = np.swapaxes(between, 1, 2) @ told[row]
    return np.asarray(np.linalg.norm(rotation_vector_from_matrix(off), axis=1))


def job_deviation(job: JobMoves, *, tolerance: float | None = None) -> MoveDeviations:
    """Returns the deviation of each move between its targets when only these are compensated.

    Arcs are looked at in 14 steps. Lines are first looked at in the middle, and in 14 steps where
    that is more than a quarter of the tolerance (without one: the thousand worst). A line is not
    looked at when it is certainly too short to matter. The bound: let ``c(t)``, t in 0..1, be the
    compensated way of a line and ``l(t)`` the straight line between ``c(0)`` and ``c(1)``. Each
    component of ``e = c - l`` vanishes at both ends, so for every t there is an s with
    ``e(t) = -t (1 - t) e''(s) / 2`` (the remainder of linear interpolation), hence
    ``|e(t)| <= max |c''| / 8``. The size of a line is ``S = L + 0.5 m * (its turn in rad)``, and
    ``c''`` grows with its square: ``|c''| <= K S^2`` with one K for the whole job, so that
    ``deviation <= K S^2 / 8``. K is four times the largest value of ``8 deviation / S^2`` seen at
    the middle of 2048 lines spread evenly over the job and of the 2048 longest. With K given this
    is a proof; that K holds for the lines not probed is an assumption about the model, which is
    smooth. A model with backlash is not: then every line is looked at.

    Args:
        job: The compensated job.
        tolerance: m that matters.

    Fails when: a correction has features narrower than the lines probed.
    """
    k = len(job.moves)
    able = _able(job)
    out = unknown_deviations(k)
    resolution = RESOLUTION if tolerance is None else max(RESOLUTION, 0.1 * tolerance)
    circular = job.moves.via[able] >= 0
    arcs, lines = able[circular], able[~circular]
    _whole(job, arcs, STEPS, out)
    out.length[lines], turn = _spans(job, lines)
    seen = _middles(job, lines, out.length[lines] + _ARM * turn, resolution, out)
    known = seen[np.isfinite(out.size[seen])]
    if tolerance is None:
        fully = known[np.argsort(-out.size[known], kind="stable")[:_FULLY]]
    else:
        fully = known[out.size[known] > 0.25 * tolerance]
    _whole(job, np.sort(fully), STEPS, out)
    return out


def _able(job: JobMoves) -> IntArray:
    """Returns the moves whose targets are all compensated, with one frame and tool."""
    moves, poses = job.moves, job.poses
    good = np.isin(job.status, GOOD) & np.isfinite(poses.position).all(axis=1)
    good &= np.isfinite(job.joints).all(axis=1)
    able = (moves.start >= 0) & (moves.end >= 0)
    for points in (moves.start, moves.end, np.where(moves.via >= 0, moves.via, moves.end)):
        at = np.where(able, points, 0)
        able &= good[at] if len(good) else False
        able &= _same_frames(poses, at, np.where(able, moves.end, 0))
    return np.flatnonzero(able)


def _same_frames(poses: JobPoses, one: IntArray, other: IntArray) -> BoolArray:
    """Returns which pairs of job rows (k,) have one work frame and one tool."""
    same = np.ones(len(one), dtype=np.bool_)
    for index, matrices in ((poses.frame, poses.frames), (poses.tool, poses.tools)):
        a, b = index[one], index[other]
        differ = np.flatnonzero(a != b)
        same[differ] = (matrices[a[differ]] == matrices[b[differ]]).all(axis=(1, 2))
    return same


def _whole(job: JobMoves, rows: IntArray, steps: int, out: MoveDeviations) -> None:
    """Looks at moves in one piece."""
    out.put(rows, measure_moves(job, rows, np.ones(len(rows), np.int64), steps=steps))


def _spans(job: JobMoves, lines: IntArray) -> tuple[Array, Array]:
    """Returns length (k,) m and turn (k,) rad of lines; with F = |R - R'|, 2 asin(F / sqrt(8))."""
    ends = job.moves.start[lines], job.moves.end[lines]
    steps = [each[ends[1]] - each[ends[0]] for each in (job.poses.position, job.poses.rotation)]
    length = np.sqrt(np.einsum("ki,ki->k", steps[0], steps[0]))
    apart = np.sqrt(np.einsum("kij,kij->k", steps[1], steps[1]))
    return length, 2.0 * np.arcsin(np.minimum(apart / np.sqrt(8.0), 1.0))


def _middles(
    job: JobMoves, lines: IntArray, size: Array, resolution: float, out: MoveDeviations
) -> IntArray:
    """Looks at the middle of the lines that may matter, returns them, and bounds the others."""
    probed = np.arange(len(lines))
    if len(lines) > 2 * _PROBED and not _backlash(job):
        longest = np.argsort(-size, kind="stable")[:_PROBED]
        spread = np.linspace(0, len(lines) - 1, _PROBED).astype(np.int64)
        probed = np.unique(np.concatenate([longest, spread]))
    _whole(job, lines[probed], COARSE, out)
    bow, far = out.size[lines[probed]], size[probed]
    usable = np.isfinite(bow) & (far > 0.0)
    ratio = 8.0 * bow[usable] / far[usable] ** 2
    curving = _SAFETY * float(ratio.max(initial=0.0))
    left = np.setdiff1d(np.arange(len(lines)), probed, assume_unique=True)
    matter = left[curving / 8.0 * size[left] ** 2 > resolution]
    _whole(job, lines[matter], COARSE, out)
    rest = np.setdiff1d(left, matter, assume_unique=True)
    out.size[lines[rest]] = curving / 8.0 * size[rest] ** 2
    out.bounded[lines[rest]] = True
    out.status[lines[rest]] = Status.COMPENSATED
    return np.asarray(lines[np.concatenate([probed, matter])])


def _backlash(job: JobMoves) -> bool:
    tables = job.model.mean_tables()
    return tables is not None and bool(np.any(tables.backlash))
