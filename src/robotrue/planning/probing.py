"""Which feature to touch next, and in which posture, so that the machined points are known best.

A touch tells about the arm and about the part's frame together, and so do the machined points: the
planner works on their joint belief (:mod:`robotrue.calibration.machined`). For a run compensated by
the estimate everything is linear and known beforehand: what a touch is worth does not depend on its
result. For a run with an unchanged model see :mod:`robotrue.planning.probing_frame`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.belief import Belief, with_nuisances
from robotrue.calibration.machined import tip_columns, uncarried
from robotrue.calibration.model import Query
from robotrue.calibration.update import carry_residual
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet
from robotrue.planning.criteria import exchange_poses, greedy
from robotrue.robot.statics import NO_LOAD, Load

Goal: TypeAlias = Literal["mean", "worst"]
GOALS: Final = ("mean", "worst")
FACTOR: Final = 2.0
"""Standard uncertainty of a machined group over that at the touches, from which it is not covered.
An arm of its type errs 5 to 10 times as much on a side that was not touched as on one that was."""
REWEIGHTED: Final = 6
POWER: Final = 1.0
"""Plans made for the worst point, and the power with which weights grow where the last one left
most."""
ROUGH: Final = 0.02
ROUGH_TURN: Final = 0.04
"""m and rad, by which a frame may be off before the first touch. Loose beside any arm, and not so
loose that the exchange of single touches, which takes them back, loses its digits."""
MOTIONS: Final = (
    *(f"shift along {axis}" for axis in "xyz"),
    *(f"turn about {axis}" for axis in "xyz"),
)
UNFIXED: Final = 0.1
"""Share of a frame's prior sd that is left in some direction where touches do not fix it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Machining(Columns):
    """m postures in which the part will be machined.

    Attributes:
        group: (m) name of the side or posture each belongs to.
        point: (m, 3) m in part.
        joints: (m, dof) rad, commanded.
        part: (m,) number of the frame the point belongs to.
        load: Payload and process force, one row or m rows.
        T_flange_tool: (4, 4) the cutting point; None is the touching tip itself.
    """

    group: Annotated[tuple[str, ...], Column("n")]
    point: Annotated[Array, Column("n 3", unit="m")]
    joints: Annotated[Array, Column("n dof", unit="rad")]
    part: Annotated[IntArray, Column("n")]
    load: Load = NO_LOAD
    T_flange_tool: Array | None = None

    def _check_rules(self) -> None:
        """Needs a posture.

        Raises:
            ShapeError: No posture at all.
        """
        if not self.group:
            raise ShapeError("no machined posture, expected one or more.")

    def __len__(self) -> int:
        return len(self.group)

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups in the order in which they come."""
        return tuple(dict.fromkeys(self.group))

    @property
    def query(self) -> Query:
        """The postures, as the uncertainty of machined points asks for them."""
        return Query(joints=self.joints, load=self.load, T_flange_tool=self.T_flange_tool)

    def members(self, name: str) -> IntArray:
        """Returns the rows of a group."""
        return np.flatnonzero(np.array([g == name for g in self.group]))


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingTask:
    """What is believed before the first touch, what can be touched, and what will be machined.

    Attributes:
        belief: Of the arm with the touching tip as its tool; no frames yet.
        T_base_part: (4, 4) of every part, roughly.
        candidates: Touches that can be made, with their joints as planned.
        machining: Where it counts.
        touch_sigma: m per axis: probe, surface, hand.
        touch_load: On the flange while touching, one row.
    """

    belief: Belief
    T_base_part: Mapping[int, Array]
    candidates: ProbingSet
    machining: Machining
    touch_sigma: float
    touch_load: Load = NO_LOAD

    def __post_init__(self) -> None:
        """Checks that all belong together.

        Raises:
            ConfigurationError: A belief with frames, a sigma below zero, candidates without joints.
            ShapeError: Joints of another arm.
        """
        if self.belief.nuisances:
            raise ConfigurationError("the belief before touching already has frames.")
        if not 0.0 <= self.touch_sigma < np.inf:
            raise ConfigurationError(
                f"touch sigma {self.touch_sigma * 1e3:g} mm, expected 0 or more."
            )
        if not self.candidates.has_joints:
            raise ConfigurationError("candidate touches need joints.", hint="find their postures.")
        for joints in (self.candidates.joints, self.machining.joints):
            if joints.shape[1] != self.belief.robot.dof:
                raise ShapeError(
                    f"{joints.shape[1]} joints for a {self.belief.robot.name} of "
                    f"{self.belief.robot.dof}."
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearTask:
    """The task as the criteria of planning see it: every direction in units of its prior.

    The last six directions of each part are those of its frame.

    Attributes:
        rows: (c, 3, k) whitened rows of the candidates; a touch of a surface fills one of three.
        columns: (m, 3, k) m, what touching can teach about the machined points.
        at_touches: (c, 3, k) m, the same for points machined where a candidate touches.
        visit: m^2 per axis, what differs from visit to visit, of each machined point (m,).
        touch_visit: (c,) m^2, likewise at the candidates.
    """

    rows: Array
    columns: Array
    at_touches: Array
    visit: Array
    touch_visit: Array

    def weight(self, share: Array) -> Array:
        """Returns W (k, k) m^2: mean of G' G over the machined points, with weights (m,)."""
        flat = (self.columns * np.sqrt(share / share.mean())[:, None, None]).reshape(
            -1, self.columns.shape[2]
        )
        return np.asarray(flat.T @ flat / len(self.columns))

    def covariance(self, known: Array) -> Array:
        """Returns the covariance (m, 3, 3) m^2 of the machined points for P (k, k)."""
        spread = self.columns @ known @ np.swapaxes(self.columns, 1, 2)
        return np.asarray(spread + self.visit[:, None, None] * np.eye(3))


