"""Contract of the data doctor's suspicions, and their findings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal, Protocol, TypeAlias

from robotrue.core.arrays import Array, IntArray
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.doctor_evidence import Evidence

CauseName: TypeAlias = Literal[
    "instrument-moved", "drift", "reflector", "scale", "payload", "one-direction",
    "joints-early", "clock", "shifted-rows", "joint-sign", "joint-turn", "joint-offset",
    "joints-exchanged", "preset", "duplicates", "stale-points", "outliers",
]  # fmt: skip
"""Names of causes, as ``--cure`` takes them."""
HOPELESS: Final = -3.0
"""Log Bayes factor of a cheap test below which a hypothesis is dropped."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """One way in which rows may be wrong, with what makes them right again.

    Attributes:
        cause: Its name.
        text: What is wrong, with numbers and units; no rows, no full stop.
        log_odds: Log Bayes factor against clean rows, its own freedom paid for.
        rows: (k,) rows of the whole set that are concerned; all if the whole file is.
        cure: Returns the whole set put right; None where the cure is outside the rows.
        robot: The robot put right, where that is the cure.
        columns: (n, 3, q) m, what the hypothesis adds to the examined rows, over its sd; None where
            ``log_odds`` rest on a fit of their own.
        price: Log of the choices that were made to find it, in ``log_odds`` already.
        revise: From coefficients (q,) of ``columns`` to the hypothesis that has them.
        refine: From cured rows, fitted anew, to the hypothesis that cures them better: an effect
            that is large is not linear. Its text, ``cure`` and ``refine`` replace those.
        advice: What to do in the shop, an imperative sentence.
    """

    cause: CauseName
    text: str
    log_odds: float
    rows: IntArray
    cure: Callable[[], MeasurementSet] | None
    advice: str
    robot: RobotModel | None = None
    columns: Array | None = None
    price: float = 0.0
    revise: Callable[[Array], Hypothesis] | None = None
    refine: Callable[[Evidence], Hypothesis | None] | None = None

    @cached_property
    def cured(self) -> MeasurementSet | None:
        """The whole set put right."""
        return None if self.cure is None else self.cure()


class DataSuspicion(Protocol):
    """A group of causes that are looked for together."""

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the likeliest hypotheses of this group, by cheap tests.

        Args:
            residuals: The examined rows under "clean", with their case.
        """
        ...


def move_points(rows: MeasurementSet, shift: Array) -> MeasurementSet:
    """Returns rows with positions (n, 3) m moved by ``-shift``."""
    return replace(rows, position=rows.position - shift)
