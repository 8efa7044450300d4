"""Use of positions by the statements of a Fanuc LS program.

A statement is ``n: ... ;`` and may go over lines. J, L, C (via and end in one statement), A (one
point of an arc per statement) and S (spline) move to ``P[n]``. Words after the target modify it: an
offset or an increment makes it another pose than the one in the record.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.alike import Alike, note_moves
from robotrue.program.formats.fanuc_offsets import (
    NO_OFFSET,
    MoveTarget,
    TargetOffset,
    cut_timed,
    doubtful_words,
    in_another_language,
    join_targets,
    odd_word,
    read_offset,
    target_of,
    words_behind,
)
from robotrue.program.formats.fanuc_scan import STATEMENT, FanucScan, find_program
from robotrue.program.formats.fanuc_values import State
from robotrue.program.formats.numbered_frames import list_changed_frames
from robotrue.program.formats.text_lines import line_at, line_starts
from robotrue.program.program import Motion, Reason

PLAIN_MOVE: Final = re.compile(
    rb"\s*+(?:(\d{0,6}+)\s*+:)?+()[ \t]*+([JLS])[ \t]++P\[(\d{1,6})(?::[^\];]*+)?\]([^;]*+);"
    rb"[ \t]*+(?:\r\n|\n|\r)?"
)
"""A statement that moves to a record; the second group is where its text begins."""
_MOVE: Final = re.compile(rb"\s*([JLCAS])\s+(P|PR)\s*\[(.*)", re.DOTALL)
_TARGET: Final = re.compile(rb"\b(P|PR)\s*+\[\s*+([^\]:]*+)(?::[^\]]*+)?\]")
_POINT: Final = re.compile(rb"(?<![\w$])P\s*+\[\s*+([^\]:]*+)(?::[^\]]*+)?\]")
_FRAME_NUMBER: Final = re.compile(rb"\b(UFRAME|UTOOL|BENUTZER|WKZ)_NUM\s*=\s*([^;,)]*)")
_FRAME_DATA: Final = re.compile(rb"\b(UFRAME|UTOOL|BENUTZER|WKZ)\s*+\[")
MOTION: Final = {b"J": Motion.PTP, b"L": Motion.LIN, b"S": Motion.SPLINE}
_CALL: Final = re.compile(rb"\b(?:CALL|RUN)\s+([\w.]+)")
_SIDE: Final = {b"UFRAME": "base", b"BENUTZER": "base", b"UTOOL": "tool", b"WKZ": "tool"}
_REMARKS: Final = (b"!", b"//", b"--")
_SHIFT: Final = re.compile(rb"(?:TOUCH|MP)[ \t]+OFFSET\b[ \t]*(END\b)?")
_LEAP: Final = re.compile(rb"\bJMP\b|[:;]\s*(?:FOR|IF|ELSE|SELECT)\b")
_TRACKING: Final = re.compile(rb"\bLINE_TRACK_SCHEDULE_NUMBER\s*:\s*0*([1-9]\d*)")
_SETS: Final = re.compile(rb"[ \t]*=")
_TAILS: Final = 4096
"""Tails of moves remembered."""


@dataclass(slots=True)
class FanucMoves:
    """Motion, flags and paths of every position that a statement names.

    Attributes:
        motion: How each row is moved to, by row.
        flags: Reasons found in statements, by row.
        arcs: Rows that make one arc, or one run of arcs.
        offsets: Offset of the targets of records whose moves all have it, by row.
        written: Targets with separate rows, after those of the records.
        current: Values of ``UFRAME_NUM`` and ``UTOOL_NUM``: distinct texts by side, ``?`` for one
            that is computed, or first set behind a move or a branch.
        changed: Line of the frames that the program computes, by side and number, ``?`` for any.
        calls: Programs called that may set the number of frame and tool.
        path: As ``Program.path``: byte, row or minus the line, motion.
        notes: Sentences.
    """

    motion: dict[int, Motion] = field(default_factory=dict)
    flags: dict[int, Reason] = field(default_factory=dict)
    arcs: list[list[int]] = field(default_factory=list)
    offsets: dict[int, TargetOffset] = field(default_factory=dict)
    written: list[MoveTarget] = field(default_factory=list)
    current: dict[str, set[str]] = field(default_factory=lambda: {"base": set(), "tool": set()})
    changed: dict[tuple[str, str], int] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    path: array[int] = field(default_factory=lambda: array("q"))
    notes: list[str] = field(default_factory=list)


def quiet_programs(files: Sequence[tuple[str, bytes]]) -> tuple[str, ...]:
    """Returns the names, in lower case, of programs that set no frame number and call none.

    Empty where no file calls a program.
    """
    if not any(b"CALL" in data or b"RUN" in data for _, data in files):
        return ()
    named = [(find_program(data), data) for _, data in files]
    return tuple(
        found[0]
        for found, data in named
        if found and not (_FRAME_NUMBER.search(data, *found[1:]) or _CALL.search(data, *found[1:]))
    )


def fanuc_frame_changes(files: Sequence[tuple[str, bytes]]) -> Mapping[tuple[str, str], str]:
    """Returns what changes numbered frames of the controller in the programs of a job."""

    def read(line: bytes) -> list[tuple[str, str]]:
        text = line.lstrip(b" \t0123456789").removeprefix(b":").lstrip()
        return [] if text.startswith(_REMARKS) else _list_set_frames(text)

    return list_changed_frames(files, tuple(_SIDE), read)


def _list_set_frames(text: bytes) -> list[tuple[str, str]]:
    """Returns side and number, ``?`` if computed, of the frames that a statement sets."""
    out = []
    for part in text.split(b"=")[:-1]:
        given = part.rstrip()
        holder = _FRAME_DATA.search(given) if given.endswith(b"]") else None
        if holder:
            number = given[holder.end() : -1].partition(b":")[0]
            out.append((_SIDE[holder[1]], _digits(number)))
    return out


def moves(
    scan: FanucScan,
    name: str,
    harmless: Container[str] = (),
    registers: Mapping[int, State] | None = None,
) -> FanucMoves:
    """Returns what the statements do.

    Args:
        scan: The program.
        name: Of its file.
        harmless: Programs that set no frame or tool number, in lower case.
        registers: What is known of registers at moves, by the first byte of their statement.

    Raises:
        FormatError: A statement without its ``;``.
    """
    walk = _Walk(scan, name, harmless, registers or {})
    at, end = scan.statements
    at = walk.plain_moves(at, end)
    while match := STATEMENT.match(scan.data, at, end):
        walk.statement(match.start(2), match[2])
        at = walk.plain_moves(match.end(), end)
    rest = scan.data[at:end]
    if rest.strip():
        at += len(rest) - len(rest.lstrip())
        raise FormatError(
            f"the statement {rest.strip()[:40].decode('latin-1')!r} has no ';'.",
            source=name,
            line=line_at(scan.data, at),
            hint="the file is cut off or was edited: export the program again.",
        )
    walk.finish()
    return walk.out


class _Walk:
    def __init__(
        self,
        scan: FanucScan,
        name: str,
        harmless: Container[str],
        registers: Mapping[int, State],
    ) -> None:
        self._harmless, self._registers = harmless, registers
        self._uses: dict[int, MoveTarget] = {}
        self._read: set[int] = set()
        self._set: set[int] = set()
        self.name, self.data = name, scan.data
        self.out = FanucMoves()
        self._starts = line_starts(self.data)
        self._row = {number: row for row, number in enumerate(scan.number.tolist())}
        self._scan, self._others = scan, scan.others
        self._alike = Alike(self.data, wholes=(1, 4), zones=(), places=(2,))
        self._run: list[int] = []
        self._groups: list[list[int]] = []
        self._told: set[str] = set()
        self._tails: dict[bytes, tuple[tuple[Reason, str], ...]] = {}
        self._foreign = in_another_language(scan.data, scan.statements)
        first, last = scan.statements
        self._leaps = _LEAP.search(scan.data, first, last) is not None
        self._shifted = self._shifts_all = self._branched = False
        tracking = _TRACKING.search(scan.data, 0, first)
        if tracking:
            self._tell("tracking", tracking.start(), "line tracking schedule "
                       f"{tracking[1].decode()}: the positions count from a frame that moves with "
                       "the conveyor; they are not compensated")  # fmt: skip
            self.out.flags |= dict.fromkeys(self._row.values(), Reason.UNKNOWN_FRAME)
            self._set.update(self._row.values())

    def plain_moves(self, at: int, end: int) -> int:
        """Reads moves to records without words that modify them; returns the byte after them."""
        if self._run or self._shifted:
            return at
        while plain := PLAIN_MOVE.match(self.data, at, end):
            letter, number, tail = plain.group(3, 4, 5)
            row, options = self._row.get(int(number)), self._tails.get(tail)
            if row is None or (self._options(tail) if options is None else options):
                break
            self._use(plain.start(2), row, MOTION[letter])
            at = plain.end()
            for found in self._alike.after(plain, end):
                rows = [self._row.get(number, -1) for number in found[:, 4].tolist()]
                known = rows.index(-1) if -1 in rows else len(rows)
                note_moves(
                    self.out.path, self.out.motion, found[:known, 6], rows[:known], MOTION[letter]
                )
                at = int(found[known - 1, 1]) if known else at
                if known < len(rows):
                    break
        return at

    def statement(self, place: int, text: bytes) -> None:
        """Reads one; comments and remarked statements are skipped."""
        place += len(text) - len(text.lstrip())
        text = text.lstrip()
        if not text or text.startswith(_REMARKS):
            return
        self._branched |= text.startswith((b"IF", b"FOR", b"SELECT", b"JMP"))
        move = _MOVE.match(text)
        shift = _SHIFT.match(text.upper())
        if move:
            self._move(place, move[1], text)
        elif shift:
            self._shift(place, bool(shift[1]))
        elif b"P" in text or b"U" in text or b"CALL" in text:
            self._other(place, text)

    def finish(self) -> None:
        """Ends open runs, and gives targets of several kinds separate rows."""
        self._close_run()
        path = np.array(self.out.path, np.int64).reshape(-1, 3)
        if self._uses or self._read:
            self._give_rows(path)
            self.out.path = array("q", path.ravel().tolist())
            self.out.motion.clear()
            for _, row, how in path.tolist():
                if row >= 0 and (row not in self.out.motion or how == Motion.PTP):
                    self.out.motion[row] = Motion(how)
        for group in self._groups:
            rows = [int(path[use, 1]) if use >= 0 else -1 for use in group]
            known = [row for row in rows if row >= 0]
            if len(known) < len(rows):
                for row in known:
                    self._flag(row, Reason.EXPRESSION)
            if known:
                self.out.arcs.append(known)
                if self.out.motion[known[-1]] == Motion.ARC_VIA:
                    self.out.motion[known[-1]] = Motion.ARC_END

    def _give_rows(self, path: IntArray) -> None:
        """Writes the rows of targets that differ from a record into the path."""
        count = len(self._scan.number)
        rows = {use.row for use in self._uses.values()} | self._read
        moved = {row: np.flatnonzero(path[:, 1] == row).tolist() for row in rows if row >= 0}
        registers = [use for use, target in self._uses.items() if target.row < 0]
        apart = [] if self._shifts_all else registers
        for row, uses in moved.items():
            apart += self._uses_apart(row, uses, path)
        targets = {use: self._use_of(use, path) for use in sorted(apart)}
        joined = join_targets(targets.values())
        number = {target.alike: count + k for k, target in enumerate(joined)}
        for use, target in targets.items():
            path[use, 1] = number[target.alike]
        self.out.written = joined

    def _uses_apart(self, row: int, uses: list[int], path: IntArray) -> list[int]:
        """Returns the moves to a record whose target needs a separate row.

        The record serves the moves of one kind, if no other statement and no move that is not
        understood uses it; then all the others get separate positions.
        """
        if row in self._set:
            return []
        targets = {use: self._use_of(use, path) for use in uses}
        good = {use: target.offset for use, target in targets.items() if target.known}
        kinds = list(dict.fromkeys(good.values()))
        if row in self._read or row in self.out.flags:
            return list(good)
        first = NO_OFFSET if NO_OFFSET in kinds else kinds[0]
        if first != NO_OFFSET:
            self.out.offsets[row] = first
        return [use for use, offset in good.items() if offset != first]

    def _use_of(self, use: int, path: IntArray) -> MoveTarget:
        """Returns the target of a move; that of a plain one is found again."""
        target = self._uses.get(use)
        if target is None:
            place, row, _ = path[use].tolist()
            match = PLAIN_MOVE.match(self.data, place)
            found = match if match is not None else _TARGET.search(self.data, place)
            span = (0, 0) if found is None else found.span()
            if match is not None:
                span = match.start(4) - 2, match.start(5)
            target = MoveTarget(row, self._line(place), (span,))
        return target

    def _close_run(self) -> None:
        """Ends a run of A moves: its points share their fate."""
        if len(self._run) > 1:
            self._groups.append(self._run)
        self._run = []

    def _move(self, place: int, letter: bytes, text: bytes) -> None:
        count = 2 if letter == b"C" else 1
        found = list(_TARGET.finditer(text, 0, text.rfind(b"]") + 1))[:count]
        tail = text[found[-1].end() :] if found else b""
        state = self._registers.get(place, {})
        targets = [self._target(place, each, tail, state, arc=letter == b"C") for each in found]
        if letter != b"A":
            self._close_run()
        if not any(targets):
            line, how = self._line(place), MOTION.get(letter, Motion.ARC_END)
            self.out.path.extend((place, -line, int(how)))
        ways = {b"C": (Motion.ARC_VIA, Motion.ARC_END), b"A": (self._next_of_run(),)}
        uses = [
            -1 if target is None else self._use_target(place, target, how)
            for target, how in zip(
                targets, ways.get(letter, (MOTION.get(letter, Motion.LIN),)), strict=False
            )
        ]
        if letter == b"C":
            self._groups.append(uses if len(uses) == count else [*uses, -1])
        elif letter == b"A" and (uses[:1] != [-1] or self._run):
            self._run += uses

    def _next_of_run(self) -> Motion:
        """The first point of a run is reached on a straight line and begins the arc."""
        if not self._run:
            return Motion.LIN
        return Motion.ARC_VIA if len(self._run) % 2 else Motion.ARC_END

    def _use_target(self, place: int, target: MoveTarget, how: Motion) -> int:
        """Notes a move to a target and returns its number in the path."""
        use = len(self.out.path) // 3
        if target.row >= 0:
            self._use(place, target.row, how)
        else:
            self.out.path.extend((place, -target.line, int(how)))
        self._uses[use] = target
        return use

    def _shift(self, place: int, ends: bool) -> None:
        """Begins or ends what moves every target by a register; in a program that jumps, all."""
        if not ends:
            self._tell("shift", place, "Touch Offset and MP OFFSET move the targets after them by "
                       "a register; they are not compensated")  # fmt: skip
            if self._leaps:
                self._leaps, self._shifts_all = False, True  # once is enough
                self._set.update(self._row.values())
                for row in self._row.values():
                    self._flag(row, Reason.EXPRESSION)
        self._shifted = not ends

    def _target(
        self, place: int, match: re.Match[bytes], tail: bytes, state: State, *, arc: bool
    ) -> MoveTarget | None:
        """Returns a target of a move; None where it is no record and no known register."""
        text, line = match[2].strip(), self._line(place)
        span = place + match.start(), place + match.end()
        step = dict(self._options(tail)).get(Reason.RELATIVE)
        if match[1] == b"PR" and step:  # which step it is changes nothing
            self._tell(step, place, f"{step}; such targets are not compensated")
            return None
        if not text.isdigit() or len(text) > 6:
            if match[1] == b"P":
                self._note_computed(place)
            else:
                self._tell("PR", place, "a position register (PR) is chosen by a computed number; "
                           "such targets are not compensated")  # fmt: skip
            return None
        if match[1] == b"PR":
            target, why = target_of(int(text), state, line, span)
            if target is None:
                self._tell(f"PR{int(text)}", place, f"a target in a position register: {why}; such "
                           "targets are not compensated")  # fmt: skip
                return None
            target = self._shift_target(
                place, target, tail, state, frame=target.in_force[0], arc=arc
            )
            return target if target.known else None
        row = self._row.get(int(text))
        if row is None:
            if int(text) not in self._others:
                self._tell("absent", place, f"/POS does not hold P[{int(text)}]; moves to such "
                           "points are not compensated")  # fmt: skip
            return None
        target = MoveTarget(row, line, (span,))
        frame = int(self._scan.frame[row])
        return self._shift_target(place, target, tail, state, frame=frame, arc=arc)

    def _shift_target(
        self, place: int, target: MoveTarget, tail: bytes, state: State, *, frame: int, arc: bool
    ) -> MoveTarget:
        """Returns a target as the words after it shift it; flags its record if they are odd."""
        odd = self._options(tail)
        if odd and not self._foreign:
            offset, rest, why = read_offset(cut_timed(tail), state, frame)
            others = self._options(rest)
            joint = target.row >= 0 and bool(self._scan.is_axis[target.row])
            shifts = offset is not None and offset != NO_OFFSET
            if shifts and (joint or arc):
                why = f"an {'arc' if arc else 'axis target'} with an offset is not followed"
            elif offset is not None and not others:
                odd, target = (), target._replace(offset=offset)
            elif why and not others:
                odd = ((Reason.EXPRESSION, f"{odd[0][1]}: {why}"),)
        for reason, what in odd:
            self._tell(what, place, f"{what}; such targets are not compensated")
            if target.row >= 0:
                self._flag(target.row, reason)
        if self._shifted and target.row >= 0:
            self._flag(target.row, Reason.EXPRESSION)
        return target._replace(known=not odd and not self._shifted)

    def _other(self, place: int, text: bytes) -> None:
        """Reads a statement that is no move: frames it sets, positions it reads."""
        for kind, number in _FRAME_NUMBER.findall(text):
            current = self.out.current[_SIDE[kind]]
            late = bool(self.out.path) or self._branched
            current.add("?" if late and _digits(number) not in current else _digits(number))
        for called in _CALL.findall(text):
            if called.decode("latin-1").lower() not in self._harmless:
                self.out.calls.append(called.decode("latin-1"))
        for key in _list_set_frames(text):
            self.out.changed.setdefault(key, self._line(place))
        for match in _POINT.finditer(text, 0, text.rfind(b"]") + 1):
            found, plain = match[1], _digits(match[1])
            sets = _SETS.match(text, match.end()) is not None
            row = self._row.get(int(plain)) if plain.isdigit() and len(plain) <= 6 else None
            if row is not None:
                (self._set if sets else self._read).add(row)
                self._flag(row, Reason.EXPRESSION)
                self._tell("read", place, f"P[{int(plain)}] is used by a statement that is no "
                           "move; such positions are not compensated, moves to those that are only "
                           "read get separate positions")  # fmt: skip
            elif not found.strip().isdigit():
                self._note_computed(place)

    def _note_computed(self, place: int) -> None:
        if "index" in self._told:
            return
        self._tell("index", place, "a position is chosen by a computed number; no position of this "
                   "program is compensated")  # fmt: skip
        self._set.update(self._row.values())
        for row in self._row.values():
            self._flag(row, Reason.EXPRESSION)

    def _options(self, tail: bytes) -> tuple[tuple[Reason, str], ...]:
        known = self._tails.get(tail)
        if known is None:
            known = doubtful_words(tail)
            odd = odd_word(words_behind(tail)) if self._foreign and not known else ""
            if odd:
                what = f"{odd!r}, in a program of another language than English, may move the"
                known = ((Reason.EXPRESSION, f"{what} target"),)
            if len(self._tails) < _TAILS:
                self._tails[tail] = known
        return known

    def _use(self, place: int, row: int, how: Motion) -> None:
        self.out.path.extend((place, row, how))
        before = self.out.motion.get(row)
        if before is None or how == Motion.PTP:
            self.out.motion[row] = how

    def _line(self, place: int) -> int:
        return int(np.searchsorted(self._starts, place, "right"))

    def _flag(self, row: int, reason: Reason) -> None:
        self.out.flags.setdefault(row, reason)

    def _tell(self, key: str, place: int, text: str) -> None:
        if key not in self._told:
            self._told.add(key)
            self.out.notes.append(f"{self.name}:{self._line(place)}: {text}.")


def _digits(text: bytes) -> str:
    """Returns a number as text, ``?`` for what is computed."""
    plain = text.strip().decode("latin-1")
    return plain if plain.isascii() and plain.isdigit() else "?"
