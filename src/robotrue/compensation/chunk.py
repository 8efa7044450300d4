"""One chunk of a program through the kernels."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from robotrue.compensation.branch_lanes import choose_closed
from robotrue.compensation.branches import Closed
from robotrue.compensation.chunks import Helper, Outcome, Part
from robotrue.compensation.guessed import PARTED, ErrorAt, Others, part_ways, standings
from robotrue.compensation.iterated import Serial, choose_iterated
from robotrue.compensation.lanes import correct
from robotrue.compensation.memory import Aim, Arm, Asked, Space
from robotrue.compensation.pack import Pack
from robotrue.compensation.plan import Plan
from robotrue.compensation.rows import command, enter_base, follow
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route, Status
from robotrue.compensation.stragglers import invert_stragglers
from robotrue.core.arrays import Array, IntArray
from robotrue.program.program import Program
from robotrue.robot.statics import Load

REUSE = 50.0  # rad of joint motion per m of tolerance: at a gradient of 1 mm/rad a twentieth of it
MOST_REUSE = 1e-5  # rad


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """Where the arm is: what one chunk hands to the next. Renewed in place.

    Attributes:
        near: (6,) rad, while joints are chosen.
        joints: (6,) rad, while motions are followed.
        sign: (6,) of the last motion.
        branch: (4,) see :func:`robotrue.compensation.branch_lanes.choose_closed`.
        known: (1,) see :mod:`robotrue.compensation.guessed`.
        space: Working memory.
    """

    near: Array
    joints: Array
    sign: Array
    branch: IntArray
    known: IntArray
    space: Space


def solve_chunk(
    pack: Pack,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    load: Load,
    outcome: Outcome,
    search: Helper,
    others: Others,
    error_at: ErrorAt | None,
    arrival: Arrival,
    part: slice,
) -> Part:
    """Returns nominal joints and approach of the chunk; its results go into ``outcome``."""
    count = part.stop - part.start
    route, tool = np.array(plan.route[part]), np.array(program.tool[part])
    frame, frames = _frames(program, part)
    rotation, position = outcome.rotation[part], outcome.position[part]
    target = np.empty((count, 12))
    enter_base(frames, frame, route, rotation, position, target)
    been = bool(arrival.branch[3])
    nominal = _nominal(
        pack, outcome, search, arrival, part, target, route, tool, settings.max_joint_step
    )
    approach, jump = np.zeros((count, 6)), np.zeros(count, dtype=np.bool_)
    follow(
        nominal, route, been, settings.approach == "path", settings.max_joint_step,
        arrival.joints, arrival.sign, approach, jump,
    )  # fmt: skip
    wanted = (route != Route.SKIP) & (route != Route.PASS) & np.isfinite(nominal[:, 0])
    rows = np.flatnonzero(wanted)
    predicted = partial(_error_at, pack, settings, load, part, target, tool, arrival.space)
    standing = standings(plan.known[part], int(arrival.known[0]))
    part_ways(
        standing, plan.known[part], rows, nominal, approach, partial(_by_row, others, part.start),
        predicted if error_at is None else partial(_by_row, error_at, part.start), settings.alike,
    )  # fmt: skip
    arrival.known[0] = standing[-1]
    outcome.status[part][rows[standing[rows] == PARTED]] = Status.UNCHANGED_CONFIGURATION
    rows = rows[standing[rows] != PARTED]
    asked = Asked(
        target=target,
        nominal=nominal,
        approach=approach,
        route=route,
        mass=_share(load.mass, part),
        com=_share(load.com, part),
        wrench=_share(load.wrench, part),
        code=np.zeros(count, dtype=np.int64),
        found=np.array(nominal),
        told=np.empty((count, 12)),
        before=outcome.before[part],
        after=outcome.after[part],
        singular=outcome.singular[part],
    )
    _invert(pack, settings, asked, rows, tool, arrival.space)
    bounds = np.array([settings.min_shift, settings.max_shift, settings.max_turn])
    command(
        pack.limits, bounds, frames, frame, route, rows, jump, asked.code, target, nominal,
        asked.found, asked.told, asked.before, outcome.status[part], outcome.joints[part],
        asked.after, outcome.shift[part], outcome.turn[part], rotation, position,
    )  # fmt: skip
    return Part(rows=part, nominal=nominal, approach=approach)


def _by_row(of: Callable[..., Array], first: int, rows: IntArray, *columns: Array) -> Array:
    """Asks by the rows of the program what is known by those of the chunk."""
    return of(rows + first, *columns)


def _error_at(
    pack: Pack,
    settings: CompensationSettings,
    load: Load,
    part: slice,
    target: Array,
    tool: IntArray,
    space: Space,
    rows: IntArray,
    joints: Array,
    approach: Array,
) -> Array:
    """Returns the error (m, 3) m that the pack predicts at other joints of some targets."""
    m = len(rows)
    mass, com, wrench = (
        each[rows] if len(each) > 1 else each
        for each in (_share(column, part) for column in (load.mass, load.com, load.wrench))
    )
    asked = Asked(
        target=target[rows],
        nominal=joints,
        approach=approach,
        route=np.full(m, int(Route.LINEAR)),
        mass=mass,
        com=com,
        wrench=wrench,
        code=np.zeros(m, dtype=np.int64),
        found=np.array(joints),
        told=np.empty((m, 12)),
        before=np.full((m, 3), np.nan),
        after=np.full((m, 3), np.nan),
        singular=np.full(m, np.nan),
    )
    _invert(pack, settings, asked, np.arange(m), tool[rows], space)
    return asked.before


def _nominal(
    pack: Pack,
    outcome: Outcome,
    search: Helper,
    arrival: Arrival,
    part: slice,
    target: Array,
    route: IntArray,
    tool: IntArray,
    max_joint_step: float,
) -> Array:
    """Returns the nominal joints (n, 6) rad of the chunk; marks targets out of reach.

    Targets that only the global search reaches get the route that this makes of them.
    """
    out = np.full((len(route), 6), np.nan)
    given, near, branch = outcome.joints[part], arrival.near, arrival.branch
    status = outcome.status[part]
    if np.isfinite(pack.opw[0]):
        closed = Closed(
            lengths=pack.opw,
            sign=pack.opw_sign,
            offset=pack.opw_offset,
            end=pack.opw_end,
            uncoupling=pack.uncoupling,
            coupled=pack.coupled,
            limits=pack.limits,
        )
        choose_closed(closed, target, route, tool, given, near, branch, out)
        status[(route != Route.SKIP) & np.isnan(out[:, 0])] = Status.UNCHANGED_UNREACHABLE
        return out
    serial = Serial(
        chains=np.array([_chain(pack.nominal, end) for end in pack.nominal_end]),
        zero=pack.zero,
        coupling=pack.coupling,
        coupled=pack.coupled,
        length=pack.length,
    )
    row = choose_iterated(serial, target, route, tool, given, near, branch, out, 0)
    while row < len(route):
        joints = search(part.start + row, np.array(near))
        if joints is None:
            status[row], route[row] = Status.UNCHANGED_UNREACHABLE, Route.SKIP
        else:
            given[row] = joints
            jump = branch[3] != 0 and route[row] == Route.LINEAR
            jump = jump and np.abs(joints - near).max() > max_joint_step
            route[row] = Route.PASS if jump else Route.GIVEN
            if jump:
                status[row] = Status.UNCHANGED_BRANCH_JUMP
        row = choose_iterated(serial, target, route, tool, given, near, branch, out, row)
    return out


def _invert(
    pack: Pack,
    settings: CompensationSettings,
    asked: Asked,
    rows: IntArray,
    tool: IntArray,
    space: Space,
) -> None:
    """Inverts the calibrated arm for the rows, one tool after the other."""
    aim = Aim(
        tolerance=settings.tolerance,
        turn_tolerance=settings.turn_tolerance,
        min_singular_value=settings.min_singular_value,
        min_wrist_sine=float(np.sin(settings.min_wrist_angle)),
        reuse=min(REUSE * settings.tolerance, MOST_REUSE),
    )
    for index, mine in _by_tool(tool, rows):
        arm = _arm(pack, index)
        correct(arm, aim, asked, mine, space)
        invert_stragglers(arm, aim, asked, mine, space)


def _by_tool(tool: IntArray, rows: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yields the tools of the rows, and the rows of each."""
    used = tool[rows]
    if len(rows) and (used == used[0]).all():
        yield int(used[0]), rows
        return
    for index in np.unique(used):
        yield int(index), rows[used == index]


