"""Builds programs from the scanned and walked KRL files: columns, reasons, what is inherited."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Final

import numba
import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.formats.krl_frames import Frames, State
from robotrue.program.formats.krl_scan import (
    INLINE_ARC,
    NOT_CONSTANT,
    Scan,
    scan,
)
from robotrue.program.formats.krl_walk import MOTION_OF, Walk
from robotrue.program.formats.krl_write import KrlSpans
from robotrue.program.program import FrameTable, Motion, Program, Reason

_SIGNS: Final = (
    (rb"(?m)^\s*/PROG\b", "a Fanuc LS program"),
    (rb"(?m)^/JOB\b", "a Yaskawa JBI job"),
    (rb"(?im)^\s*MODULE\s+\w|\bMove[LJC]\s", "an ABB RAPID module"),
    (rb"(?m)^\s*(def\s+\w+\(\):|movel\()", "a UR script"),
    (rb"(?m)^\s*GOTO\s*/", "APT or CL data"),
    (rb"(?m)^\s*(%|N?\d*\s*G0?[0-3]\b)", "ISO G-code"),
)

_CHUNK: Final = 1 << 13
"""Rows converted at a time, so that the intermediate arrays stay in the cache."""


def read_krl(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file, in the order given; ``.dat`` files are read for the others.

    Raises:
        FormatError: A file is not KRL, is cut off, or has a number that cannot be read.
    """
    names = [name for name, _ in files]
    for name, data in files:
        _check_encoding(data, name)
    scans = [scan(data, name=name) for name, data in files]
    stores = [i for i, name in enumerate(names) if name.lower().endswith(".dat")]
    mains = [i for i in range(len(files)) if i not in stores]
    if len(mains) > 1:
        raise FormatError(
            f"{len(mains)} programs ({', '.join(names[i] for i in mains)}) were given as one job.",
            hint="give each .src with its own .dat; run the others as jobs of their own.",
        )
    table = Frames(frames, names[mains[0]] if mains else names[0])
    walk = Walk(scans, names, table)
    for file in stores:
        walk.data_file(file)
    for file in mains:
        walk.main_file(file)
    builder = _Builder(walk, mains[0] if mains else -1, frames)
    return tuple(builder.program(file) for file in range(len(files)))


def _check_encoding(data: bytes, name: str) -> None:
    if len(data) >= 2**31 - 1:
        raise FormatError(
            f"{len(data)} bytes, at most 2147483646 are read.",
            source=name,
            hint="split the program, as the controller needs it anyway.",
        )
    zero = data.find(b"\0")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FormatError(
            "the file is UTF-16, KRL is one byte per character.",
            source=name,
            line=1,
            hint="save it as ANSI (Latin-1) or UTF-8.",
        )
    if zero >= 0:
        raise FormatError(
            f"NUL byte at offset {zero}: a binary file, UTF-16 text, or a damaged copy.",
            source=name,
            line=data.count(b"\n", 0, zero) + 1,
            hint="export the program again as plain text.",
        )


