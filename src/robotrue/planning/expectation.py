"""Expected accuracy of the arm: after a plan, and after the next pose or probing point.

Of a plan: what is left to learn, and what never is. While measuring, what is known grows with each
pose; results are not needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np
from scipy.special import gammaln

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.criteria import covariance_after, next_pose
from robotrue.planning.information import LinearModel, Postures, WorkErrorPrior
from robotrue.planning.plan_defaults import CRITERION, Criterion
from robotrue.planning.probing import ProbingTask, linear_task

RANDOM: Final = 20
"""Random plans for comparison with the chosen one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedAccuracy(Columns):
    """3-D error expected where the arm will work, after 0, 1, ..., n poses, as a check measures it.

    Attributes:
        rms: (n + 1,) m.
        mean: (n + 1,) m.
        random_mean: (n + 1,) m, median over random plans from the same candidates.
        random_low: (n + 1,) m, their lower quartile.
        random_high: (n + 1,) m, their upper quartile.
        floor_mean: m, of an arm whose linear part is known exactly.
    """

    rms: Annotated[Array, Column("_", unit="m")]
    mean: Annotated[Array, Column("_", unit="m")]
    random_mean: Annotated[Array, Column("_", unit="m")]
    random_low: Annotated[Array, Column("_", unit="m")]
    random_high: Annotated[Array, Column("_", unit="m")]
    floor_mean: float


def mean_length(covariance: Array) -> Array:
    """Returns the mean length (...) of Gaussian vectors with covariance (..., 3, 3), mean zero.

    The squared length is taken as gamma distributed with the true mean tr C and variance 2 tr C^2
    (Satterthwaite 1946), so k = tr(C)^2 / (2 tr C^2) and the mean length is sqrt(tr C / k)
    Gamma(k + 1/2) / Gamma(k): exact for equal axes and for one axis alone, within 3 % between.
    """
    square = np.trace(covariance, axis1=-2, axis2=-1)
    fourth = np.einsum("...ij,...ij->...", covariance, covariance)
    shape = square**2 / np.where(fourth > 0.0, 2.0 * fourth, 1.0)
    shape = np.where(fourth > 0.0, shape, 1.0)
    return np.asarray(np.sqrt(square / shape) * np.exp(gammaln(shape + 0.5) - gammaln(shape)))


def mean_error(work: WorkErrorPrior, covariance: Array) -> float:
    """Returns the mean 3-D error in m expected with a covariance (k, k), as a check measures it."""
    learned = work.columns @ covariance @ np.swapaxes(work.columns, 1, 2)
    return float(mean_length(learned + work.rest + work.instrument).mean())


def predict_accuracy(
    work: WorkErrorPrior,
    rows: Array,
    order: IntArray,
    *,
    seed: int,
    on_step: Callable[[int], None] | None = None,
) -> ExpectedAccuracy:
    """Returns the accuracy expected after each pose of an order, and after random poses.

    Args:
        work: Where the arm will work.
        rows: (c, 3, k) whitened rows of the candidates.
        order: (n,) chosen candidates, in the order of choice.
        seed: Of the random plans.
        on_step: Called with the number of random plans done, before each.
    """
    fixed = work.rest + work.instrument
    rms, mean = _curve(work, rows, order, fixed)
    rng = np.random.default_rng([seed, 43])
    n = len(order)
    random = np.empty((RANDOM, n + 1))
    for k in range(RANDOM):
        if on_step is not None:
            on_step(k)
        other = rng.choice(len(rows), n, replace=False)
        random[k] = _curve(work, rows, other, fixed)[1]
    low, middle, high = np.percentile(random, [25, 50, 75], axis=0)
    return ExpectedAccuracy(
        rms=rms,
        mean=mean,
        random_mean=middle,
        random_low=low,
        random_high=high,
        floor_mean=float(mean_length(fixed).mean()),
    )


def _curve(work: WorkErrorPrior, rows: Array, order: IntArray, fixed: Array) -> tuple[Array, Array]:
    """Root mean square and mean of the 3-D error after each pose; its parameters begin at I."""
    m, _, size = work.columns.shape
    flat, now = work.columns.reshape(3 * m, size), np.eye(size)
    spread = np.einsum("mik,mjk->mij", work.columns, work.columns) + fixed
    rms, mean = [], []
    for k in [-1, *order.tolist()]:
        if k >= 0:
            mine = rows[k]
            ahead = now @ mine.T
            inverse = np.linalg.inv(np.eye(len(mine)) + mine @ ahead)
            now = now - ahead @ inverse @ ahead.T
            common = flat @ ahead
            left, right = common.reshape(m, 3, -1), (common @ inverse).reshape(m, 3, -1)
            spread = spread - left @ np.swapaxes(right, 1, 2)
        rms.append(np.sqrt(np.trace(spread, axis1=1, axis2=2).mean()))
        mean.append(mean_length(spread).mean())
    return np.array(rms), np.array(mean)


@dataclass(frozen=True, slots=True, kw_only=True)
class NextVisit:
    """Next pose and its expected benefit.

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
        """Expected reduction of the mean error, m."""
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

    After a first fit pass :func:`robotrue.planning.information.after_fit` of its model and no
    measured postures: scales and noise are then those that were learned.

    Args:
        model: Prior of the arm before ``measured``.
        measured: Visits made since; may be none (an empty array of joints).
        candidates: Visits that can be made, see :func:`robotrue.planning.candidates.usable`.
        work: Errors where the arm will work, from the same model.
        criterion: ``"I"`` or ``"D"``.
        enough: m; the least decrease of the expected mean error that justifies a pose.
        allowed: (c,) allowed candidates; all if not given. A pose may be measured twice.

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
    """Next probing point and its expected benefit.

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
