"""A paper's printed numbers beside those of simulated arms: the nouns of every reproduction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, frozen

Progress: TypeAlias = Callable[[str, int, int], None]
"""Told what is done, how many steps are behind, and of how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One printed number and what the simulated arms have in its place.

    Attributes:
        table: Of the paper, or a word for what it does not tabulate.
        name: Row of the table.
        quantity: Column.
        unit: As printed; empty for a pure number.
        paper: The printed number; None where the paper has none.
        ours: (robots,) one value for each arm; one value where arms do not matter.
    """

    table: str
    name: str
    quantity: str
    unit: str
    paper: float | None
    ours: Array

    def __post_init__(self) -> None:
        """Checks and freezes."""
        object.__setattr__(self, "ours", frozen(self.ours, (None,), self.name))

    @property
    def median(self) -> float:
        """Median over the arms."""
        return float(np.median(self.ours))

    @property
    def quartiles(self) -> tuple[float, float]:
        """Quarter and three-quarter points over the arms."""
        low, high = np.percentile(self.ours, [25.0, 75.0])
        return float(low), float(high)

    @property
    def range90(self) -> tuple[float, float]:
        """5 % and 95 % points over the arms."""
        low, high = np.percentile(self.ours, [5.0, 95.0])
        return float(low), float(high)

    def document(self) -> dict[str, Any]:
        """Returns JSON values."""
        low, high = self.quartiles
        bottom, top = self.range90
        return {
            "table": self.table,
            "name": self.name,
            "quantity": self.quantity,
            "unit": self.unit,
            "paper": self.paper,
            "median": self.median,
            "quartile_low": low,
            "quartile_high": high,
            "p05": bottom,
            "p95": top,
            "robots": len(self.ours),
        }


def single(
    table: str, name: str, quantity: str, unit: str, paper: float | None, value: float
) -> Figure:
    """Returns a figure of one value, where arms do not matter; arguments as of :class:`Figure`."""
    return Figure(
        table=table,
        name=name,
        quantity=quantity,
        unit=unit,
        paper=paper,
        ours=np.array([float(value)]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """All figures.

    Attributes:
        scenario: What kind of arms.
        robots: Number of simulated arms.
        figures: In the order of the tables.
        unmet: What cannot be met, and why.
        remarks: How to read the tables.
        source: The paper.
    """

    scenario: str
    robots: int
    figures: tuple[Figure, ...]
    unmet: tuple[tuple[str, str], ...] = ()
    remarks: tuple[str, ...] = ()
    source: str = ""

    def document(self) -> dict[str, Any]:
        """Returns JSON values."""
        return {
            "simulated": True,
            "source": self.source,
            "scenario": self.scenario,
            "robots": self.robots,
            "figures": [f.document() for f in self.figures],
            "unmet": [{"what": what, "why": why} for what, why in self.unmet],
            "remarks": list(self.remarks),
        }
