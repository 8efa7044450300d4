"""The ways through Yaskawa jobs that call each other, and where a shift may be in force.

A shift belongs to the controller: it lasts in called jobs, behind the end of a job that does not
end it, and in the next run.
"""

from __future__ import annotations

import itertools
import re
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.program.formats.control_flow import ControlFlow
from robotrue.program.formats.jbi_scan import JbiScan

_JOB: Final = re.compile(rb"^//NAME[ \t]+(\S+)", re.MULTILINE)
_CALL: Final = re.compile(
    rb"\b(?:CALL|JUMP|PSTART)\b(?:(?!\b(?:CALL|JUMP|PSTART)\b)[^'\"])*?\bJOB:([^\s()]++)"
    rb"|\b(MJ#\(\w{1,20}+\))"
)
_OTHER_CALL: Final = re.compile(rb"(?:CALL|JUMP)[ \t]+(?!\*|LABEL:|JOB:)(\S+)")
"""A job by a variable, an input group or a table."""
_JUMP: Final = re.compile(rb"(?:JUMP[ \t]+|.* TRAP[ \t]*)(\*[^ \t]+|LABEL:)")
_SHIFT: Final = "shift"


@dataclass(frozen=True, slots=True)
class JobLines:
    """A job: its file, its name in lower case, and its instructions but for plain moves."""

    file: str
    name: str
    lines: list[tuple[int, bytes]]


def read_job_lines(file: str, found: JbiScan) -> JobLines:
    """Returns the instructions of a job that are no plain moves."""
    traps = b" TRAP" in found.data
    lines = [
        (line, text.partition(b"'")[0])
        for line, text in found.body
        if not text.startswith(b"MOV") or (traps and b" TRAP" in text)
    ]
    return JobLines(file, name_job(found.data), lines)


def name_job(data: bytes) -> str:
    """Returns the name of a job in lower case."""
    match = _JOB.search(data)
    return match[1].decode("latin-1").lower() if match else ""


def list_calls(text: bytes) -> list[str]:
    """Returns the jobs that an instruction starts, as it writes them."""
    if b"JOB:" not in text and not text.startswith((b"CALL", b"JUMP", b"MACRO")):
        return []
    found = [job or macro for job, macro in _CALL.findall(text)]
    other = _OTHER_CALL.match(text)
    return [name.decode("latin-1") for name in (*found, *([other[1]] if other else ()))]


def find_shifts(jobs: Sequence[JobLines]) -> dict[str, dict[int, bool]]:
    """Returns whether a shift may be in force after lines, 0 before all, by the names of files."""
    if not any(text.startswith(b"SFTON") for job in jobs for _, text in job.lines):
        return {}
    flow, edge = _ShiftFlow({job.name for job in jobs}), [1]
    for job in jobs:
        flow.draw(job, edge[-1])
        edge.append(edge[-1] + max(line for line, _ in job.lines) + 1)
    shifted, out = flow.find_shifted(), {}
    for job, first in zip(jobs, edge, strict=False):
        lines = [0, *(line for line, _ in job.lines)]
        out[job.file] = {line: shifted(first + line) for line in lines}
    return out


