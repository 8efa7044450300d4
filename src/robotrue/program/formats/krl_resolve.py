"""Evaluates the computed values of a KRL job: frames first, then the targets of its motions.

A frame number or frame with one value is that frame; where it depends on the arguments of a call,
the routine is followed once for every call. A target that is computed, or is in no data list of the
job, and has one value is *written out*: it becomes a separate target, at its place in the motion,
and the points it is computed from keep their numbers. A target without a single value is left
alone, and so is every point it reads.
"""

from __future__ import annotations

import re
from collections import defaultdict
from typing import Final

import numpy as np

from robotrue.program.formats.expression import NotConstantError
from robotrue.program.formats.krl_expression import (
    AXIS_PARTS,
    POSE_PARTS,
    KrlRecord,
    KrlValue,
    matrix_of,
)
from robotrue.program.formats.krl_flow import PURE
from robotrue.program.formats.krl_frames import DeferredFrame
from robotrue.program.formats.krl_operands import (
    REFERENCE,
    Definition,
    MotionStatement,
    Operand,
)
from robotrue.program.formats.krl_scan import COMPONENTS
from robotrue.program.formats.krl_values import NO_VALUE, Arguments, KrlCall
from robotrue.program.formats.krl_walk import COLUMN, KrlWalk
from robotrue.program.formats.krl_written import Written, put_written
from robotrue.program.formats.text_lines import split_outside
from robotrue.program.program import Motion, Reason

_NUMBERED: Final = re.compile(r"\s*(BASE|TOOL)_DATA\s*\[(.*)\]\s*", re.IGNORECASE)
_DEEPEST: Final = 4
_MOST_COPIES: Final = 2_000
_MOTIONS: Final = {"PTP": Motion.PTP, "LIN": Motion.LIN, "SPL": Motion.SPLINE}


def resolve(walk: KrlWalk) -> None:
    """Settles frames and targets of a walk that has read every file."""
    _Resolver(walk).run()


