"""How much the share of windows inside a band varies by chance, where windows share their errors.

Of a hundred windows whose errors are alike, a 95 % band holds all or none. What a share says is
that of a binomial of so many windows as are independent: its variance, p (1 - p) / n, gives n.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array

TWO_SIDED_95: Final = 1.959964
DRAWS: Final = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class ShareByChance:
    """What share of some windows a band holds that is right.

    Attributes:
        shares: (draws,) drawn from the errors as the band's model has them.
    """

    shares: Array

    @property
    def range(self) -> tuple[float, float]:
        """The share lies between these two in 95 of 100 cases."""
        low, high = np.quantile(self.shares, [0.025, 0.975])
        return float(low), float(high)

    @property
    def effective(self) -> float:
        """Independent windows that would give a share as unsure."""
        mean, variance = float(self.shares.mean()), float(self.shares.var())
        return mean * (1.0 - mean) / max(variance, 1e-12)

    def below(self, share: float) -> float:
        """Returns the probability of a share less than this."""
        return float((self.shares < share).mean())


def share_by_chance(covariance: Array) -> ShareByChance:
    """Returns what a 95 % band of windows would hold.

    Args:
        covariance: (n, n) m^2 of their errors, as the band takes them; its diagonal is the band.
    """
    sd = np.sqrt(np.diag(covariance))
    value, vector = np.linalg.eigh(covariance / np.outer(sd, sd))
    drawn = np.random.default_rng(len(sd)).standard_normal((len(sd), DRAWS))
    errors = (vector * np.sqrt(np.maximum(value, 0.0))) @ drawn
    return ShareByChance(shares=np.asarray((np.abs(errors) <= TWO_SIDED_95).mean(axis=0)))


def join_shares(parts: Sequence[ShareByChance], windows: Sequence[int]) -> ShareByChance:
    """Returns the share of several sets of windows together, errors of different sets independent.

    Args:
        parts: Of each set.
        windows: In each set.
    """
    weight = np.asarray(windows, dtype=np.float64) / sum(windows)
    rng = np.random.default_rng(len(parts))
    mixed = [rng.permutation(part.shares) for part in parts]
    return ShareByChance(shares=np.asarray(weight @ np.array(mixed)))
