"""Long programs of blocks: G-code of Sinumerik and Fanuc, and Heidenhain conversational."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.program.formats.gcode_blocks import Blocks, Findings, Take, scan_blocks
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_odd import OddReader
from robotrue.program.formats.gcode_vocabulary import (
    FANUC as FANUC_WORDS,
)
from robotrue.program.formats.gcode_vocabulary import (
    HEIDENHAIN as HEIDENHAIN_WORDS,
)
from robotrue.program.formats.gcode_vocabulary import (
    SINUMERIK as SINUMERIK_WORDS,
)
from robotrue.program.formats.gcode_vocabulary import Drive, Modal, Vocabulary, WordColumn
from robotrue.program.formats.heidenhain_odd import ConversationalReader
from robotrue.program.formats.path_words import Turn
from robotrue.program.formats.splice_chunks import (
    ANGLES,
    NO_TURN,
    VECTOR,
    PointLines,
    SpliceCutter,
    SpliceSurvey,
)
from robotrue.program.formats.text_lines import line_edges
from robotrue.program.program import FrameTable, Program
from robotrue.program.program_chunk import Whole

_POINT: Final = (WordColumn.X, WordColumn.Y, WordColumn.Z)
_ANGLES: Final = (WordColumn.A, WordColumn.B, WordColumn.C)
_AXIS: Final = (WordColumn.AX, WordColumn.AY, WordColumn.AZ)
_CENTRE: Final = (WordColumn.I, WordColumn.J, WordColumn.K)
_PLAIN: Final = (*_POINT, *_ANGLES, *_AXIS, *_CENTRE, WordColumn.R)
_TWO_ROWS: Final = (Drive.RIGHT, Drive.LEFT, Drive.THROUGH)
"""Arcs: a middle and an end."""


class BlockSurvey(SpliceSurvey):
    """One pass over a file of blocks."""

    def __init__(
        self, name: str, targets: int, frames: FrameTable, *, vocabulary: Vocabulary
    ) -> None:
        super().__init__(name, targets, frames)
        self._vocabulary = vocabulary
        self._tip = self._sideways = 0
        self._jumps = False

    def _print_mode(self, mode: int) -> bytes:
        return b"" if self._vocabulary.signs[3] else b"G%d\n" % mode

    def _sort_points(self, data: bytes) -> PointLines:
        edges = line_edges(data)
        count, odd = len(edges) - 1, np.zeros(len(edges), np.bool_)
        blocks = scan_blocks(data, self.name, self._vocabulary, partial(self._read_odd, odd))
        self._jumps |= bool(blocks.findings.targets or blocks.findings.jumps)
        place = np.full((WordColumn.TU + 1, count), -1)
        place[blocks.column, blocks.block] = np.arange(len(blocks.block))
        there = place >= 0
        state = blocks.state[:count]
        motion = _fill(state[:, Modal.MOTION], self._mode)
        tip = _fill(state[:, Modal.TIP], self._tip)
        self._tip = int(tip[-1]) if count else self._tip
        point = there[[*_POINT, *_ANGLES, *_AXIS]].any(axis=0)
        stated, side = state != NO_STATE, state[:, Modal.SIDEWAYS]
        force = _fill(side, self._sideways)
        before = np.append(self._sideways, force)[:-1]
        stated[:, Modal.SIDEWAYS] &= (side != 0) | (before != 0)  # R0 in many lines says nothing
        self._sideways = int(force[-1]) if count else self._sideways
        event = odd[:count] | stated[:, Modal.MOTION + 1 :].any(axis=1)
        event |= (there.any(axis=0) & ~point) | np.delete(there, _PLAIN, axis=0).any(axis=0)
        event |= motion < 0
        straight = (motion == Drive.RAPID) | (motion == Drive.LINE)
        axis, by_axis = self._axes_of(blocks, place, (tip == 2) & (motion < Drive.RIGHT))
        by_angle = there[list(_ANGLES)].any(axis=0)
        turn = np.where(by_axis, VECTOR, np.where(by_angle, ANGLES, NO_TURN))
        full = there[list(_POINT)].all(axis=0) & straight & ~(by_axis & by_angle)
        full &= ~by_angle | there[list(_ANGLES)].all(axis=0)
        full &= ~by_axis | self._states_all(there, tip)
        targets = np.where(point & ~event, 1 + np.isin(motion, _TWO_ROWS), 0)
        return PointLines(
            start=edges[:-1], end=edges[1:], targets=targets, event=event, turn=turn, full=full,
            mode=motion, axis=axis,
        )  # fmt: skip

    def judge(self, skeleton: Program, others: Sequence[tuple[str, bytes]]) -> Whole | None:
        """Returns why the file cannot be cut, if so; counts the targets that are not plain."""
        if self._jumps:
            return Whole(why="it jumps, or has labels")
        return super().judge(skeleton, others)

    def _read_odd(self, odd: BoolArray, vocabulary: Vocabulary, found: Findings) -> Take:
        """Returns the slow reader, which also marks what it reads."""
        if vocabulary.signs[3]:
            conversation = ConversationalReader(vocabulary, found)
            conversation.begun = self.size > 0
            read = conversation.take
        else:
            read = OddReader(vocabulary, found).take

        def take(block: int, first: int, text: bytes) -> None:
            odd[block] = True
            read(block, first, text)

        return take

    def _columns_of(self, tip: BoolArray) -> list[tuple[tuple[WordColumn, ...], BoolArray]]:
        """Returns columns of tool axes, and the lines (l,) where they are."""
        by_centre = self._vocabulary.names[Turn.VECTOR][3] == b"I"
        return [(_CENTRE, tip & by_centre), (_AXIS, ~(tip & by_centre))]

    def _states_all(self, there: BoolArray, tip: IntArray) -> BoolArray:
        """Returns the lines (l,) with all components of a tool axis."""
        out = np.zeros(there.shape[1], np.bool_)
        for columns, mine in self._columns_of(tip == 2):
            out |= mine & there[list(columns)].all(axis=0)
        return out

    def _axes_of(self, blocks: Blocks, place: IntArray, tip: BoolArray) -> tuple[Array, BoolArray]:
        """Returns the tool axes (l, 3) that lines state, NaN where they do not, and where."""
        axis, by_axis = np.full((place.shape[1], 3), np.nan), np.zeros(place.shape[1], np.bool_)
        value = np.append(blocks.value, 0.0)  # an omitted component is 0
        moves = np.ones(place.shape[1] + 1, np.bool_)
        moves[list(blocks.findings.silent)] = False
        for columns, mine in self._columns_of(tip):
            part = place[list(columns)]
            rows = np.flatnonzero(mine & (part >= 0).any(axis=0) & moves[:-1])
            axis[rows], by_axis[rows] = value[part[:, rows]].T, True
        return axis, by_axis


def _fill(setting: IntArray, before: int) -> IntArray:
    """Returns the state (l,) in force after each line."""
    rows = np.arange(len(setting))
    last = np.maximum.accumulate(np.where(setting != NO_STATE, rows, -1))
    return np.where(last >= 0, setting[last], before)


SINUMERIK: Final = SpliceCutter(survey=partial(BlockSurvey, vocabulary=SINUMERIK_WORDS))
FANUC_GCODE: Final = SpliceCutter(survey=partial(BlockSurvey, vocabulary=FANUC_WORDS))
HEIDENHAIN: Final = SpliceCutter(survey=partial(BlockSurvey, vocabulary=HEIDENHAIN_WORDS))
