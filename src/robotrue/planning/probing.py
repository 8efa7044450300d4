"""Choice of the next feature to probe and its posture, for least uncertainty of machined points.

A touch depends on the arm and on the part's frame together, and so do the machined points: the
planner works on their joint posterior (:mod:`robotrue.calibration.machined`). For a run compensated
by the estimate everything is linear and known beforehand: the information gain of a touch does not
depend on its result. For a run with an unchanged model see :mod:`robotrue.planning.probing_frame`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.belief import Belief, with_nuisances
from robotrue.calibration.machined import tip_columns, uncarried_variance
from robotrue.calibration.model import Query
from robotrue.calibration.update import carry_residual
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet
from robotrue.planning.criteria import exchange_poses, greedy
from robotrue.planning.plan_defaults import GOAL
from robotrue.planning.probing_plan import (
    GOALS,
    MORE_FEATURES,
    Goal,
    ProbePlan,
    TouchPosterior,
    spread_touches,
)
from robotrue.robot.statics import NO_LOAD, Load

ROUGH: Final = 0.02
ROUGH_TURN: Final = 0.04
"""m and rad, by which a frame may be off before the first touch. Wide compared with any arm, but
not so wide that the exchange of single touches, which subtracts them, loses its digits."""
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
    def groups(self) -> dict[str, IntArray]:
        """Rows of every group by its name, in the order in which they come."""
        names = np.array(self.group)
        return {name: np.flatnonzero(names == name) for name in dict.fromkeys(self.group)}

    @property
    def query(self) -> Query:
        """The postures, as inputs of the uncertainty of machined points."""
        return Query(joints=self.joints, load=self.load, T_flange_tool=self.T_flange_tool)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingTask:
    """Prior belief, candidate probing points, and machined points of a probing task.

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


def plan_touches(
    task: ProbingTask, n: int, *, goal: Goal = GOAL, tolerance: float = 0.0
) -> ProbePlan:
    """Returns up to n touches, each the best after those before it.

    The run is taken to be compensated by the estimate these touches will give.

    Args:
        task: Belief, candidates, machined postures.
        n: Largest number of touches.
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
            f"{n} touches are requested, there are {len(task.candidates)} candidates.",
            hint="fewer touches, or more features.",
        )
    linear = linear_task(task)
    plan = linear.plan(task.machining.groups, n, goal, tolerance)
    _require_frames(linear, plan.row, tuple(sorted(task.T_base_part)))
    return plan


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearTask(TouchPosterior):
    """The task as the criteria of planning see it: every direction in units of its prior.

    The last six directions of each part are those of its frame.

    Attributes:
        rows: (c, 3, k) whitened rows of the candidates; a touch of a surface fills one of three.
        columns: (m, 3, k) m, what touching can teach about the machined points.
        at_touches: (c, 3, k) m, the same for points machined where a candidate touches.
        visit: m^2 per axis, what differs from visit to visit, of each machined point (m,).
        touch_visit: (c,) m^2, likewise at the candidates.
    """

    rows: Annotated[Array, Column("c 3 k")]
    columns: Annotated[Array, Column("m 3 k", unit="m")]
    at_touches: Annotated[Array, Column("c 3 k", unit="m")]
    visit: Annotated[Array, Column("m", unit="m^2")]
    touch_visit: Annotated[Array, Column("c", unit="m^2")]

    def weight(self, share: Array) -> Array:
        """Returns W (k, k) m^2: mean of G' G over the machined points, with weights (m,)."""
        flat = (self.columns * np.sqrt(share / share.mean())[:, None, None]).reshape(
            -1, self.columns.shape[2]
        )
        return np.asarray(flat.T @ flat / len(self.columns))

    def condition(self, chosen: IntArray) -> Array:
        """Returns P (k, k) after candidates, by their information."""
        flat = self.rows[chosen].reshape(-1, self.rows.shape[2])
        return np.asarray(np.linalg.inv(np.eye(flat.shape[1]) + flat.T @ flat))

    def covariance(self, chosen: IntArray) -> Array:
        """Returns the covariance (m, 3, 3) m^2 of the machined points after candidates."""
        spread = self.columns @ self.condition(chosen) @ np.swapaxes(self.columns, 1, 2)
        return np.asarray(spread + self.visit[:, None, None] * np.eye(3))

    def _search(self, n: int, weight: Array) -> IntArray:
        """The best of spread touches, and of exchanges from them and from greedy ones."""
        directions, spread = self.weight(weight), spread_touches(self.candidates, n)
        starts = [greedy(self.rows, directions, n).chosen, spread]
        trials = [spread] + [
            exchange_poses(self.rows, directions, start).chosen for start in starts
        ]
        return min(trials, key=lambda trial: float(weight @ self.squares(trial)))

    def _losses(self, chosen: IntArray, weight: Array) -> Array:
        mine = self.rows[chosen]
        ahead = mine @ self.condition(chosen)
        inner = np.eye(3) - ahead @ np.swapaxes(mine, 1, 2)
        lost = np.linalg.solve(inner, ahead @ self.weight(weight) @ np.swapaxes(ahead, 1, 2))
        return np.asarray(lost.trace(axis1=1, axis2=2))

    def _uncertainty_at_touches(self, chosen: IntArray) -> float:
        own = self.at_touches[chosen]
        spread = np.einsum("nik,kl,nil->n", own, self.condition(chosen), own)
        return float(np.sqrt(np.median(spread + 3.0 * self.touch_visit[chosen])))

    def _best_for(self, machined: IntArray, n: int, goal: Goal) -> tuple[float, str, str]:
        square = self.squares(np.arange(len(self.rows)))
        least = float(np.sqrt(square[machined].mean()))
        most = f"touching every candidate leaves {least * 1e3:.2f} mm: {MORE_FEATURES}"
        return least, "more of these touches reduce it", most


def linear_task(task: ProbingTask) -> LinearTask:
    """Returns the task in the coordinates of the criteria."""
    parts = tuple(sorted(task.T_base_part))
    belief = carry_residual(task.belief, np.vstack([task.candidates.joints, task.machining.joints]))
    scale = float(np.sqrt(belief.inflation))  # inflation stated by the model, without touches
    belief = replace(belief, root=belief.root * scale, white=belief.white * scale, inflation=1.0)
    placed = with_nuisances(belief, np.tile(np.repeat([ROUGH, ROUGH_TURN], 3), len(parts)))
    touched = Query(joints=task.candidates.joints, load=task.touch_load)
    seen = tip_columns(placed, touched, T_base_part=task.T_base_part, part=task.candidates.part)
    wanted = tip_columns(
        placed, task.machining.query, T_base_part=task.T_base_part, part=task.machining.part
    )
    seen = seen @ placed.root.T
    scatter = placed.white**2 + placed.repeatability**2
    touch_visit = scatter + uncarried_variance(placed, touched)
    rows = seen / np.sqrt(touch_visit + task.touch_sigma**2)[:, None, None]
    return LinearTask(
        candidates=task.candidates,
        rows=_along_normals(task.candidates, rows),
        columns=wanted @ placed.root.T,
        at_touches=seen,
        visit=scatter + uncarried_variance(placed, task.machining.query),
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
