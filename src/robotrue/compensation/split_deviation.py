"""How far every straight or circular move of a job is off between its compensated targets."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.compensation.split_probe import (
    COARSE,
    GOOD,
    STEPS,
    MoveDeviations,
    measure_moves,
    unknown_deviations,
)
from robotrue.compensation.split_shapes import JobMoves, JobPoses
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import UM

RESOLUTION: Final = 0.1 * UM
"""Lines that are surely nearer than this are not looked at one by one."""
_ARM: Final = 0.5
"""m a turn of the tool counts for: a radian bows a line as half a metre of path does."""
_PROBED: Final = 2048
"""Lines that tell how strongly the correction curves: so many spread evenly, so many longest."""
_SAFETY: Final = 4.0
_FULLY: Final = 1000
"""Most worst lines looked at in all steps when no tolerance says which."""


def job_deviation(job: JobMoves, *, tolerance: float | None = None) -> MoveDeviations:
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
    tables = job.model.mean_tables(job.settings.load)
    return tables is not None and bool(np.any(tables.backlash))
