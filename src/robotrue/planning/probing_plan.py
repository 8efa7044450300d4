"""A plan of touches, made by any estimate that returns the uncertainty after touches."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Columns
from robotrue.measurement.probing_set import ProbingSet

Goal: TypeAlias = Literal["mean", "worst"]
GOALS: Final = ("mean", "worst")
FACTOR: Final = 2.0
"""Standard uncertainty of a machined group over that at the touches, from which it is not covered.
An arm of its type errs 5 to 10 times as much on a side that was not touched as on one that was."""

POWER: Final = 1.0
"""With which weights grow where the last plan left most, if the worst point counts."""
MORE_FEATURES: Final = "add features that can be probed in its postures"


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupCover:
    """Expected uncertainty of one group's machined points: 3-D standard uncertainty, rms.

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
        """True if the points determine this group about as well as their own postures."""
        return self.uncertainty <= FACTOR * self.at_touches

    @property
    def warning(self) -> str | None:
        """Warning about a group that is not covered, with its cure; None for a covered one."""
        if self.covered:
            return None
        return (
            f"no touch covers {self.name!r}: expected uncertainty of its points "
            f"{self.uncertainty * 1e3:.2f} mm, of touched postures {self.at_touches * 1e3:.2f} "
            f"mm; {self.cure}."
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbePlan:
    """Planned probing points, in order of their benefit.

    Standard uncertainties are 3-D: the root of the trace of a point's covariance; 95 % of the
    errors are within about 1.6 times that.

    Attributes:
        touches: The chosen candidates.
        row: (n,) their rows among the candidates.
        goal: Minimised quantity.
        mean: (n + 1,) m, rms over the machined points of their standard uncertainty, after 0 .. n
            touches.
        worst: (n + 1,) m, of the worst point.
        spread_mean: (n + 1,) m, rms after as many touches spread evenly over the part.
        covariance: (m, 3, 3) m^2 of each machined point in its part, after the last touch.
        groups: Cover of each group.
        stopped: The tolerance was met before the requested number of touches.
        notes: Assumptions.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchPosterior(Columns, ABC):
    """Uncertainty of m machined points after probing, by the estimator that is used later.

    Attributes:
        candidates: Touches that can be made.
    """

    candidates: ProbingSet
    rounds: ClassVar[int] = 6
    """Plans made for the worst point, with weights that grow where the last one left most."""

    @abstractmethod
    def covariance(self, chosen: IntArray) -> Array:
        """Returns the covariance (m, 3, 3) m^2 of the machined points after candidates."""

    @abstractmethod
    def _search(self, n: int, weight: Array) -> IntArray:
        """Returns n candidates that leave a small weighted sum of squares, weights (m,)."""

    @abstractmethod
    def _losses(self, chosen: IntArray, weight: Array) -> Array:
        """Returns what dropping each one (n,) would cost, up to a constant; inf: a frame."""

    @abstractmethod
    def _uncertainty_at_touches(self, chosen: IntArray) -> float:
        """Returns the median standard uncertainty, m, of points machined as the plan touches."""

    @abstractmethod
    def _best_for(self, machined: IntArray, n: int, goal: Goal) -> tuple[float, str, str]:
        """Returns the least rms uncertainty, m, some machined points can get, and what helps them.

        The first cure is for the case that the least is small enough, the second for the other.
        """

    def _fixes_frames(self, chosen: IntArray) -> bool:
        """Returns whether candidates fix every frame; True where frames have a prior."""
        return True

    def squares(self, chosen: IntArray) -> Array:
        """Returns the squared standard uncertainty (m,) m^2 of the machined points."""
        return np.asarray(np.trace(self.covariance(chosen), axis1=1, axis2=2))

    def plan(
        self, groups: Mapping[str, IntArray], n: int, goal: Goal, tolerance: float
    ) -> ProbePlan:
        """Returns up to n touches, each the best after those before it.

        Args:
            groups: Rows of the machined points by the name of their group.
            n: Largest number of touches.
            goal: Of :data:`GOALS`.
            tolerance: m; the plan stops once the uncertainty of the goal is below it.
        """
        machined = sum(map(len, groups.values()))
        chosen = self.choose(n, machined, goal)
        mean, worst = self._trace(chosen)
        while (kept := _count_needed(mean if goal == "mean" else worst, tolerance)) < len(chosen):
            # Chosen again: another set of the same number can be better.
            fewer = self.choose(kept, machined, goal)
            trial = self._trace(fewer)
            if not trial[goal == "worst"][-1] <= tolerance:
                chosen, mean, worst = chosen[:kept], mean[: kept + 1], worst[: kept + 1]
                break
            chosen, (mean, worst) = fewer, trial
        return ProbePlan(
            touches=self.candidates.subset(chosen),
            row=chosen,
            goal=goal,
            mean=mean,
            worst=worst,
            spread_mean=self._trace(spread_touches(self.candidates, len(chosen)))[0],
            covariance=self.covariance(chosen),
            groups=tuple(self._cover(groups, chosen, goal)),
            stopped=len(chosen) < n,
        )

    def choose(self, n: int, machined: int, goal: Goal) -> IntArray:
        """Returns rows of n candidates chosen for these machined points, by benefit."""
        weight = np.ones(machined)
        best, least = np.empty(0, dtype=np.int64), np.inf
        for _ in range(1 if goal == "mean" else self.rounds):
            chosen = self._search(n, weight)
            square = self.squares(chosen)
            if goal == "mean" or square.max() < least:
                best, least = self._sort_by_benefit(chosen, weight), float(square.max())
            weight = weight * (square / square.mean()) ** POWER
        return best

    def _sort_by_benefit(self, chosen: IntArray, weight: Array) -> IntArray:
        """Sorts points by benefit: the least useful of those left goes to the end, repeatedly.

        Better at its start than choosing forwards: two touches alone have little information, three
        have enough.
        """
        kept, last = list(chosen), []
        while len(kept) > 1:
            losses = self._losses(np.array(kept), weight)
            place = int(np.argmin(losses))
            if not np.isfinite(losses[place]):
                break
            last.append(kept.pop(place))
        return np.array(kept + last[::-1], dtype=np.int64)

    def _trace(self, order: IntArray) -> tuple[Array, Array]:
        """Rms and worst standard uncertainty (n + 1,) m along an order; NaN without a frame."""
        out = np.full((2, len(order) + 1), np.nan)
        for k in range(len(order) + 1):
            if self._fixes_frames(order[:k]):
                square = self.squares(order[:k])
                out[:, k] = np.sqrt(square.mean()), np.sqrt(square.max())
        return out[0], out[1]

    def _cover(
        self, groups: Mapping[str, IntArray], chosen: IntArray, goal: Goal
    ) -> Iterator[GroupCover]:
        square, at_touches = self.squares(chosen), self._uncertainty_at_touches(chosen)
        for name, mine in groups.items():
            least, *cures = self._best_for(mine, len(chosen), goal)
            yield GroupCover(
                name=name,
                postures=len(mine),
                uncertainty=float(np.sqrt(square[mine].mean())),
                worst=float(np.sqrt(square[mine].max())),
                best=least,
                at_touches=at_touches,
                cure=cures[least > FACTOR * at_touches],
            )


def _count_needed(left: Array, tolerance: float) -> int:
    """Returns the number of points that meet the tolerance; all if none does."""
    met = np.flatnonzero(left[1:] <= tolerance)
    return int(met[0]) + 1 if len(met) else len(left) - 1


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
