"""Runs the kernels over a program, a chunk at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robotrue.compensation.pack import Pack
from robotrue.compensation.plan import Plan
from robotrue.compensation.scratch import scratch
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route, Status
from robotrue.core.arrays import Array, IntArray
from robotrue.program.program import Program
from robotrue.robot.statics import Load

CHUNK = 1 << 15
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
    """Returns the outcome before anything is solved: all targets as they stand."""
    n = len(program)
    joints = np.full((n, 6), np.nan)
    joints[plan.rows] = plan.joints
    return Outcome(
        position=np.array(program.position),
        rotation=np.array(program.rotation).reshape(n, 9),
        joints=joints,
        status=np.array(plan.status),
        before=np.full((n, 3), np.nan),
        after=np.full((n, 3), np.nan),
        shift=np.zeros((n, 3)),
        turn=np.zeros(n),
        singular=np.full(n, np.nan),
        covariance=np.full((n if covariance else 0, 3, 3), np.nan),
    )


def solve_chunks(
    pack: Pack,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    load: Load,
    outcome: Outcome,
    search: Helper,
) -> Iterator[Part]:
    """Yields each chunk after its targets were solved into ``outcome``."""
    from robotrue.compensation import solve as kernel  # compiles: only when needed

    guard = kernel.Guard(
        tolerance=settings.tolerance,
        turn_tolerance=settings.turn_tolerance,
        max_shift=settings.max_shift,
        max_turn=settings.max_turn,
        min_shift=settings.min_shift,
        min_singular_value=settings.min_singular_value,
        min_wrist_sine=float(np.sin(settings.min_wrist_angle)),
        max_joint_step=settings.max_joint_step,
        follow_approach=settings.approach == "path",
    )
    home = settings.home if len(settings.home) else pack.limits.mean(axis=1)
    state = kernel.State(
        joints=np.array(home), approach=np.zeros(6), branch=np.zeros(4, dtype=np.int64)
    )
    work = scratch(pack)
    frames = np.array(program.T_base_frame)
    frames = np.concatenate([frames[:, :3, :3].reshape(-1, 9), frames[:, :3, 3]], axis=1)
    for start in range(0, len(program), CHUNK):
        part = slice(start, min(start + CHUNK, len(program)))
        count = part.stop - part.start
        rows = kernel.Rows(
            position=outcome.position[part],
            rotation=outcome.rotation[part],
            joints=outcome.joints[part],
            route=np.array(plan.route[part]),
            frame=np.array(program.frame[part]),
            tool=np.array(program.tool[part]),
            frames=frames,
            mass=_share(load.mass, part),
            com=_share(load.com, part),
            wrench=_share(load.wrench, part),
            status=outcome.status[part],
            before=outcome.before[part],
            after=outcome.after[part],
            shift=outcome.shift[part],
            turn=outcome.turn[part],
            nominal=np.full((count, 6), np.nan),
            approach=np.zeros((count, 6)),
            singular=outcome.singular[part],
        )
        row = kernel.solve_rows(pack, guard, rows, state, work, 0)
        while row < count:
            been = state.branch[3] != 0
            joints = search(start + row, np.array(state.joints))
            if joints is None:
                rows.status[row], rows.route[row] = Status.UNCHANGED_UNREACHABLE, Route.SKIP
            else:
                rows.joints[row] = joints
                step = np.abs(joints - state.joints).max()
                jump = been and rows.route[row] == Route.LINEAR and step > guard.max_joint_step
                rows.route[row] = Route.PASS if jump else Route.GIVEN
                if jump:
                    rows.status[row] = Status.UNCHANGED_BRANCH_JUMP
            row = kernel.solve_rows(pack, guard, rows, state, work, row)
        yield Part(rows=part, nominal=rows.nominal, approach=rows.approach)


def _share(column: Array, part: slice) -> Array:
    """Returns a writeable copy of a chunk's rows of a load column, or of its only row."""
    return np.array(column[part] if len(column) > 1 else column)
