"""Use of points by the instructions of a JBI job: moves, arcs, shifts, computed points."""

from __future__ import annotations

import re
from array import array
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.errors import FormatError
from robotrue.program.formats.alike import note_moves
from robotrue.program.formats.jbi_flow import list_calls
from robotrue.program.formats.jbi_jobs import JobLinks, list_set_frames
from robotrue.program.formats.jbi_scan import P_POINTS, JbiScan
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
MOTION: Final = {
    b"J": Motion.PTP,
    b"L": Motion.LIN,
    b"C": Motion.ARC_VIA,
    b"S": Motion.SPLINE,
    b"": Motion.LIN,
}
_OTHER_FRAME: Final = re.compile(rb"\b(?:TL|UF)#\(")
_TAILS: Final = 4096
"""Tails of moves remembered."""
ALL_POINTS: Final = -1
"""Among the numbers of P points: any of them."""


@dataclass(slots=True)
class JbiMoves:
    """Motion, frames and paths of every point that a move names.

    Attributes:
        motion: How each row is moved to, by row.
        flags: Reasons found in instructions, by row.
        partners: External points in the same move, by row.
        runs: Rows of each run of ``MOVC``, in order.
        frames: Frames that the job computes: side, number and line.
        named: P points that it uses other than as a constant target, or ``ALL_POINTS``.
        path: As ``Program.path``: line, row or minus the line, motion.
        notes: Sentences.
    """

    motion: dict[int, Motion] = field(default_factory=dict)
    flags: dict[int, Reason] = field(default_factory=dict)
    partners: dict[int, list[tuple[str, int]]] = field(default_factory=dict)
    runs: list[list[int]] = field(default_factory=list)
    frames: list[tuple[str, str, int]] = field(default_factory=list)
    named: set[int] = field(default_factory=set)
    path: array[int] = field(default_factory=lambda: array("q"))
    notes: list[str] = field(default_factory=list)


def moves(scan: JbiScan, name: str, links: JobLinks) -> JbiMoves:
    """Returns what the instructions do.

    Args:
        scan: The job.
        name: Of its file.
        links: What holds in it because of other jobs.

    Raises:
        FormatError: A move to a C point that the job does not hold.
    """
    walk = _Walk(scan, name, links)
    for line, text in scan.body:
        walk.instruction(line, text.partition(b"'")[0] if b"'" in text else text)
        if line in scan.alike:
            walk.moves_alike(line, text.partition(b"'")[0])
    walk.finish()
    return walk.out


def flag_p_points(found: JbiMoves, scan: JbiScan, name: str, named: Collection[int]) -> None:
    """Flags the P points that any job uses other than as a constant target.

    Args:
        found: Of one of the jobs, changed in place.
        scan: The job.
        name: Of its file.
        named: Numbers of such points; with ``ALL_POINTS`` all.
    """
    rows = np.flatnonzero(scan.names >= P_POINTS).tolist()
    own = [row for row in rows if ALL_POINTS in named or int(scan.names[row]) in named]
    fresh = [row for row in own if row in found.motion and row not in found.flags]
    found.flags |= dict.fromkeys(fresh, Reason.EXPRESSION)
    if fresh:
        what = f"P{int(scan.names[fresh[0]]) - P_POINTS:03d}"
        found.notes.append(
            f"{name}:{int(scan.line[fresh[0]])}: {what} is used or set otherwise in another job; "
            f"{len(fresh)} such points are not compensated."
        )


def names_no_point(tail: bytes) -> bool:
    """Returns whether a move's words after its point name none, no frame and no second group."""
    other = b"+" in tail or _POINTS.search(tail) or _COMPUTED.search(tail)
    return not (other or _OTHER_FRAME.search(tail))


