"""How far every straight or circular move of a job is off between its compensated targets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.split_probe import (
    COARSE,
    STEPS,
    Deviations,
    Samples,
    deviations,
    sample,
)
from robotrue.compensation.split_shapes import JobPoses, Shapes, job_poses, shapes_of
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError
from robotrue.program.insertion import Moves
from robotrue.program.program import Program
from robotrue.robot.statics import Load

RESOLUTION: Final = 0.1 * UM
"""Lines that are surely nearer than this are not looked at one by one."""
_ARM: Final = 0.5
"""m a turn of the tool counts for: a radian bows a line as half a metre of path does."""
_PROBED: Final = 2048
"""Lines that tell how strongly the correction curves: so many spread evenly, so many longest."""
_SAFETY: Final = 4.0
_FULLY: Final = 1000
"""Most worst lines looked at in all steps when no tolerance says which."""
_ROWS: Final = 1 << 16
"""Points compensated at a time."""
_GOOD: Final = (Status.COMPENSATED, Status.UNCHANGED_NO_ERROR)


@dataclass(frozen=True, slots=True, kw_only=True)
class JobMoves:
    """What is needed of a compensated job to look between its targets.

    Attributes:
        model: Error of the robot.
        moves: The k moves.
        poses: Its targets in the base.
        joints: (n, 6) rad commanded at every job row.
        status: (n,) :class:`Status` of every job row.
        load: (n, 6) N, N m, base, of every job row where it changes; else empty.
        settings: Guards, and the load where it does not change.
    """

    model: ErrorModel
    moves: Moves
    poses: JobPoses
    joints: Array
    status: IntArray
    load: Array
    settings: CompensationSettings

    def shapes(self, rows: IntArray) -> Shapes:
        """Returns the shapes of some moves."""
        return shapes_of(self.poses, self.moves, rows, self.load)


def job_moves(
    model: ErrorModel,
    job: Sequence[Program],
    moves: Moves,
    results: Sequence[Compensation],
    settings: Sequence[CompensationSettings],
) -> JobMoves:
    """Returns a compensated job for the functions here; one result and settings per program.

    Raises:
        ConfigurationError: The payload changes from target to target.
    """
    for program, each in zip(job, settings, strict=True):
        if max(len(each.load.mass), len(each.load.com)) > 1:
            raise ConfigurationError(
                f"the payload changes from target to target of {program.name}; what it is between "
                "them is not known.",
                hint="give one payload, or leave the deviation and the splitting away.",
            )
    wrenches = [
        np.broadcast_to(each.load_for(len(program)).wrench, (len(program), 6))
        for program, each in zip(job, settings, strict=True)
    ]
    load = np.concatenate(wrenches)
    first = settings[0].load
    common = replace(
        settings[0],
        load=Load(mass=first.mass, com=first.com),
        wrench=load[:1] if load[:1].any() else np.empty(0),
    )
    if not len(load) or (load == load[0]).all():
        load = np.empty((0, 6))
    return JobMoves(
        model=model,
        moves=moves,
        poses=job_poses(job),
        joints=np.concatenate([each.joints for each in results]),
        status=np.concatenate([each.status for each in results]),
        load=load,
        settings=common,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class JobDeviation:
    """Deviation of the k moves of a job when they are kept whole.

    Attributes:
        size: (k,) m; NaN where it is not known.
        bounded: (k,) ``size`` was not measured but is a bound, see :func:`job_deviation`.
        turn: (k,) rad, largest angle between orientations; NaN where not measured.
        at: (k,) fraction of the move of the worst point; NaN likewise.
        place: (k, 3) m, base, wanted position there; NaN likewise.
        length: (k,) m of path.
        status: (k,) :class:`Status` that explains what is not known; ``UNCHANGED_SOURCE`` where the
            move has no begin or end that is compensated.
    """

    size: Array
    bounded: BoolArray
    turn: Array
    at: Array
    place: Array
    length: Array
    status: IntArray


def job_deviation(job: JobMoves, *, tolerance: float | None = None) -> JobDeviation:
    """Returns how far each move is off its compensated path when only its targets are compensated.

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
    out = _unknown(k)
    resolution = RESOLUTION if tolerance is None else max(RESOLUTION, 0.1 * tolerance)
    circular = job.moves.via[able] >= 0
    arcs, lines = able[circular], able[~circular]
    out.length[arcs] = job.shapes(arcs).length
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
    good = np.isin(job.status, _GOOD) & np.isfinite(poses.position).all(axis=1)
    good &= np.isfinite(job.joints).all(axis=1)
    able = (moves.start >= 0) & (moves.end >= 0)
    for points in (moves.start, moves.end, np.where(moves.via >= 0, moves.via, moves.end)):
        at = np.where(able, points, 0)
        able &= good[at] if len(good) else False
        able &= same_frames(poses, at, np.where(able, moves.end, 0))
    return np.flatnonzero(able)


