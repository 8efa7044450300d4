"""The terms a reading's error is made of, as columns over clamps.

Angles count in degrees, force in kN and height in 100 mm, so that a coefficient is what the error
changes by over a usual step of its cause. All come from what the machine knows when it has to
turn: the tilt its uncorrected readings show, the clamp force and the height.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG
from robotrue.drilling.campaign import Clamps, tilt_seen
from robotrue.drilling.foot import Foot
from robotrue.drilling.head import AxisOrder

Family: TypeAlias = Literal["patent", "interactions", "quadratic", "cubic"]

FORCE: Final = 1000.0  # N, one unit of force
HEIGHT: Final = 0.1  # m, one unit of height


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions(Columns):
    """The causes of n clamps, in the units of this file.

    Attributes:
        a: (n,) deg, tilt about x as the uncorrected readings show it.
        b: (n,) deg, about y.
        force: (n,) kN.
        height: (n,) in 100 mm.
    """

    a: Annotated[Array, Column("_", unit="rad")]
    b: Annotated[Array, Column("_", unit="rad")]
    force: Annotated[Array, Column("_", unit="N")]
    height: Annotated[Array, Column("_", unit="m")]

    @property
    def table(self) -> Array:
        """(n, 4) a, b, force, height."""
        return np.stack([self.a, self.b, self.force, self.height], axis=-1)


def conditions(foot: Foot, order: AxisOrder, clamps: Clamps) -> Conditions:
    """Returns the causes that are known of each clamp.

    Raises:
        ShapeError: Not one reading per sensor.
    """
    tilt = tilt_seen(foot, order, clamps.readings) / DEG
    return Conditions(
        a=tilt[:, 0], b=tilt[:, 1], force=clamps.force / FORCE, height=clamps.height / HEIGHT
    )


def columns(family: Family, c: Conditions) -> tuple[tuple[str, ...], Array]:
    """Returns the names of a family's terms and their columns (n, p), the constant first.

    ``patent`` are the terms of the patent's step 7; ``interactions`` adds F a, F b and F^2;
    ``quadratic`` and ``cubic`` are all products of two and three.
    """
    named: list[tuple[str, Array]] = [("1", np.ones(len(c.a)))]
    single = [("a", c.a), ("b", c.b), ("F", c.force), ("z", c.height)]
    named += single
    if family == "interactions":
        named += [("F a", c.force * c.a), ("F b", c.force * c.b), ("F F", c.force**2)]
    if family in ("quadratic", "cubic"):
        named += _products(single, 2)
    if family == "cubic":
        named += _products(single, 3)
    return tuple(name for name, _ in named), np.stack([value for _, value in named], axis=-1)


def _products(single: list[tuple[str, Array]], degree: int) -> list[tuple[str, Array]]:
    """All products of ``degree`` of the single terms, repetition allowed."""
    return [
        (" ".join(name for name, _ in chosen), np.prod([value for _, value in chosen], axis=0))
        for chosen in combinations_with_replacement(single, degree)
    ]
