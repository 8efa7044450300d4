"""Every way of registration on the same cells: step, its spread, the truth. Simulated."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.errors import ConfigurationError
from robotrue_reproductions.feng2018.machining_cell import CellSizes
from robotrue_reproductions.feng2018.registration_ways import (
    Session,
    all_sides,
    as_drawn,
    frame_and_tip,
    frame_per_side,
    front,
    joint_estimate,
    probing_only,
    probing_planned,
    session,
    three_points,
    tool_not_refitted,
    tool_refitted,
    tool_refitted_planned,
    turned_as_drawn,
    turned_points,
    turned_three_points,
    with_spindle_askew,
)
from robotrue_reproductions.feng2018.slot_experiment import (
    ContourResult,
    SlotResult,
    SlotSide,
    cut_contour,
    cut_slots,
)

Sides: TypeAlias = tuple[SlotSide, SlotSide]


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationWay:
    """One way to tie a program to the block.

    Attributes:
        key: Short word for it.
        name: Of the way.
        sides: From a session to the two sides as they are cut.
        cell: Kind of cell: ``plain``, ``askew`` (spindle), ``true tip`` or ``true arm``.
    """

    key: str
    name: str
    sides: Callable[[Session], Sides]
    cell: str = "plain"


def require_calibrated(s: Session) -> ErrorModel:
    """Returns the session's calibrated model.

    Raises:
        ConfigurationError: It had no tracker.
    """
    if s.calibrated is None:
        raise ConfigurationError("the session has no calibrated model.")
    return s.calibrated


PAPER: Final = "3 points on the front, tip from CAD (the paper)"
DRAWN: Final = "as drawn, spindle askew"
CALIBRATED: Final = "calibrated, 30 points on 3 sides"
TOUCHES_30: Final = "touches alone, 30 at random, one estimate"
TOUCHES_90: Final = "touches alone, 90 at random, one estimate"
PLANNED_30: Final = "touches alone, 30 planned, one estimate"
PLANNED_90: Final = "touches alone, 90 planned, one estimate"
REFITTED: Final = "calibrated, tool changed, 30 touches at random refit it"
REFITTED_PLANNED: Final = "calibrated, tool changed, 30 planned touches refit it"

WAYS: Final = (
    RegistrationWay(key="drawn", name=DRAWN, sides=as_drawn, cell="askew"),
    RegistrationWay(key="paper", name=PAPER, sides=lambda s: three_points(s, s.nominal)),
    RegistrationWay(
        key="tip-exact",
        name="the same, tip exact",
        sides=lambda s: three_points(s, s.nominal),
        cell="true tip",
    ),
    RegistrationWay(
        key="arm-exact",
        name="the same, arm exact",
        sides=lambda s: three_points(s, s.nominal),
        cell="true arm",
    ),
    RegistrationWay(
        key="front", name="20 points on the front", sides=lambda s: front(s, s.nominal)
    ),
    RegistrationWay(
        key="one-frame",
        name="30 points on 3 sides, one frame",
        sides=lambda s: all_sides(s, s.nominal),
    ),
    RegistrationWay(
        key="per-side",
        name="a frame for each side, 10 + 10",
        sides=lambda s: frame_per_side(s, s.nominal),
    ),
    RegistrationWay(key="frame-tip", name="frame and tip, 30 points", sides=frame_and_tip),
    RegistrationWay(key="touches-30", name=TOUCHES_30, sides=probing_only),
    RegistrationWay(key="touches-90", name=TOUCHES_90, sides=lambda s: probing_only(s, 90)),
    RegistrationWay(key="planned-30", name=PLANNED_30, sides=probing_planned),
    RegistrationWay(key="planned-90", name=PLANNED_90, sides=lambda s: probing_planned(s, 90)),
    RegistrationWay(
        key="calibrated-3",
        name="calibrated, 3 points",
        sides=lambda s: three_points(s, require_calibrated(s)),
    ),
    RegistrationWay(
        key="calibrated", name=CALIBRATED, sides=lambda s: all_sides(s, require_calibrated(s))
    ),
    RegistrationWay(
        key="joint",
        name="calibrated, 30 points, one estimate",
        sides=lambda s: joint_estimate(s, require_calibrated(s)),
    ),
    RegistrationWay(
        key="changed",
        name="calibrated, tool changed, not refitted",
        sides=lambda s: tool_not_refitted(s, require_calibrated(s)),
    ),
    RegistrationWay(
        key="refitted", name=REFITTED, sides=lambda s: tool_refitted(s, require_calibrated(s))
    ),
    RegistrationWay(
        key="refitted-planned",
        name=REFITTED_PLANNED,
        sides=lambda s: tool_refitted_planned(s, require_calibrated(s)),
    ),
    RegistrationWay(key="turned-drawn", name="block turned, as drawn", sides=turned_as_drawn),
    RegistrationWay(
        key="turned-3",
        name="block turned, 3 points each time",
        sides=lambda s: turned_three_points(s, s.nominal),
    ),
    RegistrationWay(
        key="turned",
        name="block turned, 20 points each",
        sides=lambda s: turned_points(s, s.nominal),
    ),
    RegistrationWay(
        key="turned-calibrated",
        name="block turned, 20 points each, calibrated",
        sides=lambda s: turned_points(s, require_calibrated(s)),
    ),
)
"""From the drawing to one estimate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WayResult:
    """One way, cut in one cell; lengths in m.

    Attributes:
        way: Which.
        slots: The slot test.
        outline: The sculpture test.
    """

    way: RegistrationWay
    slots: SlotResult
    outline: ContourResult

    @property
    def mismatch(self) -> float:
        """Mean size of the four steps."""
        return self.slots.mismatch

    @property
    def spread(self) -> float:
        """Standard deviation between them."""
        return self.slots.evaluation.spread

    @property
    def rms(self) -> float:
        """True error of both sides."""
        return self.slots.rms

    @property
    def front(self) -> float:
        """True error of the first side."""
        return self.slots.side_rms[0]

    @property
    def back(self) -> float:
        """True error of the second side."""
        return self.slots.side_rms[1]

    @property
    def contour(self) -> float:
        """Mean size of the step of the sculpture test."""
        return self.outline.mismatch

    @property
    def contour_worst(self) -> float:
        """Its largest."""
        return self.outline.worst


