"""What a path of words cannot say of its new points: arcs out of their plane, unprinted turns."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, UM
from robotrue.program.formats.gcode_arcs import middles, moved_words
from robotrue.program.formats.path_words import PathWords, Turn
from robotrue.program.formats.pose_write import changed_rows, spans_of
from robotrue.program.program import Program, Replacement

_SLIGHT: Final = 0.5 * UM
_SLIGHT_TURN: Final = 1e-4 * DEG


def path_losses(program: Program, replacement: Replacement) -> tuple[str, ...]:
    """Returns what is not followed, one sentence each with the line where it is worst.

    Raises:
        ShapeError: The program is not a path of words.
    """
    words = spans_of(program, PathWords, "path")
    changed = changed_rows(program, replacement)
    out = []
    rows, off = arc_deviation(program, replacement, words, changed)
    if len(rows) and off.max() > _SLIGHT:
        worst = int(np.argmax(off))
        out.append(
            f"{len(rows)} arcs stay in their plane: in the middle they are left up to "
            f"{off[worst] / UM:.1f} um off (line {program.line[rows[worst]]})."
        )
    quiet = np.isin(words.turn, (Turn.FIXED, Turn.VECTOR)) & changed & ~words.skip
    turn = np.zeros(len(program))
    turn[quiet] = _unsaid(program, replacement, words, quiet)
    if turn.max(initial=0.0) > _SLIGHT_TURN:
        worst = int(np.argmax(turn))
        out.append(
            f"{int((turn > _SLIGHT_TURN).sum())} points print no word for all of their turn: up to "
            f"{turn[worst] / DEG:.3f} deg are not written (line {program.line[worst]})."
        )
    return tuple(out)


def arc_deviation(
    program: Program, replacement: Replacement, words: PathWords, changed: BoolArray
) -> tuple[IntArray, Array]:
    """Returns rows (k,) of middles of corrected plane arcs, and m (k,) they are left off.

    Args:
        program: As it was read.
        replacement: What its points shall be.
        words: Its words.
        changed: (n,) rows that move.
    """
    arcs = words.arcs
    if not len(arcs):
        return np.empty(0, np.int64), np.empty(0)
    old = words.value[:, :3]
    new = np.where(changed[:, None], replacement.position / words.unit[:, None], old)
    written = replace(arcs, value=moved_words(arcs, old, new))
    middle, _ = middles(written, new)
    mine = changed[arcs.via]
    off = np.linalg.norm(middle - new[arcs.via], axis=1) * words.unit[arcs.via]
    return arcs.via[mine], off[mine]


def _unsaid(program: Program, replacement: Replacement, words: PathWords, rows: BoolArray) -> Array:
    """Returns rad (k,) that rows are turned by and do not print: all of it, or the spin."""
    before, after = program.rotation[rows], np.asarray(replacement.rotation)[rows]
    turn = rotation_vector_from_matrix(after @ np.swapaxes(before, 1, 2))
    spin = np.abs((turn * words.rule.axes_of(before)).sum(axis=1))
    fixed = words.turn[rows] == Turn.FIXED
    out: Array = np.where(fixed, np.linalg.norm(turn, axis=1), spin)
    return out
