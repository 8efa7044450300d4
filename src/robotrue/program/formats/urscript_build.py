"""Builds the program of a walked UR script: columns, reasons, notes."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.program.formats.control_flow import DIFFERS
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.number_text import LARGEST
from robotrue.program.formats.shared_fate import flag_lost_frames, pair_arcs
from robotrue.program.formats.stored_points import firsts, motions_of, moves_to
from robotrue.program.formats.target_notes import TargetNotes, absent_routine
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.formats.urscript_walk import (
    BASE,
    FOREIGN,
    FRAME,
    JOINTS,
    NOTHING,
    TOOL,
    ScriptWalk,
)
from robotrue.program.formats.written_out import TableSpans
from robotrue.program.program import FrameTable, Program, Reason, find_open

_SENTENCES: Final = {
    "conflict": "this target is used with more than one tool or frame; it is not compensated",
    "uncertain": "this target takes part in a computation, or is given several values; "
    "it is not compensated",
    "frame": "this pose is a tool or a frame, too; it is not compensated",
    "incomplete": "a number of this target is beyond all bounds",
}


def build(walk: ScriptWalk, data: bytes, name: str, given: FrameTable) -> Program:
    """Returns the program. Without ``set_tcp`` the tool is the table's; poses are in the base."""
    return _Builder(walk, data, name, given).program()


