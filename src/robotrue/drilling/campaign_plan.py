"""Clamps of a campaign (steps 2, 5 and 6): drawn at random, or by information gain.

Where the head's own A and B are to be causes of an error (a sag, an error of their zero), the
calibration plane has to face different ways: a plate at each of several attitudes, so that A and B
vary by themselves and not with the tilt alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.units import DEG
from robotrue.drilling.campaign import FORCE, HEIGHT, TURN, Conditions
from robotrue.drilling.drill_defaults import By, Position
from robotrue.drilling.head import Head, normal_from_tilt, rotation, tilt_from_normal
from robotrue.drilling.physics import signal_covariance, start
from robotrue.errors import ConfigurationError

FEWEST: Final = 15
"""Clamps below which no correction but the patent's five terms is well determined."""
CANDIDATES: Final = 600
"""Clamps a plan by information chooses from."""
WANTED: Final = 400
"""Clamps of production, by chance, whose uncertainty it brings down."""
SCATTER: Final = 2e-6
"""m, noise of a reading."""
ON_A_PLATE: Final = 5
"""Clamps below which a plate cannot be separated from the others."""
GRID: Final = 9
"""Attitudes of each axis that plates are chosen from."""
TURNS: Final = 30
"""Steps to the axes at which a plate is seen at a tilt; each takes the error down by the tilt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignPlan(Columns):
    """n clamps in the order they are made.

    Attributes:
        tilt: (n, 2) rad, to turn the head off the calibration plane by.
        force: (n,) N.
        height: (n,) m.
        plate: n names of the plates; empty names where one plane faces one way.
        axes: (n, 2) rad, A and B at the clamp as the machine counts them; NaN without plates.
    """

    tilt: Annotated[Array, Column("n 2", unit="rad")]
    force: Annotated[Array, Column("n", unit="N")]
    height: Annotated[Array, Column("n", unit="m")]
    plate: Annotated[tuple[str, ...], Column("n", fill="")] = ()
    axes: Annotated[Array, Column("n 2", unit="rad", nan=True, fill=np.nan)] = EMPTY

    def __len__(self) -> int:
        return len(self.force)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plates(Columns):
    """Attitudes of calibration plates, p of them.

    Attributes:
        axes: (p, 2) rad, A and B at which the spindle is square to each, right-handed.
        head: Of the machine.
    """

    axes: Annotated[Array, Column("p 2", unit="rad")]
    head: Head

    @property
    def shown(self) -> Array:
        """(p, 2) rad, A and B as the machine counts them."""
        return np.asarray(self.axes * np.asarray(self.head.sense))


def spread_plates(head: Head, count: int, limits: Array) -> Plates:
    """Returns plates over a range of A and B: its corners first, then where it is emptiest.

    Args:
        head: Of the machine.
        count: Plates.
        limits: (2, 2) rad, lowest and highest A and B as the machine counts them.

    Raises:
        ConfigurationError: Fewer plates than the axes that vary need, or no range.
    """
    limits = np.asarray(limits, dtype=np.float64)
    width = limits[:, 1] - limits[:, 0]
    varied = int(np.count_nonzero(width))
    if (width < 0.0).any() or not varied:
        raise ConfigurationError(
            "a plate that faces one way only: neither A nor B has a range, lowest first.",
            hint="--axis-a-deg -30,30",
        )
    if count <= varied:
        raise ConfigurationError(
            f"{count} plates over {varied} {'axis' if varied == 1 else 'axes'}, "
            f"at least {varied + 1} are needed.",
            hint="--plates 5",
        )
    line = np.linspace(0.0, 1.0, GRID)
    grid = np.array([(a, b) for a in line for b in line]) * (width > 0.0)
    chosen = [grid[0]]
    while len(chosen) < count:
        apart = np.linalg.norm(grid[:, None] - np.array(chosen), axis=-1).min(axis=1)
        chosen.append(grid[int(np.argmax(apart))])
    shown = limits[:, 0] + np.array(chosen) * width
    return Plates(axes=shown * np.asarray(head.sense), head=head)


def plan_campaign(
    count: int,
    *,
    forces: Array,
    heights: Array,
    largest: float,
    seed: int,
    by: By,
    plates: Plates | None = None,
) -> CampaignPlan:
    """Returns a campaign over every force and height, in random order.

    By chance, tilts are uniform within a disc and forces and heights go round. By information,
    each clamp is the candidate that brings the variance of the error down most, in the mean over
    clamps that production may make and by the prior of :mod:`robotrue.drilling.physics`.

    Args:
        count: Clamps.
        forces: (f,) N to clamp with.
        heights: (z,) m.
        largest: rad, largest tilt.
        seed: Of tilts and order.
        by: ``"chance"`` or ``"information"``.
        plates: That are clamped on one after the other, alike often; one plane without.

    Raises:
        ConfigurationError: Fewer than 15 clamps, or than five a plate, no force or height, a tilt
            that is not above 0.
    """
    forces, heights = np.unique(forces), np.unique(heights)
    if count < FEWEST:
        raise ConfigurationError(
            f"{count} clamps, at least {FEWEST} are needed.", hint=f"--clamps {4 * FEWEST}"
        )
    if not len(forces) or not len(heights) or not largest > 0.0 or (forces < 0.0).any():
        raise ConfigurationError(
            "a campaign needs forces not below 0 N, heights, and a largest tilt above 0 deg."
        )
    if plates is not None and count < ON_A_PLATE * len(plates.axes):
        raise ConfigurationError(
            f"{count} clamps on {len(plates.axes)} plates, at least {ON_A_PLATE} on each are "
            "needed.",
            hint=f"--clamps {4 * ON_A_PLATE * len(plates.axes)}",
        )
    random = np.random.default_rng(seed)
    if by == "chance":
        plan = _by_chance(count, forces, heights, largest, random, plates)
    else:
        plan = _by_information(count, forces, heights, largest, random, plates)
    order = random.permutation(count)
    if plates is None:
        return CampaignPlan(tilt=plan[order, :2], force=plan[order, 2], height=plan[order, 3])
    plan = plan[order[np.argsort(plan[order, 4], kind="stable")]]
    number = plan[:, 4].astype(int)
    axes = axes_at(plates.head, plates.axes[number], plan[:, :2])
    return CampaignPlan(
        tilt=plan[:, :2],
        force=plan[:, 2],
        height=plan[:, 3],
        plate=tuple(f"P{k + 1}" for k in number),
        axes=axes,
    )


def axes_at(head: Head, square: Array, tilt: Array) -> Array:
    """Returns A and B (n, 2) rad, as the machine counts them, that see a plate at a tilt.

    Args:
        head: Of the machine.
        square: (n, 2) rad, right-handed A and B at which the spindle is square to the plate.
        tilt: (n, 2) rad, of the plate in the spindle's frame.
    """
    normal = normal_from_tilt(head.order, square)
    axes = square - tilt
    for _ in range(TURNS):
        seen = np.einsum("nji,nj->ni", rotation(head.order, axes), normal)
        axes = axes + tilt_from_normal(head.order, seen) - tilt
    return np.asarray(axes * np.asarray(head.sense))


def _by_chance(
    count: int,
    forces: Array,
    heights: Array,
    largest: float,
    random: np.random.Generator,
    plates: Plates | None,
) -> Array:
    """(n, 7) tilt, force, height, number of the plate, A and B; one plate at 0 without plates."""
    grid = np.array([(f, z) for f in forces for z in heights])
    rows = grid[np.arange(count) % len(grid)]
    radius = largest * np.sqrt(random.uniform(size=count))
    turn = random.uniform(-np.pi, np.pi, count)
    square = np.zeros((1, 2)) if plates is None else plates.axes
    number = np.arange(count) % len(square)
    if plates is not None:  # forces and heights go round by themselves, not with the plates
        rows = rows[random.permutation(count)]
    tilt = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1)
    return np.column_stack([tilt, rows, number, square[number] - tilt])


def _by_information(
    count: int,
    forces: Array,
    heights: Array,
    largest: float,
    random: np.random.Generator,
    plates: Plates | None,
) -> Array:
    """(n, 7) as by chance, chosen one by one from such candidates, alike many of each plate."""
    candidates, wanted = (
        _by_chance(n, forces, heights, largest, random, plates) for n in (CANDIDATES, WANTED)
    )
    inputs: tuple[Position, ...] = () if plates is None else ("A", "B")
    theta = start(SCATTER, rest_alone=False, inputs=len(inputs))
    causes = _causes(np.concatenate([candidates, wanted]))
    spread = signal_covariance(theta, causes, causes, inputs)
    number = candidates[:, 4].astype(int)
    most = -(-count // (int(number.max()) + 1))
    noise = float(np.exp(2.0 * np.log(SCATTER)))
    chosen: list[int] = []
    for _ in range(count):
        own = np.diagonal(spread)[:CANDIDATES] + noise
        gain = np.sum(spread[CANDIDATES:, :CANDIDATES] ** 2, axis=0) / own
        full = np.bincount(number[chosen], minlength=int(number.max()) + 1) >= most
        best = int(np.argmax(np.where(full[number], -1.0, gain)))
        spread = spread - np.outer(spread[best], spread[best]) / own[best]
        chosen.append(best)
    return candidates[chosen]


def _causes(rows: Array) -> Conditions:
    return Conditions(
        a=rows[:, 0] / DEG,
        b=rows[:, 1] / DEG,
        force=rows[:, 2] / FORCE,
        height=rows[:, 3] / HEIGHT,
        axis_a=rows[:, 5] / TURN,
        axis_b=rows[:, 6] / TURN,
    )
