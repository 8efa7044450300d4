"""Builds the program of a walked RAPID module: columns, reasons, notes."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_quat_wxyz
from robotrue.core.units import DEG, MM
from robotrue.program.external_axes import Carried, mark_described
from robotrue.program.formats.control_flow import DIFFERS
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.rapid_data import AXIS, NOTHING
from robotrue.program.formats.rapid_flow import AXES_SHIFTED, FOREIGN, SHIFTED
from robotrue.program.formats.rapid_frames import TOOL, WORK
from robotrue.program.formats.rapid_walk import RapidWalk
from robotrue.program.formats.shared_fate import flag_lost_frames, pair_arcs
from robotrue.program.formats.stored_points import firsts, motions_of, moves_to
from robotrue.program.formats.target_notes import TargetNotes, absent_routine
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.formats.written_out import NONE_WRITTEN, TableSpans, WrittenOut
from robotrue.program.program import FrameTable, Program, Reason, find_open
from robotrue.program.target_poses import turned_round

_NOT_CONNECTED: Final = 8.9e9
"""9E9 and beyond: the external axis is absent."""


def _worse(one: IntArray, other: IntArray) -> IntArray:
    """Returns the nonzero value of two columns; if both are zero, that of the second."""
    return np.where(other != 0, other, one)


def build(walk: RapidWalk, given: FrameTable) -> Program:
    """Returns the program."""
    return _Builder(walk, given).program()


class _Builder:
    """Columns of one module while reasons are found; rows are points in the order of the walk."""

    def __init__(self, walk: RapidWalk, given: FrameTable) -> None:
        story, uses = walk.story, walk.story.uses
        self.walk, self.given, self.count = walk, given, len(story.offset)
        self.kind = np.array(story.kind, np.int64)
        self.is_axis = self.kind == AXIS
        self.numbers = self._with_written(walk.table.numbers().rows(np.array(story.row, np.int64)))
        self.point, self.place, self.how, self.setting = (
            np.array(column, np.int64)
            for column in (uses.point, uses.place, uses.motion, uses.setting)
        )
        self.first = firsts(self.point, self.count)
        self.used = self.first >= 0
        self.reason = np.where(self.is_axis, int(Reason.JOINT_TARGET), int(Reason.NONE))
        offsets = np.array(story.offset, np.int64)
        self.starts = line_starts(walk.data)
        self.line = np.searchsorted(self.starts, offsets, side="right")
        self.order = np.argsort(offsets, kind="stable")
        self.outside = walk.outside()
        self.tell = TargetNotes(walk.name, self.line)

    def program(self) -> Program:
        """Returns the finished program, its rows in file order."""
        state = self._settle()
        moved = self._external(state[1])
        self._flag_points()
        position, rotation, axes = self._si()
        position, rotation = turned_round(position, rotation, self.held)
        pair_arcs(self.reason, self.walk.story.arcs)
        self._spoken()
        frames, order = self.walk.frames.frames, self.order
        return Program(
            name=self.walk.name,
            dialect="rapid",
            data=self.walk.data,
            position=position[order],
            rotation=rotation[order],
            axes=axes[order],
            motion=motions_of(self.point, self.how, self.count)[order],
            reason=self.reason[order],
            words=self._words()[order],
            words_of="abb",
            line=self.line[order],
            frame=moved.frame[order],
            tool=state[0][order],
            T_base_frame=moved.T_base_frame,
            external=None if moved.external is None else moved.external[order],
            T_flange_tool=np.array(frames.matrices[TOOL]),
            held=self.held[order] if self.held.any() else np.empty(0, np.bool_),
            notes=self.tell.notes(),
            spans=self._spans(),
            path=moves_to(self.walk.story.uses, np.argsort(order)),
        )

    def _with_written(self, numbers: Numbers) -> Numbers:
        """Returns the numbers with those of points that are written out."""
        written = self.walk.story.written
        if not written:
            return numbers
        value = np.array(numbers.value)
        for point, (_, _, row) in written.items():
            value[point] = row
        return replace(numbers, value=value)

    def _spans(self) -> TableSpans:
        """Returns the places of the numbers, rows in file order."""
        order = self.order
        numbers, is_axis = self.numbers.rows(order), self.is_axis[order]
        return TableSpans(numbers=numbers, is_axis=is_axis, written=self._find_written_out())

    def _find_written_out(self) -> WrittenOut:
        """Returns the targets that are written out."""
        written, bases, place = self.walk.story.written, self.walk.story.bases, self.order.argsort()
        if not written:
            return NONE_WRITTEN
        mine = sorted((int(place[point]), *span[:2], point) for point, span in written.items())
        row, start, end, points = np.array(mine, np.int64).T
        # A target that starts from one that is moved to as well must not be carried along.
        bound = [any(self.used[base] for base in bases.get(one, ())) for one in points.tolist()]
        return WrittenOut(row=row, start=start, end=end, bound=np.array(bound))

    def _put(self, rows: BoolArray, why: Reason, what: str) -> None:
        rows = rows & (self.kind != NOTHING)
        self.reason[rows] = why
        self.tell.rows(rows, what)

    def _settle(self) -> IntArray:
        """Returns tool and work frame (2, n) of every point; flags what cannot be relied on."""
        states, swapped = self._states()
        self.displaced = self._displace(states, swapped)
        self._hold(states, swapped)
        state = np.zeros((2, self.count), np.int64)
        state[:, self.used] = states[:, self.first[self.used]]
        sides, cures = {TOOL: state[0], WORK: state[1]}, self.walk.frames.frames.cures
        for each in flag_lost_frames(self.reason, sides, self.is_axis, cures):
            self.tell.say(each)
        self._put(
            self._any(np.asarray(swapped[0] != swapped[1])) & ~self.is_axis,
            Reason.TOOL_ON_FLOOR,
            "the robot holds the workpiece and the tool, or neither of them (robhold); such "
            "targets are not compensated",
        )
        shifted = self.walk.course.versions(AXES_SHIFTED, self.place) != 0
        self._put(
            self._any(shifted | self.displaced),
            Reason.RELATIVE,
            "a program displacement or offset of external axes (PDisp.., EOffs..) is in force; "
            "such targets are not compensated",
        )
        self._foreign()
        same = states == states[:, self.first[self.point]]
        self._put(
            self._any(~(same[0] & (same[1] | self.is_axis[self.point]))),
            Reason.UNKNOWN_FRAME,
            "this target is used with more than one tool or work object; it is not compensated",
        )
        return state

    def _foreign(self) -> None:
        """Flags the targets after routines in no file that may have moved them, and notes why."""
        if not self.outside or not len(self.place):
            return
        course = self.walk.course
        after = course.versions((FOREIGN, SHIFTED), self.place)
        keys = [(FOREIGN, AXES_SHIFTED)] if self.given.external else []
        for key in keys:
            after = _worse(after, course.versions(key, self.place))
        for (tool, work), (number, _) in self.walk.story.settings.items():
            rows = np.flatnonzero(self.setting == number)
            for key in ((TOOL, tool), (WORK, work)):
                found = course.versions((FOREIGN, key), self.place[rows])
                after[rows] = _worse(after[rows], found)
        left = self._any(after != 0) & (self.kind != NOTHING)
        left &= find_open(self.reason)
        self.reason[left] = Reason.UNKNOWN_FRAME
        uses = after[left[self.point]]
        marks = np.unique(uses).tolist()
        every = DIFFERS in marks
        calls = [each for k, each in enumerate(self.outside, 1) if every or k in marks]
        if calls:
            line = int(np.searchsorted(self.starts, calls[0][1], side="right"))
            self.tell.say(
                absent_routine(
                    f"{self.walk.name}:{line}",
                    list(dict.fromkeys(name for name, _ in calls)),
                    f"a program displacement, tool or work object: {int(left.sum())} targets "
                    "behind it are not compensated",
                )
            )

    def _hold(self, states: IntArray, swapped: BoolArray) -> None:
        """Exchanges tool and work frame, in place, where the robot holds the part."""
        held: BoolArray = np.asarray(swapped.all(axis=0))
        odd = swapped[0] != swapped[1]
        states[:, held] = states[::-1, held]
        states[swapped & odd] = 0
        self.held = self._any(held) & ~self.is_axis
        self._put(
            self._any(held) & self._any(~held) & ~self.is_axis,
            Reason.UNKNOWN_FRAME,
            "this target is used with the part on the robot and with the tool on it",
        )

    def _states(self) -> tuple[IntArray, BoolArray]:
        """Returns tool and work frame (2, u) of every use, and which of them are swapped."""
        states = np.zeros((2, len(self.place)), np.int64)
        swapped = np.zeros((2, len(self.place)), np.bool_)
        for (tool, work), (number, offset) in self.walk.story.settings.items():
            rows = np.flatnonzero(self.setting == number)
            line = int(np.searchsorted(self.starts, offset, side="right")) - 1
            for side, (kind, name) in enumerate(((TOOL, tool), (WORK, work))):
                index, on_robot = self.walk.frames.resolve(kind, name, self.place[rows], line)
                states[side, rows] = index
                swapped[side, rows] = on_robot
        return states, swapped

    def _displace(self, states: IntArray, swapped: BoolArray) -> BoolArray:
        """Adds known displacements to the work frames, in place; returns the uses left (u,)."""
        version = self.walk.course.versions(SHIFTED, self.place)
        left: BoolArray = np.asarray(version != 0)
        frames = self.walk.frames.frames
        for one in np.unique(version[left]).tolist():
            T_work_shifted = self.walk.displacement(one)
            rows = np.flatnonzero((version == one) & ~swapped.any(axis=0))
            if T_work_shifted is None:
                continue
            for index in np.unique(states[1, rows]).tolist():
                mine = rows[states[1, rows] == index]
                left[mine] = False
                if (WORK, index) not in frames.cures:
                    matrix = frames.matrices[WORK][index] @ T_work_shifted
                    states[1, mine] = frames.index_frame(WORK, matrix)
        return left

    def _any(self, uses: BoolArray) -> BoolArray:
        """Returns the points (n,) of which some use is meant."""
        out = np.zeros(self.count, np.bool_)
        out[self.point[uses]] = True
        return out

    def _external(self, work: IntArray) -> Carried:
        """Returns work frames as external axes move them; flags targets where they are unknown."""
        external = self.numbers.value[:, 11:]
        with np.errstate(invalid="ignore"):
            there = np.abs(external) < _NOT_CONNECTED
        moved = self.walk.frames.frames.carry_frames(work, np.where(there, external, np.nan))
        self._put(
            moved.unknown & self.used & ~self.is_axis,
            Reason.EXTERNAL_AXIS,
            "an external axis that carries the robot or the work object has no value here; "
            "such targets are not compensated",
        )
        there &= self.used[:, None] & ~mark_described(self.given.external)
        self._flag_undescribed(external, there)
        return moved

    def _flag_undescribed(self, external: Array, there: BoolArray) -> None:
        away = (there & (external != 0.0)).any(axis=1)
        if not away.any():
            return
        seen = np.where(there, external, np.nan)[self.used & (self.kind != NOTHING)]
        low, high = (each(seen, axis=0) for each in (np.fmin.reduce, np.fmax.reduce))
        missing = np.isnan(seen).any(axis=0) & np.isfinite(low)
        if self.given.external_axes_at_rest and not ((low < high) | missing).any():
            return
        self.reason[away] = Reason.EXTERNAL_AXIS
        column = int(np.flatnonzero((low != 0.0) & np.isfinite(low) | (high > 0.0))[0])
        self.tell.rows(
            away,
            f"external axis {column + 1} is {low[column]:g} to {high[column]:g} (mm or deg) and "
            f"may carry the robot or the part; {int(away.sum())} targets are not compensated. "
            "Describe it in the cell ([[controller.external]]); if it is at rest and the frames "
            "are valid there, state external_axes_at_rest",
        )

    def _flag_points(self) -> None:
        """Sets the flags of single points from the text."""
        story = self.walk.story
        uncertain, based, flagged = (np.zeros(self.count, np.bool_) for _ in range(3))
        uncertain[list(self.walk.variables.uncertain())] = True
        based[list(story.based)] = True
        flagged[list(story.flags)] = True
        self._put(
            uncertain & self.used,
            Reason.EXPRESSION,
            "this target takes part in a computation, or is given several values; "
            "it is not compensated",
        )
        for point, why in story.flags.items():
            self.reason[point] = why
        self.reason[~self.used & ~flagged] = Reason.UNUSED
        self._put(
            based & ~self.used,
            Reason.RELATIVE,
            "this target is used only by Offs or RelTool; it is not compensated",
        )
        self.tell.rows(
            based & (self.reason == Reason.NONE),
            "this target is also the start of Offs or RelTool: targets computed from it move with "
            "its correction",
        )

    def _si(self) -> tuple[Array, Array, Array]:
        """Returns position, rotation and axes in m and rad; flags what cannot be either."""
        values, is_axis = self.numbers.value, self.is_axis
        with np.errstate(invalid="ignore", over="ignore"):
            length = np.linalg.norm(values[:, 3:7], axis=1)
            pose = ~is_axis & (length > 0.5) & (length < 2.0)
        pose &= np.isfinite(values[:, :3]).all(axis=1)
        position = np.where(pose[:, None], values[:, :3] * MM, np.nan)
        rotation = np.full((self.count, 3, 3), np.nan)
        rotation[pose] = matrix_from_quat_wxyz(values[pose, 3:7])
        axes = np.where(is_axis[:, None], values[:, :6] * DEG, np.nan)
        self._put(
            ~pose & ~is_axis | is_axis & np.isnan(axes).any(axis=1),
            Reason.INCOMPLETE,
            "the numbers of this target are no pose: its quaternion is far from length 1, or a "
            "number is beyond all bounds",
        )
        return position, rotation, axes

    def _words(self) -> IntArray:
        values = self.numbers.value[:, 7:11]
        with np.errstate(invalid="ignore"):
            plain = (values == np.rint(values)) & (np.abs(values) < 1000)
        plain &= ~self.is_axis[:, None]
        return np.where(plain, np.where(plain, values, 0).astype(np.int64), NO_WORD)

    def _spoken(self) -> None:
        """Adds what the walk noticed: computed targets, checks of confdata, foreign routines."""
        story, name = self.walk.story, self.walk.name
        self.tell.each(story.notes, self.starts)
        for what, offset in story.checks.items():
            self.tell.say(
                f"{name}:{int(np.searchsorted(self.starts, offset, side='right'))}: {what}: the "
                "controller does not compare confdata from here; they are updated nevertheless."
            )
        for each in (*self.walk.course.handlers(), *self.walk.find_changing_handlers()):
            self.tell.say(
                f"{name}: {each}, which an interrupt or an error starts, changes a tool, work "
                "object or displacement; targets that may come after it are compensated as if it "
                "had not run."
            )
        lost = np.isin(self.reason, (Reason.UNKNOWN_FRAME, Reason.RELATIVE)).any()
        for each, offset in self.walk.changing.items() if lost else ():
            self.tell.say(
                f"{name}:{int(np.searchsorted(self.starts, offset, side='right'))}: {each} of "
                "another module may change a tool, work object or displacement. Set it between "
                "the call and the next motion."
            )
        early = self.walk.course.list_uncertain() if lost else []
        if early:
            self.tell.say(
                f"{name}: an error may end {', '.join(early)} early while a handler continues; "
                "the tool, work object or displacement set there is not known behind the call, and "
                "targets in it are not compensated. Set it between the call and the next motion."
            )
