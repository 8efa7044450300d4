"""Builds programs from a walked KRL job: columns, reasons, notes."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG
from robotrue.program.external_axes import Carried, mark_described
from robotrue.program.formats.krl_columns import lean, si_columns, target_numbers
from robotrue.program.formats.krl_flow import (
    BASE,
    FOREIGN_BASE,
    FOREIGN_TOOL,
    ON_ROBOT,
    TOOL,
)
from robotrue.program.formats.krl_frames import UNSURE
from robotrue.program.formats.krl_modal import (
    Visits,
    incomplete_notes,
    inherit,
    inherit_external,
    visits,
)
from robotrue.program.formats.krl_scan import INLINE_ARC, NOT_CONSTANT, STATEMENT
from robotrue.program.formats.krl_walk import MOTION_OF, KrlWalk
from robotrue.program.formats.krl_write import KrlSpans, column_of
from robotrue.program.formats.shared_fate import flag_lost_frames, pair_arcs
from robotrue.program.formats.target_notes import absent_routine
from robotrue.program.formats.written_out import NONE_WRITTEN, WrittenOut
from robotrue.program.program import FrameTable, Motion, Program, Reason
from robotrue.program.target_poses import turned_round

_MOTION_OF_KIND: Final = np.array([int(MOTION_OF.get(kind, -1)) for kind in range(INLINE_ARC + 1)])
_MOST_WORD: Final = 1 << 31
"""Numbers from which on S and T are no words of any controller."""
_SIDES: Final = (("base", BASE), ("tool", TOOL))


class Settled(NamedTuple):
    """Reasons (n,), work frames and tools (n,) of targets, the matrices, and notes."""

    reason: IntArray
    frame: IntArray
    tool: IntArray
    T_base_frame: Array
    T_flange_tool: Array
    external: Array | None
    notes: list[str]


class Builder:
    """Turns one walk into programs."""

    def __init__(self, walk: KrlWalk, main: int, given: FrameTable) -> None:
        self.walk, self.main, self.given = walk, main, given
        self.scans, self.story, self.frames = walk.scans, walk.story, walk.frames
        self._places, self._states = self._solved_frames()
        self._flags = self.story.flag_tainted()

    def _solved_frames(self) -> tuple[IntArray, IntArray]:
        """Returns from which place on which (base, tool, on robot, foreign base, tool) hold."""
        flow = self.walk.flow
        self.story.notes += [
            f"{self.frames.name}: {name}, which an interrupt or trigger starts, changes base or "
            "tool; targets that may come after it are compensated as if it had not run."
            for name in flow.changing_handlers()
        ]
        self._calls = flow.foreign_calls()
        self.story.notes += [
            f"{self.frames.name}: {self.story.spelled.get(name, name)}, which an interrupt starts, "
            "is in no file given; targets are compensated as if it changed neither base nor "
            "tool."
            for name in flow.absent_handlers()
        ]
        places, keys = flow.places, (BASE, TOOL, ON_ROBOT, FOREIGN_BASE, FOREIGN_TOOL)
        table = np.stack([flow.marks(key, places) for key in keys], axis=1)
        for side, column in _SIDES:
            for mark in np.unique(table[table[:, column] < 0, column]).tolist():
                at, what = flow.differing(mark)
                cure = "remove it" if at < 0 else "set it again after this line"
                at = int(places[table[:, column] == mark][0]) if at < 0 else at
                index = self.frames.unknown(side, at // 2, what, cure)
                table[table[:, column] == mark, column] = index
        table[:, ON_ROBOT] = np.where(table[:, ON_ROBOT] < 0, UNSURE, table[:, ON_ROBOT])
        calls = table[:, 3:]
        first = calls[calls > 0].min(initial=np.iinfo(np.int64).max)
        calls[calls < 0] = first
        return places, table

    def _state(self, line: IntArray | int) -> IntArray:
        place = 2 * np.asarray(line) + 1
        if place.size > 1:  # nearly always equal: no separate row for each
            ends = np.searchsorted(self._places, (place.min(), place.max()), side="right") - 1
            if ends[0] == ends[1]:
                return np.broadcast_to(self._states[ends[0]], (len(place), self._states.shape[1]))
        return self._states[np.searchsorted(self._places, place, side="right") - 1]

    def join_calls(self, before: IntArray, line: int) -> tuple[IntArray, BoolArray]:
        """Joins calls of the same targets (n,): by earlier lines, -1 for none, and by one more.

        Returns:
            The line whose frames hold, that of a call after a routine in no file if there is one,
            and where the frames differ.
        """
        first, called = self._state(before), before >= 0
        differ = called & (first[:, :3] != self._state(line)[:3]).any(axis=1)
        return np.where(called & (first[:, 3:] > 0).any(axis=1), before, line), differ

    def axes_before(self, line: int) -> Array:
        """Returns the axis values (6,) rad last moved to before a line; empty if not by them."""
        found = self.scans[max(self.main, 0)]
        at = np.flatnonzero(found.line_kind[found.agg_line] > STATEMENT)
        inline = [(int(found.agg_line[a]), int(a), False) for a in at.tolist()]
        moved = [each for each in (*inline, *self.story.sequence) if each[0] < line]
        last = max(moved, key=lambda each: each[:2], default=(0, -1, False))[1]
        if last < 0:
            return np.empty(0)
        numbers, is_pose, is_axis = target_numbers(found, np.array([last]))
        axes: Array = numbers.value[0, :6] * DEG
        return axes if is_axis[0] and not is_pose[0] and np.isfinite(axes).all() else np.empty(0)

    def settle_call(self, name: str, lines: IntArray, external: Array) -> Settled:
        """Returns what holds for targets of a file that the main file calls.

        Args:
            name: Of that file.
            lines: (n,) zero-based line of the call that goes through each target.
            external: (n, 6) external axes as printed, NaN where none is.
        """
        axis = np.zeros(len(lines), np.bool_)
        state = np.asarray(self._state(lines), dtype=np.int64).reshape(-1, 5)
        reason, notes = self._frame_reasons(state, axis)
        if self.given.fixed_tool == "tool_in_part":
            reason[state[:, ON_ROBOT] > 0] = Reason.TOOL_ON_FLOOR
        moved, said = self._external(external, state[:, BASE], reason, name, axis)
        notes += said
        return Settled(
            reason,
            moved.frame,
            state[:, TOOL],
            moved.T_base_frame,
            np.array(self.frames.matrices["tool"]),
            moved.external,
            notes,
        )

    def program(self, file: int) -> Program:
        """Returns the program of one file."""
        found, name = self.scans[file], self.walk.names[file]
        agg, motion, where = self._rows(file)
        state, conflicts = self._row_states(file, agg, where)
        numbers, is_pose, is_axis = target_numbers(found, agg)
        values, words = np.array(numbers.value[:, :6]), numbers.value[:, 6:8]
        external = np.array(numbers.value[:, 8:]) if numbers.value.shape[1] > 8 else None
        mixed = is_pose & is_axis
        partial, donor = self._modal(file, agg, motion, values, is_axis, state, mixed)
        incomplete = mixed | np.isnan(values).any(axis=1)
        line = found.agg_line[agg].astype(np.int64) + 1
        reason, notes = self._frame_reasons(state, is_axis)
        reason[conflicts] = Reason.UNKNOWN_FRAME
        notes += [
            f"{name}:{one}: this point is used with more than one base or tool; it is not "
            "compensated."
            for one in line[conflicts][:5].tolist()
        ]
        if external is not None and file == self.main and _some(np.isnan(external)):
            inherit_external(external, self._path(file, agg, motion, np.zeros(len(agg), np.bool_)))
        moved, said = self._external(external, state[:, BASE], reason, name, is_axis)
        notes += said
        reason[motion == Motion.UNUSED] = Reason.UNUSED
        reason[incomplete] = Reason.INCOMPLETE
        notes += incomplete_notes(name, line, incomplete & ~mixed)
        for row, why in self._list_flagged(file, agg):
            reason[row] = why
        self._pair_arcs(file, agg, motion, reason)
        notes = self._file_notes(file, name) + notes + self._note_shared(file, name, agg, reason)
        free = ((motion == Motion.ARC_VIA) & ~is_axis)[partial][:, None] & (np.arange(6) >= 3)
        values[incomplete] = np.nan
        position, rotation, axes = si_columns(values, is_axis)
        held = self._find_held(state, is_axis)
        if len(held):
            position, rotation = turned_round(position, rotation, held)
        return Program(
            name=name,
            dialect="krl",
            data=found.data,
            position=position,
            rotation=rotation,
            axes=axes,
            motion=lean(motion),
            reason=lean(reason),
            words=lean(np.where(np.abs(words) < _MOST_WORD, words, NO_WORD).astype(np.int64)),
            words_of="kuka",
            line=line,
            frame=lean(moved.frame),
            tool=lean(state[:, TOOL]),
            T_base_frame=moved.T_base_frame,
            external=moved.external,
            T_flange_tool=np.array(self.frames.matrices["tool"]),
            held=held,
            notes=tuple(dict.fromkeys(notes)),
            spans=KrlSpans(
                numbers=numbers,
                is_axis=is_axis,
                written=self._collect_written(file, agg),
                partial=partial,
                donor=donor,
                owed=(donor >= 0) & ~free,
            ),
            path=self._moves(file, agg, motion),
        )

    def _collect_written(self, file: int, agg: IntArray) -> WrittenOut:
        """Returns the targets that are written out, and which depend on other moved ones."""
        mine = sorted((a, *what) for (f, a), what in self.story.written.items() if f == file)
        if not mine:
            return NONE_WRITTEN
        moved = {d.variable for d in self.story.definitions if (d.file, d.agg) in self.story.uses}
        point, start, end = np.array([each[:3] for each in mine], np.int64).T
        scan = self.scans[file]
        tokens = zip(
            scan.agg_token[point].tolist(), scan.agg_token[point + 1].tolist(), strict=True
        )
        return WrittenOut(
            row=np.searchsorted(agg, point),
            start=start,
            end=end,
            bound=np.array([bool(each[3] & moved) for each in mine]),
            columns=tuple(
                tuple(map(column_of, scan.tok_component[a:b].tolist())) for a, b in tokens
            ),
        )

    def _find_held(self, state: IntArray, is_axis: BoolArray) -> BoolArray:
        """Returns the rows whose part the robot carries along a fixed tool; empty: none."""
        on_robot = state[:, ON_ROBOT] == 1
        if self.given.fixed_tool != "tool_in_part" or not on_robot.any():
            return np.zeros(0, np.bool_)
        return np.asarray(on_robot & ~is_axis)

    def _note_shared(self, file: int, name: str, agg: IntArray, reason: IntArray) -> list[str]:
        """Notes compensated GLOBAL points: programs outside of the job may use them."""
        shared = self.story.shared
        own = [d for d in self.story.definitions if d.file == file and d.variable in shared]
        if not own:
            return []
        rows = np.searchsorted(agg, np.array([item.agg for item in own]))
        done = [d for d, row in zip(own, rows.tolist(), strict=True) if reason[row] == Reason.NONE]
        if not done:
            return []
        names = list(dict.fromkeys(item.variable.partition("@")[0] for item in done))
        shown = ", ".join(names[:5]) + (" and others" if len(names) > 5 else "")
        return [
            f"{name}: {len(done)} targets are GLOBAL points ({shown}), compensated in the base "
            "and tool of this job; other programs that move to them get the same numbers. Give "
            "all programs that use them as one job."
        ]

    def _moves(self, file: int, agg: IntArray, motion: IntArray) -> IntArray:
        """Returns the moves of the main file to the points of one, see ``Program.path``."""
        story = self.story
        if self.main < 0 or not (story.uses or story.lost):
            return np.empty((0, 3), np.int64)
        moves = [
            (2 * line + (how != Motion.ARC_VIA), int(np.searchsorted(agg, point)), int(how))
            for (where, point), uses in story.uses.items()
            if where == file
            for line, how in uses
        ]
        if file == self.main:
            found = self.scans[file]
            moves += [(2 * line + 1, -line - 1, int(how)) for line, how in story.lost]
            rows = np.flatnonzero(found.line_kind[found.agg_line[agg]] > STATEMENT)
            place = 2 * found.agg_line[agg[rows]].astype(np.int64)
            place += motion[rows] != Motion.ARC_VIA
            inline = np.stack([place, rows, motion[rows]], axis=1)
        else:
            inline = np.empty((0, 3), np.int64)
        every = np.concatenate([np.array(moves, np.int64).reshape(-1, 3), inline])
        return np.asarray(every[np.argsort(every[:, 0], kind="stable")])

    def _rows(self, file: int) -> tuple[IntArray, IntArray, IntArray]:
        """Returns the aggregates that are targets, their motions, and the lines of the moves."""
        found = self.scans[file]
        motion = np.full(len(found.agg_line), -1, np.int64)
        line = found.agg_line.astype(np.int64)
        if file == self.main:
            kind = found.line_kind[found.agg_line]
            motion = _MOTION_OF_KIND[kind]
            arc = np.flatnonzero(kind == INLINE_ARC)
            motion[arc[::2]] = Motion.ARC_VIA
            plain = np.flatnonzero(kind > STATEMENT)
            for agg in plain[(found.agg_flag[plain] & NOT_CONSTANT) > 0].tolist():
                self._flags[file, agg] = Reason.EXPRESSION
        for item in self.story.definitions:
            if item.file == file:
                motion[item.agg] = Motion.LIN if self.main < 0 else Motion.UNUSED
        for (where, agg), uses in self.story.uses.items():
            if where == file:
                hows = [how for _, how in uses]
                motion[agg] = Motion.PTP if Motion.PTP in hows else hows[0]
                line[agg] = uses[0][0]
        targets = np.flatnonzero(motion >= 0)
        return targets, motion[targets], line[targets]

    def _row_states(self, file: int, agg: IntArray, line: IntArray) -> tuple[IntArray, BoolArray]:
        """Returns the frames in force at every row and which rows are used with several."""
        conflicts = np.zeros(len(agg), np.bool_)
        if self.main < 0:
            return self._inline_states(file, agg, line), conflicts
        state = np.asarray(self._state(line), dtype=np.int64).reshape(-1, 5)
        shared = [
            (int(np.searchsorted(agg, point)), np.array([self._state(use) for use, _ in uses]))
            for (where, point), uses in self.story.uses.items()
            if where == file and len(uses) > 1
        ]
        state = np.array(state) if shared else state  # one use after a routine in no file is enough
        for row, states in shared:
            conflicts[row] = (states[1:, :3] != states[0, :3]).any()
            state[row, 3:] = states[:, 3:].max(axis=0)
        return state, conflicts

    def _inline_states(self, file: int, agg: IntArray, line: IntArray) -> IntArray:
        """Returns the frames of points without motions: those of the FDAT named like them."""
        state = np.zeros((len(agg), 5), np.int64)
        rows = {int(a): row for row, a in enumerate(agg)}
        for item in self.story.definitions:
            inline = self.frames.fdat.get("f" + item.variable[1:])
            if item.file == file and inline is not None and item.variable.startswith("x"):
                row = rows[item.agg]
                state[row, :3] = self.frames.inline_frames(int(line[row]), inline)
        return state

    def _modal(
        self,
        file: int,
        agg: IntArray,
        motion: IntArray,
        values: Array,
        axis: BoolArray,
        state: IntArray,
        mixed: BoolArray,
    ) -> tuple[IntArray, IntArray]:
        """Fills left-out components from the target before; returns (rows, donors) as executed."""
        if file != self.main or not np.isnan(values).any():
            return np.zeros(0, np.int64), np.zeros((0, 6), np.int64)
        torn = mixed.copy()
        torn[[row for row, _ in self._list_flagged(file, agg)]] = True
        torn[np.searchsorted(agg, [a for f, a in self.story.written if f == file])] = True
        path = self._path(file, agg, motion, torn)
        return inherit(values, path, axis.astype(np.int64), state[:, :3])

    def _path(self, file: int, agg: IntArray, motion: IntArray, torn: BoolArray) -> Visits:
        """Returns the motions of the main file in the order they are executed."""
        found = self.scans[file]
        row_of = np.full(len(found.agg_line) + 1, -1, np.int64)
        row_of[agg] = np.arange(len(agg))
        inline = np.flatnonzero(found.line_kind[found.agg_line[agg]] > STATEMENT)
        entries = zip(
            found.agg_line[agg[inline]].tolist(),
            agg[inline].tolist(),
            (motion[inline] == Motion.ARC_VIA).tolist(),
            strict=True,
        )
        return visits(entries, self.story.sequence, row_of, torn)

    def _frame_reasons(self, state: IntArray, axis: BoolArray) -> tuple[IntArray, list[str]]:
        """Returns the first reason of every row, from its kind and frames, and the notes."""
        reason = np.where(axis, int(Reason.JOINT_TARGET), int(Reason.NONE))
        on_robot = (state[:, ON_ROBOT] > 0) & ~axis
        refused = on_robot & ((state[:, ON_ROBOT] == UNSURE) | (not self.given.fixed_tool))
        reason[refused] = Reason.TOOL_ON_FLOOR
        sides = {side: state[:, column] for side, column in _SIDES}
        notes = flag_lost_frames(reason, sides, axis, self.frames.cures)
        notes += self._foreign(state, axis, reason)
        if refused.any():
            notes.append(
                f"{self.frames.name}: {int(refused.sum())} targets carry the workpiece on the "
                "robot (#TCP), or may do so; they are not compensated. State fixed_tool in "
                "[controller] of the cell."
            )
        return reason, notes

    def _external(
        self, external: Array | None, base: IntArray, reason: IntArray, name: str, axis: BoolArray
    ) -> tuple[Carried, list[str]]:
        """Returns work frames as external axes move them; flags targets where they are unknown."""
        if external is None and not self.given.external:
            bases = np.array(self.frames.matrices["base"])
            unknown = np.zeros(len(base), np.bool_)
            return Carried(frame=base, T_base_frame=bases, unknown=unknown), []
        values = np.full((len(base), 6), np.nan) if external is None else external
        moved = self.frames.carry_frames(base, values)
        lost = moved.unknown & ~axis
        reason[lost] = Reason.EXTERNAL_AXIS
        notes = []
        if lost.any():
            notes.append(
                f"{name}: {int(lost.sum())} targets leave out the value of an external axis that "
                "carries the robot or their base; they are not compensated. Write it with each."
            )
        values = values[:, ~mark_described(self.given.external)]
        return moved, notes + self._flag_undescribed(values, reason, name)

    def _flag_undescribed(self, external: Array, reason: IntArray, name: str) -> list[str]:
        used = np.nan_to_num(external).any(axis=0)
        lacking = (np.isnan(external) & used).any(axis=1) & (reason != Reason.JOINT_TARGET)
        external = np.nan_to_num(external)
        away = (np.abs(external) > 0).any(axis=1) | lacking
        still = bool((external == external[:1]).all())
        if not away.any() or (self.given.external_axes_at_rest and still):
            return []
        reason[away] = Reason.EXTERNAL_AXIS
        column = int(np.flatnonzero((np.abs(external) > 0).any(axis=0))[0])
        low, high = external[:, column].min(), external[:, column].max()
        column = int(np.flatnonzero(~mark_described(self.given.external))[column])
        return [
            f"{name}: external axis E{column + 1} is {low:g} to {high:g} (mm or deg) and may carry "
            f"the robot or the part; {int(away.sum())} targets are not compensated. Describe it in "
            "the cell ([[controller.external]]); if it is at rest and the frames are valid there, "
            "state external_axes_at_rest."
        ]

    def _foreign(self, state: IntArray, axis: BoolArray, reason: IntArray) -> list[str]:
        """Flags, in place, targets after a call that may have changed their frames; notes why."""
        calls = np.where(state[:, 3] > 0, state[:, 3], state[:, 4])
        after = ((state[:, 3] > 0) & ~axis | (state[:, 4] > 0)) & (reason != Reason.UNKNOWN_FRAME)
        found: dict[tuple[str, ...], list[int]] = {}
        for line, count in zip(*np.unique(calls[after], return_counts=True), strict=True):
            names = self._calls.get(int(line), ())
            known = found.setdefault(names, [int(line), 0])
            known[1] += int(count)
        reason[after] = Reason.UNKNOWN_FRAME
        return [
            absent_routine(
                f"{self.frames.name}:{line}",
                [self.story.spelled.get(name, name) for name in names],
                f"base or tool: {count} targets after it are not compensated, until both are set "
                "again",
            )
            for names, (line, count) in found.items()
        ]

    def _file_notes(self, file: int, name: str) -> list[str]:
        notes = list(self.story.notes) if file == max(self.main, 0) else []
        if self.main < 0:
            notes.append(
                f"{name}: points without the .src that moves to them; they are assumed to be "
                "linear motions in the frames of their inline forms, or the defaults."
            )
        return notes

    def _list_flagged(self, file: int, agg: IntArray) -> list[tuple[int, int]]:
        rows = [
            (int(np.searchsorted(agg, a)), a, why)
            for (f, a), why in self._flags.items()
            if f == file
        ]
        return [(row, why) for row, a, why in rows if row < len(agg) and agg[row] == a]

    def _pair_arcs(self, file: int, agg: IntArray, motion: IntArray, reason: IntArray) -> None:
        """Gives both points of an arc the same fate: half a corrected arc is another arc."""
        found, arcs = self.scans[file], []
        if file == self.main:
            via = np.flatnonzero(
                (found.line_kind[found.agg_line[agg]] == INLINE_ARC) & (motion == Motion.ARC_VIA)
            )
            via = via[(reason[via] > 0) | (reason[via + 1] > 0)]
            arcs = [(row, row + 1) for row in via.tolist()]
        for pair in self.story.arcs:
            rows = [int(np.searchsorted(agg, a)) for f, a in pair if f == file]
            arcs += [(rows[0], rows[1])] if len(rows) == 2 else []
        pair_arcs(reason, arcs)


def _some(lacking: BoolArray) -> bool:
    """Returns whether a column is true in some rows and not in others."""
    return bool((lacking.any(axis=0) & ~lacking.all(axis=0)).any())
