"""Plan of poses to measure: choice, order, and expected accuracy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.settings import FitSettings
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.progress import Progress, unheard
from robotrue.core.regions import Region
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ReachError
from robotrue.planning.arm_scene import Scene, scene_of
from robotrue.planning.candidates import draw_candidates, nothing_left, reachable_in, usable
from robotrue.planning.criteria import CRITERIA, Choice, exchange_poses, greedy, passes
from robotrue.planning.expectation import (
    RANDOM,
    ExpectedAccuracy,
    predict_accuracy,
)
from robotrue.planning.information import (
    LinearModel,
    Postures,
    UnmodelledErrors,
    WorkErrorPrior,
    after_fit,
    before_measuring,
)
from robotrue.planning.order import short_order, travel
from robotrue.planning.plan_defaults import CANDIDATES, CRITERION, SEED, Criterion
from robotrue.robot.statics import Load

Approach: TypeAlias = Literal["one side", "as it comes"]
APPROACHES: Final = ("one side", "as it comes")
LEAST: Final = 4
"""Poses: even base and tool need as many."""
EVALUATED: Final = 200
"""Postures at most at which the accuracy is evaluated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """Settings of a plan of poses.

    Attributes:
        criterion: ``"I"``: least mean variance where the arm will work. ``"D"``: best determined
            parameters.
        candidates: Number of usable postures to choose from.
        within: Where the reflector may be while measuring; anywhere if not given.
        work: Where the arm will work, any posture there; the candidates' own range if not given.
        margin: rad, kept from the joint limits; also room for the pre-positions.
        clearance: m, kept from obstacles and from the arm itself.
        approach: ``"one side"``: every pose is entered from a pre-position from which every joint
            moves in its positive sense. ``"as it comes"``: straight from the pose before.
        step_back: rad, each joint's move from the pre-position.
        enough: m; the plan stops when the next pose lowers the expected rms error by less.
        loads: States of payload and wrench that can be measured; empty is the cell's payload.
        seed: Of the candidates and of the random plans for comparison.
        fit: Priors and noise of the fit that will follow; the cell's if not given.
        unmodelled: Sizes of what the linear model leaves out.
    """

    criterion: Criterion = CRITERION
    candidates: int = CANDIDATES
    within: Region | None = None
    work: Region | None = None
    margin: float = 5.0 * DEG
    clearance: float = 0.02
    approach: Approach = "one side"
    step_back: float = 3.0 * DEG
    enough: float = 0.0
    loads: tuple[Load, ...] = ()
    seed: int = SEED
    fit: FitSettings | None = None
    unmodelled: UnmodelledErrors = field(default_factory=UnmodelledErrors)

    def __post_init__(self) -> None:
        """Refuses what cannot be."""
        if self.criterion not in CRITERIA:
            raise ConfigurationError(f"criterion {self.criterion!r}, expected one of {CRITERIA}.")
        if self.approach not in APPROACHES:
            raise ConfigurationError(f"approach {self.approach!r}, expected one of {APPROACHES}.")
        for name in ("margin", "clearance", "step_back", "enough"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ConfigurationError(f"{name} {getattr(self, name)}, expected 0 or more.")
        if any(len(load.mass) != 1 for load in self.loads):
            raise ConfigurationError("each load state is one load, not one per pose.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PosePlan(Columns):
    """n poses in the order in which they are to be measured.

    Attributes:
        joints: (n, dof) rad.
        pre: (n, dof) rad, the pre-position of each; (0, dof) where poses are entered from any
            direction.
        approach: (n, dof) sign of the last motion of each joint into the pose.
        row: (n,) index into the candidates, as drawn or as given.
        load: (n,) index into ``loads``.
        loads: The load states; one that is the cell's payload where none were stated.
        position: (n, 3) m, the reflector as the controller computes it, in base.
        rank: (n,) order of choice; 0 has the highest information gain.
        expected: Accuracy against number of poses, in the order of choice.
        criterion: Optimised criterion.
        candidates: Number of usable candidates, without load states.
        drawn: Number of postures drawn for them.
        rejected: (reason, count) of the others.
        travel: rad, sum of the largest joint moves, in this order.
        travel_as_chosen: rad, the same in the order of choice.
        stopped: The plan has fewer poses than requested: the next would gain less than ``enough``.
        seed: Of the candidates.
        notes: Assumptions and missing checks, one sentence each.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    pre: Annotated[Array, Column("_ dof", unit="rad")]
    approach: Annotated[Array, Column("n dof")]
    row: Annotated[IntArray, Column("n")]
    load: Annotated[IntArray, Column("n")]
    loads: tuple[Load, ...]
    position: Annotated[Array, Column("n 3", unit="m")]
    rank: Annotated[IntArray, Column("n")]
    expected: ExpectedAccuracy
    criterion: Criterion
    candidates: int
    drawn: int
    rejected: tuple[tuple[str, int], ...]
    travel: float
    travel_as_chosen: float
    stopped: bool
    seed: int
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.joints)


def plan_poses(
    cell: Cell,
    n: int,
    *,
    settings: PlanSettings | None = None,
    model: ErrorModel | None = None,
    candidates: Array | None = None,
    work: Postures | None = None,
    T_flange_tool: Array | None = None,
    progress: Progress = unheard,
) -> PosePlan:
    """Returns n informative poses, ordered for short travel.

    Only the cell is used; with a model also its parameters from an earlier calibration, and the
    poses then add most to it.

    Args:
        cell: Robot, reflector, instrument, surroundings.
        n: Largest number, load states counted.
        settings: See :class:`PlanSettings`.
        model: A calibration of this arm that the new poses are to improve.
        candidates: (c, dof) rad postures to choose from instead of drawn ones; those that cannot
            be measured are left out.
        work: Postures in which the arm will work, instead of ``settings.work``.
        T_flange_tool: (4, 4) the point whose accuracy counts there; the reflector if not given.
        progress: Called with step and progress.

    Raises:
        ConfigurationError: Fewer than 4 poses, or an invalid cell.
        ReachError: No pose can be measured, or fewer candidates than poses.
        ModelMismatchError: A model of another arm.
    """
    settings = PlanSettings() if settings is None else settings
    _require_poses(n, model)
    meter = _Meter(progress, n)
    meter.at("drawing postures", 0)
    scene = scene_of(cell, clearance=settings.clearance)
    joints, index, drawn, rejected = _choices(scene, n, settings, candidates)
    known = _linearise(cell, settings, model)
    loads = settings.loads or (known.settings.payload,)
    _require_candidates(n, len(joints), len(loads))
    rows = np.concatenate([known.rows(_visits(joints, load, settings)) for load in loads])
    place = _where(known, joints, settings, work, loads[0])
    wanted = known.work_errors(place, T_flange_tool)
    choice, stopped = _choose_poses(rows, wanted, n, settings, meter)
    posture, load = choice.chosen % len(joints), choice.chosen // len(joints)
    order = _visiting_order(joints[posture], load, len(loads))
    ordered = joints[posture[order]]
    pre, approach = _plan_entries(ordered, settings)
    return PosePlan(
        joints=ordered,
        pre=pre,
        approach=approach,
        row=index[posture[order]],
        load=load[order],
        loads=loads,
        position=scene.tubes(ordered)[1],
        rank=order,
        expected=predict_accuracy(
            wanted,
            rows,
            choice.chosen,
            seed=settings.seed,
            on_step=meter.phase("comparing plans", 4),
        ),
        criterion=settings.criterion,
        candidates=len(joints),
        drawn=drawn,
        rejected=rejected,
        travel=travel(ordered),
        travel_as_chosen=travel(joints[posture]),
        stopped=stopped,
        seed=settings.seed,
        notes=_notes(cell, settings),
    )


def _require_poses(n: int, model: ErrorModel | None) -> None:
    if n < LEAST and model is None:
        raise ConfigurationError(
            f"{n} poses, expected at least {LEAST}: even base and tool need as many.",
            hint="10 poses give a first model, 30 a good one.",
        )


def _require_candidates(n: int, postures: int, loads: int) -> None:
    if n > postures * loads:
        raise ReachError(
            f"{n} poses are requested, {postures} postures can be measured.",
            hint="more candidates, a larger region, or fewer poses.",
        )


def _linearise(cell: Cell, settings: PlanSettings, model: ErrorModel | None) -> LinearModel:
    if model is None:
        return before_measuring(cell, settings=settings.fit, unmodelled=settings.unmodelled)
    return after_fit(model, cell, settings=settings.fit, unmodelled=settings.unmodelled)


def _choices(
    scene: Scene, n: int, settings: PlanSettings, candidates: Array | None
) -> tuple[Array, IntArray, int, tuple[tuple[str, int], ...]]:
    """Returns usable postures, their indices, the number drawn, and the causes of rejection."""
    dof = scene.robot.dof
    back = -np.full(dof, settings.step_back) if settings.approach == "one side" else None
    if candidates is None:
        found = draw_candidates(
            scene,
            max(settings.candidates, n),
            seed=settings.seed,
            margin=settings.margin,
            region=settings.within,
            step_back=back,
        )
        numbers = np.arange(len(found.joints))
        return found.joints, numbers, found.drawn, found.rejected
    joints = np.asarray(candidates, dtype=np.float64)
    if joints.ndim != 2 or joints.shape[1] != dof:
        raise ConfigurationError(f"candidates have shape {joints.shape}, expected (any, {dof}).")
    checked = usable(scene, joints, pre=None if back is None else joints + back)
    if not checked.good.any():
        raise nothing_left(len(joints), checked)
    good = np.flatnonzero(checked.good)
    return joints[good], good, len(joints), checked.rejected


def _visits(joints: Array, load: Load, settings: PlanSettings) -> Postures:
    """One-sided poses come from below; the side of others is not known before they are ordered."""
    side = np.ones_like(joints) if settings.approach == "one side" else np.zeros_like(joints)
    return Postures(joints=joints, load=load, approach=side)


def _where(
    known: LinearModel, joints: Array, settings: PlanSettings, work: Postures | None, load: Load
) -> Postures:
    """The postures at which the accuracy counts."""
    if work is not None:
        return work.take(_spread(len(work)))
    if settings.work is None:
        return Postures(joints=joints[_spread(len(joints))], load=load)
    found = reachable_in(
        known.robot.nominal(),
        EVALUATED,
        seed=settings.seed + 1,
        margin=settings.margin,
        region=settings.work,
    )
    if len(found) < LEAST:
        raise ReachError(
            f"the reflector reaches the region of work in {len(found)} of the postures drawn.",
            hint="check the limits of the region (mm, deg, robot base).",
        )
    return Postures(joints=found, load=load)


def _spread(n: int) -> IntArray:
    return np.unique(np.linspace(0, n - 1, min(n, EVALUATED)).astype(np.int64))


class _Meter:
    """Progress of a plan: parts of a plan of n poses, each of steps of similar duration."""

    def __init__(self, progress: Progress, n: int) -> None:
        self._progress = progress
        drawing = max(n // 4, 1)
        self._start = np.cumsum([0, drawing, n, 2 * n * passes(n), n // 4 + 1, RANDOM]).tolist()

    def at(self, text: str, part: int, step: int = 0) -> None:
        """Reports the next step of a part."""
        start, end = self._start[part : part + 2]
        self._progress(text, min(start + step, end), self._start[-1])

    def phase(self, text: str, part: int, weight: int = 1) -> Callable[[int], None]:
        """Returns what a part calls with the number of its steps done, ``weight`` of time each."""
        return lambda step: self.at(text, part, weight * step)


def _choose_poses(
    rows: Array, work: WorkErrorPrior, n: int, settings: PlanSettings, meter: _Meter
) -> tuple[Choice, bool]:
    """Greedy, then exchanged, then sorted so that each pose is the best after those before."""
    weight, text = work.weight, "choosing poses"
    first = greedy(rows, weight, n, criterion=settings.criterion, on_step=meter.phase(text, 1))
    better = exchange_poses(
        rows, weight, first.chosen, criterion=settings.criterion,
        on_step=meter.phase("exchanging poses", 2, 2),
    )  # fmt: skip
    sorted_rows = greedy(rows[better.chosen], weight, n, criterion=settings.criterion)
    chosen = better.chosen[sorted_rows.chosen]
    kept = n
    if settings.enough > 0.0:
        fixed = float(np.trace(work.rest + work.instrument, axis1=1, axis2=2).mean())
        gain = -np.diff(np.sqrt(sorted_rows.variance + fixed))
        large = np.flatnonzero(gain >= settings.enough)
        kept = max(int(large[-1]) + 1 if len(large) else 0, min(LEAST, n))
    return (
        Choice(
            chosen=chosen[:kept],
            variance=sorted_rows.variance[: kept + 1],
            log_det=sorted_rows.log_det[: kept + 1],
        ),
        kept < n,
    )


def _visiting_order(joints: Array, load: IntArray, count: int) -> IntArray:
    """Short travel within each load state: a payload is changed once."""
    parts = []
    for k in range(count):
        mine = np.flatnonzero(load == k)
        parts.append(mine[short_order(joints[mine])] if len(mine) else mine)
    return np.concatenate(parts)


def _plan_entries(joints: Array, settings: PlanSettings) -> tuple[Array, Array]:
    """Pre-positions, and the sign of each joint's last motion into each pose."""
    if settings.approach == "one side":
        return joints - settings.step_back, np.ones_like(joints)
    approach = np.zeros_like(joints)
    approach[1:] = np.sign(np.diff(joints, axis=0))
    return joints[:0], approach


def _notes(cell: Cell, settings: PlanSettings) -> tuple[str, ...]:
    notes = []
    if cell.tracker_place is None:
        notes.append(
            "The tracker's place in the base is unknown: line of sight was not checked, and "
            "every point counts as 3 m away (tracker.place_mm)."
        )
    if cell.target_axis is None:
        notes.append(
            "The direction of the reflector is unknown: its acceptance angle was not checked "
            "(target.axis, target.acceptance_deg)."
        )
    if cell.link_radius is None:
        notes.append("The links are modelled as tubes of 6 % and 4 % of the reach.")
    if not cell.obstacles:
        notes.append("No obstacles are stated, not even the floor.")
    if settings.approach == "one side":
        notes.append(
            "Every joint enters every pose in its positive sense: backlash then acts like an "
            "offset, valid for poses entered from that side."
        )
    return tuple(notes)
