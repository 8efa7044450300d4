"""What references far off the model point to: exchanged sensors, axes of the wrong sense."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.drilling.campaign_csv import ProductionRecord
from robotrue.drilling.foot_model import NormalModel, estimate_tilt

FEWEST: Final = 4
"""References below which no cause is named: a few agree by chance."""
CLEAR: Final = 0.2
"""Share of the residual tilts that a cause must leave to be named."""
SHUFFLED: Final = 6
"""Most sensors whose orders are all tried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceCause:
    """What would explain references that are far off.

    Attributes:
        said: The cause, as a clause.
        hint: What to do.
        rms: rad, of one residual tilt if it is the cause.
    """

    said: str
    hint: str
    rms: float


def find_cause(model: NormalModel, holes: ProductionRecord) -> ReferenceCause | None:
    """Returns the one cause that explains references far off the model; None if none does.

    Args:
        model: Moved all holes.
        holes: With the residual tilts as the file states them.
    """
    if len(holes.hole) < FEWEST:
        return None
    stated = float(np.sqrt(np.mean(holes.left**2)))
    causes = [*_axis_causes(model, holes), *_sensor_causes(model, holes)]
    best = min(causes, key=lambda cause: cause.rms)
    return best if best.rms < CLEAR * stated else None


def _rms(tilt: Array) -> float:
    return float(np.sqrt(np.mean(tilt**2)))


def _axis_causes(model: NormalModel, holes: ProductionRecord) -> Iterator[ReferenceCause]:
    """The true tilt is what the head turned by plus what was left, however it turned."""
    tilt = estimate_tilt(model, holes.clamps).tilt
    turns = {
        "A turned the other way": tilt * [-1.0, 1.0],
        "B turned the other way": tilt * [1.0, -1.0],
        "A and B turned the other way": -tilt,
        "A and B were exchanged": tilt[:, ::-1],
    }
    for said, turned in turns.items():
        yield ReferenceCause(
            said=f"{said} than the model asked for",
            hint="[head] sense of the foot file, --foot-abc-deg of a robot, or the axes in the "
            "program; then move and measure again.",
            rms=_rms(holes.left + turned - tilt),
        )
    yield ReferenceCause(
        said="the references were measured before the move, or the head did not move",
        hint="measure after the move.",
        rms=_rms(holes.left - tilt),
    )


def _sensor_causes(model: NormalModel, holes: ProductionRecord) -> Iterator[ReferenceCause]:
    """Other orders of the columns, and one with the other sign."""
    truth = estimate_tilt(model, holes.clamps).tilt + holes.left
    sensors = len(model.foot.radius)
    stated = tuple(range(sensors))
    for k in stated:
        sign = np.where(np.arange(sensors) == k, -1.0, 1.0)
        yield ReferenceCause(
            said=f"sensor {k + 1} reads with the other sign",
            hint="turn the sign of its column, or its wiring.",
            rms=_rms(truth - _tilt_of(model, holes, holes.clamps.readings * sign)),
        )
    for order in permutations(stated) if sensors <= SHUFFLED else ():
        if order == stated:
            continue
        moved = ", ".join(
            f"column {p + 1} is sensor {k + 1}" for k, p in enumerate(order) if p != k
        )
        yield ReferenceCause(
            said=f"sensors are exchanged: {moved}",
            hint="exchange the columns, or the cables.",
            rms=_rms(truth - _tilt_of(model, holes, holes.clamps.readings[:, list(order)])),
        )


def _tilt_of(model: NormalModel, holes: ProductionRecord, readings: Array) -> Array:
    return estimate_tilt(model, replace(holes.clamps, readings=readings)).tilt
