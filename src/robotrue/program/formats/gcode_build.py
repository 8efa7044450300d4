"""Builds a program from the blocks of a G-code: rows, what they inherit, reasons, notes."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD, WORDS
from robotrue.core.arrays import BoolArray, IntArray
from robotrue.program.formats.gcode_arc_rows import ArcRows, arc_rows
from robotrue.program.formats.gcode_arcs import ACROSS
from robotrue.program.formats.gcode_blocks import Blocks, list_starts
from robotrue.program.formats.gcode_frames import GcodeFrames
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_rows import find_rows
from robotrue.program.formats.gcode_state import (
    Epochs,
    Rows,
    Words,
    in_force,
)
from robotrue.program.formats.gcode_vocabulary import (
    UNCERTAIN,
    Drive,
    Modal,
    Vocabulary,
    WordColumn,
)
from robotrue.program.formats.path_kernels import with_point
from robotrue.program.formats.path_words import PathWords, Turn, poses, tool_axes
from robotrue.program.formats.shared_fate import share_fate
from robotrue.program.formats.target_notes import TargetNotes
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Motion, Program, Reason, find_open

_NORMAL: Final = re.compile(rb"(?im)^[ \t]*+N?\d*+[ \t]*+LN\b")
_COMPUTED: Final = re.compile(rb"(?i)(?<=[ \t])I?[XYZABC][ \t]*[+-]?Q[LRS]?\d+")
_TURNS: Final = (WordColumn.A, WordColumn.AX)


class ProgramBuilder:
    """One program of a job: its rows, and what others of the job mean for them."""

    def __init__(
        self, blocks: Blocks, name: str, vocabulary: Vocabulary, frames: FrameTable
    ) -> None:
        self.blocks, self.name, self.vocabulary, self.given = blocks, name, vocabulary, frames
        self.rule: OrientationRule = frames.orientation
        self.force = in_force(blocks)
        if blocks.findings.inch is not None:
            self.force[:, Modal.INCH] = int(blocks.findings.inch)
        self.epochs = Epochs(blocks, self.force)
        self.rows = find_rows(blocks, self.force, self.epochs, vocabulary)
        self.words = Words(blocks, self.rows.block)
        self.notes = TargetNotes(name, self.rows.block + 1)
        self.frames = GcodeFrames(frames, name, blocks, vocabulary)
        self.base, self.tool = self.frames.columns(self.rows.block, self.rows.force)
        self.arcs = arc_rows(
            self.rows, self.words, self.base, absolute=bool(self.vocabulary.signs[3])
        )
        self.stretch = np.zeros(len(self.rows.block) + 1, np.int64)
        self._find_reasons()

    def _find_reasons(self) -> None:
        """Finds the poses of all rows, and why some cannot be compensated."""
        rows, arcs = self.rows, self.arcs
        table = arcs.spread
        value, turn = table.rows_of(rows.value), table.rows_of(rows.turn)
        arcs.fill(value)
        line = table.rows_of(rows.block) + 1
        self.poses = poses(value, table.rows_of(rows.unit), turn, self.rule, line)
        _, rotation, _ = self.poses
        arcs.turn_middles(rotation)
        reason = table.rows_of(self._reasons(self.base, self.tool, arcs))
        known = np.isfinite(value).all(axis=1)
        known &= np.isfinite(rotation).all(axis=(1, 2)) | (turn == Turn.AXES)
        open_ = find_open(reason)
        reason[open_ & ~known] = Reason.INCOMPLETE
        self._tell_unknown(rows, open_[table.place] & ~known[table.place])
        self.value, self.reason = value, reason

    def program(self, *, ends: bool, last: bool) -> Program:
        """Returns the program.

        Args:
            ends: A point may take over words from the last points before calls and jumps.
            last: Or from that of the program.
        """
        rows, found, reason = self.rows, self.blocks.findings, self.reason
        arcs, table = self.arcs, self.arcs.spread
        position, rotation, axes = self.poses
        line = table.rows_of(rows.block) + 1
        self._keep_inherited(reason, table.place, ends, ends and last)
        share_fate(reason, arcs.groups(reason))
        words, marks = self._status(table.count, table.place)
        self.notes.each(found.told, self.blocks.first)
        self._remark()
        return Program(
            name=self.name, dialect=self.vocabulary.name, data=self.blocks.data,
            position=position, rotation=rotation, axes=axes,
            motion=arcs.motion(self._motion()), reason=reason,
            words=words, words_of="kuka" if words.shape[1] else "",
            line=line,
            frame=table.rows_of(self.base), tool=table.rows_of(self.tool),
            T_base_frame=self.frames.stack_matrices("base"),
            T_flange_tool=self.frames.stack_matrices("tool"),
            notes=(*self.frames.notes, *self.notes.notes()),
            noted=self.notes.on_lines(),
            path=self._moves(arcs),
            spans=PathWords(
                numbers=arcs.numbers(rows.numbers), value=self.value,
                unit=table.rows_of(rows.unit), turn=table.rows_of(rows.turn), skip=arcs.skip,
                at=arcs.behind(self._behind()), barred=self._bar_words(arcs),
                names=self.vocabulary.names, blank=self._blank(), rule=self.rule,
                arcs=arcs.plane, marks=marks,
            ),
        )  # fmt: skip

    def continues_others(self, calls: set[int]) -> bool:
        """Returns whether a point takes over words from one that is not before it in the text.

        Args:
            calls: Blocks that call programs of the job.
        """
        found, block = self.blocks.findings, self.rows.block
        starts = list_starts(self.blocks.data, self.blocks.first)
        inside = [each for each, _ in found.breaks] if starts else []
        behind = (each + 1 for each in (*found.jumps, *calls, *inside))
        seams = sorted({*found.entries, *starts, *behind})
        self.stretch = np.searchsorted(seams, [*block, len(self.blocks.first)], side="right")
        heirs, before = self._find_heirs()
        anchors = np.searchsorted(seams, found.anchors, side="right")
        own = np.append(self.stretch[heirs[: len(heirs) - len(anchors)]], anchors)
        donor = before[1, heirs]
        return bool(((donor < 0) | (self.stretch[donor] != own)).any())

    def _find_heirs(self) -> tuple[IntArray, IntArray]:
        """Returns the rows (h,) that take over a correction, and the rows before all (2, m + 1).

        The second of those are the ones that no switch skips. Last among the heirs are the rows
        behind coordinates that are moved by where the robot is.

        A point left alone gets its omitted words with their old values, so that it stays unchanged.
        Where none can be inserted, or their values are not known, the point they come from must not
        move. A relative point continues from the command before it, a cycle from its height.
        """
        rows, own = self.rows, self.reason[self.arcs.spread.place]
        told = self.words.numbers((WordColumn.X, WordColumn.Y, WordColumn.Z))
        angles = self.words.numbers((WordColumn.A, WordColumn.B, WordColumn.C))[1]
        vector = self.words.numbers((WordColumn.AX, WordColumn.AY, WordColumn.AZ))[1]
        relative = own == Reason.RELATIVE
        mixed = relative & (rows.force[:, Modal.RELATIVE] == 0) & (told[0].start >= 0).any(axis=1)
        turns = np.isin(rows.turn, (Turn.ANGLES, Turn.VECTOR))[:, None]
        lacking = np.concatenate([~told[1], turns & ~(angles | vector)], axis=1)
        lacking |= (rows.force[:, Modal.MOTION] == Drive.CYCLE)[:, None]
        lost = (self._behind() < 0)[:, None] | np.isnan(rows.value)
        lost[:, 3:] |= self._find_normals()[:, None]
        heir = ~find_open(own) & ~relative & (rows.turn != Turn.AXES) & (lacking & lost).any(axis=1)
        fixed = np.where(relative & ~mixed, -1, np.arange(len(own)))
        flags = self.blocks.findings.flags
        skipped = [block for block, why in flags.items() if why == Reason.INCOMPLETE]
        sure = np.where(np.isin(rows.block, skipped), -1, fixed)
        before = np.pad(np.stack([fixed, sure]), ((0, 0), (1, 0)), constant_values=-1)
        anchors = np.searchsorted(rows.block, self.blocks.findings.anchors)
        heirs = np.append(np.flatnonzero(heir | mixed), anchors).astype(np.int64)
        return heirs, np.maximum.accumulate(before, axis=1)

    def _keep_inherited(self, reason: IntArray, place: IntArray, ends: bool, last: bool) -> None:
        """Leaves alone, in place, the last point before one that would inherit its correction.

        Args:
            reason: (n,) of all rows.
            place: (m,) row of every block with a move.
            ends: Those before calls and jumps, too.
            last: And that of the program.
        """
        ends_here = self.stretch[1:] != self.stretch[:-1]
        ends_here[-1:] |= last
        which, fresh = np.zeros(len(place), np.bool_), True
        while fresh:  # one that is kept may take over words, too
            heirs, before = self._find_heirs()
            donor = np.append(before[:, heirs], before[:, 1:][:, ends_here & ends])
            donor = donor[donor >= 0]
            donor = np.unique(donor[find_open(reason[place[donor]])])
            reason[place[donor]], which[donor], fresh = Reason.INCOMPLETE, True, bool(len(donor))
        self.notes.rows(
            which,
            "not compensated either: the next point is not compensated and takes over words from "
            "here that cannot be written there",
        )

    def _remark(self) -> None:
        """Reports the assumptions."""
        found, told = self.blocks.findings, set()
        for place, what in found.remarks:
            if what not in told:
                told.add(what)
                line = int(np.searchsorted(self.blocks.first, place, side="right"))
                self.notes.say(f"{self.name}:{line}: {what}.")
        if found.inch is None and (self.blocks.state[:, Modal.INCH] == NO_STATE).all():
            self.notes.say(f"{self.name}:1: the program states no unit: millimetres are assumed.")

    def _motion(self) -> IntArray:
        rows = self.rows
        axis_wise = (rows.force[:, Modal.AXIS_WISE] == 1) | (rows.turn == Turn.AXES)
        return np.where(axis_wise, int(Motion.PTP), int(Motion.LIN))

    def _moves(self, arcs: ArcRows) -> IntArray:
        """Returns the rows in file order, rapid ones as joint moves: they cut nothing."""
        table, motion = arcs.spread, arcs.motion(self._motion())
        rapid = table.rows_of(self.rows.force[:, Modal.MOTION] == Drive.RAPID)
        if not rapid.any():
            return np.empty((0, 3), np.int64)
        row = np.arange(table.count)
        return np.stack([row, row, np.where(rapid, int(Motion.PTP), motion)], axis=1)

    def _behind(self) -> IntArray:
        """Returns the byte (m,) after the last word of each row, -1 where none may be inserted."""
        last = WordColumn.AX if self.vocabulary.signs[3] else WordColumn.J1
        mine = np.flatnonzero((self.blocks.column < last) & (self.blocks.start >= 0))
        rows = np.full(len(self.blocks.first), -1)
        rows[self.rows.block] = np.arange(len(self.rows.block))
        place = rows[self.blocks.block[mine]]
        mine, place = mine[place >= 0], place[place >= 0]
        out = np.full(len(self.rows.block), -1)
        np.maximum.at(out, place, self.blocks.start[mine] + self.blocks.length[mine])
        for row in np.flatnonzero(out < 0).tolist():  # all its words are computed
            block = self.rows.block[row]
            first, end = int(self.blocks.first[block]), int(self.blocks.end[block])
            text = self.blocks.data[first:end].rstrip()
            words = list(_COMPUTED.finditer(text)) if self.vocabulary.signs[3] else []
            out[row] = first + (words[-1].end() if words else len(text))
        out[(self.rows.turn == Turn.AXES) | self._find_closed()] = -1
        return np.asarray(out)

    def _find_closed(self) -> BoolArray:
        """Returns the rows (m,) where an absolute coordinate would be another one."""
        force, flags = self.rows.force, self.blocks.findings.flags
        out = (force[:, Modal.RELATIVE] != 0) | (force[:, Modal.SHIFTED] != 0)
        out |= (force[:, Modal.MOTION] < 0) | (force[:, Modal.MOTION] >= Drive.OTHER)
        # a block that may be skipped would hand on its words, or not
        kinds = (Reason.UNKNOWN_FRAME, Reason.RELATIVE, Reason.INCOMPLETE)
        moved = [block for block, why in flags.items() if why in kinds]
        return np.asarray(out | np.isin(self.rows.block, moved))

    def _bar_words(self, arcs: ArcRows) -> BoolArray:
        """Conversational arcs take no third axis and no turn, straight lines no tool axis."""
        out = np.zeros((arcs.spread.count, 6), np.bool_)
        if self.vocabulary.signs[3]:
            there = self.words.numbers((WordColumn.AX, WordColumn.AY, WordColumn.AZ))[1].any(axis=1)
            short = ~there & ((self.rows.turn == Turn.VECTOR) | self._find_normals())
            out[:, 3:] = arcs.spread.rows_of(short)[:, None]
            out[arcs.ends, 3:] = True
            third = ACROSS[arcs.spread.rows_of(self.rows.force[:, Modal.PLANE])[arcs.ends], 2]
            out[arcs.ends, third] = True
        return out

    def _find_normals(self) -> BoolArray:
        """Returns the rows (m,) of LN blocks, which take no rotary word."""
        blocks, out = self.blocks, np.zeros(len(self.rows.block), np.bool_)
        if self.vocabulary.signs[3] and _NORMAL.search(blocks.data):
            for row in np.flatnonzero(self.rows.turn == Turn.ANGLES).tolist():
                at = int(blocks.first[self.rows.block[row]])
                out[row] = bool(_NORMAL.match(blocks.data, at))
        return out

    def _blank(self) -> bool:
        blocks = self.blocks
        for row in self.rows.block[:50].tolist():
            text = blocks.data[int(blocks.first[row]) : int(blocks.end[row])].strip()
            if b" " in text:
                return True
        return not len(self.rows.block)

    def _status(self, count: int, place: IntArray) -> tuple[IntArray, IntArray]:
        """Returns STAT and TU (n, 2) and their places (n, 2, 2); no columns without any."""
        numbers, given = self.words.numbers((WordColumn.STAT, WordColumn.TU))
        if not given.any():
            return np.empty((count, 0), np.int64), np.empty((count, 0, 2), np.int64)
        whole = given & (numbers.value == np.rint(np.nan_to_num(numbers.value, nan=0.5)))
        words = np.full((count, WORDS["kuka"]), NO_WORD, np.int64)
        words[place] = np.where(whole, np.nan_to_num(numbers.value), NO_WORD)
        marks = np.full((count, 2, 2), -1)
        marks[place] = np.stack([numbers.start, numbers.length], axis=2)
        return words, marks

    def _reasons(self, base: IntArray, tool: IntArray, arcs: ArcRows) -> IntArray:
        """Returns why the rows (m,) cannot be compensated, and adds notes."""
        rows, force = self.rows, self.rows.force
        reason = np.where(rows.turn == Turn.AXES, int(Reason.JOINT_TARGET), int(Reason.NONE))
        axes = rows.turn == Turn.AXES

        def give(which: BoolArray, why: Reason, what: str) -> None:
            if not which.any():
                return
            fresh = which & find_open(reason)
            reason[fresh] = why
            if what:
                self.notes.rows(fresh, what)

        flagged = self.blocks.findings.flags
        for row, block in enumerate(rows.block.tolist()):
            if block in flagged:
                reason[row] = flagged[block]
        external = np.maximum.accumulate(reason == Reason.EXTERNAL_AXIS)
        if not self.given.external_axes_at_rest:
            give(external, Reason.EXTERNAL_AXIS, "an axis beside the six of the arm has moved")
        else:
            reason[reason == Reason.EXTERNAL_AXIS] = Reason.NONE
        uncertain = (force == UNCERTAIN).any(axis=1) & ~axes
        give(
            uncertain,
            Reason.INCOMPLETE,
            "the modal state is uncertain: state it again after calls, labels and jumps",
        )
        give(force[:, Modal.RELATIVE] == 1, Reason.RELATIVE, "relative (G91)")
        motion = force[:, Modal.MOTION]
        give(motion == Drive.CYCLE, Reason.EXPRESSION, "a cycle moves at every point")
        give(motion == Drive.OTHER, Reason.EXPRESSION, "neither a straight line nor an arc")
        give(
            force[:, Modal.SIDEWAYS] == 1,
            Reason.EXPRESSION,
            "the control moves the path sideways by the radius of the tool (G41, G42, RL, RR)",
        )
        self._frame_reasons(give, base, tool)
        if self.vocabulary.increments and self.given.units_without_point != "mm":
            give(
                self._increments(),
                Reason.EXPRESSION,
                "a number without a point counts increments on some controls; where it is the unit "
                'in force, state [controller] units_without_point = "mm" in the cell',
            )
        self._turn_reasons(give)
        give(arcs.bad, Reason.INCOMPLETE, "an arc whose circle is not determined")
        return reason

    def _frame_reasons(
        self, give: Callable[[BoolArray, Reason, str], None], base: IntArray, tool: IntArray
    ) -> None:
        posed = self.rows.turn != Turn.AXES
        lost_base, lost_tool = (
            np.isin(index, self.frames.list_lost(side))
            for side, index in (("base", base), ("tool", tool))
        )
        self.frames.tell(base[lost_base & posed], tool[lost_tool])
        give((lost_base & posed) | lost_tool, Reason.UNKNOWN_FRAME, "")
        give(
            (self.rows.force[:, Modal.SHIFTED] == 1) & posed,
            Reason.UNKNOWN_FRAME,
            "the coordinates are moved, turned or scaled by the program",
        )

    def _turn_reasons(self, give: Callable[[BoolArray, Reason, str], None]) -> None:
        rows, force = self.rows, self.rows.force
        off = (force[:, Modal.TIP] == 0) & (rows.turn != Turn.AXES)
        give(
            off & (rows.turn != Turn.FIXED),
            Reason.EXPRESSION,
            "rotary words, but the control does not lead the tool point (TRAORI, G43.4, M128)",
        )
        angles = rows.turn == Turn.ANGLES
        told = force[:, Modal.ANGLES]
        other = (told == 2) | ((told == 1) & (self.rule.angles == "kuka"))
        give(angles & other, Reason.EXPRESSION, "angles in another order than in the cell")
        if not self.rule.angles:
            give(
                angles,
                Reason.INCOMPLETE,
                "the meaning of angles is data of the control: state [controller] angles in the "
                "cell",
            )
        if self.rule.spin is None:
            axis = (rows.turn == Turn.VECTOR) | (rows.turn == Turn.FIXED)
            give(
                axis,
                Reason.INCOMPLETE,
                "only the tool axis is stated: state [controller] spin_deg in the cell",
            )
        short = np.isfinite(rows.value[:, 3:]).all(axis=1)
        short &= ~np.isfinite(tool_axes(rows.value[:, 3:])).all(axis=1)
        give(short & (rows.turn == Turn.VECTOR), Reason.INCOMPLETE, "a tool axis not of length 1")

    def _increments(self) -> BoolArray:
        """Returns the rows with a number other than 0 that has no point."""
        blocks, found = self.blocks, np.zeros(len(self.blocks.first), np.bool_)
        mine = np.flatnonzero((blocks.column <= WordColumn.R) & (blocks.start >= 0))
        text = np.frombuffer(blocks.data, np.uint8)
        bare = ~with_point(text, blocks.start[mine], blocks.length[mine])
        found[blocks.block[mine][bare & (blocks.value[mine] != 0.0)]] = True
        return found[self.rows.block]

    def _tell_unknown(self, rows: Rows, which: BoolArray) -> None:
        missing = np.isnan(rows.value)
        for pattern in np.unique(missing[which], axis=0).tolist():
            same = which & (missing == np.array(pattern)).all(axis=1)
            turn = int(rows.turn[np.flatnonzero(same)[0]])
            names = self.vocabulary.names[turn] if turn != Turn.AXES else ()
            said = [
                name.decode().rstrip("=")
                for name, lost in zip(names, pattern, strict=False)
                if lost
            ]
            what = ", ".join(name for name in said if name) or "a coordinate or angle"
            self.notes.rows(same, f"{what}: left out here and not stated before; write it there")