class _Builder:
    """Turns one walk into programs."""

    def __init__(self, walk: Walk, main: int, given: FrameTable) -> None:
        self.walk, self.main, self.given = walk, main, given
        self.scans, self.story, self.frames = walk.scans, walk.story, walk.frames
        lines = [line for line, _ in self.frames.changes]
        self._lines = np.array(lines)
        self._states = np.array([state for _, state in self.frames.changes], dtype=np.int64)
        self._flags = dict(self.story.flags)
        self._taint()

    def _taint(self) -> None:
        paths: dict[str, list[str]] = {}
        for variable, path in self.story.tainted:
            paths.setdefault(variable, []).append(path)
        for item in self.story.definitions:
            for path in paths.get(item.variable, ()):
                if _nested(path, item.path):
                    self._flags[item.file, item.agg] = Reason.EXPRESSION

    def _state(self, line: Any) -> Any:
        return self._states[np.searchsorted(self._lines, line, side="right") - 1]

    def program(self, file: int) -> Program:
        """Returns the program of one file."""
        found, name = self.scans[file], self.walk.names[file]
        motion, line = self._rows(file)
        if (
            file != self.main
            and self.main < 0
            and not self.story.has_def
            and not len(found.agg_line)
        ):
            _refuse(found, name)
        if file == self.main and not self.story.has_def and not (motion >= 0).any():
            _refuse(found, name)
        agg = np.flatnonzero(motion >= 0)
        state, conflicts = self._row_states(file, agg, line[agg])
        token = found.agg_token[agg]
        tokens = found.agg_token[agg + 1] - token
        values = np.full((len(agg), 6), np.nan)
        external = np.zeros((len(agg), 6)) if (found.tok_component >= 12).any() else None
        words = np.full((len(agg), 2), -1, np.int64)
        pose, axis = np.zeros(len(agg), np.bool_), np.zeros(len(agg), np.bool_)
        _gather(
            token,
            tokens,
            found.tok_component,
            found.tok_value,
            values,
            np.zeros((1, 6)) if external is None else external,
            words,
            pose,
            axis,
        )
        mixed = pose & axis
        reason = np.zeros(len(agg), np.int64)
        notes = list(self.story.notes) if file == max(self.main, 0) else []
        partial, donor = self._modal(file, agg, motion[agg], values, axis, state, mixed)
        reason[axis] = Reason.JOINT_TARGET
        self._frame_reasons(state, axis, reason, notes)
        reason[conflicts] = Reason.UNKNOWN_FRAME
        notes += [
            f"{name}:{found.agg_line[agg[row]] + 1}: this point is used with more than one base "
            "or tool; it is not compensated."
            for row in np.flatnonzero(conflicts)[:5].tolist()
        ]
        if external is not None:
            self._external_reasons(external, reason, notes, name)
        reason[motion[agg] == Motion.UNUSED] = Reason.UNUSED
        filled = ~np.isnan(values)
        arc_via = motion[agg] == Motion.ARC_VIA
        incomplete = mixed | ~filled.all(axis=1)
        reason[incomplete] = Reason.INCOMPLETE
        self._incomplete_notes(found, name, agg, incomplete & ~mixed, notes)
        for row, why in self._flagged(file, agg):
            reason[row] = why
        self._pair_arcs(file, agg, motion[agg], reason)
        if self.main < 0:
            notes.append(
                f"{name}: points without the .src that moves to them; they are taken as linear "
                "motions in the frames of their inline forms, or the defaults."
            )
        free = (arc_via & ~axis)[partial][:, None] & (np.arange(6) >= 3)
        values[incomplete] = np.nan
        position, rotation, axes = _si(values, axis)
        return Program(
            name=name,
            dialect="krl",
            data=found.data,
            position=position,
            rotation=rotation,
            axes=axes,
            motion=motion[agg],
            reason=reason,
            status=words[:, 0],
            turn=words[:, 1],
            line=found.agg_line[agg].astype(np.int64) + 1,
            frame=state[:, 0],
            tool=state[:, 1],
            T_base_frame=np.array(self.frames.matrices["base"]),
            T_flange_tool=np.array(self.frames.matrices["tool"]),
            notes=tuple(dict.fromkeys(notes)),
            spans=KrlSpans(
                token=token,
                tokens=tokens,
                component=found.tok_component,
                start=found.tok_start,
                length=found.tok_length,
                value=found.tok_value,
                is_axis=axis,
                partial=partial,
                donor=donor,
                owed=(donor >= 0) & ~free,
            ),
        )

    def _rows(self, file: int) -> tuple[IntArray, IntArray]:
        """Returns the motion of every aggregate (-1: no target) and the line it is moved to in."""
        found = self.scans[file]
        motion = np.full(len(found.agg_line), -1, np.int64)
        line = found.agg_line.astype(np.int64)
        if file == self.main:
            kind = found.line_kind[found.agg_line]
            for code, how in MOTION_OF.items():
                motion[kind == code] = how
            arc = np.flatnonzero(kind == INLINE_ARC)
            motion[arc[::2]] = Motion.ARC_VIA
            plain = np.flatnonzero(kind > 1)
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
        return motion, line

    def _row_states(self, file: int, agg: IntArray, line: IntArray) -> tuple[IntArray, BoolArray]:
        """Returns (base, tool, on robot) of every row and which rows are used with several."""
        conflicts = np.zeros(len(agg), np.bool_)
        if self.main < 0:
            state = np.zeros((len(agg), 3), np.int64)
            rows = {int(a): row for row, a in enumerate(agg)}
            for item in self.story.definitions:
                inline = self.frames.fdat.get("f" + item.variable[1:])
                if item.file == file and inline is not None and item.variable.startswith("x"):
                    where = int(line[rows[item.agg]])
                    state[rows[item.agg]] = self.frames.inline_state(where, inline)
            return state, conflicts
        state = np.asarray(self._state(line), dtype=np.int64).reshape(-1, 3)
        several = {
            a: uses
            for (where, a), uses in self.story.uses.items()
            if where == file and len(uses) > 1
        }
        for agg_index, uses in several.items():
            states = {State(*self._state(use).tolist()) for use, _ in uses}
            conflicts[np.searchsorted(agg, agg_index)] = len(states) > 1
        return state, conflicts

    def _frame_reasons(
        self, state: IntArray, axis: BoolArray, reason: IntArray, notes: list[str]
    ) -> None:
        cures = self.frames.cures
        lost_base = np.isin(state[:, 0], [i for side, i in cures if side == "base"]) & ~axis
        lost_tool = np.isin(state[:, 1], [i for side, i in cures if side == "tool"])
        on_robot = (state[:, 2] > 0) & ~axis
        reason[on_robot] = Reason.TOOL_ON_FLOOR
        reason[lost_base | lost_tool] = Reason.UNKNOWN_FRAME
        for side, lost, column in (("base", lost_base, 0), ("tool", lost_tool, 1)):
            notes += [cures[side, i] for i in np.unique(state[lost, column]).tolist()]
        if on_robot.any():
            notes.append(
                f"{self.frames.name}: {int(on_robot.sum())} targets carry the workpiece on the "
                "robot (#TCP); they are not compensated."
            )

    def _external_reasons(
        self, external: Array, reason: IntArray, notes: list[str], name: str
    ) -> None:
        away = (np.abs(external) > 0).any(axis=1)
        if not away.any():
            return
        still = bool((external == external[0]).all())
        if self.given.external_axes_at_rest and still:
            return
        reason[away] = Reason.EXTERNAL_AXIS
        column = int(np.flatnonzero((np.abs(external) > 0).any(axis=0))[0])
        low, high = external[:, column].min(), external[:, column].max()
        notes.append(
            f"{name}: external axis E{column + 1} is {low:g} to {high:g} (mm or deg) and may carry "
            f"the robot or the part; {int(away.sum())} targets are not compensated. If it stands "
            "still and the frames hold there, say so in the frame table."
        )

    def _incomplete_notes(
        self, found: Scan, name: str, agg: IntArray, rows: BoolArray, notes: list[str]
    ) -> None:
        at = np.flatnonzero(rows)
        if len(at):
            notes.append(
                f"{name}:{found.agg_line[agg[at[0]]] + 1}: {len(at)} targets from this line on "
                "leave components out, and what they inherit is not known; they are not "
                "compensated. Write all six components."
            )

    def _flagged(self, file: int, agg: IntArray) -> list[tuple[int, int]]:
        rows = [
            (int(np.searchsorted(agg, a)), a, why)
            for (f, a), why in self._flags.items()
            if f == file
        ]
        return [(row, why) for row, a, why in rows if row < len(agg) and agg[row] == a]

    def _pair_arcs(self, file: int, agg: IntArray, motion: IntArray, reason: IntArray) -> None:
        """Gives both points of an arc the same fate: half a corrected arc is another arc."""
        found = self.scans[file]
        if file == self.main:
            via = np.flatnonzero(
                (found.line_kind[found.agg_line[agg]] == INLINE_ARC) & (motion == Motion.ARC_VIA)
            )
            worse = np.where(reason[via] > 0, reason[via], reason[via + 1])
            reason[via] = worse
            reason[via + 1] = np.where(reason[via + 1] > 0, reason[via + 1], worse)
        for pair in self.story.arcs:
            rows = [int(np.searchsorted(agg, a)) for f, a in pair if f == file]
            if len(rows) == 2:
                worst = next((int(reason[r]) for r in rows if reason[r] > 0), 0)
                for row in rows:
                    reason[row] = reason[row] or worst

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
        written = ~np.isnan(values)
        lacking: BoolArray = np.asarray(~written.all(axis=1))
        none = np.zeros(0, np.int64), np.zeros((0, 6), np.int64)
        if file != self.main or not lacking.any():
            return none
        found = self.scans[file]
        row_of = np.full(len(found.agg_line) + 1, -1, np.int64)
        row_of[agg] = np.arange(len(agg))
        inline = agg[found.line_kind[found.agg_line[agg]] > 1]
        entries = [
            (int(found.agg_line[a]), int(a), int(motion[row_of[a]] == Motion.ARC_VIA))
            for a in inline
        ]
        entries += [(line, a, int(via)) for line, a, via in self.story.sequence]
        order = np.array(sorted(entries, key=lambda e: (e[0], e[1])), dtype=np.int64)
        rows: IntArray = np.where(order[:, 1] >= 0, row_of[order[:, 1]], -1)
        torn: BoolArray = np.asarray(rows < 0)
        torn |= (rows >= 0) & np.isin(
            order[:, 1], [a for (f, a), _ in self._flags.items() if f == file]
        )
        torn |= (rows >= 0) & mixed[rows]
        kind: IntArray = np.where(rows >= 0, axis[rows].astype(np.int64), -1)
        used = np.bincount(rows[rows >= 0], minlength=len(agg))
        inherits: dict[int, IntArray] = {}
        last = np.full(6, -1, np.int64)
        previous = -1
        for place, row in enumerate([int(each) for each in rows]):
            if torn[place] or (previous >= 0 and kind[place] != previous):
                last[:] = -1
            previous = int(kind[place])
            if row < 0 or torn[place]:
                continue
            if lacking[row] and used[row] == 1:
                donors = np.where(written[row], -1, last)
                same = (donors >= 0) & (state[donors] == state[row]).all(axis=1)
                donors = np.where(same, donors, -1)
                inherits[row] = donors
                values[row] = np.where(donors >= 0, values[donors, np.arange(6)], values[row])
            if not order[place, 2]:
                kept = inherits.get(row, np.full(6, -1))
                last = np.where(written[row] | (kept >= 0), row, -1)
        if not inherits:
            return none
        return np.array(list(inherits), dtype=np.int64), np.array(list(inherits.values()))