class _Builder:
    """Columns of one script while reasons are found; rows are points in the order of the walk."""

    def __init__(self, walk: ScriptWalk, data: bytes, name: str, given: FrameTable) -> None:
        story, uses = walk.story, walk.story.uses
        self.walk, self.data, self.name, self.count = walk, data, name, len(story.offset)
        self.kind = np.array(story.kind, np.int64)
        self.is_axis = self.kind == JOINTS
        self.numbers = walk.table.numbers().rows(np.array(story.row, np.int64))
        self.bounded = np.asarray((np.abs(self.numbers.value) < LARGEST).all(axis=1))
        self.point, self.place, self.how, self.setting = (
            np.array(column, np.int64)
            for column in (uses.point, uses.place, uses.motion, uses.setting)
        )
        self.first = firsts(self.point, self.count)
        self.used = self.first >= 0
        self.offset = np.array(story.offset, np.int64)
        self.starts = line_starts(data)
        self.line = np.searchsorted(self.starts, self.offset, side="right")
        self.reason = np.where(self.is_axis, int(Reason.JOINT_TARGET), int(Reason.NONE))
        self.tell = TargetNotes(name, self.line)
        # A UR pose is in the robot's base, whatever the cell's own work frame is.
        self.frames = Frames(dataclasses.replace(given, T_base_frame=np.eye(4)), name)
        self.uncertain = np.zeros(self.count, np.bool_)
        self.uncertain[list(walk.variables.uncertain())] = True

    def program(self) -> Program:
        """Returns the finished program, its rows in file order."""
        state = self._settle()
        self._flag_points()
        known = np.where(self.bounded[:, None], self.numbers.value, np.nan)
        axes = np.where(self.is_axis[:, None], known, np.nan)
        values = np.where(self.is_axis[:, None], np.nan, known)
        rows = np.argsort(self.offset, kind="stable")
        held = (self.kind == FRAME) | ~self.used & self._flags(tools_and_frames=True)
        rows = rows[~held[rows]]
        row_of = np.full(self.count, -1)
        row_of[rows] = np.arange(len(rows))
        return Program(
            name=self.name,
            dialect="urscript",
            data=self.data,
            position=values[rows, :3],
            rotation=matrix_from_rotation_vector(values[rows, 3:]),
            axes=axes[rows],
            motion=motions_of(self.point, self.how, self.count)[rows],
            reason=self.reason[rows],
            words=np.empty((len(rows), 0), np.int64),
            words_of="",
            line=self.line[rows],
            frame=state[1][rows],
            tool=state[0][rows],
            T_base_frame=np.array(self.frames.matrices["base"]),
            T_flange_tool=np.array(self.frames.matrices["tool"]),
            notes=self.tell.notes(),
            spans=TableSpans(numbers=self.numbers.rows(rows), is_axis=self.is_axis[rows]),
            path=moves_to(self.walk.story.uses, row_of),
        )

    def _put(self, rows: BoolArray, why: Reason, what: str) -> None:
        rows = rows & (self.kind != NOTHING)
        self.reason[rows] = why
        self.tell.rows(rows, _SENTENCES[what])

    def _settle(self) -> IntArray:
        """Returns tool and frame (2, n) of every point; flags those that are not known."""
        story = self.walk.story
        by_number = np.zeros(len(story.frames), np.int64)
        for frame, number in story.frames.items():
            by_number[number] = self._index("base", number, frame)
        versions = self.walk.course.versions(TOOL, self.place)
        tools = np.array([self._index("tool", i, each) for i, each in enumerate(story.tools)])
        tool = np.where(versions == DIFFERS, -1, tools[np.maximum(versions, 0)])
        if (tool < 0).any():
            at = int(self.line[self.point[np.argmax(tool < 0)]])
            cure = "set it again before this line"
            tool[tool < 0] = self.frames.unknown("tool", at - 1, "depends on the path here", cure)
        states = np.stack([tool, by_number[self.setting]])
        state = np.zeros((2, self.count), np.int64)
        state[:, self.used] = states[:, self.first[self.used]]
        sides = {"tool": state[0], "base": state[1]}
        for each in flag_lost_frames(self.reason, sides, self.is_axis, self.frames.cures):
            self.tell.say(each)
        self._foreign()
        same = states == states[:, self.first[self.point]]
        conflict = np.zeros(self.count, np.bool_)
        conflict[self.point[~(same[0] & (same[1] | self.is_axis[self.point]))]] = True
        self._put(conflict, Reason.UNKNOWN_FRAME, "conflict")
        return state

    def _foreign(self) -> None:
        """Flags the targets after routines in no script that may have set the tool; notes why."""
        outside = self.walk.story.outside
        if not outside:  # the version differs also where no way leads
            return
        after = self.walk.course.versions(FOREIGN, self.place)
        left = np.zeros(self.count, np.bool_)
        left[self.point[after != 0]] = True
        left &= find_open(self.reason)
        if not left.any():
            return
        self.reason[left] = Reason.UNKNOWN_FRAME
        marks = np.unique(after[left[self.point]]).tolist()
        calls = [each for k, each in enumerate(outside, 1) if DIFFERS in marks or k in marks]
        line = int(np.searchsorted(self.starts, calls[0][1], side="right"))
        names = list(dict.fromkeys(name for name, _ in calls))
        what = f"the tool: {int(left.sum())} targets behind it are not compensated, until set_tcp"
        self.tell.say(absent_routine(f"{self.name}:{line}", names, what))

    def _index(self, side: str, number: int, point: int) -> int:
        """Returns the index of a frame or tool: the default, a literal, or not known."""
        if point == BASE:
            return 0
        values = self.numbers.value[point] if point >= 0 else np.full(6, np.nan)
        if point < 0 or self.uncertain[point] or not self.bounded[point]:
            line = self.walk.story.asked.get((side, number), 0)
            at = int(np.searchsorted(self.starts, line, side="right")) - 1
            what = f"of line {at + 1} is computed, given several values, or given nowhere"
            return self.frames.unknown(side, at, what, "write it as a literal p[...]")
        matrix: Array = pose(matrix_from_rotation_vector(values[3:]), values[:3])
        return self.frames.index_frame(side, matrix)

    def _flags(self, *, tools_and_frames: bool) -> BoolArray:
        out = np.zeros(self.count, np.bool_)
        story = self.walk.story
        held = {each for each in (*story.frames, *story.tools) if each >= 0}
        out[[each for each in story.flags if (each in held) == tools_and_frames]] = True
        return out

    def _flag_points(self) -> None:
        """Sets the flags of single points from the text, equal ones for the points of an arc."""
        story = self.walk.story
        self._put(self.uncertain & self.used, Reason.EXPRESSION, "uncertain")
        self._put(self._flags(tools_and_frames=True) & self.used, Reason.EXPRESSION, "frame")
        for point, why in story.flags.items():
            self.reason[point] = why
        flagged = np.zeros(self.count, np.bool_)
        flagged[list(story.flags)] = True
        self.reason[~self.used & ~flagged] = Reason.UNUSED
        self._put(~self.bounded & (self.reason != Reason.UNUSED), Reason.INCOMPLETE, "incomplete")
        pair_arcs(self.reason, story.arcs)
        self.tell.each(story.notes, self.starts)
        for each in self.walk.course.handlers():
            self.tell.say(
                f"{self.name}: the thread {each} changes the tool; targets are compensated as if "
                "it did not run."
            )
