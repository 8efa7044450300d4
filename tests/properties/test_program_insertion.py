"""Targets put into generated programs of every language are read where they were put."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))
from languages import LANGUAGES
from written import Pen

from robotrue.core.arm_words import NO_WORD
from robotrue.program.insertion import Insertion, Moves
from robotrue.program.lang import find_inserter, find_language
from robotrue.program.program import Motion, Program

SEEDS = 20
NAMES = sorted(name for name in LANGUAGES if find_language(name).inserter)


def eligible(job: tuple[Program, ...], moves: Moves) -> np.ndarray:
    """Moves that a plan may choose: no obstacle, and all their targets can be compensated."""
    reason = np.concatenate([program.reason for program in job])
    position = np.concatenate([program.position for program in job])
    able = moves.obstacle == 0
    for points in (moves.start, moves.end, np.where(moves.via >= 0, moves.via, moves.end)):
        at = np.where(able, points, 0)
        able &= (reason[at] == 0) & np.isfinite(position[at]).all(axis=1)
    return np.flatnonzero(able)


def middles(job: tuple[Program, ...], moves: Moves, rows: np.ndarray) -> Insertion:
    position = np.concatenate([program.position for program in job])
    rotation = np.concatenate([program.rotation for program in job])
    pairs = moves.bending[rows]
    move = np.repeat(rows, np.where(pairs, 2, 1))
    second = np.append(False, move[1:] == move[:-1])
    motion = np.where(moves.bending[move], int(Motion.ARC_VIA), int(Motion.LIN))
    motion[second] = Motion.ARC_END
    middle = (position[moves.start[move]] + position[moves.end[move]]) / 2.0
    return Insertion(
        move=move,
        motion=motion,
        position=middle + np.where(second, 1e-3, 2e-3)[:, None],
        rotation=rotation[moves.end[move]],
        words=np.full((len(move), job[0].words.shape[1]), NO_WORD),
    )


@pytest.mark.parametrize("name", NAMES)
def test_moves_and_targets_of_generated_programs_stay_what_they_were(name):
    language, put = find_inserter(name), 0
    for seed in range(SEEDS):
        made = LANGUAGES[name].writer(Pen.of(seed))

        def read(new, made=made):
            files = [(key, new.get(key, data)) for key, data in made.files]
            return find_language(name).read_job(files, frames=made.frames)

        job = read({})
        moves = language.moves(job)
        rows = eligible(job, moves)
        if not len(rows):
            continue
        insertion = middles(job, moves, rows)
        written = language.insert(job, moves, insertion)
        again = read({p.name: data for p, data in zip(job, written, strict=True)})
        found = language.moves(again)
        parts = np.where(np.isin(np.arange(len(moves)), rows), 2, 1)
        assert len(found) == parts.sum(), seed
        known = moves.end >= 0
        last = found.end[np.cumsum(parts) - 1][known]
        for column, tolerance in (("position", 1e-7), ("reason", 0)):
            before, after = (
                np.concatenate([getattr(p, column) for p in each]) for each in (job, again)
            )
            gap = np.abs(after[last] - before[moves.end[known]])
            assert not (np.nan_to_num(gap) > tolerance).any(), (seed, column)
        put += len(insertion)
    assert put >= 6