def _nested(one: str, other: str) -> bool:
    return (
        not one
        or not other
        or (other + ".").startswith(one + ".")
        or (one + ".").startswith(other + ".")
    )


def _refuse(found: Scan, name: str) -> None:
    text = found.data
    guess = next((what for sign, what in _SIGNS if re.search(sign, text)), None)
    why = f"it looks like {guess}" if guess else "no DEF, DEFDAT, point or motion was found"
    line = next((i for i, kind in enumerate(found.line_kind.tolist()) if kind), 0)
    shown = found.code(line).strip()[:60] if len(found.line_kind) else ""
    raise FormatError(
        f"not a KRL program: {why}. The first statement is {shown!r}.",
        source=name,
        line=line + 1,
        hint="give the .src (and .dat) that the controller runs.",
    )


def _si(values: Array, axis: BoolArray) -> tuple[Array, Array, Array]:
    """Returns position, rotation and axes in m and rad, read-only, from (n, 6) in mm and deg."""
    n = len(values)
    position, rotation = np.empty((n, 3)), np.empty((n, 3, 3))
    for first in range(0, n, _CHUNK):
        part = slice(first, first + _CHUNK)
        position[part] = values[part, :3] * MM
        rotation[part] = matrix_from_abc(values[part, 3:] * DEG)
    axes: Array = np.broadcast_to(np.nan, (n, 6))
    if axis.any():
        position[axis], rotation[axis] = np.nan, np.nan
        axes = np.where(axis[:, None], values * DEG, np.nan)
    for array in (position, rotation, axes):
        array.flags.writeable = False
    return position, rotation, axes


@numba.njit(cache=True)
def _gather(
    token: Any,
    tokens: Any,
    component: Any,
    value: Any,
    values: Any,
    external: Any,
    words: Any,
    pose: Any,
    axis: Any,
) -> None:
    """Fills the dense columns of every row from its tokens."""
    for row in range(token.size):
        for t in range(token[row], token[row] + tokens[row]):
            code = component[t]
            if code < 12:
                values[row, code % 6] = value[t]
                if code < 6:
                    pose[row] = True
                else:
                    axis[row] = True
            elif code < 18:
                external[row, code - 12] = value[t]
            else:
                words[row, code - 18] = int(value[t])
