"""The next pose while measuring: what is known grows with every pose, results are not needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import BoolArray
from robotrue.planning.criteria import Criterion, covariance_after, next_pose
from robotrue.planning.expectation import WorkErrorPrior, mean_error
from robotrue.planning.information import LinearModel, Postures


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
    criterion: Criterion = "I",
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
