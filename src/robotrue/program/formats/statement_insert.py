"""Inserts targets into programs by copies of the statement of a move, the target written out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.move_trail import MoveGroup, Trail, TrailStatement, groups, put_in
from robotrue.program.formats.number_text import Stretch
from robotrue.program.insertion import Insertion, Moves, job_rows
from robotrue.program.program import Program


@dataclass(frozen=True, slots=True)
class MoveCopy:
    """One move that gets targets.

    Attributes:
        job: The programs.
        first: First job row of each of them.
        moves: Of the job.
        insertion: Of the job.
        group: The move and its rows of the insertion.
    """

    job: Sequence[Program]
    first: IntArray
    moves: Moves
    insertion: Insertion
    group: MoveGroup

    @property
    def statement(self) -> TrailStatement:
        """The bytes of the move."""
        return self.group.statement

    @property
    def program(self) -> Program:
        """The program that contains the move."""
        return self.job[self.statement.file]

    @property
    def data(self) -> bytes:
        """Its bytes."""
        return self.program.data

    @property
    def rows(self) -> range:
        """The rows of the insertion."""
        return self.group.rows

    @property
    def line(self) -> int:
        """The one-based line of the move."""
        return int(self.moves.line[self.group.move])

    @property
    def own_start(self) -> tuple[Program, int]:
        """Where the move begins: a program and its row."""
        return self._find(int(self.moves.start[self.group.move]))

    @property
    def own_end(self) -> tuple[Program, int]:
        """Where it ends."""
        return self._find(int(self.moves.end[self.group.move]))

    @property
    def models(self) -> Iterator[tuple[Program, int, int]]:
        """For each row of the insertion the program and the row whose target it is written like."""
        for model, row in self.group.models(self.moves):
            yield *self._find(model), row

    def _find(self, row: int) -> tuple[Program, int]:
        file = int(np.searchsorted(self.first, row, side="right")) - 1
        return self.job[file], row - int(self.first[file])


@dataclass(frozen=True, slots=True, kw_only=True)
class StatementInserter:
    """An :class:`~robotrue.program.insertion.Inserter` that copies statements.

    Attributes:
        read: Adds the moves of a job to a trail.
        copy: Returns the edits that insert the targets of one move, in the file of its statement;
            raises ShapeError for a value that cannot be written.
    """

    read: Callable[[Trail, Sequence[Program]], None]
    copy: Callable[[MoveCopy], list[Stretch]]

    def moves(self, job: Sequence[Program]) -> Moves:
        """Returns the moves of a job."""
        trail = Trail()
        self.read(trail, job)
        return trail.moves()

    def insert(
        self, job: Sequence[Program], moves: Moves, insertion: Insertion
    ) -> tuple[bytes, ...]:
        """Returns the bytes of every program with the targets inserted.

        Raises:
            ShapeError: A move with an obstacle, or a limit of ``copy``.
        """
        first = job_rows(job)
        edits: list[list[Stretch]] = [[] for _ in job]
        for group in groups(moves, insertion):
            edits[group.statement.file] += self.copy(MoveCopy(job, first, moves, insertion, group))
        return tuple(put_in(job, edits))
