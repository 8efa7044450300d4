"""Number of parts per move, and the targets inserted into it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.compensation.result import zero_correction
from robotrue.compensation.split_deviation import MoveDeviations, measure_moves, sample_moves
from robotrue.compensation.split_shapes import JobMoves, along
from robotrue.core.arm_words import NO_WORD, WORDS
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import inverse, pose
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError
from robotrue.program.compensation_defaults import SPLIT_LIMIT
from robotrue.program.insertion import Insertion, Obstacle, job_rows
from robotrue.program.program import Motion, Program, Replacement
from robotrue.robot.configuration import configuration_words
from robotrue.robot.opw import opw_geometry

_TRIED: Final = 8
"""Parts from which on a deviation that does not fall is that of a step in the correction."""
_TRIED_AGAIN: Final = 64
"""The same for the deviation of some parts: a part of it has fallen, a step in it has not."""
_ROUNDS: Final = 40
_ENDLESS: Final = 1 << 40


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitPlan:
    """Plan for the k moves of a job.

    Attributes:
        parts: (k,) equal parts; 1 does not split the move.
        size: (k,) m, deviation of the worst part.
        over: (k,) the move is beyond the tolerance and stays whole.
        stepped: (k,) of these: no number of parts is enough, its correction has a step.
        insertion: The targets to insert.
        vias: One per program: the auxiliary points that move along their arcs.
    """

    parts: IntArray
    size: Array
    over: BoolArray
    stepped: BoolArray
    insertion: Insertion
    vias: tuple[Replacement, ...]


def plan_split(
    job: JobMoves,
    programs: Sequence[Program],
    deviation: MoveDeviations,
    tolerance: float,
    *,
    limit: int = SPLIT_LIMIT,
) -> SplitPlan:
    """Returns the fewest equal parts of every move that keep it within a tolerance.

    The deviation of a line falls with the square of the number of parts, that of an arc with its
    cube; the resulting number is tried on the compensated points of the parts, then one less or
    more until the fewest is found.

    Args:
        job: The compensated job.
        programs: Its programs.
        deviation: Of its moves when not split.
        tolerance: m.
        limit: Largest number of inserted targets.

    Raises:
        ConfigurationError: The tolerance is no positive length, or needs more targets than allowed.

    Fails when: the orientation has a tolerance as well; only the position is checked.
    """
    if not 0.0 < tolerance < np.inf:
        raise ConfigurationError(
            f"the tolerance of splitting is {tolerance / UM:g} um, expected above 0.",
            hint="2 um, or what the process needs.",
        )
    over = np.asarray(deviation.size > tolerance)
    free = job.moves.obstacle == Obstacle.NONE
    free &= ~_unspoken(job, programs)
    rows = np.flatnonzero(over & free)
    parts = np.ones(len(over), dtype=np.int64)
    size, stepped = np.array(deviation.size), np.zeros(len(over), dtype=np.bool_)
    parts[rows], size[rows], stepped[rows] = _fewest(job, rows, size[rows], tolerance, limit)
    cut = np.flatnonzero(parts > 1)
    _require_few(parts, np.where(job.moves.bending, 2, 1), tolerance, limit)
    insertion, vias = _targets(job, programs, cut, parts[cut])
    return SplitPlan(
        parts=parts,
        size=size,
        over=over & (parts == 1),
        stepped=stepped,
        insertion=insertion,
        vias=vias,
    )


def _fewest(
    job: JobMoves, rows: IntArray, whole: Array, tolerance: float, limit: int
) -> tuple[IntArray, Array, BoolArray]:
    """Returns the parts of moves (k,), their deviation, and which have a step in them."""
    power = np.where(job.moves.bending[rows], 3.0, 2.0)
    few, few_size = np.ones(len(rows), np.int64), np.array(whole)  # not enough
    many, many_size = np.full(len(rows), _ENDLESS), np.full(len(rows), np.nan)  # enough
    stepped = np.zeros(len(rows), dtype=np.bool_)
    seen, seen_size = few.copy(), np.array(whole)  # what later trials are compared with
    for _ in range(_ROUNDS):
        open_ = np.flatnonzero((many - few > 1) & ~stepped)
        if not len(open_):
            break
        known = np.isfinite(many_size[open_])
        at = np.where(known, many[open_], few[open_])
        there = np.where(known, many_size[open_], few_size[open_])
        trial = np.ceil(at * (there / tolerance) ** (1.0 / power[open_])).astype(np.int64)
        trial = np.clip(trial, few[open_] + 1, many[open_] - 1)
        _require_few(trial, np.where(power[open_] > 2.0, 2, 1), tolerance, limit, about=True)
        found = measure_moves(job, rows[open_], trial).size
        good = found <= tolerance  # what could not be compensated is not
        many[open_] = np.where(good, trial, many[open_])
        many_size[open_] = np.where(good, found, many_size[open_])
        few[open_] = np.where(good, few[open_], trial)
        few_size[open_] = np.where(good, few_size[open_], found)
        enough = np.where(seen[open_] > 1, _TRIED_AGAIN, _TRIED)
        far = (trial >= enough) & (trial >= seen[open_] * 4.0 ** (1.0 / power[open_]))
        halved = found < 0.5 * seen_size[open_]
        stepped[open_] |= (~good & ~known & far & ~halved) | np.isnan(found)
        fell = open_[~good & halved]
        seen[fell], seen_size[fell] = few[fell], few_size[fell]
    done = np.isfinite(many_size) & ~stepped
    return np.where(done, many, 1), np.where(done, many_size, whole), ~done


def _require_few(
    parts: IntArray, each: IntArray, tolerance: float, limit: int, *, about: bool = False
) -> None:
    """Refuses parts that take more targets than allowed; four times as many while they are tried.

    Args:
        parts: Of the moves.
        each: Targets every further part takes.
        tolerance: m, for the message.
        limit: How many are allowed.
        about: The parts are those of a trial.
    """
    needed = int(((parts - 1) * each).sum())
    if needed > (4 * limit if about else limit):
        raise ConfigurationError(
            f"to keep every move within {tolerance / UM:g} um, {'about ' * about}{needed} targets "
            f"would have to be put into {int((parts > 1).sum())} moves; at most {limit} are "
            "allowed.",
            hint="a larger tolerance, or --split-limit.",
        )


def _targets(
    job: JobMoves, programs: Sequence[Program], rows: IntArray, parts: IntArray
) -> tuple[Insertion, tuple[Replacement, ...]]:
    """Returns the targets of moves cut into parts, and the auxiliary points that move along."""
    arc = job.moves.bending[rows]
    extra = np.where(arc, 2 * (parts - 1), parts - 1)
    which = np.repeat(np.arange(len(rows)), extra)
    step = np.arange(len(which)) - np.repeat(np.cumsum(extra) - extra, extra) + 1
    pieces = np.where(arc, 2 * parts, parts)
    shapes = job.shapes(rows)
    position, rotation = along(shapes, which, step / pieces[which])
    end = job.moves.end[rows[which]]
    T = inverse(job.poses.frames[job.poses.frame[end]]) @ pose(rotation, position)
    bow = np.flatnonzero(arc)
    last_via = along(shapes, bow, (2 * parts[bow] - 1) / (2 * parts[bow]))
    halfway = np.where(step % 2 == 1, int(Motion.ARC_VIA), int(Motion.ARC_END))
    return Insertion(
        move=rows[which],
        motion=np.where(arc[which], halfway, int(Motion.LIN)),
        position=T[:, :3, 3],
        rotation=T[:, :3, :3],
        words=_words(job, programs, rows, parts, which),
    ), _vias(job, programs, job.moves.via[rows[bow]], *last_via)


def _vias(
    job: JobMoves, programs: Sequence[Program], rows: IntArray, position: Array, rotation: Array
) -> tuple[Replacement, ...]:
    out = []
    T = inverse(job.poses.frames[job.poses.frame[rows]]) @ pose(rotation, position)
    for program, first in zip(programs, job_rows(programs), strict=False):
        mine = (rows >= first) & (rows < first + len(program))
        at = rows[mine] - first
        changed = np.zeros(len(program), dtype=np.bool_)
        changed[at] = True
        places, turns = np.array(program.position), np.array(program.rotation)
        places[at], turns[at] = T[mine, :3, 3], T[mine, :3, :3]
        whole = zero_correction(program)
        out.append(replace(whole, changed=changed, position=places, rotation=turns))
    return tuple(out)


def _turning(job: JobMoves, programs: Sequence[Program]) -> BoolArray:
    """Returns a mask (k,) of moves that end with other configuration words than they begin with."""
    words, moves = np.concatenate([program.words for program in programs]), job.moves
    out = np.zeros(len(moves), dtype=np.bool_)
    if programs[0].words_of not in ("", "kuka"):  # KUKA reads S and T of joint moves alone
        known = np.flatnonzero((moves.start >= 0) & (moves.end >= 0))
        one, other = words[moves.start[known]], words[moves.end[known]]
        both = (one != NO_WORD) & (other != NO_WORD)
        out[known] = (both & (one != other)).any(axis=1)
    return out


def _unspoken(job: JobMoves, programs: Sequence[Program]) -> BoolArray:
    """Returns a mask (k,) of moves whose words between the ends are unknown: of an unknown arm."""
    turning, robot = _turning(job, programs), job.model.robot
    if robot.maker == programs[0].words_of and opw_geometry(robot.nominal()) is not None:
        turning[:] = False
    return turning


def _words(
    job: JobMoves,
    programs: Sequence[Program],
    rows: IntArray,
    parts: IntArray,
    which: IntArray,
) -> IntArray:
    """Returns words (m, w) of the inserted targets: those of the end, or of the joints there."""
    maker = programs[0].words_of
    out = np.full((len(which), WORDS[maker]), NO_WORD, dtype=np.int64)
    mine = np.flatnonzero(_turning(job, programs)[rows])
    if not len(mine):
        return out
    joints = []
    for points in sample_moves(job, rows[mine], parts[mine], 2):
        bending = points.shapes.circular & np.isnan(points.shapes.normal[:, 0])
        for base, count, arc in zip(points.base, points.count, bending, strict=True):
            # Two steps to a part: an arc gets its middles, too, but for the last, which it has.
            inside = slice(base + 1, base + count - 1) if arc else slice(base + 2, base + count, 2)
            joints.append(points.solved.joints[inside])
    out[np.isin(which, mine)] = configuration_words(
        job.model.robot.nominal(), maker, np.concatenate(joints)
    )
    return out