def results_of(
    seed: int,
    ways: tuple[RegistrationWay, ...] = WAYS,
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
    sessions = sessions_of(seed, ways, method=method, sizes=sizes)
    return {way.name: cut_way(way, sessions[way.cell], seed) for way in ways}


def cut_way(way: RegistrationWay, touched: Session, seed: int) -> WayResult:
    """Returns a way cut in the cell of a session; ``seed`` is that of the cutting."""
    first, second = way.sides(touched)
    rng = np.random.default_rng([seed, 53])
    slots = cut_slots(first, second, rng)
    return WayResult(way=way, slots=slots, outline=cut_contour(first, second, rng))


def sessions_of(
    seed: int,
    ways: Iterable[RegistrationWay] = WAYS,
    *,
    method: str = "ripple",
    sizes: CellSizes | None = None,
) -> dict[str, Session]:
    """Returns the sessions of ways, by their ``cell``; arguments as above."""
    kinds: dict[str, Callable[[], Session]] = {
        "plain": lambda: session(seed, sizes=sizes, method=method),
        "askew": lambda: with_spindle_askew(seed),
        "true tip": lambda: session(seed, sizes=CellSizes(tip=0.0), method=None),
        "true arm": lambda: session(seed, sizes=CellSizes(arm=0.0), method=None),
    }
    return {kind: kinds[kind]() for kind in dict.fromkeys(way.cell for way in ways)}
