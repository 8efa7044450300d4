"""Runs the kernels over a program, a chunk at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robotrue.compensation.guessed import GUESSED, KNOWN, ErrorAt, Others
from robotrue.compensation.memory import space
from robotrue.compensation.pack import Pack
from robotrue.compensation.plan import Plan
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.words import NO_WORD
from robotrue.program.program import Program
from robotrue.robot.statics import Load

CHUNK = 1 << 13
"""Targets worked on at a time; only results grow with the program."""

Helper: TypeAlias = Callable[[int, Array], Array | None]
"""Joints (6,) rad of a target near given joints by global search, or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Results of n targets while they are being written; columns as in ``Compensation``.

    Attributes:
        position: (n, 3) m, in the work frame.
        rotation: (n, 9).
        joints: (n, 6) rad.
        status: (n,).
        before: (n, 3) m.
        after: (n, 3) m.
        shift: (n, 3) m.
        turn: (n,) rad.
        singular: (n,).
        covariance: (n, 3, 3) m^2, or empty.
    """

    position: Array
    rotation: Array
    joints: Array
    status: IntArray
    before: Array
    after: Array
    shift: Array
    turn: Array
    singular: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Where the arm is between two targets: all that the next one depends on.

    Attributes:
        near: (6,) rad, joints chosen last.
        joints: (6,) rad, joints driven to last.
        sign: (6,) of the last motion of every joint.
        branch: (4,) see :func:`robotrue.compensation.branch_lanes.choose_closed`.
        begun: (1,) whether there was a target before, reached or not.
        known: (1,) what is known of the configuration, see :mod:`robotrue.compensation.guessed`.
        words: (3,) words of the last target that names its branch, see ``Plan.words``.
    """

    near: Array
    joints: Array
    sign: Array
    branch: IntArray
    begun: BoolArray
    known: IntArray
    words: IntArray

    def copy(self) -> Standing:
        """Returns the same in arrays of its own."""
        return Standing(
            near=np.array(self.near),
            joints=np.array(self.joints),
            sign=np.array(self.sign),
            branch=np.array(self.branch),
            begun=np.array(self.begun),
            known=np.array(self.known),
            words=np.array(self.words),
        )

    def same(self, other: Standing) -> bool:
        """Returns whether both are equal bit for bit."""
        return all(
            getattr(self, name).tobytes() == getattr(other, name).tobytes()
            for name in ("near", "joints", "sign", "branch", "begun", "known", "words")
        )


def at_home(pack: Pack, settings: CompensationSettings) -> Standing:
    """Returns where the arm is before the first target of a program."""
    home = settings.home if len(settings.home) else pack.limits.mean(axis=1)
    return Standing(
        near=np.array(home),
        joints=np.array(home),
        sign=np.zeros(6),
        branch=np.zeros(4, dtype=np.int64),
        begun=np.zeros(1, dtype=np.bool_),
        known=np.array([KNOWN if len(settings.home) else GUESSED]),
        words=np.full(3, NO_WORD),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One chunk that has been solved.

    Attributes:
        rows: The targets of the chunk.
        nominal: (m, 6) rad, nominal joints of the targets.
        approach: (m, 6) sign of the last motion.
    """

    rows: slice
    nominal: Array
    approach: Array


def empty_outcome(program: Program, plan: Plan, *, covariance: bool) -> Outcome:
    """Returns room for the outcome; :func:`begin` fills it chunk by chunk."""
    n = len(program)
    return Outcome(
        position=np.empty((n, 3)),
        rotation=np.empty((n, 9)),
        joints=np.empty((n, 6)),
        status=np.array(plan.status),
        before=np.empty((n, 3)),
        after=np.empty((n, 3)),
        shift=np.empty((n, 3)),
        turn=np.empty(n),
        singular=np.empty(n),
        covariance=np.empty((n if covariance else 0, 3, 3)),
    )


def begin(outcome: Outcome, program: Program, plan: Plan, part: slice) -> None:
    """Writes into ``outcome`` a chunk before anything is solved: its targets as they stand."""
    outcome.position[part] = program.position[part]
    outcome.rotation[part] = program.rotation[part].reshape(-1, 9)
    for unknown in (outcome.joints, outcome.before, outcome.after, outcome.singular):
        unknown[part] = np.nan
    outcome.shift[part], outcome.turn[part] = 0.0, 0.0
    if len(outcome.covariance):
        outcome.covariance[part] = np.nan
    first, last = np.searchsorted(plan.rows, (part.start, part.stop))
    outcome.joints[plan.rows[first:last]] = plan.joints[first:last]


def solve_chunks(
    pack: Pack,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    load: Load,
    outcome: Outcome,
    search: Helper,
    others: Others,
    standing: Standing | None = None,
    error_at: ErrorAt | None = None,
) -> Iterator[Part]:
    """Yields each chunk after its targets were solved into ``outcome``.

    Args:
        pack: The model.
        program: The targets.
        plan: Their treatment.
        settings: Guards and tolerances.
        load: One row or one per target.
        outcome: Renewed in place.
        search: For targets that nothing else reaches.
        others: The other configurations at targets, by their row.
        error_at: Errors that the pack does not hold, by row.
        standing: Where the arm is before the first target, renewed in place; at home if not given.
    """
    from robotrue.compensation.chunk import Arrival, solve_chunk  # compiles: only when needed

    now = standing or at_home(pack, settings)
    arrival = Arrival(
        near=now.near, joints=now.joints, sign=now.sign, branch=now.branch, known=now.known,
        space=space(),
    )  # fmt: skip
    for start in range(0, len(program), CHUNK):
        rows = slice(start, min(start + CHUNK, len(program)))
        begin(outcome, program, plan, rows)
        yield solve_chunk(
            pack, program, plan, settings, load, outcome, search, others, error_at, arrival, rows
        )
