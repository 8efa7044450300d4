"""A dry run: points along a program, each measured with the robot stopped.

Points are at equal steps along a program's moves; each is the target nearest to its step, so that
the robot stops at a commanded target. Error is the measured point less the target of the intended
program, in base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import EMPTY
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ImplausibleDataError
from robotrue.program.program import Motion

FARTHEST: Final = 100.0 * MM
"""m; a point farther from its target was measured in another frame, or is another point."""
FACTOR: Final = 1.96
"""Standard deviations of a 95 % band of one axis."""


def pick_points(
    place: Array, motion: IntArray, count: int, *, source: str
) -> tuple[IntArray, Array]:
    """Returns the targets at equal steps of the way along path moves, and the way to each.

    Args:
        place: (n, 3) m, targets in base in the order they are moved to; NaN for axis targets.
        motion: (n,) :class:`Motion`.
        count: Requested number; fewer are returned where targets lie farther apart.
        source: The program, for messages.

    Returns: ``(m,)`` rows, and (m,) m from the first target.

    Raises:
        ConfigurationError: Fewer than two points, or too few targets with a place.
    """
    if count < 2:
        raise ConfigurationError(f"{count} points, at least 2 are needed.", hint="--points 39")
    on_path = (motion != Motion.PTP) & (motion != Motion.UNUSED)
    known = np.flatnonzero(np.isfinite(place).all(axis=1) & on_path)
    if len(known) < 2:
        raise ConfigurationError(
            f"{len(known)} targets of the program lie on a path, at least 2 are needed.",
            source=source,
            hint="a program with linear or circular moves, and --cell with its frames.",
        )
    steps = np.linalg.norm(np.diff(place[known], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, along[-1], count)
    right = np.clip(np.searchsorted(along, wanted), 1, len(along) - 1)
    nearest = right - (wanted - along[right - 1] <= along[right] - wanted)
    chosen = np.unique(nearest)
    return known[chosen], along[chosen]


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisErrors:
    """Errors of a dry run, m: mean, largest and standard deviation of x, y, z and of the length.

    Attributes:
        mean: (4,) of the sizes |x|, |y|, |z| and of the length.
        largest: (4,) of the same.
        deviation: (4,) sample standard deviation of the same.
        bias: (3,) mean with sign.
        count: Points.
        inside: Share of points whose axes all lie in the model's 95 % band; NaN without one.
    """

    mean: Array
    largest: Array
    deviation: Array
    bias: Array
    count: int
    inside: float

    @property
    def sizes(self) -> tuple[Array, Array, Array]:
        """Mean, largest and standard deviation, (4,) m each."""
        return self.mean, self.largest, self.deviation


def summarise_errors(error: Array, predicted: Array = EMPTY, sigma: Array = EMPTY) -> AxisErrors:
    """Returns the statistics of measured errors.

    Args:
        error: (n, 3) m in base, measured less wanted.
        predicted: (n, 3) m, of the model; empty without, NaN where it predicts nothing.
        sigma: (n, 3) m, its standard deviation; likewise.

    Raises:
        ConfigurationError: Fewer than two points.
    """
    if len(error) < 2:
        raise ConfigurationError(
            f"{len(error)} measured points, at least 2 are needed.", hint="measure more points."
        )
    sizes = np.column_stack([np.abs(error), np.linalg.norm(error, axis=1)])
    inside = float("nan")
    if len(predicted):
        known = np.flatnonzero(np.isfinite(predicted + sigma).all(axis=1))
        within = np.all(np.abs(error - predicted)[known] <= FACTOR * sigma[known], axis=1)
        inside = float(np.mean(within)) if len(known) else inside
    return AxisErrors(
        mean=sizes.mean(axis=0),
        largest=sizes.max(axis=0),
        deviation=sizes.std(axis=0, ddof=1),
        bias=error.mean(axis=0),
        count=len(error),
        inside=inside,
    )


def match_points(
    names: Sequence[str],
    wanted: Array,
    measured: Sequence[str],
    place: Array,
    lines: Sequence[int],
    source: str,
) -> tuple[IntArray, Array]:
    """Returns the planned row of every measured point, and its error (m, 3) m.

    Args:
        names: Of the planned points.
        wanted: (n, 3) m, their places in base.
        measured: Names of the measured points.
        place: (m, 3) m, measured, in base.
        lines: Of the measured points in their file.
        source: That file.

    Raises:
        ConfigurationError: A name that was not planned, or twice.
        ImplausibleDataError: A point far from its target.
    """
    index = {name: k for k, name in enumerate(names)}
    rows: list[int] = []
    for name, line in zip(measured, lines, strict=True):
        if name not in index or index[name] in rows:
            said = "is measured twice" if name in index else "was not planned"
            raise ConfigurationError(
                f"point {name!r} {said}.",
                source=source,
                line=line,
                hint="one row for each point of the sheet that `dry-run-plan` wrote.",
            )
        rows.append(index[name])
    chosen = np.array(rows, dtype=np.int64)
    error = place - wanted[chosen]
    size = np.linalg.norm(error, axis=1)
    far = np.flatnonzero(size > FARTHEST)
    if len(far):
        k = int(far[0])
        raise ImplausibleDataError(
            f"point {measured[k]!r} is {size[k] / MM:.1f} mm from its target, up to "
            f"{FARTHEST / MM:g} mm are an error; {len(far)} of {len(size)} points are.",
            source=source,
            line=lines[k],
            hint="x_mm, y_mm, z_mm in mm and in the robot's base, of the points in their order.",
        )
    return chosen, error
