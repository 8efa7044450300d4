"""Rows of a G-code: the blocks that go somewhere, with their words and what they take over."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.program.formats.gcode_blocks import Blocks
from robotrue.program.formats.gcode_state import Epochs, Rows, Words, choose_rows, fill_left_out
from robotrue.program.formats.gcode_vocabulary import Drive, Modal, Vocabulary, WordColumn
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.path_words import Turn
from robotrue.program.program import Reason

INCH: Final = 25.4 * MM


def find_rows(blocks: Blocks, force: IntArray, epochs: Epochs, vocabulary: Vocabulary) -> Rows:
    """Returns the blocks that go somewhere, with what is in force there.

    Args:
        blocks: Of a program.
        force: (n, groups) setting of every group in every block.
        epochs: Over which blocks words are inherited.
        vocabulary: The control.
    """
    block = _find_moving(blocks, force)
    words = Words(blocks, block)
    own = force[block]
    point, there = words.numbers((0, 1, 2))
    spoken = epochs.of(0, block)
    unit = np.where(own[:, Modal.INCH] == 1, INCH, MM)
    relative = (own[:, Modal.RELATIVE] != 0) | (own[:, Modal.MOTION] == Drive.CYCLE)
    value = np.empty((len(block), 6))
    for k in range(3):
        column = np.where(relative, np.nan, point.value[:, k])
        value[:, k] = fill_left_out(column, there[:, k], epochs.of(k, block))
    turn, numbers, found = _find_turns(blocks, epochs, vocabulary, block, force)
    value[:, 3:] = found
    start, length, printed = (
        np.concatenate([getattr(point, n), getattr(numbers, n)], axis=1)
        for n in ("start", "length", "value")
    )
    joints, value = _find_joints(words, turn, value)
    axes = (turn == Turn.AXES)[:, None]
    table = Numbers(
        start=np.where(axes, joints.start, start),
        length=np.where(axes, joints.length, length),
        value=np.where(axes, joints.value, printed),
    )
    return Rows(
        block=block, force=own, numbers=table, value=value, turn=turn, epoch=spoken, unit=unit
    )


def _find_moving(blocks: Blocks, force: IntArray) -> IntArray:
    """Returns the blocks that go somewhere."""
    column, block = blocks.column, blocks.block
    motion, tip = force[block, Modal.MOTION], force[block, Modal.TIP]
    goes = (column < WordColumn.I) | ((column >= WordColumn.J1) & (column <= WordColumn.J6))
    arc = (column >= WordColumn.I) & (column <= WordColumn.R)
    goes |= arc & np.isin(motion, (Drive.RIGHT, Drive.LEFT, Drive.THROUGH))
    goes |= arc & (column <= WordColumn.K) & (tip == 2)
    moving = np.zeros(len(blocks.first), np.bool_)
    moving[block[goes]] = True
    moving[list(blocks.findings.silent)] = False
    return np.flatnonzero(moving)


def _find_turns(
    blocks: Blocks, epochs: Epochs, vocabulary: Vocabulary, block: IntArray, force: IntArray
) -> tuple[IntArray, Numbers, Array]:
    """Returns the form of each row's orientation, its three words and their values."""
    words, own = Words(blocks, block), force[block]
    angles, by_angle = words.numbers((3, 4, 5))
    vector, by_vector = words.numbers((6, 7, 8))
    if vocabulary.names[Turn.VECTOR][3] == b"I":
        ijk, there = words.numbers((9, 10, 11))
        mine = (own[:, Modal.TIP] == 2) & (own[:, Modal.MOTION] < Drive.RIGHT)
        by_vector, vector = there & mine[:, None], choose_rows(mine, ijk, vector)
    jointed = words.numbers(tuple(range(WordColumn.J1, WordColumn.J6 + 1)))[1].any(axis=1)
    said = np.where(by_vector.any(axis=1), 2.0, np.where(by_angle.any(axis=1), 1.0, np.nan))
    said[jointed] = np.nan
    epoch = epochs.of(3, block)
    mode = fill_left_out(said, np.isfinite(said), epoch)
    turn = np.where(np.isnan(mode), int(Turn.ANGLES), np.nan_to_num(mode)).astype(np.int64)
    turn[own[:, Modal.TIP] == 2] = Turn.VECTOR
    turned = np.maximum.accumulate(np.isfinite(said)) if len(said) else np.zeros(0, np.bool_)
    off = own[:, Modal.TIP] == 0
    turn[off & ~turned] = Turn.FIXED
    turn[jointed] = Turn.AXES
    vectors = (turn == Turn.VECTOR) & by_vector.any(axis=1)
    both = by_vector.any(axis=1) & by_angle.any(axis=1)
    for row in np.flatnonzero(both).tolist():
        blocks.findings.flag(int(block[row]), Reason.EXPRESSION)
    found = np.full((len(block), 3), np.nan)
    numbers = choose_rows(turn == Turn.VECTOR, vector, angles)
    given = np.where((turn == Turn.VECTOR)[:, None], by_vector, by_angle)
    values = np.where(vectors[:, None] & ~by_vector, 0.0, numbers.value)
    given = given | vectors[:, None]
    kinds = epoch * 4 + turn
    for k in range(3):
        found[:, k] = fill_left_out(values[:, k], given[:, k], kinds)
    found[turn == Turn.FIXED] = (0.0, 0.0, 1.0)
    return turn, numbers, found


def _find_joints(words: Words, turn: IntArray, value: Array) -> tuple[Numbers, Array]:
    """Axis targets: JT1 to JT6, or JT1 to JT3 with A, B, C for the wrist."""
    joints, there = words.numbers(tuple(range(WordColumn.J1, WordColumn.J6 + 1)))
    axes = turn == Turn.AXES
    if not axes.any():
        return joints, value
    wrist, _ = words.numbers((3, 4, 5))
    short = axes & ~there[:, 3:].any(axis=1)
    tail = choose_rows(short, wrist, Numbers(
        start=joints.start[:, 3:], length=joints.length[:, 3:], value=joints.value[:, 3:]
    ))  # fmt: skip
    start, length, printed = (
        np.concatenate([getattr(joints, n)[:, :3], getattr(tail, n)], axis=1)
        for n in ("start", "length", "value")
    )
    joints = Numbers(start=start, length=length, value=printed)
    return joints, np.where(axes[:, None], printed, value)
