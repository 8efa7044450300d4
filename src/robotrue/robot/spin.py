"""The cheapest way through a grid of rotations about the tool axis, by dynamic programming.

Stations along the path, at each a list of spins, in each of the arm's branches the joints that go
with a spin. A way takes one spin per station and one branch throughout: a straight move cannot
change the branch. It pays ::

    sum over stations of  h (limits + singularities + extra) + (travel * |dq|)^2 / h

with h the length of path between stations, ``limits`` = sum over joints of u^2 / (1 - u^2), u from
-1 at one limit to 1 at the other, ``singularities`` = sum of (w0 / w)^2 over the sine of the wrist,
the sine of the elbow and the wrist point's distance from axis 1, ``extra`` what the caller adds.
Turns of a joint follow from the station before (nearest), beginning in the middle of the limits or
at the caller's joints; a way that would leave the limits or come too near a singularity does not
exist. Where the arm comes from somewhere, ways with its shoulder and elbow go before all others
(the wrist may flip). Equal costs go to the lower branch and the earlier spin, so that equal input
gives equal output.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.rotations import wrap
from robotrue.core.units import DEG
from robotrue.errors import ShapeError
from robotrue.robot.inverse import ClosedArm
from robotrue.robot.model import RobotModel

COMFORT: Final = np.array([np.sin(20.0 * DEG), np.sin(15.0 * DEG), 0.15])
"""w0 of wrist, elbow and shoulder; the last over the length of the stretched arm."""
SHAPES: Final = 4
"""Combinations of shoulder and elbow; the branch number modulo this."""
Stand: TypeAlias = Callable[[Array], tuple[Array, Array | None]]
"""From spins (m, k) rad to joints (m, b, k, 6) rad and what standing there costs besides (m, b, k)
per metre of path, or None."""
_WINDOW: Final = np.arange(-5.0, 6.0)
_FINER: Final = 5.0
MOST_STATIONS: Final = 2000
_STEP: Final = 45.0 * DEG
"""rad a joint may turn between two points of a straight move."""
TRIES: Final = 3
"""How often stations are laid, half as far apart each time, where a way cannot be followed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpinSettings(Columns):
    """Settings for choosing rotations about the tool axis.

    Attributes:
        cutter: (3,) the way from the spindle to the tip, in the tool frame; normalised. KUKA's
            own convention is +x, most CAM posts and this default take +z.
        step: rad between the spins tried first; refined to a 25th of it.
        spacing: m of path between stations.
        travel: m; weight of a radian of joint travel against comfort. Larger is smoother.
        limit_margin: rad kept from every joint limit.
        wrist_margin: rad between axes 4 and 6 that is kept.
        elbow_margin: rad by which the elbow stays bent.
        shoulder_margin: m the wrist point keeps from axis 1.
    """

    cutter: Annotated[Array, Column("3")]
    step: float = 10.0 * DEG
    spacing: float = 0.02
    travel: float = 1.0
    limit_margin: float = 3.0 * DEG
    wrist_margin: float = 3.0 * DEG
    elbow_margin: float = 3.0 * DEG
    shoulder_margin: float = 0.02

    def _check_rules(self) -> None:
        """Normalises the cutter axis.

        Raises:
            ShapeError: An axis of length zero.
        """
        length = float(np.linalg.norm(self.cutter))
        if not length > 0.0:
            raise ShapeError("cutter has length 0, expected a direction in the tool frame.")
        self._set_column("cutter", self.cutter / length)


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Permitted rotations at every station.

    Attributes:
        joints: (m, b, k, 6) rad per station, branch and spin, any turn; NaN where there are none.
        spin: (m, k) rad.
        length: (m,) m of path to each station from the one before; the first is not used.
        circular: The spins go once round, the first follows the last.
        extra: (m, b, k) further cost per metre; infinite where the caller allows no standing.
    """

    joints: Array
    spin: Array
    length: Array
    circular: bool
    extra: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SpinPath:
    """The cheapest way, or how far any got.

    Attributes:
        branch: Number; -1 if no way leads to the end.
        spin: (m,) rad, unwrapped; empty if there is none.
        joints: (m, 6) rad, continuous; empty if there is none.
        cost: Of the way.
        reached: Stations that some way reaches; all of them if there is a way.
    """

    branch: int
    spin: Array
    joints: Array
    cost: float
    reached: int


def best_way(
    robot: RobotModel,
    geometry: ClosedArm,
    grid: Grid,
    settings: SpinSettings,
    *,
    shape: int | None = None,
    near: Array | None = None,
) -> SpinPath:
    """Returns the cheapest way through a grid by the rule in the head of this module.

    Args:
        robot: The nominal arm, for its limits.
        geometry: Of the arm.
        grid: Of the stations, with all eight branches or with one.
        settings: Margins and weights.
        shape: Branch number of the posture the arm comes from; its shoulder and elbow go first.
        near: (6,) rad the turns of the first station are nearest to; the middle of the limits.
    """
    stations, _, spins, _ = grid.joints.shape
    comfort = singular_cost(geometry, grid.joints, settings)
    if grid.extra is not None:
        comfort = comfort + grid.extra
    joints = _first_turn(robot, grid.joints[0], near)
    start = limit_cost(robot, joints, settings) + comfort[0]
    cost = np.where(np.isfinite(start), start * grid.length[1:2].sum(), np.inf)
    before, allowed = _predecessors(grid, settings, spins)
    backs: list[IntArray] = []
    states = [joints]
    if not np.isfinite(cost).any():
        return _no_path(0)
    for k in range(1, stations):
        # (b, ways in, spins, 6): every spin from each spin it may come from
        previous = states[-1][:, before]
        options = previous + wrap(grid.joints[k][:, None] - previous)
        length = max(float(grid.length[k]), 1e-6)
        moved = ((options - previous) ** 2).sum(axis=-1) * settings.travel**2 / length
        stay = limit_cost(robot, options, settings) + comfort[k][:, None]
        total = cost[:, before] + moved + length * stay
        total = np.where(allowed[k] & np.isfinite(total), total, np.inf)
        chosen = np.argmin(total, axis=1)
        cost = np.take_along_axis(total, chosen[:, None], axis=1)[:, 0]
        if not np.isfinite(cost).any():
            return _no_path(k)
        pick = np.broadcast_to(chosen[:, None, :, None], (*cost.shape[:1], 1, spins, 6))
        states.append(np.take_along_axis(options, pick, axis=1)[:, 0])
        backs.append(before[chosen, np.arange(spins)])
    alike = np.arange(len(cost)) % SHAPES == (shape or 0) % SHAPES
    if shape is not None and np.isfinite(cost[alike]).any():
        cost = np.where(alike[:, None], cost, np.inf)
    branch, last = np.unravel_index(int(np.argmin(cost)), cost.shape)
    taken = _trace(backs, int(branch), int(last))
    rows = np.arange(stations)
    return SpinPath(
        branch=int(branch),
        spin=np.unwrap(grid.spin[rows, taken]),
        joints=np.array([states[k][branch, taken[k]] for k in rows]),
        cost=float(cost[branch, last]),
        reached=stations,
    )


def _no_path(reached: int) -> SpinPath:
    joints = np.empty((0, 6))
    return SpinPath(branch=-1, spin=np.empty(0), joints=joints, cost=np.inf, reached=reached)


def refined_way(
    robot: RobotModel,
    geometry: ClosedArm,
    stand: Stand,
    length: Array,
    settings: SpinSettings,
    *,
    shape: int | None = None,
    near: Array | None = None,
) -> SpinPath:
    """Returns the cheapest way over the whole circle, refined twice in a finer window around it.

    Args:
        robot: The nominal arm.
        geometry: Of the arm.
        stand: Joints and further cost at spins.
        length: (m,) as in :class:`Grid`.
        settings: Margins and weights.
        shape: As in :func:`best_way`.
        near: As in :func:`best_way`.
    """
    count = max(round(2.0 * np.pi / settings.step), 4)
    step = 2.0 * np.pi / count
    spin = np.tile(np.arange(count) * step, (len(length), 1))
    way: SpinPath | None = None
    for finer in range(3):
        joints, extra = stand(spin)
        if way is not None:  # only the branch that was found
            joints = joints[:, way.branch : way.branch + 1]
            extra = None if extra is None else extra[:, way.branch : way.branch + 1]
        grid = Grid(joints=joints, spin=spin, length=length, circular=finer == 0, extra=extra)
        shaped = shape if way is None else None
        found = best_way(robot, geometry, grid, settings, shape=shaped, near=near)
        if found.branch < 0:
            return way or found
        way = found if way is None else replace(found, branch=way.branch)
        step /= _FINER
        spin = way.spin[:, None] + step * _WINDOW
    return way or found


def _trace(backs: list[IntArray], branch: int, last: int) -> IntArray:
    taken = [last]
    for back in reversed(backs):
        taken.append(int(back[branch, taken[-1]]))
    return np.array(taken[::-1])


def _predecessors(grid: Grid, settings: SpinSettings, spins: int) -> tuple[IntArray, BoolArray]:
    """Spin each spin may come from (w, k), and whether it may, per station (m, w, k)."""
    stations = len(grid.spin)
    if grid.circular:
        before = (np.arange(spins) + np.array([[0], [-1], [1]])) % spins
        return before, np.ones((stations, 3, spins), dtype=np.bool_)
    before = np.repeat(np.arange(spins)[:, None], spins, axis=1)
    allowed = np.ones((stations, spins, spins), dtype=np.bool_)
    turned = grid.spin[1:, None, :] - grid.spin[:-1, :, None]
    allowed[1:] = np.abs(turned) <= 1.5 * settings.step
    return before, allowed


def _first_turn(robot: RobotModel, joints: Array, near: Array | None = None) -> Array:
    """Joints on the turn nearest to given ones, or to the middle of the limits."""
    middle = robot.limits.mean(axis=1) if near is None else near
    return np.asarray(middle + wrap(joints - middle))


def can_be_taken(
    robot: RobotModel, geometry: ClosedArm, joints: Array, settings: SpinSettings
) -> Array:
    """Returns the cost of standing at joints (..., 6) rad; infinite or NaN where it cannot be."""
    stand = limit_cost(robot, _first_turn(robot, joints), settings)
    return np.asarray(stand + singular_cost(geometry, joints, settings))


def limit_cost(robot: RobotModel, joints: Array, settings: SpinSettings) -> Array:
    """Returns the sum of u^2 / (1 - u^2) over the joints (...).

    Infinite beyond the margin; NaN stays NaN.
    """
    middle = robot.limits.mean(axis=1)
    half = 0.5 * np.diff(robot.limits, axis=1)[:, 0]
    apart = np.abs(joints - middle)
    outside = (apart > half - settings.limit_margin).any(axis=-1)
    u = np.minimum(apart / half, 0.999) ** 2
    return np.asarray(np.where(outside, np.inf, (u / (1.0 - u)).sum(axis=-1)))


def singular_cost(geometry: ClosedArm, joints: Array, settings: SpinSettings) -> Array:
    """Returns the sum of (w0 / w)^2 (...); infinite inside the margins, NaN stays NaN."""
    measure = geometry.singular_measures(joints)
    least = np.array(
        [np.sin(settings.wrist_margin), np.sin(settings.elbow_margin), settings.shoulder_margin]
    )
    scale = COMFORT * np.array([1.0, 1.0, geometry.stretch])
    near = (measure < least).any(axis=-1)
    return np.asarray(
        np.where(near, np.inf, ((scale / np.maximum(measure, 1e-9)) ** 2).sum(axis=-1))
    )


def stations_of(along: Array, spacing: float) -> IntArray:
    """Returns points (m,) about every ``spacing`` m, of those at ``along`` (d,) m of a path.

    First and last are among them.
    """
    cell = np.floor(along / max(spacing, float(along[-1]) / MOST_STATIONS))
    chosen = np.concatenate([[True], cell[1:] > cell[:-1]])
    chosen[-1] = True
    return np.flatnonzero(chosen)


def limit_room(robot: RobotModel, joints: Array) -> Array:
    """Returns the distance (n,) rad to the nearest limit; below zero beyond it."""
    below, above = joints - robot.limits[:, 0], robot.limits[:, 1] - joints
    return np.asarray(np.minimum(below, above).min(axis=1))


def cannot_follow(
    robot: RobotModel, geometry: ClosedArm, joints: Array, settings: SpinSettings
) -> BoolArray:
    """Returns at which points (n,) of a path an arm cannot go on with joints (n, 6) rad.

    Half the margin from limits is enough here: between stations, where spins are interpolated.
    """
    bad = ~np.isfinite(joints).all(axis=1)
    bad |= ~np.isfinite(singular_cost(geometry, joints, settings))
    bad |= ~(limit_room(robot, joints) >= 0.5 * settings.limit_margin)
    bad[1:] |= ~(np.abs(np.diff(joints, axis=0)).max(axis=1) <= _STEP)
    return bad
