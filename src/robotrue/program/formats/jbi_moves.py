"""Use of points by the instructions of a JBI job: moves, arcs, shifts, computed points."""

from __future__ import annotations

import re
from array import array
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.errors import FormatError
from robotrue.program.formats.alike import note_moves
from robotrue.program.formats.jbi_scan import P_POINTS, JbiScan
from robotrue.program.formats.numbered_frames import list_changed_frames
from robotrue.program.formats.target_notes import absent_routine
from robotrue.program.program import Motion, Reason

_PLAIN: Final = re.compile(rb"MOV([JLC])[ \t]+C(\d{1,6})(?![^ \t])(.*)", re.DOTALL)
_MOVE: Final = re.compile(rb"(\+?)[ \t]*(S?MOV|IMOV|EIMOV|REFP)([JLCS]?)\b(.*)", re.DOTALL)
_POINTS: Final = re.compile(rb"(?<![\w#(])(C|P|BC|BP|EC|EX)(\d{1,6})\b")
_COMPUTED: Final = re.compile(rb"(?<![\w#(])(?:C|P|BC|BP|EC|EX)\[")
_LOCAL: Final = re.compile(rb"(?<![\w#(])L(?:P|BP|EX)[ \t]*(?:\d{1,6}\b|\[)")
_VARIABLE: Final = re.compile(rb"\bL?PX?(\d{1,6})\b")
_USED: Final = re.compile(rb"(?<![\w#(*:\"])C(\d{1,6})\b")
_VARIABLES: Final = re.compile(rb"\bPX?\[")
_FRAME: Final = re.compile(
    rb"\b(?:MFRAME|SETUFRAME)\b(?:(?!\b(?:MFRAME|SETUFRAME)\b).)*?UF#\((\d++)\)", re.IGNORECASE
)
_TOOL: Final = re.compile(rb"\bSETTOOL\b(?:(?!\bSETTOOL\b).)*?TL#\((\d++)\)", re.IGNORECASE)
MOTION: Final = {
    b"J": Motion.PTP,
    b"L": Motion.LIN,
    b"C": Motion.ARC_VIA,
    b"S": Motion.SPLINE,
    b"": Motion.LIN,
}
_CALL: Final = re.compile(rb"\bCALL[ \t]+JOB:([^\s()]+)")
_JOB: Final = re.compile(rb"^//NAME[ \t]+(\S+)", re.MULTILINE)
_SETS: Final = re.compile(
    rb"(?m)^(?!(?:\+?[ \t]*)?(?:S?MOV|P\d|///))[^'\r\n]*?"
    rb"(?:\b(?:CALL|JUMP)[ \t]+JOB|\bPX?(?:\d|\[))"
)
"""A line that is no move and names a P point, or calls a job."""
_LEAPS: Final = (b"JUMP", b"FOR ", b"WHILE", b"IFTHEN", b"ELSE", b"SWITCH")
"""Instructions with which a job does not run from its first line to its last."""
_TAILS: Final = 4096
"""Tails of moves remembered."""


@dataclass(slots=True)
class JbiMoves:
    """Motion, frames and paths of every point that a move names.

    Attributes:
        motion: How each row is moved to, by row.
        flags: Reasons found in instructions, by row.
        partners: External points in the same move, by row.
        runs: Rows of each run of ``MOVC``, in order.
        frames: Frames that the job computes: side, number and line.
        path: As ``Program.path``: line, row or minus the line, motion.
        notes: Sentences.
    """

    motion: dict[int, Motion] = field(default_factory=dict)
    flags: dict[int, Reason] = field(default_factory=dict)
    partners: dict[int, list[tuple[str, int]]] = field(default_factory=dict)
    runs: list[list[int]] = field(default_factory=list)
    frames: list[tuple[str, str, int]] = field(default_factory=list)
    path: array[int] = field(default_factory=lambda: array("q"))
    notes: list[str] = field(default_factory=list)


def quiet_jobs(files: Sequence[tuple[str, bytes]]) -> tuple[str, ...]:
    """Returns the names, in lower case, of jobs that set no point and call no job.

    Empty where no file calls a job.
    """
    if not any(b"CALL" in data for _, data in files):
        return ()
    named = [(_JOB.search(data), data) for _, data in files]
    return tuple(
        match[1].decode("latin-1").strip().lower()
        for match, data in named
        if match and not _SETS.search(data, match.end())
    )


def jbi_frame_changes(files: Sequence[tuple[str, bytes]]) -> Mapping[tuple[str, str], str]:
    """Returns what changes numbered frames of the controller in the jobs given."""
    words = (b"MFRAME", b"SETUFRAME", b"SETTOOL")
    return list_changed_frames(files, words, lambda line: _list_set_frames(line.partition(b"'")[0]))


def _list_set_frames(text: bytes) -> list[tuple[str, str]]:
    """Returns side and number of the frames that an instruction sets."""
    kinds = (("base", _FRAME), ("tool", _TOOL))
    return [(side, number.decode()) for side, kind in kinds for number in kind.findall(text)]


