"""The moves of a job, and the targets to insert into them.

A program is columns of targets in file order; a move is the path to a target from the one before
it. Only the dialect, which reads the statements, determines the target before, and whether more of
them may be inserted between. Rows here are *job rows*: those of the first program of a job, then
those of the second, and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Protocol

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.explained import Explained
from robotrue.errors import ShapeError
from robotrue.program.program import Motion, Program


class Obstacle(Explained):
    """Why no target may be inserted into a move; 0 means it may."""

    NONE = 0, "may be split"
    START = 1, "its start is uncertain"
    SHARED = 2, "its target is used by several moves"
    LOOP = 3, "it is in a loop"
    COMPUTED = 4, "its target is computed, or chosen by a computed number"
    TIMED = 5, "its time is given, not its speed"
    EVENT = 6, "an output or a trigger is tied to it"
    FRAMES = 7, "it begins in another work frame or with another tool"
    EXTERNAL = 8, "an external axis moves along"
    BLEND = 9, "its blend would reach beyond a part of it"
    FORM = 10, "a statement of this form is not repeated"


@dataclass(frozen=True, slots=True, kw_only=True)
class Moves(Columns):
    """k straight and circular moves of a job, in the order of the text.

    Attributes:
        start: (k,) job row the move begins at, -1 where that is not certain.
        via: (k,) job row of the auxiliary point of an arc, -1 for a straight move.
        end: (k,) job row it ends at.
        line: (k,) one-based line of the motion in the file that holds the motions.
        obstacle: (k,) :class:`Obstacle`.
        across: (k,) axis (0, 1, 2) of the work frame across the plane that an arc cannot leave: it
            is split into lines; -1 for lines and for arcs that go through any three points. Empty
            if there are none of the first.
        spans: The dialect's own table of byte positions; opaque to everyone else.
    """

    start: Annotated[IntArray, Column("n")]
    via: Annotated[IntArray, Column("n")]
    end: Annotated[IntArray, Column("n")]
    line: Annotated[IntArray, Column("n")]
    obstacle: Annotated[IntArray, Column("n")]
    across: Annotated[IntArray, Column("n", fill=-1)] = EMPTY
    spans: Any = None

    def __len__(self) -> int:
        return len(self.end)

    @property
    def circular(self) -> BoolArray:
        """(k,) which are arcs."""
        return np.asarray(self.via >= 0)

    @property
    def bending(self) -> BoolArray:
        """(k,) which are arcs that are split into shorter arcs."""
        return np.asarray((self.via >= 0) & (self.across < 0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Insertion(Columns):
    """m targets to insert into moves, each after the start of its move and those before it here.

    A straight move gets ``LIN`` targets, and so does an arc that cannot leave its plane; it becomes
    straight moves, its own last part, too. Another arc gets pairs of ``ARC_VIA`` and ``ARC_END``;
    its own end stays and its own auxiliary point serves the last of the shorter arcs (moved there
    by a :class:`~robotrue.program.program.Replacement`, not here).

    Attributes:
        move: (m,) the move each belongs to, not falling.
        motion: (m,) :class:`~robotrue.program.program.Motion`.
        position: (m, 3) m, in the work frame of the end of the move.
        rotation: (m, 3, 3) likewise.
        words: (m, w) configuration words; ``NO_WORD`` takes the one of the end of the move.
    """

    move: Annotated[IntArray, Column("n")]
    motion: Annotated[IntArray, Column("n")]
    position: Annotated[Array, Column("n 3", unit="m")]
    rotation: Annotated[Array, Column("n 3 3")]
    words: Annotated[IntArray, Column("n w")]

    def _check_rules(self) -> None:
        """Checks the order of the text, and that the motions can be inserted."""
        if (np.diff(self.move) < 0).any():
            raise ShapeError("the moves of an insertion fall, expected the order of the text.")
        known = (Motion.LIN, Motion.ARC_VIA, Motion.ARC_END)
        if not np.isin(self.motion, known).all():
            raise ShapeError("an insertion holds LIN, ARC_VIA and ARC_END targets only.")

    def __len__(self) -> int:
        return len(self.move)


class Inserter(Protocol):
    """Inserts targets into programs of a dialect: a leaf file next to its writer."""

    def moves(self, job: Sequence[Program]) -> Moves:
        """Returns the moves of a job from its statements."""
        ...

    def insert(
        self, job: Sequence[Program], moves: Moves, insertion: Insertion
    ) -> tuple[bytes, ...]:
        """Returns the bytes of every program of the job with the targets inserted.

        The words of the move besides its target are repeated for each; where the move has no word
        for continuous motion, inserted ones get one.

        Raises:
            ShapeError: A move with an obstacle, or a value that cannot be written.
        """
        ...


def job_rows(job: Sequence[Program]) -> IntArray:
    """Returns the first job row of every program, and after the last (p + 1,)."""
    return np.concatenate([[0], np.cumsum([len(program) for program in job])]).astype(np.int64)