def same_frames(poses: JobPoses, one: IntArray, other: IntArray) -> BoolArray:
    """Returns which pairs of job rows (k,) have one work frame and one tool."""
    same = np.ones(len(one), dtype=np.bool_)
    for index, matrices in ((poses.frame, poses.frames), (poses.tool, poses.tools)):
        a, b = index[one], index[other]
        differ = np.flatnonzero(a != b)
        same[differ] = (matrices[a[differ]] == matrices[b[differ]]).all(axis=(1, 2))
    return same


def _unknown(k: int) -> JobDeviation:
    return JobDeviation(
        size=np.full(k, np.nan),
        bounded=np.zeros(k, dtype=np.bool_),
        turn=np.full(k, np.nan),
        at=np.full(k, np.nan),
        place=np.full((k, 3), np.nan),
        length=np.full(k, np.nan),
        status=np.full(k, int(Status.UNCHANGED_SOURCE)),
    )


def _whole(job: JobMoves, rows: IntArray, steps: int, out: JobDeviation) -> None:
    """Looks at moves in one piece."""
    found = measured(job, rows, np.ones(len(rows), np.int64), steps=steps)
    for name in ("size", "turn", "at", "place", "status"):
        getattr(out, name)[rows] = getattr(found, name)


def _spans(job: JobMoves, lines: IntArray) -> tuple[Array, Array]:
    """Returns length (k,) m and turn (k,) rad of lines; with F = |R - R'|, 2 asin(F / sqrt(8))."""
    ends = job.moves.start[lines], job.moves.end[lines]
    steps = [each[ends[1]] - each[ends[0]] for each in (job.poses.position, job.poses.rotation)]
    length = np.sqrt(np.einsum("ki,ki->k", steps[0], steps[0]))
    apart = np.sqrt(np.einsum("kij,kij->k", steps[1], steps[1]))
    return length, 2.0 * np.arcsin(np.minimum(apart / np.sqrt(8.0), 1.0))


def _middles(
    job: JobMoves, lines: IntArray, size: Array, resolution: float, out: JobDeviation
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
    tables = job.model.mean_tables(job.settings.load)
    return tables is not None and bool(np.any(tables.backlash))


def measured(job: JobMoves, rows: IntArray, parts: IntArray, *, steps: int = STEPS) -> Deviations:
    """Returns the deviations of some moves (k,), each cut into its number of equal parts."""
    found = [deviations(samples) for _, samples in sampled(job, rows, parts, steps)]
    if not found:
        nothing = np.empty(0)
        return Deviations(
            size=nothing,
            turn=nothing,
            at=nothing,
            place=np.empty((0, 3)),
            status=np.empty(0, np.int64),
        )
    names = ("size", "turn", "at", "place", "status")
    return Deviations(**{n: np.concatenate([getattr(d, n) for d in found]) for n in names})


def sampled(
    job: JobMoves, rows: IntArray, parts: IntArray, steps: int
) -> Iterator[tuple[Shapes, Samples]]:
    """Yields runs of the moves with their points compensated, in order."""
    moves, points = job.moves, np.cumsum(parts * steps + 2)
    at = 0
    while at < len(rows):
        before = int(points[at - 1]) if at else 0
        end = max(at + 1, int(np.searchsorted(points, before + _ROWS, side="right")))
        run = rows[at:end]
        linked = np.zeros(len(run), dtype=np.bool_)
        linked[1:] = moves.start[run[1:]] == moves.end[run[:-1]]
        shapes = job.shapes(run)
        yield (
            shapes,
            sample(
                job.model,
                shapes,
                job.poses.tools,
                job.poses.tool[moves.end[run]],
                job.joints[moves.start[run]],
                linked,
                parts[at:end],
                steps,
                job.settings,
            ),
        )
        at = end