class _Walk:
    def __init__(self, scan: JbiScan, name: str, links: JobLinks) -> None:
        self.name, self._links, self._scan = name, links, scan
        self._p_points: set[int] = set()
        self.out = JbiMoves()
        self._row = {number: row for row, number in enumerate(scan.names.tolist())}
        self._external = scan.external
        self._run: list[int] = []
        self._master: list[int] = []
        self._shifts = links.shifts.get(name, {})
        self._shift = self._shifts.get(0, False)
        self._shifted: list[int] = []
        self._reads_steps = 0
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
        self._shift = self._shifts.get(line, self._shift)
        if text.startswith(b"SFTON"):
            self._tell("shift", f"{self.name}:{line}: SFTON shifts the moves after it up to SFTOF; "
                       "their targets are not compensated.")  # fmt: skip
        elif text.startswith(b"+") and b"SFTON" in text:
            self._shift_move(line, self._master)
        for called in list_calls(text):
            self._call(line, called)
        if text.startswith(b"GETPOS"):
            self._reads_steps = line
        self.out.frames += [(side, number, line) for side, number in list_set_frames(text)]
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
        self.out.flags |= dict.fromkeys(self._shifted, Reason.RELATIVE)
        if self._shifted:
            self._tell("shift", f"{self.name}: a shift of another job, or of the run before, may "
                       "be in force; its moves there are not compensated.")  # fmt: skip
        if self._reads_steps:
            for row in self.out.motion:
                self._flag(row, Reason.EXPRESSION)
            self._tell("steps", f"{self.name}:{self._reads_steps}: GETPOS reads a taught position; "
                       "the points of this job are not compensated.")  # fmt: skip
        rows = [row for row in self.out.flags if int(self._scan.names[row]) >= P_POINTS]
        self.out.named |= {int(self._scan.names[row]) for row in rows}

    def _shift_move(self, line: int, rows: list[int]) -> None:
        """Flags the points of a move that states a shift itself."""
        self._tell("3D", f"{self.name}:{line}: SFTON3D shifts the move; its point is not "
                   "compensated.")  # fmt: skip
        for row in rows:
            self._flag(row, Reason.RELATIVE)

    def _call(self, line: int, called: str) -> None:
        if self._shift and called in self._links.absent:
            self._tell("called", f"{self.name}:{line}: a job that is called while SFTON shifts "
                "moves away from its points; do not compensate it.")  # fmt: skip

    def _behind_calls(self) -> None:
        """Flags P points, which are global, if a job in no file may give them other values."""
        rows = [self._row[name] for name in self._p_points if name in self._row]
        absent = self._links.absent
        if not absent or not rows:
            return
        for row in rows:
            self._flag(row, Reason.EXPRESSION)
        what = (f"P points: {len(rows)} points are not compensated; user frames, tools "
            "and shifts are assumed unchanged")  # fmt: skip
        self.out.notes.append(absent_routine(next(iter(absent.values())), list(absent), what))

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
        changed = verb not in (b"MOV", b"REFP") or self._shift or _OTHER_FRAME.search(rest)
        points = self._points(rest if changed else b"+".join(others))
        self.out.named |= {number + P_POINTS for kind, number in points if kind == "P"}
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
        if b"SFTON" in rest:
            self._shift_move(line, self._master)
        if _OTHER_FRAME.search(own) and verb == b"MOV":
            self._tell("frame", f"{self.name}:{line}: the move names a tool or frame itself; "
                       "its point is not compensated.")  # fmt: skip
            for row in rows:
                self._flag(row, Reason.UNKNOWN_FRAME)
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
            if kind == "P":
                self._p_points.add(number + P_POINTS)
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
        if name >= P_POINTS:
            self.out.named.add(name)
        if row is not None:
            self._flag(row, Reason.EXPRESSION)
            what = f"C{name:05d}" if name < P_POINTS else f"P{name - P_POINTS:03d}"
            self._tell("set", f"{self.name}:{line}: {what} is used or set by an instruction that "
                       "is no move; such points are not compensated.")  # fmt: skip

    def _all_variables(self, line: int) -> None:
        self.out.named.add(ALL_POINTS)
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
