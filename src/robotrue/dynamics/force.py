"""A record of cutting force at one clock: the noun, and its checks against broken sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.errors import ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceRecord:
    """Force on the tool, sampled regularly.

    Attributes:
        start: s, time of the first sample on the recorder's clock.
        rate: Samples per second.
        force: (n, 3) N along x, y, z, what acts **on the tool**.
        source: File or model it came from.
    """

    start: float
    rate: float
    force: Array
    source: str

    def __post_init__(self) -> None:
        """Freezes and checks."""
        object.__setattr__(self, "force", frozen(self.force, (None, 3), "force"))
        if not self.rate > 0.0:
            raise ShapeError(f"rate {self.rate:g} 1/s, expected more than zero.")

    def __len__(self) -> int:
        return len(self.force)

    @property
    def time(self) -> Array:
        """(n,) s on the recorder's clock."""
        return np.asarray(self.start + np.arange(len(self.force)) / self.rate)
