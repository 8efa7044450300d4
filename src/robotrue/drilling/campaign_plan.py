"""Which clamps a campaign makes (steps 2, 5 and 6): by chance, or by what they would tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG
from robotrue.drilling.campaign import FORCE, HEIGHT, Conditions
from robotrue.drilling.drill_defaults import By
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


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignPlan(Columns):
    """n clamps in the order they are made.

    Attributes:
        tilt: (n, 2) rad, to turn the head off the calibration plane by.
        force: (n,) N.
        height: (n,) m.
    """

    tilt: Annotated[Array, Column("n 2", unit="rad")]
    force: Annotated[Array, Column("n", unit="N")]
    height: Annotated[Array, Column("n", unit="m")]

    def __len__(self) -> int:
        return len(self.force)


def plan_campaign(
    count: int, *, forces: Array, heights: Array, largest: float, seed: int, by: By
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

    Raises:
        ConfigurationError: Fewer than 15 clamps, no force or height, a tilt that is not above 0.
    """
    forces, heights = np.unique(forces), np.unique(heights)
    if count < FEWEST:
        raise ConfigurationError(
            f"{count} clamps, at least {FEWEST} are needed.", hint=f"--count {4 * FEWEST}"
        )
    if not len(forces) or not len(heights) or not largest > 0.0 or (forces < 0.0).any():
        raise ConfigurationError(
            "a campaign needs forces not below 0 N, heights, and a largest tilt above 0 deg."
        )
    random = np.random.default_rng(seed)
    if by == "chance":
        plan = _by_chance(count, forces, heights, largest, random)
    else:
        plan = _by_information(count, forces, heights, largest, random)
    order = random.permutation(count)
    return CampaignPlan(tilt=plan[order, :2], force=plan[order, 2], height=plan[order, 3])


def _by_chance(
    count: int, forces: Array, heights: Array, largest: float, random: np.random.Generator
) -> Array:
    """(n, 4) tilt, force, height."""
    grid = np.array([(f, z) for f in forces for z in heights])
    rows = grid[np.arange(count) % len(grid)]
    radius = largest * np.sqrt(random.uniform(size=count))
    turn = random.uniform(-np.pi, np.pi, count)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rows])


def _by_information(
    count: int, forces: Array, heights: Array, largest: float, random: np.random.Generator
) -> Array:
    """(n, 4), chosen one by one from candidates by chance."""
    candidates, wanted = (
        _by_chance(n, forces, heights, largest, random) for n in (CANDIDATES, WANTED)
    )
    theta = start(SCATTER, rest_alone=False)
    causes = _causes(np.concatenate([candidates, wanted]))
    spread = signal_covariance(theta, causes, causes)
    noise = float(np.exp(2.0 * theta[-1]))
    chosen: list[int] = []
    for _ in range(count):
        own = np.diagonal(spread)[:CANDIDATES] + noise
        gain = np.sum(spread[CANDIDATES:, :CANDIDATES] ** 2, axis=0) / own
        best = int(np.argmax(gain))
        spread = spread - np.outer(spread[best], spread[best]) / own[best]
        chosen.append(best)
    return candidates[chosen]


def _causes(rows: Array) -> Conditions:
    return Conditions(
        a=rows[:, 0] / DEG, b=rows[:, 1] / DEG, force=rows[:, 2] / FORCE, height=rows[:, 3] / HEIGHT
    )
