"""Directions of the weights that the rows show, group by group.

Weights of a group with one scale may be turned among themselves: prior and evidence stay as they
are. Waves of N cycles per turn on a joint that moved through a third of a turn are nearly linear
combinations of a third as many; the other combinations are next to zero at every row. They leave
the sums, and their posterior is their prior. A step of learning costs p^3 of the directions seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.evidence import PriorGroup, Sums, Weights
from robotrue.core.arrays import Array, IntArray, as_range

FAINT: Final = 1e-4
"""Information on a direction, over that of its prior, below which it is not seen."""
GROWTH: Final = 100.0
"""Times its scale at rest that a group may reach while it is learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Turn:
    """How the weights of one group are turned.

    Attributes:
        columns: (k,) of the group.
        place: Of the directions seen, among those of all groups.
        seen: (k, s) their unit vectors.
        hidden: (k, k - s) unit vectors of the others.
    """

    columns: IntArray
    place: slice
    seen: Array
    hidden: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenDirections:
    """The directions seen of all groups.

    Attributes:
        turns: One for each group.
        groups: The groups over the directions seen.
        whole: The groups over all weights.
        size: p, number of all weights.
    """

    turns: tuple[_Turn, ...]
    groups: tuple[PriorGroup, ...]
    whole: tuple[PriorGroup, ...]
    size: int

    def turn_sums(self, sums: Sums) -> Sums:
        """Returns sums over the directions seen."""
        gram, count = sums.whole_gram(), self.turns[-1].place.stop
        half, turned = np.empty((self.size, count)), np.empty((count, count))
        for turn in self.turns:
            half[:, turn.place] = gram[turn.columns].T @ turn.seen  # symmetric; rows are faster
        for turn in self.turns:
            turned[turn.place] = turn.seen.T @ half[turn.columns]
        pull = [turn.seen.T @ sums.pull[turn.columns] for turn in self.turns]
        none = np.empty((0, 0))
        return replace(
            sums, gram=turned, pull=np.concatenate(pull), columns=none, values=np.empty(0)
        )

    def expand(self, weights: Weights) -> Weights:
        """Returns a posterior over the directions seen as one over all weights."""
        count = len(weights.root)
        rows = count + sum(turn.hidden.shape[1] for turn in self.turns)
        mean, root = np.zeros(self.size), np.zeros((rows, self.size))
        groups, start = [], count
        for turn, whole, known in zip(self.turns, self.whole, weights.groups, strict=True):
            group, columns = replace(whole, sd=known.sd), as_range(turn.columns)
            mean[columns] = turn.seen @ weights.mean[turn.place]
            root[:count, columns] = weights.root[:, turn.place] @ turn.seen.T
            own = slice(start, start + turn.hidden.shape[1])
            root[own, columns] = turn.hidden.T * (group.sd * group.unit)
            groups.append(group)
            start = own.stop
        return replace(weights, mean=mean, root=root, groups=tuple(groups))


def find_seen(
    channels: Sequence[Sums], groups: Sequence[PriorGroup], noise: Array
) -> SeenDirections | None:
    """Returns the directions of each group that the rows show at the starting scales and noise.

    None where they show all.

    Groups of weights of unlike size are taken as they are.

    Args:
        channels: Sums per noise channel.
        groups: Starting scales.
        noise: (c,) starting tau.
    """
    grams = [s.whole_gram() for s in channels]
    turns, seen_groups, start = [], [], 0
    for group in groups:
        own = np.ix_(group.columns, group.columns)
        seen, hidden = np.eye(len(group.columns)), np.zeros((len(group.columns), 0))
        if group.learned and np.ptp(group.unit) == 0.0:
            scale = max(group.sd, GROWTH * group.rest) * group.unit[0]
            information = sum(gram[own] / t for gram, t in zip(grams, noise, strict=True))
            values, vectors = np.linalg.eigh(np.asarray(information) * scale**2)
            shown = values > FAINT
            seen, hidden = vectors[:, shown], vectors[:, ~shown]
        place = slice(start, start + seen.shape[1])
        start = place.stop
        turns.append(_Turn(columns=group.columns, place=place, seen=seen, hidden=hidden))
        unit = group.unit if not hidden.shape[1] else np.full(seen.shape[1], group.unit[0])
        seen_groups.append(replace(group, columns=np.arange(place.start, place.stop), shape=unit))
    size = len(channels[0].pull)
    if start == size:
        return None
    return SeenDirections(
        turns=tuple(turns),
        groups=tuple(seen_groups),
        whole=tuple(groups),
        size=size,
    )
