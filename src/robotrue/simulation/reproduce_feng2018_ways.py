"""Every way of registration on the same cells: step, its spread, the truth. Simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.errors import ConfigurationError
from robotrue.simulation.feng2018_cell import CellSizes
from robotrue.simulation.feng2018_ways import (
    Session,
    all_sides,
    as_drawn,
    frame_and_tip,
    frame_per_side,
    front,
    joint_estimate,
    probing_only,
    session,
    three_points,
    tool_not_refitted,
    tool_refitted,
    turned_as_drawn,
    turned_points,
    turned_three_points,
    with_spindle_askew,
)
from robotrue.simulation.slot_test import Side, cut_contour, cut_slots

Sides: TypeAlias = tuple[Side, Side]


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """One way to tie a program to the block.

    Attributes:
        name: Of the way.
        sides: From a session to the two sides as they are cut.
        cell: Kind of cell: ``plain``, ``askew`` (spindle), ``true tip`` or ``true arm``.
    """

    name: str
    sides: Callable[[Session], Sides]
    cell: str = "plain"


def _calibrated(s: Session) -> ErrorModel:
    if s.calibrated is None:
        raise ConfigurationError("the session has no calibrated model.")
    return s.calibrated


PAPER: Final = "3 points on the front, tip from CAD (the paper)"
DRAWN: Final = "as drawn, spindle askew"
CALIBRATED: Final = "calibrated, 30 points on 3 sides"
TOUCHES_30: Final = "touches alone, 30, one estimate"
TOUCHES_90: Final = "touches alone, 90, one estimate"
REFITTED: Final = "calibrated, tool changed, refitted with the touches"

WAYS: Final = (
    Way(name=DRAWN, sides=as_drawn, cell="askew"),
    Way(name=PAPER, sides=lambda s: three_points(s, s.nominal)),
    Way(name="the same, tip exact", sides=lambda s: three_points(s, s.nominal), cell="true tip"),
    Way(name="the same, arm exact", sides=lambda s: three_points(s, s.nominal), cell="true arm"),
    Way(name="20 points on the front", sides=lambda s: front(s, s.nominal)),
    Way(name="30 points on 3 sides, one frame", sides=lambda s: all_sides(s, s.nominal)),
    Way(name="a frame for each side, 10 + 10", sides=lambda s: frame_per_side(s, s.nominal)),
    Way(name="frame and tip, 30 points", sides=frame_and_tip),
    Way(name=TOUCHES_30, sides=probing_only),
    Way(name=TOUCHES_90, sides=lambda s: probing_only(s, 90)),
    Way(name="calibrated, 3 points", sides=lambda s: three_points(s, _calibrated(s))),
    Way(name=CALIBRATED, sides=lambda s: all_sides(s, _calibrated(s))),
    Way(
        name="calibrated, 30 points, one estimate",
        sides=lambda s: joint_estimate(s, _calibrated(s)),
    ),
    Way(
        name="calibrated, tool changed, not refitted",
        sides=lambda s: tool_not_refitted(s, _calibrated(s)),
    ),
    Way(name=REFITTED, sides=lambda s: tool_refitted(s, _calibrated(s))),
    Way(name="block turned, as drawn", sides=turned_as_drawn),
    Way(
        name="block turned, 3 points each time",
        sides=lambda s: turned_three_points(s, s.nominal),
    ),
    Way(name="block turned, 20 points each", sides=lambda s: turned_points(s, s.nominal)),
    Way(
        name="block turned, 20 points each, calibrated",
        sides=lambda s: turned_points(s, _calibrated(s)),
    ),
)
"""From the drawing to one estimate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WayResult:
    """One way in one cell, m.

    Attributes:
        mismatch: Mean size of the four steps.
        spread: Standard deviation between them.
        rms: True error of both sides.
        front: Of the first side.
        back: Of the second side.
        contour: Mean size of the step of the sculpture test.
        contour_worst: Its largest.
    """

    mismatch: float
    spread: float
    rms: float
    front: float
    back: float
    contour: float
    contour_worst: float


def results_of(
    seed: int,
    ways: tuple[Way, ...] = WAYS,
    *,
    method: str = "ripple",
    sizes: CellSizes | None = None,
) -> dict[str, WayResult]:
    """Returns the result of every way in the cell of a seed, by name.

    Args:
        seed: Of cell, touches, tracker and cutting.
        ways: Which.
        method: Of the calibration.
        sizes: Of the plain cell.
    """
    sessions: dict[str, Session] = {}
    out: dict[str, WayResult] = {}
    for way in ways:
        if way.cell not in sessions:
            sessions[way.cell] = _session(way.cell, seed, method, sizes)
        first, second = way.sides(sessions[way.cell])
        rng = np.random.default_rng([seed, 53])
        slots, body = cut_slots(first, second, rng), cut_contour(first, second, rng)
        front, back = slots.side_rms
        out[way.name] = WayResult(
            mismatch=slots.mismatch,
            spread=slots.evaluation.spread,
            rms=slots.rms,
            front=front,
            back=back,
            contour=body.mismatch,
            contour_worst=body.worst,
        )
    return out


def _session(kind: str, seed: int, method: str, sizes: CellSizes | None) -> Session:
    other: Mapping[str, Callable[[], Session]] = {
        "plain": lambda: session(seed, sizes=sizes, method=method),
        "askew": lambda: with_spindle_askew(seed),
        "true tip": lambda: session(seed, sizes=CellSizes(tip=0.0), method=None),
        "true arm": lambda: session(seed, sizes=CellSizes(arm=0.0), method=None),
    }
    return other[kind]()