class _ShiftFlow(ControlFlow):
    """The graph of all jobs, each entered without a shift or with one."""

    def __init__(self, names: Collection[str]) -> None:
        super().__init__()
        self._given = names

    def draw(self, job: JobLines, first: int) -> None:
        """Draws a job; the places of its lines begin at ``first``."""
        self.start(first, job.name)
        labels = [text.split()[0] for _, text in job.lines if text.startswith(b"*")]
        end = first
        for line, text in job.lines:
            end = first + line
            self._draw(end, text)
        if any(b"LABEL:" in text for _, text in job.lines):  # a label by a variable may be any
            self.label(end, "LABEL:")
            for label in labels:
                self.branch(end, opens=True)
                self.jump(end, label.decode("latin-1"))
                self.join(end)

    def _draw(self, at: int, text: bytes) -> None:
        if text.startswith(b"SFTO"):
            self.set(at, _SHIFT, int(text.startswith(b"SFTON")))
        elif text.startswith((b"IFTHEN", b"SWITCH")):
            self.branch(at, opens=text.startswith(b"IFTHEN"))
        elif text.startswith((b"ELSE", b"CASE", b"DEFAULT")):
            self.alternative(at, other=not text.startswith((b"ELSEIF", b"CASE")))
        elif text.startswith((b"ENDIF", b"ENDSWITCH")):
            self.join(at)
        elif text.startswith((b"FOR ", b"WHILE")):
            self.loop(at)
        elif text.startswith((b"NEXT", b"ENDWHILE")):
            self.close_loop(at)
        elif text.startswith(b"*"):
            self.label(at, text.split()[0].decode("latin-1"))
        else:
            self._leap(at, text)

    def _leap(self, at: int, text: bytes) -> None:
        """Draws a jump, a call or the end of a job, on a condition or not."""
        jump, calls = _JUMP.match(text), list_calls(text)
        known = [name.lower() for name in calls if name.lower() in self._given]
        others = [] if known or b"JOB:" in text or not calls else sorted(self._given)
        ends = text.startswith((b"RET", b"END")) or (calls and text.startswith(b"JUMP"))
        always = b" IF" not in text and not others and b" TRAP" not in text
        # A job by a variable may be any of them.
        for name in (*known, *others) or ([""] if ends or jump else ()):
            if not always:
                self.branch(at, opens=True)
            if name:
                self.call(at, [name])
            if ends:
                self.leave(at)
            elif jump:
                self.jump(at, jump[1].decode("latin-1"))
            if not always:
                self.join(at)

    def find_shifted(self) -> Callable[[int], bool]:
        """Returns a function: whether a shift may be in force at a place."""
        self._finish()
        starts = np.array(self._place)
        at, values = np.array(self._sets[_SHIFT], np.int64).T
        node = np.searchsorted(starts, at, side="right") - 1
        sets = dict(zip(node.tolist(), (values > 0).tolist(), strict=True))  # the last of each
        self._iterate(sets)
        entries = self._find_entries()

        def is_shifted(place: int) -> bool:
            here = int(np.searchsorted(starts, place, side="right")) - 1
            last = int(np.searchsorted(at, place, side="right")) - 1
            if last >= 0 and node[last] == here:
                return bool(values[last])
            return any(self._middle[entry][here] for entry in entries[self._routine[here]])

        return is_shifted

    def _iterate(self, sets: Mapping[int, bool]) -> None:
        """Finds the states before and after the calls of every node, by how its job is entered."""
        count, first = len(self._place), set(self._first)
        self._into, self._middle, out = ([[False] * count for _ in (0, 1)] for _ in range(3))
        self._effect = [[False] * len(self._first) for _ in (0, 1)]
        wakes = self._list_woken()
        queue = deque(itertools.product((0, 1), range(count)))
        while queue:  # no state goes back, so every node is looked at again a few times at most
            entry, node = queue.popleft()
            on = any(out[entry][before] for before in self._before[node])
            on |= bool(entry) and node in first
            self._into[entry][node] |= on
            for name in self._calls[node]:
                on = self._effect[on][self._names[name]]
            self._middle[entry][node] |= on
            if not sets.get(node, on) or out[entry][node]:
                continue
            out[entry][node] = True
            behind, ends = wakes[node]
            queue.extend((entry, each) for each in behind)
            for routine, callers in ends:
                ways = (0, 1)[entry:]  # without a shift before, as with one
                fresh = not all(self._effect[way][routine] for way in ways)
                for way in ways:
                    self._effect[way][routine] = True
                queue.extend(itertools.product((0, 1), callers) if fresh else ())

    def _list_woken(self) -> list[tuple[list[int], list[tuple[int, list[int]]]]]:
        """Returns by node those behind it, and the jobs that end there with the nodes of calls."""
        out: list[tuple[list[int], list[tuple[int, list[int]]]]] = [([], []) for _ in self._place]
        callers: list[list[int]] = [[] for _ in self._first]
        for node, names in enumerate(self._calls):
            for before in self._before[node]:
                out[before][0].append(node)
            for name in names:
                callers[self._names[name]].append(node)
        for routine, ends in enumerate(self._last):
            for node in ends:
                if node >= 0:
                    out[node][1].append((routine, callers[routine]))
        return out

    def _find_entries(self) -> list[set[int]]:
        """Returns with which states each job is entered; one without a caller again and again."""
        calls = [(node, self._names[n]) for node, names in enumerate(self._calls) for n in names]
        called = {routine for _, routine in calls}
        count = len(self._first)
        ways = [set() if r in called else {0, int(self._effect[0][r])} for r in range(count)]
        known = -1
        while known != sum(map(len, ways)):
            known = sum(map(len, ways))
            for node, routine in calls:
                entered = tuple(ways[self._routine[node]])
                ways[routine] |= {int(self._into[entry][node]) for entry in entered}
        return [way or {0, 1} for way in ways]
