"""Inserts the targets of a plan into a job, reads it again, and matches every target.

The written program is used only after it was read: the moves must be the planned ones, with the
planned ends of each part, or the job is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.split import SplitPlan
from robotrue.compensation.split_shapes import JobMoves, along, job_poses, loads
from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.formats import write_program
from robotrue.program.insertion import Moves, job_rows
from robotrue.program.lang import find_inserter
from robotrue.program.program import Program
from robotrue.robot.statics import Load

Reread: TypeAlias = Callable[[Mapping[str, bytes]], tuple[Program, ...]]
"""From the new bytes of files, by name, to the programs of the job, as they were read before."""
_PRINTED: Final = 0.01 * MM
"""m a target read again may lie from where it was to be: what printed decimals leave, and more."""
_TURNED: Final = 1e-4
"""Of an element of its orientation, likewise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitJob:
    """A job with inserted targets, not yet compensated.

    Attributes:
        programs: Read from the new bytes.
        moves: Its moves: ``parts`` for each that was split.
        origin: (n,) previous job row of each job row, -1 for inserted ones.
        wrench: (n, 6) N, N m, base, of every job row where the load changes along the job; else
            empty.
        order: For each program its rows in the order of the path: positions stored by number come
            after the others in the file.
    """

    programs: tuple[Program, ...]
    moves: Moves
    origin: IntArray
    wrench: Array
    order: tuple[IntArray, ...]


def split_job(
    job: JobMoves, programs: Sequence[Program], plan: SplitPlan, reread: Reread
) -> SplitJob:
    """Returns the job with the targets of the plan inserted.

    Raises:
        ConfigurationError: The dialect cannot insert targets.
        FormatError: The written program does not read as the planned path.
    """
    language = find_inserter(programs[0].dialect)
    bent = tuple(programs)
    if any(each.changed.any() for each in plan.vias):
        bent = reread(
            {
                program.name: write_program(program, via)
                for program, via in zip(programs, plan.vias, strict=True)
            }
        )
    written = language.insert(bent, language.moves(bent), plan.insertion)
    names = [program.name for program in programs]
    split = reread(dict(zip(names, written, strict=True)))
    moves = language.moves(split)
    if [program.name for program in split] != names or len(moves) != plan.parts.sum():
        raise _unlike(programs[0], f"{len(moves)} moves were read, {plan.parts.sum()} expected")
    origin, of_move, share = _origins(programs, split, job.moves, moves, plan)
    _require_planned(job, programs, split, origin, of_move, share)
    wrench = np.empty((0, 6))
    if len(job.load):
        wrench = np.zeros((len(origin), 6))
        wrench[origin >= 0] = job.load[origin[origin >= 0]]
        new = np.flatnonzero(of_move >= 0)  # and the auxiliary points that moved
        rows, which = np.unique(of_move[new], return_inverse=True)
        wrench[new] = loads(job.shapes(rows), which, share[new])
    order = _orders(split, job.moves, job_rows(programs), origin, of_move, share)
    return SplitJob(programs=split, moves=moves, origin=origin, wrench=wrench, order=order)


def compensate_split(
    model: ErrorModel, split: SplitJob, settings: Sequence[CompensationSettings]
) -> tuple[list[Compensation], list[CompensationSettings]]:
    """Returns the compensation of every program of a split job, and the settings it was made with.

    Targets are solved in the order of the path, so that each branch continues from the target
    before.

    Args:
        model: Error of the robot.
        split: The job.
        settings: Of the programs before; a load that changes along the path is carried over.
    """
    first, results, used = job_rows(split.programs), [], []
    for k, (program, order) in enumerate(zip(split.programs, split.order, strict=True)):
        wrench = split.wrench[first[k] : first[k + 1]]
        mine = settings[k]
        if len(wrench):
            load = Load(mass=mine.load.mass, com=mine.load.com)
            mine = replace(mine, load=load, wrench=wrench)
            turned = replace(mine, wrench=wrench[order]) if len(order) else mine
        else:
            turned = mine
        back = np.argsort(order)
        along_path = replace(program.take(order), spans=None)
        results.append(compensate(model, along_path, settings=turned).take(back))
        used.append(mine)
    return results, used


