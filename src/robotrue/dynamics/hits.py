"""Records of hammer tests: the noun, the hits in them, and implausible sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.errors import ImplausibleDataError, ShapeError

_TRIGGER: Final = 0.1
"""Part of the hardest hit at which a hit begins."""
SECOND: Final = 0.05
"""Part of its peak that the hammer may touch again before a hit counts as double."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HammerRecord(Columns):
    """Hits along one axis and what they moved, as recorded.

    Attributes:
        rate: Samples per second.
        force: (n,) N of the hammer, positive along its axis.
        excitation_axis: x, y or z.
        motion: (n, r) in the SI unit of ``form``.
        response_axes: r of x, y, z.
        form: ``accelerance`` for an accelerometer, ``mobility`` for a velocity,
            ``receptance`` for a displacement.
        source: File.
        provenance: Simulated or measured, and the file.
    """

    rate: float
    force: Annotated[Array, Column("n", unit="N")]
    excitation_axis: str
    motion: Annotated[Array, Column("n r")]
    response_axes: Annotated[tuple[str, ...], Column("r")]
    form: str
    source: str
    provenance: Provenance = MEASURED

    def _check_rules(self) -> None:
        """Checks the values."""
        if not self.rate > 0.0:
            raise ShapeError(f"rate {self.rate:g} 1/s, expected more than zero.")


def find_hits(record: HammerRecord) -> tuple[list[int], tuple[tuple[int, str], ...]]:
    """Returns the samples at which clean hits begin, and of the others sample and reason.

    Raises:
        ImplausibleDataError: No hit, or one against the hammer's axis.
    """
    force = record.force - np.median(record.force)
    peak = float(force.max())
    if -float(force.min()) > peak:
        raise ImplausibleDataError(
            f"the hammer pulls: {force.min():.3g} N is its largest force. Its sign is flipped.",
            source=record.source,
            hint="change the sign of the channel; positive is along the axis.",
        )
    noise = 1.4826 * float(np.median(np.abs(force)))
    if not peak > 20.0 * noise or peak <= 0.0:
        raise ImplausibleDataError(
            f"no hit: the largest force is {peak:.3g} N, its noise {noise:.3g} N.",
            source=record.source,
            hint="check the hammer's cable and trigger.",
        )
    above = force > _TRIGGER * peak
    starts = np.flatnonzero(above & ~np.concatenate([[False], above[:-1]]))
    stops = np.flatnonzero(above & ~np.concatenate([above[1:], [False]])) + 1
    hits: list[int] = []
    left_out: list[tuple[int, str]] = []
    quiet = max(3, int(stops[0] - starts[0])) * 40
    k = 0
    while k < len(starts):
        last = k
        while last + 1 < len(starts) and starts[last + 1] - stops[last] < quiet:
            last += 1
        top = float(force[starts[k] : stops[k]].max())
        rest = force[stops[k] + 2 * (stops[k] - starts[k]) : stops[k] + quiet]
        again = float(rest.max()) if rest.size else 0.0
        if last > k or again > max(SECOND * top, 8.0 * noise):
            left_out.append((int(starts[k]), "double hit"))
        else:
            hits.append(int(starts[k]))
        k = last + 1
    return hits, tuple(left_out)


def check_sensors(record: HammerRecord) -> None:
    """Returns nothing; raises where a channel is clipped or dead.

    Raises:
        ImplausibleDataError: The same value on every sample, or a flat top at an extreme.
    """
    channels = [("hammer", record.force)]
    channels += [
        (f"sensor {a}", m) for a, m in zip(record.response_axes, record.motion.T, strict=True)
    ]
    for name, values in channels:
        if np.ptp(values) == 0.0:
            raise ImplausibleDataError(
                f"{name} is {values[0]:g} on every sample: not connected.",
                source=record.source,
                hint="check the cable.",
            )
        for extreme in (values.max(), values.min()):
            at = np.flatnonzero(values == extreme)
            run = np.split(at, np.flatnonzero(np.diff(at) != 1) + 1)
            longest = max(run, key=len)
            if len(longest) >= 4 and abs(extreme) >= 0.5 * np.abs(values).max():
                raise ImplausibleDataError(
                    f"sample {longest[0]}: {name} stays at {extreme:g} for {len(longest)} samples: "
                    "it is overloaded.",
                    source=record.source,
                    hint="a larger range, or hit more softly.",
                )
