"""Sums over the targets of a compensation, made whole or in parts.

Counts, largest values and lines are those of the whole program; a mean is that of the whole to
rounding, since a sum of sums is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from robotrue.compensation.row_notes import RowNote, merge_notes
from robotrue.compensation.stance import Stance
from robotrue.compensation.status import Status
from robotrue.compensation.steps import Steps, joined
from robotrue.core.arrays import Array, IntArray

SIZES: Final = (
    "predicted_error_before_um",
    "predicted_error_after_um",
    "correction_um",
    "correction_deg",
    "predicted_sigma_um",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Sums over some targets.

    Attributes:
        status: (number of statuses,) targets of each :class:`Status`.
        total: (5,) sums over the compensated targets, in the order and units of ``SIZES``.
        largest: (5,) largest values.
        sigma: Whether the last of them is known.
        notes: What is to be said of targets.
        stance: How the arm stands at the first target of the program, where it is among them.
        steps: Between targets left alone and compensated ones.
    """

    status: IntArray
    total: Array
    largest: Array
    sigma: bool
    notes: tuple[RowNote, ...]
    steps: Steps
    stance: Stance | None = None

    def counts(self) -> dict[str, int]:
        """Returns how many targets there are of each status, by lower-case name, zeros left out."""
        return {s.name.lower(): int(self.status[s]) for s in Status if self.status[s]}

    def summary(self) -> Mapping[str, Any]:
        """Returns JSON values: counts, predicted error before and after, size of the correction."""
        done = int(self.status[Status.COMPENSATED])
        count = int(self.status.sum())
        out: dict[str, Any] = {
            "targets": count,
            "compensated": done,
            "unchanged": count - done,
            "status": self.counts(),
        }
        for name, total, largest in zip(
            SIZES, self.total.tolist(), self.largest.tolist(), strict=True
        ):
            if name != SIZES[-1] or self.sigma:
                out[name] = {"mean": total / done, "max": largest} if done else None
        if self.stance is not None:
            out["configuration"] = self.stance.document()
        return {**out, "notes": [str(note) for note in self.notes]}


def sum_tallies(parts: Iterable[Tally]) -> Tally:
    """Returns the sums over all parts of a program, given in file order."""
    status = np.zeros(len(Status), np.int64)
    total, largest, sigma = np.zeros(len(SIZES)), np.zeros(len(SIZES)), False
    notes: tuple[RowNote, ...] = ()
    stance = None
    steps = Steps()
    for part in parts:
        status += part.status
        total += part.total
        largest = np.maximum(largest, part.largest)
        sigma |= part.sigma
        notes = merge_notes([*notes, *part.notes])
        stance = stance or part.stance
        steps = joined([steps, part.steps])
    return Tally(
        status=status,
        total=total,
        largest=largest,
        sigma=sigma,
        notes=notes,
        steps=steps,
        stance=stance,
    )
