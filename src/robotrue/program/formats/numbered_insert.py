"""Insertion of targets into Yaskawa jobs and Fanuc programs: the shared part.

Both keep positions by number apart from the moves. An arc is either one statement with two
positions, or two statements of a run (MOVC, A) with one each. Their jobs are one file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.program.formats.move_trail import (
    UNKNOWN,
    Trail,
    TrailStatement,
    repeat_statement,
)
from robotrue.program.formats.number_text import restyle
from robotrue.program.insertion import Insertion, Moves, Obstacle
from robotrue.program.program import Program

_LEAST: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One statement that moves to one position.

    Attributes:
        row: Of the position, ``UNKNOWN`` if it is none.
        line: One-based.
        begin: First byte of the statement.
        target: First byte of the position's name.
        target_end: Its end.
        end: End of the statement.
        obstacle: Why it cannot be repeated.
    """

    row: int
    line: int
    begin: int
    target: int
    target_end: int
    end: int
    obstacle: Obstacle = Obstacle.NONE


@dataclass(slots=True)
class Run:
    """A run of moves along arcs: straight to the first, then two positions to an arc."""

    trail: Trail
    steps: list[Step] = field(default_factory=list)
    there: bool = False

    def turn(self) -> None:
        """One arc ends at the last position and the next begins there."""
        last = self.steps[-1:]
        self.close()
        self.steps, self.there = last, bool(last)

    def add(self, step: Step) -> None:
        """Continues the run."""
        self.steps.append(step)

    def close(self) -> None:
        """Ends the run."""
        for number, step in enumerate(self.steps):
            if number == 0:
                if not self.there:
                    self._straight(step)
            elif number % 2 == 0:
                self._arc(self.steps[number - 1], step)
        if len(self.steps) > 1 and len(self.steps) % 2 == 0:
            self.trail.arrive(self.steps[-1].row)  # half an arc: how it runs is not documented
            self.trail.lose()
        self.steps, self.there = [], False

    def _straight(self, step: Step) -> None:
        s = TrailStatement(0, step.begin, -1, -1, step.target, step.target_end, step.end)
        # A copy would be one more point of the run and make other arcs of it.
        self.trail.move(UNKNOWN, step.row, step.line, s, step.obstacle or Obstacle.FORM)

    def _arc(self, via: Step, end: Step) -> None:
        s = TrailStatement(
            0, via.begin, via.target, via.target_end, end.target, end.target_end, via.end, end.begin
        )
        obstacle = via.obstacle or end.obstacle
        self.trail.move(via.row, end.row, end.line, s, obstacle)


def copy_statements(
    data: bytes, s: TrailStatement, names: Sequence[bytes], end: int
) -> list[bytes]:
    """Returns the statement of a move once for each new position, or pair of an arc.

    Args:
        data: The file.
        s: The statement; ``other`` is the begin of the second one of an arc of a run.
        names: Of the positions.
        end: End of that second statement.
    """
    if s.other < 0:
        return repeat_statement(data, s, names)
    around = (
        (data[s.begin : s.via], data[s.via_end : s.end]),
        (data[s.other : s.target], data[s.target_end : end]),
    )
    return [around[k % 2][0] + name + around[k % 2][1] for k, name in enumerate(names)]


def new_numbers(program: Program, row: int, position: Array, rotation: Array) -> list[bytes]:
    """Returns X Y Z in mm and the turns about X Y Z in deg, in the style of a row's numbers."""
    tokens = program.spans.tokens
    near = tokens.value[row, :2:-1] * DEG
    abc = abc_from_matrix(rotation, near=near) / DEG
    values = [*(position / MM).tolist(), *abc[::-1].tolist()]
    out = []
    for start, size, value in zip(tokens.start[row], tokens.length[row], values, strict=True):
        token = program.data[int(start) : int(start + size)]
        out.append(restyle(token, value, least=_LEAST))
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class OneFileInserter:
    """An :class:`~robotrue.program.insertion.Inserter` of a dialect whose jobs are one file.

    Attributes:
        called: What such a file is called in messages.
        read: Adds the moves of a program to a trail.
        written: Bytes of a program with the targets of an insertion put into its moves; raises
            ShapeError for a move with an obstacle, a value that cannot be written, or no number
            left.
    """

    called: str
    read: Callable[[Trail, Program], None]
    written: Callable[[Program, Moves, Insertion], bytes]

    def moves(self, job: Sequence[Program]) -> Moves:
        """Returns the moves of a job.

        Raises:
            ShapeError: Several files.
        """
        trail = Trail()
        self.read(trail, self._only(job))
        return trail.moves()

    def insert(
        self, job: Sequence[Program], moves: Moves, insertion: Insertion
    ) -> tuple[bytes, ...]:
        """Returns the bytes of the job with the targets inserted.

        Raises:
            ShapeError: Several files, or a limit of ``written``.
        """
        return (self.written(self._only(job), moves, insertion),)

    def _only(self, job: Sequence[Program]) -> Program:
        if len(job) != 1:
            raise ShapeError(f"{self.called} is one file, {len(job)} are given.")
        return job[0]