def linear_task(task: ProbingTask) -> LinearTask:
    """Returns the task in the coordinates of the criteria."""
    parts = tuple(sorted(task.T_base_part))
    belief = carry_residual(task.belief, np.vstack([task.candidates.joints, task.machining.joints]))
    scale = float(np.sqrt(belief.inflation))  # what the model says of itself, touches aside
    belief = replace(belief, root=belief.root * scale, white=belief.white * scale, inflation=1.0)
    placed = with_nuisances(belief, np.tile(np.repeat([ROUGH, ROUGH_TURN], 3), len(parts)))
    touched = Query(joints=task.candidates.joints, load=task.touch_load)
    seen = tip_columns(placed, touched, T_base_part=task.T_base_part, part=task.candidates.part)
    wanted = tip_columns(
        placed, task.machining.query, T_base_part=task.T_base_part, part=task.machining.part
    )
    seen = seen @ placed.root.T
    scatter = placed.white**2 + placed.repeatability**2
    touch_visit = scatter + uncarried(placed, touched)
    rows = seen / np.sqrt(touch_visit + task.touch_sigma**2)[:, None, None]
    return LinearTask(
        rows=_along_normals(task.candidates, rows),
        columns=wanted @ placed.root.T,
        at_touches=seen,
        visit=scatter + uncarried(placed, task.machining.query),
        touch_visit=touch_visit,
    )


