"""What the statements of a Fanuc LS program do with its positions.

A statement is ``n: ... ;`` and may go over lines. J, L, C (via and end in one statement), A (one
point of an arc per statement) and S (spline) move to ``P[n]``. Words after the target say what
else counts: an offset or an increment makes it another pose than the one that stands there.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.errors import FormatError
from robotrue.program.formats.fanuc_foreign import in_another_language, odd_word, words_behind
from robotrue.program.formats.fanuc_scan import FanucScan
from robotrue.program.formats.text_lines import line_at, line_starts
from robotrue.program.program import Motion, Reason

_STATEMENT: Final = re.compile(rb"\s*+(?:\d{0,6}+\s*+:)?+([^;]*+);")
_PLAIN: Final = re.compile(rb"[ \t]*([JLS])[ \t]+P\[(\d{1,6})(?::[^\]]*)?\](.*)", re.DOTALL)
_MOVE: Final = re.compile(rb"\s*([JLCAS])\s+(P|PR)\s*\[(.*)", re.DOTALL)
_TARGET: Final = re.compile(rb"\b(P|PR)\s*+\[\s*+([^\]:]*+)(?::[^\]]*+)?\]")
_POINT: Final = re.compile(rb"(?<![\w$])P\s*+\[\s*+([^\]:]*+)(?::[^\]]*+)?\]")
_FRAME_NUMBER: Final = re.compile(rb"\b(UFRAME|UTOOL|BENUTZER|WKZ)_NUM\s*=\s*([^;,)]*)")
_FRAME_DATA: Final = re.compile(rb"\b(UFRAME|UTOOL|BENUTZER|WKZ)\s*+\[")
_MOTION: Final = {b"J": Motion.PTP, b"L": Motion.LIN, b"S": Motion.SPLINE}
_CALL: Final = re.compile(rb"\b(?:CALL|RUN)\s+([\w.]+)")
_PROG: Final = re.compile(rb"^/PROG[ \t]+(\w+)", re.MULTILINE)
_SIDE: Final = {b"UFRAME": "base", b"BENUTZER": "base", b"UTOOL": "tool", b"WKZ": "tool"}
_SHIFT: Final = re.compile(rb"(?:TOUCH|MP)[ \t]+OFFSET\b[ \t]*(END\b)?")
_LEAP: Final = re.compile(rb"\bJMP\b|[:;]\s*(?:FOR|IF|ELSE|SELECT)\b")
_TRACKING: Final = re.compile(rb"\bLINE_TRACK_SCHEDULE_NUMBER\s*:\s*0*([1-9]\d*)")
_OPTIONS: Final = (
    (re.compile(rb"\bINC\b"), Reason.RELATIVE, "INC moves by a step"),
    (
        re.compile(rb"\b(?:TOOL_OFFSET|OFFSET|VOFFSET)\b"),
        Reason.EXPRESSION,
        "an offset from a register moves the target",
    ),
    (
        re.compile(rb"\b(?:PR|VR)\s*+\[\](?!\s*=)"),
        Reason.EXPRESSION,
        "an offset from a register moves the target",
    ),
    (re.compile(rb"\bRTCP\b"), Reason.TOOL_ON_FLOOR, "RTCP has the tool stand outside the robot"),
    (re.compile(rb"\bCOORD\b"), Reason.EXTERNAL_AXIS, "COORD moves with another group"),
)
_TAILS: Final = 4096
"""Tails of moves remembered."""


@dataclass(slots=True)
class FanucMoves:
    """What is known of every position that a statement names.

    Attributes:
        motion: How each row is moved to, by row.
        flags: Reasons found in statements, by row.
        arcs: Rows that make one arc, or one run of arcs.
        current: What ``UFRAME_NUM`` and ``UTOOL_NUM`` are set to: distinct texts by side.
        changed: Line of the frames that the program computes, by side and number, ``?`` for any.
        calls: Programs called that may set the number of frame and tool.
        path: As ``Program.path``: byte, row or minus the line, motion.
        notes: Sentences.
    """

    motion: dict[int, Motion] = field(default_factory=dict)
    flags: dict[int, Reason] = field(default_factory=dict)
    arcs: list[list[int]] = field(default_factory=list)
    current: dict[str, set[str]] = field(default_factory=lambda: {"base": set(), "tool": set()})
    changed: dict[tuple[str, str], int] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    path: array[int] = field(default_factory=lambda: array("q"))
    notes: list[str] = field(default_factory=list)


def quiet_programs(files: Sequence[tuple[str, bytes]]) -> tuple[str, ...]:
    """Returns the names, in lower case, of programs that set no frame number and call none."""
    named = [(_PROG.search(data), data) for _, data in files]
    return tuple(
        match[1].decode("latin-1").lower()
        for match, data in named
        if match and not _FRAME_NUMBER.search(data) and not _CALL.search(data)
    )


def moves(scan: FanucScan, name: str, harmless: Container[str] = ()) -> FanucMoves:
    """Returns what the statements do.

    Args:
        scan: The program.
        name: Of its file.
        harmless: Programs that set no frame or tool number, in lower case.

    Raises:
        FormatError: A statement without its ``;``.
    """
    walk = _Walk(scan, name, harmless)
    at, end = scan.statements
    match = _STATEMENT.match(scan.data, at, end)
    while match is not None:
        walk.statement(match.start(1), match[1])
        at = match.end()
        match = _STATEMENT.match(scan.data, at, end)
    rest = scan.data[at:end]
    if rest.strip():
        at += len(rest) - len(rest.lstrip())
        raise FormatError(
            f"the statement {rest.strip()[:40].decode('latin-1')!r} has no ';'.",
            source=name,
            line=line_at(scan.data, at),
            hint="the file is cut off or was edited: export the program again.",
        )
    walk.close_run()
    return walk.out


class _Walk:
    def __init__(self, scan: FanucScan, name: str, harmless: Container[str]) -> None:
        self._harmless = harmless
        self.name, self.data = name, scan.data
        self.out = FanucMoves()
        self._starts = line_starts(self.data)
        self._row = {number: row for row, number in enumerate(scan.number.tolist())}
        self._others = scan.others
        self._run: list[int] = []
        self._told: set[str] = set()
        self._tails: dict[bytes, tuple[tuple[Reason, str], ...]] = {}
        self._foreign = in_another_language(scan.data, scan.statements)
        first, last = scan.statements
        self._leaps = _LEAP.search(scan.data, first, last) is not None
        self._shifted = False
        tracking = _TRACKING.search(scan.data, 0, first)
        if tracking:
            self._tell("tracking", tracking.start(), "line tracking schedule "
                       f"{tracking[1].decode()}: the positions count from a frame that moves with "
                       "the conveyor; they are not compensated")  # fmt: skip
            self.out.flags |= dict.fromkeys(self._row.values(), Reason.UNKNOWN_FRAME)

    def statement(self, place: int, text: bytes) -> None:
        """Reads one; comments and remarked statements are passed over."""
        plain = _PLAIN.match(text)
        if plain and not self._run and not self._shifted:
            row, options = self._row.get(int(plain[2])), self._options(plain[3])
            if row is not None and not options:
                self._use(place, row, _MOTION[plain[1]])
                return
        text = text.lstrip()
        if not text or text.startswith((b"!", b"//", b"--")):
            return
        move = _MOVE.match(text)
        shift = _SHIFT.match(text.upper())
        if move:
            self._move(place, move[1], text)
        elif shift:
            self._shift(place, bool(shift[1]))
        elif b"P" in text or b"U" in text or b"CALL" in text:
            self._other(place, text)

    def close_run(self) -> None:
        """Ends a run of A moves: its points share their fate."""
        if len(self._run) > 1:
            self.out.arcs.append(self._run)
            if self.out.motion[self._run[-1]] == Motion.ARC_VIA:
                self.out.motion[self._run[-1]] = Motion.ARC_END
        self._run = []

    def _move(self, place: int, letter: bytes, text: bytes) -> None:
        count = 2 if letter == b"C" else 1
        targets = list(_TARGET.finditer(text, 0, text.rfind(b"]") + 1))[:count]
        tail = text[targets[-1].end() :] if targets else b""
        rows = [self._target(place, each) for each in targets]
        known = [row for row in rows if row is not None]
        if not known:
            line, how = line_at(self.data, place), _MOTION.get(letter, Motion.ARC_END)
            self.out.path.extend((place, -line, int(how)))
        if letter != b"A":
            self.close_run()
        if letter == b"C":
            for row, how in zip(rows, (Motion.ARC_VIA, Motion.ARC_END), strict=False):
                if row is not None:
                    self._use(place, row, how)
            if len(known) < 2:
                for row in known:
                    self._flag(row, Reason.EXPRESSION)
            self.out.arcs.append(known)
        elif letter == b"A":
            for row in known:
                # The first is reached on a straight line and begins the arc.
                how = Motion.ARC_VIA if len(self._run) % 2 else Motion.ARC_END
                self._use(place, row, how if self._run else Motion.LIN)
                self._run.append(row)
        else:
            for row in known:
                self._use(place, row, _MOTION[letter])
        for reason, what in self._options(tail):
            self._tell(what, place, f"{what}; such targets are not compensated")
            for row in known:
                self._flag(row, reason)

        if self._shifted:
            for row in known:
                self._flag(row, Reason.EXPRESSION)

    def _shift(self, place: int, ends: bool) -> None:
        """Begins or ends what moves every target by a register; in a program that jumps, all."""
        if not ends:
            self._tell("shift", place, "Touch Offset and MP OFFSET move the targets after them by "
                       "a register; they are not compensated")  # fmt: skip
            if self._leaps:
                self._leaps = False  # once is enough
                for row in self._row.values():
                    self._flag(row, Reason.EXPRESSION)
        self._shifted = not ends

    def _target(self, place: int, match: re.Match[bytes]) -> int | None:
        text = match[2].strip()
        if match[1] == b"PR":
            self._tell("PR", place, "targets in position registers (PR) stand in the controller; "
                       "they are not compensated")  # fmt: skip
            return None
        if not text.isdigit() or len(text) > 6:
            self._note_computed(place)
            return None
        row = self._row.get(int(text))
        if row is None and int(text) not in self._others:
            self._tell("absent", place, f"/POS does not hold P[{int(text)}]; moves to such points "
                       "are not compensated")  # fmt: skip
        return row

    def _other(self, place: int, text: bytes) -> None:
        """Reads a statement that is no move: frames it sets, positions it reads."""
        for kind, number in _FRAME_NUMBER.findall(text):
            self.out.current[_SIDE[kind]].add(_digits(number))
        for called in _CALL.findall(text):
            if called.decode("latin-1").lower() not in self._harmless:
                self.out.calls.append(called.decode("latin-1"))
        for part in text.split(b"=")[:-1]:
            given = part.rstrip()
            holder = _FRAME_DATA.search(given) if given.endswith(b"]") else None
            if holder:
                number = given[holder.end() : -1].partition(b":")[0]
                key = _SIDE[holder[1]], _digits(number)
                if key not in self.out.changed:
                    self.out.changed[key] = int(np.searchsorted(self._starts, place, "right"))
        for found in _POINT.findall(text, 0, text.rfind(b"]") + 1):
            plain = _digits(found)
            row = self._row.get(int(plain)) if plain.isdigit() and len(plain) <= 6 else None
            if row is not None:
                self._flag(row, Reason.EXPRESSION)
                self._tell("read", place, f"P[{int(plain)}] is used by a statement that is no "
                           "move; such positions are not compensated")  # fmt: skip
            elif not found.strip().isdigit():
                self._note_computed(place)

    def _note_computed(self, place: int) -> None:
        if "index" in self._told:
            return
        self._tell("index", place, "a position is chosen by a computed number; no position of this "
                   "program is compensated")  # fmt: skip
        for row in self._row.values():
            self._flag(row, Reason.EXPRESSION)

    def _options(self, tail: bytes) -> tuple[tuple[Reason, str], ...]:
        known = self._tails.get(tail)
        if known is None:
            upper = words_behind(tail)
            known = tuple((why, what) for sign, why, what in _OPTIONS if sign.search(upper))
            odd = odd_word(upper) if self._foreign and not known else ""
            if odd:
                what = f"{odd!r}, in a program of another language than English, may move the"
                known = ((Reason.EXPRESSION, f"{what} target"),)
            if len(self._tails) < _TAILS:
                self._tails[tail] = known
        return known

    def _use(self, place: int, row: int, how: Motion) -> None:
        self.out.path.extend((place, row, int(how)))
        before = self.out.motion.get(row)
        if before is None or how == Motion.PTP:
            self.out.motion[row] = how

    def _flag(self, row: int, reason: Reason) -> None:
        self.out.flags.setdefault(row, reason)

    def _tell(self, key: str, place: int, text: str) -> None:
        if key not in self._told:
            self._told.add(key)
            self.out.notes.append(f"{self.name}:{line_at(self.data, place)}: {text}.")


def _digits(text: bytes) -> str:
    """Returns a number as text, ``?`` for what is computed."""
    plain = text.strip().decode("latin-1")
    return plain if plain.isascii() and plain.isdigit() else "?"
