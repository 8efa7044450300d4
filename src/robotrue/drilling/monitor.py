"""A watch on residuals: cumulative sums that tell a shifted zero from noise.

Two one-sided sums per channel (Page, Biometrika 41 (1954)), in standard deviations:

    up <- max(0, up + z - k),  down <- max(0, down - z - k),  alarm where one exceeds h.

With k = 0.5 and h = 8 a channel of plain noise alarms once in some 10^4 records; a shift of two
deviations is seen after about six records. What a correction leaves is wider than it says where
it was learned from few clamps; a slow mean square of the scores widens the deviation then, never
narrows it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError

ALLOWANCE: Final = 0.5
LIMIT: Final = 8.0
MEMORY: Final = 0.98
"""Weight of the past in the mean square of the scores."""
LARGEST: Final = 4.0
"""Deviations one record may count: an outlier alone raises no alarm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch(Columns):
    """Cumulative sums of c channels.

    Attributes:
        sums: (2, c) upward and downward, in standard deviations.
        since: (2, c) records since each last stood at zero: where the shift began.
        spread: (c,) slow mean square of the scores, not below 1.
        records: How many were seen.
        allowance: k.
        limit: h.
    """

    sums: Annotated[Array, Column("2 k")]
    since: Annotated[Array, Column("2 k")]
    spread: Annotated[Array, Column("k")]
    records: int = 0
    allowance: float = ALLOWANCE
    limit: float = LIMIT

    def _check_rules(self) -> None:
        """Checks the values."""
        if not self.limit > 0.0 or not self.allowance >= 0.0:
            raise ConfigurationError("limit of a watch is above 0, its allowance not below 0.")

    @property
    def alarm(self) -> bool:
        """Whether a sum is beyond its limit."""
        return bool((self.sums > self.limit).any())

    @property
    def shift(self) -> Array:
        """(c,) estimated shift in standard deviations, 0 where no sum is beyond its limit."""
        rate = self.sums / np.maximum(self.since, 1.0) + self.allowance
        out: Array = np.where(self.sums > self.limit, rate, 0.0)
        return np.asarray(out[0] - out[1])


def watch(channels: int, *, allowance: float = ALLOWANCE, limit: float = LIMIT) -> Watch:
    """Returns a watch that has seen nothing."""
    zero = np.zeros((2, channels))
    return Watch(sums=zero, since=zero, spread=np.ones(channels), allowance=allowance, limit=limit)


def update_watch(state: Watch, score: Array) -> Watch:
    """Returns the watch after one more record.

    Args:
        state: The watch before it.
        score: (c,) residual over its predicted standard deviation.

    Raises:
        ShapeError: Another number of channels, or a residual that is not finite.
    """
    z = frozen(score, (state.sums.shape[1],), "score") / np.sqrt(state.spread)
    z = np.clip(z, -LARGEST, LARGEST)
    spread = np.maximum(state.spread * (MEMORY + (1.0 - MEMORY) * z**2), 1.0)
    sums = np.maximum(state.sums + np.stack([z, -z]) - state.allowance, 0.0)
    since = np.where(sums > 0.0, state.since + 1.0, 0.0)
    return replace(state, sums=sums, since=since, spread=spread, records=state.records + 1)