def _along_normals(candidates: ProbingSet, rows: Array) -> Array:
    """Rows (c, 3, k) of which a touch of a surface keeps one, along its normal in part."""
    if (candidates.touched != NO_SURFACE).any():
        raise ConfigurationError(
            "candidates that name a surface cannot be planned.", hint="state normals instead."
        )
    out = rows.copy()
    one = np.flatnonzero(~candidates.full)
    out[one, 0] = np.einsum("ni,nik->nk", candidates.normal[one], rows[one])
    out[one, 1:] = 0.0
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupCover:
    """How well the machined points of one group will be known: 3-D standard uncertainty, rms.

    Attributes:
        name: Of the group.
        postures: How many there are.
        uncertainty: m, after the planned touches.
        worst: m, of its worst point.
        best: m, the least these candidates allow: all of them touched, or a frame for it alone.
        at_touches: m, of points machined where and as the plan touches.
        cure: What would help.
    """

    name: str
    postures: int
    uncertainty: float
    worst: float
    best: float
    at_touches: float
    cure: str

    @property
    def covered(self) -> bool:
        """Whether the touches say about as much of this group as of their own postures."""
        return self.uncertainty <= FACTOR * self.at_touches

    @property
    def warning(self) -> str | None:
        """What to say of a group that is not covered, with its cure; None of one that is."""
        if self.covered:
            return None
        return (
            f"no touch covers {self.name!r}: its points will be known to "
            f"{self.uncertainty * 1e3:.2f} mm, those of touched postures to "
            f"{self.at_touches * 1e3:.2f} mm; {self.cure}."
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbePlan:
    """Touches worth making, in the order of their worth.

    Standard uncertainties are 3-D: the root of the trace of a point's covariance; 95 % of the
    errors are within about 1.6 times that.

    Attributes:
        touches: The chosen candidates.
        row: (n,) their rows among the candidates.
        goal: What was made small.
        mean: (n + 1,) m, rms over the machined points of their standard uncertainty, after 0 .. n
            touches.
        worst: (n + 1,) m, of the worst point.
        spread_mean: (n + 1,) m, rms after as many touches spread evenly over the part.
        covariance: (m, 3, 3) m^2 of each machined point in its part, after the last touch.
        groups: Cover of each group.
        stopped: The tolerance was met before the number of touches asked for.
        notes: What was assumed.
    """

    touches: ProbingSet
    row: IntArray
    goal: Goal
    mean: Array
    worst: Array
    spread_mean: Array
    covariance: Array
    groups: tuple[GroupCover, ...]
    stopped: bool
    notes: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each group that no touch covers."""
        return tuple(w for w in (g.warning for g in self.groups) if w is not None)

    @property
    def uncertainty(self) -> Array:
        """(m,) m, standard uncertainty of each machined point."""
        return np.asarray(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2)))


def plan_touches(
    task: ProbingTask, n: int, *, goal: Goal = "mean", tolerance: float = 0.0
) -> ProbePlan:
    """Returns up to n touches, each the best after those before it.

    The run is taken to be compensated by the estimate these touches will give.

    Args:
        task: Belief, candidates, machined postures.
        n: How many touches at most.
        goal: ``"mean"``: least rms standard uncertainty over the machined points. ``"worst"``:
            least uncertainty of the worst one.
        tolerance: m; the plan stops once that uncertainty is below it.

    Raises:
        ConfigurationError: No such goal, or more touches than candidates.
        ObservabilityError: The touches do not fix the frame of a part.
    """
    if goal not in GOALS:
        raise ConfigurationError(f"goal {goal!r}, expected one of {GOALS}.")
    if not 1 <= n <= len(task.candidates):
        raise ConfigurationError(
            f"{n} touches are asked for, there are {len(task.candidates)} candidates.",
            hint="fewer touches, or more features.",
        )
    linear = linear_task(task)
    chosen = _choose_greedily(linear, spread_touches(task.candidates, n), goal)
    mean, worst, known = trace_order(linear, chosen)
    while (kept := _enough(mean if goal == "mean" else worst, tolerance)) < len(chosen):
        # Chosen anew: as many touches can be better ones.
        fewer = _choose_greedily(linear, spread_touches(task.candidates, kept), goal)
        trial = trace_order(linear, fewer)
        if trial[goal == "worst"][-1] > tolerance:
            chosen = chosen[:kept]
            mean, worst, known = trace_order(linear, chosen)
            break
        chosen, (mean, worst, known) = fewer, trial
    _require_frames(linear, chosen, tuple(sorted(task.T_base_part)))
    spread, _, _ = trace_order(linear, spread_touches(task.candidates, len(chosen)))
    return ProbePlan(
        touches=task.candidates.subset(chosen),
        row=chosen,
        goal=goal,
        mean=mean,
        worst=worst,
        spread_mean=spread,
        covariance=linear.covariance(known),
        groups=_cover(task, linear, chosen, known),
        stopped=len(chosen) < n,
    )


def _choose_greedily(linear: LinearTask, spread: IntArray, goal: Goal) -> IntArray:
    """Rows of as many candidates as spread ones; each adds most to those before it."""
    weight = np.ones(len(linear.columns))
    found, left = np.empty(0, dtype=np.int64), np.inf
    for _ in range(1 if goal == "mean" else REWEIGHTED):
        directions = linear.weight(weight)
        starts = [greedy(linear.rows, directions, len(spread)).chosen, spread]
        trials = [spread] + [
            exchange_poses(linear.rows, directions, start, criterion="I").chosen for start in starts
        ]
        squares = [
            np.trace(linear.covariance(condition_covariance(linear.rows[trial])), axis1=1, axis2=2)
            for trial in trials
        ]
        best = int(np.argmin([weight @ square for square in squares]))
        better, square = trials[best], squares[best]
        if goal == "mean" or square.max() < left:
            found, left = _sort_by_benefit(linear.rows, directions, better), float(square.max())
        weight = weight * (square / square.mean()) ** POWER
    return found


def _sort_by_benefit(rows: Array, weight: Array, chosen: IntArray) -> IntArray:
    """The same touches by worth: the one that is missed least goes to the end, and so on.

    Better at its start than choosing forwards: alone, no two touches say much, three do.
    """
    kept, last = list(chosen), []
    while len(kept) > 1:
        mine = rows[kept]
        known = condition_covariance(mine)
        ahead = mine @ known
        inner = np.eye(3) - ahead @ np.swapaxes(mine, 1, 2)
        missed = np.linalg.solve(inner, ahead @ weight @ np.swapaxes(ahead, 1, 2))
        last.append(kept.pop(int(np.argmin(missed.trace(axis1=1, axis2=2)))))
    return np.array(kept + last[::-1], dtype=np.int64)


def trace_order(linear: LinearTask, order: IntArray) -> tuple[Array, Array, Array]:
    """Returns rms and worst standard uncertainty (n + 1,) m along an order, and the last P."""
    known = np.eye(linear.rows.shape[2])
    mean, worst = [], []
    for k in [-1, *order.tolist()]:
        if k >= 0:
            known = _condition_on(known, linear.rows[k])
        square = np.trace(linear.covariance(known), axis1=1, axis2=2)
        mean.append(np.sqrt(square.mean()))
        worst.append(np.sqrt(square.max()))
    return np.array(mean), np.array(worst), known


def _condition_on(known: Array, rows: Array) -> Array:
    ahead = known @ rows.T
    inner = np.eye(len(rows)) + rows @ ahead
    after = known - ahead @ np.linalg.solve(inner, ahead.T)
    return np.asarray(0.5 * (after + after.T))


def _enough(left: Array, tolerance: float) -> int:
    """How many touches meet the tolerance; all if none does."""
    met = np.flatnonzero(left[1:] <= tolerance)
    return int(met[0]) + 1 if len(met) else len(left) - 1


def _require_frames(linear: LinearTask, chosen: IntArray, parts: tuple[int, ...]) -> None:
    """Passes if the touches would fix every frame by themselves, were the arm known exactly."""
    start = linear.rows.shape[2] - 6 * len(parts)
    for k, part in enumerate(parts):
        rows = linear.rows[chosen, :, start + 6 * k : start + 6 * k + 6].reshape(-1, 6)
        values, vectors = np.linalg.eigh(np.eye(6) + rows.T @ rows)
        if values[0] < 1.0 / UNFIXED**2:
            motion = MOTIONS[int(np.argmax(np.abs(vectors[:, 0])))]
            raise ObservabilityError(
                f"{len(chosen)} touches do not fix the frame of part {part}; most of all the "
                f"{motion} of the part is open.",
                hint="three points that are not on one line, or six touches of surfaces that face "
                "three ways, for each part.",
            )


def spread_touches(candidates: ProbingSet, n: int) -> IntArray:
    """Returns n candidates spread evenly over their points, without regard to what they teach.

    The next is always the farthest from those taken; among postures of one feature the first that
    is left.
    """
    point = np.column_stack([candidates.point, 10.0 * candidates.part])  # parts far from each other
    chosen: list[int] = []
    times = np.zeros(len(candidates), dtype=np.int64)
    # From each feature its postures in turn: none twice before all features came once.
    _, feature = np.unique(np.round(point, 9), axis=0, return_inverse=True)
    feature = feature.reshape(-1)
    near = np.linalg.norm(point - point.mean(axis=0), axis=1)
    free = np.ones(len(candidates), dtype=bool)
    while len(chosen) < n:
        rank = np.where(free, near - 1e3 * times, -np.inf)
        best = int(np.argmax(rank))
        chosen.append(best)
        free[best] = False
        times[feature == feature[best]] += 1
        apart = np.linalg.norm(point - point[best], axis=1)
        near = apart if len(chosen) == 1 else np.minimum(near, apart)
    return np.array(chosen, dtype=np.int64)


def _cover(
    task: ProbingTask, linear: LinearTask, chosen: IntArray, known: Array
) -> tuple[GroupCover, ...]:
    now = np.trace(linear.covariance(known), axis1=1, axis2=2)
    all_told = condition_covariance(linear.rows)
    best = np.trace(linear.covariance(all_told), axis1=1, axis2=2)
    own = linear.at_touches[chosen]
    spread = np.einsum("nik,kl,nil->n", own, known, own) + 3.0 * linear.touch_visit[chosen]
    at_touches = float(np.sqrt(np.median(spread)))
    out = []
    for name in task.machining.groups:
        mine = task.machining.members(name)
        least = float(np.sqrt(best[mine].mean()))
        cure = (
            f"touching every candidate leaves {least * 1e3:.2f} mm: add features that can be "
            "touched in its postures"
        )
        out.append(
            GroupCover(
                name=name,
                postures=len(mine),
                uncertainty=float(np.sqrt(now[mine].mean())),
                worst=float(np.sqrt(now[mine].max())),
                best=least,
                at_touches=at_touches,
                cure="more of these touches would" if least <= FACTOR * at_touches else cure,
            )
        )
    return tuple(out)


def condition_covariance(rows: Array) -> Array:
    """Returns P (k, k) after all of the rows (n, m, k), by their information."""
    flat = rows.reshape(-1, rows.shape[2])
    return np.asarray(np.linalg.inv(np.eye(rows.shape[2]) + flat.T @ flat))
