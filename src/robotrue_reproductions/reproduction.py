"""Numbers of a source next to those of simulated arms: the nouns of every reproduction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with the starting step, the number of finished steps, and the total."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure(Columns):
    """One printed number and what the simulated arms have in its place.

    Attributes:
        table: Of the source, or a word for what it does not tabulate.
        name: Row of the table.
        quantity: Column.
        unit: As printed; empty for a pure number.
        paper: The printed number; None where the source has none.
        ours: (robots,) one value for each arm; one value where arms do not matter.
    """

    table: str
    name: str
    quantity: str
    unit: str
    paper: float | None
    ours: Annotated[Array, Column("n")]

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

    def document(self) -> dict[str, object]:
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


def figure(
    table: str, name: str, quantity: str, unit: str, paper: float | None, values: ArrayLike
) -> Figure:
    """Returns a figure of one value or of one for each arm; arguments as of :class:`Figure`."""
    ours = np.atleast_1d(np.asarray(values, dtype=np.float64))
    return Figure(table=table, name=name, quantity=quantity, unit=unit, paper=paper, ours=ours)


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

    def document(self) -> dict[str, object]:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ReproductionRequest:
    """Scope of a reproduction.

    Attributes:
        robots: Simulated arms, seeds 1, 2, ...
        quick: Only a part of the tables; each source states which.
        scenario: Level of the arms of ``deng2022``; the others have one kind.
    """

    robots: int = 20
    quick: bool = False
    scenario: str = "S2A"

    def __post_init__(self) -> None:
        """Checks the number of arms.

        Raises:
            ConfigurationError: Below one.
        """
        if self.robots < 1:
            raise ConfigurationError(f"{self.robots} robots, expected 1 or more; 20 for a spread.")

    @property
    def seeds(self) -> range:
        """Seeds of the arms."""
        return range(1, self.robots + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLayout:
    """How the figures of one table are printed.

    Attributes:
        title: Above the table.
        decimals: Of a table with one row for each figure.
        compares: Whether the printed number is shown there.
        beside: Word for the printed number in a table with one column for each quantity; empty:
            one row for each figure.
    """

    title: str
    decimals: int = 3
    compares: bool = True
    beside: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """A source that can be repeated.

    Attributes:
        authors: With the year.
        arms: What is simulated, in front of the scenario.
        tables: Layouts by table, in the order printed.
        run: Repeats it.
    """

    authors: str
    arms: str
    tables: Mapping[str, TableLayout]
    run: Callable[[ReproductionRequest, Progress], Reproduction]
