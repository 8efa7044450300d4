"""The trail of moves through the text of a program, for dialects that insert targets.

A dialect reads its statements in the order of the text and reports them: a target moved to, a line
or arc with the bytes of its statement, a place where the robot's position is uncertain, a loop.
Where two moves follow each other without uncertainty between, the second starts where the first
ends.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ShapeError
from robotrue.program.formats.number_text import Stretch, splice_texts
from robotrue.program.insertion import Insertion, Moves, Obstacle
from robotrue.program.program import Motion, Program

UNKNOWN: Final = -1
"""A target that is no certain row."""
COLUMNS: Final = 8


class TrailStatement(NamedTuple):
    """The bytes of a move.

    Attributes:
        file: Program of the job that contains it.
        begin: First byte of the statement.
        via: First byte and end of the auxiliary target, -1 where there is none.
        via_end: See there.
        target: First byte of the target.
        target_end: Its end.
        end: End of the statement.
        other: A place of the dialect's own.
    """

    file: int
    begin: int
    via: int
    via_end: int
    target: int
    target_end: int
    end: int
    other: int = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Statements:
    """Statements of k moves as columns (k, 8)."""

    table: IntArray

    def __getitem__(self, move: int) -> TrailStatement:
        return TrailStatement(*self.table[move].tolist())


class Trail:
    """Collects moves; see the module."""

    def __init__(self) -> None:
        self._here, self._depth, self._event = UNKNOWN, 0, False
        self._moves = array("q")
        self._statements = array("q")
        self._used = array("q")

    def lose(self) -> None:
        """From here on it is not certain where the robot is."""
        self._here, self._event = UNKNOWN, False

    def loop(self, step: int) -> None:
        """Enters (1) or leaves (-1) a loop."""
        self._depth = max(0, self._depth + step)
        self.lose()

    def tie(self) -> None:
        """Attaches a statement to the next move: a trigger that precedes it."""
        self._event = True

    def routine(self) -> None:
        """A routine begins: no loop is open."""
        self._depth = 0
        self.lose()

    def arrive(self, row: int) -> None:
        """Ends the segment at a target that the robot reaches on its own path."""
        self._here, self._event = row, False
        self._used.append(row)

    def move(
        self,
        via: int,
        row: int,
        line: int,
        statement: TrailStatement,
        obstacle: int = Obstacle.NONE,
    ) -> None:
        """The robot moves straight, or on an arc over ``via``, to a target."""
        if row < 0 or (statement.via >= 0 and via < 0):
            obstacle = obstacle or Obstacle.COMPUTED
        if self._depth:
            obstacle = obstacle or Obstacle.LOOP
        if self._here < 0:
            obstacle = obstacle or Obstacle.START
        if self._event:
            obstacle = obstacle or Obstacle.EVENT
        self._moves.extend((self._here, via, row, line, int(obstacle)))
        self._statements.extend(statement)
        if via >= 0:
            self._used.append(via)
        self.arrive(row)

    def run(self, rows: range, line: int, file: int, begins: IntArray) -> None:
        """The robot moves straight from target to target, a line of the file for each.

        Args:
            rows: Job rows of the targets.
            line: One-based line of the first.
            file: Program of the job.
            begins: First byte of each statement; the place of its target is not stated (-1).
        """
        row = np.arange(rows.start, rows.stop)
        table = np.full((len(row), 5), Obstacle.LOOP if self._depth else Obstacle.NONE)
        table[:, 0], table[:, 1], table[:, 2] = row - 1, UNKNOWN, row
        table[:, 3] = line + np.arange(len(row))
        table[0, 0] = self._here
        if not self._depth and (self._here < 0 or self._event):
            table[0, 4] = Obstacle.START if self._here < 0 else Obstacle.EVENT
        statements = np.full((len(row), COLUMNS), UNKNOWN)
        statements[:, 0], statements[:, 1] = file, begins
        self._moves.frombytes(table.astype(np.int64).tobytes())
        self._statements.frombytes(statements.astype(np.int64).tobytes())
        self._used.frombytes(row.astype(np.int64).tobytes())
        self._here, self._event = int(row[-1]), False

    def moves(self) -> Moves:
        """Returns what was collected."""
        table = np.frombuffer(self._moves, np.int64).reshape(-1, 5)
        start, via, end, line, obstacle = table.T
        used = np.frombuffer(self._used, np.int64)
        times = np.bincount(used[used >= 0], minlength=1)
        shared = (end >= 0) & (times[end] > 1) | (via >= 0) & (times[via] > 1)
        statements = np.frombuffer(self._statements, np.int64).reshape(-1, COLUMNS)
        return Moves(
            start=start,
            via=via,
            end=end,
            line=line,
            obstacle=np.where(shared & (obstacle == Obstacle.NONE), int(Obstacle.SHARED), obstacle),
            spans=Statements(table=statements),
        )


class MoveGroup(NamedTuple):
    """The targets to insert into one move.

    Attributes:
        move: Which.
        statement: Its bytes.
        rows: Rows of the insertion, (straight) or pairs of them (arc).
    """

    move: int
    statement: TrailStatement
    rows: range

    def models(self, moves: Moves) -> Iterator[tuple[int, int]]:
        """Yields for each row of the insertion the job row that it is written like, and itself."""
        for k, row in enumerate(self.rows):
            via = self.statement.via >= 0 and k % 2 == 0
            yield int((moves.via if via else moves.end)[self.move]), row


def groups(moves: Moves, insertion: Insertion) -> Iterator[MoveGroup]:
    """Yields the moves that get targets, in order.

    Raises:
        ShapeError: A move that may not be split, or targets that do not suit it.
    """
    which, first = np.unique(insertion.move, return_index=True)
    ends = [*first[1:].tolist(), len(insertion)][: len(first)]
    for move, begin, end in zip(which.tolist(), first.tolist(), ends, strict=True):
        if moves.obstacle[move]:
            why = Obstacle(int(moves.obstacle[move])).explanation
            raise ShapeError(f"the move of line {moves.line[move]} cannot be split: {why}.")
        motions = insertion.motion[begin:end].tolist()
        arc = bool(moves.bending[move])
        pattern = [Motion.ARC_VIA, Motion.ARC_END] * (len(motions) // 2)
        if motions != (pattern if arc else [Motion.LIN] * len(motions)):
            raise ShapeError(f"the targets for the move of line {moves.line[move]} do not suit it.")
        yield MoveGroup(move, moves.spans[move], range(begin, end))


def repeat_statement(
    data: bytes, statement: TrailStatement, texts: Sequence[bytes], tail: bytes | None = None
) -> list[bytes]:
    """Returns the statement once for each target of ``texts``, or for each pair of an arc.

    Args:
        data: The file.
        statement: Of the move.
        texts: New targets.
        tail: Text after the target; as in the statement if not given.
    """
    s = statement
    tail = data[s.target_end : s.end] if tail is None else tail
    if s.via < 0:
        head = data[s.begin : s.target]
        return [head + text + tail for text in texts]
    head, between = data[s.begin : s.via], data[s.via_end : s.target]
    pairs = zip(texts[::2], texts[1::2], strict=True)
    return [head + via + between + end + tail for via, end in pairs]


def put_in(programs: Sequence[Program], edits: Sequence[list[Stretch]]) -> list[bytes]:
    """Returns the bytes of every program with its stretches replaced."""
    pairs = zip(programs, edits, strict=True)
    return [splice_texts(program.data, own) if own else program.data for program, own in pairs]


def line_start(data: bytes, place: int) -> int:
    """Returns the first byte of the line that contains a byte."""
    return max(data.rfind(b"\n", 0, place), data.rfind(b"\r", 0, place)) + 1


def line_end(data: bytes) -> bytes:
    """Returns how the lines of a file end: as its first one does."""
    at = min((i for i in (data.find(b"\n"), data.find(b"\r")) if i >= 0), default=-1)
    if at < 0:
        return b"\n"
    return b"\r\n" if data[at : at + 2] == b"\r\n" else data[at : at + 1]


def indentation(data: bytes, place: int) -> bytes:
    """Returns the blanks at the beginning of a line, up to a byte; nothing after text."""
    text = data[line_start(data, place) : place]
    return b"" if text.strip() else text


class Literals:
    """Job row of a literal, by the place of its first number.

    Args:
        starts: For each file, the first byte of the first number of its rows, -1 without.
    """

    def __init__(self, starts: Sequence[IntArray]) -> None:
        self._first: list[int] = [0, *np.cumsum([len(each) for each in starts]).tolist()]
        orders = [np.argsort(each, kind="stable") for each in starts]
        self._order: list[list[int]] = [order.tolist() for order in orders]
        pairs = zip(starts, orders, strict=True)
        self._sorted: list[list[int]] = [each[order].tolist() for each, order in pairs]

    def row(self, file: int, begin: int, end: int) -> int:
        """Returns the job row whose numbers begin between two bytes, ``UNKNOWN`` if none does."""
        places = self._sorted[file]
        at = bisect_left(places, begin)
        if at < len(places) and places[at] < end:
            return self._first[file] + self._order[file][at]
        return UNKNOWN


def pose_in(insertion: Insertion, row: int) -> tuple[Array, Array]:
    """Returns position (3,) m and rotation (3, 3) of one row."""
    return insertion.position[row], insertion.rotation[row]
