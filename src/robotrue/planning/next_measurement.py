"""The next pose or touch while measuring: what is known grows with each, results are not needed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robotrue.core.arrays import BoolArray
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.criteria import covariance_after, next_pose
from robotrue.planning.expectation import mean_error
from robotrue.planning.information import LinearModel, Postures, WorkErrorPrior
from robotrue.planning.plan_defaults import CRITERION, Criterion
from robotrue.planning.probing import ProbingTask, linear_task


@dataclass(frozen=True, slots=True, kw_only=True)
class NextVisit:
    """What to measure next, and what it is expected to bring.

    Attributes:
        index: Row of the candidates.
        mean_now: m, mean 3-D error expected where the arm will work, with what was measured.
        mean_then: m, the same with this pose measured too.
    """

    index: int
    mean_now: float
    mean_then: float

    @property
    def gain(self) -> float:
        """By how much the expected mean error falls, m."""
        return self.mean_now - self.mean_then


def next_visit(
    model: LinearModel,
    measured: Postures,
    candidates: Postures,
    work: WorkErrorPrior,
    *,
    criterion: Criterion = CRITERION,
    enough: float = 0.0,
    allowed: BoolArray | None = None,
) -> NextVisit | None:
    """Returns the candidate to measure next; None when none gains ``enough`` any more.

    After a first fit hand over :func:`robotrue.planning.information.after_fit` of its model and no
    measured postures: scales and noise are then those that were learned.

    Args:
        model: What is believed of the arm before ``measured``.
        measured: Visits made since; may be none (an empty array of joints).
        candidates: Visits that can be made, see :func:`robotrue.planning.candidates.usable`.
        work: Where the arm will work, from the same model.
        criterion: ``"I"`` or ``"D"``.
        enough: m; the least gain in expected mean error that is worth a pose.
        allowed: (c,) candidates that may be taken; all if not given. A pose may be measured twice.

    Raises:
        ConfigurationError: No candidate is left.
    """
    known = model.rows(measured)
    rows = model.rows(candidates)
    index, _ = next_pose(known, rows, work.weight, criterion=criterion, allowed=allowed)
    before = covariance_after(known)
    found = NextVisit(
        index=index,
        mean_now=mean_error(work, before),
        mean_then=mean_error(work, covariance_after(rows[[index]], np.array(before))),
    )
    return found if found.gain >= enough else None


@dataclass(frozen=True, slots=True, kw_only=True)
class NextTouch:
    """What to touch next, and what it is expected to bring.

    Attributes:
        index: Row of the candidates.
        now: m, rms over the machined points of their 3-D standard uncertainty, with what was
            touched.
        then: m, the same with this one touched too.
    """

    index: int
    now: float
    then: float


def next_touch(
    task: ProbingTask, touched: ProbingSet | None, *, allowed: BoolArray | None = None
) -> NextTouch:
    """Returns the candidate that makes the machined points known best.

    Args:
        task: What can be touched, and what will be machined, by the model touching gives.
        touched: Touches made, with joints; None: none yet.
        allowed: (c,) candidates that may be taken; all if not given.

    Raises:
        ConfigurationError: No candidate is left.
    """
    count = len(task.candidates)
    both = (
        task if touched is None else replace(task, candidates=_join_sets(task.candidates, touched))
    )
    linear = linear_task(both)
    done = np.arange(count, len(linear.rows))
    index, _ = next_pose(
        linear.rows[done],
        linear.rows[:count],
        linear.weight(np.ones(len(linear.columns))),
        allowed=allowed,
    )
    return NextTouch(
        index=index,
        now=float(np.sqrt(linear.squares(done).mean())),
        then=float(np.sqrt(linear.squares(np.append(done, index)).mean())),
    )


def _join_sets(first: ProbingSet, second: ProbingSet) -> ProbingSet:
    return ProbingSet(
        names=first.names + second.names,
        point=np.concatenate([first.point, second.point]),
        joints=np.concatenate([first.joints, second.joints]),
        normal=np.concatenate([first.normal, second.normal]),
        part=np.concatenate([first.part, second.part]),
        radius=first.radius,
    )
