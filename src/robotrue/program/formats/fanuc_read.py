"""Builds a program from a scanned Fanuc LS file: columns, reasons, notes."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD, WORDS
from robotrue.core.arrays import BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.units import DEG, MM
from robotrue.program.external_axes import COUNT, Carried, mark_described
from robotrue.program.formats.fanuc_moves import FanucMoves, moves
from robotrue.program.formats.fanuc_register_files import follow_registers
from robotrue.program.formats.fanuc_registers import Effects
from robotrue.program.formats.fanuc_scan import CURRENT, FanucScan, scan
from robotrue.program.formats.fanuc_write import FanucSpans, read_config
from robotrue.program.formats.numbered_frames import NumberedFrames
from robotrue.program.formats.shared_fate import flag_lost_frames, share_fate
from robotrue.program.formats.target_tokens import TargetTokens, values_of
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.program import FrameTable, Motion, Program, Reason, find_open, leave_far

_HOLDER: Final = {"base": "UFRAME", "tool": "UTOOL"}
_USUAL: Final = 32
"""Bytes of CONFIG, at most; longer texts are not compared with the one before."""


def read_fanuc(data: bytes, name: str, frames: FrameTable, effects: Effects) -> Program:
    """Returns the program of an LS file.

    Args:
        data: Its bytes.
        name: Of the file.
        frames: What it names but does not hold.
        effects: What programs that are called set.

    Raises:
        FormatError: Not an LS program, cut off, or a record that cannot be read.
    """
    found = scan(data, name=name)
    known, said = follow_registers(found, frames, effects)
    walk = moves(found, name, frames.harmless_routines, known)
    if walk.written or walk.offsets or not known:
        walk.notes += [f"{name}: {each}" for each in said]
    return _Builder(found, walk, name, frames).program()


class _Builder:
    """Columns of one program: its records in file order, then targets with separate rows."""

    def __init__(self, found: FanucScan, walk: FanucMoves, name: str, given: FrameTable) -> None:
        self.scan, self.walk, self.name, self.given = found, walk, name, given
        self.notes: list[str] = []
        self.frames = NumberedFrames(given, name, holder=_HOLDER, zero_is_root=True)
        for (side, number), line in walk.changed.items():
            self.frames.change(side, number, line, "the program")
        own = np.searchsorted(line_starts(found.data), found.place, side="right")
        count, written = len(own), walk.written
        self.line = np.concatenate([own, np.array([t.line for t in written], np.int64)])
        self.source = np.concatenate(
            [np.arange(count), np.array([target.row for target in written], np.int64)]
        )
        self.is_axis = np.where(self.source >= 0, _take(found.is_axis, self.source), 0)
        rows = {row: count + k for k, row in enumerate(self.source[count:].tolist())}
        copies = [(rows[row], found.external[row]) for row in rows if row in found.external]
        self.external = {**found.external, **dict(copies)}

    def program(self) -> Program:
        """Returns the program."""
        found, n = self.scan, len(self.source)
        tokens = self._tokens()
        position, rotation, axes = values_of(tokens)
        base, tool = self._frame_columns("base"), self._frame_columns("tool")
        reason = self._frame_reasons(base, tool)
        self._shift_frames(base, tool)
        motion = np.full(n, int(Motion.UNUSED), np.int64)
        motion[list(self.walk.motion)] = list(self.walk.motion.values())
        moved = self._external(reason, base)
        reason[motion == Motion.UNUSED] = Reason.UNUSED
        untaught = np.asarray(np.isnan(tokens.value).any(axis=1))
        if untaught.any():
            reason[untaught] = Reason.INCOMPLETE
            self._tell(untaught, "positions were never taught (********)", "teach them")
        reason[list(self.walk.flags)] = list(self.walk.flags.values())
        share_fate(reason, self.walk.arcs)
        self._axis_note(reason)
        program = Program(
            name=self.name,
            dialect="fanuc_ls",
            data=found.data,
            position=position,
            rotation=rotation,
            axes=axes,
            motion=motion,
            reason=reason,
            words=self._words(),
            words_of="fanuc",
            line=self.line,
            frame=moved.frame,
            tool=tool,
            T_base_frame=moved.T_base_frame,
            external=moved.external,
            T_flange_tool=self.frames.stack_matrices("tool"),
            notes=tuple(dict.fromkeys(self.notes + self.walk.notes)),
            path=np.array(self.walk.path, np.int64).reshape(-1, 3),
            spans=FanucSpans(
                tokens=tokens,
                scan=found,
                written=tuple(self.walk.written),
            ),
        )
        return self._put_open_first(leave_far(program))

    def _put_open_first(self, program: Program) -> Program:
        """Returns the program with those rows first, after the records, that get a record.

        So they are in the order in which they are read again once they have one.
        """
        count, spans = len(self.scan.number), program.spans
        closed = ~find_open(program.reason)
        own = self.source[count:]
        rank = np.where(closed[count:], np.where((own >= 0) & (_take(closed, own) == 0), 1, 2), 0)
        order = np.concatenate([np.arange(count), count + np.argsort(rank, kind="stable")])
        if np.array_equal(order, np.arange(len(order))):
            return program
        tokens = spans.tokens
        path = np.array(program.path)
        path[:, 1] = np.where(
            path[:, 1] < 0, path[:, 1], np.argsort(order)[np.maximum(path[:, 1], 0)]
        )
        return replace(
            program.take(order),
            path=path,
            spans=replace(
                spans,
                tokens=replace(tokens, value=tokens.value[order], kind=tokens.kind[order]),
                written=tuple(spans.written[row - count] for row in order[count:].tolist()),
            ),
        )

    def _tokens(self) -> TargetTokens:
        """Returns the places of the numbers; rows without a record have none."""
        numbers, written = self.scan.numbers, self.walk.written
        nowhere = np.zeros((len(written), 6), np.int64)
        own = [
            numbers.value[target.row] if target.pose is None else np.array(target.pose.values)
            for target in written
        ]
        return TargetTokens(
            start=np.concatenate([numbers.start, nowhere]),
            length=np.concatenate([np.where(np.isnan(numbers.value), 0, numbers.length), nowhere]),
            value=np.concatenate([numbers.value, np.array(own).reshape(-1, 6)]),
            kind=self.is_axis,
            unit=np.full((2, 6), DEG),
            whole=np.zeros(2, np.bool_),
        )

    def _frame_columns(self, side: str) -> IntArray:
        """Returns the frame or tool index of every row, before offsets."""
        written = self.scan.frame if side == "base" else self.scan.tool
        own = [target.in_force[side == "tool"] for target in self.walk.written]
        numbers = np.concatenate([written, np.array(own, np.int64)])
        copies = np.flatnonzero((np.arange(len(numbers)) >= len(written)) & (self.source >= 0))
        numbers[copies] = written[self.source[copies]]
        return self._numbers(side, numbers)

    def _shift_frames(self, base: IntArray, tool: IntArray) -> None:
        """Adds the offsets of moves to frames and tools, in place."""
        count = len(self.scan.number)
        offsets = {count + k: target.offset for k, target in enumerate(self.walk.written)}
        for row, offset in sorted({**self.walk.offsets, **offsets}.items()):
            for side, column, shift in (
                ("base", base, offset.in_frame),
                ("tool", tool, offset.in_tool),
            ):
                if any(shift):
                    step = pose(np.eye(3), np.array(shift) * MM)
                    column[row] = self.frames.shift(side, int(column[row]), step)

    def _numbers(self, side: str, written: IntArray) -> IntArray:
        """Returns the frame or tool index of every row from its UF or UT."""
        if not len(written):
            return np.empty(0, np.int64)
        numbers, first, inverse = np.unique(written, return_index=True, return_inverse=True)
        found = [
            self._number(side, "F" if number == CURRENT else str(number), int(self.line[row]))
            for number, row in zip(numbers.tolist(), first.tolist(), strict=True)
        ]
        return np.array(found, np.int64)[inverse]

    def _number(self, side: str, number: str, line: int) -> int:
        computed = self.given.changed_frames.get((side, "?"))
        if computed:
            what = f"{computed} by a computed number"
            return self.frames.unknown(side, what, line, "write the number out")
        if number.isdigit():
            return self.frames.number(side, number, line)
        current, calls = self.walk.current[side], list(dict.fromkeys(self.walk.calls))
        if calls:
            what = f"is the one in force, which {', '.join(calls[:5])} may change"
            cure = (
                "give the called programs, too, write the number at the positions, or state in "
                "the cell that they set none: [controller] harmless_routines = "
                f"{json.dumps(calls[:5])}"
            )
            return self.frames.unknown(side, what, line, cure)
        if len(current) == 1 and current != {"?"}:
            return self.frames.number(side, next(iter(current)), line)
        name = _HOLDER[side]
        what = f"is the one in force ({name[:2]} : {number}), which the program does not fix"
        return self.frames.unknown(
            side,
            what,
            line,
            f"set {name}_NUM once, before every move and branch, or write its number",
        )

    def _frame_reasons(self, base: IntArray, tool: IntArray) -> IntArray:
        is_axis = self.is_axis == 1
        reason = np.where(is_axis, int(Reason.JOINT_TARGET), int(Reason.NONE))
        sides = {"base": base, "tool": tool}
        self.notes += flag_lost_frames(reason, sides, is_axis, self.frames.lost)
        return reason

    def _external(self, reason: IntArray, base: IntArray) -> Carried:
        """Returns the work frames as external axes move them; flags positions where none is known.

        External axes count as in the record: E1.. of group 1, then other groups.
        """
        values = np.full((len(base), COUNT), np.nan)
        for row, axes in self.external.items():
            values[row, : len(axes)] = [value for _, _, value in axes[:COUNT]]
        moved = self.frames.carry_frames(base, values)
        lost = moved.unknown & (self.is_axis == 0)
        lost &= np.isin(np.arange(len(base)), list(self.walk.motion))
        if lost.any():
            reason[lost] = Reason.EXTERNAL_AXIS
            what = "positions without the value of an axis that carries the robot or their frame"
            self._tell(lost, what, "write it with each")
        self._flag_undescribed(reason)
        return moved

    def _flag_undescribed(self, reason: IntArray) -> None:
        """Flags the positions with an external axis away from zero that is not described."""
        told = mark_described(self.given.external)
        values = {
            row: [each for k, each in enumerate(axes) if k >= COUNT or not told[k]]
            for row, axes in self.external.items()
        }
        away = [row for row, axes in values.items() if any(value != 0.0 for _, _, value in axes)]
        still = len({tuple(axes) for axes in values.values()}) == 1
        known = all(value == value for axes in values.values() for _, _, value in axes)
        if not away or (self.given.external_axes_at_rest and still and known):
            return
        reason[away] = Reason.EXTERNAL_AXIS
        rows = np.zeros(len(reason), np.bool_)
        rows[away] = True
        cure = (
            "describe it in the cell ([[controller.external]]); if it is at rest and the frames "
            "are valid there, state external_axes_at_rest"
        )
        self._tell(rows, "positions with an external axis or another group away from zero", cure)

    def _tell(self, rows: BoolArray, what: str, cure: str) -> None:
        line = self.line[np.flatnonzero(rows)[0]]
        self.notes.append(
            f"{self.name}:{line}: {int(rows.sum())} {what} (the first is in this line); they are "
            f"not compensated: {cure}."
        )

    def _axis_note(self, reason: IntArray) -> None:
        if (reason == Reason.JOINT_TARGET).any():
            self.notes.append(
                f"{self.name}: positions with J1 to J6 are read in the convention of the "
                "controller, J3 from the horizontal; the arm must be described with that coupling "
                "of J2 and J3."
            )

    def _words(self) -> IntArray:
        """Returns CONFIG as numbers (n, 6)."""
        texts, of_row = self._configurations()
        read = {text: read_config(text) for text in set(texts)}
        none = [NO_WORD] * WORDS["fanuc"]
        known = [none if match is None else match[0] for match in map(read.get, texts)]
        odd = np.array([read[text] is None and bool(text.strip()) for text in texts], np.bool_)
        if odd.any():
            line = self.line[np.flatnonzero(odd[of_row])[0]]
            self.notes.append(
                f"{self.name}:{line}: CONFIG is not of the form 'N U T, 0, 0, 0'; it is not "
                "changed and does not determine the arm configuration."
            )
        return np.array(known, np.int64).reshape(-1, len(none))[of_row]

    def _configurations(self) -> tuple[list[bytes], IntArray]:
        """Returns texts of CONFIG, empty where there is none, and which of them each row has."""
        data, (first, size) = self.scan.data, self.scan.config.T
        text, begins = np.frombuffer(data, np.uint8), np.ones(len(first), np.bool_)
        begins[1:] = (size[1:] != size[:-1]) | (size[1:] > _USUAL)
        for k in range(min(int(size.max(initial=0)), _USUAL)):
            letter = text.take(first + k, mode="clip")
            begins[1:] |= (letter[1:] != letter[:-1]) & (k < size[1:])
        own = [data[at : at + n] for at, n in self.scan.config[begins].tolist()]
        of_row = np.cumsum(begins) - 1
        written = [
            own[of_row[target.row]] if target.pose is None else target.pose.config
            for target in self.walk.written
        ]
        return own + written, np.append(of_row, len(own) + np.arange(len(written)))


def _take(column: IntArray | BoolArray, rows: IntArray) -> IntArray:
    """Returns entries of a column (n,), anything for rows of -1."""
    if not len(column):
        return np.zeros(len(rows), np.int64)
    return np.asarray(column[np.maximum(rows, 0)])