class _Resolver:
    """One settling."""

    def __init__(self, walk: KrlWalk) -> None:
        self.walk, self.values, self.frames = walk, walk.values, walk.frames
        self.settled: dict[tuple[str, int], int] = {}
        self.read: set[str] = set()
        self.written: list[Written] = []
        self.said: set[str] = set()
        self.sources: dict[str, set[str]] | None = None
        self.stored: dict[tuple[int, int], Definition] = {}
        self.settings: dict[tuple[str, str, str], list[tuple[int, int]]] = defaultdict(list)
        self.set_at: dict[tuple[str, str, str, int | None], list[tuple[int, int]]] = {}
        self.copies: dict[tuple[str, tuple[tuple[str, str], ...]], tuple[int, dict[int, int]]] = {}
        self.by_routine: dict[str, list[DeferredFrame]] = {}
        self.calls: dict[int, list[KrlCall]] = {}

    def run(self) -> None:
        """Settles everything."""
        walk = self.walk
        self.values.settle(self._is_harmless)
        for each in walk.deferred:
            self.by_routine.setdefault(self.values.routine_at(each.line), []).append(each)
        for call in self.values.calls:
            if call.node >= 0:
                self.calls.setdefault(call.node, []).append(call)
        if walk.deferred:
            self._settle_frames()
        found = [[self._points(motion, one) for one in motion.operands] for motion in walk.motions]
        moved = {key for motion in found for keys in motion for key in keys}
        self._taint_sources()
        self._taint_derived(
            {d.variable for d in walk.story.definitions if (d.file, d.agg) in moved}
        )
        for motion, points in zip(walk.motions, found, strict=True):
            self._write_out_read(motion, points)
            self._register(motion, points)
        put_written(walk, self.written)

    def _is_harmless(self, name: str) -> bool:
        plain = name.partition("@")[0]
        return plain in PURE or (self.walk.flow.is_harmless(name) and plain in self._told)

    @property
    def _told(self) -> frozenset[str]:
        return frozenset(self.frames.table.harmless_routines)

    # Frames

    def _settle_frames(self) -> None:
        """Gives every frame that was deferred its index, and routines copies for their calls."""
        mapping: dict[tuple[int, int], int] = {}
        for each in self.walk.deferred:
            try:
                index = self._frame(each, None)
            except NotConstantError as why:
                index = self._unknown_frame(each, why)
                self.read.update(self._names_in(each.text, each.line))
            self.settled[each.side, each.place] = index
            mapping[COLUMN[each.side], each.place] = index
        self._follow_calls()
        self.walk.flow.rename(mapping)
        self.frames.rename(self.settled)

    def _unknown_frame(self, each: DeferredFrame, why: NotConstantError) -> int:
        if each.numbered or _NUMBERED.fullmatch(each.text):
            match = _NUMBERED.fullmatch(each.text)
            number = match[2].strip() if match else each.text
            what = f"number {number} is computed ({why})"
            cure = why.cure or "write the number out"
            return self.frames.unknown(each.side, each.line, what, cure)
        return self.frames.find_named(each.side, each.line, each.text, str(why), why.cure)

    def _frame(self, each: DeferredFrame, arguments: Arguments | None) -> int:
        """Returns the index of a frame.

        Raises:
            NotConstantError: It has no single value.
        """
        match = _NUMBERED.fullmatch(each.text)
        if match and match[1].lower() != each.side:
            match = None
        text = match[2] if match else each.text
        if not match and not each.numbered and ":" in text:
            return self._chain(each, arguments)
        value = self.values.value(text, each.line, arguments)
        if not (match or each.numbered):
            printed = matrix_of(value)
            return self.frames.index_frame(each.side, self.frames.in_robot(each.side, printed))
        if not isinstance(value, int) or value < 0:
            raise NotConstantError(f"{text.strip()} is {value!r}, no frame number")
        return self._number(each, value)

    def _number(self, each: DeferredFrame, number: int) -> int:
        if self.frames.differs_later(each.side, str(number), each.stored):
            raise NotConstantError(f"frame {number} is set again later on")
        index = self.frames.number(each.side, each.line, str(number))
        return self.settled.get((each.side, index), index)

    def _chain(self, each: DeferredFrame, arguments: Arguments | None) -> int:
        """Returns the index of frames joined by ``:``, numbered frames among them."""
        total = np.eye(4)
        for number, part in enumerate(split_outside(each.text, ":")):
            match = _NUMBERED.fullmatch(part)
            if match:
                value = self.values.value(match[2], each.line, arguments)
                if not isinstance(value, int):
                    raise NotConstantError(f"{match[2]} is no frame number")
                index = self._number(each._replace(side=match[1].lower()), value)
                matrix = self.frames.matrices[match[1].lower()][index]
                if (match[1].lower(), index) in self.frames.cures:
                    raise NotConstantError(f"{part.strip()} is not known")
                if each.side == "base" and number > 0:
                    raise NotConstantError("a numbered base behind another frame")
            else:
                matrix = matrix_of(self.values.value(part, each.line, arguments))
                if number == 0:
                    matrix = self.frames.in_robot(each.side, matrix)
            total = total @ matrix
        return self.frames.index_frame(each.side, total)

    def _follow_calls(self) -> None:
        """Leads calls with constant arguments to copies of the routines they call."""
        for node, calls in list(self.calls.items()):
            for call in calls:
                self._copy(node, call, None, 0)

    def _copy(self, node: int, call: KrlCall, within: Arguments | None, depth: int) -> None:
        """Leads a call to a copy of its routine, where its frames depend on arguments."""
        routine = self.values.routines.get(call.name)
        if routine is None or not routine.parameters or depth > _DEEPEST:
            return
        arguments: dict[str, KrlValue] = {}
        for (name, _), text in zip(routine.parameters, call.arguments, strict=False):
            try:
                arguments[name] = self.values.value(text, call.line, within)
            except NotConstantError:
                continue
        key = call.name, tuple((name, repr(value)) for name, value in sorted(arguments.items()))
        if key not in self.copies:
            if not self._hangs_on_arguments(call.name, 0) or len(self.copies) > _MOST_COPIES:
                return
            frames = {}
            for each in self.by_routine.get(call.name, ()):
                try:
                    frames[COLUMN[each.side], each.place] = self._frame(each, arguments)
                except NotConstantError:
                    continue
            self.copies[key] = _, nodes = self.walk.flow.copy_routine(call.name, frames)
            for old in self.walk.flow.calls_of(call.name):
                for inner in self.calls.get(old, ()):
                    self._copy(nodes[old], inner, arguments, depth + 1)
        self.walk.flow.lead(node, call.name, self.copies[key][0])

    def _hangs_on_arguments(self, name: str, depth: int) -> bool:
        """Returns whether a routine, or one it calls, sets frames that are computed."""
        if self.by_routine.get(name):
            return True
        if depth > _DEEPEST or name not in self.values.routines:
            return False
        inner = [call for n in self.walk.flow.calls_of(name) for call in self.calls.get(n, ())]
        return any(self._hangs_on_arguments(call.name, depth + 1) for call in inner)

    # Targets

    def _register(self, motion: MotionStatement, found: list[list[tuple[int, int]]]) -> None:
        """Enters the points a motion moves to."""
        story, file, line = self.walk.story, motion.file, motion.line
        if motion.kind == "CIRC" and len(motion.operands) < 2:
            self.walk.note(line, file, "CIRC with one point; it is not compensated")
            keys = motion.operands[0].keys if motion.operands else ()
            story.flags |= dict.fromkeys(keys, Reason.INCOMPLETE)
        how = _MOTIONS.get(motion.kind)
        for number, keys in enumerate(found):
            mine = how if how is not None else (Motion.ARC_VIA, Motion.ARC_END)[number]
            for key in keys:
                story.uses[key].append((line, mine))
                if motion.relative:
                    story.flags[key] = Reason.RELATIVE
            if not keys:
                story.lost.append((line, mine))
            single = len(keys) == 1 and keys[0][0] == file and not motion.relative
            agg = keys[0][1] if single else -1
            if mine is not Motion.ARC_VIA:
                story.sequence.append((line, agg, False))
            elif agg >= 0:
                story.sequence.append((line, agg, True))
        if not motion.operands:
            story.sequence.append((line, -1, False))
        if len(found) == 2 and all(found):
            via, end = found
            story.arcs.extend(
                (a, b) for a in via for b in (end if len(via) == 1 or len(end) == 1 else ())
            )
            if len(via) > 1 and len(via) == len(end):
                story.arcs.extend(zip(via, end, strict=True))

    def _points(self, motion: MotionStatement, operand: Operand) -> list[tuple[int, int]]:
        """Returns the points a target is: one written out, or those stored."""
        line, plain = motion.line, operand.constant
        if plain and operand.keys and not (
            operand.name and self.values.is_computed(operand.name, line)
        ):  # fmt: skip
            return self._reaching_points(operand, line)
        if not operand.text or (plain and not operand.name):
            return operand.keys
        try:
            if motion.relative:
                raise NotConstantError("the motion is relative")
            value = _whole(self.values.value(operand.text, line))
        except NotConstantError as why:
            return self._leave(motion, operand, why)
        return [self._write_out(motion, operand, value)]

    def _reaching_points(self, operand: Operand, line: int) -> list[tuple[int, int]]:
        """Returns which of the points that one variable is set to a motion may go to."""
        if not operand.name or len(operand.keys) != 1:
            return operand.keys
        if not self.stored:
            self._collect_stored()
        one = self.stored[operand.keys[0]]
        variable, subscript, path = one[2:]
        places, others = (
            self.settings[variable, subscript, path],
            self.settings[variable, "?", path],
        )
        if len(places) + len(others) < 2:
            return operand.keys
        at = self.values.find_setting_line(variable, subscript, line)
        return self.set_at.get((variable, subscript, path, at)) or places + others

    def _collect_stored(self) -> None:
        """Sorts the stored points by what they set, those with a computed subscript under ``?``."""
        line_of = self.walk.scans[self.walk.main].agg_line
        for item in self.walk.story.definitions:
            point, path = (item.file, item.agg), item.path
            self.stored.setdefault(point, item)
            subscript = "?" if item.computed else item.subscript
            self.settings[item.variable, subscript, path].append(point)
            if item.file == self.walk.main:
                at = int(line_of[item.agg])
                self.set_at[item.variable, subscript, path, at] = [point]

    def _write_out(
        self, motion: MotionStatement, operand: Operand, value: KrlRecord
    ) -> tuple[int, int]:
        """Returns the new point of a target that is written out."""
        line = motion.line
        names = self._sources_of(operand.text, line)
        agg = -2 - len(self.written)  # renumbered when all are known
        self.written.append(
            Written(motion.file, line, operand.start, operand.end, value, agg, frozenset(names))
        )
        return motion.file, agg

    def _write_out_read(self, motion: MotionStatement, found: list[list[tuple[int, int]]]) -> None:
        """Writes targets out, in place, whose stored points are read by what is not followed."""
        names = {name for name, _ in self.walk.story.tainted}
        for number, (operand, keys) in enumerate(zip(motion.operands, found, strict=True)):
            plain = operand.name and operand.text.lower() == operand.name and len(keys) == 1
            name = self.values.key(operand.name, motion.line)
            if not plain or keys[0][1] < 0 or name not in names:
                continue
            if motion.relative or self.values.is_computed(operand.name, motion.line):
                continue
            try:
                value = _whole(self.values.value(operand.text, motion.line))
            except NotConstantError:
                continue
            found[number] = [self._write_out(motion, operand, value)]

    def _leave(
        self, motion: MotionStatement, operand: Operand, why: NotConstantError
    ) -> list[tuple[int, int]]:
        """Leaves a target without a single value alone, with the points it reads; notes why."""
        walk, line, file = self.walk, motion.line, motion.file
        cure = f" Try: {why.cure}" if why.cure else ""
        if not operand.constant:
            walk.taint(line, operand.text)
            walk.story.flags |= dict.fromkeys(operand.keys, Reason.EXPRESSION)
            text = f"the target is computed; it is not compensated: {why}{cure}"
            walk.note(line, file, text)
            return operand.keys
        key = self.values.key(operand.name, line)
        self.read.add(key)
        if key not in self.said and not operand.name.startswith("$"):
            self.said.add(key)
            absent = str(why).startswith(NO_VALUE)
            beside = " (if it is in a .dat file, give that, too)" if absent else f": {why}{cure}"
            text = f"{operand.text} is computed, or no file of this program gives it a value"
            walk.note(line, file, f"{text}; it is not compensated{beside}")
        return operand.keys

    def _names_in(self, text: str, line: int) -> set[str]:
        return {self.values.key(name.lower(), line) for name, _, _ in REFERENCE.findall(text)}

    def _sources_of(self, text: str, line: int) -> set[str]:
        """Returns the variables a text hangs on, over any number of steps."""
        if self.sources is None:
            self.sources = {}
            for at, name, _, right in self.walk.derived:
                self.sources.setdefault(name, set()).update(self._names_in(right, at))
        out = waiting = self._names_in(text, line)
        while waiting:
            waiting = {new for name in waiting for new in self.sources.get(name, ())} - out
            out = out | waiting
        return out

    def _taint_sources(self) -> None:
        """Keeps the numbers of points from which targets in other files are computed.

        Those targets keep their text while nothing in their own file changes.
        """
        files: dict[str, set[int]] = defaultdict(set)
        for target in self.written:
            for name in target.names:
                files[name].add(target.file)
        for item in self.walk.story.definitions:
            if files[item.variable] - {item.file}:
                self.walk.story.tainted.setdefault((item.variable, ""), 0)

    def _taint_derived(self, moved: set[str]) -> None:
        """Leaves points alone that are read by what is not followed, over any number of steps."""
        story, walk = self.walk.story, self.walk
        for name in self.read & moved:
            story.tainted.setdefault((name, ""), 0)
        waiting = list(walk.derived)
        while True:
            names = {name for name, _ in story.tainted} | self.read | self.values.shared
            fresh = [each for each in waiting if each[1] in names]
            if not fresh:
                break
            waiting = [each for each in waiting if each[1] not in names]
            for line, name, path, text in fresh:
                story.tainted.setdefault((name, path), line)
                walk.taint(line, text)


def _whole(value: KrlValue) -> KrlRecord:
    """Returns a value that is a whole target.

    Raises:
        NotConstantError: It is none.
    """
    if not isinstance(value, dict):
        raise NotConstantError("it is a number, no target")
    for parts in (POSE_PARTS, AXIS_PARTS):
        others = set(value) - set(parts)
        if all(part in value for part in parts):
            if others & {*POSE_PARTS, *AXIS_PARTS} or not others <= _KNOWN:
                break
            return value
    raise NotConstantError("it leaves components out", "write all of X, Y, Z, A, B, C")


_KNOWN: Final = {component.lower() for component in COMPONENTS}
