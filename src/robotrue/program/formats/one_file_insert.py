"""What puts targets into programs that are one file: a reader of moves and a writer of bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robotrue.errors import ShapeError
from robotrue.program.formats.move_trail import Trail
from robotrue.program.insertion import Insertion, Moves
from robotrue.program.program import Program


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
        """Returns the bytes of the job with the targets put in.

        Raises:
            ShapeError: Several files, or what ``written`` cannot do.
        """
        return (self.written(self._only(job), moves, insertion),)

    def _only(self, job: Sequence[Program]) -> Program:
        if len(job) != 1:
            raise ShapeError(f"{self.called} is one file, {len(job)} are given.")
        return job[0]
