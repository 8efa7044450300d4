"""Targets of a KRL motion: their places, and the stored points they name."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.program.formats.krl_flow import KrlFlow
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_scan import NOT_CONSTANT, Scan
from robotrue.program.formats.krl_values import KrlValues
from robotrue.program.program import Motion, Reason

REFERENCE: Final = re.compile(r"(\$?[A-Za-z_]\w*)(?:\s*\[([^\]]*)\])?((?:\s*\.\s*[A-Za-z_]\w*)*)")
_MEMBER: Final = re.compile(r"(?:\b(\w++)\s*+(?=[\[{}]))?+(?:(\[[^\[\]{}]*+\])\s*+)?+([{}])")
_LAST: Final = re.compile(r"\b(\w++)\s*+(\[[^\[\]]*+\])?+\s*+$")
_TAIL: Final = re.compile(r"\bC_|\bWITH\b|\bCA\b", re.IGNORECASE)
_NUMBERED: Final = re.compile(r"\d+(,\d+)*")
_MOST_SEARCHED: Final = 50_000
"""Elements that moves to a computed one may mean, in all; with more, none is compensated."""


class Definition(NamedTuple):
    """A stored point: its file, aggregate, and name ``variable[index].path`` in lower case."""

    file: int
    agg: int
    variable: str
    subscript: str
    path: str

    @property
    def computed(self) -> bool:
        """Whether its subscript is none of numbers."""
        return bool(self.subscript) and not _NUMBERED.fullmatch(self.subscript)


class Called(NamedTuple):
    """A call of ``CR_PROCESS_FILE``: zero-based line, file, its first and last line (-1: all)."""

    line: int
    name: str
    first: int
    last: int


@dataclass(slots=True)
class ParsedKrl:
    """Results of the walk.

    Attributes:
        definitions: Every stored point.
        uses: (file, aggregate) to the (line, motion) it is moved to with.
        flags: (file, aggregate) to the reason it cannot be compensated.
        arcs: Pairs of (file, aggregate): auxiliary and end point.
        tainted: (variable, path) that take part in an expression, with a line.
        sequence: (line, aggregate of the main file or -1, is auxiliary): what moves the robot;
            -1 where it is not known what moved it.
        notes: Sentences for the user.
        has_def: The file has a DEF, DEFFCT or DEFDAT.
        called_files: CAMRob files whose targets the robot moves through.
        lost: (line, motion) of moves to a target that is not known.
        shared: Names of GLOBAL points of the data files.
        written: (file, aggregate) of targets that are written out: first byte and end of the text
            they take the place of, and the variables they are computed from.
        spelled: Names of called routines as the program writes them, by lower case.
    """

    definitions: list[Definition]
    uses: dict[tuple[int, int], list[tuple[int, Motion]]]
    flags: dict[tuple[int, int], Reason]
    arcs: list[tuple[tuple[int, int], tuple[int, int]]]
    tainted: dict[tuple[str, str], int]
    sequence: list[tuple[int, int, bool]]
    notes: list[str]
    has_def: bool
    called_files: list[Called]
    spelled: dict[str, str]
    lost: list[tuple[int, Motion]]
    shared: set[str]
    written: dict[tuple[int, int], tuple[int, int, frozenset[str]]] = field(default_factory=dict)

    def flag_tainted(self) -> dict[tuple[int, int], Reason]:
        """Returns the flags, and those of stored points that take part in an expression."""
        out = dict(self.flags)
        paths: dict[str, list[str]] = {}
        for variable, path in self.tainted:
            paths.setdefault(variable, []).append(path)
        for item in self.definitions:
            if any(_are_nested(path, item.path) for path in paths.get(item.variable, ())):
                out[item.file, item.agg] = Reason.EXPRESSION
        return out


class Operand(NamedTuple):
    """A target of a motion.

    Attributes:
        start: First byte of its text in the file.
        end: Byte after it.
        text: The expression.
        name: The variable, in lower case, if it is one and nothing else.
        keys: (file, aggregate) of the points it may be, if it is not evaluated.
        constant: It is an aggregate of numbers, or a name: nothing in it is computed in place.
    """

    start: int
    end: int
    text: str
    name: str
    keys: list[tuple[int, int]]
    constant: bool


class MotionStatement(NamedTuple):
    """A motion: file, zero-based line, ``LIN`` and its like, whether it is relative, targets."""

    file: int
    line: int
    kind: str
    relative: bool
    operands: list[Operand]


def first_aggregates(found: Scan) -> IntArray:
    """Returns (l + 1,) the number of aggregates before each line, and at last of all."""
    first = np.zeros(len(found.line_kind) + 1, np.int64)
    np.cumsum(np.bincount(found.agg_line, minlength=len(first) - 1), out=first[1:])
    return first


def without_blanks(text: str | None) -> str:
    """Returns a text in lower case without blanks."""
    return re.sub(r"\s+", "", text or "").lower()


class KrlPoints:
    """The points a job stores and the motions that name them.

    Attributes:
        scans: Of every file.
        names: Of every file.
        frames: Work frames and tools.
        scope: Which file a name belongs to.
        values: Of variables.
        flow: Frames and variables over every way.
        first: Aggregates before each line of every file.
        story: What is collected.
        motions: In the order of the text.
    """

    def __init__(self, scans: list[Scan], names: list[str], frames: Frames) -> None:
        self.scans, self.names, self.frames = scans, names, frames
        self.scope = frames.scope
        self.flow = KrlFlow(frames.table.harmless_routines)
        self.values = KrlValues(self.scope, self.flow)
        self.first = [first_aggregates(found) for found in scans]
        self.story = ParsedKrl([], defaultdict(list), {}, [], {}, [], [], False, [], {}, [], set())
        self.motions: list[MotionStatement] = []
        self.current: dict[str, dict[tuple[str, str], Definition]] = defaultdict(dict)
        self._searched = 0

    def taint(self, line: int, code: str) -> None:
        """Marks every name in a text as read by what is not followed."""
        closed = code.rfind("]") + 1  # a bracket after it is not closed: it holds no index
        for name, _, path in REFERENCE.findall(code[:closed] + code[closed:].replace("[", "(")):
            key = self.values.key(name.lower(), line), without_blanks(path).strip(".")
            self.story.tainted.setdefault(key, line)

    def note(self, line: int, file: int, text: str) -> None:
        """Adds a sentence on a line."""
        self.story.notes.append(f"{self.names[file]}:{line + 1}: {text}.")

    def values_of(self, file: int, agg: int) -> Array:
        """Returns X..C (6,) of an aggregate in mm and deg, NaN where it leaves them out."""
        scan = self.scans[file]
        values = np.full(6, np.nan)
        for token in range(int(scan.agg_token[agg]), int(scan.agg_token[agg + 1])):
            if scan.tok_component[token] < 6:
                values[scan.tok_component[token]] = scan.tok_value[token]
        return values

    def operands(
        self, file: int, line: int, code: str, at: int, most: int
    ) -> tuple[list[Operand], int]:
        """Returns the targets of a motion, and where its tail starts."""
        found: list[Operand] = []
        while len(found) < most:
            at += len(code[at:]) - len(code[at:].lstrip())
            operand, end = self._operand(file, line, code, at)
            found.append(operand)
            comma = code[end:].lstrip()
            if not comma.startswith(",") or len(found) == most:
                return found, end
            at = code.index(",", end) + 1
        return found, at

    def _operand(self, file: int, line: int, code: str, at: int) -> tuple[Operand, int]:
        begin = int(self.scans[file].line_start[line])
        keys, end, name, constant = self._primary(file, line, code, at)
        if code[end:].lstrip()[:1] in (":", "+", "-", "*", "/", "("):
            end = _end_of_expression(code, at)
            keys = self._aggregates(file, line, at, end)
            name, constant = "", False
        text = code[at:end].rstrip()
        operand = Operand(begin + at, begin + at + len(text), text, name, keys, constant)
        return operand, end

    def _aggregates(self, file: int, line: int, at: int, end: int) -> list[tuple[int, int]]:
        """Returns the aggregates that open between two columns of a line."""
        scan, first = self.scans[file], self.first[file]
        columns = scan.agg_open[int(first[line]) : int(first[line + 1])] - scan.line_start[line]
        inside = np.flatnonzero((columns >= at) & (columns < end)) + int(first[line])
        return [(file, agg) for agg in inside.tolist()]

    def _primary(
        self, file: int, line: int, code: str, at: int
    ) -> tuple[list[tuple[int, int]], int, str, bool]:
        """Returns the points, end, variable and constancy of what begins an operand."""
        scan = self.scans[file]
        if code[at : at + 1] == "{":
            for _, agg in self._aggregates(file, line, at, at + 1):
                end = int(scan.agg_close[agg] - scan.line_start[line]) + 1
                return [(file, agg)], end, "", not scan.agg_flag[agg] & NOT_CONSTANT
            self.note(line, file, "the target is not a list of components; it is not compensated")
            return [], len(code), "", True
        match = REFERENCE.match(code, at)
        if not match:
            return [], at, "", True
        name, index = self.values.key(match[1].lower(), line), without_blanks(match[2])
        path = without_blanks(match[3]).strip(".")
        stored = self.current.get(name, {})
        if index and not _NUMBERED.fullmatch(index):
            self._searched += len(stored)
            if self._searched <= _MOST_SEARCHED:
                keys = [(d.file, d.agg) for (_, p), d in stored.items() if p == path]
            else:
                keys = []
                self.story.tainted.setdefault((name, path), line)
        else:
            one = stored.get((index, path))
            keys = [] if one is None else [(one.file, one.agg)]
        return keys, match.end(), match[1].lower(), True


def _are_nested(one: str, other: str) -> bool:
    short, long = sorted((one, other), key=len)
    return not short or (long + ".").startswith(short + ".")


def _end_of_expression(code: str, at: int) -> int:
    """Returns where an expression ends: at a comma outside of brackets, or at the motion's tail."""
    depth = 0
    tail = _TAIL.search(code, at)
    last = tail.start() if tail else len(code)
    for column in range(at, last):
        depth += (code[column] in "({[") - (code[column] in ")}]")
        if code[column] == "," and depth == 0:
            return column
    return last


def members(code: str, at: int, places: Iterable[int], outer: str) -> Iterator[str]:
    """Yields the member path of each aggregate of a structure: ``{fCnC {`` gives ``fcnc``.

    Args:
        code: A line.
        at: Where its value begins.
        places: Where the aggregates open, in order.
        outer: Path of the value.
    """
    stack: list[str] = []
    braces = _MEMBER.finditer(code, at)
    brace = next(braces, None)
    for here in places:
        while brace is not None and brace.end() <= here:
            if brace[3] == "{":
                stack.append(((brace[1] or "") + without_blanks(brace[2])).lower())
            elif stack:
                stack.pop()
            at, brace = brace.end(), next(braces, None)
        last = _LAST.search(code, at, here)
        names = [outer, *stack[1:], last[1].lower() + without_blanks(last[2]) if last else ""]
        yield ".".join(name for name in names if name)