def _arm(pack: Pack, tool: int) -> Arm:
    return Arm(
        nominal=_chain(pack.nominal, pack.nominal_end[tool]),
        actual=_chain(pack.actual, pack.actual_end[tool]),
        zero=pack.zero,
        coupling=pack.coupling,
        coupled=pack.coupled,
        dtheta=pack.dtheta,
        gear=pack.gear,
        compliance=pack.compliance,
        backlash=pack.backlash,
        harmonics=pack.harmonics,
        consecutive=pack.consecutive,
        ripple=pack.ripple,
        mass_out=pack.mass_out,
        com=pack.com.ravel(),
        flange=pack.flange,
        gravity=pack.gravity,
        table=pack.table,
        scale=pack.scale,
        length=pack.length,
    )


def _chain(links: Array, end: Array) -> Array:
    return np.array([*links, end]).ravel()


def _frames(program: Program, part: slice) -> tuple[IntArray, Array]:
    """Returns the frame of each target of a chunk (n,), and those frames in base (f, 12)."""
    mine = program.frame[part]
    used, frame = mine[:1], np.zeros(len(mine), dtype=np.int64)
    if (mine != used).any():
        used, frame = np.unique(mine, return_inverse=True)
    frames = program.T_base_frame[np.clip(used, 0, len(program.T_base_frame) - 1)]
    rows = np.concatenate([frames[:, :3, :3].reshape(-1, 9), frames[:, :3, 3]], axis=1)
    return frame.astype(np.int64).reshape(-1), np.ascontiguousarray(rows)


def _share(column: Array, part: slice) -> Array:
    """Returns a writeable copy of a chunk's rows of a load column, or of its only row."""
    return np.array(column[part] if len(column) > 1 else column)
