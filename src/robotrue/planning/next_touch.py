"""The next touch while touching: what is known grows with every touch, results are not needed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.criteria import next_pose
from robotrue.planning.probing import LinearTask, ProbingTask, condition_covariance, linear_task


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
    rows, done = linear.rows[:count], linear.rows[count:]
    index, _ = next_pose(
        done, rows, linear.weight(np.ones(len(linear.columns))), criterion="I", allowed=allowed
    )
    return NextTouch(
        index=index,
        now=_weigh_remaining(linear, done),
        then=_weigh_remaining(linear, np.concatenate([done, rows[[index]]])),
    )


def _weigh_remaining(linear: LinearTask, rows: Array) -> float:
    covariance = linear.covariance(condition_covariance(rows))
    return float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()))


def _join_sets(first: ProbingSet, second: ProbingSet) -> ProbingSet:
    return ProbingSet(
        names=first.names + second.names,
        point=np.concatenate([first.point, second.point]),
        joints=np.concatenate([first.joints, second.joints]),
        normal=np.concatenate([first.normal, second.normal]),
        part=np.concatenate([first.part, second.part]),
        radius=first.radius,
    )