def moves(scan: JbiScan, name: str, harmless: Container[str] = ()) -> JbiMoves:
    """Returns what the instructions do.

    Args:
        scan: The job.
        name: Of its file.
        harmless: Jobs that change no point, in lower case.

    Raises:
        FormatError: A move to a C point that the job does not hold.
    """
    walk = _Walk(scan, name, harmless)
    for line, text in scan.body:
        walk.instruction(line, text.partition(b"'")[0] if b"'" in text else text)
        if line in scan.alike:
            walk.moves_alike(line, text.partition(b"'")[0])
    walk.finish()
    return walk.out


def names_no_point(tail: bytes) -> bool:
    """Returns whether a move's words after its point name none, and no second group."""
    return not (b"+" in tail or _POINTS.search(tail) or _COMPUTED.search(tail))


class _Walk:
    def __init__(self, scan: JbiScan, name: str, harmless: Container[str]) -> None:
        self.name, self._harmless, self._scan = name, harmless, scan
        self._variables: list[int] = []
        self._calls: list[tuple[str, int]] = []
        self.out = JbiMoves()
        self._row = {number: row for row, number in enumerate(scan.names.tolist())}
        self._external = scan.external
        self._run: list[int] = []
        self._master: list[int] = []
        self._shift = 0
        self._shifted: list[int] = []
        self._leaps = any(text.upper().startswith(_LEAPS) for _, text in scan.body)
        self._told: set[str] = set()
        self._tails: dict[bytes, bool] = {}

    def instruction(self, line: int, text: bytes) -> None:
        """Reads one."""
        plain = _PLAIN.match(text)
        if plain and not self._shift:
            letter, number, tail = plain.groups()
            row = self._row.get(int(number)) if self._is_plain(tail) else None
            if row is not None:
                self._master = [row]
                self._track(line, self._master, letter, b"FPT" in tail)
                return
        match = _MOVE.match(text)
        if match:
            self._move(line, match[1] == b"+", match[2], match[3], match[4])
            return
        if text.startswith(b"SFTON"):
            self._shift = self._shift or line
            moves = "moves of this job, which jumps," if self._leaps else "moves after it"
            self._tell("shift", f"{self.name}:{line}: SFTON shifts the {moves} up to SFTOF; their "
                       "targets are not compensated.")  # fmt: skip
        elif text.startswith(b"SFTOF") and not self._leaps:
            self._shift = 0
        if b"CALL" in text:
            self._call(line, text)
        if text.startswith(b"CALL") and self._shift:
            self._tell("called", f"{self.name}:{line}: a job that is called while SFTON shifts "
                "moves away from its points; do not compensate it.")  # fmt: skip
        self.out.frames += [(side, number, line) for side, number in _list_set_frames(text)]
        for number in _VARIABLE.findall(text):
            self._compute(int(number) + P_POINTS, line)
        for number in _USED.findall(text):
            self._compute(int(number), line)
        if _VARIABLES.search(text):
            self._all_variables(line)

    def moves_alike(self, line: int, text: bytes) -> None:
        """Reads moves that are alike but for their points, after the first of them."""
        found, plain = self._scan.alike[line], _PLAIN.match(text)
        rows = [self._row.get(number, -1) for number in found[:, 2].tolist()]
        if plain and plain[1] != b"C" and not (self._shift or -1 in rows):
            if self._is_plain(plain[3]):
                self._master = rows[-1:]
                lines = line + 1 + np.arange(len(rows))
                note_moves(self.out.path, self.out.motion, lines, rows, MOTION[plain[1]])
                return
        for own, each in self._scan.list_alike(line):
            self.instruction(own, each.partition(b"'")[0])

    def finish(self) -> None:
        """Closes what is open at the end."""
        self._close_run()
        self._behind_calls()
        if self._shift and self._leaps:
            self._shifted = list(self.out.motion)
        self.out.flags |= dict.fromkeys(self._shifted, Reason.RELATIVE)

    def _call(self, line: int, text: bytes) -> None:
        """A job that is called may give P points, which are global, other values."""
        for name in _CALL.findall(text):
            called = name.decode("latin-1").strip()
            if called.lower() not in self._harmless:
                self._calls.append((called, line))

    def _behind_calls(self) -> None:
        """Flags the P points that are moved to after a call; all where the job jumps."""
        used = sorted({row for row in self._variables if row >= 0})
        if not self._calls or not used:
            return
        for row in used:
            self._flag(row, Reason.EXPRESSION)
        names = list(dict.fromkeys(name for name, _ in self._calls))
        what = (f"P points: {len(used)} points after it are not compensated; user frames, tools "
            "and shifts are assumed unchanged")  # fmt: skip
        sentence = absent_routine(f"{self.name}:{self._calls[0][1]}", names, what)
        self.out.notes.append(sentence)

    def _is_plain(self, tail: bytes) -> bool:
        """True if a move's tail names no point and no second group; tails repeat themselves."""
        known = self._tails.get(tail)
        if known is None:
            known = names_no_point(tail)
            if len(self._tails) < _TAILS:
                self._tails[tail] = known
        return known

    def _move(self, line: int, second: bool, verb: bytes, letter: bytes, rest: bytes) -> None:
        own, *others = rest.split(b"+")
        if second:
            own, others = b"", [rest]
        if _COMPUTED.search(rest):
            self._all_variables(line)
        local = _LOCAL.search(rest)
        if local:
            self._tell("local", f"{self.name}:{line}: {local[0].decode()} is a variable of the "
                       "controller; moves to such points are not compensated.")  # fmt: skip
        rows = [] if verb == b"REFP" else list(self._targets(line, own))
        outside = [key for key in self._points(rest) if key[0] not in ("C", "P")]
        for row in [row for other in others for row in self._targets(line, other)]:
            self._flag(row, Reason.EXTERNAL_AXIS)
            self._tell("second", f"{self.name}:{line}: points behind + move a second group; they "
                       "are not compensated.")  # fmt: skip
        self._master = rows or self._master
        for row in self._master:
            self.out.partners.setdefault(row, []).extend(outside)
        if verb in (b"IMOV", b"EIMOV"):
            self._tell("step", f"{self.name}:{line}: IMOV moves by a step; its point is not "
                       "compensated.")  # fmt: skip
            for row in rows:
                self._flag(row, Reason.RELATIVE)
        elif verb == b"SMOV":
            self._tell("along", f"{self.name}:{line}: SMOV moves along with another group; its "
                       "point is not compensated.")  # fmt: skip
            for row in rows:
                self._flag(row, Reason.EXTERNAL_AXIS)
        if self._shift:
            self._shifted += rows
        if not second and not rows and verb in (b"MOV", b"SMOV"):
            self.out.path.extend((line, -line, int(MOTION[letter])))
        self._track(line, rows, letter, b"FPT" in own)

    def _track(self, line: int, rows: list[int], letter: bytes, ends: bool) -> None:
        """Notes how rows are moved to; runs of MOVC are arcs of two points each."""
        if letter != b"C" and rows and self._run:
            self._close_run()
        for row in rows:
            how = MOTION[letter]
            if letter == b"C":
                # The first is reached on a straight line and begins the arc.
                how = (Motion.ARC_VIA, Motion.ARC_END)[len(self._run) % 2 == 0]
                how = how if self._run else Motion.LIN
                self._run.append(row)
            self.out.path.extend((line, row, how))
            before = self.out.motion.get(row)
            if before is None or how == Motion.PTP:
                self.out.motion[row] = how
        if ends and self._run:
            last = self._run[-1]
            self._close_run()
            self._run = [last]

    def _close_run(self) -> None:
        if len(self._run) > 1:
            self.out.runs.append(self._run)
            if self.out.motion[self._run[-1]] == Motion.ARC_VIA:
                self.out.motion[self._run[-1]] = Motion.ARC_END
        self._run = []

    def _points(self, text: bytes) -> Iterator[tuple[str, int]]:
        for kind, number in _POINTS.findall(text):
            yield kind.decode(), int(number)

    def _targets(self, line: int, text: bytes) -> Iterator[int]:
        for kind, number in self._points(text):
            if kind not in ("C", "P"):
                continue
            row = self._row.get(number + (P_POINTS if kind == "P" else 0))
            if kind == "P" and row is not None and (self._calls or self._leaps):
                self._variables.append(row)
            if row is not None:
                yield row
            elif kind == "C":
                raise FormatError(
                    f"a move to C{number:05d}, which //POS does not hold.",
                    source=self.name,
                    line=line,
                    hint="the file is cut off or was edited: export the job again.",
                )
            else:
                self._tell("P", f"{self.name}:{line}: P{number:03d} is a variable of the "
                           "controller; moves to such points are not compensated.")  # fmt: skip

    def _compute(self, name: int, line: int) -> None:
        row = self._row.get(name)
        if row is not None:
            self._flag(row, Reason.EXPRESSION)
            what = f"C{name:05d}" if name < P_POINTS else f"P{name - P_POINTS:03d}"
            self._tell("set", f"{self.name}:{line}: {what} is used or set by an instruction that "
                       "is no move; such points are not compensated.")  # fmt: skip

    def _all_variables(self, line: int) -> None:
        if "index" in self._told:
            return
        self._tell("index", f"{self.name}:{line}: a point is chosen by a computed number; P points "
                   "of this job are not compensated.")  # fmt: skip
        for name, row in self._row.items():
            if name >= P_POINTS:
                self._flag(row, Reason.EXPRESSION)

    def _flag(self, row: int, reason: Reason) -> None:
        self.out.flags.setdefault(row, reason)

    def _tell(self, key: str, text: str) -> None:
        if key not in self._told:
            self._told.add(key)
            self.out.notes.append(text)