def _orders(
    after: Sequence[Program],
    moves: Moves,
    old: IntArray,
    origin: IntArray,
    of_move: IntArray,
    share: Array,
) -> tuple[IntArray, ...]:
    """Returns the rows of every program in the order of the path."""
    new, out = job_rows(after), []
    for k in range(len(after)):
        rows = np.arange(new[k], new[k + 1])
        mine = origin[rows]
        # An inserted target comes before the next of its file, or before its own move's if that is
        # in the same file.
        place = np.where(mine >= 0, mine, np.iinfo(np.int64).max)
        place = np.minimum.accumulate(place[::-1])[::-1]
        put = np.flatnonzero(mine < 0)
        move = of_move[rows[put]]
        for points in (moves.end[move], moves.via[move]):
            here = (points >= old[k]) & (points < old[k + 1])
            place[put[here]] = points[here]
        late = np.where(mine >= 0, np.inf, share[rows])
        out.append(np.lexsort((late, place)))
    return tuple(out)


def _origins(
    before: Sequence[Program],
    after: Sequence[Program],
    was: Moves,
    moves: Moves,
    plan: SplitPlan,
) -> tuple[IntArray, IntArray, Array]:
    """Returns the old job row of every new one, and move and fraction of those not where they were.

    The moves are in the order of the text, so that the parts of a move follow each other.
    """
    n = int(job_rows(after)[-1])
    of_move, share = np.full(n, -1), np.full(n, np.nan)
    which = np.repeat(np.arange(len(plan.parts)), plan.parts)
    part = np.arange(len(which)) - np.repeat(np.cumsum(plan.parts) - plan.parts, plan.parts)
    early = np.flatnonzero(part < plan.parts[which] - 1)
    for points, late in ((moves.via, 0.5), (moves.end, 1.0)):
        there = early[points[early] >= 0]
        of_move[points[there]] = which[there]
        share[points[there]] = (part[there] + late) / plan.parts[which[there]]
    origin = np.full(n, -1)
    old, new = job_rows(before), job_rows(after)
    flat = (plan.parts > 1) & (was.across >= 0)
    gone = np.zeros(int(old[-1]), dtype=np.bool_)  # auxiliary points of arcs that became lines
    gone[was.via[flat]] = True
    for k in range(len(before)):
        mine = np.arange(new[k], new[k + 1])
        kept = mine[of_move[mine] < 0]
        there = np.flatnonzero(~gone[old[k] : old[k + 1]]) + old[k]
        if len(kept) != len(there):
            raise _unlike(before[k], f"{len(kept)} of its {len(there)} targets were read back")
        origin[kept] = there
    last = np.flatnonzero((part == plan.parts[which] - 1) & (part > 0) & (moves.via >= 0))
    of_move[moves.via[last]] = which[last]
    share[moves.via[last]] = (part[last] + 0.5) / plan.parts[which[last]]
    return origin, of_move, share


def _require_planned(
    job: JobMoves,
    before: Sequence[Program],
    after: Sequence[Program],
    origin: IntArray,
    of_move: IntArray,
    share: Array,
) -> None:
    """Refuses a job whose targets are not at their previous or planned places."""
    poses = job_poses(after)
    wanted, turned = np.array(poses.position), np.array(poses.rotation)
    kept, new = np.flatnonzero(of_move < 0), np.flatnonzero(of_move >= 0)
    wanted[kept] = job.poses.position[origin[kept]]
    rows, which = np.unique(of_move[new], return_inverse=True)
    if len(new):
        wanted[new], turned[new] = along(job.shapes(rows), which, share[new])
        vias = new[origin[new] >= 0]
        turned[vias] = poses.rotation[vias]  # a controller may ignore it; it may be nowhere
    off = np.linalg.norm(poses.position - wanted, axis=1)
    spun = np.abs(poses.rotation - turned).max(axis=(1, 2), initial=0.0)
    bad = np.flatnonzero((off > _PRINTED) | (spun > _TURNED))
    lost = np.flatnonzero(np.isnan(off) != np.isnan(wanted[:, 0]))
    if len(bad) or len(lost):
        at = int(bad[0] if len(bad) else lost[0])
        what = f"a target is {off[at] / MM:.4f} mm and {spun[at]:.6f} rad from its expected place"
        raise _unlike(before[0], what)


def _unlike(program: Program, what: str) -> FormatError:
    return FormatError(
        f"the split program differs from the expected path: {what}; nothing is written.",
        source=program.name,
        hint="omit --split for this program, and report the problem.",
    )
